//! Trajectories at another speed, and the setpoints (position, velocity, acceleration) of a trajectory at each
//! millisecond.

use jtc_core::{JOINTS, POINTS_MAX, SetPoint, interpolate, position_speed};

use super::{PlanError, STEP_MS};
use crate::check::POSITION_BIT;
use crate::trajectory::{Point, Trajectory};

/// Returns the trajectory on the same path at `speed_pct` of its speed.
///
/// # Errors
///
/// Returns [`PlanError::Speed`] if the speed is outside 1 to 200 %. Returns [`PlanError::TooLong`] if the slower trajectory is too long for
/// the controller. Returns [`PlanError::Plan`] if the trajectory has no points.
pub fn at_speed(trajectory: &Trajectory, speed_pct: f64) -> Result<Trajectory, PlanError> {
    if trajectory.points.is_empty() {
        return Err(jtc_plan::PlanError::TooFew { count: 0 }.into());
    }
    if !(1.0..=200.0).contains(&speed_pct) {
        return Err(PlanError::Speed { percent: speed_pct, most: 200.0 });
    }
    let s = speed_pct / 100.0;
    let slower = |p: &SetPoint| Point {
        position: p.position,
        velocity: p.velocity.map(|v| v * s),
        acceleration: p.acceleration.map(|a| a * s * s),
    };
    let own: Vec<SetPoint> = trajectory.points.iter().map(SetPoint::from).collect();
    let step = f64::from(trajectory.step_ms) / s;
    if (step - step.round()).abs() < 1e-9 && (1.0..=1000.0).contains(&step) {
        return Ok(Trajectory { step_ms: step.round() as u16, points: own.iter().map(slower).collect() });
    }
    // The new time step would not be a whole number of milliseconds, or would be outside 1 to 1000 ms. Therefore
    // positions, velocities and accelerations are interpolated (J-32) at the points of another time step.
    let seconds = trajectory.duration_s() / s;
    let step_ms = f64::from(STEP_MS).max((seconds * 1e3 / (POINTS_MAX - 1) as f64).ceil());
    if step_ms > 1000.0 {
        return Err(PlanError::TooLong { seconds });
    }
    let h = f64::from(trajectory.step_ms) * 1e-3;
    let steps = (seconds * 1e3 / step_ms).ceil() as usize;
    let last = own.len().saturating_sub(2);
    let points = (0..=steps).map(|k| {
        let t = (k as f64 * step_ms * 1e-3).min(seconds) * s / h;
        let i = (t as usize).min(last);
        match own.get(i + 1) {
            Some(b) => slower(&moment(&own[i], b, h, (t - i as f64).clamp(0.0, 1.0))),
            None => slower(&own[i]),
        }
    });
    Ok(Trajectory { step_ms: step_ms as u16, points: points.collect() })
}

/// Returns the setpoint (position, velocity, acceleration) between two points, for resampling. In some files, the
/// velocities contradict the positions by more than rounding, for example because all velocities are 0. Then the
/// velocity and the acceleration are derived from the positions.
fn moment(a: &SetPoint, b: &SetPoint, h: f64, u: f64) -> SetPoint {
    // The acceleration is computed from the speeds at two times, 0.0005 of the interval before and after `u`. This distance is precise
    // enough for a polynomial, and both times stay inside the interval.
    let (low, high) = ((u - 5e-4).max(0.0), (u + 5e-4).min(1.0));
    let mut at = interpolate(a, b, h, u);
    let (speed, before, after) =
        (position_speed(a, b, h, u), position_speed(a, b, h, low), position_speed(a, b, h, high));
    for j in 0..JOINTS {
        let middle = interpolate(a, b, h, 0.5).velocity[j];
        if (position_speed(a, b, h, 0.5)[j] - middle).abs() * h > 1.875 * 3.0 * POSITION_BIT {
            at.velocity[j] = speed[j];
            at.acceleration[j] = (after[j] - before[j]) / ((high - low) * h);
        }
    }
    at
}

impl Trajectory {
    /// Returns the setpoint (position, velocity, acceleration) at the 1 ms point `k`, with the controller's
    /// interpolation (J-31, J-32). After the end of the trajectory, the function returns the setpoint of the last
    /// point.
    pub fn at_ms(&self, k: u32) -> Option<SetPoint> {
        let step = u32::from(self.step_ms.max(1));
        let (i, ms) = ((k / step) as usize, k % step);
        let wire = |p: &Point| p.raw(0).map_or_else(|_| SetPoint::from(p), |raw| SetPoint::from(&raw));
        match (self.points.get(i), self.points.get(i + 1)) {
            (Some(a), Some(b)) => {
                let h = f64::from(self.step_ms) * 1e-3;
                Some(interpolate(&wire(a), &wire(b), h, f64::from(ms) / f64::from(step)))
            }
            _ => self.points.last().map(wire),
        }
    }
}

#[cfg(test)]
mod tests {
    use jtc_core::Config;
    use proptest::prelude::*;

    use super::*;
    use crate::check::Checker;
    use crate::plan::joint_move;

    #[test]
    fn a_trajectory_without_points_has_no_other_speed() {
        let none = Trajectory { step_ms: 10, points: Vec::new() };
        for speed in [50.0, 70.0, 100.0] {
            let error = at_speed(&none, speed).unwrap_err();
            assert!(matches!(error, PlanError::Plan(jtc_plan::PlanError::TooFew { count: 0 })), "{error}");
        }
    }

    fn pose() -> impl Strategy<Value = [f64; JOINTS]> {
        prop::array::uniform6(-1.5..1.5f64)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// At another speed, the trajectory reaches the same positions at other times.
        #[test]
        fn another_speed_keeps_the_path(from in pose(), to in pose(), speed in 5.0..100.0f64) {
            let config = Config::avena();
            let plan = joint_move(&from, &to, &config, 100.0).unwrap();
            let slow = at_speed(&plan, speed).unwrap();
            let stretch = slow.duration_s() / plan.duration_s() * speed / 100.0;
            prop_assert!((1.0..1.2).contains(&(stretch + 1e-9)), "{stretch}");
            let verdict = Checker::new(&config).check(&slow);
            prop_assert!(verdict.problems.is_empty(), "{verdict}");
            for j in 0..JOINTS {
                prop_assert!((slow.points.last().unwrap().position[j] - to[j]).abs() < 1e-9);
            }
        }
    }
}
