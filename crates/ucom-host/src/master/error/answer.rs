//! What was wrong with an answer, and what was last received from a board.
use core::fmt;

use ucom::Function;

/// The last frame that was received from a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastReceived {
    /// What it was.
    pub function: Function,
    /// How long before the error, ms.
    pub ago_ms: u64,
}

/// Prints `last received: MCA_ALIVE 120 ms ago`, or that there was nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received(pub Option<LastReceived>);

impl fmt::Display for Received {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(LastReceived { function, ago_ms }) => {
                write!(f, "last received: {} {ago_ms} ms ago", function.name())
            }
            None => f.write_str("nothing received from it at all"),
        }
    }
}

/// What is wrong with an answer of several frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Incomplete {
    /// The first frame is not what it must be.
    #[error("it began with {len} bytes instead of {need}")]
    Start {
        /// Bytes that came.
        len: u8,
        /// Bytes of the first frame.
        need: u8,
    },
    /// Silence in the middle.
    #[error("{complete} of {of} strings came, then silence")]
    Silence {
        /// Whole strings.
        complete: u32,
        /// How many there should be.
        of: u32,
    },
    /// A frame that fits nowhere.
    #[error("a frame of string {string} fits nowhere")]
    Misfit {
        /// Number of the string, from 0.
        string: u32,
    },
    /// Frames beyond the end.
    #[error("more frames came than the totals allow")]
    Surplus,
    /// More strings than can be.
    #[error("it announces {strings} strings; is the byte order right?")]
    TooMany {
        /// How many.
        strings: u32,
    },
    /// Counts that are small numbers in the other order of bytes.
    #[error(
        "it announces {strings} strings, every count a multiple of 256: the byte order is probably wrong"
    )]
    ByteOrder {
        /// How many.
        strings: u32,
    },
    /// Packages of a buffer are missing.
    #[error("{missing} of {of} packages are missing")]
    Packages {
        /// How many.
        missing: u32,
        /// How many there should be.
        of: u32,
    },
}
