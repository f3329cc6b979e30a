//! Binding limits of a motion over time.
use std::fmt;

use jtc_wire::Joint;

/// Kind of limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LimitKind {
    /// Joint speed, rad/s.
    Velocity,
    /// Joint acceleration, rad/s².
    Acceleration,
    /// Joint jerk, rad/s³.
    Jerk,
    /// Joint torque, N·m.
    Torque,
    /// A time that the request specifies for a waypoint. The other limits permit a faster motion.
    GivenTime,
}

impl LimitKind {
    /// Returns the name of the limit in lower case, for use in sentences.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Torque => "torque",
            Self::GivenTime => "given time",
        }
    }

    /// Returns the unit of this kind of limit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "rad/s",
            Self::Acceleration => "rad/s²",
            Self::Jerk => "rad/s³",
            Self::Torque => "N·m",
            Self::GivenTime => "s",
        }
    }
}

impl fmt::Display for LimitKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Time interval with its binding limit. The motion reaches or nearly reaches this limit, so a faster motion would
/// exceed the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binding {
    /// Start of the interval, in seconds after the start of the motion.
    pub from: f64,
    /// End of the interval, in seconds after the start of the motion.
    pub to: f64,
    /// Joint that is closest to its limit.
    pub joint: Joint,
    /// Limit to which this joint is closest.
    pub limit: LimitKind,
}
