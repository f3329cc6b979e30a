//! Time-optimal path parameterisation by reachability analysis (Pham and Pham 2018).
use crate::cells::{Cell, End, Room};
use crate::{ArmDynamics, JOINTS, Limits};

/// Number of rows per point: acceleration and torque of each joint in both directions.
const ROWS: usize = 4 * JOINTS;

/// Largest share of a limit that is neglected.
const NEGLIGIBLE: f64 = 1e-9;

/// Limits at one point of the path. Each row means by_speed·ṡ² + by_acceleration·s̈ ≤ limit.
struct Rows {
    by_speed: [f64; ROWS],
    by_acceleration: [f64; ROWS],
    limit: [f64; ROWS],
}

/// Returns the vertices (parameter, squared speed) of the fastest law from rest to rest along the cells. Squared speeds
/// are at most `caps`. Accelerations and torques are at most `shares` of their limits.
///
/// The parameter's acceleration s̈ is constant from each point to the next point, so ṡ² is linear between the two
/// points.
pub(crate) fn fastest(
    cells: &[Cell],
    caps: &[f64],
    shares: &[f64],
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Vec<(f64, f64)>, String> {
    let places: Vec<f64> = cells.iter().map(|c| c.from).chain(cells.last().map(|c| c.to)).collect();
    let count = places.len();
    // Returns the lower of the caps in the cells before and after point `i`.
    let cap = |i: usize| {
        let (left, right) = (caps[i.saturating_sub(1)], caps[i.min(count - 2)]);
        left.min(right).clamp(1e-18, 1e18)
    };
    let step = |(i, cell): (usize, &Cell)| {
        let rows = |end: usize| Rows::new(&cell.ends[end], shares[i], cap(i + end), limits, arm);
        Step::new([rows(0), rows(1)], [cap(i), cap(i + 1)], cell.to - cell.from)
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
    // The backward pass computes, for each point, the largest squared speed from which the remainder of the path is
    // possible. Smaller squared speeds are also possible, because rest is possible at each point and the limits are
    // linear in ṡ² and s̈.
    let mut highest = vec![0.0; steps.len() + 1];
    for (i, step) in steps.iter().enumerate().rev() {
        highest[i] = step.highest(highest[i + 1]);
    }
    // The forward pass uses the largest acceleration at each point.
    let mut squares = vec![0.0; steps.len() + 1];
    for (i, step) in steps.iter().enumerate() {
        let next = squares[i] + 2.0 * step.length * step.fastest(squares[i]);
        squares[i + 1] = next.max(0.0).min(highest[i + 1]);
    }
    squares
}

/// Bound of s̈ that is linear in ṡ², with the value start + slope·ṡ².
#[derive(Clone, Copy)]
struct Line {
    start: f64,
    slope: f64,
}

impl Line {
    /// Returns the bound at this ṡ².
    fn at(&self, square: f64) -> f64 {
        self.start + self.slope * square
    }
}

/// Limits of ṡ² and s̈ from one point of the path to the next point.
struct Step {
    /// Length of the step, in the unit of the parameter.
    length: f64,
    /// Largest ṡ² at the first point.
    cap: f64,
    /// Upper bounds of s̈.
    upper: Vec<Line>,
    /// Lower bounds of s̈.
    lower: Vec<Line>,
}

impl Step {
    /// Creates the step between two points with these rows and caps. At the second point, ṡ² is larger by 2·length·s̈.
    fn new(rows: [Rows; 2], caps: [f64; 2], length: f64) -> Self {
        // |s̈| is at most highest/(2·length), because ṡ² changes by at most `highest` within the step.
        let (mut cap, highest) = (caps[0], caps[0].max(caps[1]));
        let (mut upper, mut lower) = (Vec::new(), Vec::new());
        for (rows, added) in rows.iter().zip([0.0, 2.0 * length]) {
            for row in 0..ROWS {
                let (by_speed, limit) = (rows.by_speed[row], rows.limit[row]);
                let by_acceleration = rows.by_acceleration[row] + added * by_speed;
                if !limit.is_finite() {
                    continue;
                }
                let size = by_acceleration.abs();
                // A row with a negligible coefficient of s̈ limits only ṡ². The coefficient is negligible if its term
                // is much smaller than the limit. The coefficient is also negligible if its effect is equal to a shift
                // of the point by a very small part of the step.
                let negligible = size * highest <= NEGLIGIBLE * length * limit
                    || size <= NEGLIGIBLE * length * by_speed.abs();
                // Such a row permits a higher ṡ² at the first point only if the arm comes to rest within the step.
                // The row is therefore also used as a limit of ṡ² alone.
                let rests =
                    added == 0.0 && by_acceleration > 0.0 && by_acceleration <= 2.0 * length * by_speed;
                if (negligible || rests) && by_speed > 0.0 {
                    cap = cap.min(limit / by_speed);
                }
                if !negligible {
                    let bounds = if by_acceleration > 0.0 { &mut upper } else { &mut lower };
                    bounds.push(Line { start: limit / by_acceleration, slope: -by_speed / by_acceleration });
                }
            }
        }
        Self { length, cap, upper, lower }
    }

    /// Returns the upper bound of s̈ that is lowest at this ṡ². Returns `None` if s̈ has no upper bound.
    fn most(&self, square: f64) -> Option<Line> {
        self.upper.iter().copied().reduce(|a, b| if b.at(square) < a.at(square) { b } else { a })
    }

    /// Returns the lower bound of s̈ that is highest at this ṡ². Returns `None` if s̈ has no lower bound.
    fn least(&self, square: f64) -> Option<Line> {
        self.lower.iter().copied().reduce(|a, b| if b.at(square) > a.at(square) { b } else { a })
    }

    /// Returns the largest possible s̈ at this ṡ². Rounding errors can make the largest s̈ smaller than the smallest
    /// s̈. In this case the function uses the bound that depends less on ṡ², because it has the smaller rounding
    /// error.
    fn fastest(&self, square: f64) -> f64 {
        let Some(most) = self.most(square) else { return f64::INFINITY };
        let crossed =
            |least: &Line| most.at(square) < least.at(square) && least.slope.abs() < most.slope.abs();
        self.least(square).filter(crossed).unwrap_or(most).at(square)
    }

    /// Returns the largest ṡ² from which a possible s̈ results in a squared speed between 0 and `next` at the next point.
    ///
    /// The difference of the largest and the smallest s̈ is a concave function of ṡ², and not negative at 0. Therefore
    /// Newton's method from the cap finds the zero of this function after at most one iteration per bound.
    fn highest(&self, next: f64) -> f64 {
        if self.length <= 0.0 {
            return self.cap.min(next);
        }
        let slope = -0.5 / self.length;
        let (to_next, to_rest) = (Line { start: -slope * next, slope }, Line { start: 0.0, slope });
        let mut square = self.cap;
        for _ in 0..self.upper.len() + self.lower.len() + 2 {
            let most =
                self.most(square).filter(|most| most.at(square) <= to_next.at(square)).unwrap_or(to_next);
            let least =
                self.least(square).filter(|least| least.at(square) >= to_rest.at(square)).unwrap_or(to_rest);
            if most.at(square) >= least.at(square) {
                break;
            }
            let crossing = (most.start - least.start) / (least.slope - most.slope);
            if crossing >= square {
                // The remaining difference is smaller than the rounding error.
                break;
            }
            square = crossing.max(0.0);
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns rows with these values (coefficient of ṡ², coefficient of s̈, limit). The remaining rows have no limit.
    fn rows(given: &[(f64, f64, f64)]) -> Rows {
        let mut rows =
            Rows { by_speed: [0.0; ROWS], by_acceleration: [0.0; ROWS], limit: [f64::INFINITY; ROWS] };
        for (i, (by_speed, by_acceleration, limit)) in given.iter().enumerate() {
            (rows.by_speed[i], rows.by_acceleration[i], rows.limit[i]) =
                (*by_speed, *by_acceleration, *limit);
        }
        rows
    }

    /// Returns the rows of one joint with these derivatives of the path.
    fn joint(first: f64, second: f64, limit: f64) -> Rows {
        rows(&[(second, first, limit), (-second, -first, limit)])
    }

    #[test]
    fn a_bend_that_begins_suddenly_is_passed_without_a_stop() {
        let cap = |first: f64| (1.0 / first).powi(2);
        let straight = |first: f64| {
            Step::new([joint(first, 0.0, 1.0), joint(first, 0.0, 1.0)], [cap(first); 2], 1.0 / 16.0)
        };
        let bent = |i: usize| {
            let first = |i: usize| 0.05 + 0.2 * i as f64;
            let ends = [joint(first(i), 20.0, 1.0), joint(first(i + 1), 20.0, 1.0)];
            Step::new(ends, [cap(first(i)), cap(first(i + 1))], 0.01)
        };
        let before = (0..16).map(|_| straight(0.05));
        let steps: Vec<Step> =
            before.chain((0..9).map(bent)).chain((0..16).map(|_| straight(1.85))).collect();
        let squares = along_the_steps(&steps);
        assert!(squares[1..steps.len()].iter().all(|square| *square > 1e-3), "{squares:?}");
    }

    #[test]
    fn a_coefficient_of_rounding_breaks_no_other_limit() {
        let start = rows(&[(1.0, 6.123e-17, 8.733361872477616), (0.0, 1.0, 10.0), (0.0, -1.0, 10.0)]);
        let end = rows(&[(1.0, 6e-17, 8.733361872477616), (0.0, 1.0, 10.0), (0.0, -1.0, 10.0)]);
        let step = Step::new([start, end], [4e4; 2], 0.01);
        let fastest = step.fastest(step.highest(4e4));
        assert!(fastest.abs() <= 10.0 + 1e-5, "{fastest}");
    }

    #[test]
    fn a_low_cap_of_one_place_drops_no_limit_of_the_other() {
        let step = Step::new([joint(1.0, 0.0, 1.0), joint(1.0, 0.0, 1.0)], [1e-14, 9.0], 0.05);
        assert!(step.fastest(0.0) <= 1.0);
    }

    #[test]
    fn a_step_without_length_keeps_the_speed_of_the_next_place() {
        let step = Step::new([joint(1.0, 0.0, 1.0), joint(1.0, 0.0, 1.0)], [4.0; 2], 0.0);
        assert_eq!((step.highest(1.0), step.highest(9.0)), (1.0, 4.0));
    }

    /// Returns the largest x of a linear program in two variables with the rows a·x + b·u ≤ c. The function compares
    /// all corners of the feasible area.
    fn largest_of_the_corners(rows: &[(f64, f64, f64)]) -> f64 {
        let mut largest: f64 = 0.0;
        for (i, (a, b, c)) in rows.iter().enumerate() {
            for (d, e, f) in &rows[i + 1..] {
                let determinant = a * e - b * d;
                if determinant.abs() < 1e-12 {
                    continue;
                }
                let (x, u) = ((c * e - b * f) / determinant, (a * f - c * d) / determinant);
                if rows.iter().all(|(a, b, c)| a * x + b * u <= c + 1e-9 * (1.0 + c.abs())) {
                    largest = largest.max(x);
                }
            }
        }
        largest
    }

    proptest! {
        #[test]
        fn the_highest_speed_is_that_of_the_best_corner(
            start in prop::collection::vec((-5.0..5.0f64, 0.01..5.0f64, any::<bool>(), 0.01..5.0f64), 1..6),
            end in prop::collection::vec((-5.0..5.0f64, 0.01..5.0f64, any::<bool>(), 0.01..5.0f64), 1..6),
            length in 0.01..1.0f64,
            next in 0.0..4.0f64,
            cap in 0.1..9.0f64,
        ) {
            let signed = |list: &[(f64, f64, bool, f64)]| -> Vec<(f64, f64, f64)> {
                list.iter().map(|(a, b, up, c)| (*a, if *up { *b } else { -b }, *c)).collect()
            };
            let (start, end) = (signed(&start), signed(&end));
            // The test excludes rows for which the implementation intentionally uses a lower cap.
            prop_assume!(start.iter().all(|(a, b, _)| !(*b > 0.0 && *b <= 2.0 * length * a)));
            let step = Step::new([rows(&start), rows(&end)], [cap; 2], length);
            let mut all = start;
            all.extend(end.iter().map(|(a, b, c)| (*a, b + 2.0 * length * a, *c)));
            all.extend([(1.0, 0.0, cap), (-1.0, 0.0, 0.0), (1.0, 2.0 * length, next), (-1.0, -2.0 * length, 0.0)]);
            let (ours, best) = (step.highest(next), largest_of_the_corners(&all));
            prop_assert!((ours - best).abs() <= 1e-6 * (1.0 + best), "{} {}", ours, best);
        }
    }
}
