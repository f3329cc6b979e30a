//! Reads a log and replays it through the controller.
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

/// Record of a log.
// A snapshot is large, but a log contains only a few snapshots.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
pub enum Record {
    /// State after the previous tick.
    Snapshot(Snapshot),
    /// One tick.
    Tick {
        /// Inputs of the tick.
        inputs: RecordedInputs,
        /// Check value of the outputs of all ticks since the last snapshot.
        check: u16,
    },
}

/// Log that consists of blocks in the order of their numbers. Reading never fails. For any content of the blocks, the reader returns the
/// records of the valid blocks, beginning with the first snapshot.
#[derive(Clone, Debug)]
pub struct Log<'a> {
    blocks: &'a [Block],
    /// Index of the block at which the search for the next snapshot begins.
    next: usize,
    reader: Option<Reader<'a>>,
    reference: Reference,
}

impl<'a> Log<'a> {
    /// Creates a log that is read from the oldest block on.
    pub fn new(blocks: &'a [Block]) -> Self {
        Self { blocks, next: 0, reader: None, reference: Reference::default() }
    }

    /// Returns the number of the newest block and its state, which shows why the log ends. Returns `None` if no block is valid.
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
                // Blocks may be missing here, or recording was paused. The replay continues at the next snapshot.
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

/// Result of comparing a replayed tick with the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The outputs and the log agree.
    Same,
    /// The outputs and the log differ.
    Differs,
    /// For the contained reason, the outputs may differ from the log until the next snapshot.
    Unsure(Unsure),
}

/// Reason why a replay may differ from the recorded ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsure {
    /// An input is not in the log, because of a long frame, parameters, or too many frames. Another cause is a StoreArm, which depends on
    /// memory that the replay does not have.
    Input,
    /// The arm differs from the recorded arm.
    Arm,
    /// The points of the recorded trajectory are not known.
    Points,
    /// The replay has not reached a snapshot yet.
    NoSnapshot,
}

/// One tick of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Everything that the controller computed.
    pub telemetry: Telemetry,
    /// Number of starts of the device.
    pub boots: u32,
    /// Inputs. `None` for a snapshot, which is the state after a tick whose inputs are not in the log.
    pub inputs: Option<RecordedInputs>,
    /// Outputs. `None` for a snapshot.
    pub outputs: Option<Outputs>,
    /// Comparison with the log.
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
    /// An input is not in the log, but the outputs since that input have still been equal.
    follows: bool,
    arm: Option<u64>,
    points_hash: Option<u32>,
}

impl<'a, M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Replay<'a, M> {
    /// Creates a replay of this log. The controller has an arm, and its memory contains the points with this hash.
    pub fn new(log: Log<'a>, mut controller: Controller<M>, points_hash: Option<u32>) -> Self {
        // This number of calls is far above the number of parts of an image.
        for _ in 0..IMAGE_MAX {
            controller.hash_arm();
        }
        let arm = controller.extensions.hash;
        // The replay accepts the requests that a device with a recorder has accepted.
        controller.extensions.log = LogState::Recording;
        let outcome = Outcome::Unsure(Unsure::NoSnapshot);
        Self { log, controller, boots: None, chain: 0, outcome, follows: false, arm, points_hash }
    }

    /// Returns `true` if the memory contains the points with this hash.
    fn knows(&self, points_hash: u32) -> bool {
        self.points_hash == Some(points_hash)
    }

    /// Returns the outcome that a replay after this snapshot can have.
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

    /// Processes a snapshot. A difference in the state is reported at the snapshot, which also corrects it.
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
        // If the tick has already been replayed, it is not returned again.
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
        // A replay has no permanent memory. A device with permanent memory takes some ticks for a StoreArm, which the replay refuses at
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
        // A missing input possibly had no effect. The replay assumes this as long as the outputs are equal.
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

/// Placeholder for positions without a frame.
const NO_FRAME: Frame = match Frame::new(0, &[]) {
    Some(frame) => frame,
    None => unreachable!(),
};

/// Placeholder for positions without an event.
const NO_EVENT: HostEvent<'_> = HostEvent {
    line: 0,
    overtaken: false,
    plain: false,
    event: jtc_wire::LinkEvent::Noise(jtc_wire::Response::NONE),
};

/// Digest of bits, for comparing two states.
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
