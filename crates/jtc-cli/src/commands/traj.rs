//! `jtc traj check`, `info`, `speed`: commands for trajectories in files, and for the trajectory that the controller
//! executes.

use std::path::Path;

use cli_kit::{ErrorKind, Failure, Output, figure, table};
use host_kit::FrontEnd;
use jtc_core::{Config, Payload};
use jtc_host::check::Verdict;
use jtc_host::session::UploadOptions;
use jtc_host::trajectory::{Form, Loaded};
use jtc_wire::Joint;
use serde_json::json;

use super::job::{Job, typed};
use super::plan::{margin_line, note_low_margin};
use super::{continued, halt, resume, run};
use crate::args::{CheckArgs, LinkArgs, RunArgs, TrajCommand};

/// Runs a `jtc traj` command.
pub(super) fn traj(command: &TrajCommand, out: &Output) -> Result<(), Failure> {
    match command {
        TrajCommand::Check { file, check: args, payload } => {
            check(file, args, payload.unwrap_or_default(), out)
        }
        TrajCommand::Info { file, deg, joints_by_number } => {
            let args = CheckArgs { arm: None, speed: None, deg: *deg, joints_by_number: *joints_by_number };
            info(file, &args, out)
        }
        TrajCommand::Run(args) => run::run(args, out),
        TrajCommand::Replay { run: args, measured } => replay(args, *measured, out),
        TrajCommand::Continue(args) => continued::continued(args, out),
        TrajCommand::Pause(link) => halt::pause(link, out),
        TrajCommand::Resume(args) => resume::resume(args, out),
        TrajCommand::Stop(link) => halt::stop(link, out),
        TrajCommand::Speed { percent, link } => speed(*percent, link, out),
    }
}

/// Executes the motion of a recording.
fn replay(args: &RunArgs, measured: bool, out: &Output) -> Result<(), Failure> {
    let recorded = if measured { Loaded::load_measured(&args.file) } else { Loaded::load(&args.file, None) }?;
    if recorded.form != Form::Recording {
        let message = format!("{} is not a recording of a run", args.file.display());
        return Err(Failure::usage(message)
            .next(format!("`jtc traj run {}` runs this trajectory", typed(&args.file))));
    }
    let load = |out: &Output| {
        let mut job = Job::of(recorded, &args.file, &args.check, out)?;
        if measured {
            job.plan_anew(out);
        }
        Ok(job)
    };
    run::perform(&run::Course::of(args), load, None, out)
}

/// Shows or sets the speed override of the motion.
fn speed(percent: Option<f64>, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if let Some(percent) = percent
        && !(5.0..=100.0).contains(&percent)
    {
        let message = format!("speed override {percent} % is out of range (5 to 100 %); nothing was sent");
        return Err(Failure::usage(message)
            .next("choose a speed in this range; `jtc traj pause` pauses the arm on its path"));
    }
    let mut session = link.session()?;
    if let Some(percent) = percent {
        session.set_speed(percent / 100.0)?;
    }
    let speed = 100.0 * session.speed()?;
    out.result(&json!({ "speed_percent": speed }), || format!("speed on the path: {} %", figure(speed, 1)));
    Ok(())
}

fn check(file: &Path, args: &CheckArgs, payload: Payload, out: &Output) -> Result<(), Failure> {
    let mut job = Job::load(file, args, out)?;
    job.config.payload = payload;
    let differences = job.arm.device_differences(&Config::avena());
    if !differences.is_empty() {
        out.note(format!(
            "note: {} settings of this arm cannot be sent to a controller without extensions, which has \
             other built-in values; `jtc traj run` lists them",
            differences.len()
        ));
    }
    let verdict = job.verdict(&job.trajectory, None, UploadOptions::default());
    if verdict.is_ok() {
        note_low_margin(verdict.margin, out);
    }
    let passing_speed = job.passing_speed(&verdict);
    let hint = job.hint(&verdict, passing_speed);
    let value = json!({
        "ok": verdict.is_ok(),
        "form": job.loaded.form,
        "notes": job.loaded.notes,
        "overshoot": job.loaded.overshoot,
        "left_out": job.left_out(),
        "suspicion": verdict.suspicion(),
        "passing_speed_percent": passing_speed,
        "hint": hint,
        "verdict": verdict,
    });
    out.result(&value, || {
        let without = job.without().map_or(String::new(), |words| words + "\n");
        // If the check fails, the command prints the problems but not the torque margin.
        let margin = margin_line(verdict.margin.filter(|_| verdict.is_ok()));
        format!("{verdict}\n{}{margin}{without}next: {}", figures(&verdict), hint.plain(FrontEnd::Command))
    });
    if verdict.is_ok() { Ok(()) } else { Err(Failure::shown(ErrorKind::Refused)) }
}

fn figures(verdict: &Verdict) -> String {
    let rows: Vec<Vec<String>> = Joint::ALL
        .iter()
        .zip(&verdict.joints)
        .map(|(joint, f)| {
            vec![
                joint.to_string(),
                format!("{} .. {}", figure(f.position_min_rad, 3), figure(f.position_max_rad, 3)),
                figure(f.velocity_peak_rad_s, 3),
                figure(f.acceleration_peak_rad_s2, 3),
                f.torque_peak_nm.map_or("-".into(), |t| figure(t, 1)),
            ]
        })
        .collect();
    table(&["", ">position rad", ">peak rad/s", ">peak rad/s²", ">peak N·m"], &rows)
}

fn info(file: &Path, args: &CheckArgs, out: &Output) -> Result<(), Failure> {
    let job = Job::load(file, args, out)?;
    let (t, upload) = (&job.trajectory, UploadOptions::default());
    let verdict = job.verdict(t, None, upload);
    let per_segment = upload.segment_points(t.points.len());
    let segments = t.points.len().div_ceil(per_segment);
    let ends = |p: Option<&jtc_host::Point>| p.map(|p| p.position);
    let value = json!({
        "form": job.loaded.form,
        "notes": job.loaded.notes,
        "overshoot": job.loaded.overshoot,
        "points": t.points.len(),
        "step_ms": t.step_ms,
        "duration_s": t.duration_s(),
        "segments": segments,
        "first_position_rad": ends(t.points.first()),
        "last_position_rad": ends(t.points.last()),
        "joints": verdict.joints,
    });
    out.result(&value, || {
        format!(
            "{:?}: {} points, step {} ms, {:.2} s, {segments} segments of {per_segment}\n{}next: jtc traj check {}",
            job.loaded.form,
            t.points.len(),
            t.step_ms,
            t.duration_s(),
            figures(&verdict),
            job.words,
        )
    });
    Ok(())
}
