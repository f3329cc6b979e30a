//! `jtc traj continue`: on from where a run was broken off.

use cli_kit::{Failure, Output};
use jtc_host::arm::Arm;
use jtc_host::recording::{BrokenOff, NothingLeft, Recording, Resumption};
use jtc_host::trajectory::{Loaded, Trajectory};
use jtc_wire::Status;

use super::job::{Job, stem, typed};
use super::named_arm;
use super::run::{Course, perform};
use crate::args::ContinueArgs;

/// Finds the place, and runs the rest from there.
pub fn continued(args: &ContinueArgs, out: &Output) -> Result<(), Failure> {
    let recording = Recording::read(&args.run).map_err(Failure::nothing_sent)?;
    if let Some(cut) = &recording.cut {
        out.note(format!("note: {}: {cut}", args.run.display()));
    }
    let arm = named_arm::load(args.arm.as_deref()).map_err(Failure::nothing_sent)?;
    let whole = whole(args, &recording, &arm)?;
    let broken = recording.broken_off(&whole).map_err(Failure::nothing_sent)?;
    let inputs = [Some(&args.run), args.trajectory.as_ref(), args.arm.as_ref()];
    let course = Course {
        execute: args.execute.clone(),
        name: format!("rest of {}", stem(&args.run)),
        words: format!("the rest of {}", args.run.display()),
        inputs: inputs.into_iter().flatten().cloned().collect(),
        arm_named: args.arm.is_some(),
        approach: true,
        speed_pct: 50.0,
        points_per_segment: None,
        repeat: 1,
    };
    let arm_words = named_arm::typed_option(args.arm.as_deref());
    let words = format!("traj continue {}{arm_words}", typed(&args.run));
    let mut make = |job: &mut Job, status: &Status| {
        let from_ms = place(job, &whole, broken, status, out).map_err(Failure::nothing_sent)?;
        let friction = job.arm.friction();
        let rest =
            job.planner(friction.as_ref()).rest(&whole, from_ms, None).map_err(Failure::nothing_sent)?;
        job.take(rest);
        Ok(())
    };
    perform(&course, |out| Ok(Job::made(arm, words, out)), Some(&mut make), out)
}

/// The trajectory that was run.
fn whole(args: &ContinueArgs, recording: &Recording, arm: &Arm) -> Result<Trajectory, Failure> {
    if let Some(file) = &args.trajectory {
        return Ok(Loaded::load(file, Some(&arm.joint_names)).map_err(Failure::nothing_sent)?.trajectory);
    }
    let held = recording.info.as_ref().and_then(|info| info.commanded.as_deref());
    held.cloned().ok_or_else(|| {
        let message = format!("{} does not hold the whole trajectory; nothing was sent", args.run.display());
        Failure::usage(message).hint(format!(
            "`jtc traj continue {} --trajectory FILE` names the trajectory that was run; recordings in MCAP hold it themselves",
            typed(&args.run)
        ))
    })
}

/// The path time to go on from, ms, with the reason on stderr.
fn place(
    job: &Job,
    whole: &Trajectory,
    broken: BrokenOff,
    status: &Status,
    out: &Output,
) -> Result<u32, NothingLeft> {
    let on = broken.resumption(whole, status, job.config.start_tolerance_rad)?;
    let seconds = |ms: u32| format!("{:.3} s", f64::from(ms) * 1e-3);
    let of_path = format!("{} of {:.3} s of its path", seconds(on.ms), whole.duration_s());
    out.note(match on {
        Resumption { shown: true, .. } => {
            format!("the controller went on by itself to {of_path}, and the arm stands there: it goes on from there")
        }
        Resumption { stands: true, .. } => {
            format!("the recording shows the run up to {of_path}, and the arm stands there: it goes on from there")
        }
        _ => format!(
            "the recording shows the run up to {of_path}, and the controller no later place of it (trajectory {}, at {}): an approach \
             leads there, and it goes on from there",
            status.trajectory,
            seconds(status.point)
        ),
    });
    Ok(on.ms)
}
