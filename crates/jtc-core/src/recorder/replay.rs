//! Reader of a log, and replay of the log through the controller.
use jtc_bus::Frame;
use jtc_wire::{EVENTS_MAX, FrameType, IMAGE_MAX, LogState, RawPoint};

use super::block::Whole;
use super::inputs::Reference;
use super::reader::Reader;
use super::recorded::{RecordedEvent, RecordedInputs};
use super::snapshot::{Origin, Snapshot};
use super::{Block, chain, check};
use crate::bit_codec::{BitCodec, BitSink, BitSource};
use crate::controller::Controller;
use crate::extension::state::LogRequest;
use crate::io::{HostEvent, Inputs, Outputs};
use crate::nodes::FRAMES_MAX;
use crate::telemetry::Telemetry;

/// Part of a log: a snapshot or a tick.
// The enum is large because of the snapshot, but a log contains only a few snapshots.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Record {
    /// State of the controller after the previous tick.
    Snapshot(Snapshot),
    /// A recorded tick.
    Tick {
        /// Inputs of the tick.
        inputs: RecordedInputs,
        /// Check value of the outputs of all ticks after the last snapshot.
        check: u16,
    },
}

/// Log, as a list of blocks in the order of their numbers. Reading of a log never fails. For any content of the blocks, the reader returns
/// the records of the valid blocks, beginning with the first snapshot.
#[derive(Clone, Debug)]
pub struct Log<'a> {
    blocks: &'a [Block],
    /// Index of the block at which the search for the next snapshot begins.
    next: usize,
    reader: Option<Reader<'a>>,
    reference: Reference,
}

impl<'a> Log<'a> {
    /// Creates a log whose reading begins with the oldest block.
    pub fn new(blocks: &'a [Block]) -> Self {
        Self { blocks, next: 0, reader: None, reference: Reference::default() }
    }

    /// Returns the number of the newest block and its state, which shows why the log ends. Returns `None` if no block is valid.
    pub fn end(&self) -> Option<(u32, LogState)> {
        self.blocks.iter().rev().find_map(Whole::parse).map(|whole| (whole.sequence, whole.state))
    }

    /// Returns a reader at the next snapshot in the blocks that were not read yet.
    fn find(&mut self) -> Option<Reader<'a>> {
        while let Some(rest) = self.blocks.get(self.next..).filter(|rest| !rest.is_empty()) {
            self.next += 1;
            if let Some(bit) = rest.first().and_then(Whole::parse).and_then(|whole| whole.snapshot) {
                return Some(Reader::new(rest, bit));
            }
        }
        None
    }
}

impl Iterator for Log<'_> {
    type Item = Record;

    fn next(&mut self) -> Option<Record> {
        loop {
            let mut reader = match self.reader.take() {
                Some(reader) => reader,
                None => self.find()?,
            };
            let before = reader.block();
            if reader.at_end() {
                // At this point of the log, blocks may be missing, or recording may have paused. The replay then continues at the next
                // snapshot.
                continue;
            }
            let record = if reader.peek() {
                reader.take(1);
                self.reference = Reference::default();
                let snapshot = Snapshot::read(&mut reader);
                reader.align();
                Record::Snapshot(snapshot)
            } else {
                let (inputs, check) = RecordedInputs::read(&mut self.reference, &mut reader);
                Record::Tick { inputs, check }
            };
            self.next += reader.block() - before;
            if reader.is_damaged() {
                continue;
            }
            self.reader = Some(reader);
            return Some(record);
        }
    }
}

/// Result of the comparison of a replayed tick with the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The replayed outputs and the log agree.
    Same,
    /// The replayed outputs and the log differ.
    Differs,
    /// The replayed outputs may differ from the log until the next snapshot. The value contains the reason.
    Unsure(Unsure),
}

/// Reason why a replay may differ from the recorded ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsure {
    /// An input is not in the log, because a frame was too long, contained parameters, or exceeded the allowance. A StoreArm has the same
    /// effect, because it depends on memory that the replay does not have.
    Input,
    /// The arm of the replay differs from the recorded arm.
    Arm,
    /// The points of the recorded trajectory are not known.
    Points,
    /// The replay has not reached a snapshot yet.
    NoSnapshot,
}

