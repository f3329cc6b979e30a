//! Flight recorder (J-56): stores the last seconds before an error, tick by tick, in memory that survives a reset.
//!
//! The recorder stores the *inputs* of each tick, usually in eight words, and a check value of the *outputs* of each tick. Every
//! [`SNAPSHOT_MS`], the recorder stores a *snapshot* of the controller state. A [`Replay`] of the log through the controller reproduces all
//! computed values: commanded and measured motion, the parts of the torques, states, and errors. A log identifies the arm and the points of
//! the trajectory by their hashes.
//!
//! A log *stops* [`AFTER_ERROR_MS`] after the first error and stays in memory until a command clears the log. [`Recorder::record`] executes
//! the commands that clear and read the log. The log also stays in memory if the device was reset because of a failure. If the controller
//! never had torque during a log, the recorder replaces this log by a new log when the torque is switched on. An error before the first
//! torque of a day therefore does not keep the recorder from recording a later error.
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
/// Number of ticks for which recording pauses after a host has requested a page. The pause prevents the recorder from
/// overwriting the block that is being read.
const HELD_MS: u16 = 2_000;

/// Flight recorder of a controller. `P` is a piece of the recorder's memory: blocks that keep their contents during a reset and are not
/// cached.
///
/// The board creates a recorder at its start, for any content of the memory, and calls [`record`](Self::record) after every tick.
pub struct Recorder<P, const N: usize> {
    writer: Writer<P, N>,
    reference: Reference,
    /// Check value of the outputs since the last snapshot.
    chain: u32,
    since_snapshot: u16,
    /// `true` if a replay cannot repeat an input since the last snapshot, so that the next snapshot is due earlier.
    uncertain: bool,
    /// `true` if an error was latched in the last tick.
    was_in_error: bool,
    /// Number of ticks until the log stops.
    stops_in: Option<u16>,
    /// Remaining number of ticks for which recording pauses.
    held: u16,
}

impl<P: AsRef<[Block]> + AsMut<[Block]>, const N: usize> Recorder<P, N> {
    /// Creates a recorder with these `pieces` of memory. The recorder keeps a log in the memory if this log had stopped, or if the device
    /// was reset because it `failed`. In all other cases, a new log begins.
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

    /// Returns the memory of the recorder. A simulation or a test creates the recorder after a reset from this memory.
    pub fn into_memory(self) -> [P; N] {
        self.writer.into_memory()
    }

    /// Returns the memory of the recorder.
    pub fn memory(&self) -> &[P; N] {
        self.writer.memory()
    }

    /// Returns the blocks of the log, oldest first.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        let (oldest, end) = self.writer.range();
        (oldest..end).filter_map(|block| self.writer.block(block))
    }

    /// Returns the state of the recorder, which contains the reason if the recorder has stopped.
    pub fn state(&self) -> LogState {
        self.writer.state
    }

    /// Records a tick that the controller has just executed, and executes the requests of hosts to the recorder. The board calls this
    /// function after every tick. A call usually takes some hundred instructions. Every [`SNAPSHOT_MS`], a call writes a snapshot and takes
    /// some ten thousand instructions.
    #[inline(never)]
    pub fn record<M>(&mut self, controller: &mut Controller<M>, inputs: &Inputs<'_>, outputs: &Outputs)
    where
        M: AsRef<[RawPoint]> + AsMut<[RawPoint]>,
    {
        controller.hash_arm();
        let errors = controller.errors.word();
        // A held stop does not end a log (J-69), because a more serious error may follow.
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

    /// Records one tick in a log that has not stopped.
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
            // The hash of the arm is known only some ticks after the start of the device. Until then, the recorder
            // does not begin a log, unless an error occurs.
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
        // A snapshot waits until the hash of the arm is known, but at most for two periods. The hash is unknown while
        // the parameters of the arm change, and a host may send parameters again and again.
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

    /// Discards the log and begins a new log, as after a ClearLog.
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
            // After an error, recording does not pause, because the ticks after the error are more important than the page.
            self.held = HELD_MS;
        }
        let (oldest, end) = self.writer.range();
        // If a host requests a block that no longer exists, the host gets the oldest block.
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
        // For a Move, all torques and the command of the pump are added to the check value.
        Some(bytes) => {
            bytes.as_chunks::<4>().0.iter().fold(hash, |hash, word| mix(hash, u32::from_le_bytes(*word)))
        }
        None => frame.data().iter().fold(hash, |hash, byte| mix(hash, (*byte).into())),
    }
}

/// Returns the bits of the check value that the log contains. A part of the check value is sufficient, because each check value covers all
/// earlier ticks since the snapshot.
fn check(chain: u32) -> u16 {
    (chain >> 16) as u16
}
