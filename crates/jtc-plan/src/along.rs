//! Time laws for paths.
use crate::motion::{Motion, Piece};
use crate::path::Path;
use crate::{ArmDynamics, Limits, PlanError, State, verify};

/// As fast along a path as velocity, acceleration and torque allow.
///
/// # Errors
///
/// See [`PlanError`].
pub fn along(path: &dyn Path, limits: &Limits, arm: Option<&ArmDynamics>) -> Result<Motion, PlanError> {
    limits.check()?;
    let mut ends = vec![0.0];
    ends.extend(path.stops());
    ends.push(path.end());
    let mut whole: Option<Motion> = None;
    for pair in ends.windows(2) {
        let section = verify::finished(section(path, pair[0], pair[1]), limits, None)?;
        match &mut whole {
            None => whole = Some(section),
            Some(whole) => whole.append(&section),
        }
    }
    let whole = whole.ok_or(PlanError::TooFew { count: 0 })?;
    verify::finished(whole, limits, arm)
}

/// A second along a part of the path, by a quintic.
fn section(path: &dyn Path, from: f64, to: f64) -> Motion {
    const COUNT: usize = 200;
    let state = |i: usize| {
        let u = i as f64 / COUNT as f64;
        let way = to - from;
        let s = from + way * u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let (v, a) =
            (way * 30.0 * u * u * (1.0 - u) * (1.0 - u), way * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u));
        // Of two legs that meet at a stop, this one.
        let at = path.at(s.clamp(from + 1e-12 * way, to - 1e-12 * way));
        State {
            position: at.position,
            velocity: at.first.map(|q| q * v),
            acceleration: std::array::from_fn(|j| at.first[j] * a + at.second[j] * v * v),
        }
    };
    let h = 1.0 / COUNT as f64;
    let pieces = (0..COUNT).map(|i| Piece::between(i as f64 * h, h, &state(i), &state(i + 1)));
    Motion::new(pieces.collect(), path.at(to).position, vec![0.0, 1.0])
}
