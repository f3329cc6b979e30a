//! `jtc traj continue`: on from where a run was broken off.

use cli_kit::{Failure, Output};
use jtc_host::arm::Arm;
use jtc_host::plan::where_it_stands;
use jtc_host::recording::{BrokenOff, NothingLeft, Recording};
use jtc_host::trajectory::{Loaded, Trajectory};
use jtc_wire::Status;

use super::job::{Job, typed};
use super::run::{Course, perform};
use crate::args::ContinueArgs;

/// Finds the place, and runs the rest from there.
pub fn continued(args: &ContinueArgs, out: &Output) -> Result<(), Failure> {
    let recording = Recording::read(&args.run).map_err(Failure::nothing_sent)?;
    if let Some(cut) = &recording.cut {
        out.note(format!("note: {}: {cut}", args.run.display()));
    }
    let arm = args.arm.as_deref().map(Arm::load).transpose().map_err(Failure::nothing_sent)?;
    let arm_named = arm.is_some();
    let arm = arm.unwrap_or_else(Arm::avena);
    let whole = whole(args, &recording, &arm)?;
    let broken = recording.broken_off(&whole).map_err(Failure::nothing_sent)?;
    let name = args.run.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let inputs = [Some(&args.run), args.trajectory.as_ref(), args.arm.as_ref()];
    let course = Course {
        link: args.link.clone(),
        name: format!("rest of {name}"),
        words: format!("the rest of {}", args.run.display()),
        inputs: inputs.into_iter().flatten().cloned().collect(),
        files: args.files.clone(),
        arm_named,
        accept_device_limits: args.accept.accept_device_limits,
        approach: true,
        speed_pct: 50.0,
        points_per_segment: None,
        repeat: 1,
    };
    let arm_words = args.arm.as_deref().map_or(String::new(), |path| format!(" --arm {}", typed(path)));
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

/// The path time to go on from, ms: where the arm stands on the path, or where the run was seen last.
fn place(
    job: &Job,
    whole: &Trajectory,
    broken: BrokenOff,
    status: &Status,
    out: &Output,
) -> Result<u32, NothingLeft> {
    let BrokenOff { last_ms, until_ms } = broken;
    let tolerance = job.config.start_tolerance_rad;
    let stands = where_it_stands(whole, (last_ms, until_ms), &status.positions(), tolerance);
    let from_ms = stands.map_or(last_ms, |stands| stands.ms);
    let seconds = |ms: u32| format!("{:.3} s", f64::from(ms) * 1e-3);
    let (from, end) = (seconds(from_ms), seconds((whole.duration_s() * 1e3).round() as u32));
    if f64::from(from_ms) * 1e-3 + 1e-3 >= whole.duration_s() {
        return Err(NothingLeft::Finished);
    }
    out.note(match stands {
        Some(_) => format!("the arm stands at {from} of {end} of its path: it goes on from there"),
        None => format!("the run was seen last at {from} of {end} of its path: an approach leads there"),
    });
    Ok(from_ms)
}
