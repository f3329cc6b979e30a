//! Messages of the PC and of the boards, and their conversion to and from frames.
//!
//! The PC and the boards send functions 22, 24 and 26 with the same identifier (D-05). Therefore the caller must know
//! the sender of a frame. The caller decodes frames of the PC with [`ToBoard`], and frames of a board with
//! [`FromBoard`].

mod from_board;
mod to_board;

use core::fmt;

pub use from_board::FromBoard;
pub use to_board::ToBoard;

use crate::foreign::Foreign;
use crate::frame::{Frame, Payload};
use crate::function::Function;
use crate::profile::Profile;

/// Reasons why a frame is not a message in the expected direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// The frame does not belong to the UCoM protocol (D-02).
    Foreign(Foreign),
    /// The frame is a message that only the opposite side sends (D-04).
    Direction(Function),
    /// The frame contains fewer bytes than the message needs (D-12).
    TooShort {
        /// Function of the frame.
        function: Function,
        /// Number of bytes in the frame.
        len: u8,
        /// Number of bytes that the message needs.
        need: u8,
    },
    /// The length of the message is not one of its valid lengths (D-12). With `dlc.strict`, only the exact length is valid.
    Length {
        /// Function of the frame.
        function: Function,
        /// Number of bytes in the frame.
        len: u8,
    },
    /// A flag of the message is neither 0 nor 1 (D-37).
    Value(Function),
}

impl DecodeError {
    /// Returns `true` if the length of the message is wrong. In this case, a board sends DSP_ERROR 7.
    pub const fn is_length(&self) -> bool {
        matches!(self, Self::TooShort { .. } | Self::Length { .. })
    }
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign(foreign) => write!(f, "{foreign}"),
            Self::Direction(function) => write!(f, "{function} is not sent in this direction"),
            Self::TooShort { function, len, need } => {
                write!(f, "{function} has {len} bytes, expected at least {need}")
            }
            Self::Length { function, len } => write!(f, "{function} cannot have {len} bytes"),
            Self::Value(function) => write!(f, "{function} has a flag that is neither 0 nor 1"),
        }
    }
}

impl core::error::Error for DecodeError {}

/// Returns the payload of the frame if it has at least `need` bytes. With `dlc.strict`, the payload must have exactly `need` bytes.
fn need(frame: &Frame, function: Function, need: u8, profile: &Profile) -> Result<Payload, DecodeError> {
    let len = frame.dlc();
    if len < need {
        return Err(DecodeError::TooShort { function, len, need });
    }
    if profile.dlc_strict && len != need {
        return Err(DecodeError::Length { function, len });
    }
    Ok(frame.payload())
}

#[cfg(test)]
mod tests;
