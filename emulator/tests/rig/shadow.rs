//! The shadow controller, which is the controller code of the board running on the PC.
use jtc_core::recorder::{BLOCK_WORDS, Block, Recorder};
use jtc_core::{Config, Controller, HostEvent, Identity, Inputs, POINTS_MAX, Telemetry};
use jtc_sim::{RECORDER_BLOCKS, Worked};
use jtc_wire::{
    BootCause, FrameRef, FrameStatus, LinkEvent, Program, RawPoint, Response, Status, StoreState,
};

use super::elf::Version;
use super::flight::{Event, Flight};
use super::host::Host;

/// Start causes after which the controller reports a failure (J-12): watchdog, hard fault and panic.
const FAILED: [u32; 3] = [4, 5, 6];

/// Memory of the flight recorder, divided into the same parts as on the board.
pub type LogMemory = [Vec<Block>; 3];

/// Creates the memory of the flight recorder in its state after a loss of power.
pub fn no_log() -> LogMemory {
    RECORDER_BLOCKS.map(|blocks| vec![[0; BLOCK_WORDS]; blocks])
}

/// Controller that runs on the PC in parallel with the board.
pub struct Shadow {
    controller: Controller<Vec<RawPoint>>,
    recorder: Recorder<Vec<Block>, 3>,
    /// Frames that the last tick has executed.
    pub worked: Vec<Worked>,
    program: Program,
}

/// Data about a start of the board.
pub struct Start {
    /// Cause of the start, as the code in the flight record.
    pub cause: u32,
    /// Number of this program start, counted since power-on.
    pub boots: u32,
    /// Version record of the firmware.
    pub version: Version,
    /// Length and CRC of the program in flash (J-67).
    pub program: Program,
    /// Arm that the board found in its flash, and its sequence number.
    pub arm: Option<(Vec<u8>, u32)>,
    /// Contents of the flight recorder before the start.
    pub log: LogMemory,
}

impl Shadow {
    /// Creates the shadow controller for a board that has just started.
    pub fn new(start: Start) -> Self {
        let Start { cause, boots, version, program, arm, log } = start;
        let points = vec![RawPoint::default(); POINTS_MAX];
        let mut controller = Controller::new(Config::default(), points);
        controller.set_identity(Identity {
            board: version.board.leak(),
            firmware: version.version.leak(),
            revision: version.build.leak(),
            boots,
            boot_cause: BootCause::from_byte(cause as u8).unwrap_or_default(),
            program: None,
        });
        match &arm {
            None => controller.set_store_state(StoreState::Empty, 0),
            Some((image, sequence)) => {
                let taken = controller.load_arm(image);
                let state = if taken { StoreState::Stored } else { StoreState::Failed };
                controller.set_store_state(state, *sequence);
            }
        }
        if FAILED.contains(&cause) {
            controller.raise_internal();
        }
        let recorder = Recorder::new(log, FAILED.contains(&cause));
        Self { controller, recorder, program, worked: Vec::new() }
    }

    /// Records that the board has finished reading its program in flash.
    pub fn flash_is_read(&mut self) {
        self.controller.set_program(Some(self.program));
    }

    /// Sets the result of the last StoreArm to the value in the board's mailbox after the tick.
    pub fn stored(&mut self, state: StoreState, sequence: u32) {
        self.controller.set_store_state(state, sequence);
    }

    /// Returns the flight recorder.
    pub fn recorder(&self) -> &Recorder<Vec<Block>, 3> {
        &self.recorder
    }

    /// Returns the memory of the flight recorder for the next start.
    pub fn into_log(self) -> LogMemory {
        self.recorder.into_memory()
    }

    /// Returns the controller that runs on the PC.
    pub fn controller(&self) -> &Controller<Vec<RawPoint>> {
        &self.controller
    }

    /// Returns the telemetry of the last tick of the shadow controller.
    pub fn telemetry(&self) -> Telemetry {
        self.controller.telemetry()
    }

    /// Returns the settings of the shadow controller.
    pub fn config(&self) -> &Config {
        self.controller.config()
    }

    /// Runs the tick that the board recorded. All outputs must be bit-identical to the outputs of the board.
    pub fn tick(&mut self, flight: &Flight, hosts: &mut [Host; 2]) {
        let bytes: Vec<Vec<u8>> = flight
            .events
            .iter()
            .map(|event| match event.kind {
                1 => hosts[usize::from(event.line)].frame(event),
                _ => Vec::new(),
            })
            .collect();
        let host: Vec<HostEvent<'_>> =
            flight.events.iter().zip(&bytes).map(|(event, bytes)| host_event(event, bytes)).collect();
        let inputs = Inputs {
            bus: &flight.received,
            bus_state: flight.bus(),
            safety_input: flight.safety_input,
            missed_ticks: flight.missed_ticks,
            urgent: flight.urgent,
            host: &host,
            status_free: flight.status_free,
        };
        let outputs = self.controller.tick(&inputs);
        self.recorder.record(&mut self.controller, &inputs, &outputs);
        self.worked.clear();
        for (event, received) in flight.events.iter().zip(&host).take(outputs.host_done) {
            self.worked.push(Worked::from(&received.event));
            if event.kind == 1 {
                hosts[received.line].done(event);
            }
        }
        if outputs.status {
            let status = *self.controller.status_frame();
            expect_status(&status, outputs.record_line, hosts);
        }

        if let Some(line) = outputs.answer_line {
            hosts[line].expected.extend(self.controller.answer_frame());
        }

        let t = self.controller.telemetry();
        let tick = flight.tick;
        let torque = t.joints.map(|joint| joint.torque.to_bits());
        assert_eq!(torque, flight.torque.map(f64::to_bits), "tick {tick}: bits of the torques");
        assert_eq!(outputs.bus, flight.sent, "tick {tick}: frame on the joint bus");
        let ours = (t.state as u8, t.trajectory as u8, t.point, t.errors, outputs.safety_output);
        let board = (flight.state, flight.trajectory, flight.point, flight.errors, flight.safety_output);
        assert_eq!(ours, board, "tick {tick}: state, execution, point, errors, safety output");
        let done = (outputs.host_done, outputs.status, outputs.record_line);
        assert_eq!(done, (flight.host_done, flight.status, flight.record_line), "tick {tick}: host");
    }
}

fn host_event<'a>(event: &Event, bytes: &'a [u8]) -> HostEvent<'a> {
    let response = || {
        let status = FrameStatus::from_byte(event.status).expect("a status code");
        Response::bad(event.frame_type, status, event.len)
    };
    let what = match event.kind {
        1 => LinkEvent::Frame(FrameRef::new_checked(bytes).expect("a good frame")),
        2 => LinkEvent::Bad(response()),
        _ => LinkEvent::Noise(response()),
    };
    HostEvent { line: event.line.into(), overtaken: event.overtaken, plain: event.plain, event: what }
}

/// Adds the expected status (J-04). The status on the line of the answered frame contains the response record. The
/// status on the other line does not contain the record.
fn expect_status(bytes: &[u8], line: Option<usize>, hosts: &mut [Host; 2]) {
    let status = Status::parse(bytes).expect("the controller makes good statuses");
    assert_eq!(status.response().is_some(), line.is_some());
    let without = Status { response: Response::default(), ..status }.emit();
    for (n, host) in hosts.iter_mut().enumerate() {
        let bytes = if line == Some(n) { bytes } else { &without };
        host.expected.extend(bytes);
    }
}
