//! The measured session, which reaches every state of the controller with continuous traffic on both serial lines.
use std::collections::BTreeMap;
use std::error::Error;

use jtc_core::{ControllerState, TrajectoryState};
use jtc_sim::{FaultKind, host as frames};
use jtc_wire::{Code, ExecCommand, FrameType, Joint, RawPoint, fixed, trajectory};
use openjtc_emulator::clock::MILLISECOND;
use openjtc_emulator::{FIRST_LINE, Machine, Port, RegisterARM};

use crate::rig::Rig;

/// Port of the host that sends commands.
const HOST: Port = Port::Usart2;
/// Exception number of the tick.
const TIM7: usize = FIRST_LINE + 55;
/// Port of the host that only generates traffic.
const OTHER: Port = Port::Usart3;

/// Instruction counts of a group of control steps.
#[derive(Clone, Copy, Default)]
pub struct Steps {
    pub count: u64,
    pub min: u64,
    pub max: u64,
    sum: u64,
}

impl Steps {
    fn add(&mut self, instructions: u64) {
        self.min = if self.count == 0 { instructions } else { self.min.min(instructions) };
        self.max = self.max.max(instructions);
        self.sum += instructions;
        self.count += 1;
    }

    /// Returns the mean number of instructions per step.
    pub fn mean(&self) -> u64 {
        self.sum / self.count.max(1)
    }
}

/// Time longer than the acceleration or braking at any start, pause or stop of a trajectory, ms.
const RAMP: u32 = 250;

/// A test rig that counts the instructions of control steps.
pub struct Session {
    pub rig: Rig,
    counter: openjtc_emulator::Counter,
    recorder: openjtc_emulator::Counter,
    calls: u64,
    /// Instruction counts of the flight recorder after each control step.
    recorded: Steps,
    steps: BTreeMap<(u8, bool), Steps>,
    serving: BTreeMap<(u8, u8), Steps>,
    /// Instruction counts of steps along the path at full speed in which the board sends no status and no host event
    /// occurs.
    on_path: Steps,
    /// Index of the trajectory point of the last step. The next field is the number of consecutive steps in which the
    /// path time advanced by exactly 1 ms.
    point: u32,
    steady: u32,
    traffic: Vec<Vec<u8>>,
    turn: usize,
}

impl Session {
    /// Creates a session before the first tick.
    pub fn new(mut rig: Rig) -> Result<Self, Box<dyn Error>> {
        let counter = rig.board.machine.count("control_step")?;
        let recorder = rig.board.machine.count("record_step")?;
        let mut long = vec![0; 60_000];
        // The segment is not segment 0, because a valid segment 0 would replace the trajectory and stop the arm
        // (J-30).
        let n = trajectory(&mut long, (1, 1, 2), 10, std::iter::repeat_n(RawPoint::default(), 1_666))?;
        long.truncate(n);
        // Traffic that can arrive at any time: a segment that the controller rejects, valid frames, and invalid bytes
        // that contain many frame headers.
        let traffic = vec![
            long,
            fixed::CLEAR_OCCURRED_ERRORS.to_vec(),
            [0x9B, 0x04, 0xEA, 0x56].repeat(250),
            fixed::PUMP_OFF.to_vec(),
        ];
        Ok(Self {
            rig,
            counter,
            recorder,
            calls: 0,
            recorded: Steps::default(),
            steps: BTreeMap::new(),
            serving: BTreeMap::new(),
            on_path: Steps::default(),
            point: 0,
            steady: 0,
            traffic,
            turn: 0,
        })
    }

    /// Runs the whole session.
    pub fn run(&mut self) {
        self.hold();
        self.run_ms(1_000);
        self.execute();
        self.run_ms(600);
        self.write(&frames::exec(ExecCommand::Pause));
        self.until("pause", 3_000, |rig| rig.telemetry().trajectory == TrajectoryState::Pause);
        self.write(&frames::exec(ExecCommand::Execute));
        self.until("the end", 6_000, |rig| rig.telemetry().trajectory == TrajectoryState::Finish);
        self.until("HoldPos after the last point", 10, |rig| rig.state() == ControllerState::HoldPos);
        self.write(&fixed::TEACHING_MODE_ENABLE);
        self.until("teaching", 2_000, |rig| rig.state() == ControllerState::Teaching);
        self.run_ms(1_000);
        self.lead_too_fast();
        self.write(&fixed::TEACHING_MODE_ENABLE);
        self.until("teaching again", 12_000, |rig| rig.state() == ControllerState::Teaching);
        self.run_ms(100);
        self.write(&fixed::TEACHING_MODE_DISABLE);
        self.until("no teaching", 2_000, |rig| rig.state() == ControllerState::HoldPos);
        self.rig.board.set_safety_input(Some(false));
        self.run_ms(500);
        self.rig.board.set_safety_input(Some(true));
        self.write(&frames::clear_all());
        self.until("the arm is held again", 20_000, |rig| rig.state() == ControllerState::HoldPos);
    }

    /// Pushes a joint with 100 N·m during Teaching. The joint moves too fast, so the controller ends Teaching and
    /// stops the arm by itself (J-25).
    fn lead_too_fast(&mut self) {
        let push = FaultKind::Push { joint: Joint::ALL[3], torque: 100.0 };
        self.rig.board.inject(push);
        self.until("the end of Teaching", 100, |rig| rig.state() == ControllerState::HoldPos);
        self.rig.board.heal(push);
        self.run_ms(1_000);
        self.write(&frames::clear_all());
        self.run_ms(200);
    }

