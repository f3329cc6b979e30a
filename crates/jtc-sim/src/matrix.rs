//! The fault matrix: each fault in each state, what the controller makes of it and after how many ticks, as a
//! table for the docs.
use core::fmt;

mod standstill;

use jtc_core::{JOINTS, State, error, joint_error};
use jtc_wire::{ExecCommand, FrameType};

use crate::config::{SimConfig, Support};
use crate::faults::{Fault, FaultKind, Trigger};
use crate::host;
use crate::invariants::{Invariants, Violation};
use crate::operator::{Operator, OperatorError};

pub use standstill::standstill_table;

/// Ticks in which a reaction is looked for.
const WATCH_MS: u64 = 600;
/// Ticks after which a fault that lasts is taken away.
const LASTING_MS: u64 = 300;
/// Pose in which the arm is held, rad.
const START: [f64; JOINTS] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];

/// States in which faults are thrown. Start lasts a single tick.
const STATES: [State; 5] = [State::Init, State::HoldPos, State::Operate, State::Teaching, State::Error];

/// A row: what goes wrong, for how long (ms).
struct Row {
    name: &'static str,
    kind: FaultKind,
    ms: u64,
}

const fn row(name: &'static str, kind: FaultKind, ms: u64) -> Row {
    Row { name, kind, ms }
}

const ROWS: [Row; 28] = [
    row("safety input low", FaultKind::SafetyInput, LASTING_MS),
    row("safety input low for 1 ms", FaultKind::SafetyInput, 1),
    row("joint silent", FaultKind::NodeSilent { node: 1 }, LASTING_MS),
    row("joint silent for 4 ms", FaultKind::NodeSilent { node: 1 }, 4),
    row("joint reboots", FaultKind::NodeReboot { node: 1 }, 1),
    row("joint: motor-control fault", FaultKind::MotorFault { joint: 1, bits: 0x04 }, LASTING_MS),
    row("joint: gate driver fault", FaultKind::HardwareFault { joint: 1 }, LASTING_MS),
    row("joint in fault state, no error bit", FaultKind::FaultState { joint: 1 }, 1),
    row("joint: safety line", FaultKind::SafetyLine { node: 1 }, LASTING_MS),
    row("joint: encoder jumps by 0.3 rad", FaultKind::EncoderJump { joint: 1, rad: 0.3 }, LASTING_MS),
    row("joint: encoder jumps by 0.05 rad", FaultKind::EncoderJump { joint: 1, rad: 0.05 }, LASTING_MS),
    row("joint: position not accurate", FaultKind::NotAccurate { joint: 1 }, LASTING_MS),
    row("joint: friction times 3", FaultKind::Friction { joint: 1, factor: 3.0 }, LASTING_MS),
    row("joint: bearing at 60 °C", FaultKind::Temperature { joint: 1, celsius: 60.0 }, LASTING_MS),
    row("gripper silent", FaultKind::NodeSilent { node: 6 }, LASTING_MS),
    row("gripper reboots", FaultKind::NodeReboot { node: 6 }, 1),
    row("gripper: safety line", FaultKind::SafetyLine { node: 6 }, LASTING_MS),
    row("1 % of bus receptions lost", FaultKind::FramesLost { probability: 0.01 }, LASTING_MS),
    row("every bus reception lost for 4 ms", FaultKind::FramesLost { probability: 1.0 }, 4),
    row(
        "10 % of bus frames destroyed and repeated",
        FaultKind::FramesCorrupted { probability: 0.1 },
        LASTING_MS,
    ),
    row("bus cut at the controller", FaultKind::NoAcknowledge, LASTING_MS),
    row("controller bus-off", FaultKind::BusOff, LASTING_MS),
    row("controller bus-off for 1 ms", FaultKind::BusOff, 1),
    row("every byte from the host lost", FaultKind::SerialLost { probability: 1.0 }, LASTING_MS),
    row("5 % of bytes from the host flipped", FaultKind::SerialFlipped { probability: 0.05 }, LASTING_MS),
    row("bytes from the host delayed", FaultKind::SerialDelayed, LASTING_MS),
    row("tick late by 5 ms", FaultKind::TickOverrun, 5),
    row("tick stops", FaultKind::TickOverrun, LASTING_MS),
];

