//! Complete simulation of host line, controller, joint bus, drives and arm, in steps of one millisecond.
use jtc_bus::{Frame, JOINTS, NODES, NodeState, Scale};
use jtc_core::{BusState, ControllerState};
use jtc_wire::FrameType;

use crate::board::{Board, Pins, Worked};
use crate::bus::{Bus, BusFault};
use crate::config::SimConfig;
use crate::event::{Event, Log};
use crate::faults::{Change, FaultKind, Running};
use crate::hand::{Hand, HandPath};
use crate::plant::Plant;
use crate::serial::{Line, LineFault};

mod access;
mod exchange;
mod moment;

pub use access::Statistics;
pub use exchange::Exchange;
pub use moment::Moment;

/// Duration of a tick, µs.
const TICK_US: u64 = 1000;

/// A simulated controller with its arm.
pub struct World {
    config: SimConfig,
    ticks: u64,
    board: Board,
    bus: Bus,
    plant: Plant,
    to_device: Line,
    /// Clock that the board uses to measure silence on its serial line, µs. `heard_us` is the time of the last byte.
    line_us: u64,
    heard_us: u64,
    /// Upper limit of the silence that the board measures on the serial line, µs. With `None`, the board measures the
    /// silence in virtual time, without a limit.
    silence_us: Option<u64>,
    to_host: Line,
    host_inbox: Vec<u8>,
    received: Vec<Frame>,
    bus_state: BusState,
    sent: Option<Frame>,
    ticked: bool,
    safety_output: bool,
    safety_input: bool,
    faults: Running,
    hands: Vec<HandPath>,
    hand: Option<Hand>,
    line_fault: LineFault,
    overrun: bool,
    input_fault: bool,
    line_rng: fastrand::Rng,
    node_states: [NodeState; NODES],
    seen: Seen,
    good_frames: u64,
    bad_frames: u64,
    log: Log,
    /// Inputs and outputs of the board, if recording is enabled.
    exchange: Option<Box<Exchange>>,
}

/// Controller states and errors that were logged last, used to detect changes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Seen {
    state: ControllerState,
    trajectory: jtc_core::TrajectoryState,
    errors: u16,
}

impl World {
    /// Creates a simulation that has just been switched on.
    pub fn new(config: SimConfig) -> Self {
        let plant = Plant::new(&config);
        let scales = config.drives.map(|d| Scale { velocity: d.velocity_full_scale });
        let mut world = Self {
            ticks: 0,
            board: Board::new(
                config.controller.clone(),
                config.stored_arm.clone(),
                config.inter_byte_timeout_us,
                config.watchdog_ms,
            ),
            bus: Bus::new(scales, config.seed ^ 0x6275_7300),
            node_states: plant.node_states(),
            plant,
            to_device: Line::new(config.baud),
            line_us: 0,
            heard_us: 0,
            silence_us: None,
            to_host: Line::new(config.baud),
            host_inbox: Vec::new(),
            received: Vec::with_capacity(16),
            bus_state: BusState { acknowledged: true, bus_off: false },
            sent: None,
            ticked: false,
            safety_output: false,
            safety_input: true,
            faults: Running::new(&config.faults),
            hands: config.faults.hands.clone(),
            hand: None,
            line_fault: LineFault::default(),
            overrun: false,
            input_fault: false,
            line_rng: fastrand::Rng::with_seed(config.seed ^ 0x6C69_6E65),
            seen: Seen::default(),
            good_frames: 0,
            bad_frames: 0,
            log: Log::new(config.log_entries),
            exchange: None,
            config,
        };
        world.bus.monitored = world.config.bus_monitored;
        world.bus.jitter.most_ms = world.config.answer_jitter_ms;
        world
    }

    /// Simulates one millisecond.
    pub fn step(&mut self) {
        self.step_faults();
        self.receive();
        self.tick_controller();
        let now = self.now_us();
        self.bus_state = self.bus.tick(now, self.sent.as_ref(), &mut self.plant.nodes, &mut self.received);
        self.lead_by_hand();
        self.plant.step(self.safety_output);
        self.ticks += 1;
        let now = self.now_us();
        self.line_us += TICK_US;
        self.to_host.arrived(now, usize::MAX, &mut self.host_inbox);
        self.note();
    }

    /// Begins and ends the faults of this millisecond.
    fn step_faults(&mut self) {
        let telemetry = self.board.telemetry();
        let (state, point) = (telemetry.state, telemetry.point);
        let time = self.now_us();
        let (log, plant, hand) = (&mut self.log, &mut self.plant, &mut self.hand);
        let mut changed = false;
        self.faults.step(self.ticks, state, point, |change| {
            changed = true;
            match change {
                Change::Begin(kind) => {
                    log.push(time, Event::FaultBegins(kind));
                    plant.begin(kind);
                    if let FaultKind::Hand { path } = kind {
                        *hand = self.hands.get(path).cloned().map(Hand::new);
                    }
                }
                Change::End(kind) => {
                    log.push(time, Event::FaultEnds(kind));
                    if matches!(kind, FaultKind::Hand { .. }) {
                        *hand = None;
                    }
                }
            }
        });
        if changed {
            self.apply_faults();
        }
    }

