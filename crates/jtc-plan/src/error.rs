//! Planning errors.
use jtc_wire::Joint;

use crate::LimitKind;
use crate::kinematics::PoseError;
use crate::limits::MARGIN_MAX;

/// Reason why a motion cannot be planned. Waypoints and legs are counted from 1. Leg 1 is the path from waypoint 1 to
/// waypoint 2.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A request with fewer than two waypoints.
    #[error("too few waypoints: {count}, expected at least 2")]
    TooFew {
        /// Number of waypoints.
        count: usize,
    },
    /// A position that is NaN or infinite.
    #[error("waypoint {waypoint}, {}", self.what())]
    NotFinite {
        /// Waypoint, from 1.
        waypoint: usize,
        /// Joint of the position.
        joint: Joint,
        /// Position, rad.
        value: f64,
    },
    /// A position outside the limits.
    #[error("waypoint {waypoint}, {}", self.what())]
    Position {
        /// Number (from 1) of the waypoint outside the limits. If the position is between two waypoints, this is the
        /// number of the waypoint before it.
        waypoint: usize,
        /// Joint of the position.
        joint: Joint,
        /// Position, rad.
        value: f64,
        /// Lowest position, rad.
        min: f64,
        /// Highest position, rad.
        max: f64,
    },
    /// A limit that permits no motion.
    #[error("{joint}: {} limit of {value} {} permits no motion", .limit.name(), .limit.unit())]
    Limit {
        /// Joint of the limit.
        joint: Joint,
        /// Kind of limit.
        limit: LimitKind,
        /// Value of the limit.
        value: f64,
    },
    /// A position range that contains no positions.
    #[error("{joint}: lowest position {min} rad is not below the highest position, {max} rad")]
    Range {
        /// Joint of the range.
        joint: Joint,
        /// Lowest position, rad.
        min: f64,
        /// Highest position, rad.
        max: f64,
    },
    /// A torque margin that is out of range.
    #[error(
        "{joint}: torque margin {} % of the limit is out of range (0–{} %)", 100.0 * .share, 100.0 * MARGIN_MAX
    )]
    Margin {
        /// Joint of the margin.
        joint: Joint,
        /// Share of the torque limit.
        share: f64,
    },
    /// An invalid blend.
    #[error("blend of {value} rad is out of range, expected 0 (a stop at each waypoint) or more")]
    Blend {
        /// Blend, rad.
        value: f64,
    },
    /// An invalid time, or a time that is not later than the previous time.
    #[error("waypoint {waypoint}: time {time} s is not after {before} s")]
    Time {
        /// Waypoint, from 1.
        waypoint: usize,
        /// Time, s.
        time: f64,
        /// Time of the previous waypoint with a time, s.
        before: f64,
    },
    /// A time that the limits do not permit.
    #[error(
        "waypoint {waypoint}: {given:.3} s after waypoint {from} is too early, {joint} needs {shortest:.3} s for its {} limit",
        .limit.name()
    )]
    TooEarly {
        /// Number (from 1) of the previous waypoint with a specified time.
        from: usize,
        /// Waypoint, from 1.
        waypoint: usize,
        /// Joint that needs the longest time.
        joint: Joint,
        /// Limit that this joint reaches.
        limit: LimitKind,
        /// Specified time from waypoint `from` to this waypoint, s.
        given: f64,
        /// Shortest possible time, s. The value is at least 5 % longer than the specified time, because sometimes
        /// only the speed in the adjacent legs makes the specified time impossible.
        shortest: f64,
    },
    /// The torque of a joint is not sufficient at any speed.
    #[error("waypoint {waypoint}, {}", self.what())]
    Torque {
        /// Number (from 1) of the waypoint with the failure, or of the last waypoint before the failure.
        waypoint: usize,
        /// Joint whose torque is not sufficient.
        joint: Joint,
        /// Required torque, N·m.
        torque: f64,
        /// Torque available for this joint, N·m.
        limit: f64,
        /// Torque limit of the joint, N·m; the field `limit` is a share of this torque limit.
        whole: f64,
        /// `true` if the torque is too small even to hold the arm at rest. This position is the start, a stop or the
        /// end of the motion.
        holding: bool,
    },
    /// A path whose positions or derivatives are NaN or infinite, or whose length is 0.
    #[error("leg {leg}: the path has no direction or no finite derivatives at parameter {parameter}")]
    Path {
        /// Leg, from 1.
        leg: usize,
        /// Parameter of the path.
        parameter: f64,
    },
    /// The flange cannot reach the pose, or cannot follow a line or an arc to this pose.
    #[error(transparent)]
    Flange(#[from] PoseError),
    /// The planner found no time law, because of a defect of the planner or extreme values.
    #[error("leg {leg}: no time law within the limits: {reason}")]
    NoTimeLaw {
        /// Leg, from 1.
        leg: usize,
        /// Failure of the solver.
        reason: String,
    },
}

