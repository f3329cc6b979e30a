//! Settings and counters of a board.

use crate::profile::Profile;

/// Settings of one board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeConfig {
    /// Number chosen when the bootloader was flashed; the low byte of this number is the UCoM id (D-07).
    pub flash_number: u16,
    /// Compatibility profile of this board.
    pub profile: Profile,
    /// Seed of the board's random numbers, which the board uses for the random delays of D-05.
    pub seed: u32,
    /// Time from a reset until the board listens to the bus, µs; at most 200 000 µs (D-07).
    pub boot_us: u64,
    /// Shortest time from the last frame of a block to the board's answer, µs.
    pub block_us: u64,
    /// Time between two control cycles, µs.
    pub control_period_us: u64,
    /// Length of an image in words, used if `prog.header` is `none`; 0 means the length of the complete application area.
    pub headerless_words: u32,
}

impl NodeConfig {
    /// Creates settings with the default profile.
    pub const fn new(flash_number: u16) -> Self {
        Self {
            flash_number,
            profile: Profile::DEFAULT,
            seed: 1,
            boot_us: 20_000,
            block_us: 400,
            control_period_us: 1000,
            headerless_words: 0,
        }
    }
}

/// Counters of a board. The board does not send the counters on the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Number of received frames that do not belong to the UCoM protocol (D-02).
    pub foreign: u32,
    /// Number of messages that were addressed to this board, but had no effect because the state of the board does
    /// not allow them.
    pub ignored: u32,
    /// Number of messages that were too short or had a wrong length (D-12).
    pub wrong_length: u32,
    /// Number of errors that the board did not send because of the rate limit or a full queue.
    pub errors_dropped: u32,
    /// Number of debug texts that the board did not send (D-38).
    pub texts_dropped: u32,
    /// Number of output transfers that the board skipped because the previous transfer was not finished (D-33).
    pub so_skipped: u32,
    /// Number of frames that the CAN controller failed to send.
    pub not_sent: u32,
}
