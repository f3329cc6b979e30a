//! `jtc traj run`, and the steps that all motion commands share (check, upload, execute, wait, report).

mod approach;
mod conclude;
mod outputs;
mod terminal;

use std::path::PathBuf;

use cli_kit::{Failure, Output};
use jtc_host::check::Verdict;
use jtc_host::plan::MoveSpeed;
use jtc_host::recording::Format;
use jtc_host::run::{OpenPath, Order, run as run_all};
use jtc_host::session::UploadOptions;
use jtc_host::{CheckOptions, Error, Session};
use jtc_wire::Status;

use super::job::{Job, stem, typed};
use crate::args::{ExecuteArgs, RunArgs};
use crate::limits;
use crate::link::LinkPort;
use crate::operator::Operator;
use crate::progress::Progress;
use conclude::conclude;
use outputs::Outputs;
use terminal::{Terminal, cancelled};

/// Settings of a motion that all motion commands use.
#[derive(Clone, Debug)]
pub(super) struct Course {
    /// Options for the link, for output files, and for risks that the user accepts.
    pub execute: ExecuteArgs,
    /// Name of the motion in recordings.
    pub name: String,
    /// Name of the trajectory, as the user typed it. An approach moves to the start of this trajectory.
    pub words: String,
    /// Files that the command reads. Output files must not replace these input files.
    pub inputs: Vec<PathBuf>,
    /// `true` if the user has specified an arm file. In this case, the arm file must match the arm of the controller.
    pub arm_named: bool,
    /// `true` if the command first moves the arm to the first point of the trajectory, unless the arm is already there.
    pub approach: bool,
    /// Speed of a move or an approach in %, if the user has specified the speed.
    pub speed: Option<f64>,
    /// Name of the speed option. Empty if the command has no speed option.
    pub speed_option: &'static str,
    pub points_per_segment: Option<usize>,
    /// Number of runs of the motion.
    pub repeat: u32,
}

/// Function that creates the trajectory of a job. The command calls the function when it knows the position of the arm and the speed
/// of a move on this controller.
pub(super) type Make<'a> = &'a mut dyn FnMut(&mut Job, &Status, MoveSpeed) -> Result<(), Failure>;

impl Course {
    /// Returns the settings for the run of a trajectory file.
    pub(super) fn of(args: &RunArgs) -> Self {
        Self {
            execute: args.execute.clone(),
            name: stem(&args.file),
            words: typed(&args.file),
            inputs: std::iter::once(args.file.clone()).chain(args.check.arm.clone()).collect(),
            arm_named: args.check.arm.is_some(),
            approach: args.approach,
            speed: args.check.speed,
            speed_option: "--speed",
            points_per_segment: args.points_per_segment,
            repeat: args.repeat,
        }
    }

    fn accepts_device_limits(&self) -> bool {
        self.execute.accept.accept_device_limits
    }

    fn upload(&self) -> UploadOptions {
        UploadOptions { points_per_segment: self.points_per_segment, number: 0 }
    }
}

/// Runs a trajectory from a file.
pub(super) fn run(args: &RunArgs, out: &Output) -> Result<(), Failure> {
    let course = Course::of(args);
    perform(&course, |out| Job::load(&args.file, &args.check, out), None, out)
}

/// Runs the motion of a job. The motion is the unchanged trajectory of a file, or it is planned as soon as the
/// position of the arm is known.
pub(super) fn perform(
    course: &Course,
    load: impl FnOnce(&Output) -> Result<Job, Failure>,
    make: Option<Make<'_>>,
    out: &Output,
) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    if let Some(path) = &course.execute.files.record {
        Format::of(path)?; // the command reports a wrong file name extension before the arm moves
    }
    let mut job = load(out)?;
    drive(course, &mut job, make, &progress, out).map_err(|failure| job.named(failure))
}

/// Checks that the arm of the controller matches the arm of the job (J-55). If the user has specified an arm file, the function
/// rejects a difference. Otherwise, the job uses the arm of the controller. After the check, the job uses the settings of the
/// controller.
fn match_device(
    session: &mut Session<LinkPort>,
    job: &mut Job,
    course: &Course,
    out: &Output,
) -> Result<(), Failure> {
    let accepted = course.accepts_device_limits();
    let info = session.info()?;
    job.identity = info.as_ref().map(|info| (info.into(), info.hash));
    job.device = session.device_config()?;
    match info {
        None => drop(limits::accept(&job.arm, &job.device, accepted, out)?),
        Some(info) if job.arm.hash().ok().flatten() == Some(info.hash) => {}
        Some(info) => {
            let has = session.device_arm()?;
            if course.arm_named {
                limits::same_arm(&job.arm, &has, accepted, out)?;
            } else {
                let name =
                    if has.name == job.arm.name { "with its present settings" } else { info.arm.as_str() };
                out.note(format!("note: checked with the arm of the controller, {name}"));
                job.arm = has;
            }
        }
    }
    // The settings are those of the arm file, because it matches the arm of the controller. Rotor values that the arm
    // file does not contain come from the controller.
    job.config = job.arm.config_on_device(&job.device);
    if job.device.payload.is_there() {
        out.note(format!(
            "note: checked with the payload of the controller, {}",
            super::payload::words(&job.device.payload)
        ));
    }
    job.note_what_is_left_out(out);
    Ok(())
}

