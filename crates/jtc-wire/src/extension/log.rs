//! Pages of the log of the flight recorder (J-56).
use core::fmt;

use crate::code::codes;
use crate::frame::FRAME_MIN;
use crate::layout::{ANSWER_MAX, LOG_HEAD_LEN};

/// Largest number of log bytes in a Log frame, in whole words.
pub const LOG_PAGE: usize = (ANSWER_MAX - FRAME_MIN - LOG_HEAD_LEN) & !3;
/// Block number that no log contains. The answer to a GetLog with this number contains the extent of the log, without bytes.
pub const LOG_NO_BLOCK: u32 = u32::MAX;

codes! {
    /// State of a flight recorder, or the reason why its log ends (J-56).
    #[derive(Default)]
    #[allow(missing_docs)]
    LogState {
        #[default]
        Absent = 0, "no recorder";
        Recording = 1, "recording";
        Error = 2, "stopped after an error";
        Reset = 3, "stopped by a reset of the device";
    }
}

/// Answer to GetLog: bytes of one block of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogPage<'a> {
    /// State of the recorder.
    pub state: LogState,
    /// Number of the block: the requested block, or the oldest block if the requested block no longer exists.
    pub block: u32,
    /// Position of the log bytes in the block.
    pub offset: u16,
    /// Block number that follows the number of the newest block.
    pub end: u32,
    /// Number of points of the trajectory in the memory of the device.
    pub points: u16,
    /// Hash of the points of this trajectory.
    pub points_hash: u32,
    /// Bytes of the log in this frame; empty after the end of the log.
    pub bytes: &'a [u8],
}

impl<'a> LogPage<'a> {
    /// Returns the part of the body before the log bytes.
    pub(crate) fn head(&self) -> [u8; LOG_HEAD_LEN] {
        let [a, b, c, d] = self.block.to_be_bytes();
        let [e, f] = self.offset.to_be_bytes();
        let [g, h, i, j] = self.end.to_be_bytes();
        let [k, l] = self.points.to_be_bytes();
        let [m, n, o, p] = self.points_hash.to_be_bytes();
        [self.state as u8, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]
    }

    /// Parses the body of a Log frame. Returns `None` if the body is too short or its state is unknown.
    pub(crate) fn parse(body: &'a [u8]) -> Option<Self> {
        let (head, bytes) = body.split_first_chunk::<LOG_HEAD_LEN>()?;
        let [state, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *head;
        Some(Self {
            state: LogState::from_byte(state)?,
            block: u32::from_be_bytes([a, b, c, d]),
            offset: u16::from_be_bytes([e, f]),
            end: u32::from_be_bytes([g, h, i, j]),
            points: u16::from_be_bytes([k, l]),
            points_hash: u32::from_be_bytes([m, n, o, p]),
            bytes,
        })
    }
}

impl fmt::Display for LogPage<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { state, block, offset, end, points, points_hash, bytes } = self;
        write!(
            f,
            "Log: {state}, {} bytes of block {block} from {offset} on, up to block {end}",
            bytes.len()
        )?;
        write!(f, "; {points} points, hash {points_hash:08x}")
    }
}
