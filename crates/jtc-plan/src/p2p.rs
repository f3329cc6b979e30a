//! Point-to-point motions.
use rsruckig::prelude::{
    DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler, Trajectory,
};

use crate::motion::{Motion, Piece};
use crate::{ArmDynamics, JOINTS, JointVec, Limits, PlanError, State, reasons, trapezoid, verify};

/// Duration of a motion between two equal positions, s. A trajectory needs two points, so its duration must be above 0.
const STANDING: f64 = 0.01;

/// Plans the fastest motion from rest to rest within velocity, acceleration and jerk limits. All joints start and
/// stop together (Ruckig, by Berscheid and Kröger 2021). The motion is a straight line in joint space if a straight
/// line does not take longer. With an `arm`, the motion is slowed down until the torque is sufficient, and the joint
/// speeds stay within the friction table.
///
/// If `from` and `to` are equal, the arm stays at rest for 10 ms.
///
/// # Errors
///
/// Returns [`PlanError::Limit`] and [`PlanError::Range`] for limits that permit no motion. Returns
/// [`PlanError::NotFinite`] and [`PlanError::Position`] for waypoint 1 (`from`) or 2 (`to`). Returns
/// [`PlanError::Torque`] if the torque is too small at every speed.
pub fn point_to_point(
    from: &JointVec,
    to: &JointVec,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    limits.check()?;
    limits.holds(from, 1)?;
    limits.holds(to, 2)?;
    verify::holds(from, 1, limits, arm)?;
    verify::holds(to, 2, limits, arm)?;
    let motion = fastest(from, to, &verify::with_table(limits, arm))?;
    Ok(reasons::explained(verify::finished(motion, limits, arm)?, limits, arm))
}

/// Like [`point_to_point`], ignoring torque.
fn fastest(from: &JointVec, to: &JointVec, limits: &Limits) -> Result<Motion, PlanError> {
    if from == to {
        return Ok(standing(from, to, 2));
    }
    if !limits.has_jerk() {
        return Ok(trapezoid::straight_or_joined(from, to, limits));
    }
    ruckig(from, to, limits)
}

/// Returns a short motion without movement between two equal positions, with `waypoints` waypoints.
pub(crate) fn standing(from: &JointVec, to: &JointVec, waypoints: usize) -> Motion {
    let piece = Piece::between(0.0, STANDING, &State::rest(*from), &State::rest(*to));
    let mut times = vec![0.0; waypoints];
    if let Some(last) = times.last_mut() {
        *last = STANDING;
    }
    Motion::new(vec![piece], *to, times)
}

/// Plans a motion with Ruckig. The motion is a straight line if all other joints can follow the joint with the longest
/// distance.
fn ruckig(from: &JointVec, to: &JointVec, limits: &Limits) -> Result<Motion, PlanError> {
    let mut input = InputParameter::<JOINTS>::new(None);
    input.current_position = DataArrayOrVec::Stack(*from);
    input.target_position = DataArrayOrVec::Stack(*to);
    input.max_velocity = DataArrayOrVec::Stack(limits.velocity);
    input.max_acceleration = DataArrayOrVec::Stack(limits.acceleration);
    input.max_jerk = DataArrayOrVec::Stack(limits.jerk);
    input.synchronization = Synchronization::Phase;
    let mut trajectory = Trajectory::new(None);
    Ruckig::<JOINTS, ThrowErrorHandler>::new(None, 0.001)
        .calculate(&input, &mut trajectory)
        .map_err(|e| PlanError::NoTimeLaw { leg: 1, reason: e.to_string() })?;
    let end = trajectory.get_duration();
    let mut breaks: Vec<f64> = vec![0.0, end];
    for profile in trajectory.get_profiles().iter().flat_map(|section| section.iter()) {
        breaks.extend(profile.t_sum.iter().map(|t| t + profile.brake.duration));
    }
    breaks.retain(|t| (0.0..=end).contains(t));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < 1e-12);
    if let Some(last) = breaks.last_mut() {
        *last = end;
    }
    let pieces = breaks.windows(2).map(|pair| constant_jerk(&trajectory, pair[0], pair[1] - pair[0]));
    Ok(Motion::new(pieces.collect(), *to, vec![0.0, end]))
}

/// Returns a part of a trajectory in which the jerk of every joint is constant.
fn constant_jerk(trajectory: &Trajectory<JOINTS>, start: f64, length: f64) -> Piece {
    let zeros = || DataArrayOrVec::Stack([0.0; JOINTS]);
    let (mut p, mut v, mut a, mut jerk) = (zeros(), zeros(), zeros(), zeros());
    trajectory.at_time(start, &mut Some(&mut p), &mut Some(&mut v), &mut Some(&mut a), &mut None, &mut None);
    // The jerk is evaluated in the middle of the part, because the value at its start can still be the jerk of the
    // previous part.
    let middle = start + 0.5 * length;
    trajectory.at_time(middle, &mut None, &mut None, &mut None, &mut Some(&mut jerk), &mut None);
    let coefficients = std::array::from_fn(|j| [p[j], v[j], 0.5 * a[j], jerk[j] / 6.0, 0.0, 0.0]);
    Piece { start, length, coefficients }
}
