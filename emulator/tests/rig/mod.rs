//! A board under test, with the firmware file of the board, a simulated arm on its joint bus, and a host on each serial
//! line. In parallel, the same controller runs on the PC (the shadow controller) with the inputs from the flight record
//! of the board. The outputs of both controllers must be equal.
//!
//! The rig checks every millisecond of every test: no tick is missing, and the invariants of the simulator are true.
//! Torques, frames and statuses are bit-identical to the outputs of the shadow controller.
#![allow(dead_code, reason = "each test uses its part")]

mod elf;
mod flight;
mod host;
mod shadow;

use openjtc_emulator::clock::MICROSECOND;
use openjtc_emulator::fdcan::{BusEntry, Outcome};
use openjtc_emulator::{Board, BoardConfig, FIRST_LINE, Port};

use jtc_core::{ControllerState, Telemetry};
use jtc_sim::Moment;
use jtc_sim::{FaultKind, host as frames};
use jtc_wire::{DataStatus, ExecCommand, FrameStatus, Response, Status, StoreState};
use sim_checks::Invariants;

#[allow(unused_imports, reason = "each test uses its part")]
pub use elf::{BOARDS, Version, elf, fast_elf, program, version};
pub use flight::{FLIGHT_SIZE, Flight};
pub use host::Host;
pub use shadow::Shadow;
use shadow::{LogMemory, Start, no_log};

/// Exception number of the tick interrupt.
const TIM7: usize = FIRST_LINE + 55;

/// Ports of both serial lines, in the order of the flight record.
pub const PORTS: [Port; 2] = [Port::Usart2, Port::Usart3];

/// Returns the index of a port in arrays that have one element for each port.
pub fn index(port: Port) -> usize {
    match port {
        Port::Usart2 => 0,
        Port::Usart3 => 1,
    }
}

/// Test rig with a board, its hosts, and the shadow controller.
pub struct Rig {
    /// The emulated board.
    pub board: Board,
    /// Hosts with the bytes that they sent and received.
    pub hosts: [Host; 2],
    /// The shadow controller; `None` from a start of the board until its first tick.
    pub shadow: Option<Shadow>,
    /// Last complete flight record of the board.
    pub flight: Flight,
    /// Frames that were on the joint bus in the last millisecond.
    pub bus: Vec<BusEntry>,
    /// `true` if ticks may be missing, because the test makes the board hang.
    pub may_hang: bool,
    /// Number of ticks since the board started.
    pub ticks: u64,
    /// Contents of the flight recorder when the board was reset.
    log: LogMemory,
    invariants: Invariants,
    flight_at: u32,
    mailbox_at: u32,
    /// Address to which the firmware writes the length and CRC of its program in flash (J-67).
    program_at: u32,
    resets: usize,
    /// Frames that the last ticks sent and that have not been on the joint bus yet.
    to_pass: Vec<jtc_bus::Frame>,
}

impl Rig {
    /// Creates a test rig with a board that has just been switched on.
    pub fn new(board: &str) -> Self {
        Self::with(board, BoardConfig::default())
    }

    /// Creates a test rig whose board has this configuration.
    pub fn with(board: &str, config: BoardConfig) -> Self {
        Self::of(elf(board), &config)
    }

    /// Creates a test rig whose board has this firmware.
    pub fn of(elf: openjtc_emulator::Elf, config: &BoardConfig) -> Self {
        let flight_at = elf.symbol("FLIGHT").expect("the flight record").address;
        let mailbox_at = elf.symbol("ARM_STORE").expect("the mailbox").address;
        let program_at = elf.symbol("PROGRAM").expect("what it has read of its flash").address;
        let board = Board::new(elf, config);
        Self {
            board,
            hosts: [Host::default(), Host::default()],
            shadow: None,
            flight: Flight::default(),
            bus: Vec::new(),
            may_hang: false,
            ticks: 0,
            log: no_log(),
            invariants: Invariants::default(),
            flight_at,
            mailbox_at,
            program_at,
            resets: 1,
            to_pass: Vec::new(),
        }
    }

