//! Distance and speed of the arm from a fault in motion until standstill, with and without holding brakes.
use jtc_core::{ControllerState, JOINTS, TrajectoryState};

use super::rows::{Act, ROWS, STOPS};
use super::{MatrixError, words, world_in};
use jtc_sim::Support;

/// Speed below which a joint counts as being at rest, rad/s.
const STANDS: f64 = 2e-3;
/// Time below this speed after which a joint counts as being at rest, ms.
const STANDS_MS: u64 = 50;
/// Time after the fault at which the motion is checked, ms. Without a fault, the motion takes longer. If the arm
/// still executes the motion at this time, the fault did not stop it.
const WATCH_MS: u64 = 700;
/// Longest time of the observation, ms.
const LONGEST_MS: u64 = 10_000;

/// Motion of the arm after the fault.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Motion {
    GoesOn,
    Stands { ms: u64, distance: f64, speed: f64 },
    Moves,
}

impl core::fmt::Display for Motion {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::GoesOn => f.write_str("the motion continues"),
            Self::Stands { ms, distance, speed } => write!(f, "{ms} ms, {distance:.3} rad, {speed:.2} rad/s"),
            Self::Moves => write!(f, "still moves after {} s", LONGEST_MS / 1000),
        }
    }
}

/// Returns a Markdown table with the motion after each fault of the matrix in Operate.
pub fn standstill_table() -> Result<String, MatrixError> {
    let mut out = String::from(
        "Each fault happens in the middle of a motion. A row shows the state of the controller when every joint is at rest, the\n\
         milliseconds until then, the longest distance that a joint moves, and the peak speed. An arm without brakes and without torque\n\
         falls until it lies on its end stops. A falling joint causes an over-speed error of its drive, which is an error of a node. A drive\n\
         that ignores its state command keeps its brake open.\n\n\
         | in Operate | state then | with holding brakes | without brakes |\n|---|---|---|---|\n",
    );
    for row in &ROWS {
        out += &line(row.name, row.act, row.host_timeout_ms)?;
    }
    Ok(out)
}

/// Returns the table rows of the stop commands.
pub(super) fn stop_lines() -> Result<String, MatrixError> {
    let mut out = String::new();
    for (name, act) in STOPS {
        for support in [Support::Brakes, Support::Stand] {
            stood_in_time(&motion(support, act, 0)?.1)?;
        }
        out += &line(name, act, 0)?;
    }
    Ok(out)
}

/// Checks that the arm comes to rest in the time of J-33. The arm has an additional 20 ms after the end of the
/// commanded motion.
pub(super) fn stood_in_time(motion: &Motion) -> Result<(), MatrixError> {
    match *motion {
        Motion::Stands { ms, .. } if ms <= 520 => Ok(()),
        Motion::Stands { ms, .. } => Err(MatrixError::NoStop { ms: Some(ms) }),
        Motion::GoesOn | Motion::Moves => Err(MatrixError::NoStop { ms: None }),
    }
}

fn line(name: &str, act: Act, host_timeout_ms: u16) -> Result<String, MatrixError> {
    let (then, brakes) = motion(Support::Brakes, act, host_timeout_ms)?;
    let (also, stand) = motion(Support::Stand, act, host_timeout_ms)?;
    let then = if then == also { then } else { format!("{then}; without brakes {also}") };
    Ok(format!("| {name} | {then} | {brakes} | {stand} |\n"))
}

/// Returns the state and the motion of the arm after `act`.
fn motion(support: Support, act: Act, host_timeout_ms: u16) -> Result<(String, Motion), MatrixError> {
    let mut operator = world_in(ControllerState::Operate, support, host_timeout_ms)?;
    let from = operator.world.truth().q;
    let (mut still, mut distance, mut speed) = (0, 0.0f64, 0.0f64);
    let mut motion = Motion::Moves;
    for ms in 1..=LONGEST_MS {
        act.before(&mut operator, ms);
        operator.step();
        let truth = operator.world.truth();
        for j in 0..JOINTS {
            distance = distance.max((truth.q[j] - from[j]).abs());
            speed = speed.max(truth.qd[j].abs());
        }
        still = if truth.qd.iter().all(|v| v.abs() < STANDS) { still + 1 } else { 0 };
        if still == STANDS_MS {
            motion = Motion::Stands { ms: ms + 1 - STANDS_MS, distance, speed };
            break;
        }
        let telemetry = operator.world.telemetry();
        let runs =
            telemetry.state == ControllerState::Operate && telemetry.trajectory == TrajectoryState::Execute;
        if ms == WATCH_MS && runs {
            motion = Motion::GoesOn;
            break;
        }
    }
    let t = operator.world.telemetry();
    let joints = t.joints.iter().fold(0, |word, joint| word | joint.internal);
    Ok((state_then(t.state, t.trajectory, t.errors, joints), motion))
}

/// Returns the controller state, the execution state if the controller has a path, and the errors.
pub(super) fn state_then(
    state: ControllerState,
    trajectory: TrajectoryState,
    errors: u16,
    joints: u16,
) -> String {
    let words = words(errors, joints).join(", ");
    match (state, trajectory) {
        _ if !words.is_empty() => format!("{state:?} ({words})"),
        (ControllerState::HoldPos, TrajectoryState::Pause | TrajectoryState::Stop) => {
            format!("{state:?}, {trajectory:?}")
        }
        _ => format!("{state:?}"),
    }
}
