//! Why there is no motion.
use jtc_wire::Joint;

use crate::LimitKind;
use crate::kinematics::PoseError;
use crate::limits::MARGIN_MAX;

/// Why there is no motion. Waypoints and legs are counted from 1; leg 1 leads from waypoint 1 to waypoint 2.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// No way from one waypoint, or from none.
    #[error("a motion takes at least 2 waypoints; given: {count}")]
    TooFew {
        /// Waypoints given.
        count: usize,
    },
    /// A position that is no number.
    #[error("waypoint {waypoint}, {}", self.what())]
    NotFinite {
        /// From 1.
        waypoint: usize,
        /// Of this joint.
        joint: Joint,
        /// rad.
        value: f64,
    },
    /// A position outside the limits.
    #[error("waypoint {waypoint}, {}", self.what())]
    Position {
        /// The one that is outside, or the one before the place that is; from 1.
        waypoint: usize,
        /// Of this joint.
        joint: Joint,
        /// rad.
        value: f64,
        /// rad.
        min: f64,
        /// rad.
        max: f64,
    },
    /// A limit within which nothing can move.
    #[error("{joint}: {} limit of {value} {} leaves no motion", .limit.name(), .limit.unit())]
    Limit {
        /// Of this joint.
        joint: Joint,
        /// Which limit.
        limit: LimitKind,
        /// Its value.
        value: f64,
    },
    /// A range without positions.
    #[error("{joint}: lowest position {min} rad is not below the highest one, {max} rad")]
    Range {
        /// Of this joint.
        joint: Joint,
        /// rad.
        min: f64,
        /// rad.
        max: f64,
    },
    /// A torque margin that is out of range.
    #[error(
        "{joint}: torque margin {} % of the limit is out of range (0–{} %)", 100.0 * .share, 100.0 * MARGIN_MAX
    )]
    Margin {
        /// Of this joint.
        joint: Joint,
        /// Share of the torque limit.
        share: f64,
    },
    /// A blend that is none.
    #[error("blend of {value} rad; it is 0 (a stop at each waypoint) or more")]
    Blend {
        /// rad.
        value: f64,
    },
    /// A time that is none, or is not after the one before it.
    #[error("waypoint {waypoint}: time {time} s is not after {before} s")]
    Time {
        /// From 1.
        waypoint: usize,
        /// s.
        time: f64,
        /// Time of the waypoint that was given one before it, s.
        before: f64,
    },
    /// A time that the limits do not allow.
    #[error(
        "waypoint {waypoint}: {given:.3} s after waypoint {from} is too early, {joint} needs {shortest:.3} s for its {} limit",
        .limit.name()
    )]
    TooEarly {
        /// The waypoint with the given time before, from 1.
        from: usize,
        /// From 1.
        waypoint: usize,
        /// The joint that needs the longest.
        joint: Joint,
        /// The limit that it comes up to.
        limit: LimitKind,
        /// Time given from that waypoint to this one, s.
        given: f64,
        /// Shortest possible, s; a twentieth more than given where only the legs beside it leave nothing over.
        shortest: f64,
    },
    /// The torque does not suffice however slow the motion is.
    #[error("waypoint {waypoint}, {}", self.what())]
    Torque {
        /// Where, or the one before the place where; from 1.
        waypoint: usize,
        /// Of this joint.
        joint: Joint,
        /// N·m.
        torque: f64,
        /// What is left for that, N·m.
        limit: f64,
        /// The torque limit, of which that is a share, N·m.
        whole: f64,
        /// The arm could not even be held there, where the motion begins, rests or ends.
        holding: bool,
    },
    /// A path whose positions or derivatives are no numbers, or that has no length.
    #[error("leg {leg}: the path has no direction or no finite derivatives at parameter {parameter}")]
    Path {
        /// From 1.
        leg: usize,
        /// The path's own.
        parameter: f64,
    },
    /// The flange cannot be brought there, or not along a line or an arc.
    #[error(transparent)]
    Flange(#[from] PoseError),
    /// No law of time was found, which is a fault of the planner or numbers beyond what it can compute with.
    #[error("leg {leg}: no time law within the limits: {reason}")]
    NoTimeLaw {
        /// From 1.
        leg: usize,
        /// What failed.
        reason: String,
    },
}

impl PlanError {
    /// The waypoint that it is about, counted from 1, where its message names one: of two, the one where it is wrong.
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

    /// The message without the waypoint that it begins with, where the joint or the flange is wrong at one.
    pub fn what(&self) -> String {
        match self {
            Self::NotFinite { joint, value, .. } => format!("{joint}: {value} is no position"),
            Self::Position { joint, value, min, max, .. } => {
                format!("{joint}: {value} rad is outside {min}..{max} rad")
            }
            Self::Torque { joint, torque, limit, whole, holding, .. } => format!(
                "{joint}: {} takes {torque:.1} N·m, more than {limit:.1} N·m ({:.1} % of its limit of {whole:.1} N·m)",
                if *holding { "holding the arm there" } else { "the slowest motion from there" },
                100.0 * limit / whole
            ),
            Self::Flange(PoseError::Waypoint { source, .. }) => source.to_string(),
            _ => self.to_string(),
        }
    }

    /// What helps.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::TooFew { .. } => "give where the motion starts and where it ends",
            Self::NotFinite { .. } => "correct the waypoint: each joint has a number, in rad",
            Self::Position { .. } => {
                "move the waypoint inside the limits; is it in degrees? All positions are in rad (90° = 1.5708)"
            }
            Self::Limit { .. } | Self::Range { .. } => {
                "correct the limits of the arm, or ask for a higher speed"
            }
            Self::Margin { .. } => "give a share of 0 to 0.5 of the torque limit",
            Self::Blend { .. } => "give a blend of 0 rad or more",
            Self::Time { .. } => {
                "let the times rise from waypoint to waypoint, beginning at 0, or leave them out"
            }
            Self::TooEarly { .. } => {
                "give a later time from there on, or leave the times out: the motion is then as fast as it can be"
            }
            Self::Torque { holding: true, .. } => {
                "choose a pose that takes less torque (less stretched out), or a lighter payload; speed does not change it"
            }
            Self::Torque { .. } => {
                "lead the path around poses that take much torque, or carry a lighter payload"
            }
            Self::Path { .. } => "remove waypoints that coincide, and correct those that are no numbers",
            Self::Flange(error) => error.hint(),
            Self::NoTimeLaw { .. } => {
                "ask for a lower speed or a larger blend; if it stays, report it with the waypoints"
            }
        }
    }
}