    /// Applies the torque of the hand for this millisecond.
    fn lead_by_hand(&mut self) {
        let Some(hand) = &mut self.hand else { return };
        // A hand cannot move a joint with a closed brake, so the hand waits until every drive is enabled.
        let free = self.plant.node_states()[..JOINTS] == [NodeState::ENABLED; JOINTS];
        let teaching = free && self.board.telemetry().state == ControllerState::Teaching;
        let truth = self.plant.truth();
        let pull = hand.torque(teaching, &truth.q, &truth.qd);
        self.plant.hand = pull.unwrap_or_default();
        if pull.is_none() {
            self.hand = None;
        }
    }

    /// Applies the active faults, and removes the effects of all other faults.
    fn apply_faults(&mut self) {
        let mut bus = BusFault::default();
        let mut line = LineFault::default();
        self.overrun = false;
        self.input_fault = false;
        for kind in self.faults.active() {
            match kind {
                FaultKind::FramesLost { probability } => bus.lost = probability,
                FaultKind::FramesCorrupted { probability } => bus.corrupted = probability,
                FaultKind::FramesGarbled { probability } => bus.garbled = probability,
                FaultKind::BusOff => bus.bus_off = true,
                FaultKind::NoAcknowledge => bus.cut = true,
                FaultKind::SafetyInput => self.input_fault = true,
                FaultKind::SerialLost { probability } => line.lost = probability,
                FaultKind::SerialFlipped { probability } => line.flipped = probability,
                FaultKind::SerialDelayed => line.held = true,
                FaultKind::TickOverrun => self.overrun = true,
                // The function `Plant::set_faults` applies the other faults.
                _ => {}
            }
        }
        self.bus.fault = bus;
        self.line_fault = line;
        self.plant.set_faults(self.faults.active());
    }

    /// Passes bytes from the host to the board's parser.
    fn receive(&mut self) {
        let now = self.now_us();
        let mut fresh = Vec::new();
        if !self.line_fault.held {
            self.to_device.arrived(now, usize::MAX, &mut fresh);
            if self.line_fault != LineFault::default() {
                self.line_fault.apply(&mut fresh, &mut self.line_rng);
            }
        }
        if let Some(most) = self.silence_us.filter(|_| self.to_device.is_idle()) {
            // The board's clock never runs backwards.
            let before = self.line_us.saturating_sub(TICK_US).max(self.heard_us);
            self.line_us = self.line_us.min(self.heard_us.saturating_add(most)).max(before);
        }
        if !fresh.is_empty() {
            self.heard_us = self.line_us;
        }
        if let Some(exchange) = &mut self.exchange {
            // If the tick is missed, the safety output pin keeps its level.
            let safety_output = self.safety_output;
            **exchange = Exchange { host: fresh.clone(), safety_output, ..Exchange::default() };
        }
        self.board.receive(self.line_us, &fresh);
    }

    fn tick_controller(&mut self) {
        self.ticked = !self.overrun;
        self.sent = None;
        if self.overrun {
            if self.board.miss() {
                self.log.push(self.now_us(), Event::WatchdogReset);
                self.restart();
                if let Some(exchange) = &mut self.exchange {
                    exchange.safety_output = self.safety_output;
                }
            }
            return;
        }
        let pins = Pins {
            bus: &self.received,
            bus_state: self.bus_state,
            safety_input: self.safety_input && !self.input_fault,
            status_free: self.to_host.is_idle(),
        };
        let outputs = self.board.tick(&pins);
        if let Some(exchange) = &mut self.exchange {
            exchange.note(&pins, &outputs, &self.board);
        }
        self.received.clear();
        self.sent = outputs.bus;
        self.safety_output = outputs.safety_output;
        if outputs.status {
            self.to_host.write(self.now_us(), self.board.status_frame());
        }
        if outputs.answer_line.is_some() {
            self.to_host.write(self.now_us(), self.board.answer_frame());
        }
        let now = self.now_us();
        for worked in &self.board.worked {
            match *worked {
                Worked::Frame(_) | Worked::Exec(_) => {
                    let exec = FrameType::TrajSetExecStatus as u8;
                    let frame_type = if let Worked::Frame(other) = *worked { other } else { exec };
                    self.good_frames += 1;
                    self.log.push(now, Event::Frame { frame_type });
                }
                Worked::Bad(status) => {
                    self.bad_frames += 1;
                    self.log.push(now, Event::BadFrame { status });
                }
            }
        }
    }

    /// Applies the effects of a board reset on the other parts of the simulation.
    fn restart(&mut self) {
        self.safety_output = false;
        self.bus.clear();
        self.received.clear();
        self.bus_state = BusState { acknowledged: true, bus_off: false };
        self.to_host.clear();
    }

    /// Adds changes of states to the log.
    fn note(&mut self) {
        let time = self.now_us();
        let telemetry = self.board.telemetry();
        let now = Seen { state: telemetry.state, trajectory: telemetry.trajectory, errors: telemetry.errors };
        if now != self.seen {
            let before = core::mem::replace(&mut self.seen, now);
            if now.state != before.state {
                self.log.push(time, Event::ControllerState { from: before.state, to: now.state });
            }
            if now.trajectory != before.trajectory {
                self.log.push(time, Event::Execution { from: before.trajectory, to: now.trajectory });
            }
            if now.errors != before.errors {
                self.log.push(time, Event::Errors { from: before.errors, to: now.errors });
            }
        }
        let states = self.plant.node_states();
        if states != self.node_states {
            for node in 0..NODES {
                let (from, to) = (self.node_states[node], states[node]);
                if from != to {
                    self.log.push(time, Event::Node { node: node as u8, from, to });
                }
            }
            self.node_states = states;
        }
    }
}
