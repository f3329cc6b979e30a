//! Fault matrix: a table for the docs that shows how the controller reacts to each fault in each state, and after how many ticks.
use core::fmt;

mod contact;
mod rows;
mod standstill;
mod stopping;

use jtc_core::{ControllerState, JOINTS, error, joint_error};
use jtc_wire::{ExecCommand, FrameType};

use crate::invariants::{Invariants, Violation};
use jtc_sim::{Operator, OperatorError, SimConfig, Support, host};

use rows::{LASTING_MS, ROWS, Row};

pub use contact::contact_table;
pub use standstill::standstill_table;
pub use stopping::stopping_table;

/// Time for which the matrix observes the controller after the fault begins, ms.
const WATCH_MS: u64 = 600;
/// Pose in which the controller holds the arm, rad.
const START: [f64; JOINTS] = [0.1, -0.4, 0.9, 0.2, -0.3, 0.5];

/// States in which the matrix injects faults. The state Start lasts only one tick.
const STATES: [ControllerState; 5] = [
    ControllerState::Init,
    ControllerState::HoldPos,
    ControllerState::Operate,
    ControllerState::Teaching,
    ControllerState::Error,
];

/// Reaction to a fault in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The controller did not react within the observed time.
    None,
    /// The controller entered another state, or reported more errors in the same state.
    Change {
        /// State after the reaction.
        state: ControllerState,
        /// Error word after the reaction.
        errors: u16,
        /// Internal errors of all joints after the reaction.
        joints: u16,
        /// `true` if the state of the controller is unchanged. `errors` and `joints` then contain only the added errors.
        same: bool,
        /// Number of the tick with the reaction, counted from the fault. The controller can detect the fault in tick 1 at the
        /// earliest.
        tick: u64,
    },
    /// The watchdog reset the controller.
    Reset {
        /// Number of missed ticks before the reset.
        tick: u64,
    },
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::None => f.write_str("no reaction"),
            Self::Reset { tick } => write!(f, "reset, {tick}"),
            Self::Change { state, errors, joints, same, tick } => {
                write!(f, "{state:?}, {tick}")?;
                let words = words(errors, joints).join(", ");
                match (words.is_empty(), same) {
                    (true, _) if state == ControllerState::Error => f.write_str(" (clearing)"),
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
    let device =
        errors & error::INTERNAL != 0 && errors & (error::INTERNAL_CAN | error::INTERNAL_JOINTS) == 0;
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
    let internal: &[_] = if device { &["internal"] } else { &[] };
    [internal, &of(errors, &jtc), &of(joints, &joint)].concat()
}

/// Reason why the matrix could not be generated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MatrixError {
    /// The simulation did not reach the state.
    Operator(OperatorError),
    /// An invariant was violated.
    Invariant(Violation),
    /// The arm did not come to rest within the time of a Pause or Stop.
    NoStop {
        /// Time until the arm was at rest, ms; `None` if the stop ended in an error or the motion did not begin.
        ms: Option<u64>,
    },
    /// The controller released the arm after a fault that permits it to hold the arm.
    Released {
        /// State of the controller before the fault.
        state: ControllerState,
    },
    /// The controller did not react as expected.
    NoReaction {
        /// Row of the table.
        row: &'static str,
        /// State of the controller before the fault.
        state: ControllerState,
    },
}

impl fmt::Display for MatrixError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Operator(error) => error.fmt(f),
            Self::Invariant(violation) => violation.fmt(f),
            Self::NoStop { ms: Some(ms) } => write!(f, "the arm stands after {ms} ms only"),
            Self::NoStop { ms: None } => f.write_str("the arm was not stopped"),
            Self::Released { state } => write!(f, "the arm was released in {state:?}"),
            Self::NoReaction { row, state } => {
                write!(f, "{row} in {state:?}: no reaction, and no reason why")
            }
        }
    }
}

impl std::error::Error for MatrixError {}

impl From<OperatorError> for MatrixError {
    fn from(error: OperatorError) -> Self {
        Self::Operator(error)
    }
}

/// Cell of the matrix. The cell contains the reaction to the fault, and the way in which the arm returns to position
/// hold after ClearCurrentErrors. If the controller has lost the parameters, the host sends them again.
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

