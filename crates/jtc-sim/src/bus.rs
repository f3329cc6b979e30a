//! Simulation of the joint bus, with one broadcast and its answers per millisecond. The simulation includes frame
//! times, arbitration, errors and bus-off.

mod nodes;

use std::collections::VecDeque;

use jtc_bus::{Frame, JOINTS, NODES, Scale};
use jtc_core::BusState;

pub(crate) use nodes::Nodes;

use crate::jitter::Jitter;
use crate::request::NodeRequest;

/// Duration of a tick, µs.
const TICK_US: u32 = 1000;
/// Duration of an error frame and the pause before the frame is repeated, µs.
const ERROR_FRAME_US: u32 = 23;
/// Transmit error counter above which a controller goes bus-off (ISO 11898-1).
const BUS_OFF: u16 = 255;
/// Recovery time of a controller from bus-off, 128 times 11 recessive bits, µs.
const RECOVERY_US: u32 = 1408;

/// Bit in the identifier that marks an answer.
const RESPONSE: u16 = 0x200;
/// Largest number of queued frames from nodes outside the simulation.
const FOREIGN_MAX: usize = 64;

/// Largest number of bytes of a frame on this bus.
const LEN_MAX: usize = 24;

/// Returns the duration of a CAN FD frame with `len` bytes (up to 24) at 1 and 5 Mbit/s, µs. The duration includes the usual
/// share of stuff bits.
pub const fn frame_us(len: usize) -> u32 {
    const TIMES: [u32; LEN_MAX + 1] = {
        let mut times = [0; LEN_MAX + 1];
        let mut len = 0;
        while len <= LEN_MAX {
            // A frame has 31 bits at the nominal rate. ESI, DLC and data are sent at five times this rate, with one stuff bit
            // per ten bits. The stuff count and the CRC follow the data.
            let crc = if len > 16 { 31 } else { 27 };
            let tenths = (5 + 8 * len as u32) * 11 + crc * 10;
            times[len] = 31 + (tenths + 25) / 50;
            len += 1;
        }
        times
    };
    TIMES[if len < LEN_MAX { len } else { LEN_MAX }]
}

/// Current faults of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BusFault {
    /// Share of receptions that fail, 0..1. For each frame, each receiver can fail separately.
    pub lost: f64,
    /// Share of frames that are destroyed on the bus and repeated, 0..1.
    pub corrupted: f64,
    /// Share of answers that reach the controller with changed contents, 0..1.
    pub garbled: f64,
    /// `true` if the bus cable of the controller is cut. With a cut cable, the controller receives no frames, and no node
    /// receives its frames.
    pub cut: bool,
    /// `true` if the controller is forced to stay bus-off.
    pub bus_off: bool,
}

/// Counters of the bus since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BusStatistics {
    /// Number of transmitted frames.
    pub frames: u64,
    /// Time for which the bus was busy, µs.
    pub busy_us: u64,
    /// Number of receptions that failed.
    pub lost: u64,
    /// Number of frames that were repeated after an error.
    pub repeated: u64,
    /// Number of answers that a fault has corrupted.
    pub garbled: u64,
    /// Number of requests that no node acknowledged.
    pub unacknowledged: u64,
    /// Number of times that the controller went bus-off.
    pub bus_offs: u64,
}

/// A frame and the time at which it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedFrame {
    /// Time from the start of the tick to the end of the frame, µs.
    pub end_us: u32,
    /// Frame on the joint bus.
    pub frame: Frame,
}

#[derive(Clone, Copy, Debug)]
struct Pending {
    ready_us: u32,
    frame: Frame,
}

/// Joint bus, including the CAN interface of the controller.
#[derive(Clone, Debug)]
pub struct Bus {
    scales: [Scale; JOINTS],
    pending: Vec<Pending>,
    /// Transmit error counter of the controller.
    errors: u16,
    off_us: Option<u32>,
    rng: fastrand::Rng,
    log: Vec<TimedFrame>,
    /// Frames from nodes outside this simulation, oldest first.
    foreign: VecDeque<Frame>,
    /// Model that delays the answers to the controller.
    pub jitter: Jitter,
    /// `true` if another device on the bus, such as an analyser, also acknowledges frames.
    pub monitored: bool,
    /// Current faults of the bus.
    pub fault: BusFault,
    /// Counters of the bus since the start.
    pub statistics: BusStatistics,
}

