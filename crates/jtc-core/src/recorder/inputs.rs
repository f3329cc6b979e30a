//! The inputs of a tick, as few bits as they take: what the nodes answer against what they answered before, what is as ever in one bit.
//!
//! Writer and reader keep the same [`Reference`]; a snapshot begins it anew on both sides.
use jtc_bus::{Frame, id};
use jtc_wire::{EVENTS_MAX, FrameRef, FrameType, LinkEvent, UrgentCommand, UrgentCommands};

use crate::io::{HostEvent, Inputs};
use crate::nodes::{FRAMES_MAX, GRIPPER};
use crate::remembered::{BitSink, BitSource};
use crate::{JOINTS, NODES};

/// Longest frame of a host that is recorded with its bytes.
pub const HOST_BYTES: usize = 48;
/// Bytes of frames of hosts that are recorded, on average in a tick and at once.
const ALLOWANCE: (u16, u16) = (2, 500);
/// What an event takes beside its bytes.
const EVENT_BYTES: u16 = 2;

/// How a number is written, by its size: not at all when 0, else in so many bits.
struct Code(u32, u32, u32);

const VELOCITY: Code = Code(6, 11, 17);
const TORQUE: Code = Code(5, 10, 17);
/// Bits of a change of position that is no whole number of encoder steps.
const FINE: u32 = 22;

fn zigzag(value: i32) -> u32 {
    ((value << 1) ^ (value >> 31)) as u32
}

fn straight(code: u32) -> i32 {
    (code >> 1) as i32 ^ -((code & 1) as i32)
}

impl Code {
    fn write<S: BitSink>(&self, value: i32, to: &mut S) {
        let code = zigzag(value);
        if code == 0 {
            to.put(0, 1);
        } else if code >> self.0 == 0 {
            to.put(0b01 | code << 2, 2 + self.0);
        } else if code >> self.1 == 0 {
            to.put(0b011 | code << 3, 3 + self.1);
        } else {
            to.put(0b111 | code << 3, 3 + self.2);
        }
    }

    fn read<S: BitSource>(&self, from: &mut S) -> i32 {
        straight(match prefix(from) {
            0 => 0,
            1 => from.take(self.0),
            2 => from.take(self.1),
            _ => from.take(self.2),
        })
    }
}

/// How many ones there are in front of a zero, at most 3.
fn prefix<S: BitSource>(from: &mut S) -> u32 {
    (0..3).find(|_| from.take(1) == 0).unwrap_or(3)
}

/// What the next inputs are written against.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    /// The last answer to a Move of each node: bytes, and big-endian words.
    pub(super) len: [u8; NODES],
    pub(super) words: [[u32; 4]; NODES],
    pub(super) tails: [[u32; 2]; NODES],
    /// How many nodes answer.
    pub(super) expected: u8,
    /// Bytes of frames of hosts that may still be recorded.
    allowance: u16,
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            len: [16; NODES],
            words: [[0; 4]; NODES],
            tails: [[0; 2]; NODES],
            expected: NODES as u8,
            allowance: ALLOWANCE.1,
        }
    }
}

