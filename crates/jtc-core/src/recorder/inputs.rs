//! Encodes the inputs of a tick relative to the inputs of earlier ticks. Values that change in each tick are written as whole words,
//! because this takes little time. All other values are written as bits. A bit of the first word shows whether the tick contains other
//! values.
//!
//! Writer and reader each keep an identical [`Reference`]. A snapshot resets the reference of writer and reader.
use jtc_bus::{Frame, MAX_LEN, id};
use jtc_wire::{EVENTS_MAX, FrameRef, FrameType, LinkEvent, Segment, UrgentCommand, UrgentCommands};

use super::Block;
use super::memory::Writer;
use crate::bit_codec::BitSink;
use crate::io::{HostEvent, Inputs};
use crate::nodes::FRAMES_MAX;
use crate::{JOINTS, NODES};

/// Longest host frame whose bytes the log contains.
pub(super) const HOST_BYTES: usize = 48;
/// Allowance for the bytes of host frames in the log: the average number of bytes per tick, and the highest number of
/// bytes at one time.
const ALLOWANCE: (u16, u16) = (2, 500);
/// Bytes that an event takes from the allowance, in addition to the bytes of its frame. Without its frame, an event
/// takes 15 to 20 bits in the log.
const EVENT_BYTES: u16 = 2;

/// Values of earlier ticks. The inputs of the next tick are encoded relative to these values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reference {
    /// Lengths and words (from [`words`]) of the last answers to a Move. The log contains velocity and torque
    /// completely in each tick. These two values are therefore updated here only in ticks in which other words of the
    /// answers change.
    pub(super) len: [u8; NODES],
    pub(super) words: [Words; NODES],
    /// Number of nodes that are expected to answer.
    pub(super) expected: u8,
    /// Number of bytes of host frames that the log may still contain.
    allowance: u16,
}

/// Words of the payload of an answer.
pub(super) type Words = [u32; MAX_LEN / 4];

/// Returns the words of an answer in their order in memory. The function converts only the position to a number.
#[inline]
fn words(frame: &Frame) -> Words {
    let mut words = frame.words();
    words[POSITION] = words[POSITION].swap_bytes();
    words
}

impl Default for Reference {
    fn default() -> Self {
        Self {
            len: [16; NODES],
            words: [[0; MAX_LEN / 4]; NODES],
            expected: NODES as u8,
            allowance: ALLOWANCE.1,
        }
    }
}

/// Index of the word with the position in an answer, and index of the word with velocity and torque in an answer.
pub(super) const POSITION: usize = 0;
pub(super) const RATES: usize = 1;
/// Number of bits for the distance of a joint in a tick, in steps of a 16-bit encoder. The log contains these bits if the distances of all
/// joints fit into them.
const WAY_BITS: u32 = 5;
/// Mask of [`WAY_BITS`] bits, and half of the range of a distance.
const WAY: u32 = (1 << WAY_BITS) - 1;
const WAY_HALF: u32 = 1 << (WAY_BITS - 1);

/// Returns the new position of joint `n`, which was at `before`, from the word with the distances of all joints.
pub(super) fn moved(n: usize, before: u32, ways: u32) -> u32 {
    let way = (ways >> (WAY_BITS * n as u32) & WAY).wrapping_sub(WAY_HALF);
    before.wrapping_add(way << 16)
}

/// Bits of the first word of a tick. Bit 0 of this word is 0 for a tick and 1 for a snapshot.
pub(super) mod head {
    pub(crate) const STATUS_FREE: u32 = 1 << 1;
    /// The tick has no inputs except answers of the nodes.
    pub(crate) const QUIET: u32 = 1 << 2;
    /// Each expected node has answered in order. Words with the distances of all joints follow.
    pub(crate) const ORDERED: u32 = 1 << 3;
    /// The distance of a joint is too large for [`super::WAY_BITS`], so the words contain all positions.
    pub(crate) const FAR: u32 = 1 << 4;
    /// Words of the answers other than the motion have changed.
    pub(crate) const CHANGED: u32 = 1 << 5;
    /// Index of the lowest bit of the check value of the outputs.
    pub(crate) const CHECK: u32 = 16;
}

