//! Singular poses, in which the flange cannot move in at least one direction.
use std::fmt;

use jtc_dynamics::JOINTS;
use jtc_wire::Joint;
use nalgebra::Vector6;

use super::chain::{Axes, Chain};
use super::closed_form::{Geometry, Shoulder};
use super::subproblems::across;

/// Smallest singular value of the Jacobian that is permitted on a path of the flange (see [`Singularity::smallest`]). A
/// value of 0.01 corresponds to half a degree from aligned wrist axes, and to a few degrees from the stretched arm.
pub const SINGULAR: f64 = 0.01;

/// Kind of singular pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SingularKind {
    /// Wrist singularity: the axes of joints 4 and 6 are parallel, with joint 5 at 0 or half a turn.
    Wrist,
    /// Elbow singularity: the arm is stretched or folded.
    Elbow,
    /// Shoulder singularity: the wrist centre is on the axis of joint 1, or joint 1 cannot move the wrist centre
    /// sideways.
    Shoulder,
    /// Any other singular pose, or a singular pose of an arm without a known geometry.
    Other,
}

/// Singular pose in which the arm is, or to which it is close.
#[derive(Clone, Debug, PartialEq)]
pub struct Singularity {
    /// Kind of the singular pose.
    pub kind: SingularKind,
    /// Joints that can move while the flange is almost at rest.
    pub joints: Vec<Joint>,
    /// Smallest singular value of the Jacobian, with translations divided by the length of the stretched arm. This
    /// value is the smallest motion of the flange for joint motions of 1 rad in total (root of the sum of squares). The
    /// value is 0 in a singular pose, and NaN if a joint position is NaN or infinite.
    pub smallest: f64,
}

impl fmt::Display for Singularity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, why) = match self.kind {
            SingularKind::Wrist => ("wrist singularity", " (the axes of joints 4 and 6 in line)"),
            SingularKind::Elbow => ("elbow singularity", " (the arm stretched or folded)"),
            SingularKind::Shoulder => ("shoulder singularity", " (joint 1 cannot move the wrist sideways)"),
            SingularKind::Other => ("singular pose", ""),
        };
        write!(f, "{name}{why}: {} ", if self.joints.len() > 1 { "joints" } else { "joint" })?;
        for (k, joint) in self.joints.iter().enumerate() {
            let before = if k == 0 {
                ""
            } else if k + 1 == self.joints.len() {
                " and "
            } else {
                ", "
            };
            write!(f, "{before}{}", joint.number())?;
        }
        write!(
            f,
            " would move far for a small motion of the flange; smallest singular value {:.2e}, limit {:.2e}",
            self.smallest, SINGULAR
        )
    }
}

/// A joint is considered moving if its entry in the vector of joint motions exceeds this share of the largest entry.
const TAKES_PART: f64 = 0.2;
/// Sine of the wrist angle below which a singular pose of an arm without a planar elbow is reported as a wrist
/// singularity.
const NAMED: f64 = 0.1;

/// Returns the smallest singular value of the Jacobian and the unit vector of the corresponding joint motions. If a
/// joint position is NaN or infinite, returns NaN and a zero vector.
pub(crate) fn weakest(chain: &Chain, axes: &Axes) -> (f64, Vector6<f64>) {
    let jacobian = chain.scaled_jacobian(axes);
    // With values that are not finite, the iteration for singular values would not end.
    if !jacobian.iter().all(|entry| entry.is_finite()) {
        return (f64::NAN, Vector6::zeros());
    }
    let parts = jacobian.svd(false, true);
    let least = parts.singular_values.imin();
    let direction = parts.v_t.map(|v| v.row(least).transpose()).unwrap_or_default();
    (parts.singular_values[least], direction)
}

/// Returns the singular pose that is nearest to these joint positions.
pub(crate) fn nearest(chain: &Chain, geometry: Option<&Geometry>, axes: &Axes) -> Singularity {
    let (smallest, direction) = weakest(chain, axes);
    let part = TAKES_PART * direction.amax();
    let joints = (0..JOINTS).filter(|&j| direction[j].abs() > part).filter_map(Joint::from_index).collect();
    Singularity { kind: geometry.map_or(SingularKind::Other, |g| kind(chain, g, axes)), joints, smallest }
}

/// Returns the kind of singularity. The kind corresponds to the factor of the Jacobian's determinant that is nearest to
/// 0.
fn kind(chain: &Chain, geometry: &Geometry, axes: &Axes) -> SingularKind {
    let (h, p) = (&axes.axis, &axes.point);
    // The factor of the wrist is divided by its value at a quarter turn of joint 5, so that its range is from 0 to 1.
    let full = h[3].cross(&h[4]).norm() * h[4].cross(&h[5]).norm();
    let wrist = h[3].dot(&h[4].cross(&h[5])).abs() / full.max(f64::MIN_POSITIVE);
    let (centre, is_planar) = match geometry {
        Geometry::ThreeParallel { centre } => (centre, true),
        Geometry::SphericalWrist { centre, shoulder } => (centre, *shoulder == Shoulder::UpperArmParallel),
    };
    if !is_planar {
        return if wrist < NAMED { SingularKind::Wrist } else { SingularKind::Other };
    }
    // The last axes meet in a point on axis 5. This point moves with axis 5, so its present position is computed from
    // its position along axis 5.
    let along = chain.zero.axis[4].dot(&(centre - chain.zero.point[4]));
    let centre = axes.point[4] + h[4] * along;
    let end = if matches!(geometry, Geometry::ThreeParallel { .. }) { p[3] } else { centre };
    let (upper, fore) = (across(&h[1], &(p[2] - p[1])), across(&h[1], &(end - p[2])));
    let elbow = h[1].dot(&upper.cross(&fore)).abs() / (upper.norm() * fore.norm()).max(f64::MIN_POSITIVE);
    let shoulder = h[1].dot(&h[0].cross(&(centre - p[0]))).abs() / chain.length;
    if wrist <= elbow.min(shoulder) {
        SingularKind::Wrist
    } else if elbow <= shoulder {
        SingularKind::Elbow
    } else {
        SingularKind::Shoulder
    }
}