/// The first 16 bytes of a payload: position, velocity and torque as numbers, the rest as it is in memory.
#[inline]
fn words(bytes: &[u8; 16]) -> [u32; 4] {
    let [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = *bytes;
    [
        u32::from_be_bytes([a, b, c, d]),
        u32::from_be_bytes([e, f, g, h]),
        u32::from_le_bytes([i, j, k, l]),
        u32::from_le_bytes([m, n, o, p]),
    ]
}

/// What is behind the first 16 bytes of a payload, and zeros.
#[inline]
fn tail(bytes: &[u8]) -> [u32; 2] {
    let word = |at: usize| {
        bytes.get(at..).and_then(|bytes| bytes.first_chunk()).copied().map_or(0, u32::from_le_bytes)
    };
    [word(0), word(4)]
}

/// Bits of changes that are as small as those of most ticks: of the position in steps of a 16-bit encoder, of velocity and torque.
const STEP_BITS: u32 = 5;
const SPEED_BITS: u32 = 8;
const TORQUE_BITS: u32 = 9;
const SMALL_BITS: u32 = STEP_BITS + SPEED_BITS + TORQUE_BITS;

/// Bits of the last word of six of them.
const PACKED_REST: u32 = SMALL_BITS * JOINTS as u32 - 4 * 32;

/// The changes of a joint in one number, and 0 where each is small.
#[inline]
fn small(position: i32, velocity: i32, torque: i32) -> (u32, u32) {
    let a = ((position >> 16) + (1 << (STEP_BITS - 1))) as u32;
    let b = (velocity + (1 << (SPEED_BITS - 1))) as u32;
    let c = (torque + (1 << (TORQUE_BITS - 1))) as u32;
    let beyond = (a >> STEP_BITS) | (b >> SPEED_BITS) | (c >> TORQUE_BITS) | (position as u32) << 16;
    (a | b << STEP_BITS | c << (STEP_BITS + SPEED_BITS), beyond)
}

/// The same back.
fn small_parts(all: u32) -> (i32, i32, i32) {
    let part = |from: u32, bits: u32| ((all >> from) & ((1 << bits) - 1)) as i32 - (1 << (bits - 1));
    (part(0, STEP_BITS) << 16, part(STEP_BITS, SPEED_BITS), part(STEP_BITS + SPEED_BITS, TORQUE_BITS))
}

/// Changes of a joint of which one is large.
#[inline(never)]
fn write_large<S: BitSink>(position: i32, velocity: i32, torque: i32, to: &mut S) {
    let code = zigzag(position);
    if code >> FINE == 0 {
        to.put(code << 1, 1 + FINE);
    } else {
        to.put(1, 1);
        to.put(position as u32, 32);
    }
    VELOCITY.write(velocity, to);
    TORQUE.write(torque, to);
}

/// Changes of a joint as they were written.
pub(super) fn read_changes<S: BitSource>(is_small: bool, from: &mut S) -> (i32, i32, i32) {
    if is_small {
        return small_parts(from.take(SMALL_BITS));
    }
    let position = if from.take(1) == 0 { straight(from.take(FINE)) } else { from.take(32) as i32 };
    let velocity = VELOCITY.read(from);
    (position, velocity, TORQUE.read(from))
}

/// Words that have changed.
#[inline(never)]
fn write_words<S: BitSink>(now: &[u32], before: &[u32], to: &mut S) {
    for (now, before) in now.iter().zip(before) {
        to.put((now != before).into(), 1);
        if now != before {
            to.put(*now, 32);
        }
    }
}

fn is_move_answer(frame: &Frame) -> bool {
    id::command(frame.id) == id::MOVE_ANSWER && usize::from(id::node(frame.id)) < NODES
}

impl Reference {
    /// Writes the inputs; returns whether all of them are there (a replay of this tick gives the same).
    pub fn write<S: BitSink>(&mut self, inputs: &Inputs<'_>, done: usize, to: &mut S) -> bool {
        to.put(inputs.status_free.into(), 1);
        let quiet = inputs.safety_input
            && inputs.bus_state == Inputs::QUIET.bus_state
            && inputs.missed_ticks == 0
            && inputs.host.is_empty()
            && inputs.urgent.iter().all(UrgentCommands::is_empty);
        to.put(quiet.into(), 1);
        self.allowance = (self.allowance + ALLOWANCE.0).min(ALLOWANCE.1);
        let whole = quiet || self.write_rest(inputs, done, to);
        self.write_bus(inputs.bus, to);
        whole
    }

    fn write_bus<S: BitSink>(&mut self, bus: &[Frame], to: &mut S) {
        let bus = bus.get(..FRAMES_MAX).unwrap_or(bus);
        let in_place = |(n, (frame, len)): (usize, (&Frame, &u8))| {
            frame.id == id::MOVE_ANSWER + n as u16 && frame.data().len() == usize::from(*len)
        };
        let ordered =
            bus.len() == usize::from(self.expected) && bus.iter().zip(&self.len).enumerate().all(in_place);
        to.put(ordered.into(), 1);
        if !ordered {
            return self.write_frames(bus, to);
        }
        // As a rule each joint has moved a little, and nothing else has changed.
        let packed = self.packed(bus);
        to.put(packed.is_some().into(), 1);
        match packed {
            Some(words) => {
                to.put_pair(words[0], words[1]);
                to.put_pair(words[2], words[3]);
                to.put(words[4], PACKED_REST);
            }
            None => {
                for (n, frame) in bus.iter().enumerate() {
                    self.write_answer(n, frame, to);
                }
            }
        }
    }

    /// What the joints have moved, in one number of 132 bits, where all moved little and nothing else has changed. Keeps the answers as
    /// those that the next are written against, but only then.
    #[inline]
    fn packed(&mut self, bus: &[Frame]) -> Option<[u32; 5]> {
        let mut moved = [0u32; JOINTS];
        let mut now = [[0u32; 2]; JOINTS];
        let mut changes = 0;
        let joints = bus.iter().zip(self.words.iter().zip(&self.tails));
        for ((frame, (before, tail_before)), (moved, now)) in joints.zip(moved.iter_mut().zip(&mut now)) {
            let (head, rest) = frame.data().split_first_chunk()?;
            let words = words(head);
            let tail = if rest.is_empty() { [0; 2] } else { tail(rest) };
            changes |= (words[2] ^ before[2])
                | (words[3] ^ before[3])
                | (tail[0] ^ tail_before[0])
                | (tail[1] ^ tail_before[1]);
            let half = |word: u32| (i32::from((word >> 16) as i16), i32::from(word as i16));
            let ((velocity, torque), last) = (half(words[1]), half(before[1]));
            let change = words[0].wrapping_sub(before[0]) as i32;
            let (all, beyond) = small(change, velocity - last.0, torque - last.1);
            changes |= beyond;
            *moved = all;
            *now = [words[0], words[1]];
        }
        if let (Some(frame), Some(before), Some(tail_before)) =
            (bus.get(GRIPPER), self.words.get(GRIPPER), self.tails.get(GRIPPER))
        {
            let (head, rest) = frame.data().split_first_chunk()?;
            let (now, tail) = (words(head), tail(rest));
            // Not compared as arrays: that would be a call.
            changes |= (now[0] ^ before[0])
                | (now[1] ^ before[1])
                | (now[2] ^ before[2])
                | (now[3] ^ before[3])
                | (tail[0] ^ tail_before[0])
                | (tail[1] ^ tail_before[1]);
        }
        if changes != 0 {
            return None;
        }
        for (before, now) in self.words.iter_mut().zip(now) {
            [before[0], before[1]] = now;
        }
        let [a, b, c, d, e, f] = moved;
        Some([a | b << 22, b >> 10 | c << 12, c >> 20 | d << 2 | e << 24, e >> 8 | f << 14, f >> 18])
    }

    /// Frames in any order.
    #[inline(never)]
    fn write_frames<S: BitSink>(&mut self, bus: &[Frame], to: &mut S) {
        to.put(bus.len() as u32, 6);
        let mut answers = 0;
        for frame in bus {
            let (n, data) = (usize::from(id::node(frame.id)), frame.data());
            let answer = is_move_answer(frame) && data.len() >= 16 && data.len() % 4 == 0;
            to.put(answer.into(), 1);
            if answer {
                answers |= 1u32 << n;
                to.put(n as u32, 3);
                to.put(data.len() as u32 / 4 - 4, 2);
                if let Some(len) = self.len.get_mut(n) {
                    *len = data.len() as u8;
                }
                self.write_answer(n, frame, to);
            } else {
                to.put(frame.id.into(), 11);
                to.put(data.len() as u32, 5);
                for byte in data {
                    to.put((*byte).into(), 8);
                }
            }
        }
        self.expect(answers);
    }

    /// Which nodes are expected from now on.
    pub(super) fn expect(&mut self, answers: u32) {
        if answers == 0x3F || answers == 0x7F {
            self.expected = answers.count_ones() as u8;
        }
    }

    /// An answer of node `n` to a Move, of the length that is known.
    #[inline]
    fn write_answer<S: BitSink>(&mut self, n: usize, frame: &Frame, to: &mut S) {
        let Some((before, tail_before)) = self.words.get_mut(n).zip(self.tails.get_mut(n)) else { return };
        let Some((head, rest)) = frame.data().split_first_chunk() else { return };
        let now = words(head);
        let tail = if rest.is_empty() { [0; 2] } else { tail(rest) };
        let mut changes = (now[2] ^ before[2])
            | (now[3] ^ before[3])
            | (tail[0] ^ tail_before[0])
            | (tail[1] ^ tail_before[1]);
        if n < JOINTS {
            let change = now[0].wrapping_sub(before[0]) as i32;
            let half = |word: u32| (i32::from((word >> 16) as i16), i32::from(word as i16));
            let ((velocity, torque), last) = (half(now[1]), half(before[1]));
            let other = u32::from(changes != 0) << 1;
            let (velocity, torque) = (velocity - last.0, torque - last.1);
            match small(change, velocity, torque) {
                (all, 0) => to.put(1 | other | all << 2, 2 + SMALL_BITS),
                _ => {
                    to.put(other, 2);
                    write_large(change, velocity, torque, to);
                }
            }
        } else {
            changes |= (now[0] ^ before[0]) | (now[1] ^ before[1]);
            to.put((changes != 0).into(), 1);
            if changes != 0 {
                write_words(&now[..2], &before[..2], to);
            }
        }
        [before[0], before[1]] = [now[0], now[1]];
        if changes != 0 {
            write_words(&now[2..], &before[2..], to);
            write_words(tail.get(..rest.len() / 4).unwrap_or(&[]), tail_before, to);
            (*before, *tail_before) = (now, tail);
        }
    }

    /// What is not as ever, but for the joint bus.
    #[inline(never)]
    fn write_rest<S: BitSink>(&mut self, inputs: &Inputs<'_>, done: usize, to: &mut S) -> bool {
        to.put(inputs.safety_input.into(), 1);
        to.put(inputs.bus_state.acknowledged.into(), 1);
        to.put(inputs.bus_state.bus_off.into(), 1);
        to.put((inputs.missed_ticks != 0).into(), 1);
        if inputs.missed_ticks != 0 {
            to.put(inputs.missed_ticks.into(), 16);
        }
        for commands in &inputs.urgent {
            to.put(commands.iter().count() as u32, 2);
            for (command, count) in commands.iter() {
                to.put((command == UrgentCommand::Pause).into(), 1);
                to.put(count.into(), 8);
            }
        }
        // Those that were done, and the one that was worked on or had no turn; as many as there is room for.
        let looked_at = inputs.host.get(..done + 1).unwrap_or(inputs.host);
        let left = looked_at.iter().take(EVENTS_MAX).position(|event| !self.allows(event));
        let count = left.unwrap_or(looked_at.len().min(EVENTS_MAX));
        to.put(left.is_some().into(), 1);
        to.put(count as u32, 5);
        let mut whole = left.is_none();
        for event in looked_at.iter().take(count) {
            whole &= self.write_event(event, to);
        }
        whole
    }

    /// Takes what an event needs off the allowance, if there is as much.
    fn allows(&mut self, event: &HostEvent<'_>) -> bool {
        let bytes = match event.event {
            LinkEvent::Frame(frame) if has_bytes(frame) => EVENT_BYTES + frame.bytes.len() as u16,
            _ => EVENT_BYTES,
        };
        let rest = self.allowance.checked_sub(bytes);
        self.allowance = rest.unwrap_or(self.allowance);
        rest.is_some()
    }

    /// One event; false when its bytes were left out.
    fn write_event<S: BitSink>(&self, event: &HostEvent<'_>, to: &mut S) -> bool {
        to.put(event.line.min(3) as u32, 2);
        to.put(event.overtaken.into(), 1);
        let (kind, response) = match event.event {
            LinkEvent::Frame(frame) => {
                to.put(frame.frame_type as u32, 8);
                let fits = has_bytes(frame);
                to.put(if fits { 0 } else { 1 }, 2);
                if fits {
                    to.put(frame.bytes.len() as u32, 6);
                    for byte in frame.bytes {
                        to.put((*byte).into(), 8);
                    }
                }
                return fits;
            }
            LinkEvent::Bad(response) => (2, response),
            LinkEvent::Noise(response) => (3, response),
        };
        to.put(response.frame_type.into(), 8);
        to.put(kind, 2);
        to.put(response.status as u32, 3);
        true
    }
}

/// The frame is recorded with its bytes. Parameters change the arm, whatever their length: a snapshot after them says which it is.
fn has_bytes(frame: FrameRef<'_>) -> bool {
    frame.bytes.len() <= HOST_BYTES && !changes_arm(frame.frame_type)
}

/// Frames that change the parameters, which a log has by hash only.
fn changes_arm(frame_type: FrameType) -> bool {
    use FrameType::*;
    frame_type.is_default() || matches!(frame_type, FrictionTable | PidParam | ArmModel | FrictionPolynomial)
}