    /// Advances the board, the arm and the hosts by one millisecond, and does all checks.
    pub fn step(&mut self) {
        self.board.step();
        let ms = self.board.now_ms();
        let resets = self.board.machine.chip().observers.resets.clone();
        for reset in &resets[self.resets..] {
            // The program of the board restarts. Therefore the shadow controller and the receivers of the hosts also
            // restart. The rig keeps the memory of the flight recorder.
            if let Some(shadow) = self.shadow.take() {
                self.log = shadow.into_log();
            }
            self.ticks = 0;
            self.to_pass.clear();
            for host in &mut self.hosts {
                host.device_was_reset(reset.time);
            }
        }
        self.resets = resets.len();
        self.take_bus();
        if let Some(flight) = self.complete_flight() {
            let due = self.ticks > 0 && !self.may_hang;
            if flight.tick == self.ticks + 1 && flight.phase == Flight::PHASE_COMPLETE {
                self.ticked(flight);
            } else {
                assert!(!due, "{ms} ms: tick {} of the board follows {}", flight.tick, self.ticks);
            }
        } else {
            assert_eq!(self.ticks, 0, "{ms} ms: the flight record is gone");
        }
        for port in PORTS {
            let bytes = self.board.read_timed(port);
            self.hosts[index(port)].receive(&bytes);
        }
    }

    fn ticked(&mut self, flight: Flight) {
        let ms = self.board.now_ms();
        self.ticks = flight.tick;
        let start = self.shadow.is_none().then(|| self.start(flight.cause));
        let [state, _, sequence, ..] = self.mailbox();
        let read = self.board.machine.word(self.program_at).expect("memory") != 0;
        let shadow = self.shadow.get_or_insert_with(|| Shadow::new(start.expect("it has just started")));
        shadow.tick(&flight, &mut self.hosts);
        match state {
            3 => shadow.stored(StoreState::Stored, sequence),
            4 => shadow.stored(StoreState::Failed, sequence),
            _ => {}
        }
        if read {
            shadow.flash_is_read();
        }
        self.to_pass.extend(flight.sent);
        let level = flight.safety_output;
        assert_eq!(self.board.safety_output(), Some(level), "{ms} ms: safety output");
        let truth = *self.board.plant().truth();
        let checked = self.invariants.check_moment(&Moment {
            time_us: ms * 1000,
            ticked: true,
            telemetry: &shadow.telemetry(),
            truth: &truth,
            sent: flight.sent.as_ref(),
            worked: &shadow.worked,
            safety_output: level,
            config: shadow.config(),
        });
        if let Err(violation) = checked {
            panic!("{violation}");
        }
        self.flight = flight;
    }

    /// Returns the firmware's mailbox of the stored arm. Its words are in the order of `firmware/src/arm_store.rs`.
    fn mailbox(&self) -> [u32; 8] {
        core::array::from_fn(|n| self.board.machine.word(self.mailbox_at + 4 * n as u32).expect("memory"))
    }

    /// Returns the data about a start of the board.
    fn start(&self, cause: u32) -> Start {
        let [.., address, length, sequence] = self.mailbox();
        let arm = (address != 0).then(|| {
            let image = self.board.machine.memory(address, length as usize).expect("memory");
            (image, sequence)
        });
        let version = version(self.board.machine.elf()).expect("the record of the version");
        let program = program(self.board.machine.elf());
        Start { cause, boots: self.resets as u32, version, program, arm, log: self.log.clone() }
    }

    /// Checks that the frames of the controller appear on the joint bus unchanged and in order. Frames may also be
    /// missing on the bus.
    fn take_bus(&mut self) {
        let wire = &mut self.board.machine.chip().fdcan.wire;
        self.bus = wire.log().iter().cloned().collect();
        wire.clear_log();
        for entry in self.bus.iter().filter(|e| e.from_controller && e.outcome == Outcome::Good) {
            let frame = &entry.frame;
            assert!(frame.is_fd() && frame.is_brs() && !frame.is_extended(), "{frame:?}");
            let passed = jtc_bus::Frame::new(frame.id().value() as u16, frame.data());
            let Some(at) = self.to_pass.iter().position(|sent| Some(*sent) == passed) else {
                // This frame is not in the list yet. The frame belongs to the current tick, whose flight record the rig
                // reads later.
                continue;
            };
            self.to_pass.drain(..=at);
        }
    }

    /// Returns the flight record. If a tick is still running at the end of the millisecond, this function first waits
    /// for the end of the tick.
    fn complete_flight(&mut self) -> Option<Flight> {
        // 80 steps of 5 µs are enough for the longest tick, which takes a third of a millisecond. In this tick, the
        // controller receives an arm model and computes all values that depend on the model.
        for _ in 0..80 {
            // During a tick, the flight record may be only half written. If the next tick is already due, the record
            // is too old.
            if !self.in_tick() {
                let flight = self.read_flight()?;
                let due = self.ticks > 0 && !self.may_hang && flight.tick == self.ticks;
                if flight.phase != Flight::PHASE_INPUTS && !due {
                    return Some(flight);
                }
            }
            let next = self.board.machine.now() + 5 * MICROSECOND;
            self.board.machine.run_until(next);
        }
        self.read_flight()
    }

