//! Motion from the current position of the arm to the first point of a trajectory.

use jtc_core::JOINTS;

use super::{PlanError, Planner};
use crate::arm::Arm;
use crate::check::{CheckOptions, CheckedTrajectory};
use crate::error::CheckError;
use crate::trajectory::{Trajectory, UploadOptions};

/// Maximum speed of an approach, % of the limits. The speed is low because the user has not checked the path of the approach for obstacles.
const FASTEST_PCT: f64 = 50.0;

/// Reason why the arm cannot move to the first point of a trajectory. The trajectory itself may be valid.
#[derive(Debug, thiserror::Error)]
pub enum ApproachError {
    /// No motion to the first point can be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The motion to the first point does not pass the check.
    #[error(transparent)]
    Check(#[from] CheckError),
}

/// Plans an approach: a straight motion in joint space from the position `here` to the first point of `trajectory`.
/// The approach is checked like any other motion. Its speed is `speed_pct` % of the limits of `arm` on this
/// controller, at most 50 %.
///
/// # Errors
///
/// Returns an [`ApproachError`] if the motion cannot be planned or does not pass the check.
pub fn approach(
    trajectory: &Trajectory,
    arm: &Arm,
    here: &[f64; JOINTS],
    speed_pct: f64,
    options: &CheckOptions,
) -> Result<CheckedTrajectory, ApproachError> {
    let first = trajectory.points.first().map_or(*here, |point| point.position);
    let (config, friction) = (arm.config_on_device(&options.device), arm.friction());
    let planner = Planner {
        model: Some(&arm.model),
        friction: friction.as_ref(),
        speed_pct: speed_pct.min(FASTEST_PCT),
        ..Planner::new(&config)
    };
    let path = planner.to(here, &first)?.trajectory;
    // The points per segment that the user has set apply only to the trajectory, and not to the approach.
    let upload = UploadOptions { points_per_segment: None, ..options.upload };
    Ok(CheckedTrajectory::check(&path, arm, here, &CheckOptions { upload, ..options.clone() })?)
}
