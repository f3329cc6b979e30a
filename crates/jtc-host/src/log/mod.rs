//! The flight recorder's log: fetched from a device, kept in a file, and run through the controller again (J-56).
//!
//! [`FlightLog`] is what a device returns: the blocks of its log, the arm that it has in use, and the points of the trajectory that the log
//! needs. [`FlightLog::replay`] gives every tick of it with everything that the controller computed, and says which of them are known to be
//! what was, bit for bit. [`Story`] puts what happened in order, what broke first in front.

mod account;
mod container;
mod replay;
mod story;

pub use account::Account;
pub use container::LogFileError;
pub use replay::{Difference, Gap, Replayed, Tick, Worth};
pub use story::{Event, Story};

use jtc_core::recorder::{BLOCK_WORDS, Block, Log, Record};
use jtc_wire::{LogState, RawPoint};

/// Ticks that follow a snapshot at most until the next.
const SPAN_MS: f64 = 1_100.0;

/// What a device returned of its flight recorder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlightLog {
    /// Why the log ends.
    pub state: LogState,
    /// Blocks, oldest first.
    pub blocks: Vec<Block>,
    /// The arm in use when it was fetched: a [`jtc_wire::ArmImage`].
    pub arm: Vec<u8>,
    /// Number of the first of these points in the trajectory.
    pub first_point: usize,
    /// Points of the trajectory, as many as the log needs.
    pub points: Vec<RawPoint>,
    /// Hash of all points in the memory of the device.
    pub points_hash: u32,
    /// Device and firmware, in words.
    pub device: String,
}

impl FlightLog {
    /// The blocks as a log.
    pub fn log(&self) -> Log<'_> {
        Log::new(&self.blocks)
    }

    /// Nothing is in it.
    pub fn is_empty(&self) -> bool {
        self.log().next().is_none()
    }

    /// The points that the ticks of the log need of the trajectory in the device's memory, which has this hash: first and how many; none
    /// where no motion along it was recorded.
    pub fn needed_points(&self, hash: u32, total: usize) -> Option<(usize, usize)> {
        let mut needed: Option<(f64, f64)> = None;
        let mut need = |from: f64, to: f64| {
            needed = Some(needed.map_or((from, to), |(low, high)| (low.min(from), high.max(to))));
        };
        let mut begins = None;
        for record in self.log() {
            match record {
                Record::Snapshot(snapshot) if snapshot.origin.points_hash == hash => {
                    let (time, step) = snapshot.path_ms();
                    let step = f64::from(step.max(1));
                    if snapshot.needs_points() {
                        need(time / step, (time + SPAN_MS) / step);
                    }
                    begins = Some(step);
                }
                Record::Snapshot(_) => begins = None,
                Record::Tick { inputs, .. } => {
                    let executes = inputs
                        .host()
                        .iter()
                        .any(|event| event.frame_type == jtc_wire::FrameType::TrajSetExecStatus as u8);
                    if let Some(step) = begins.filter(|_| executes) {
                        need(0.0, SPAN_MS / step);
                    }
                }
            }
        }
        let (low, high) = needed?;
        let first = (low.max(0.0) as usize).saturating_sub(1).min(total);
        // The last point stands for all behind it.
        let end = ((high as usize).saturating_add(3)).min(total);
        (end > first).then_some((first, end - first))
    }
}

/// Blocks from their bytes, as pages bring them; a rest that is no whole block is left out.
pub(crate) fn blocks_of(bytes: &[u8]) -> Vec<Block> {
    let words = bytes.as_chunks::<4>().0;
    words.as_chunks::<BLOCK_WORDS>().0.iter().map(|block| block.map(u32::from_le_bytes)).collect()
}
