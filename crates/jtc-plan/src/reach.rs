//! Time-optimal path parameterisation by reachability analysis (Pham and Pham 2018), as implemented in `copp`.
use copp::constraints::Constraints;
use copp::solver::topp2_ra::{ReachSet2OptionsBuilder, Topp2ProblemBuilder, topp2_ra};
use nalgebra::DMatrixView;

use crate::cells::{Cell, End, Room};
use crate::path::PathPoint;
use crate::{ArmDynamics, JOINTS, Limits};

/// Number of rows per point: acceleration and torque of each joint in both directions.
const ROWS: usize = 4 * JOINTS;

/// Tolerance of squared speeds, relative to the highest.
const TOLERANCE: f64 = 1e-12;

/// Limits of one place, per row: by_speed·ṡ² + by_acceleration·s̈ ≤ limit.
struct Rows {
    by_speed: [f64; ROWS],
    by_acceleration: [f64; ROWS],
    limit: [f64; ROWS],
}

/// Returns the vertices (parameter, squared speed) of the fastest law from rest to rest along the cells. Squared speeds
/// are at most `caps`; accelerations and torques are at most `shares` of their limits.
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
    let caps_of_places: Vec<f64> = (0..count).map(cap).collect();
    // The unit of time is chosen such that the highest speed is 1, because copp's tolerances are absolute.
    let unit = caps_of_places.iter().copied().fold(0.0, f64::max);
    let in_units: Vec<f64> = caps_of_places.iter().map(|cap| cap / unit).collect();
    let mut constraints = Constraints::with_capacity(JOINTS, count);
    let failed = |e: copp::diag::ConstraintError| e.to_string();
    constraints.with_s(places.as_slice()).map_err(failed)?;
    constraints.with_constraint_1order(in_units.as_slice(), 0).map_err(failed)?;
    // A place belongs to the cell after it. If its derivatives differ there, it also belongs to the cell before it.
    let share = |i: usize| shares[i.saturating_sub(1)].min(shares[i.min(count - 2)]);
    let end = |i: usize| cells.get(i).map_or(&cells[count - 2].ends[1], |cell| &cell.ends[0]);
    let rows = |end: &End, i: usize| Rows::new(end, share(i), caps_of_places[i], limits, arm).in_units(unit);
    let after: Vec<Rows> = (0..count).map(|i| rows(end(i), i)).collect();
    append(&mut constraints, &after, 0)?;
    for i in 1..count - 1 {
        let left = &cells[i - 1].ends[1];
        if differ(&left.point, &end(i).point) {
            append(&mut constraints, &[rows(left, i)], i)?;
        }
    }
    let problem = Topp2ProblemBuilder::with_constraint(&constraints, (0, count - 1), (0.0, 0.0))
        .build()
        .map_err(|e| e.to_string())?;
    let options = ReachSet2OptionsBuilder::new()
        .a_cmp_abs_tol(TOLERANCE)
        .a_cmp_rel_tol(TOLERANCE)
        .lp_feas_tol(TOLERANCE)
        .build()
        .map_err(|e| e.to_string())?;
    let squares = topp2_ra(&problem, &options).map_err(|e| e.to_string())?;
    if squares[1..count - 1].iter().any(|a| !(*a > 0.0 && a.is_finite())) {
        return Err("the speed along the path is 0 where it does not stop".into());
    }
    Ok(places.into_iter().zip(squares.into_iter().map(|square| square * unit)).collect())
}

/// Returns `true` if the derivatives of the path differ between two points.
fn differ(a: &PathPoint, b: &PathPoint) -> bool {
    let far = |a: f64, b: f64| (a - b).abs() > 1e-9 * (1.0 + a.abs() + b.abs());
    (0..JOINTS).any(|j| far(a.first[j], b.first[j]) || far(a.second[j], b.second[j]))
}

/// Adds the rows of the points from index `first` on.
fn append(constraints: &mut Constraints, rows: &[Rows], first: usize) -> Result<(), String> {
    let flat = |part: fn(&Rows) -> &[f64; ROWS]| -> Vec<f64> { rows.iter().flat_map(|r| *part(r)).collect() };
    let (a, b, c) = (flat(|r| &r.by_speed), flat(|r| &r.by_acceleration), flat(|r| &r.limit));
    let matrix = |values| DMatrixView::from_slice(values, ROWS, rows.len());
    constraints
        .with_constraint_2order(&matrix(&a), &matrix(&b), &matrix(&c), first, false)
        .map(|_| ())
        .map_err(|e| e.to_string())
}

impl Rows {
    /// Returns the rows with the parameter's squared speeds and accelerations in this unit, scaled to about 1.
    fn in_units(mut self, unit: f64) -> Self {
        for row in 0..ROWS {
            let size =
                self.by_speed[row].abs().max(self.by_acceleration[row].abs()).max(self.limit[row] / unit);
            if size.is_finite() && size > 0.0 {
                self.by_speed[row] /= size;
                self.by_acceleration[row] /= size;
                self.limit[row] /= size * unit;
            } else {
                self.limit[row] /= unit;
            }
        }
        self
    }

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