/// Returns the fault matrix as a Markdown table.
pub fn fault_matrix() -> Result<String, MatrixError> {
    let mut out = format!(
        "A cell shows the next state of the controller, the number of the tick in which it changes, and the reason. Tick 1 is the first\n\
         tick that begins after the fault. In the tick of a change to Error the torque is already zero. A fault without a time in its name\n\
         lasts {LASTING_MS} ms. *clearing* means that no error is left, and that the controller still clears the nodes. If nothing happens\n\
         within {WATCH_MS} ms, the cell shows the reason:\n\n\
         - *bridged*: the controller tolerates up to four missing or impossible answers in a row, and predicts the motion\n  \
           (J-63). The fifth is an error.\n\
         - *controlled*: the control law compensates for the fault, and no limit is reached.\n\
         - *latched*: the controller is already in Error because of the same fault, until the host clears it (J-21).\n\
         - *no torque*: the controller checks for this fault only while there is torque.\n\
         - *not asked*: the drive is already in the commanded state.\n\
         - *shown*: the status shows the fault of the gripper. The controller starts the gripper again and does not stop the arm (J-23).\n\
         - *repeated*: the bus hardware repeats the frame within the tick.\n\
         - *refused*: the controller answers damaged frames with an error record, and changes nothing (J-06).\n\
         - *bounded*: a tick does a bounded amount of work for the host (J-07).\n\
         - *no supervision*: a silent host is not an error. The controller reacts to it only if `host_timeout_ms` is set (J-59).\n\
         - *at rest*: host supervision pauses motions and ends Teaching. In this state neither is in progress.\n\
         - *late ticks*: the controller tolerates fewer than ten late or missing ticks within a second (J-12).\n\n\
         The last column shows what the host must send after the cause has ended, so that the arm is held again: nothing,\n\
         ClearCurrentErrors, or all parameters. The state Start lasts a single tick.\n\n| fault |"
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
            let quiet = || row.quiet(state).ok_or(MatrixError::NoReaction { row: row.name, state });
            let text = if cell.reaction == Reaction::None { quiet()? } else { cell.reaction.to_string() };
            out += &format!(" {text} |");
            back = if worse(cell.back) > worse(back) { cell.back } else { back };
        }
        let words = match back {
            Back::ByItself => "nothing",
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

/// Returns a frame that has no effect.
fn harmless() -> Vec<u8> {
    host::frame(FrameType::GripperControl, &[0; 4])
}

/// Returns a simulation whose controller is in `state`. `host_timeout_ms` is the timeout of the host supervision
/// (J-59); 0 disables the supervision.
fn world_in(
    state: ControllerState,
    support: Support,
    host_timeout_ms: u16,
) -> Result<Operator, OperatorError> {
    bring_to(config_for(support, host_timeout_ms), state)
}

/// Returns the configuration of this simulation.
fn config_for(support: Support, host_timeout_ms: u16) -> SimConfig {
    let mut config = SimConfig { start: START, baud: None, support, ..SimConfig::default() };
    config.controller.host_timeout_ms = host_timeout_ms;
    for drive in &mut config.drives {
        // With its normal duration, the motor alignment would add seconds in which nothing happens.
        drive.first_enable_ms = 60;
    }
    config
}

/// Starts a simulation and brings its controller to `state`.
fn bring_to(config: SimConfig, state: ControllerState) -> Result<Operator, OperatorError> {
    let host_timeout_ms = config.controller.host_timeout_ms;
    let mut operator = Operator::new(config);
    if state == ControllerState::Init {
        operator.run(400);
        return Ok(operator);
    }
    operator.bring_up()?;
    operator.run(200);
    // If host supervision is enabled, the host must send frames until the fault begins.
    let run = |operator: &mut Operator, ms: u64| {
        for _ in 0..ms / 50 {
            operator.run(50);
            if host_timeout_ms > 0 {
                operator.world.host_write(&harmless());
            }
        }
    };
    match state {
        ControllerState::Operate => {
            let to = START.map(|q| q + 0.8);
            operator.upload(&host::there_and_back(&START, &to, 2.0, 1, 10), 10)?;
            operator.ask(&host::exec(ExecCommand::Execute))?;
            run(&mut operator, 800);
        }
        ControllerState::Teaching => {
            operator.teach()?;
            run(&mut operator, 200);
        }
        ControllerState::Error => {
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

fn cell(row: &Row, state: ControllerState) -> Result<Cell, MatrixError> {
    let mut operator = world_in(state, Support::Brakes, row.host_timeout_ms)?;
    let mut watch = Watch::new(&mut operator)?;
    let mut reaction = Reaction::None;
    for tick in 1..=WATCH_MS {
        if tick % 50 == 1 {
            // The harmless frame has no effect, but faults of the line can damage it.
            operator.world.host_write(&harmless());
        }
        row.act.before(&mut operator, tick);
        let seen = watch.step(&mut operator)?;
        if reaction == Reaction::None && seen.is_some() {
            reaction = seen.map_or(Reaction::None, |seen| seen.at(tick));
        }
    }
    Ok(Cell { reaction, back: recover(&mut operator, &mut watch, state)? })
}

/// Performs the steps of an operator who returns the arm to position hold.
fn recover(operator: &mut Operator, watch: &mut Watch, state: ControllerState) -> Result<Back, MatrixError> {
    // In Init and Error, the controller waits for the host even without the fault.
    let host_first = matches!(state, ControllerState::Init | ControllerState::Error);
    let held = |operator: &Operator| {
        matches!(
            operator.state(),
            ControllerState::HoldPos | ControllerState::Operate | ControllerState::Teaching
        ) && operator.world.node_states()[..JOINTS] == [jtc_bus::NodeState::ENABLED; JOINTS]
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

/// Observer of the controller, with its values in the last tick.
struct Watch {
    invariants: Invariants,
    state: ControllerState,
    errors: u16,
    resets: u32,
}

/// Change of the controller in one tick.
#[derive(Clone, Copy)]
struct Seen {
    state: ControllerState,
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

    /// Simulates one millisecond and returns the change in this millisecond. The end of a trajectory does not count as a reaction.
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
