//! Progress of the transfer of a new application.

use super::config::NodeConfig;
use super::hardware::Area;
use crate::header::{BLOCK_LEN, Header, Memory};
use crate::profile::Profile;
use crate::program::Digest;

/// Work that the board performs after it has received a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// The board waits for frames.
    None,
    /// The board has received a complete block, and will process it at this time (µs).
    Block(u64),
    /// The board will clear the validity record before it erases the flash.
    ClearRecord,
    Erase,
    AwaitErase,
    AwaitWrite,
    /// The board reads the image back from flash; the value is the number of bytes read so far.
    Verify(u32),
    WriteRecord,
    AwaitRecord,
    /// The board is sending DSP_READY. Until DSP_READY has been sent, the block buffer must not change.
    Answer,
}

/// Cycle of the transfer that is in progress.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    pub header: Header,
    pub area: Area,
    pub memory: Memory,
    /// `true` if the data of the cycle are written to memory; `false` if the data are only checked.
    pub writes: bool,
    /// Number of bytes of the image that were received so far.
    pub done: u32,
    /// Checksum of the data received so far. During the verification, the checksum of the data that the board reads
    /// back from flash.
    pub digest: Digest,
}

impl Cycle {
    pub(super) fn bytes(&self) -> u32 {
        self.header.length.saturating_mul(2)
    }
}

/// State of the transfer of an application.
#[derive(Clone, Debug)]
pub(super) struct Programming {
    pub block: [u8; BLOCK_LEN],
    pub filled: usize,
    pub last_frame_us: u64,
    pub work: Work,
    /// Number of the cycle, 1 or 2.
    pub number: u16,
    pub cycle: Option<Cycle>,
    /// Header of the first cycle; `None` until that cycle has ended.
    pub first: Option<Header>,
    /// `true` after an error: the board drops program data silently (D-43).
    pub discard: bool,
}

impl Programming {
    pub(super) fn new(_: &Profile) -> Self {
        Self {
            block: [0; BLOCK_LEN],
            filled: 0,
            last_frame_us: 0,
            work: Work::None,
            number: 1,
            cycle: None,
            first: None,
            discard: false,
        }
    }

    /// Starts a new transfer with cycle 1.
    pub(super) fn restart(&mut self, profile: &Profile) {
        *self = Self::new(profile);
    }

    /// Drops the transfer that is in progress. If an error occurred before, the board continues to ignore program data.
    pub(super) fn cancel(&mut self, profile: &Profile) {
        *self = Self { discard: self.discard, ..Self::new(profile) };
    }

    pub(super) const fn discarding(&self) -> bool {
        self.discard
    }

    /// Enables the reception of the next block. The node calls this function when DSP_READY has been sent.
    pub(super) fn answered(&mut self) {
        if self.work == Work::Answer {
            self.work = Work::None;
        }
    }

    pub(super) fn deadline(&self, now_us: u64, config: &NodeConfig) -> u64 {
        let pause = u64::from(config.profile.prog_frame_timeout) * 1000 + 1;
        match self.work {
            Work::None if self.filled > 0 => self.last_frame_us.saturating_add(pause),
            Work::None | Work::Answer => u64::MAX,
            Work::Block(at) => at,
            Work::Verify(_) => 0,
            // The node polls the state of the flash again after 500 µs.
            _ => now_us.saturating_add(500),
        }
    }
}