/// Checks a motion that is known before the command connects to the controller. If the check fails and the user has
/// specified an arm file, the result is an error. Without an arm file, the function returns the failed verdict for
/// the built-in arm, because the controller may have another arm. A repeated motion must end at its start point.
fn checked_before(course: &Course, job: &Job, out: &Output) -> Result<Option<Verdict>, Failure> {
    let verdict = job.verdict(&job.trajectory, None, course.upload());
    if !verdict.is_ok() {
        return if course.arm_named { Err(job.refuse(&verdict, out)) } else { Ok(Some(verdict)) };
    }
    warn(&verdict, out);
    let open = OpenPath::between(&job.trajectory, &job.trajectory, job.config.start_tolerance_rad);
    match open.filter(|_| course.repeat > 1 && !course.approach) {
        Some(open) => Err(open_path(&open, course)),
        None => Ok(None),
    }
}

/// Prints the warnings of a check.
fn warn(verdict: &Verdict, out: &Output) {
    for warning in verdict.warnings() {
        out.note(format!("warning: {warning}"));
    }
}

/// Returns the failure of a run that cannot be repeated.
fn open_path(open: &OpenPath, course: &Course) -> Failure {
    Failure { message: format!("{}: {open}", course.words), ..Failure::of(open) }
}

fn drive(
    course: &Course,
    job: &mut Job,
    make: Option<Make<'_>>,
    progress: &Progress,
    out: &Output,
) -> Result<(), Failure> {
    let refused = if make.is_none() { checked_before(course, job, out)? } else { None };
    let outputs = Outputs::open(course).map_err(Failure::nothing_sent)?;
    let mut operator = Operator::listen(out, progress)?;
    let port = match (course.execute.link.open_with(course.execute.policy()), &refused) {
        (Ok(port), _) => port,
        (Err(failure), None) => return Err(failure),
        (Err(failure), Some(verdict)) => {
            let why = failure.message;
            out.note(format!("note: checked with the built-in arm, because the link failed: {why}"));
            return Err(job.refuse(verdict, out));
        }
    };
    let mut session = Session::new(port);
    progress.watch(&mut session);
    let status = ready(&mut session, &operator)?;
    match_device(&mut session, job, course, out)?;
    if refused.is_some() {
        warn(&job.verdict(&job.trajectory, None, course.upload()), out);
    }
    let move_speed = session.move_speed(course.speed)?;
    if let Some(make) = make {
        make(job, &status, move_speed)?;
    }
    let speed = session.speed()?;
    if speed < 1.0 {
        out.note(format!(
            "note: the speed override of the controller is {:.0} %: `jtc traj speed 100` resets it",
            speed * 100.0
        ));
    }
    operator.speed = session.has_extensions().then_some((speed * 100.0).round() as u8);
    let options = job.options(course);
    let later = job.later.clone();
    let order = Order {
        arm: &job.arm,
        options: &options,
        trajectory: &job.trajectory,
        later: later.as_ref().map_or(&job.trajectory, |(later, _)| later),
        runs: course.repeat.max(1) + later.as_ref().map_or(0, |(_, often)| *often),
        approach_pct: course.approach.then_some(move_speed.percent),
    };
    let mut terminal = Terminal::new(course, job, &order, move_speed, outputs, &mut operator);
    let ended = run_all(&mut session, &order, &status, &mut terminal)?;
    let taken = terminal.taken();
    drop(operator);
    conclude(job, ended, taken, &session, out)
}

/// Waits until the controller holds the arm with all drives enabled.
fn ready(session: &mut Session<LinkPort>, operator: &Operator) -> Result<Status, Failure> {
    let waits = |what| operator.out.note(format!("waiting until {what}"));
    session.ready_to_move(waits, || operator.wants_the_end()).map_err(|error| match error {
        Error::Cancelled => cancelled("wait for the drives"),
        other => other.into(),
    })
}

impl Job {
    /// Returns the options for the trajectory check of this job.
    fn options(&self, course: &Course) -> CheckOptions {
        let accept_device_limits = course.accepts_device_limits();
        CheckOptions { upload: course.upload(), accept_device_limits, device: self.device.clone() }
    }
}
