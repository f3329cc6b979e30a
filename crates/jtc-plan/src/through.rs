//! Through waypoints, with given times.
use crate::{ArmDynamics, BlendedPath, JointVec, Limits, Motion, PlanError, along, p2p};

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
/// 0: a stop at each waypoint. Waypoints that are all the same are a rest of 10 ms.
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
    if let [first, others @ ..] = &positions[..]
        && !others.is_empty()
        && others.iter().all(|p| BlendedPath::are_one(first, p))
    {
        return Ok(p2p::standing(first, &positions[positions.len() - 1], positions.len()));
    }
    along(&BlendedPath::new(&positions, blend)?, limits, arm)
}
