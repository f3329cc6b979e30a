//! Errors of flange poses and lines.
use jtc_wire::Joint;

use super::singular::Singularity;

/// Reason why a pose of the flange cannot be reached, or why the flange cannot follow a line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// A value that is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// Name of the value, such as `position x`.
        what: &'static str,
        /// Value.
        value: f64,
    },
    /// A quaternion whose length is not 1.
    #[error("the quaternion has the length {length:.6}, expected 1")]
    NotUnit {
        /// Length of the quaternion.
        length: f64,
    },
    /// A matrix that is not a rotation matrix.
    #[error(
        "the matrix is not a rotation: its axes differ from length 1 and right angles by {deviation:.2e}"
    )]
    NotRotation {
        /// Largest entry of RᵀR − 1, or 2 for a reflection.
        deviation: f64,
    },
    /// The arm cannot reach the position with any orientation of the flange, because the position is too far away or
    /// too close.
    #[error(
        "out of reach: {distance:.3} m from the origin of the base; the nearest position of the flange is {missing:.4} m away from it"
    )]
    OutOfReach {
        /// Distance of the position from the origin of the base, m.
        distance: f64,
        /// Distance between the requested position and the nearest flange position that the search found, m.
        missing: f64,
    },
    /// The flange can reach the position, but not with this orientation.
    #[error(
        "out of reach in this orientation: the flange reaches this position, {distance:.3} m from the origin of the base, but its nearest \
         orientation differs by {missing:.3} rad"
    )]
    Orientation {
        /// Distance of the position from the origin of the base, m.
        distance: f64,
        /// Angle between the requested orientation and the nearest orientation that the search found at this position,
        /// rad.
        missing: f64,
    },
    /// The arm can reach the pose only with a joint outside its limits.
    #[error("{joint} would be at {value:.4} rad, its limits are {low:.4} and {high:.4} rad")]
    OutsideLimits {
        /// Joint that is farthest outside its limits, in the solution that exceeds the limits least.
        joint: Joint,
        /// Position of the joint in this solution, rad.
        value: f64,
        /// Lowest position, rad.
        low: f64,
        /// Highest position, rad.
        high: f64,
    },
    /// A line of the flange that passes through or near a singular pose.
    #[error("{0}")]
    Singular(Singularity),
    /// A line of the flange on which a joint must turn far within a short distance.
    #[error("{joint} would need to turn by {step:.3} rad within {distance:.6} m")]
    JointStep {
        /// Joint.
        joint: Joint,
        /// Angle that the joint must turn, rad.
        step: f64,
        /// Distance on the line within which the joint must turn, m.
        distance: f64,
    },
    /// Three points that are not on a circle.
    #[error(
        "the three points of the arc are not on a circle: the second is {distance:.2e} m from the line through the others"
    )]
    Arc {
        /// Distance of the second point from the straight line, m; 0 if the first and the last point are equal.
        distance: f64,
    },
    /// Two consecutive orientations with an angle of half a turn between them.
    #[error(
        "the orientation is half a turn from that of the waypoint before, so the direction of the turn is ambiguous"
    )]
    HalfTurn,
    /// A `via` point that is not followed by an arc.
    #[error("a point on an arc (`via`) is not followed by the end of the arc")]
    NoArc,
    /// An arc without its `via` point.
    #[error("the end of an arc does not follow a point on the arc (`via`)")]
    NoVia,
    /// Joint positions at the end of a line that the arm does not reach, because it keeps its configuration (elbow,
    /// wrist, shoulder) along the line.
    #[error(
        "the line ends there with {joint} at {value:.4} rad, not at {wanted:.4} rad: the arm keeps its configuration along a line"
    )]
    Configuration {
        /// Joint with the largest difference.
        joint: Joint,
        /// Position of the joint at the end of the line, rad.
        value: f64,
        /// Position of the waypoint, rad.
        wanted: f64,
    },
    /// An invalid blend radius.
    #[error("a blend radius of {radius} m is out of range, expected a finite value of 0 or more")]
    Blend {
        /// Given radius, m.
        radius: f64,
    },
    /// A path without a leg that moves the flange.
    #[error("the path has no leg that moves the flange")]
    NoMotion,
    /// An error at one of several waypoints.
    #[error("waypoint {waypoint}: {source}")]
    Waypoint {
        /// Number of the waypoint, from 1.
        waypoint: usize,
        /// Error at the waypoint.
        source: Box<PoseError>,
    },
    /// An error on one of several legs.
    #[error("leg {leg} (to waypoint {}), {distance:.4} m of {length:.4} m along it: {source}", leg + 1)]
    Leg {
        /// Number of the leg, from 1. Leg n is between waypoints n and n + 1.
        leg: usize,
        /// Distance along the leg, m. The length of a leg is the larger of its translation and its rotation, with
        /// [`RADIUS`](super::RADIUS) m for a rotation of 1 rad.
        distance: f64,
        /// Length of the leg, m, computed in the same way as the distance along the leg.
        length: f64,
        /// Error on the leg.
        source: Box<PoseError>,
    },
}

impl PoseError {
    /// Wraps the error with the number of the waypoint, counted from 1.
    pub(crate) fn at_waypoint(self, waypoint: usize) -> Self {
        Self::Waypoint { waypoint, source: Box::new(self) }
    }

    /// Returns the number (from 1) of the waypoint in the message, if the message contains a waypoint. For an error on
    /// a leg, returns the waypoint at the end of the leg.
    pub fn waypoint(&self) -> Option<usize> {
        match self {
            Self::Waypoint { waypoint, .. } => Some(*waypoint),
            Self::Leg { leg, .. } => Some(leg + 1),
            _ => None,
        }
    }

    /// Returns advice on how to correct the error.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => {
                "give a position as three numbers in m, and an orientation as four numbers (x, y, z, w) or three in rad"
            }
            Self::NotUnit { .. } => {
                "give a quaternion as x, y, z, w, with the scalar last, and divide the four numbers by their length"
            }
            Self::NotRotation { .. } => {
                "the columns of a rotation matrix are the axes of the flange in the base frame, each of length 1"
            }
            Self::OutOfReach { .. } => {
                "give positions of the flange in the base frame, in m, without the length of a tool. Move the pose nearer to the arm, or move the \
                 arm"
            }
            Self::Orientation { .. } => {
                "turn the pose, or move it towards the middle of the workspace; roll, pitch and yaw are about the fixed x, y and z axes, in rad"
            }
            Self::OutsideLimits { .. } => {
                "choose another pose, or begin the line with the arm in another configuration (elbow or wrist flipped)"
            }
            Self::Singular(_) => {
                "move the line away from the singular pose, begin it with the arm in another configuration, or go there with a motion in joint space"
            }
            Self::JointStep { .. } => {
                "the line passes near a singular pose: move it away from there, or go there with a motion in joint space"
            }
            Self::Arc { .. } => {
                "give three different points that are not on one line; use two arcs for a full circle"
            }
            Self::NoArc | Self::NoVia => {
                "give an arc as two waypoints: a point on the arc (`via`), then the end of the arc (`arc`)"
            }
            Self::Configuration { .. } => {
                "begin the line with the arm in the configuration of its end, give the end as a pose of the flange, or go there with a motion in joint space"
            }
            Self::HalfTurn => "give a waypoint in between",
            Self::Blend { .. } => "give the blend radius in m, or 0 for a stop at each waypoint",
            Self::NoMotion => "give at least one waypoint with another pose than the waypoint before",
            Self::Waypoint { source, .. } | Self::Leg { source, .. } => source.hint(),
        }
    }
}
