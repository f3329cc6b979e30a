//! Fastest time law with limited speed and acceleration of the path parameter, but without a jerk limit. Each limit
//! is constant in each cell of the path.
//!
//! The law may later be averaged over a time window. To keep the limits of a cell after averaging, the law must keep
//! them also for half a window before and after the cell. Cells are therefore extended at both ends.
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Limits of the speed and acceleration of the path parameter in one interval of a section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub from: f64,
    pub to: f64,
    /// Highest squared speed of the parameter.
    pub cap: f64,
    /// Highest acceleration of the parameter.
    pub up: f64,
    /// Highest deceleration of the parameter, greater than 0.
    pub down: f64,
}

impl Bounds {
    /// Returns the bounds extended at both ends by the distance covered in half a window at the highest speed of these
    /// bounds.
    fn widened(&self, window: f64, end: f64) -> Self {
        let reach = 0.5 * window * self.cap.sqrt();
        Self { from: (self.from - reach).max(0.0), to: (self.to + reach).min(end), ..*self }
    }
}

/// Returns the vertices (parameter, squared speed) of the fastest law from rest to rest. Between two vertices, the
/// squared speed is linear. Each maximum of the speed lasts for `window` seconds.
pub(crate) fn fastest(cells: &[Bounds], window: f64) -> Vec<(f64, f64)> {
    let end = cells.last().map_or(0.0, |c| c.to);
    let widened: Vec<Bounds> = cells.iter().map(|c| c.widened(window, end)).collect();
    let parts = lowest(&widened);
    let nodes = speeds(&parts);
    let vertices = vertices(&parts, &nodes);
    if window > 0.0 { crate::plateau::flattened(&vertices, window) } else { vertices }
}

/// Returns a sorting key. The bits of non-negative floating-point numbers have the same order as the numbers.
fn key(x: f64) -> u64 {
    x.max(0.0).to_bits()
}

/// Splits the range into parts with constant limits, and returns the lowest limits in each part.
fn lowest(bounds: &[Bounds]) -> Vec<Bounds> {
    let mut order: Vec<usize> = (0..bounds.len()).collect();
    order.sort_by(|&a, &b| bounds[a].from.total_cmp(&bounds[b].from));
    let mut ends: Vec<f64> = bounds.iter().flat_map(|b| [b.from, b.to]).collect();
    ends.sort_by(f64::total_cmp);
    ends.dedup();
    let mut heaps: [BinaryHeap<Reverse<(u64, usize)>>; 3] = Default::default();
    let mut next = 0;
    let mut parts: Vec<Bounds> = Vec::with_capacity(ends.len());
    for pair in ends.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        while let Some(&i) = order.get(next).filter(|&&i| bounds[i].from <= from) {
            for (heap, value) in heaps.iter_mut().zip([bounds[i].cap, bounds[i].up, bounds[i].down]) {
                heap.push(Reverse((key(value), i)));
            }
            next += 1;
        }
        let [cap, up, down] = heaps.each_mut().map(|heap| {
            while heap.peek().is_some_and(|Reverse((_, i))| bounds[*i].to <= from) {
                heap.pop();
            }
            heap.peek().map_or(f64::INFINITY, |Reverse((bits, _))| f64::from_bits(*bits))
        });
        let part = Bounds { from, to, cap, up, down };
        match parts.last_mut() {
            Some(last) if (last.cap, last.up, last.down) == (cap, up, down) => last.to = to,
            _ => parts.push(part),
        }
    }
    parts
}

/// Returns the highest squared speeds at the ends of the parts. Each of these speeds can be reached from the start, and
/// permits a stop at the end of the path.
fn speeds(parts: &[Bounds]) -> Vec<f64> {
    let mut nodes = vec![0.0; parts.len() + 1];
    for (i, part) in parts.iter().enumerate() {
        let reached: f64 = nodes[i] + 2.0 * part.up * (part.to - part.from);
        let after = parts.get(i + 1).map_or(0.0, |next| next.cap);
        nodes[i + 1] = reached.min(part.cap).min(after);
    }
    for (i, part) in parts.iter().enumerate().rev() {
        nodes[i] = nodes[i].min(nodes[i + 1] + 2.0 * part.down * (part.to - part.from));
    }
    nodes
}

/// Returns the vertices of all parts. Each part consists of acceleration, constant speed if the cap is reached, and
/// deceleration.
fn vertices(parts: &[Bounds], nodes: &[f64]) -> Vec<(f64, f64)> {
    let mut vertices = vec![(0.0, 0.0)];
    for (part, pair) in parts.iter().zip(nodes.windows(2)) {
        let [a, b] = [pair[0], pair[1]];
        let length = part.to - part.from;
        let (up, down) = (2.0 * part.up, 2.0 * part.down);
        let peak_at = ((b - a + down * length) / (up + down)).clamp(0.0, length);
        let peak = a + up * peak_at;
        if peak > part.cap {
            vertices.push((part.from + ((part.cap - a) / up).clamp(0.0, length), part.cap));
            vertices.push((part.to - ((part.cap - b) / down).clamp(0.0, length), part.cap));
        } else {
            vertices.push((part.from + peak_at, peak));
        }
        vertices.push((part.to, b));
    }
    simplified(vertices)
}

/// Removes redundant vertices.
pub(crate) fn simplified(vertices: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::with_capacity(vertices.len());
    for (i, vertex) in vertices.iter().enumerate() {
        let last = i + 1 == vertices.len();
        while let [.., a, b] = kept[..] {
            let on_line = a.1 + (vertex.1 - a.1) * (b.0 - a.0) / (vertex.0 - a.0);
            let straight = (b.1 - on_line).abs() <= 1e-12 * (b.1 + on_line);
            if !(straight || b.0 - a.0 <= 1e-14 * vertex.0) || kept.len() < 2 {
                break;
            }
            kept.pop();
        }
        if last || kept.last().is_none_or(|k| vertex.0 > k.0) {
            kept.push(*vertex);
        }
    }
    kept
}
