//! A log read back, and run through the controller again.
use jtc_bus::Frame;
use jtc_wire::{EVENTS_MAX, FrameType, IMAGE_MAX, LogState, RawPoint};

use super::block::Whole;
use super::inputs::Reference;
use super::reader::Reader;
use super::recorded::{RecordedEvent, RecordedInputs};
use super::snapshot::{Origin, Snapshot};
use super::{Block, chain, check};
use crate::controller::Controller;
use crate::io::{HostEvent, Inputs, Outputs};
use crate::nodes::FRAMES_MAX;
use crate::remembered::{BitSink, BitSource, Remembered};
use crate::telemetry::Telemetry;

/// A record of a log.
// A snapshot is large, and there are few.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Record {
    /// The state after the tick before.
    Snapshot(Snapshot),
    /// A tick.
    Tick {
        /// Inputs of the tick.
        inputs: RecordedInputs,
        /// Check of the outputs of all ticks since the last snapshot.
        check: u16,
    },
}

/// A log: blocks in the order of their numbers. Reading is total: for any content of the blocks, it gives the records of those that are
/// whole, from the first snapshot on.
#[derive(Clone, Debug)]
pub struct Log<'a> {
    blocks: &'a [Block],
    /// Block from which on the next snapshot is looked for.
    next: usize,
    reader: Option<Reader<'a>>,
    reference: Reference,
}

impl<'a> Log<'a> {
    /// Reads from the oldest block on.
    pub fn new(blocks: &'a [Block]) -> Self {
        Self { blocks, next: 0, reader: None, reference: Reference::default() }
    }

    /// Returns the number of the newest block and its state, which says why the log ends; `None` if no block is whole.
    pub fn end(&self) -> Option<(u32, LogState)> {
        self.blocks.iter().rev().find_map(Whole::parse).map(|whole| (whole.sequence, whole.state))
    }

    /// Returns a reader at the next snapshot after the blocks that were read.
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
                // Blocks may be missing here, or recording was paused: the replay continues with a snapshot.
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

/// Comparison of a tick of a replay with the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The outputs are those of the log.
    Same,
    /// The outputs differ from those of the log.
    Differs,
    /// The outputs may differ, until the next snapshot, for this reason.
    Unsure(Unsure),
}

/// Reason why a replay may differ from the recorded ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsure {
    /// An input is not in the log: a long frame, parameters, more frames than it has room for, or the memory that a StoreArm is for.
    Input,
    /// The arm is not the one of that time.
    Arm,
    /// The points of the trajectory of that time are not known.
    Points,
    /// No snapshot came yet.
    NoSnapshot,
}

/// A tick of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Everything that the controller computed.
    pub telemetry: Telemetry,
    /// Starts of the device.
    pub boots: u32,
    /// Inputs; `None` for a snapshot, which is the state after a tick whose inputs are not in the log.
    pub inputs: Option<RecordedInputs>,
    /// Outputs; `None` for a snapshot.
    pub outputs: Option<Outputs>,
    /// Comparison with the log.
    pub outcome: Outcome,
}

/// Runs a log through a controller, which has the arm of that time and the points of its trajectory.
pub struct Replay<'a, M> {
    log: Log<'a>,
    controller: Controller<M>,
    /// The last snapshot was restored; `None` before the first.
    boots: Option<u32>,
    chain: u32,
    outcome: Outcome,
    /// An input is not in the log, but the outputs are still the same.
    follows: bool,
    arm: Option<u64>,
    points_hash: Option<u32>,
}

impl<'a, M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Replay<'a, M> {
    /// Creates a replay of this log, by a controller that has an arm and, in its memory, the points of this hash.
    pub fn new(log: Log<'a>, mut controller: Controller<M>, points_hash: Option<u32>) -> Self {
        // In many more parts than an image has.
        for _ in 0..IMAGE_MAX {
            controller.hash_arm();
        }
        let arm = controller.extensions.hash;
        // The controller takes the requests that a device with a recorder has taken.
        controller.extensions.log = LogState::Recording;
        let outcome = Outcome::Unsure(Unsure::NoSnapshot);
        Self { log, controller, boots: None, chain: 0, outcome, follows: false, arm, points_hash }
    }

    /// Returns `true` if the points of this hash are in memory.
    fn knows(&self, points_hash: u32) -> bool {
        self.points_hash == Some(points_hash)
    }

    /// Returns the outcome of a replay from this snapshot on.
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

    /// Takes a snapshot. A difference in the state stays until a snapshot corrects it.
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
        // A tick that was replayed has been seen already.
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
        if let Some(super::LogRequest::Page { line, .. }) = self.controller.extensions.log_request.take() {
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
        // A replay has no memory that lasts: a device that has one takes some ticks for a StoreArm which is refused here at once.
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
        // A missing input may have changed nothing: as long as the outputs are the same, it has not.
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

/// Fills the places that hold no frame.
const NO_FRAME: Frame = match Frame::new(0, &[]) {
    Some(frame) => frame,
    None => unreachable!(),
};

/// Fills the places that hold no event.
const NO_EVENT: HostEvent<'_> = HostEvent {
    line: 0,
    overtaken: false,
    plain: false,
    event: jtc_wire::LinkEvent::Noise(jtc_wire::Response::NONE),
};

/// Bits compared by what they come to.
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
