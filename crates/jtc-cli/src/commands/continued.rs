//! `jtc traj continue`: resumes an interrupted run.

use cli_kit::{Failure, Output};
use jtc_host::arm::Arm;
use jtc_host::recording::{NothingLeft, Recording, ResumePoint, Resumption};
use jtc_host::session::UploadOptions;
use jtc_host::trajectory::{Loaded, Trajectory};
use jtc_wire::Status;

use super::job::{Job, stem, typed};
use super::named_arm;
use super::run::{Course, perform};
use crate::args::ContinueArgs;

/// Finds the resume point, and runs the remainder of the trajectory from that point.
pub(super) fn continued(args: &ContinueArgs, out: &Output) -> Result<(), Failure> {
    let recording = Recording::read(&args.run).map_err(Failure::nothing_sent)?;
    if let Some(cut) = &recording.cut {
        out.note(format!("note: {}: {cut}", args.run.display()));
    }
    let arm = named_arm::load(args.arm.as_deref()).map_err(Failure::nothing_sent)?;
    let left = Left::of(args, &recording, &arm, out)?;
    let inputs = [Some(&args.run), args.trajectory.as_ref(), args.arm.as_ref()];
    let course = Course {
        execute: args.execute.clone(),
        name: format!("remainder of {}", stem(&args.run)),
        words: format!("the remainder of {}", args.run.display()),
        inputs: inputs.into_iter().flatten().cloned().collect(),
        arm_named: args.arm.is_some(),
        approach: true,
        speed: None,
        speed_option: "",
        points_per_segment: None,
        repeat: 1,
    };
    let arm_words = named_arm::typed_option(args.arm.as_deref());
    let words = format!("traj continue {}{arm_words}", typed(&args.run));
    let mut make =
        |job: &mut Job, status: &Status, _| left.make(job, status, out).map_err(Failure::nothing_sent);
    perform(&course, |out| Ok(Job::made(arm, words, out)), Some(&mut make), out)
}

/// Remainder of an interrupted run, and the complete runs that follow.
struct Left {
    /// Interrupted trajectory and its resume point; `None` if only complete runs remain.
    current: Option<(Trajectory, ResumePoint)>,
    /// Trajectory of the complete runs that follow.
    then: Trajectory,
    /// Number of the complete runs that follow.
    runs: u32,
}

impl Left {
    fn of(args: &ContinueArgs, recording: &Recording, arm: &Arm, out: &Output) -> Result<Self, Failure> {
        let info = recording.info.as_ref();
        let first = whole(args, recording, arm)?;
        let then = info.and_then(|info| info.then.as_deref()).unwrap_or(&first).clone();
        let asked = args.repeat.or(info.and_then(|info| info.runs));
        if asked.is_none() {
            out.note(
                "note: the recording does not contain the number of runs, so only the interrupted run is \
                 completed. Use --repeat N to set the number of runs",
            );
        }
        let finished = recording.runs_finished(&first, &then);
        let behind = asked.unwrap_or(1).saturating_sub(finished);
        let current = if finished == 0 { first } else { then.clone() };
        match recording.resume_point(&current) {
            Ok(broken) => Ok(Self { current: Some((current, broken)), then, runs: behind.saturating_sub(1) }),
            Err(NothingLeft::Finished) if behind > 0 => Ok(Self { current: None, then, runs: behind }),
            Err(error) => Err(Failure::nothing_sent(error)),
        }
    }

    /// Sets the remainder and the complete runs as the motion of a job.
    fn make(&self, job: &mut Job, status: &Status, out: &Output) -> Result<(), Failure> {
        let rest = match &self.current {
            None => None,
            Some((current, broken)) => match place(job, current, *broken, status, out) {
                Err(NothingLeft::Finished) if self.runs > 0 => None,
                Err(error) => return Err(Failure::of(&error)),
                Ok(from_ms) => {
                    let friction = job.arm.friction();
                    Some(job.planner(friction.as_ref()).rest(current, from_ms, None)?)
                }
            },
        };
        if self.runs > 0 {
            let times = if self.runs == 1 { "once".to_owned() } else { format!("{} times", self.runs) };
            out.note(match rest {
                Some(_) => format!("then the whole trajectory runs {times}, as requested"),
                None => format!(
                    "the interrupted run had already finished; the whole trajectory runs {times}, as \
                     requested"
                ),
            });
            // Before the arm moves, the command also checks the complete runs that follow.
            let verdict = job.verdict(&self.then, None, UploadOptions::default());
            if !verdict.is_ok() {
                return Err(job.refuse(&verdict, out));
            }
        }
        let behind = self.runs - u32::from(rest.is_none());
        job.take(rest.unwrap_or_else(|| self.then.clone()));
        job.later = (behind > 0).then(|| (self.then.clone(), behind));
        Ok(())
    }
}

/// Returns the trajectory of the interrupted run.
fn whole(args: &ContinueArgs, recording: &Recording, arm: &Arm) -> Result<Trajectory, Failure> {
    if let Some(file) = &args.trajectory {
        let names = (!args.joints_by_number).then(|| arm.names());
        return Ok(Loaded::load(file, names).map_err(Failure::nothing_sent)?.trajectory);
    }
    let held = recording.info.as_ref().and_then(|info| info.commanded.as_deref());
    held.cloned().ok_or_else(|| {
        let message =
            format!("{} does not contain the whole trajectory; nothing was sent", args.run.display());
        Failure::usage(message).next(format!(
            "give the trajectory of the run: `jtc traj continue {} --trajectory FILE`; only MCAP recordings \
             contain it",
            typed(&args.run)
        ))
    })
}

/// Returns the path time of the resume point, ms. Prints on stderr why the function chose this path time.
fn place(
    job: &Job,
    whole: &Trajectory,
    broken: ResumePoint,
    status: &Status,
    out: &Output,
) -> Result<u32, NothingLeft> {
    let on = broken.resumption(whole, status, job.config.start_tolerance_rad)?;
    let seconds = |ms: u32| format!("{:.3} s", f64::from(ms) * 1e-3);
    let of_path = format!("{} of {:.3} s of its path", seconds(on.ms), whole.duration_s());
    out.note(match on {
        Resumption { shown: true, .. } => {
            format!(
                "the controller continued to {of_path} without this program, and the arm is at rest there: \
                 the motion continues from that position"
            )
        }
        Resumption { stands: true, .. } => {
            format!(
                "the recording shows the run up to {of_path}, and the arm is at rest there: the motion \
                 continues from that position"
            )
        }
        _ => format!(
            "the recording shows the run up to {of_path}, and the controller reports no later position \
             (trajectory {}, at {}): after an approach, the motion continues from there",
            status.trajectory,
            seconds(status.point)
        ),
    });
    Ok(on.ms)
}
