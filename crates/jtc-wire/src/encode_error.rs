//! Reasons why a number or a frame cannot be encoded.
use core::fmt;

use crate::frame::FrameType;
use crate::segment::{ACCELERATION_SCALE, POSITION_SCALE, VELOCITY_SCALE};

/// A quantity that a trajectory point has for each joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Position, rad.
    Position,
    /// Velocity, rad/s.
    Velocity,
    /// Acceleration, rad/s².
    Acceleration,
}

impl Channel {
    /// Returns the full scale: the largest magnitude that the wire format can represent.
    pub const fn scale(self) -> f64 {
        match self {
            Self::Position => POSITION_SCALE,
            Self::Velocity => VELOCITY_SCALE,
            Self::Acceleration => ACCELERATION_SCALE,
        }
    }
    /// Returns the name of the quantity.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
        }
    }
    /// Returns the unit of `scale`.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Position => "rad",
            Self::Velocity => "rad/s",
            Self::Acceleration => "rad/s²",
        }
    }
}

/// A number that is outside the scale of a trajectory point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfScale {
    /// Joint, 0..5.
    pub joint: usize,
    /// Quantity of the number.
    pub channel: Channel,
    /// Value that is outside the scale, infinite, or NaN.
    pub value: f64,
    /// Largest magnitude that the wire format can represent for the quantity.
    pub limit: f64,
}

impl fmt::Display for OutOfScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, channel, value, limit } = self;
        let unit = channel.unit();
        write!(
            f,
            "{} of joint {joint} is {value} {unit}, but a frame carries only -{limit}..{limit} {unit}",
            channel.name()
        )
    }
}

impl core::error::Error for OutOfScale {}

/// Reason why a frame was not written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EncodeError {
    /// The buffer is too short for the frame.
    BufferTooShort {
        /// Length of the frame, bytes.
        needed: usize,
        /// Length of the buffer, bytes.
        given: usize,
    },
    /// The caller passed more points than a Trajectory frame can contain.
    TooManyPoints {
        /// Number of points that were counted. The caller may have passed more.
        points: usize,
        /// Maximum number of points in a frame.
        limit: usize,
    },
    /// The number of floats is not permitted for the type of the frame.
    WrongCount {
        /// Type of the frame.
        frame_type: FrameType,
        /// Number of floats that were counted. The caller may have passed more.
        count: usize,
    },
    /// A float is infinite, NaN, or too large for an f32.
    NotFinite {
        /// Type of the frame.
        frame_type: FrameType,
        /// Index of the float from 0, in the order of the wire format.
        index: usize,
        /// Value of the float.
        value: f64,
    },
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BufferTooShort { needed, given } => {
                write!(f, "the frame has {needed} bytes, but the buffer has {given}")
            }
            Self::TooManyPoints { points, limit } => {
                write!(f, "{points} points, expected at most {limit} in a frame")
            }
            Self::WrongCount { frame_type, count } => {
                write!(f, "wrong count of numbers for a {frame_type} frame: {count}")
            }
            Self::NotFinite { frame_type, index, value } => {
                write!(
                    f,
                    "{}: {value} is not a number that a frame can carry",
                    FloatName(*frame_type, *index)
                )
            }
        }
    }
}

impl core::error::Error for EncodeError {}

/// Name of a float in a frame: the frame type, and the index of the float, from 0 in the order of the wire format. A float name is
/// displayed as `PidParam joint 3 Ki`, with joints counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatName(pub FrameType, pub usize);

impl FloatName {
    /// Names of the numbers of a link, in the order of the wire format. The first six names are also the names of the numbers of an
    /// origin.
    pub const LINK: [&'static str; 13] =
        ["x", "y", "z", "roll", "pitch", "yaw", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mass"];
}

impl fmt::Display for FloatName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const PID: [&str; 5] = ["Kp", "Ki", "Kd", "IntMin", "IntMax"];
        let Self(kind, index) = *self;
        write!(f, "{kind} ")?;
        match kind {
            FrameType::PidParam => write!(f, "joint {} {}", 1 + index / 5, PID[index % 5]),
            FrameType::ArmModel if index < 36 => {
                write!(f, "joint {} {}", 1 + index / 6, Self::LINK[index % 6])
            }
            FrameType::ArmModel if index < 42 => write!(f, "flange {}", Self::LINK[index % 6]),
            FrameType::ArmModel => write!(f, "link {} {}", (index - 42) / 13, Self::LINK[(index - 42) % 13]),
            FrameType::FrictionTable => {
                let (joint, i) = (1 + index / 440, index % 440);
                match i {
                    0..20 => write!(f, "joint {joint} velocity {i}"),
                    20..40 => write!(f, "joint {joint} temperature {}", i - 20),
                    _ => write!(f, "joint {joint} torque [{}][{}]", (i - 40) / 20, (i - 40) % 20),
                }
            }
            FrameType::Jog => write!(f, "joint {}", 1 + index),
            _ => write!(f, "number {index}"),
        }
    }
}
