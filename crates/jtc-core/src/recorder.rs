//! Flight recorder (J-56), which stores the last seconds before an error, tick by tick, in memory that survives a reset.
//!
//! The recorder stores the *inputs* of each tick, usually in eight words, and a check value of the *outputs* of each tick. Every
//! [`SNAPSHOT_MS`], the recorder stores a *snapshot* of the controller state. A [`Replay`] of the log through the controller reproduces all
//! computed values: commanded and measured motion, the parts of the torques, states, and errors. The arm and the points of the trajectory
//! are identified by their hashes.
//!
//! A log *stops* [`AFTER_ERROR_MS`] after the first error and stays in memory until a command clears the log. [`Recorder::record`] executes
//! the commands that clear and read the log. The log is also kept if the device was reset because of a failure. A log in which the
//! controller never had torque is replaced by a new log when the torque is switched on. So an error at the start of a day does not replace
//! a relevant error.
mod block;
mod inputs;
mod memory;
mod reader;
mod recorded;
mod replay;
mod snapshot;
#[cfg(test)]
mod tests;

use jtc_wire::{Answer, LOG_NO_BLOCK, LOG_PAGE, LogPage, LogState, RawPoint};

use crate::bit_codec::{BitCodec, BitSink};
use crate::controller::Controller;
use crate::extension::state::LogRequest;
use crate::io::{Inputs, Outputs};
use inputs::Reference;
use memory::Writer;

#[doc(hidden)]
pub use block::sealed_block;

pub use recorded::{RecordedEvent, RecordedInputs, RecordedKind};
pub use replay::{Log, Outcome, Record, Replay, Step, Unsure};
pub use snapshot::{Origin, Snapshot};

/// Number of words in a block.
pub const BLOCK_WORDS: usize = 256;
/// Block of the recorder's memory.
pub type Block = [u32; BLOCK_WORDS];
/// Number of bytes in a block.
pub const BLOCK_BYTES: usize = 4 * BLOCK_WORDS;

/// Number of ticks from one snapshot to the next.
pub const SNAPSHOT_MS: u16 = 500;
/// Number of ticks that are recorded after the first error (J-56).
pub const AFTER_ERROR_MS: u16 = 300;
/// Number of ticks from one snapshot to the next, if a replay cannot repeat an input between the two snapshots.
const EARLY_SNAPSHOT_MS: u16 = 250;
/// Number of ticks for which recording pauses after the request for a page, so that the block that is being read is not overwritten.
const HELD_MS: u16 = 2_000;

/// The recorder. `P` is a piece of its memory: blocks that keep their contents during a reset and are not cached.
///
/// The board creates a recorder at its start, for any content of the memory, and calls [`record`](Self::record) after every tick.
pub struct Recorder<P, const N: usize> {
    writer: Writer<P, N>,
    reference: Reference,
    /// Check value of the outputs since the last snapshot.
    chain: u32,
    since_snapshot: u16,
    /// A replay cannot repeat an input since the last snapshot, so a snapshot is due earlier.
    uncertain: bool,
    /// An error was latched in the last tick.
    was_in_error: bool,
    /// Number of ticks until the log stops.
    stops_in: Option<u16>,
    /// Number of ticks for which recording still pauses.
    held: u16,
}

impl<P: AsRef<[Block]> + AsMut<[Block]>, const N: usize> Recorder<P, N> {
    /// Creates a recorder with this memory. A log in the memory is kept if the log had stopped, or if the device was reset because it
    /// `failed`. Otherwise a new log begins.
    pub fn new(pieces: [P; N], failed: bool) -> Self {
        let mut writer = Writer::new(pieces);
        if writer.state == LogState::Recording {
            if failed && !writer.is_empty() {
                writer.freeze(LogState::Reset);
            } else {
                writer.clear();
            }
        }
        Self {
            writer,
            reference: Reference::default(),
            chain: 0,
            since_snapshot: 0,
            uncertain: false,
            was_in_error: false,
            stops_in: None,
            held: 0,
        }
    }

    /// Returns the memory, for the recorder after a reset.
    pub fn into_memory(self) -> [P; N] {
        self.writer.into_memory()
    }

    /// Returns the present memory.
    pub fn memory(&self) -> &[P; N] {
        self.writer.memory()
    }

