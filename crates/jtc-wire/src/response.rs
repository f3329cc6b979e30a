//! Response record, which answers each received frame, and its status codes.
use core::fmt;

use crate::FrameType;
use crate::code::codes;

codes! {
    /// Status code of a received frame (J-05).
    #[derive(Default)]
    #[allow(missing_docs)]
    FrameStatus {
        #[default]
        Idle = 0, "idle";
        NoError = 1, "no error";
        IncorrectHeader = 2, "incorrect header";
        IncorrectFrameType = 3, "incorrect frame type";
        IncorrectCrc = 4, "incorrect CRC";
        DiscontinuousFrame = 5, "discontinuous frame";
    }
}

codes! {
    /// Data status code of a received frame (J-06).
    #[derive(Default)]
    #[allow(missing_docs)]
    DataStatus {
        #[default]
        Idle = 0, "idle";
        NoError = 1, "no error";
        TooManyPoints = 2, "too many points";
        TooManySegments = 3, "too many segments";
        IncorrectSegmentOrder = 4, "incorrect segment order";
        IncorrectStepTime = 5, "incorrect step time";
        IncorrectValue = 6, "incorrect value";
        NotAllowed = 7, "not allowed in this state";
        StartPositionMismatch = 8, "start position mismatch";
    }
}

/// Response record (J-04).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash)]
pub struct Response {
    /// Received type byte; 0 if unknown.
    pub frame_type: u8,
    /// Result of receiving the frame.
    pub status: FrameStatus,
    /// Result for the data of the frame; Idle if `status` is not NoError.
    pub data: DataStatus,
    /// Number of received bytes; 0 if unknown.
    pub length: u16,
}

impl Response {
    /// Empty record, which means that the status contains no response.
    pub const NONE: Self = Self::bad(0, FrameStatus::Idle, 0);

    /// Creates the record for an invalid frame or a run of bytes.
    pub const fn bad(frame_type: u8, status: FrameStatus, length: u16) -> Self {
        Self { frame_type, status, data: DataStatus::Idle, length }
    }

    /// Creates the record for a valid frame.
    pub const fn good(frame_type: FrameType, data: DataStatus, length: u16) -> Self {
        Self { frame_type: frame_type as u8, status: FrameStatus::NoError, data, length }
    }

    /// Returns true if a status with this record contains no response.
    pub const fn is_idle(&self) -> bool {
        matches!(self.status, FrameStatus::Idle)
    }

    /// Returns true if the frame was received without a fault and accepted.
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