impl Bus {
    /// Creates a bus for drives with the value scales `scales`.
    pub fn new(scales: [Scale; JOINTS], seed: u64) -> Self {
        Self {
            scales,
            pending: Vec::new(),
            errors: 0,
            off_us: None,
            rng: fastrand::Rng::with_seed(seed),
            log: Vec::new(),
            foreign: VecDeque::new(),
            jitter: Jitter::new(seed),
            monitored: false,
            fault: BusFault::default(),
            statistics: BusStatistics::default(),
        }
    }

    /// Returns the frames of the last tick with the times at which they ended.
    pub fn frames(&self) -> &[TimedFrame] {
        &self.log
    }

    /// Simulates one millisecond. Sends `out` to the nodes, and adds the answers that are complete at the end of the
    /// millisecond to `received`. The answers stay in the list until the controller reads them, even if the
    /// controller's tick is late.
    pub fn tick(
        &mut self,
        now_us: u64,
        out: Option<&Frame>,
        nodes: &mut Nodes,
        received: &mut Vec<Frame>,
    ) -> BusState {
        let before = received.len();
        let state = self.exchange(now_us, out, nodes, received);
        self.jitter.delay(received, before);
        state
    }

    fn exchange(
        &mut self,
        now_us: u64,
        out: Option<&Frame>,
        nodes: &mut Nodes,
        received: &mut Vec<Frame>,
    ) -> BusState {
        self.log.clear();
        if self.recovering() {
            self.pending.clear();
            return BusState { acknowledged: false, bus_off: true };
        }
        let mut time = 0;
        let acknowledged = match out {
            Some(frame) => self.send(now_us, frame, nodes, &mut time),
            None => true,
        };
        if self.off_us.is_none() {
            self.answers(&mut time, received);
            if !self.foreign.is_empty() {
                self.carry_foreign(now_us, nodes, &mut time, received);
            }
        }
        BusState { acknowledged, bus_off: self.off_us.is_some() }
    }

    /// Counts down the recovery time from bus-off. Returns `true` while the controller is bus-off.
    fn recovering(&mut self) -> bool {
        if self.fault.bus_off {
            if self.off_us.is_none() {
                self.statistics.bus_offs += 1;
            }
            self.off_us = Some(RECOVERY_US);
            return true;
        }
        let Some(left) = self.off_us else { return false };
        if left > TICK_US {
            self.off_us = Some(left - TICK_US);
            return true;
        }
        self.off_us = None;
        self.errors = 0;
        false
    }

    /// Sends the request of the controller. Returns `true` if a node acknowledged the request.
    fn send(&mut self, now_us: u64, frame: &Frame, nodes: &mut Nodes, time: &mut u32) -> bool {
        if self.fault.cut || !(self.monitored || nodes.any_on_bus()) {
            // The controller repeats a request without acknowledgement until the next tick replaces it. A missing
            // acknowledgement alone does not cause bus-off.
            self.statistics.unacknowledged += 1;
            self.statistics.busy_us += u64::from(TICK_US);
            self.pending.clear();
            *time = TICK_US;
            return false;
        }
        if !self.carry(frame, time, true) {
            return false;
        }
        if let Some(request) = NodeRequest::parse(frame) {
            self.reach_nodes(now_us, &request, nodes, *time);
        }
        true
    }

    /// Passes a request to every node, and queues the nodes' answers.
    fn reach_nodes(&mut self, now_us: u64, request: &NodeRequest, nodes: &mut Nodes, time: u32) {
        for node in 0..NODES {
            if self.fault.lost > 0.0 && self.rng.f64() < self.fault.lost {
                self.statistics.lost += 1;
                continue;
            }
            let answer = nodes.answer(node, now_us + u64::from(time), request, &self.scales);
            if let Some((delay_us, frame)) = answer {
                self.pending.push(Pending { ready_us: time + delay_us, frame });
            }
        }
    }

