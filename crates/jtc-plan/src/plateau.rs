//! Plateaus at the maxima of the speed. Between acceleration and deceleration, the parameter's acceleration is 0 for
//! one averaging window. Therefore an averaging window never contains both changes of the acceleration.
use crate::profile::simplified;

/// Lowers every speed maximum of a law's `vertices` (parameter, squared speed). A lowered maximum lasts for `window` seconds, or is as low
/// as the lowest adjacent speed.
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

/// Vertices to the left and right of the current position.
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

    /// Returns the plateau lowered to `level`. The sides of the plateau end at `left` and `right`.
    fn at(&self, level: f64, left: (f64, f64), right: (f64, f64)) -> Self {
        let side = |x: f64, foot: (f64, f64)| {
            let height = self.level - foot.1;
            if height > 0.0 { x + (foot.0 - x) * ((self.level - level) / height).min(1.0) } else { foot.0 }
        };
        Self { from: side(self.from, left), to: side(self.to, right), level }
    }
}

impl Walk<'_> {
    /// Lowers the speed maximum that ends at the last processed vertex, if there is one.
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

/// Returns the highest plateau between the levels of `top` and `lowest` that lasts for the window.
fn enough(top: &Top, lowest: f64, left: (f64, f64), right: (f64, f64), window: f64) -> Top {
    let (mut low, mut high) = (lowest, top.level);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if top.at(middle, left, right).lasts() >= window { low = middle } else { high = middle }
    }
    top.at(low, left, right)
}
