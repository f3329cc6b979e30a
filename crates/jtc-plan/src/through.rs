//! Through waypoints, with given times.
use crate::{ArmDynamics, BlendedPath, JointVec, Limits, Motion, PlanError, along};

/// A waypoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// rad.
    pub position: JointVec,
    /// When the motion is to be nearest to it, s from the start; `None`: as soon as it can be.
    pub time: Option<f64>,
}

impl From<JointVec> for Waypoint {
    fn from(position: JointVec) -> Self {
        Self { position, time: None }
    }
}

/// From the first waypoint to the last, as fast as the limits allow, on straight legs whose corners are rounded within `blend` rad;
/// 0: a stop at each waypoint.
///
/// # Errors
///
/// See [`PlanError`].
pub fn through(
    waypoints: &[Waypoint],
    blend: f64,
    limits: &Limits,
    arm: Option<&ArmDynamics>,
) -> Result<Motion, PlanError> {
    limits.check()?;
    for (i, waypoint) in waypoints.iter().enumerate() {
        limits.holds(&waypoint.position, i + 1)?;
    }
    let positions: Vec<JointVec> = waypoints.iter().map(|w| w.position).collect();
    along(&BlendedPath::new(&positions, blend)?, limits, arm)
}
