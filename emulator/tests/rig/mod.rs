//! A board under test, with the board's own ELF file, a simulated arm on its joint bus, and a host on each serial line.
//! In parallel, the same controller runs on the PC (the shadow controller) with the inputs from the board's flight
//! record. The outputs of both controllers must be equal.
//!
//! Every millisecond of every test is checked: no tick is missing, and the invariants of the simulator are
//! true. Torques, frames and statuses are bit-identical to the outputs of the shadow controller.
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

/// Exception number of the tick.
const TIM7: usize = FIRST_LINE + 55;

/// Ports of both lines, in the order of the flight record.
pub const PORTS: [Port; 2] = [Port::Usart2, Port::Usart3];

/// Index of a port in arrays.
pub fn index(port: Port) -> usize {
    match port {
        Port::Usart2 => 0,
        Port::Usart3 => 1,
    }
}

/// Board, hosts, and the shadow controller.
pub struct Rig {
    /// The emulated board.
    pub board: Board,
    /// Hosts with the bytes that they sent and received.
    pub hosts: [Host; 2],
    /// The shadow controller; `None` until the board's first tick after a start.
    pub shadow: Option<Shadow>,
    /// Last complete flight record of the board.
    pub flight: Flight,
    /// Frames on the joint bus in the last millisecond.
    pub bus: Vec<BusEntry>,
    /// `true` if ticks may be missing, because the test makes the board hang.
    pub may_hang: bool,
    /// Number of ticks since the board started.
    pub ticks: u64,
    /// Contents of the flight recorder at the board's reset.
    log: LogMemory,
    invariants: Invariants,
    flight_at: u32,
    mailbox_at: u32,
    /// Address to which the firmware writes the length and CRC of its flash (J-67).
    program_at: u32,
    resets: usize,
    /// Frames that the last ticks sent and that have not been on the bus yet.
    to_pass: Vec<jtc_bus::Frame>,
}

impl Rig {
    /// Creates a board that has just been switched on.
    pub fn new(board: &str) -> Self {
        Self::with(board, BoardConfig::default())
    }

    /// Creates a board with another configuration.
    pub fn with(board: &str, config: BoardConfig) -> Self {
        Self::of(elf(board), &config)
    }

    /// Creates a board with this firmware.
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

    /// Advances the board, the arm and the hosts by one millisecond, and makes all checks.
    pub fn step(&mut self) {
        self.board.step();
        let ms = self.board.now_ms();
        let resets = self.board.machine.chip().observers.resets.clone();
        for reset in &resets[self.resets..] {
            // The program restarts. Everything that runs in parallel restarts, too, except the log.
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

    /// Returns the firmware's mailbox of the stored arm, with words in the order of `firmware/src/arm_store.rs`.
    fn mailbox(&self) -> [u32; 8] {
        core::array::from_fn(|n| self.board.machine.word(self.mailbox_at + 4 * n as u32).expect("memory"))
    }

    /// Returns data about the board's start.
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

    /// Checks that the frames of the controller are unchanged and in order on the bus. Frames may also be missing.
    fn take_bus(&mut self) {
        let wire = &mut self.board.machine.chip().fdcan.wire;
        self.bus = wire.log().iter().cloned().collect();
        wire.clear_log();
        for entry in self.bus.iter().filter(|e| e.from_controller && e.outcome == Outcome::Good) {
            let frame = &entry.frame;
            assert!(frame.is_fd() && frame.is_brs() && !frame.is_extended(), "{frame:?}");
            let passed = jtc_bus::Frame::new(frame.id().value() as u16, frame.data());
            let Some(at) = self.to_pass.iter().position(|sent| Some(*sent) == passed) else {
                // The frame belongs to the tick that is running now, whose record is read later.
                continue;
            };
            self.to_pass.drain(..=at);
        }
    }

    /// Returns the flight record. If a tick extends over two milliseconds, waits for its end.
    fn complete_flight(&mut self) -> Option<Flight> {
        // The longest tick takes a third of a millisecond, when a model is received and all values that depend on
        // it are computed.
        for _ in 0..80 {
            // A half-written record is not valid. The start of a tick may also be due at this time.
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

    /// Returns the current flight record; `None` if the memory does not contain a record.
    pub fn read_flight(&mut self) -> Option<Flight> {
        let bytes = self.board.machine.memory(self.flight_at, FLIGHT_SIZE)?;
        Flight::parse(&bytes)
    }

    /// Runs `ms` milliseconds.
    pub fn run(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    /// Runs until `done` returns `true`, at most `ms` milliseconds.
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

    /// Returns the telemetry of the shadow controller, which is bit-identical to the board's.
    pub fn telemetry(&self) -> Telemetry {
        self.shadow.as_ref().map(|s| s.telemetry()).unwrap_or_default()
    }

    /// Returns the state of the controller.
    pub fn state(&self) -> ControllerState {
        self.telemetry().state
    }

    /// Sends bytes from the host at a port.
    pub fn write(&mut self, port: Port, bytes: &[u8]) {
        self.hosts[index(port)].sent.extend_from_slice(bytes);
        self.board.write(port, bytes);
    }

    /// Sends a frame and waits for its record, which must not be sent to another port.
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

    /// Sends a frame that must be accepted.
    #[track_caller]
    pub fn ask(&mut self, port: Port, frame: &[u8]) {
        let response = self.response(port, frame);
        let good = response.status == FrameStatus::NoError && response.data == DataStatus::NoError;
        assert!(good, "refused: {response}");
    }

    /// Returns the newest status at a port.
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

    /// Starts a trajectory from the current position to another position and back, which takes `seconds` in each
    /// direction. Runs the board for `ms`.
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

    /// Begins a fault.
    pub fn inject(&mut self, kind: FaultKind) {
        self.board.inject(kind);
    }

    /// Reads a register, as a debugger does.
    pub fn register(&mut self, address: u32) -> u32 {
        self.board.machine.word(address).unwrap_or_else(|| panic!("no register at {address:#010x}"))
    }
}
