//! Inputs of a tick, as read from a log.
use jtc_bus::{Frame, MAX_LEN, id};
use jtc_wire::{
    EVENTS_MAX, FrameRef, FrameStatus, FrameType, LinkEvent, Response, UrgentCommand, UrgentCommands,
};

use super::inputs::{HOST_BYTES, POSITION, RATES, Reference, Words, head, moved};
use super::reader::Reader;
use crate::JOINTS;
use crate::bit_codec::BitSource;
use crate::io::{BusState, HostEvent, Inputs};
use crate::nodes::FRAMES_MAX;
use crate::response_queue::HOST_LINES;

/// Recorded event of a host.
#[derive(Clone, Copy, Debug)]
pub struct RecordedEvent {
    /// Index of the host line of the event.
    pub line: usize,
    /// `true` if an urgent command has overtaken the event (J-04).
    pub overtaken: bool,
    /// `true` if the event came on a plain line (J-51).
    pub plain: bool,
    /// Type byte of the frame. The type byte is 0 if the frame type is not known.
    pub frame_type: u8,
    /// Kind of the event.
    pub kind: RecordedKind,
    /// `true` if the event was segment 0 of a trajectory, whose bytes are not in the log.
    begins_upload: bool,
    bytes: [u8; HOST_BYTES],
    len: usize,
}

/// A Trajectory frame of segment 0 without points.
const EMPTY_SEGMENT: &[u8] = &[0; 14];

/// Kinds of [`RecordedEvent`]s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordedKind {
    /// Valid frame whose bytes are in the log.
    Frame,
    /// Valid frame whose bytes are not in the log, because the frame is too long or contains parameters, or too many frames arrived.
    Unrecorded,
    /// Damaged frame, with the reason why it is damaged.
    Bad(FrameStatus),
    /// Bytes that are not a frame, with their status.
    Noise(FrameStatus),
}

impl RecordedEvent {
    const NONE: Self = Self {
        line: 0,
        overtaken: false,
        plain: false,
        frame_type: 0,
        kind: RecordedKind::Unrecorded,
        begins_upload: false,
        bytes: [0; HOST_BYTES],
        len: 0,
    };

    /// Returns the bytes of a recorded frame.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or(&[])
    }

    /// Returns the event as an input of the controller. If the log does not contain the bytes of the frame, the input
    /// is a frame that does not change the controller. For segment 0 of a trajectory, the input is a segment without
    /// points. In Operate, this segment has the same effect as any segment 0 (J-30).
    pub fn event(&self) -> HostEvent<'_> {
        let event = match (self.kind, FrameType::from_byte(self.frame_type)) {
            (RecordedKind::Bad(status), _) => LinkEvent::Bad(Response::bad(self.frame_type, status, 0)),
            (RecordedKind::Noise(status), _) => LinkEvent::Noise(Response::bad(self.frame_type, status, 0)),
            (_, Some(frame_type)) => {
                let bytes = if self.begins_upload { EMPTY_SEGMENT } else { self.bytes() };
                LinkEvent::Frame(FrameRef { frame_type, bytes })
            }
            (_, None) => LinkEvent::Noise(Response::bad(0, FrameStatus::IncorrectHeader, 0)),
        };
        HostEvent { line: self.line, overtaken: self.overtaken, plain: self.plain, event }
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        let mut event = Self { line: from.take(2) as usize, ..Self::NONE };
        (event.overtaken, event.plain) = (from.take(1) != 0, from.take(1) != 0);
        event.frame_type = from.take(8) as u8;
        let kind = from.take(2);
        event.kind = match kind {
            0 => {
                event.len = (from.take(6) as usize).min(HOST_BYTES);
                for byte in event.bytes.iter_mut().take(event.len) {
                    *byte = from.take(8) as u8;
                }
                RecordedKind::Frame
            }
            1 => {
                event.bytes = [0; HOST_BYTES];
                event.begins_upload = from.take(1) != 0;
                RecordedKind::Unrecorded
            }
            kind => {
                let status = FrameStatus::from_byte(from.take(3) as u8).unwrap_or_default();
                if kind == 2 { RecordedKind::Bad(status) } else { RecordedKind::Noise(status) }
            }
        };
        event
    }
}

/// Recorded inputs of a tick.
#[derive(Clone, Copy, Debug)]
pub struct RecordedInputs {
    /// State of the joint bus.
    pub bus_state: BusState,
    /// Level of the safety input.
    pub safety_input: bool,
    /// Number of ticks that were missed before this tick.
    pub missed_ticks: u16,
    /// Stop and Pause commands that arrived.
    pub urgent: [UrgentCommands; HOST_LINES],
    /// `true` if the host lines could accept a status.
    pub status_free: bool,
    bus: [Option<Frame>; FRAMES_MAX],
    host: [RecordedEvent; EVENTS_MAX],
    host_len: usize,
    left_out: bool,
}

