//! Plateaus at the maxima of the speed. On a plateau, the acceleration is 0 for at least the length of the averaging
//! window. A window therefore never contains both the end of the acceleration and the start of the deceleration.
use crate::profile::simplified;

/// Replaces each maximum of the squared speed by a plateau that lasts for `window` seconds. A plateau may be shorter
/// only if it is as low as the lowest adjacent speed. `vertices` contains pairs of parameter and squared speed.
pub(crate) fn flattened(vertices: &[(f64, f64)], window: f64) -> Vec<(f64, f64)> {
    let mut walk = Walk { done: Vec::with_capacity(vertices.len()), ahead: vertices, next: 0 };
    while walk.next < vertices.len() {
        walk.done.push(vertices[walk.next]);
        walk.next += 1;
        let falls = vertices.get(walk.next).is_some_and(|v| v.1 < vertices[walk.next - 1].1);
        if falls {
            walk.lower(window);
        }
    }
    simplified(walk.done)
}

/// Processed vertices, and the vertices that follow.
struct Walk<'a> {
    done: Vec<(f64, f64)>,
    ahead: &'a [(f64, f64)],
    next: usize,
}

/// An interval with constant squared speed.
#[derive(Clone, Copy)]
struct Top {
    from: f64,
    to: f64,
    level: f64,
}

impl Top {
    fn lasts(&self) -> f64 {
        if self.level > 0.0 { (self.to - self.from) / self.level.sqrt() } else { f64::INFINITY }
    }

    /// Returns the plateau lowered to `level`. `left` and `right` are the vertices at which the sides of the plateau
    /// end.
    fn at(&self, level: f64, left: (f64, f64), right: (f64, f64)) -> Self {
        let side = |x: f64, foot: (f64, f64)| {
            let height = self.level - foot.1;
            if height > 0.0 { x + (foot.0 - x) * ((self.level - level) / height).min(1.0) } else { foot.0 }
        };
        Self { from: side(self.from, left), to: side(self.to, right), level }
    }
}

impl Walk<'_> {
    /// Lowers the speed maximum at the last processed vertex to a plateau.
    fn lower(&mut self, window: f64) {
        let Some((x, level)) = self.done.pop() else { return };
        let mut top = Top { from: x, to: x, level };
        self.join_left(&mut top);
        while let (Some(&left), Some(&right)) = (self.done.last(), self.ahead.get(self.next)) {
            if left.1 > top.level || right.1 > top.level || top.lasts() >= window {
                break;
            }
            let lowest = top.at(left.1.max(right.1), left, right);
            if lowest.lasts() >= window {
                top = enough(&top, lowest.level, left, right, window);
                break;
            }
            top = lowest;
            self.join_left(&mut top);
            while let Some(&(x, level)) = self.ahead.get(self.next)
                && level == top.level
            {
                top.to = x;
                self.next += 1;
            }
        }
        self.done.push((top.from, top.level));
        if top.to > top.from {
            self.done.push((top.to, top.level));
        }
    }

    fn join_left(&mut self, top: &mut Top) {
        while let Some(&(x, level)) = self.done.last()
            && level == top.level
        {
            top.from = x;
            self.done.pop();
        }
    }
}

/// Returns the highest plateau that lasts for `window` seconds. Its level is between `lowest` and the level of `top`.
fn enough(top: &Top, lowest: f64, left: (f64, f64), right: (f64, f64), window: f64) -> Top {
    let (mut low, mut high) = (lowest, top.level);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if top.at(middle, left, right).lasts() >= window { low = middle } else { high = middle }
    }
    top.at(low, left, right)
}
