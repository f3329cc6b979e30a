//! `jtc traj resume`: resumes a motion after a pause. If the trajectory is known, the command first checks the remainder of
//! the motion.

use cli_kit::{ErrorKind, Failure, Output};
use jtc_host::error::MotionError;
use jtc_host::plan::furthest_joint;
use jtc_host::{Error, Session};
use jtc_wire::{Status, TrajectoryState};
use serde_json::json;

use super::job::Job;
use crate::args::ResumeArgs;
use crate::link::LinkPort;
use crate::progress::Progress;

/// Resumes the motion, unless the remainder of the specified trajectory fails the check (J-36, J-60).
pub(super) fn resume(args: &ResumeArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let job = args.trajectory.as_deref().map(|file| Job::load(file, &args.check, out)).transpose();
    let mut job = job.map_err(Failure::nothing_sent)?;
    let mut session = args.link.session()?;
    progress.watch(&mut session);
    let status = session.fresh_status()?;
    // Only a paused motion is checked. In any other state, the session rejects the request and reports the error.
    if status.trajectory == TrajectoryState::Pause {
        match &mut job {
            Some(job) => check_rest(job, args.check.arm.is_none(), &mut session, &status)?,
            None => note_what_is_not_checked(&mut session, out)?,
        }
    }
    session.resume()?;
    let value = json!({ "command": "resume", "accepted": true, "checked": job.is_some() });
    out.result(&value, || "motion resumed".to_owned());
    Ok(())
}

/// Checks the remainder of the trajectory after the pause, with the limits and the payload of the controller.
fn check_rest(
    job: &mut Job,
    arm_of_device: bool,
    session: &mut Session<LinkPort>,
    status: &Status,
) -> Result<(), Failure> {
    job.device = session.device_config()?;
    if arm_of_device && session.has_extensions() {
        job.arm = session.device_arm()?;
    }
    job.config = job.arm.config_on_device(&job.device);
    let paused_s = f64::from(status.point) * 1e-3;
    let place = job.trajectory.at_ms(status.point).unwrap_or_default().position;
    let here = status.positions();
    let beyond = paused_s > job.trajectory.duration_s();
    let (joint, away) = furthest_joint(&place, &here);
    if beyond || away > job.config.start_tolerance_rad {
        let message = format!(
            "the motion is paused at {paused_s:.3} s, but the arm is not at that point of {} ({joint} is \
             {:.3} rad away); nothing was sent",
            job.words, away
        );
        return Err(Failure::new(ErrorKind::Refused, "other-trajectory", message).next(
            "give the trajectory of the paused motion and its --speed, or end the motion with `jtc traj \
             stop`",
        ));
    }
    let friction = job.arm.friction();
    job.planner(friction.as_ref()).rest(&job.trajectory, status.point, None).map(drop).map_err(|why| {
        Failure::of(&Error::from(MotionError::RestRefused { point: status.point, why: Box::new(why) }))
    })
}

/// Prints a note that the remainder of the motion is not checked. Without a trajectory file, its trajectory is
/// unknown, because a controller cannot return a trajectory.
fn note_what_is_not_checked(session: &mut Session<LinkPort>, out: &Output) -> Result<(), Failure> {
    let payload = session.payload()?;
    if session.has_extensions() {
        out.note(format!(
            "note: the remainder of the motion is not checked against the present settings and payload ({}); \
             use --trajectory FILE to check it",
            super::payload::words(&payload)
        ));
    }
    Ok(())
}