impl RecordedInputs {
    /// Returns the frames of the joint bus.
    pub fn bus(&self) -> impl Iterator<Item = Frame> + '_ {
        self.bus.iter().map_while(|frame| *frame)
    }

    /// Returns the events of hosts that the controller has read.
    pub fn host(&self) -> &[RecordedEvent] {
        self.host.get(..self.host_len).unwrap_or(&[])
    }

    /// Returns `true` if the log contains every input, so that a replay of this tick has the same result.
    pub fn is_whole(&self) -> bool {
        !self.left_out && self.host().iter().all(|event| event.kind != RecordedKind::Unrecorded)
    }

    /// Reads a tick and the check value of its outputs.
    pub(super) fn read(reference: &mut Reference, from: &mut Reader<'_>) -> (Self, u16) {
        let head = from.take(32);
        let mut inputs = Self {
            bus_state: Inputs::QUIET.bus_state,
            safety_input: true,
            missed_ticks: 0,
            urgent: [UrgentCommands::NONE; HOST_LINES],
            status_free: head & head::STATUS_FREE != 0,
            bus: [None; FRAMES_MAX],
            host: [RecordedEvent::NONE; EVENTS_MAX],
            host_len: 0,
            left_out: false,
        };
        let ordered = head & head::ORDERED != 0;
        let motion = ordered.then(|| Motion::read(head & head::FAR != 0, from));
        if head & head::QUIET == 0 {
            inputs.read_rest(from);
        }
        match motion {
            Some(motion) => {
                let changed = head & head::CHANGED != 0;
                reference.read_ordered(&motion, changed, &mut inputs.bus, from);
            }
            None => reference.read_frames(&mut inputs.bus, from),
        }
        from.align();
        (inputs, (head >> head::CHECK) as u16)
    }

    fn read_rest<S: BitSource>(&mut self, from: &mut S) {
        self.safety_input = from.take(1) != 0;
        self.bus_state = BusState { acknowledged: from.take(1) != 0, bus_off: from.take(1) != 0 };
        if from.take(1) != 0 {
            self.missed_ticks = from.take(16) as u16;
        }
        for commands in &mut self.urgent {
            for _ in 0..from.take(2) {
                let pause = from.take(1) != 0;
                let command = if pause { UrgentCommand::Pause } else { UrgentCommand::Stop };
                commands.add(command, from.take(8) as u8);
            }
        }
        self.left_out = from.take(1) != 0;
        self.host_len = (from.take(5) as usize).min(EVENTS_MAX);
        for event in self.host.iter_mut().take(self.host_len) {
            *event = RecordedEvent::read(from);
        }
    }
}

/// Form of the recorded positions.
enum Way {
    /// The word contains the distances of all joints since the last tick.
    Moved(u32),
    /// The words contain the position of each joint.
    Far([u32; JOINTS]),
}

/// Motion of the joints in a recorded tick.
struct Motion {
    rates: [u32; JOINTS],
    way: Way,
}

impl Motion {
    fn read<S: BitSource>(far: bool, from: &mut S) -> Self {
        let rates = [(); JOINTS].map(|()| from.take(32));
        let way =
            if far { Way::Far([(); JOINTS].map(|()| from.take(32))) } else { Way::Moved(from.take(32)) };
        Self { rates, way }
    }

    /// Returns the position of joint `n`, which was at `before` in the last tick.
    fn position(&self, n: usize, before: u32) -> u32 {
        match &self.way {
            Way::Moved(ways) => moved(n, before, *ways),
            Way::Far(positions) => positions.get(n).copied().unwrap_or(before),
        }
    }
}

impl Reference {
    fn read_ordered<S: BitSource>(
        &mut self,
        motion: &Motion,
        changed: bool,
        bus: &mut [Option<Frame>; FRAMES_MAX],
        from: &mut S,
    ) {
        for (n, slot) in bus.iter_mut().enumerate().take(self.expected.into()) {
            let Some((len, before)) = self.len.get(n).zip(self.words.get_mut(n)) else { return };
            let rates = motion.rates.get(n);
            if rates.is_some() {
                before[POSITION] = motion.position(n, before[POSITION]);
            }
            if changed {
                before[RATES] = rates.copied().unwrap_or(before[RATES]);
                read_words(before, from);
            }
            let mut now = *before;
            now[RATES] = rates.copied().unwrap_or(now[RATES]);
            *slot = answer(n, *len, &now);
        }
    }

    fn read_frames<S: BitSource>(&mut self, bus: &mut [Option<Frame>; FRAMES_MAX], from: &mut S) {
        let count = from.take(6) as usize;
        let mut answers = 0;
        for slot in bus.iter_mut().take(count) {
            *slot = if from.take(1) != 0 {
                let n = from.take(3) as usize;
                answers |= 1u32 << n;
                self.read_answer(n, 4 * (from.take(2) as u8 + 4), from)
            } else {
                let (id, len) = (from.take(11) as u16, from.take(5) as usize);
                let mut data = [0; MAX_LEN];
                for byte in data.iter_mut().take(len) {
                    *byte = from.take(8) as u8;
                }
                data.get(..len).and_then(|data| Frame::new(id, data))
            };
            if slot.is_none() {
                from.damage();
                return;
            }
        }
        self.expect(answers);
    }

    fn read_answer<S: BitSource>(&mut self, n: usize, len: u8, from: &mut S) -> Option<Frame> {
        let (place, before) = self.len.get_mut(n).zip(self.words.get_mut(n))?;
        *place = len;
        read_words(before, from);
        answer(n, len, before)
    }
}

/// Reads the words of an answer that have changed. The words that have not changed keep their values.
fn read_words<S: BitSource>(words: &mut Words, from: &mut S) {
    if from.take(1) != 0 {
        for word in words {
            if from.take(1) != 0 {
                *word = from.take(32);
            }
        }
    }
}

/// Returns the frame that contains the answer of node `n` to a Move.
fn answer(n: usize, len: u8, words: &Words) -> Option<Frame> {
    let mut bytes = [0; MAX_LEN];
    for (at, (to, word)) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words).enumerate() {
        *to = if at == POSITION { word.to_be_bytes() } else { word.to_le_bytes() };
    }
    Frame::new(id::MOVE_ANSWER + n as u16, bytes.get(..usize::from(len))?)
}
