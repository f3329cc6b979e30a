//! Log of the flight recorder. These modules fetch the log from a device, store the log in a file, and replay the log through the
//! controller (J-56).
//!
//! [`FlightLog`] contains the data from a device: the blocks of its log, the active arm, and the trajectory points that the log needs.
//! [`FlightLog::replay`] returns every tick with all values that the controller computed. The replay marks each tick that equals the
//! original tick bit for bit. [`Timeline`] lists the events of the log in order, with the first error at the top.

mod container;
mod replay;
mod replay_report;
mod timeline;

pub use container::LogFileError;
pub use replay::{Difference, Gap, Replayed, Tick, Worth};
pub use replay_report::Account;
pub use timeline::{Event, Timeline};

use jtc_core::recorder::{BLOCK_WORDS, Block, Log, Record};
use jtc_wire::{LogState, RawPoint};

/// Maximum time between two snapshots of the controller in a log, in ticks of 1 ms.
const SPAN_MS: f64 = 1_100.0;

/// Data of the flight recorder that a device returned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FlightLog {
    /// Reason why the log ends.
    pub state: LogState,
    /// Blocks of the log, the oldest first.
    pub blocks: Vec<Block>,
    /// Image of the arm that was active when the log was fetched, as a [`jtc_wire::ArmImage`].
    pub arm: Vec<u8>,
    /// Trajectory index of the first point in `points`.
    pub first_point: usize,
    /// Points of the trajectory that the log needs.
    pub points: Vec<RawPoint>,
    /// Hash of all trajectory points in the memory of the device.
    pub points_hash: u32,
    /// Description of the device and its firmware.
    pub device: String,
}

impl FlightLog {
    /// Returns a reader of the records in the blocks.
    pub fn log(&self) -> Log<'_> {
        Log::new(&self.blocks)
    }

    /// Returns `true` if the log contains no record.
    pub fn is_empty(&self) -> bool {
        self.log().next().is_none()
    }

    /// Returns the trajectory points that a replay of the log needs: the index of the first point and the number of
    /// points. `hash` identifies the trajectory. Returns `None` if the log contains no motion along this trajectory.
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
        // Some points after the last position in the log are also needed, as far as the trajectory has them.
        let end = ((high as usize).saturating_add(3)).min(total);
        (end > first).then_some((first, end - first))
    }
}

/// Splits the bytes of log pages into blocks. The function ignores an incomplete block at the end of the bytes.
pub(crate) fn blocks_of(bytes: &[u8]) -> Vec<Block> {
    let words = bytes.as_chunks::<4>().0;
    words.as_chunks::<BLOCK_WORDS>().0.iter().map(|block| block.map(u32::from_le_bytes)).collect()
}
