//! Why the flange cannot be brought somewhere.
use jtc_wire::Joint;

use super::singular::Singularity;

/// Why there are no joint positions for a pose of the flange, or no way along a line of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// A number is NaN or infinite.
    #[error("{what} is {value}, not a finite number")]
    NotFinite {
        /// What it is, such as `position x`.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// A quaternion of another length than 1.
    #[error("the quaternion has the length {length:.6}, that of an orientation has 1")]
    NotUnit {
        /// Its length.
        length: f64,
    },
    /// A rotation matrix that is not one.
    #[error("the rotation matrix is none: its axes miss length 1 and right angles by {deviation:.2e}")]
    NotRotation {
        /// Largest entry of RᵀR − 1, or 2 for a reflection.
        deviation: f64,
    },
    /// The arm is too short, or too bulky, to have the flange there in any orientation.
    #[error(
        "out of reach: {distance:.3} m from the origin of the base, and the flange comes no nearer to it than {missing:.4} m"
    )]
    OutOfReach {
        /// From the origin of the base to the position, m.
        distance: f64,
        /// From the nearest position of the flange that was found to the one that was asked for, m.
        missing: f64,
    },
    /// The flange can be there, but not in this orientation.
    #[error(
        "out of reach in this orientation: the flange can be there, {distance:.3} m from the origin of the base, but turned by {missing:.3} rad \
         against it at the nearest"
    )]
    Orientation {
        /// From the origin of the base to the position, m.
        distance: f64,
        /// From the nearest orientation of the flange there that was found to the one that was asked for, rad.
        missing: f64,
    },
    /// The arm would reach it with a joint outside its limits only.
    #[error("{joint} would be at {value:.4} rad, its limits are {low:.4} and {high:.4} rad")]
    OutsideLimits {
        /// The joint that is farthest outside, in the solution that is the least outside.
        joint: Joint,
        /// Its position there, rad.
        value: f64,
        /// Lowest position, rad.
        low: f64,
        /// Highest position, rad.
        high: f64,
    },
    /// A line of the flange leads through or past a singular pose.
    #[error("{0}")]
    Singular(Singularity),
    /// A line of the flange asks a joint to turn far within a moment.
    #[error("{joint} would have to turn by {step:.3} rad within {distance:.6} m")]
    JointStep {
        /// The joint.
        joint: Joint,
        /// By how much it would have to turn, rad.
        step: f64,
        /// Within which distance on the line, m.
        distance: f64,
    },
    /// Three points that are on no circle.
    #[error(
        "the arc's three points are on no circle: the second is {distance:.2e} m from the line through the others"
    )]
    Arc {
        /// Distance of the second from the straight line, m; 0 where first and last point are the same.
        distance: f64,
    },
    /// Two orientations that are half a turn apart.
    #[error("the orientation is half a turn from that of the waypoint before: which way to turn is open")]
    HalfTurn,
    /// A point on an arc, and no arc behind it.
    #[error("a point on the way of an arc (`via`), and the waypoint behind it is not the end of an arc")]
    NoArc,
    /// An arc without the point that it passes.
    #[error("the end of an arc, and the waypoint before it is not a point on the arc's way (`via`)")]
    NoVia,
    /// Joint positions at the end of a line that the arm does not have there.
    #[error(
        "the line ends there with {joint} at {value:.4} rad, not at {wanted:.4} rad: the arm keeps its configuration along a line"
    )]
    Configuration {
        /// The joint that is farthest away.
        joint: Joint,
        /// Its position at the end of the line, rad.
        value: f64,
        /// That of the waypoint, rad.
        wanted: f64,
    },
    /// A blend radius that is no length.
    #[error("a blend radius of {radius} m")]
    Blend {
        /// What was given, m.
        radius: f64,
    },
    /// A path without a leg that moves the flange.
    #[error("the path has no leg that moves the flange")]
    NoMotion,
    /// What happens at one of several waypoints.
    #[error("waypoint {waypoint}: {source}")]
    Waypoint {
        /// Counted from 1.
        waypoint: usize,
        /// What it is.
        source: Box<PoseError>,
    },
    /// What happens on one of several legs.
    #[error("leg {leg} (to waypoint {}), {distance:.4} m of {length:.4} m along it: {source}", leg + 1)]
    Leg {
        /// Counted from 1; it leads from the waypoint with the same number to the next.
        leg: usize,
        /// How far along the leg, m (a turn of 1 rad counts as [`RADIUS`](super::RADIUS) m where it is more than the way).
        distance: f64,
        /// How long the leg is, in the same unit.
        length: f64,
        /// What it is.
        source: Box<PoseError>,
    },
}

impl PoseError {
    /// The same, of the waypoint with this number, counted from 1.
    pub(crate) fn at_waypoint(self, waypoint: usize) -> Self {
        Self::Waypoint { waypoint, source: Box::new(self) }
    }

    /// The waypoint that it is about, counted from 1, where its message names one: of a leg the one that it leads to.
    pub fn waypoint(&self) -> Option<usize> {
        match self {
            Self::Waypoint { waypoint, .. } => Some(*waypoint),
            Self::Leg { leg, .. } => Some(leg + 1),
            _ => None,
        }
    }

    /// What helps.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NotFinite { .. } => {
                "positions are three numbers in m, orientations four (x, y, z, w) or three in rad"
            }
            Self::NotUnit { .. } => {
                "quaternions are given as x, y, z, w, the scalar last, and have length 1: divide the four by their length"
            }
            Self::NotRotation { .. } => {
                "the columns of a rotation matrix are the axes of the flange in the base frame, each of length 1"
            }
            Self::OutOfReach { .. } => {
                "positions are those of the flange in the base frame, in m; a tool's length is not part of it. Move the pose nearer, or the arm"
            }
            Self::Orientation { .. } => {
                "turn the pose, or move it towards the middle of the workspace; roll, pitch and yaw are about the fixed x, y and z axes, in rad"
            }
            Self::OutsideLimits { .. } => {
                "choose another pose, or a line that begins with the arm in another configuration (elbow or wrist the other way)"
            }
            Self::Singular(_) => {
                "move the line away from the singular pose, begin it with the arm in another configuration, or go there with a motion in joint space"
            }
            Self::JointStep { .. } => {
                "the line passes near a singular pose: move it away from there, or go there with a motion in joint space"
            }
            Self::Arc { .. } => {
                "an arc needs three different points that are not in line; a full circle is two arcs"
            }
            Self::NoArc | Self::NoVia => {
                "an arc is two waypoints: a point on its way (`via`), and behind it its end (`arc`)"
            }
            Self::Configuration { .. } => {
                "begin the line with the arm in the configuration of its end, give the end as a pose of the flange, or go there with a motion in joint space"
            }
            Self::HalfTurn => "give a waypoint in between",
            Self::Blend { .. } => "a blend radius is a length in m, 0 for a stop at each waypoint",
            Self::NoMotion => "give at least one waypoint whose pose is another than the one before",
            Self::Waypoint { source, .. } | Self::Leg { source, .. } => source.hint(),
        }
    }
}
