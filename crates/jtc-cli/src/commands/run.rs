//! `jtc traj run`, and what other commands that move along a path share with it: check, upload, execute, follow, report.

mod approach;
mod conclude;
mod outputs;
mod terminal;

use std::path::PathBuf;

use cli_kit::{Failure, Output};
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

/// What a motion is run with, whichever command asks for it.
#[derive(Clone, Debug)]
pub struct Course {
    /// Link, files that it writes, what is accepted.
    pub execute: ExecuteArgs,
    /// As recordings name it.
    pub name: String,
    /// Whose first point an approach leads to, as it is typed.
    pub words: String,
    /// Files that the command reads, which are no outputs.
    pub inputs: Vec<PathBuf>,
    /// The arm was named, and has to be that of the controller.
    pub arm_named: bool,
    /// Where the arm stands elsewhere it is moved to the first point.
    pub approach: bool,
    /// Speed of a move or an approach, %, where it was named.
    pub speed: Option<f64>,
    /// Option that names it; empty: the command has none.
    pub speed_option: &'static str,
    pub points_per_segment: Option<usize>,
    /// How often the motion is run.
    pub repeat: u32,
}

/// Makes the trajectory of a job once it is known where the arm stands, and how fast a move is on this controller.
pub type Make<'a> = &'a mut dyn FnMut(&mut Job, &Status, MoveSpeed) -> Result<(), Failure>;

impl Course {
    /// That of a trajectory file.
    pub fn of(args: &RunArgs) -> Self {
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
pub fn run(args: &RunArgs, out: &Output) -> Result<(), Failure> {
    let course = Course::of(args);
    perform(&course, |out| Job::load(&args.file, &args.check, out), None, out)
}

/// Runs a job: that of a file as it is, or one whose motion is made once the arm's place is known.
pub fn perform(
    course: &Course,
    load: impl FnOnce(&Output) -> Result<Job, Failure>,
    make: Option<Make<'_>>,
    out: &Output,
) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    if let Some(path) = &course.execute.files.record {
        Format::of(path)?; // a wrong ending is reported before anything moves
    }
    let mut job = load(out)?;
    drive(course, &mut job, make, &progress, out).map_err(|failure| job.named(failure))
}

/// The arm of the controller and that of the job are one (J-55): the controller's own where none was named, else a refusal. From
/// then on its settings count.
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
                let name = if has.name == job.arm.name { "as it is set" } else { info.arm.as_str() };
                out.note(format!("note: checked for the arm of the controller, {name}"));
                job.arm = has;
            }
        }
    }
    // Where nothing differs, these are the arm's own, with the rotors that a file may have left open.
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

/// A motion that is known before the arm is asked passes the check first, and one that is repeated leads back to its start.
fn checked_before(course: &Course, job: &Job, out: &Output) -> Result<(), Failure> {
    let verdict = job.verdict(&job.trajectory, None, course.upload());
    if !verdict.is_ok() {
        return Err(job.refuse(&verdict, out));
    }
    for warning in verdict.warnings() {
        out.note(format!("warning: {warning}"));
    }
    let open = OpenPath::between(&job.trajectory, &job.trajectory, job.config.start_tolerance_rad);
    match open.filter(|_| course.repeat > 1 && !course.approach) {
        Some(open) => Err(open_path(&open, course)),
        None => Ok(()),
    }
}

/// The failure of a run that cannot be repeated.
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
    if make.is_none() {
        checked_before(course, job, out)?;
    }
    let outputs = Outputs::open(course).map_err(Failure::nothing_sent)?;
    let mut operator = Operator::listen(out, progress)?;
    let mut session = Session::new(course.execute.link.open_with(course.execute.policy())?);
    progress.watch(&mut session);
    let status = ready(&mut session, &operator)?;
    match_device(&mut session, job, course, out)?;
    let move_speed = session.move_speed(course.speed)?;
    if let Some(make) = make {
        make(job, &status, move_speed)?;
    }
    let speed = session.speed()?;
    if speed < 1.0 {
        out.note(format!(
            "note: the controller's speed override is {:.0} %: `jtc traj speed 100` ends it",
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
    /// How its motions are checked.
    fn options(&self, course: &Course) -> CheckOptions {
        let accept_device_limits = course.accepts_device_limits();
        CheckOptions { upload: course.upload(), accept_device_limits, device: self.device.clone() }
    }
}
