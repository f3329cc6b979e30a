//! `jtc move`: moves the arm from its present position to joint positions or a pose.

use cli_kit::{Failure, Output};
use jtc_host::arm::Arm;
use jtc_host::plan::kinematics::{self, Orientation};
use jtc_host::plan::{COLD, MoveSpeed, PlanError, Planner};

use super::job::Job;
use super::named_arm;
use super::plan::note_low_margin;
use super::run::{Course, perform};
use crate::args::{MoveArgs, Target};

/// Plans the move when the position of the arm is known, and executes the move.
pub(super) fn move_to(args: &MoveArgs, out: &Output) -> Result<(), Failure> {
    if let Some(percent) = args.speed.filter(|percent| !(1.0..=100.0).contains(percent)) {
        return Err(Failure::nothing_sent(PlanError::Speed { percent, most: 100.0 }));
    }
    if args.deg && matches!(args.to, Some(Target::Pose(_))) {
        let message = "--deg applies only to joint positions and poses of the flange, not to a named pose; \
            nothing was sent";
        return Err(Failure::usage(message).next("leave out --deg"));
    }
    let (name, option) = match (&args.to, &args.to_flange) {
        (Some(Target::Pose(name)), _) => (name.clone(), "--to"),
        (Some(Target::Joints(q)), _) => (q.map(|v| format!("{v}")).join(","), "--to"),
        (None, pose) => (pose.unwrap_or_default().map(|v| format!("{v}")).join(","), "--to-flange"),
    };
    let course = Course {
        execute: args.execute.clone(),
        name: format!("move to {name}"),
        words: name.clone(),
        inputs: args.arm.iter().cloned().collect(),
        arm_named: args.arm.is_some(),
        approach: false,
        speed: args.speed,
        speed_option: "--speed",
        points_per_segment: None,
        repeat: 1,
    };
    let line = if args.line { " --line" } else { "" };
    let words = line.to_owned() + &named_arm::typed_option(args.arm.as_deref());
    let arm = named_arm::load(args.arm.as_deref()).map_err(Failure::nothing_sent)?;
    let target = target(args, &arm)?;
    let mut make = |job: &mut Job, status: &jtc_wire::Status, speed: MoveSpeed| {
        let friction = job.arm.friction();
        let temperature = coldest(status);
        let (speed_pct, margin_pct) = (speed.percent, args.margin.percent);
        let planner = Planner { speed_pct, margin_pct, temperature, ..job.planner(friction.as_ref()) };
        // The move begins at the position of the arm and ends at the requested target.
        let planned = planner.to_target(&job.arm.model, &status.positions(), &target, args.line);
        let planned = planned.map_err(|e| refused(&e, &name))?;
        for note in &planned.notes {
            out.note(format!("note: {note}"));
        }
        note_low_margin(planned.verdict.margin, out);
        let of_speed = speed.note(course.speed_option).map_or(String::new(), |words| format!(", {words}"));
        out.note(format!("move to {name}: {:.2} s{of_speed}", planned.trajectory.duration_s()));
        job.take(planned.trajectory);
        Ok(())
    };
    let load = |out: &Output| Ok(Job::made(arm, format!("move {option} {name}{words}"), out));
    perform(&course, load, Some(&mut make), out)
}

/// Returns the target of the move from the options of the command.
fn target(args: &MoveArgs, arm: &Arm) -> Result<kinematics::Target, Failure> {
    let joints = match (&args.to, args.to_flange) {
        (Some(Target::Joints(q)), _) if args.deg => q.map(f64::to_radians),
        (Some(Target::Joints(q)), _) => *q,
        (Some(Target::Pose(name)), _) => arm.pose(name).map_err(Failure::nothing_sent)?,
        (None, pose) => {
            let [x, y, z, angles @ ..] = pose.unwrap_or_default();
            let angles = if args.deg { angles.map(f64::to_radians) } else { angles };
            let pose = Orientation::Rpy(angles).at([x, y, z]).map_err(|e| Failure::usage(e.to_string()))?;
            return Ok(kinematics::Target::Flange(pose));
        }
    };
    Ok(kinematics::Target::Joints(joints))
}

/// Returns the lowest measured bearing temperature in °C, but at most [`COLD`], the temperature of a cold hall.
fn coldest(status: &jtc_wire::Status) -> f64 {
    let measured = status.joints.iter().map(|joint| f64::from(joint.temperature));
    measured.fold(COLD, f64::min)
}

/// Returns the failure for a move that is not possible.
fn refused(error: &PlanError, name: &str) -> Failure {
    let message = format!("no move to {name}: {}", error.of_move());
    let failure = Failure { message, ..Failure::of(error) };
    let next = error.next_of_move().unwrap_or_else(|| failure.next.clone());
    Failure::nothing_sent(failure.next(next))
}
