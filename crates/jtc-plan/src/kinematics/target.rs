//! Targets of motions: joint positions or poses of the flange.
use jtc_dynamics::{JointVec, Pose};

use super::{Kinematics, PoseError, outside};

/// Target of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Joint positions, rad.
    Joints(JointVec),
    /// A pose of the flange in the base frame, m.
    Flange(Pose),
}

/// Returns joint positions for each target. For a flange pose, the result is the solution nearest to the previous
/// target. If the first target is a flange pose, the result is the solution nearest to `start` (rad).
///
/// # Errors
///
/// Returns [`PoseError::Waypoint`] with the number of the first target without a solution, counted from 1, and with the
/// reason (see [`Kinematics::solve`]). Targets that are joint positions must also be within the limits.
pub fn resolve(
    kinematics: &Kinematics,
    targets: &[Target],
    start: &JointVec,
) -> Result<Vec<JointVec>, PoseError> {
    let mut before = *start;
    let mut found = Vec::with_capacity(targets.len());
    for (n, target) in targets.iter().enumerate() {
        before = one(kinematics, target, &before).map_err(|error| error.at_waypoint(n + 1))?;
        found.push(before);
    }
    Ok(found)
}

/// Returns joint positions for a target. For a flange pose, the result is the solution nearest to `before`.
pub(crate) fn one(
    kinematics: &Kinematics,
    target: &Target,
    before: &JointVec,
) -> Result<JointVec, PoseError> {
    match target {
        Target::Flange(pose) => kinematics.solve(pose, before),
        Target::Joints(q) => {
            if let Some(&value) = q.iter().find(|q| !q.is_finite()) {
                return Err(PoseError::NotFinite { what: "a joint position", value });
            }
            outside(q, kinematics.limits()).map_or(Ok(*q), Err)
        }
    }
}