/// Result of one tick of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// All values that the controller computed in this tick.
    pub telemetry: Telemetry,
    /// Number of starts of the device.
    pub boots: u32,
    /// Recorded inputs of this tick. `None` for a snapshot, which is the state after a tick whose inputs are not in the log.
    pub inputs: Option<RecordedInputs>,
    /// Outputs of the replayed tick. `None` for a snapshot.
    pub outputs: Option<Outputs>,
    /// Comparison of the tick with the log.
    pub outcome: Outcome,
}

/// Replays a log through a controller that has the recorded arm and the points of its trajectory.
pub struct Replay<'a, M> {
    log: Log<'a>,
    controller: Controller<M>,
    /// Number of device starts in the last restored snapshot. `None` before the first snapshot.
    boots: Option<u32>,
    chain: u32,
    outcome: Outcome,
    /// `true` if an input is not in the log, but all outputs since that input have been equal.
    follows: bool,
    arm: Option<u64>,
    points_hash: Option<u32>,
}

impl<'a, M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Replay<'a, M> {
    /// Creates a replay of this log. `controller` has the recorded arm, and its memory contains the points with the hash `points_hash`.
    pub fn new(log: Log<'a>, mut controller: Controller<M>, points_hash: Option<u32>) -> Self {
        // Each call computes a part of the hash. This number of calls is far more than needed.
        for _ in 0..IMAGE_MAX {
            controller.hash_arm();
        }
        let arm = controller.extensions.hash;
        // The device of the log has a recorder. With this state, the controller of the replay accepts the same
        // requests for the log as the device.
        controller.extensions.log = LogState::Recording;
        let outcome = Outcome::Unsure(Unsure::NoSnapshot);
        Self { log, controller, boots: None, chain: 0, outcome, follows: false, arm, points_hash }
    }

    /// Returns `true` if the memory of the controller contains the points with this hash.
    fn knows(&self, points_hash: u32) -> bool {
        self.points_hash == Some(points_hash)
    }

    /// Returns the outcome of the ticks after this snapshot if their outputs agree with the log. The outcome is
    /// unsure if the arm of the replay differs from the recorded arm, or if the points that the snapshot requires are
    /// not known.
    fn worth(&self, snapshot: &Snapshot) -> Outcome {
        let Origin { arm, points_hash, .. } = snapshot.origin;
        if arm != self.arm {
            Outcome::Unsure(Unsure::Arm)
        } else if snapshot.needs_points() && !self.knows(points_hash) {
            Outcome::Unsure(Unsure::Points)
        } else {
            Outcome::Same
        }
    }

    /// Returns the hash of the arm that the controller has.
    pub fn arm(&self) -> Option<u64> {
        self.arm
    }

    /// Returns the controller after the last step.
    pub fn controller(&self) -> &Controller<M> {
        &self.controller
    }

    /// Processes a snapshot of the log. If the replayed state differs from the snapshot, the outcome reports this, and the snapshot
    /// replaces the state.
    fn snapshot(&mut self, snapshot: &Snapshot) -> Option<Step> {
        let follows = self.boots == Some(snapshot.origin.boots)
            && self.controller.observed.tick == snapshot.tick()
            && self.outcome == Outcome::Same;
        if follows {
            let (mut recorded, mut replayed) = (Digest::default(), Digest::default());
            snapshot.dynamic.write(&mut recorded);
            self.controller.write_state(&mut replayed);
            self.chain = 0;
            if recorded == replayed {
                return None;
            }
        }
        let next =
            self.boots != Some(snapshot.origin.boots) || self.controller.observed.tick != snapshot.tick();
        self.controller.restore(snapshot);
        (self.outcome, self.follows) = (self.worth(snapshot), false);
        (self.boots, self.chain) = (Some(snapshot.origin.boots), 0);
        let outcome = if follows { Outcome::Differs } else { self.outcome };
        // A snapshot of a tick that was already replayed is not returned as another step.
        (next || follows).then(|| self.step(None, None, outcome))
    }

