//! Remainder of an interrupted trajectory: a motion on the same path from rest to the end of the trajectory.

use jtc_core::{POINTS_MAX, SetPoint, interpolate};

use super::PlanError;
use super::sampled::step_ms;
use crate::trajectory::{Point, Trajectory};

/// Returns the remainder of a trajectory after the path time `from_ms`. The motion starts at rest, reaches full speed after `ramp_s`
/// seconds, and then follows the original timing of the trajectory. The first point of the result is the position of the path at `from_ms`.
/// The last point of the result is the last point of the trajectory.
///
/// # Errors
///
/// Returns [`PlanError::TooLong`] if the remainder is too long for the controller.
pub fn remainder(trajectory: &Trajectory, from_ms: u32, ramp_s: f64) -> Result<Trajectory, PlanError> {
    let from_s = f64::from(from_ms) * 1e-3;
    let left = (trajectory.duration_s() - from_s).max(0.0);
    // During the ramp, the path time advances by half of the ramp duration. Therefore the ramp is at most twice as
    // long as the remaining path time.
    let ramp = ramp_s.min(2.0 * left).max(1e-3);
    let seconds = left + 0.5 * ramp;
    let step_ms = step_ms(seconds)?;
    let h = f64::from(step_ms) * 1e-3;
    let steps = ((seconds / h - 1e-6).ceil() as usize).clamp(1, POINTS_MAX - 1);
    let mut points: Vec<Point> = (0..steps)
        .map(|k| {
            let t = k as f64 * h;
            let (passed, rate, change) = ramped(t, ramp);
            let at = place(trajectory, from_s + passed);
            Point {
                position: at.position,
                velocity: at.velocity.map(|v| v * rate),
                acceleration: std::array::from_fn(|j| {
                    at.acceleration[j] * rate * rate + at.velocity[j] * change
                }),
            }
        })
        .collect();
    let end = place(trajectory, trajectory.duration_s());
    points.push(Point { position: end.position, ..Point::default() });
    Ok(Trajectory { step_ms, points })
}

/// Returns the path time after `t` seconds, the rate of the path time, and the derivative of this rate. The rate of the path time rises
/// from 0 to 1 within `ramp` seconds.
fn ramped(t: f64, ramp: f64) -> (f64, f64, f64) {
    let u = t / ramp;
    if u >= 1.0 {
        return (t - 0.5 * ramp, 1.0, 0.0);
    }
    (ramp * u * u * u * (1.0 - 0.5 * u), u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / ramp)
}

/// Returns the setpoint (position, velocity, acceleration) at `t` seconds of the path, with the controller's
/// interpolation between points (J-32).
fn place(trajectory: &Trajectory, t: f64) -> SetPoint {
    let h = f64::from(trajectory.step_ms.max(1)) * 1e-3;
    let i = (t / h).max(0.0) as usize;
    match (trajectory.points.get(i), trajectory.points.get(i + 1)) {
        (Some(a), Some(b)) => {
            interpolate(&SetPoint::from(a), &SetPoint::from(b), h, (t / h - i as f64).clamp(0.0, 1.0))
        }
        _ => trajectory.points.last().map(SetPoint::from).unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use jtc_core::{Config, JOINTS};

    use super::*;
    use crate::check::Checker;
    use crate::example::demo_motion;

    fn near(a: &[f64; JOINTS], b: &[f64; JOINTS]) -> f64 {
        (0..JOINTS).map(|j| (a[j] - b[j]).abs()).fold(0.0, f64::max)
    }

    /// From any position of the path, the remainder begins at rest, stays on the path, ends at the last point, and passes the check.
    #[test]
    fn the_rest_begins_at_rest_and_stays_on_the_path() {
        let (whole, config) = (demo_motion(), Config::avena());
        for from_ms in [0, 1, 997, 2500, 5003, 9_700, 9_999] {
            let rest = remainder(&whole, from_ms, 0.5).unwrap();
            let first = rest.points[0];
            assert_eq!(first.velocity, [0.0; JOINTS]);
            assert!(near(&first.position, &whole.at_ms(from_ms).unwrap().position) < 2e-4, "{from_ms}");
            assert_eq!(rest.points.last().unwrap().position, whole.points.last().unwrap().position);
            let verdict = Checker::new(&config).check(&rest);
            assert!(verdict.is_ok(), "{from_ms}: {verdict}");
            for ms in (0..(rest.duration_s() * 1e3) as u32).step_by(7) {
                let at = rest.at_ms(ms).unwrap().position;
                // The test searches for the nearest position of the original path at any time. Only the path must be
                // the same: the remainder reaches each position at another time.
                let aside = (from_ms.saturating_sub(5)..=10_000)
                    .map(|k| near(&at, &whole.at_ms(k).unwrap().position));
                let aside = aside.fold(f64::INFINITY, f64::min);
                assert!(aside < 1.5e-3, "{from_ms}, {ms}: {aside}");
            }
        }
    }
}
