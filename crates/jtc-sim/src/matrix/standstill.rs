//! How far and how fast the arm goes after a fault in motion until it stands, with holding brakes and without.
use jtc_core::{JOINTS, State};
use jtc_wire::ExecCommand;

use super::{MatrixError, ROWS, world_in};
use crate::config::Support;
use crate::faults::{Fault, Trigger};
use crate::host;
use crate::operator::Operator;

/// Speed below which a joint stands, rad/s.
const STANDS: f64 = 2e-3;
/// For as long, ms.
const STANDS_MS: u64 = 50;
/// The motion of the test has this long to go, ms; a fault that stops nothing leaves it running for longer than `WATCH_MS`.
const WATCH_MS: u64 = 700;
/// Longest time watched, ms.
const LONGEST_MS: u64 = 10_000;

/// What becomes of the motion.
enum Motion {
    GoesOn,
    Stands { ms: u64, distance: f64, speed: f64 },
    Moves,
}

impl core::fmt::Display for Motion {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::GoesOn => f.write_str("the motion goes on"),
            Self::Stands { ms, distance, speed } => write!(f, "{ms} ms, {distance:.3} rad, {speed:.2} rad/s"),
            Self::Moves => write!(f, "still moves after {} s", LONGEST_MS / 1000),
        }
    }
}

/// The table, as Markdown: each fault of the matrix, and the commands Pause and Stop, in Operate.
pub fn standstill_table() -> Result<String, MatrixError> {
    let mut out = String::from(
        "Each fault, and each command that stops, in the middle of a motion: milliseconds until every joint stands, the longest\n\
         way of a joint until then and the peak speed. Without brakes an arm without torque falls until it lies on its end stops.\n\n\
         | in Operate | with holding brakes | without brakes |\n|---|---|---|\n",
    );
    for (name, command) in [("Pause", ExecCommand::Pause), ("Stop", ExecCommand::Stop)] {
        let act = |operator: &mut Operator| operator.world.host_write(&host::exec(command));
        out += &line(name, act)?;
    }
    for row in &ROWS {
        let act = |operator: &mut Operator| {
            let trigger = Trigger::At(operator.world.now_us() / 1000);
            operator.world.inject(Fault { kind: row.kind, trigger, duration_ms: Some(row.ms) });
        };
        out += &line(row.name, act)?;
    }
    Ok(out)
}

fn line(name: &str, act: impl Fn(&mut Operator)) -> Result<String, MatrixError> {
    let brakes = motion(Support::Brakes, &act)?;
    let stand = motion(Support::Stand, &act)?;
    Ok(format!("| {name} | {brakes} | {stand} |\n"))
}

fn motion(support: Support, act: impl Fn(&mut Operator)) -> Result<Motion, MatrixError> {
    let mut operator = world_in(State::Operate, support)?;
    let from = operator.world.truth().q;
    act(&mut operator);
    let (mut still, mut distance, mut speed) = (0, 0.0f64, 0.0f64);
    for ms in 1..=LONGEST_MS {
        operator.step();
        let truth = operator.world.truth();
        for j in 0..JOINTS {
            distance = distance.max((truth.q[j] - from[j]).abs());
            speed = speed.max(truth.qd[j].abs());
        }
        still = if truth.qd.iter().all(|v| v.abs() < STANDS) { still + 1 } else { 0 };
        if still == STANDS_MS {
            return Ok(Motion::Stands { ms: ms + 1 - STANDS_MS, distance, speed });
        }
        let telemetry = operator.world.telemetry();
        let runs = telemetry.state == State::Operate && telemetry.tes == jtc_core::Tes::Execute;
        if ms == WATCH_MS && runs {
            return Ok(Motion::GoesOn);
        }
    }
    Ok(Motion::Moves)
}
