//! The bus line between the CAN controller and the other nodes of the joint bus. The model includes arbitration, frame
//! times, acknowledgement and errors.
use std::collections::VecDeque;

use can_link::CanFrame;

use crate::clock::{MICROSECOND, NEVER, Time, from_ns};

/// Duration of a bit in the nominal phase on the bus.
pub const NOMINAL_BIT: Time = MICROSECOND;
/// Total duration of an error flag, the error flags of the other nodes, the delimiter and the intermission.
pub const ERROR_FRAME: Time = 20 * NOMINAL_BIT;
/// Largest number of entries in the log of the bus.
const LOG: usize = 100_000;

/// The other nodes of the joint bus.
pub trait CanPeers {
    /// Receives a frame that the CAN controller has sent and that ended at `end`. Appends the answers of the other
    /// nodes to `answers`, each with the time at which it is ready.
    fn receive(&mut self, end: Time, frame: &CanFrame, answers: &mut Vec<(Time, CanFrame)>);
    /// Returns `true` if one of the other nodes acknowledges frames.
    fn acknowledge(&self) -> bool;
}

/// Outcome of a frame on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The frame was transmitted.
    Good,
    /// An error destroyed the frame.
    Error,
    /// No node acknowledged the frame.
    NoAcknowledge,
}

/// Log entry of a frame that was on the bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusEntry {
    /// Time of the start of frame.
    pub start: Time,
    /// End of the intermission after the frame.
    pub end: Time,
    /// The frame that was on the bus.
    pub frame: CanFrame,
    /// `true` if the CAN controller sent the frame.
    pub from_controller: bool,
    /// Outcome of the frame.
    pub outcome: Outcome,
}

/// Current faults of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireFault {
    /// Number of frames that errors will destroy, beginning with the next frame on the bus.
    pub destroy_next: u32,
    /// `true` if errors destroy all frames.
    pub destroy_all: bool,
    /// `true` if the bus line of the CAN controller is cut.
    pub cut: bool,
}

struct Queued {
    ready: Time,
    frame: CanFrame,
}

/// A frame that a node is sending.
pub struct Transmission {
    /// Start, end and contents of the frame.
    pub entry: BusEntry,
    /// Index of the transmit buffer of the CAN controller; `None` if another node is sending.
    pub buffer: Option<u32>,
}

/// The line of the joint bus.
#[derive(Default)]
pub struct Wire {
    /// The other nodes of the bus. Without other nodes, no frame is acknowledged.
    pub peers: Option<Box<dyn CanPeers>>,
    queue: Vec<Queued>,
    on_wire: Option<Transmission>,
    free: Time,
    /// Current faults of the bus.
    pub fault: WireFault,
    log: VecDeque<BusEntry>,
    answers: Vec<(Time, CanFrame)>,
}

impl Wire {
    /// Queues a frame of another node. The node sends the frame as soon as possible after `ready`.
    pub fn put(&mut self, ready: Time, frame: CanFrame) {
        self.queue.push(Queued { ready, frame });
    }

    /// Returns the number of frames of other nodes that wait for the bus.
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// Returns the frames that were on the bus, oldest first (at most the last 100 000).
    pub fn log(&self) -> &VecDeque<BusEntry> {
        &self.log
    }

    /// Clears the log of the bus.
    pub fn clear_log(&mut self) {
        self.log.clear();
    }

    /// Removes the frame that the CAN controller is sending, if any. The controller calls this function when it
    /// stops.
    pub fn drop_controller(&mut self) {
        if self.on_wire.as_ref().is_some_and(|t| t.buffer.is_some()) {
            self.on_wire = None;
        }
    }

    /// Returns the time of the next change on the bus line that occurs without an action of the CAN controller.
    pub fn next_change(&self) -> Time {
        match &self.on_wire {
            Some(t) => t.entry.end,
            None => self.queue.iter().map(|q| q.ready.max(self.free)).min().unwrap_or(NEVER),
        }
    }

    /// Returns the frame that has ended at or before `now`.
    pub fn finished(&mut self, now: Time) -> Option<Transmission> {
        let done = self.on_wire.take_if(|t| t.entry.end <= now)?;
        self.free = done.entry.end;
        if self.log.len() == LOG {
            self.log.pop_front();
        }
        self.log.push_back(done.entry.clone());
        Some(done)
    }