    /// Runs the board from power-on until every joint is enabled and holds its position.
    pub fn hold(&mut self) {
        self.until("the first tick", 50, |rig| rig.ticks > 0);
        self.run_ms(300);
        self.write(&frames::use_defaults());
        self.until("the arm is held", 20_000, |rig| {
            let nodes = rig.board.plant().node_states();
            rig.state() == ControllerState::HoldPos && nodes[..6] == [jtc_bus::NodeState::ENABLED; 6]
        });
    }

    /// Uploads a trajectory that moves every joint, and starts it.
    pub fn execute(&mut self) {
        let goal = [0.6, 0.5, -0.6, 0.5, -0.4, 0.8];
        for segment in frames::trajectory(&frames::there_and_back(&[0.0; 6], &goal, 1.5, 1, 5), 5, 113) {
            self.write(&segment);
        }
        self.until("the upload", 10_000, |rig| rig.telemetry().trajectory == TrajectoryState::Stop);
        self.write(&frames::exec(ExecCommand::Execute));
        self.until("the beginning", 3_000, |rig| rig.telemetry().point > 0);
    }

    fn write(&mut self, bytes: &[u8]) {
        self.rig.write(HOST, bytes);
    }

    fn step(&mut self) {
        if self.rig.board.pending(OTHER) < 500 {
            let next = self.traffic[self.turn].clone();
            self.turn = (self.turn + 1) % self.traffic.len();
            self.rig.write(OTHER, &next);
        }
        self.rig.step();
        let count = self.rig.board.machine.counted(self.counter);
        if count.calls > self.calls {
            assert_eq!(count.calls, self.calls + 1, "one control step a millisecond");
            self.calls = count.calls;
            self.recorded.add(self.rig.board.machine.counted(self.recorder).last);
            let (state, point) = (self.rig.flight.state, self.rig.flight.point);
            // If a tick handles several host events, the step is counted for the last event. A kind of 0 means that
            // no event occurred.
            let event = self.rig.flight.events.last().copied().unwrap_or_default();
            self.steady = if point == self.point + 1 { self.steady + 1 } else { 0 };
            self.point = point;
            if self.steady > RAMP && event.kind == 0 && !self.rig.flight.status {
                self.on_path.add(count.last);
            }
            match event.kind {
                0 => self.steps.entry((state, self.rig.flight.status)).or_default().add(count.last),
                kind => {
                    let frame_type = if kind == 1 { event.frame_type } else { 0 };
                    self.serving.entry((frame_type, state)).or_default().add(count.last);
                }
            }
        }
    }

    /// Runs the session for `ms` milliseconds.
    pub fn run_ms(&mut self, ms: u64) {
        (0..ms).for_each(|_| self.step());
    }

    fn until(&mut self, what: &str, ms: u64, done: impl Fn(&Rig) -> bool) {
        for _ in 0..ms {
            if done(&self.rig) {
                return;
            }
            self.step();
        }
        panic!("{what}: not within {ms} ms, {:?}", self.rig.state());
    }

    /// Returns the instruction counts of steps without a host event. Each entry contains the name of the controller
    /// state, and `true` if the board sent a status in these steps.
    pub fn steps(&self) -> impl Iterator<Item = (&'static str, bool, Steps)> {
        self.steps
            .iter()
            .map(|((state, status), steps)| (Code::<ControllerState>::new(*state).name(), *status, *steps))
    }

    /// Returns the instruction counts of steps along the path at full speed in which the board sends no status and no
    /// host event occurs.
    pub fn on_path(&self) -> Steps {
        self.on_path
    }

    /// Returns the instruction counts of the flight recorder after each control step.
    pub fn recorded(&self) -> Steps {
        self.recorded
    }

    /// Returns the instruction counts of steps that handle a host event. Each entry contains the name of the event
    /// and the name of the controller state.
    pub fn serving(&self) -> impl Iterator<Item = (String, &'static str, Steps)> {
        self.serving.iter().map(|((frame_type, state), steps)| {
            let name = FrameType::from_byte(*frame_type).map_or("no frame".to_owned(), |t| t.to_string());
            (name, Code::<ControllerState>::new(*state).name(), *steps)
        })
    }

    /// Runs the machine in single steps. Returns the largest number of consecutive instructions outside the tick
    /// during which interrupts were masked.
    pub fn longest_mask(&mut self, ms: u64) -> u64 {
        let (mut masked, mut longest) = (0, 0);
        for _ in 0..ms {
            let end = (self.rig.board.now_ms() + 1) * MILLISECOND;
            let machine = &mut self.rig.board.machine;
            let cycle = machine.chip().cycle();
            while machine.now() + 200 * cycle < end {
                let before = machine.instructions();
                machine.run_until(machine.now() + cycle);
                if machine.instructions() == before {
                    // The core has executed no instruction, so it sleeps. The loop then advances by 100 cycles at a
                    // time, and may detect the end of the sleep slightly late.
                    machine.run_until(machine.now() + 100 * cycle);
                }
                let tick = machine.chip().core.contexts.contains(&TIM7);
                let mask = machine.register(RegisterARM::PRIMASK) & 1 == 1 && !tick;
                masked = if mask { masked + 1 } else { 0 };
                longest = longest.max(masked);
            }
            self.step();
        }
        longest
    }

    /// Returns the machine with its instruction counts.
    pub fn into_machine(self) -> Machine {
        self.rig.board.machine
    }
}
