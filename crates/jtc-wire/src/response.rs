//! The record that answers each received frame, and its status codes.
use core::fmt;

use crate::FrameType;

/// Status code of a received frame (J-05).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum FrameStatus {
    #[default]
    Idle = 0,
    NoError = 1,
    IncorrectHeader = 2,
    IncorrectFrameType = 3,
    IncorrectCrc = 4,
    DiscontinuousFrame = 5,
}

impl FrameStatus {
    /// The code of number `byte`.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::Idle,
            1 => Self::NoError,
            2 => Self::IncorrectHeader,
            3 => Self::IncorrectFrameType,
            4 => Self::IncorrectCrc,
            5 => Self::DiscontinuousFrame,
            _ => return None,
        })
    }
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::NoError => "no error",
            Self::IncorrectHeader => "incorrect header",
            Self::IncorrectFrameType => "incorrect frame type",
            Self::IncorrectCrc => "incorrect CRC",
            Self::DiscontinuousFrame => "discontinuous frame",
        }
    }
}

/// Data status code of a received frame (J-06).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum DataStatus {
    #[default]
    Idle = 0,
    NoError = 1,
    TooManyPoints = 2,
    TooManySegments = 3,
    IncorrectSegmentOrder = 4,
    IncorrectStepTime = 5,
    IncorrectValue = 6,
    NotAllowed = 7,
    StartPositionMismatch = 8,
}

impl DataStatus {
    /// The code of number `byte`.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Self::Idle,
            1 => Self::NoError,
            2 => Self::TooManyPoints,
            3 => Self::TooManySegments,
            4 => Self::IncorrectSegmentOrder,
            5 => Self::IncorrectStepTime,
            6 => Self::IncorrectValue,
            7 => Self::NotAllowed,
            8 => Self::StartPositionMismatch,
            _ => return None,
        })
    }
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::NoError => "no error",
            Self::TooManyPoints => "too many points",
            Self::TooManySegments => "too many segments",
            Self::IncorrectSegmentOrder => "incorrect segment order",
            Self::IncorrectStepTime => "incorrect step time",
            Self::IncorrectValue => "incorrect value",
            Self::NotAllowed => "not allowed in this state",
            Self::StartPositionMismatch => "start position mismatch",
        }
    }
}

impl fmt::Display for FrameStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl fmt::Display for DataStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A response record (J-04).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
pub struct Response {
    /// Type byte as received, 0 where unknown.
    pub frame_type: u8,
    /// How the frame arrived.
    pub status: FrameStatus,
    /// What became of its data; Idle unless `status` is NoError.
    pub data: DataStatus,
    /// Bytes received, 0 where unknown.
    pub length: u16,
}

impl Response {
    /// No record.
    pub const NONE: Self = Self::bad(0, FrameStatus::Idle, 0);

    /// The record of a frame that could not be taken.
    pub const fn bad(frame_type: u8, status: FrameStatus, length: u16) -> Self {
        Self { frame_type, status, data: DataStatus::Idle, length }
    }

    /// The record of a good frame.
    pub const fn good(frame_type: FrameType, data: DataStatus, length: u16) -> Self {
        Self { frame_type: frame_type as u8, status: FrameStatus::NoError, data, length }
    }

    /// A status that carries it carries no record.
    pub const fn is_idle(&self) -> bool {
        matches!(self.status, FrameStatus::Idle)
    }

    /// The frame arrived well and was obeyed.
    pub const fn accepted(&self) -> bool {
        matches!((self.status, self.data), (FrameStatus::NoError, DataStatus::NoError))
    }
}

impl fmt::Display for Response {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_idle() {
            return f.write_str("no record");
        }
        match FrameType::from_byte(self.frame_type) {
            Some(t) => write!(f, "{t}")?,
            None => write!(f, "type 0x{:02X}", self.frame_type)?,
        }
        if self.length > 0 {
            write!(f, " of {} bytes", self.length)?;
        }
        write!(f, ": {}", self.status)?;
        if self.status == FrameStatus::NoError {
            write!(f, ", data: {}", self.data)?;
        }
        Ok(())
    }
}