    /// Returns the transmit buffer whose frame the CAN controller is sending.
    pub fn sending(&self) -> Option<u32> {
        self.on_wire.as_ref().and_then(|t| t.buffer)
    }

    /// Returns `true` if a frame is on the bus line.
    pub fn busy(&self) -> bool {
        self.on_wire.is_some()
    }

    /// Returns the time at which the next frame starts. Returns `None` if the bus is busy, or if no frame can start
    /// by `now`. `own` is the earliest time at which the CAN controller can start its own frame.
    pub fn start_time(&self, own: Time, now: Time) -> Option<Time> {
        let first = self.queue.iter().map(|q| q.ready).min().unwrap_or(NEVER).min(own);
        let start = first.max(self.free);
        (self.on_wire.is_none() && first != NEVER && start <= now).then_some(start)
    }

    /// Arbitrates at `start`: the frame with the lowest identifier wins. `readable` means that the CAN controller uses
    /// the bit rates of the bus.
    pub fn arbitrate(&mut self, start: Time, own: Option<(u32, CanFrame)>, readable: bool) {
        let best = (0..self.queue.len())
            .filter(|&i| self.queue[i].ready <= start)
            .min_by_key(|&i| (rank(&self.queue[i].frame), i));
        let own_wins = match (&own, best) {
            (Some((_, frame)), Some(i)) => rank(frame) < rank(&self.queue[i].frame),
            (own, _) => own.is_some(),
        };
        let cut = self.fault.cut;
        let acknowledged = self.peers.as_ref().is_some_and(|p| p.acknowledge());
        let (buffer, frame) = match (own, best) {
            (Some((buffer, frame)), _) if own_wins => (Some(buffer), frame),
            (_, Some(i)) => (None, self.queue.remove(i).frame),
            _ => return,
        };
        let length = frame_time(&frame);
        let from_controller = buffer.is_some();
        let destroyed = self.destroyed() || from_controller && !readable;
        let (outcome, length) = if destroyed {
            (Outcome::Error, length / 2 + ERROR_FRAME)
        } else if from_controller && (cut || !acknowledged) {
            (Outcome::NoAcknowledge, length + ERROR_FRAME)
        } else {
            (Outcome::Good, length)
        };
        if outcome != Outcome::Good && !from_controller {
            // The node sends the frame again after the error.
            self.queue.push(Queued { ready: start + length, frame });
        }
        let entry = BusEntry { start, end: start + length, frame, from_controller, outcome };
        self.on_wire = Some(Transmission { entry, buffer });
    }

    fn destroyed(&mut self) -> bool {
        let one = self.fault.destroy_next > 0;
        self.fault.destroy_next -= u32::from(one);
        one || self.fault.destroy_all
    }

    /// Delivers a frame of the CAN controller to the other nodes.
    pub fn deliver(&mut self, end: Time, frame: &CanFrame) {
        let Some(peers) = &mut self.peers else { return };
        peers.receive(end, frame, &mut self.answers);
        self.queue.extend(self.answers.drain(..).map(|(ready, frame)| Queued { ready, frame }));
    }
}

/// Returns the rank of an identifier in arbitration. An 11-bit identifier wins against a 29-bit identifier with equal
/// first bits.
pub fn rank(frame: &CanFrame) -> u32 {
    let id = frame.id();
    if id.is_extended() { id.value() << 1 | 1 } else { id.value() << 19 }
}

/// Returns the duration of a frame on the bus line, including intermission.
pub fn frame_time(frame: &CanFrame) -> Time {
    let joint = u16::try_from(frame.id().value()).ok().and_then(|id| jtc_bus::Frame::new(id, frame.data()));
    if let Some(joint) = joint
        && frame.is_fd()
        && frame.is_brs()
        && !frame.is_extended()
    {
        return from_ns(u64::from(jtc_bus::duration_ns(&joint)));
    }
    // Frames that do not belong to the protocol of the joint bus reach this code. For these frames, the model assumes
    // one stuff bit per ten bits.
    let id_bits = if frame.is_extended() { 38 } else { 19 };
    let data_bits = 8 * frame.data().len() as u64;
    let bits = if !frame.is_fd() {
        (id_bits + data_bits + 15) * 11 / 10 + 13
    } else if frame.is_brs() {
        (id_bits * 11 / 10 + 13) + (data_bits * 11 / 10 + 35) / 5
    } else {
        (id_bits + data_bits) * 11 / 10 + 48
    };
    bits * NOMINAL_BIT
}