/// What became of a fault in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Nothing within the time watched.
    None,
    /// Another state, or more errors in the same.
    Change {
        /// State then.
        state: State,
        /// Error word then.
        errors: u16,
        /// Internal errors of all joints then.
        joints: u16,
        /// The state is the one from before: `errors` and `joints` are what was added.
        same: bool,
        /// In which tick, counted from the fault: 1 is the first that can know of it.
        tick: u64,
    },
    /// The watchdog reset the controller.
    Reset {
        /// After this many ticks that did not come.
        tick: u64,
    },
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::None => f.write_str("–"),
            Self::Reset { tick } => write!(f, "reset, {tick}"),
            Self::Change { state, errors, joints, same, tick } => {
                write!(f, "{state:?}, {tick}")?;
                let words = words(errors, joints).join(", ");
                match (words.is_empty(), same) {
                    (true, _) => Ok(()),
                    (false, false) => write!(f, " ({words})"),
                    (false, true) => write!(f, " (also {words})"),
                }
            }
        }
    }
}

fn words(errors: u16, joints: u16) -> Vec<&'static str> {
    let jtc = [
        (error::EMERGENCY_INPUT, "safety input"),
        (error::INTERNAL_CAN, "CAN"),
        (error::EXTERNAL_JOINTS, "node"),
    ];
    let joint = [
        (joint_error::POSITION, "position"),
        (joint_error::VELOCITY, "velocity"),
        (joint_error::ACCELERATION, "acceleration"),
        (joint_error::TORQUE, "torque"),
        (joint_error::POSITION_ERROR, "position error"),
        (joint_error::FRICTION_TABLE, "friction table"),
    ];
    let of = |word: u16, names: &[(u16, &'static str)]| -> Vec<_> {
        names.iter().filter(|(bit, _)| word & bit != 0).map(|(_, name)| *name).collect()
    };
    [of(errors, &jtc), of(joints, &joint)].concat()
}

/// Why there is no matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MatrixError {
    /// The state was not reached.
    Operator(OperatorError),
    /// An invariant was broken.
    Invariant(Violation),
}

impl fmt::Display for MatrixError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Operator(error) => error.fmt(f),
            Self::Invariant(violation) => violation.fmt(f),
        }
    }
}

impl std::error::Error for MatrixError {}

impl From<OperatorError> for MatrixError {
    fn from(error: OperatorError) -> Self {
        Self::Operator(error)
    }
}