    fn step(&self, inputs: Option<RecordedInputs>, outputs: Option<Outputs>, outcome: Outcome) -> Step {
        let (telemetry, boots) = (self.controller.telemetry(), self.boots.unwrap_or(0));
        Step { telemetry, boots, inputs, outputs, outcome }
    }

    fn tick(&mut self, recorded: &RecordedInputs, recorded_check: u16) -> Step {
        let mut bus = [NO_FRAME; FRAMES_MAX];
        let mut frames = 0;
        for (slot, frame) in bus.iter_mut().zip(recorded.bus()) {
            *slot = frame;
            frames += 1;
        }
        let mut host = [NO_EVENT; EVENTS_MAX];
        for (slot, event) in host.iter_mut().zip(recorded.host()) {
            *slot = event.event();
        }
        let inputs = Inputs {
            bus: bus.get(..frames).unwrap_or(&[]),
            bus_state: recorded.bus_state,
            safety_input: recorded.safety_input,
            missed_ticks: recorded.missed_ticks,
            urgent: recorded.urgent,
            host: host.get(..recorded.host().len()).unwrap_or(&[]),
            status_free: recorded.status_free,
        };
        let outputs = self.controller.tick(&inputs);
        if let Some(LogRequest::Page { line, .. }) = self.controller.extensions.log_request.take() {
            let page = jtc_wire::LogPage {
                state: LogState::Recording,
                block: 0,
                offset: 0,
                end: 0,
                points: 0,
                points_hash: 0,
                bytes: &[],
            };
            self.controller.extensions.answers.put(line, &jtc_wire::Answer::Log(page));
        }
        self.chain = chain(self.chain, &self.controller, self.controller.errors.word(), &outputs);
        let executes = |event: &RecordedEvent| event.frame_type == FrameType::TrajSetExecStatus as u8;
        let same = check(self.chain) == recorded_check;
        // A replay has no non-volatile memory. A device with such memory takes some ticks for a StoreArm. The replay refuses a StoreArm at
        // once.
        let stores = |event: &RecordedEvent| event.frame_type == FrameType::StoreArm as u8;
        let repeatable = recorded.is_whole() && !recorded.host().iter().any(stores);
        if !repeatable && self.outcome == Outcome::Same {
            self.outcome = Outcome::Unsure(Unsure::Input);
            self.follows = true;
        } else if self.outcome == Outcome::Same
            && !self.knows(self.controller.points_hash())
            && recorded.host().iter().any(executes)
        {
            self.outcome = Outcome::Unsure(Unsure::Points);
        } else if self.outcome == Outcome::Same && !same {
            self.outcome = Outcome::Differs;
        }
        // A missing input may have had no effect. The replay assumes that it had no effect as long as the outputs of
        // the replay are equal to the log.
        self.follows &= same && self.outcome == Outcome::Unsure(Unsure::Input);
        let outcome = if self.follows { Outcome::Same } else { self.outcome };
        self.step(Some(*recorded), Some(outputs), outcome)
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Iterator for Replay<'_, M> {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        loop {
            match self.log.next()? {
                Record::Snapshot(snapshot) => {
                    if let Some(step) = self.snapshot(&snapshot) {
                        return Some(step);
                    }
                }
                Record::Tick { inputs, check } => return Some(self.tick(&inputs, check)),
            }
        }
    }
}

/// Placeholder for entries without a bus frame.
const NO_FRAME: Frame = match Frame::new(0, &[]) {
    Some(frame) => frame,
    None => unreachable!(),
};

/// Placeholder for entries without a host event.
const NO_EVENT: HostEvent<'_> = HostEvent {
    line: 0,
    overtaken: false,
    plain: false,
    event: jtc_wire::LinkEvent::Noise(jtc_wire::Response::NONE),
};

/// Digest of bits, for the comparison of two states.
#[derive(Default, PartialEq)]
struct Digest {
    hash: u64,
    bits: u64,
}

impl BitSink for Digest {
    fn put(&mut self, value: u32, bits: u32) {
        let mixed = (self.hash.rotate_left(5) ^ u64::from(value) ^ u64::from(bits) << 32)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (self.hash, self.bits) = (mixed, self.bits + u64::from(bits));
    }
}

#[cfg(test)]
mod tests;