/// Motion of the joints in answers that arrived in order.
struct Answers {
    positions: [u32; JOINTS],
    rates: [u32; JOINTS],
    /// Distances of the joints. `far` is not zero if a joint has moved too far for [`WAY_BITS`].
    ways: u32,
    far: u32,
    /// Bits in which the other words of the answers differ from the reference.
    changed: u32,
}

/// Writes the words that differ from the words `before`.
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
    /// Writes the inputs of a tick, and a check value of the outputs. Returns `true` if all inputs are written, so that a replay of this
    /// tick has the same result.
    ///
    /// Drives send new positions in each tick, but other values in the answers rarely change. The inputs of a tick therefore usually take
    /// eight words.
    pub(super) fn write<P, const N: usize>(
        &mut self,
        inputs: &Inputs<'_>,
        done: usize,
        check: u16,
        to: &mut Writer<P, N>,
    ) -> bool
    where
        P: AsRef<[Block]> + AsMut<[Block]>,
    {
        let quiet = inputs.safety_input
            && inputs.bus_state == Inputs::QUIET.bus_state
            && inputs.missed_ticks == 0
            && inputs.host.is_empty()
            && inputs.urgent.iter().all(UrgentCommands::is_empty);
        self.allowance = (self.allowance + ALLOWANCE.0).min(ALLOWANCE.1);
        let mut head = u32::from(check) << head::CHECK;
        head |= if inputs.status_free { head::STATUS_FREE } else { 0 };
        head |= if quiet { head::QUIET } else { 0 };
        let bus = inputs.bus.get(..FRAMES_MAX).unwrap_or(inputs.bus);
        let Some(answers) = self.ordered(bus) else {
            to.append([head]);
            return self.write_more(head, inputs, done, to);
        };
        let changed = answers.changed != 0;
        head |= head::ORDERED | if changed { head::CHANGED } else { 0 };
        let ([p, q, r, s, t, u], [a, b, c, d, e, f]) = (answers.positions, answers.rates);
        if answers.far == 0 {
            to.append([head, a, b, c, d, e, f, answers.ways]);
        } else {
            to.append([head | head::FAR, a, b, c, d, e, f, p, q, r, s, t, u]);
        }
        for (before, position) in self.words.iter_mut().zip(answers.positions) {
            before[POSITION] = position;
        }
        (quiet && !changed) || self.write_more(head, inputs, done, to)
    }

    /// Returns the motion of the joints if each expected node has answered in order.
    #[inline]
    fn ordered(&self, bus: &[Frame]) -> Option<Answers> {
        if bus.len() != usize::from(self.expected) {
            return None;
        }
        let mut answers = Answers { positions: [0; JOINTS], rates: [0; JOINTS], ways: 0, far: 0, changed: 0 };
        let mut misplaced = 0;
        // The loop collects the differences without a branch for each value.
        let nodes = bus.iter().zip(self.len.iter().zip(&self.words)).zip(id::MOVE_ANSWER..);
        for (n, ((frame, (len, before)), id)) in nodes.enumerate() {
            let now = words(frame);
            misplaced |= (frame.id ^ id) | u16::from(frame.len() ^ len);
            answers.changed |=
                (now[2] ^ before[2]) | (now[3] ^ before[3]) | (now[4] ^ before[4]) | (now[5] ^ before[5]);
            match answers.positions.get_mut(n).zip(answers.rates.get_mut(n)) {
                Some((position, rates)) => {
                    let way = now[POSITION].wrapping_sub(before[POSITION]);
                    let steps = ((way as i32 >> 16) as u32).wrapping_add(WAY_HALF);
                    answers.far |= steps & !WAY | way << 16;
                    answers.ways |= steps << (WAY_BITS * n as u32);
                    (*position, *rates) = (now[POSITION], now[RATES]);
                }
                None => {
                    answers.changed |= (now[POSITION] ^ before[POSITION]) | (now[RATES] ^ before[RATES]);
                }
            }
        }
        (misplaced == 0).then_some(answers)
    }

    /// Writes all inputs of a tick except the motion, as the bits of the first word require.
    #[inline(never)]
    fn write_more<P, const N: usize>(
        &mut self,
        head: u32,
        inputs: &Inputs<'_>,
        done: usize,
        to: &mut Writer<P, N>,
    ) -> bool
    where
        P: AsRef<[Block]> + AsMut<[Block]>,
    {
        let whole = head & head::QUIET != 0 || self.write_rest(inputs, done, to);
        if head & head::ORDERED == 0 {
            self.write_frames(inputs.bus.get(..FRAMES_MAX).unwrap_or(inputs.bus), to);
        } else if head & head::CHANGED != 0 {
            for (n, frame) in inputs.bus.iter().enumerate() {
                if let Some(before) = self.words.get_mut(n).filter(|_| n < JOINTS) {
                    before[RATES] = words(frame)[RATES];
                }
                self.write_answer(n, frame, to);
            }
        }
        to.align();
        whole
    }

    /// Writes bus frames that may have any order.
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

    /// Sets the nodes that are expected to answer.
    pub(super) fn expect(&mut self, answers: u32) {
        if answers == 0x3F || answers == 0x7F {
            self.expected = answers.count_ones() as u8;
        }
    }

    /// Writes an answer of node `n` to a Move. The reader already knows the length of the answer.
    fn write_answer<S: BitSink>(&mut self, n: usize, frame: &Frame, to: &mut S) {
        let Some(before) = self.words.get_mut(n) else { return };
        let now = words(frame);
        to.put((now != *before).into(), 1);
        if now != *before {
            write_words(&now, before, to);
            *before = now;
        }
    }

    /// Writes all inputs that occur rarely, except the inputs of the joint bus.
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
        // The controller has completed the first `done` events, and may have executed a part of the next event.
        // `looked_at` contains all these events. The log contains as many of them as the allowance permits.
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

    /// Subtracts the bytes of an event from the allowance. Returns `false` if the allowance is too small.
    fn allows(&mut self, event: &HostEvent<'_>) -> bool {
        let bytes = match event.event {
            LinkEvent::Frame(frame) if has_bytes(frame) => EVENT_BYTES + frame.bytes.len() as u16,
            _ => EVENT_BYTES,
        };
        let rest = self.allowance.checked_sub(bytes);
        self.allowance = rest.unwrap_or(self.allowance);
        rest.is_some()
    }

    /// Writes one event. Returns `false` if the log does not contain the bytes of the event.
    fn write_event<S: BitSink>(&self, event: &HostEvent<'_>, to: &mut S) -> bool {
        to.put(event.line.min(3) as u32, 2);
        to.put(event.overtaken.into(), 1);
        to.put(event.plain.into(), 1);
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
                } else {
                    // In Operate, the only effect of a segment is that segment 0 begins an upload (J-30).
                    to.put(begins_upload(frame).into(), 1);
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

/// Returns `true` for segment 0 of a trajectory.
fn begins_upload(frame: FrameRef<'_>) -> bool {
    frame.frame_type == FrameType::Trajectory
        && Segment::parse(frame.body()).is_some_and(|segment| segment.segment == 0)
}

/// Returns `true` if the log contains the bytes of the frame. The log never contains the bytes of parameters. Parameters change the arm,
/// and the next snapshot identifies the changed arm.
fn has_bytes(frame: FrameRef<'_>) -> bool {
    frame.bytes.len() <= HOST_BYTES && !changes_arm(frame.frame_type)
}

/// Returns `true` for a frame that changes the parameters. A log contains only the hash of the parameters.
fn changes_arm(frame_type: FrameType) -> bool {
    use FrameType::*;
    frame_type.is_default() || matches!(frame_type, FrictionTable | PidParam | ArmModel | FrictionPolynomial)
}