    /// Transmits a frame, and repeats the frame after each error. Returns `false` if the tick has too little time for the frame.
    fn carry(&mut self, frame: &Frame, time: &mut u32, from_controller: bool) -> bool {
        let length = frame_us(frame.data().len());
        while self.fault.corrupted > 0.0 && self.rng.f64() < self.fault.corrupted {
            let wasted = length / 2 + ERROR_FRAME_US;
            *time += wasted;
            self.statistics.busy_us += u64::from(wasted);
            self.statistics.repeated += 1;
            if from_controller {
                self.errors += 8;
                if self.errors > BUS_OFF {
                    self.statistics.bus_offs += 1;
                    self.off_us = Some(RECOVERY_US);
                    return false;
                }
            }
            if *time + length > TICK_US {
                return false;
            }
        }
        *time += length;
        if *time > TICK_US {
            return false;
        }
        if from_controller {
            self.errors = self.errors.saturating_sub(1);
        }
        self.statistics.frames += 1;
        self.statistics.busy_us += u64::from(length);
        self.log.push(TimedFrame { end_us: *time, frame: *frame });
        true
    }

    /// Transmits the answers in the order of arbitration: whenever the bus is free, the ready answer with the lowest
    /// identifier is next.
    fn answers(&mut self, time: &mut u32, received: &mut Vec<Frame>) {
        while !self.pending.is_empty() && *time < TICK_US {
            let ready = |p: &Pending| p.ready_us <= *time;
            let Some(next) = (0..self.pending.len())
                .filter(|&i| ready(&self.pending[i]))
                .min_by_key(|&i| self.pending[i].frame.id)
            else {
                *time = self.pending.iter().map(|p| p.ready_us).min().unwrap_or(TICK_US);
                continue;
            };
            let frame = self.pending[next].frame;
            if !self.carry(&frame, time, false) {
                break;
            }
            self.pending.swap_remove(next);
            if self.fault.lost > 0.0 && self.rng.f64() < self.fault.lost {
                self.statistics.lost += 1;
            } else {
                received.push(self.garble(frame));
            }
        }
        // Answers that were not sent take part in arbitration in the next tick.
        for p in &mut self.pending {
            p.ready_us = 0;
        }
    }

    /// Transmits as many frames of nodes outside the simulation as the time in the tick permits. The controller receives
    /// answers, and the nodes receive all other frames.
    fn carry_foreign(&mut self, now_us: u64, nodes: &mut Nodes, time: &mut u32, received: &mut Vec<Frame>) {
        while let Some(frame) = self.foreign.front().copied() {
            if !self.carry(&frame, time, false) {
                break;
            }
            self.foreign.pop_front();
            if frame.id & RESPONSE != 0 {
                received.push(frame);
            } else if let Some(request) = NodeRequest::parse(&frame) {
                self.reach_nodes(now_us, &request, nodes, *time);
            }
        }
    }

    /// Queues a frame from a node outside this simulation. Returns `false` if the queue is full.
    pub fn put(&mut self, frame: Frame) -> bool {
        let room = self.foreign.len() < FOREIGN_MAX;
        if room {
            self.foreign.push_back(frame);
        }
        room
    }

    /// Returns the frame as a receiver with faulty memory reads it: the fault `garbled` changes the contents of some
    /// frames.
    fn garble(&mut self, frame: Frame) -> Frame {
        if self.fault.garbled == 0.0 || self.rng.f64() >= self.fault.garbled {
            return frame;
        }
        self.statistics.garbled += 1;
        let mut data = frame.data().to_vec();
        if self.rng.bool() {
            data.truncate(self.rng.usize(0..=data.len()));
        }
        for byte in &mut data {
            if self.rng.u8(0..4) == 0 {
                *byte = self.rng.u8(..);
            }
        }
        let id = if self.rng.u8(0..4) == 0 { self.rng.u16(0..0x800) } else { frame.id };
        Frame::new(id, &data).unwrap_or(frame)
    }

    /// Resets the error counter and ends bus-off, because the controller was reset.
    pub fn clear(&mut self) {
        self.errors = 0;
        self.off_us = None;
    }
}

#[cfg(test)]
mod tests {
    use super::nodes::ANSWER_US;
    use super::*;

    #[test]
    fn j12_a_round_of_seven_nodes_takes_what_was_measured() {
        let request = frame_us(16);
        let answer = frame_us(20);
        assert!((65..=74).contains(&request), "{request}");
        assert!((72..=83).contains(&answer), "{answer}");
        let round = request + ANSWER_US.0 + 7 * answer;
        assert!((570..=660).contains(&round), "{round}");
    }
}
