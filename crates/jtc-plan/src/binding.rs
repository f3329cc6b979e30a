//! Which limit binds when.
use std::fmt;

use jtc_wire::Joint;

/// Kind of a limit.
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
    /// A time that was given for a waypoint: the motion could be faster.
    GivenTime,
}

impl LimitKind {
    /// In lower case, for sentences.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Torque => "torque",
            Self::GivenTime => "given time",
        }
    }

    /// Unit of such a limit.
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

/// From when to when which limit of which joint is used up, or comes closest to that: what a faster motion would have to exceed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binding {
    /// s from the start.
    pub from: f64,
    /// s from the start.
    pub to: f64,
    /// The joint that comes closest to its limit.
    pub joint: Joint,
    /// The limit it comes closest to.
    pub limit: LimitKind,
}
