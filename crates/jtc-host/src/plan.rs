//! Moves made here: joint moves to a pose, and trajectories at another speed.

use jtc_core::{Config, JOINTS, POINTS_MAX, SetPoint, interpolate, position_speed};
use jtc_dynamics::ArmModel;
use jtc_wire::Joint;

use crate::check::{Checker, POSITION_BIT, Problem, ProblemKind};
use crate::trajectory::{Point, Trajectory};

/// Step of planned moves, ms.
const STEP_MS: u16 = 10;
/// Share of the limits that a planned move uses, which leaves room for the controller's own corrections and for rounding.
const SHARE: f64 = 0.9;
/// Shortest move, s.
const SHORTEST: f64 = 0.2;

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A pose that is no pose, or outside the limits.
    #[error("{joint}: target {value} rad is outside {min}..{max} rad")]
    Target {
        /// Of this joint.
        joint: Joint,
        /// rad.
        value: f64,
        /// rad.
        min: f64,
        /// rad.
        max: f64,
    },
    /// The measured position is no number.
    #[error("{joint}: position {value} is no place to start from")]
    Start {
        /// Of this joint.
        joint: Joint,
        /// rad.
        value: f64,
    },
    /// Not a share of the speed.
    #[error("speed {0} % is not within 1..200 %")]
    Speed(f64),
    /// Even slowly the torque is over its limit.
    #[error("{joint}: the move needs {torque:.1} N·m, more than {limit} N·m, at any speed")]
    Torque {
        /// Of this joint.
        joint: Joint,
        /// N·m.
        torque: f64,
        /// N·m.
        limit: f64,
    },
    /// Longer than a trajectory can be.
    #[error("the trajectory takes {seconds:.0} s at this speed, more than {POINTS_MAX} points can hold")]
    TooLong {
        /// s.
        seconds: f64,
    },
}

/// A straight move in joint space from rest to rest, as a quintic in time: as fast as `speed_pct` of 90 % of the speed and
/// acceleration limits allow.
///
/// # Errors
///
/// [`PlanError::Speed`] outside 1..200 %; [`PlanError::Start`] and [`PlanError::Target`] for a pose that is none or is outside the
/// limits.
pub fn joint_move(
    from: &[f64; JOINTS],
    to: &[f64; JOINTS],
    config: &Config,
    speed_pct: f64,
) -> Result<Trajectory, PlanError> {
    if !(1.0..=200.0).contains(&speed_pct) {
        return Err(PlanError::Speed(speed_pct));
    }
    let speed = speed_pct / 100.0 * SHARE;
    let mut seconds = SHORTEST;
    for (joint, limit) in Joint::ALL.into_iter().zip(&config.joints) {
        let j = joint.index();
        if !from[j].is_finite() {
            return Err(PlanError::Start { joint, value: from[j] });
        }
        let (min, max) = config.position_range(j);
        if !(min..=max).contains(&to[j]) {
            return Err(PlanError::Target { joint, value: to[j], min, max });
        }
        let distance = (to[j] - from[j]).abs();
        // Peaks of the quintic: 15/8 of the mean speed, 10/√3 of distance over time squared.
        seconds = f64::max(seconds, 1.875 * distance / (limit.velocity_max * speed));
        let acceleration = limit.acceleration_max * speed * speed.min(1.0);
        seconds = f64::max(seconds, (10.0 / 3f64.sqrt() * distance / acceleration).sqrt());
    }
    Ok(quintic(from, to, seconds))
}

fn quintic(from: &[f64; JOINTS], to: &[f64; JOINTS], seconds: f64) -> Trajectory {
    // Slower than 12,000 points of 10 ms: longer steps, the controller interpolates.
    let step_ms = f64::from(STEP_MS).max((seconds * 1e3 / (POINTS_MAX - 1) as f64).ceil()) as u16;
    let h = f64::from(step_ms) * 1e-3;
    let steps = (seconds / h).ceil().max(1.0) as usize;
    let seconds = steps as f64 * h;
    let points = (0..=steps).map(|i| {
        let u = i as f64 / steps as f64;
        let mut point = Point::default();
        for j in 0..JOINTS {
            let d = to[j] - from[j];
            let w = 1.0 - u;
            point.position[j] =
                if i == steps { to[j] } else { from[j] + d * u * u * u * (10.0 + u * (6.0 * u - 15.0)) };
            point.velocity[j] = d * 30.0 * u * u * w * w / seconds;
            point.acceleration[j] = d * 60.0 * u * w * (1.0 - 2.0 * u) / (seconds * seconds);
        }
        point
    });
    Trajectory { step_ms, points: points.collect() }
}