    /// Returns the blocks of the log, oldest first.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        let (oldest, end) = self.writer.range();
        (oldest..end).filter_map(|block| self.writer.block(block))
    }

    /// Returns the state of the recorder, or the reason why it stopped.
    pub fn state(&self) -> LogState {
        self.writer.state
    }

    /// Records a tick that the controller has just executed, and executes the requests of hosts to the recorder. The board calls this after
    /// every tick. A call takes some hundred instructions. Every [`SNAPSHOT_MS`], a call takes some ten thousand instructions.
    #[inline(never)]
    pub fn record<M>(&mut self, controller: &mut Controller<M>, inputs: &Inputs<'_>, outputs: &Outputs)
    where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        controller.hash_arm();
        let errors = controller.errors.word();
        // A held stop is not an error that ends a log (J-69), because a worse error may follow.
        let (in_error, torque) = (controller.errors.any(), controller.state.has_torque());
        let new_error = !core::mem::replace(&mut self.was_in_error, in_error) && in_error;
        if self.writer.state != LogState::Recording && torque && !self.writer.powered {
            self.clear();
        }
        if self.writer.state == LogState::Recording {
            self.take(controller, errors, inputs, outputs, new_error);
        }
        if let Some(request) = controller.extensions.log_request.take() {
            self.serve(controller, request);
        }
        controller.extensions.log = self.writer.state;
    }

    /// Records one tick of a log that continues.
    fn take<M>(
        &mut self,
        controller: &Controller<M>,
        errors: u16,
        inputs: &Inputs<'_>,
        outputs: &Outputs,
        new_error: bool,
    ) where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        let torque = controller.state.has_torque();
        if torque && !self.writer.powered {
            // An error before the first torque does not stop the log.
            self.stops_in = None;
            self.writer.set_powered();
        }
        if self.held > 0 {
            // A new error ends the pause, so that the error is recorded.
            self.held = if new_error { 0 } else { self.held - 1 };
            if self.held > 0 {
                return;
            }
            self.writer.begin();
            self.snapshot(controller);
        } else if self.writer.is_empty() {
            // The hash of the arm is available some ticks after the start.
            if controller.extensions.hash.is_none() && !new_error {
                return;
            }
            self.writer.begin();
            self.snapshot(controller);
        } else {
            self.tick(controller, errors, inputs, outputs);
        }
        self.writer.commit();
        if new_error && self.stops_in.is_none() {
            self.stops_in = Some(AFTER_ERROR_MS);
        } else if let Some(left) = &mut self.stops_in {
            *left -= 1;
            if *left == 0 {
                self.stops_in = None;
                self.writer.freeze(LogState::Error);
            }
        }
    }

    fn tick<M>(&mut self, controller: &Controller<M>, errors: u16, inputs: &Inputs<'_>, outputs: &Outputs)
    where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        self.chain = chain(self.chain, controller, errors, outputs);
        let check = check(self.chain);
        self.uncertain |= !self.reference.write(inputs, outputs.host_done, check, &mut self.writer);
        self.since_snapshot += 1;
        let due = if self.uncertain { EARLY_SNAPSHOT_MS } else { SNAPSHOT_MS };
        // While the parameters of the arm change, the hash of the arm is not available. This time is short, unless a host sends parameters
        // again and again.
        let named = controller.extensions.hash.is_some() || self.since_snapshot >= 2 * SNAPSHOT_MS;
        if self.since_snapshot >= due && named {
            self.snapshot(controller);
        }
    }

    #[inline(never)]
    fn snapshot<M>(&mut self, controller: &Controller<M>)
    where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        self.writer.mark_snapshot();
        self.writer.put(1, 1);
        controller.origin().write(&mut self.writer);
        controller.write_state(&mut self.writer);
        self.writer.align();
        (self.reference, self.chain) = (Reference::default(), 0);
        (self.since_snapshot, self.uncertain) = (0, false);
    }

    /// Discards the log and begins a new one, as after a ClearLog.
    pub fn clear(&mut self) {
        self.writer.clear();
        (self.stops_in, self.held) = (None, 0);
    }

    fn serve<M>(&mut self, controller: &mut Controller<M>, request: LogRequest)
    where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        let LogRequest::Page { line, block, offset } = request else {
            self.clear();
            return;
        };
        let reads = block != LOG_NO_BLOCK && !self.writer.is_empty();
        if self.writer.state == LogState::Recording && self.stops_in.is_none() && reads {
            // The ticks after an error are more important, so recording does not pause then.
            self.held = HELD_MS;
        }
        let (oldest, end) = self.writer.range();
        // Blocks that no longer exist are skipped.
        let (block, offset) = if block < oldest { (oldest, 0) } else { (block, offset) };
        let mut bytes = [0; LOG_PAGE];
        let read = self.writer.read(block, usize::from(offset) & !3, &mut bytes);
        let (points_hash, points) = controller.store.points_hash();
        let page = LogPage {
            state: self.writer.state,
            block,
            offset: offset & !3,
            end,
            points: points as u16,
            points_hash,
            bytes: bytes.get(..read).unwrap_or(&[]),
        };
        controller.extensions.answers.put(line, &Answer::Log(page));
    }
}

/// Adds the outputs of a tick to the check value of the earlier ticks.
fn chain<M>(chain: u32, controller: &Controller<M>, errors: u16, outputs: &Outputs) -> u32 {
    let mix = |hash: u32, word: u32| (hash.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B1);
    let states = u32::from(errors) << 16
        | (controller.state as u32) << 8
        | (controller.trajectory as u32) << 4
        | u32::from(outputs.safety_output);
    let hash = mix(chain, states);
    let Some(frame) = &outputs.bus else { return hash };
    let hash = mix(hash, frame.id.into());
    match frame.data().first_chunk::<16>() {
        // For a Move, all torques and the state of the pump are added.
        Some(bytes) => {
            bytes.as_chunks::<4>().0.iter().fold(hash, |hash, word| mix(hash, u32::from_le_bytes(*word)))
        }
        None => frame.data().iter().fold(hash, |hash, byte| mix(hash, (*byte).into())),
    }
}

/// Returns the part of the check value that is recorded. A part is sufficient, because each check value covers all earlier ticks since the
/// snapshot.
fn check(chain: u32) -> u16 {
    (chain >> 16) as u16
}
