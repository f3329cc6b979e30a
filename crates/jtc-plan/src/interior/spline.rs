//! Knots of a spline, and its time law.
use super::Problem;
use crate::law::{Law, Phase};

/// Largest relative change of the speed within a pair of phases. The next constant is the largest number of phase
/// pairs per cell.
const ALIKE: f64 = 0.2;
const PARTS_MAX: f64 = 4.0;

impl Problem<'_> {
    /// Returns the time law of a spline.
    pub(super) fn law(&self, c: &[f64]) -> Law {
        let cells = self.plan.cells;
        let spans = self.knots.len() - 1;
        // Parameter, speed and acceleration at each knot.
        let states: Vec<(f64, f64, f64)> = (0..=spans)
            .map(|k| {
                let i = k as isize;
                let at = |k: isize| knot(&self.knots, k);
                let width = at(i + 1) - at(i - 1);
                let b = (c[k] * (at(i + 1) - at(i)) + c[k + 1] * (at(i) - at(i - 1))) / width;
                (at(i), b.sqrt(), (c[k + 1] - c[k]) / width)
            })
            .collect();
        let mut phases: Vec<Phase> = Vec::with_capacity(2 * cells.len());
        let (_, speed, acceleration) = states[0];
        let mut start = 3.0 * cells[0].to / speed;
        phases.push(Phase { length: start, jerk: acceleration / start, ..Phase::default() });
        for pair in states.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            // A phase has a constant jerk, but the jerk of the spline grows with the speed. Therefore a large change of
            // speed is divided into several phase pairs.
            let parts = ((to.1 - from.1).abs() / (ALIKE * from.1.min(to.1))).ceil().clamp(1.0, PARTS_MAX);
            let mut before = from;
            for part in 1..=parts as usize {
                let after = if part as f64 == parts { to } else { between(from, to, part as f64 / parts) };
                start = phases_between(&mut phases, start, before, after);
                before = after;
            }
        }
        let (s, speed, acceleration) = states[spans];
        let length = 3.0 * (self.end - s) / speed;
        phases.push(Phase { start, length, s, speed, acceleration, jerk: -acceleration / length });
        Law { phases, end: self.end, rests: true }
    }
}

/// Returns parameter, speed and acceleration of a spline at a fraction of the cell between these two knots.
fn between(from: (f64, f64, f64), to: (f64, f64, f64), share: f64) -> (f64, f64, f64) {
    let way = share * (to.0 - from.0);
    let acceleration = from.2 + share * (to.2 - from.2);
    let square = from.1 * from.1 + way * (from.2 + acceleration);
    (from.0 + way, square.max(0.0).sqrt(), acceleration)
}

/// Adds two phases of equal length. The phases match the parameter, speed and acceleration of the spline at both ends. Returns the end
/// time.
fn phases_between(
    phases: &mut Vec<Phase>,
    start: f64,
    (s, v, a): (f64, f64, f64),
    (to, w, b): (f64, f64, f64),
) -> f64 {
    let (sum, way) = (v + w, to - s);
    let length = 2.0 * way / (sum + (sum * sum + 4.0 / 3.0 * way * (a - b)).max(0.0).sqrt());
    let middle = (w - v) / length - 0.5 * (a + b);
    let phase = Phase { start, length, s, speed: v, acceleration: a, jerk: (middle - a) / length };
    let (s, speed, acceleration) = phase.at(length);
    let start = start + length;
    phases.push(phase);
    phases.push(Phase { start, length, s, speed, acceleration, jerk: (b - middle) / length });
    start + length
}

/// Returns the knot with an index. If the index is out of range, returns the first or the last knot.
pub(super) fn knot(knots: &[f64], k: isize) -> f64 {
    knots[k.clamp(0, knots.len() as isize - 1) as usize]
}