/// One cell: what happened, and whether the arm was held again after ClearCurrentErrors and, where they were
/// lost, new parameters.
struct Cell {
    reaction: Reaction,
    back: Back,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Back {
    ByItself,
    Clear,
    Parameters,
    Never,
}

/// The table, as Markdown.
pub fn fault_matrix() -> Result<String, MatrixError> {
    let mut out = format!(
        "A cell says which state the controller goes to, in which tick, and why; tick 1 is the first that begins\n\
         after the fault. In that tick the torque is zero already. “–”: no reaction within {WATCH_MS} ms. Faults\n\
         without a time last {LASTING_MS} ms. The last column says what the host has to send, once the cause is\n\
         gone, until the arm is held again: nothing (–), ClearCurrentErrors, or all parameters. Start lasts a\n\
         single tick.\n\n| fault |"
    );
    for state in STATES {
        out += &format!(" {state:?} |");
    }
    out += " back to HoldPos |\n|---|---|---|---|---|---|---|\n";
    for row in &ROWS {
        out += &format!("| {} |", row.name);
        let mut back = Back::ByItself;
        for state in STATES {
            let cell = cell(row, state)?;
            out += &format!(" {} |", cell.reaction);
            back = if worse(cell.back) > worse(back) { cell.back } else { back };
        }
        let words = match back {
            Back::ByItself => "–",
            Back::Clear => "clear",
            Back::Parameters => "parameters again",
            Back::Never => "never",
        };
        out += &format!(" {words} |\n");
    }
    Ok(out)
}

fn worse(back: Back) -> u8 {
    match back {
        Back::ByItself => 0,
        Back::Clear => 1,
        Back::Parameters => 2,
        Back::Never => 3,
    }
}

/// A world in which the controller is in `state`.
fn world_in(state: State, support: Support) -> Result<Operator, OperatorError> {
    let mut config = SimConfig { start: START, baud: None, support, ..SimConfig::default() };
    for drive in &mut config.drives {
        // Alignment takes seconds in which nothing else happens.
        drive.first_enable_ms = 60;
    }
    let mut operator = Operator::new(config);
    if state == State::Init {
        operator.run(400);
        return Ok(operator);
    }
    operator.bring_up()?;
    operator.run(200);
    match state {
        State::Operate => {
            let to = START.map(|q| q + 0.8);
            operator.upload(&host::there_and_back(&START, &to, 2.0, 1, 10), 10)?;
            operator.ask(&host::exec(ExecCommand::Execute))?;
            operator.run(800);
        }
        State::Teaching => {
            operator.teach()?;
            operator.run(200);
        }
        State::Error => {
            operator.world.set_safety_input(false);
            operator.run(20);
            operator.world.set_safety_input(true);
            operator.run(200);
        }
        _ => {}
    }
    operator.wait("the state to start from", 10, |world| world.telemetry().state == state)?;
    Ok(operator)
}

fn cell(row: &Row, state: State) -> Result<Cell, MatrixError> {
    let mut operator = world_in(state, Support::Brakes)?;
    let mut watch = Watch::new(&mut operator)?;
    let fault = Fault {
        kind: row.kind,
        trigger: Trigger::At(operator.world.now_us() / 1000),
        duration_ms: Some(row.ms),
    };
    operator.world.inject(fault);
    let mut reaction = Reaction::None;
    for tick in 1..=WATCH_MS {
        if tick % 50 == 1 {
            // Something for faults of the line to meet; it changes nothing.
            operator.world.host_write(&host::frame(FrameType::GripperControl, &[0; 4]));
        }
        let seen = watch.step(&mut operator)?;
        if reaction == Reaction::None && seen.is_some() {
            reaction = seen.map_or(Reaction::None, |seen| seen.at(tick));
        }
    }
    Ok(Cell { reaction, back: recover(&mut operator, &mut watch, state)? })
}

/// Do what an operator would to get the arm held.
fn recover(operator: &mut Operator, watch: &mut Watch, state: State) -> Result<Back, MatrixError> {
    // Init and Error wait for the host anyway.
    let host_first = matches!(state, State::Init | State::Error);
    let held = |operator: &Operator| {
        matches!(operator.state(), State::HoldPos | State::Operate | State::Teaching)
            && operator.world.node_states()[..JOINTS] == [jtc_bus::fsm::ENABLED; JOINTS]
    };
    for (back, send) in [
        (Back::ByItself, Vec::new()),
        (Back::Clear, host::clear_all()),
        (Back::Clear, host::clear_all()),
        (Back::Parameters, host::use_defaults()),
        (Back::Parameters, host::clear_all()),
    ] {
        operator.world.host_write(&send);
        for _ in 0..1500 {
            watch.step(operator)?;
            if held(operator) {
                return Ok(if host_first { Back::ByItself } else { back });
            }
        }
    }
    Ok(Back::Never)
}

/// What is compared from tick to tick.
struct Watch {
    invariants: Invariants,
    state: State,
    errors: u16,
    resets: u32,
}

/// Something changed.
#[derive(Clone, Copy)]
struct Seen {
    state: State,
    errors: u16,
    joints: u16,
    same: bool,
    reset: bool,
}

impl Seen {
    fn at(self, tick: u64) -> Reaction {
        let Self { state, errors, joints, same, reset } = self;
        if reset { Reaction::Reset { tick } } else { Reaction::Change { state, errors, joints, same, tick } }
    }
}

impl Watch {
    fn new(operator: &mut Operator) -> Result<Self, MatrixError> {
        let mut invariants = Invariants::joining(&operator.world);
        operator.step();
        invariants.check(&operator.world).map_err(MatrixError::Invariant)?;
        let telemetry = operator.world.telemetry();
        Ok(Self { invariants, state: telemetry.state, errors: telemetry.errors, resets: 0 })
    }

    /// One millisecond; what changed in it. The end of a trajectory is no reaction.
    fn step(&mut self, operator: &mut Operator) -> Result<Option<Seen>, MatrixError> {
        operator.step();
        self.invariants.check(&operator.world).map_err(MatrixError::Invariant)?;
        let resets = operator.world.statistics().watchdog_resets;
        let telemetry = operator.world.telemetry();
        let changed = (telemetry.state, telemetry.errors) != (self.state, self.errors);
        let same = telemetry.state == self.state;
        let known = if same { self.errors } else { 0 };
        let reset = resets != self.resets;
        self.resets = resets;
        (self.state, self.errors) = (telemetry.state, telemetry.errors);
        let joints = telemetry.joints.iter().fold(0, |word, joint| word | joint.internal);
        let seen = Seen { state: telemetry.state, errors: telemetry.errors & !known, joints, same, reset };
        Ok((changed || reset).then_some(seen))
    }
}