/// A move from where the arm is to the first point of a trajectory, slowed down until the torque suffices by the arm model.
///
/// # Errors
///
/// Those of [`joint_move`], and [`PlanError::Torque`] when the move needs too much torque however slow it is.
pub fn approach(
    from: &[f64; JOINTS],
    to: &[f64; JOINTS],
    config: &Config,
    model: Option<&ArmModel>,
    speed_pct: f64,
) -> Result<Trajectory, PlanError> {
    let mut speed = speed_pct;
    loop {
        let plan = joint_move(from, to, config, speed)?;
        let verdict = Checker { model, ..Checker::new(config) }.check(&plan);
        let torque =
            |p: &Problem| Some((p.joint?, p.value, p.limit)).filter(|_| p.kind == ProblemKind::Torque);
        let over = verdict.problems.iter().find_map(torque);
        match over {
            None => return Ok(plan),
            Some((joint, torque, limit)) if speed < speed_pct / 8.0 || speed < 2.0 => {
                return Err(PlanError::Torque { joint, torque: torque.abs(), limit: limit.abs() });
            }
            Some(_) => speed *= 0.7,
        }
    }
}

/// The same path at `speed_pct` of its speed.
///
/// # Errors
///
/// [`PlanError::Speed`] outside 1..200 %, [`PlanError::TooLong`] when the slower one does not fit into the controller.
pub fn at_speed(trajectory: &Trajectory, speed_pct: f64) -> Result<Trajectory, PlanError> {
    if !(1.0..=200.0).contains(&speed_pct) {
        return Err(PlanError::Speed(speed_pct));
    }
    let s = speed_pct / 100.0;
    let slower = |p: &SetPoint| Point {
        position: p.position,
        velocity: p.velocity.map(|v| v * s),
        acceleration: p.acceleration.map(|a| a * s * s),
    };
    let own: Vec<SetPoint> = trajectory.points.iter().map(set_point).collect();
    let step = f64::from(trajectory.step_ms) / s;
    if (step - step.round()).abs() < 1e-9 && (1.0..=1000.0).contains(&step) {
        return Ok(Trajectory { step_ms: step.round() as u16, points: own.iter().map(slower).collect() });
    }
    // A step that is no whole number of ms: sampled anew, each channel from its own samples (J-32).
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

/// Set values between two points to sample anew. Where the velocities leave out more of the way than rounding does (a file whose
/// velocities are all 0), those of the position take their place, or the samples would contradict themselves all along.
fn moment(a: &SetPoint, b: &SetPoint, h: f64, u: f64) -> SetPoint {
    // Half a thousandth of an interval: exact enough for a polynomial, and inside it.
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

pub(crate) fn set_point(p: &Point) -> SetPoint {
    SetPoint { position: p.position, velocity: p.velocity, acceleration: p.acceleration }
}

impl Trajectory {
    /// Set values at the 1 ms point `k`, as the controller computes them (J-31, J-32); the last point beyond the end.
    pub fn at_ms(&self, k: u32) -> Option<SetPoint> {
        let step = u32::from(self.step_ms.max(1));
        let (i, ms) = ((k / step) as usize, k % step);
        let wire = |p: &Point| p.raw(0).map_or_else(|_| set_point(p), |raw| SetPoint::from(&raw));
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
    use proptest::prelude::*;

    use super::*;

    fn pose() -> impl Strategy<Value = [f64; JOINTS]> {
        prop::array::uniform6(-1.5..1.5f64)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Any planned move passes the check at any speed up to 100 %, and ends exactly where it should.
        #[test]
        fn planned_moves_pass_the_check(from in pose(), to in pose(), speed in 1.0..100.0f64) {
            let config = Config::avena();
            let plan = joint_move(&from, &to, &config, speed).unwrap();
            let verdict = Checker { start: Some(from), ..Checker::new(&config) }.check(&plan);
            prop_assert!(verdict.problems.is_empty(), "{verdict}");
            prop_assert_eq!(plan.points.last().unwrap().position, to);
            prop_assert!(plan.points.len() <= POINTS_MAX);
        }

        /// The same path at another speed: same places, other times.
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

    #[test]
    fn a_target_outside_the_limits_is_refused() {
        let config = Config::avena();
        let error = joint_move(&[0.0; 6], &[0.0, 1.6, 0.0, 0.0, 0.0, 0.0], &config, 100.0).unwrap_err();
        assert_eq!(error.to_string(), "joint 2: target 1.6 rad is outside -1.57..1.57 rad");
        assert!(joint_move(&[f64::NAN; 6], &[0.0; 6], &config, 100.0).is_err());
        assert!(joint_move(&[0.0; 6], &[0.0; 6], &config, 0.0).is_err());
    }

    /// A slowed approach still works where full speed asks for more torque than there is.
    #[test]
    fn approaches_slow_down_for_torque() {
        let arm = crate::arm::Arm::avena();
        let mut config = arm.config();
        config.joints[1].torque_max = 135.0;
        let to = [0.0, 1.5, 0.0, 0.0, 0.0, 0.0];
        let fast = joint_move(&[0.0; 6], &to, &config, 100.0).unwrap();
        let plan = approach(&[0.0; 6], &to, &config, Some(&arm.model), 100.0).unwrap();
        assert!(plan.duration_s() >= fast.duration_s());
        config.joints[1].torque_max = 60.0;
        assert!(matches!(
            approach(&[0.0; 6], &to, &config, Some(&arm.model), 100.0),
            Err(PlanError::Torque { joint, .. }) if joint.number() == 2
        ));
    }
}
