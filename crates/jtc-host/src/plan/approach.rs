//! The way from where the arm stands to the first point of a trajectory.

use jtc_core::JOINTS;

use super::{PlanError, Planner};
use crate::arm::Arm;
use crate::check::{CheckOptions, CheckedTrajectory};
use crate::error::CheckError;
use crate::trajectory::{Trajectory, UploadOptions};

/// Fastest, % of what the limits allow: nobody has looked at this path for obstacles.
const FASTEST_PCT: f64 = 50.0;

/// Why there is no way to the first point; the trajectory itself may be sound.
#[derive(Debug, thiserror::Error)]
pub enum ApproachError {
    /// No motion leads there.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The motion that leads there does not pass the check.
    #[error(transparent)]
    Check(#[from] CheckError),
}

/// A straight motion in joint space from `here` to the first point of `trajectory`, checked like any other one: at `speed_pct` of what
/// the limits of `arm` on this controller allow, and at most at half of it.
///
/// # Errors
///
/// [`ApproachError`].
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
    // Segments that were asked for are those of the motion.
    let upload = UploadOptions { points_per_segment: None, ..options.upload };
    Ok(CheckedTrajectory::check(&path, arm, here, &CheckOptions { upload, ..options.clone() })?)
}