impl PlanError {
    /// Returns the number (from 1) of the waypoint in the message, if the message contains a waypoint. If the message
    /// contains two waypoints, returns the invalid waypoint.
    pub fn waypoint(&self) -> Option<usize> {
        match self {
            Self::NotFinite { waypoint, .. }
            | Self::Position { waypoint, .. }
            | Self::Time { waypoint, .. }
            | Self::TooEarly { waypoint, .. }
            | Self::Torque { waypoint, .. } => Some(*waypoint),
            Self::Flange(error) => error.waypoint(),
            Self::TooFew { .. }
            | Self::Limit { .. }
            | Self::Range { .. }
            | Self::Margin { .. }
            | Self::Blend { .. }
            | Self::Path { .. }
            | Self::NoTimeLaw { .. } => None,
        }
    }

    /// Returns the message. If the error concerns a joint or the flange at a waypoint, the message does not begin with
    /// the waypoint.
    pub fn what(&self) -> String {
        match self {
            Self::NotFinite { joint, value, .. } => format!("{joint}: {value} is not a valid position"),
            Self::Position { joint, value, min, max, .. } => {
                format!("{joint}: {value} rad is outside {min}..{max} rad")
            }
            Self::Torque { joint, torque, limit, whole, holding, .. } => format!(
                "{joint}: {} needs {torque:.1} N·m, more than {limit:.1} N·m ({:.1} % of its limit of {whole:.1} N·m)",
                if *holding { "holding the arm there" } else { "the slowest motion from there" },
                100.0 * limit / whole
            ),
            Self::Flange(PoseError::Waypoint { source, .. }) => source.to_string(),
            _ => self.to_string(),
        }
    }

    /// Returns advice on how to correct the error.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::TooFew { .. } => "give the start and the end of the motion",
            Self::NotFinite { .. } => "correct the waypoint: each joint needs a number, in rad",
            Self::Position { .. } => {
                "move the waypoint inside the limits; all positions are in rad, not in degrees (90° = 1.5708)"
            }
            Self::Limit { .. } | Self::Range { .. } => {
                "correct the limits of the arm, or request a higher speed"
            }
            Self::Margin { .. } => "give a share of 0 to 0.5 of the torque limit",
            Self::Blend { .. } => "give a blend of 0 rad or more",
            Self::Time { .. } => {
                "give times that start at 0 and increase from waypoint to waypoint, or omit the times"
            }
            Self::TooEarly { .. } => {
                "give later times from this waypoint on, or omit the times: the motion is then as fast as possible"
            }
            Self::Torque { holding: true, .. } => {
                "choose a pose that needs less torque (less stretched out), or a lighter payload; a lower speed does not help"
            }
            Self::Torque { .. } => {
                "plan the path around poses that need much torque, or use a lighter payload"
            }
            Self::Path { .. } => "remove waypoints that coincide, and correct waypoints that are not numbers",
            Self::Flange(error) => error.hint(),
            Self::NoTimeLaw { .. } => {
                "use a lower speed or a larger blend; if the error stays, report it with the waypoints"
            }
        }
    }
}
