//! Time-optimal path parameterisation by reachability analysis (Pham and Pham 2018).

use crate::cells::{Cell, End, Room};
use crate::{ArmDynamics, JOINTS, Limits};

/// Number of rows per point: acceleration and torque of each joint in both directions.
const ROWS: usize = 4 * JOINTS;

/// Share of a limit that is less than the rounding of the others.
const NEGLIGIBLE: f64 = 1e-12;

/// Limits at one place, per row: by_speed·ṡ² + by_acceleration·s̈ ≤ limit.
struct Rows {
    by_speed: [f64; ROWS],
    by_acceleration: [f64; ROWS],
    limit: [f64; ROWS],
}

/// Returns the vertices (parameter, squared speed) of the fastest law from rest to rest along the cells. Squared speeds
/// are at most `caps`; accelerations and torques are at most `shares` of their limits.
///
/// The parameter's acceleration s̈ is constant from each place to the next one, so ṡ² is linear between them.
pub(crate) fn fastest(
    cells: &[Cell],
    caps: &[f64],
    shares: &[f64],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Vec<(f64, f64)>, String> {
    let places: Vec<f64> = cells.iter().map(|c| c.from).chain(cells.last().map(|c| c.to)).collect();
    let count = places.len();
    // Lower of the caps on both sides of a point.
    let cap = |i: usize| {
        let (left, right) = (caps[i.saturating_sub(1)], caps[i.min(count - 2)]);
        left.min(right).clamp(1e-18, 1e18)
    };
    let step = |(i, cell): (usize, &Cell)| {
        let rows = |end: usize| Rows::new(&cell.ends[end], shares[i], cap(i + end), limits, arm);
        Step::new([rows(0), rows(1)], cap(i), cell.to - cell.from)
    };
    let steps: Vec<Step> = cells.iter().enumerate().map(step).collect();
    let squares = along_the_steps(&steps);
    if squares[1..count - 1].iter().any(|square| !(*square > 0.0 && square.is_finite())) {
        return Err("the speed along the path is 0 at a place without a stop".into());
    }
    Ok(places.into_iter().zip(squares).collect())
}

/// Returns the largest squared speeds at the ends of the steps, from rest to rest.
fn along_the_steps(steps: &[Step]) -> Vec<f64> {
    // Backward: the largest squared speed at each place from which the rest of the path can be followed. Each smaller one is possible,
    // too, because rest is possible everywhere and the limits are linear in ṡ² and s̈.
    let mut highest = vec![0.0; steps.len() + 1];
    for (i, step) in steps.iter().enumerate().rev() {
        highest[i] = step.highest(highest[i + 1]);
    }
    // Forward: the largest acceleration at each place.
    let mut squares = vec![0.0; steps.len() + 1];
    for (i, step) in steps.iter().enumerate() {
        let next = squares[i] + 2.0 * step.length * step.most(squares[i]).0;
        squares[i + 1] = next.clamp(0.0, highest[i + 1]);
    }
    squares
}

/// Bound of s̈ that is linear in ṡ²: at + by·ṡ².
#[derive(Clone, Copy)]
struct Line {
    at: f64,
    by: f64,
}

/// Limits of ṡ² and s̈ on the way from a place to the next one.
struct Step {
    /// Length of the step, in the unit of the parameter.
    length: f64,
    /// Largest ṡ² at the place.
    cap: f64,
    /// Upper bounds of s̈.
    upper: Vec<Line>,
    /// Lower bounds of s̈.
    lower: Vec<Line>,
}

impl Step {
    /// Makes the step between two places with these rows. At the second place ṡ² is larger by 2·length·s̈.
    fn new(rows: [Rows; 2], mut cap: f64, length: f64) -> Self {
        let (mut upper, mut lower) = (Vec::new(), Vec::new());
        for (rows, added) in rows.iter().zip([0.0, 2.0 * length]) {
            for row in 0..ROWS {
                let (by_speed, limit) = (rows.by_speed[row], rows.limit[row]);
                let by_acceleration = rows.by_acceleration[row] + added * by_speed;
                if !limit.is_finite() {
                    continue;
                }
                // A share of s̈ that is lost in rounding: the row limits ṡ² alone.
                if by_acceleration.abs() * cap <= NEGLIGIBLE * length * limit {
                    cap = if by_speed > 0.0 { cap.min(limit / by_speed) } else { cap };
                    continue;
                }
                let bounds = if by_acceleration > 0.0 { &mut upper } else { &mut lower };
                bounds.push(Line { at: limit / by_acceleration, by: -by_speed / by_acceleration });
            }
        }
        Self { length, cap, upper, lower }
    }

    /// Returns the largest s̈ at this ṡ², and its bound. With an infinite s̈, no bound exists.
    fn most(&self, square: f64) -> (f64, Line) {
        let none = (f64::INFINITY, Line { at: f64::INFINITY, by: 0.0 });
        self.upper
            .iter()
            .map(|line| (line.at + line.by * square, *line))
            .fold(none, |a, b| if b.0 < a.0 { b } else { a })
    }

    /// Returns the smallest s̈ at this ṡ², and its bound.
    fn least(&self, square: f64) -> (f64, Line) {
        let none = (f64::NEG_INFINITY, Line { at: f64::NEG_INFINITY, by: 0.0 });
        self.lower
            .iter()
            .map(|line| (line.at + line.by * square, *line))
            .fold(none, |a, b| if b.0 > a.0 { b } else { a })
    }

    /// Returns the largest ṡ² from which a possible s̈ leads to at most `next` and at least 0 at the next place.
    ///
    /// The difference of the largest and the smallest s̈ is a concave function of ṡ², and not negative at 0. So Newton's method from the cap
    /// downwards ends at its zero after at most one iteration per pair of bounds.
    fn highest(&self, next: f64) -> f64 {
        let slope = -0.5 / self.length;
        let (to_next, to_rest) = (Line { at: -slope * next, by: slope }, Line { at: 0.0, by: slope });
        let mut square = self.cap;
        for _ in 0..self.upper.len() + self.lower.len() {
            let at = |line: Line| (line.at + line.by * square, line);
            let (most, least) = (self.most(square), self.least(square));
            let most = if at(to_next).0 < most.0 { at(to_next) } else { most };
            let least = if at(to_rest).0 > least.0 { at(to_rest) } else { least };
            if most.0 >= least.0 {
                break;
            }
            let crossing = (most.1.at - least.1.at) / (least.1.by - most.1.by);
            // Rounding must not lead upwards.
            square = crossing.clamp(0.0, square);
        }
        square
    }
}

impl Rows {
    fn new(end: &End, share: f64, cap: f64, limits: &Limits, arm: Option<&ArmDynamics>) -> Self {
        let mut rows =
            Self { by_speed: [0.0; ROWS], by_acceleration: [0.0; ROWS], limit: [f64::INFINITY; ROWS] };
        let mut put = |row: usize, by_speed: f64, by_acceleration: f64, high: f64, low: f64| {
            for (row, sign, limit) in [(row, 1.0, high), (row + JOINTS, -1.0, low)] {
                rows.by_speed[row] = sign * by_speed;
                rows.by_acceleration[row] = sign * by_acceleration;
                rows.limit[row] = limit;
            }
        };
        for j in 0..JOINTS {
            let limit = share * limits.acceleration[j];
            put(j, end.point.second[j], end.point.first[j], limit, limit);
        }
        if let (Some(loads), Some(arm)) = (&end.loads, arm) {
            let room = Room::new(end, loads, cap, limits, arm);
            for j in 0..JOINTS {
                let least = 1e-3 * limits.torque[j];
                let (high, low) = ((share * room.high[j]).max(least), (share * room.low[j]).max(least));
                put(2 * JOINTS + j, loads.speed[j], loads.mass[j], high, low);
            }
        }
        rows
    }
}