    /// Returns `true` while the tick interrupt is running.
    fn in_tick(&mut self) -> bool {
        self.board.machine.chip().core.contexts.contains(&TIM7)
    }

    /// Returns the current flight record. Returns `None` if the memory does not contain a flight record.
    pub fn read_flight(&mut self) -> Option<Flight> {
        let bytes = self.board.machine.memory(self.flight_at, FLIGHT_SIZE)?;
        Flight::parse(&bytes)
    }

    /// Runs the board for `ms` milliseconds.
    pub fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    /// Runs the board until `done` returns `true`, at most `ms` milliseconds.
    #[track_caller]
    pub fn wait(&mut self, what: &str, ms: u64, mut done: impl FnMut(&mut Self) -> bool) {
        for _ in 0..=ms {
            if done(self) {
                return;
            }
            self.step();
        }
        let t = self.shadow.as_ref().map(|s| s.telemetry());
        panic!("{what}: not within {ms} ms; {t:?}");
    }

    /// Returns the telemetry of the shadow controller, which is bit-identical to the telemetry of the board.
    pub fn telemetry(&self) -> Telemetry {
        self.shadow.as_ref().map(|s| s.telemetry()).unwrap_or_default()
    }

    /// Returns the state of the shadow controller.
    pub fn state(&self) -> ControllerState {
        self.telemetry().state
    }

    /// Sends bytes from the host at a port.
    pub fn write(&mut self, port: Port, bytes: &[u8]) {
        self.hosts[index(port)].sent.extend_from_slice(bytes);
        self.board.write(port, bytes);
    }

    /// Sends a frame and waits for its response record. The board must not send this record to another port.
    #[track_caller]
    pub fn response(&mut self, port: Port, frame: &[u8]) -> Response {
        for host in &mut self.hosts {
            host.records.clear();
        }
        self.write(port, frame);
        self.wait("a record", 8_000, |rig| !rig.hosts[index(port)].records.is_empty());
        let other = &self.hosts[1 - index(port)];
        assert!(other.records.is_empty(), "J-04: the other port received {:?}", other.records);
        self.hosts[index(port)].records.remove(0)
    }

    /// Sends a frame that the board must accept.
    #[track_caller]
    pub fn ask(&mut self, port: Port, frame: &[u8]) {
        let response = self.response(port, frame);
        let good = response.status == FrameStatus::NoError && response.data == DataStatus::NoError;
        assert!(good, "refused: {response}");
    }

    /// Returns the newest status that the host at a port received.
    pub fn status(&self, port: Port) -> Status {
        self.hosts[index(port)].last.expect("a status was received")
    }

    /// Sends default parameters from the host at `port`, then waits until every joint is enabled and holds its
    /// position.
    #[track_caller]
    pub fn bring_up(&mut self, port: Port) {
        self.wait("the board is up", 50, |rig| rig.ticks > 0);
        self.write(port, &frames::use_defaults());
        self.wait_for_hold(12_000);
    }

    /// Starts a trajectory from the current position to another position and back. The motion takes `seconds` in each
    /// direction. After the start, runs the board for `ms` milliseconds.
    #[track_caller]
    pub fn set_off(&mut self, port: Port, seconds: f64, ms: u64) {
        let here = self.telemetry().joints.map(|j| j.set_position);
        let there = [0.4, 0.2, -0.2, 0.5, 0.3, 0.2];
        for segment in frames::trajectory(&frames::there_and_back(&here, &there, seconds, 1, 10), 10, 113) {
            self.ask(port, &segment);
        }
        self.ask(port, &frames::exec(ExecCommand::Execute));
        self.run(ms);
        assert_eq!(self.state(), ControllerState::Operate);
    }

    /// Waits until every joint is enabled and holds its position.
    #[track_caller]
    pub fn wait_for_hold(&mut self, ms: u64) {
        self.wait("HoldPos with all joints enabled", ms, |rig| {
            rig.state() == ControllerState::HoldPos
                && rig.board.plant().node_states()[..6] == [jtc_bus::NodeState::ENABLED; 6]
        });
    }

    /// Starts a simulated fault.
    pub fn inject(&mut self, kind: FaultKind) {
        self.board.inject(kind);
    }

    /// Reads a register of the board, as a debugger does.
    pub fn register(&mut self, address: u32) -> u32 {
        self.board.machine.word(address).unwrap_or_else(|| panic!("no register at {address:#010x}"))
    }
}
