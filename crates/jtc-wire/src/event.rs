//! Events that the parser of a serial line finds, and the form in which a controller receives them.
use crate::frame::FrameRef;
use crate::response::{FrameStatus, Response};

/// Event that the parser found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkEvent<'a> {
    /// A good frame.
    Frame(FrameRef<'a>),
    /// Invalid frame, including the bytes that follow it without a gap.
    Bad(Response),
    /// Run of bytes whose first byte is not the start of a frame.
    Noise(Response),
}

impl LinkEvent<'_> {
    /// Returns the frame status of the response record (J-05).
    pub fn status(&self) -> FrameStatus {
        match self {
            Self::Frame(_) => FrameStatus::NoError,
            Self::Bad(response) | Self::Noise(response) => response.status,
        }
    }
}

/// An event with its serial line and its position in the byte stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReceivedEvent<'a> {
    /// Number of the serial line of the event.
    pub line: usize,
    /// Position of the first byte of the event in the byte stream of its serial line.
    pub position: u64,
    /// `true` for a frame on a plain line. A line is plain if no extension request arrived on it in the 2 s before the first byte
    /// of the frame (J-51).
    pub plain: bool,
    /// The received event.
    pub event: LinkEvent<'a>,
}
