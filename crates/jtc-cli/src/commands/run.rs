//! `jtc traj run`, and what other commands that move along a path share with it: check, upload, execute, follow, report.

mod approach;
mod conclude;
mod leg;
mod outputs;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output};
use jtc_host::plan::{MoveSpeed, RunCourse, RunStart, StartError, furthest_joint};
use jtc_host::port::Port;
use jtc_host::recording::{Format, RecordingInfo};
use jtc_host::report::Summary;
use jtc_host::session::UploadOptions;
use jtc_host::trajectory::Trajectory;
use jtc_host::{CheckError, CheckOptions, CheckedTrajectory, Error, Session};
use jtc_wire::Status;

use super::job::{Job, stem, typed};
use super::run_report;
use crate::args::{ExecuteArgs, RunArgs};
use crate::limits;
use crate::link::LinkPort;
use crate::operator::Operator;
use crate::progress::Progress;
use conclude::{Done, Finished, Legs, conclude};
use leg::{APPROACH, Leg, Reel, cancelled};
use outputs::Outputs;

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
    let ends = job.trajectory.points.first().zip(job.trajectory.points.last());
    let gap = |(first, last): (&jtc_host::Point, &jtc_host::Point)| {
        Some(furthest_joint(&first.position, &last.position))
            .filter(|(_, far)| *far > job.config.start_tolerance_rad)
    };
    match ends.and_then(gap) {
        Some((joint, far)) if course.repeat > 1 && !course.approach => {
            let message = format!(
                "{} ends {far:.3} rad from where it begins ({joint}), more than {} rad: it cannot be repeated as it is; nothing was sent",
                course.words, job.config.start_tolerance_rad
            );
            Err(Failure::new(ErrorKind::Refused, "open-path", message)
                .hint("`--approach` leads back to its first point before each run; or let the path end where it begins"))
        }
        _ => Ok(()),
    }
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
    let mut stage = Stage { course, job, move_speed, outputs, out, reel: None };
    let legs = stage.legs(&mut session, &mut operator, status)?;
    drop(operator);
    let Stage { outputs, reel, .. } = stage;
    // Each motion begins it before it moves.
    let reel = reel.unwrap_or_else(|| Reel::of(RecordingInfo::of(&job.arm), None, Duration::ZERO));
    conclude(job, legs, reel, &session, outputs, out)
}

/// A run in the making.
struct Stage<'a> {
    course: &'a Course,
    job: &'a mut Job,
    /// Of an approach.
    move_speed: MoveSpeed,
    outputs: Outputs,
    out: &'a Output,
    reel: Option<Reel>,
}

impl Stage<'_> {
    /// All motions, until one is not finished or all are done.
    fn legs(
        &mut self,
        session: &mut Session<LinkPort>,
        operator: &mut Operator,
        mut status: Status,
    ) -> Result<Legs, Failure> {
        let mut done = Finished::default();
        let repeat = self.repeat();
        for n in 1..=repeat {
            let (checked, phase) = self.next(&status, n)?;
            let mut leg = self.leg(session, &checked, phase, operator)?;
            let mut verdict = checked.verdict().clone();
            if phase == APPROACH && leg.is_finished() {
                self.approached(n == 1, leg, &mut done);
                // From where the approach ended, not from where it should have.
                let checked = self.job.checked(&self.job.trajectory, &session.fresh_status()?, self.course);
                let checked = checked.map_err(|e| self.job.not_checked(e, self.out))?;
                verdict = checked.verdict().clone();
                leg = self.leg(session, &checked, "motion", operator)?;
            }
            let over = n == repeat || !leg.is_finished();
            let cut = !over && operator.wants_the_end();
            if over || cut {
                return Ok(Legs { done, last: leg, verdict, cut });
            }
            self.out.note(format!("run {n} of {repeat} finished"));
            self.take(&leg, &mut done);
            if let Some((later, _)) = &self.job.later {
                let later = later.clone();
                self.job.take(later);
            }
            status = session.fresh_status()?;
        }
        Err(cancelled("run"))
    }

    /// How many runs there are, the first one included.
    fn repeat(&self) -> u32 {
        self.course.repeat.max(1) + self.job.later.as_ref().map_or(0, |(_, often)| *often)
    }

    /// The motion of run `n` from where the arm stands, or the way to its first point where that is asked for and needed. Before the first
    /// run those after it are checked as well.
    fn next(&self, status: &Status, n: u32) -> Result<(CheckedTrajectory, &'static str), Failure> {
        let (job, course, speed) = (&*self.job, self.course, self.move_speed);
        let later = job.later.as_ref().map_or(&job.trajectory, |(later, _)| later);
        let run = RunCourse {
            trajectory: &job.trajectory,
            then: (n == 1 && self.repeat() > 1).then_some(later),
            approach_pct: course.approach.then_some(speed.percent),
        };
        match run.start(&job.arm, &status.positions(), &job.options(course)) {
            Ok(RunStart { checked, is_approach: false }) => Ok((checked, "motion")),
            Ok(RunStart { checked, is_approach: true }) => {
                approach::note(&checked, course, speed, self.out);
                Ok((checked, APPROACH))
            }
            Err(StartError::Check(error) | StartError::Elsewhere(error)) => {
                Err(job.not_checked(error, self.out))
            }
            Err(StartError::Approach(error)) => Err(approach::not_possible(error, course, self.out)),
        }
    }

    /// Runs one motion; the recording is begun with the first one.
    fn leg(
        &mut self,
        session: &mut Session<LinkPort>,
        checked: &CheckedTrajectory,
        phase: &'static str,
        operator: &mut Operator,
    ) -> Result<Leg, Failure> {
        let repeat = self.repeat();
        let (job, course, out) = (&*self.job, self.course, self.out);
        let source = session.port().name();
        let (outputs, reel) = (&mut self.outputs, &mut self.reel);
        let mut record = |phase: &str, start_unix_ns, now: Duration| {
            if reel.is_none() {
                let name = &course.name;
                let name = if phase == APPROACH { format!("{name}, {APPROACH}") } else { name.clone() };
                let mut info = run_report::info(&job.arm, &source, &name, start_unix_ns);
                info.commanded = Some(Arc::new(job.trajectory.clone()));
                info.runs = Some(repeat);
                if let Some((device, hash)) = &job.identity {
                    (info.device, info.hash) = (Some(device.clone()), Some(*hash));
                }
                info.then = job.later.as_ref().map(|(later, _)| Arc::new(later.clone()));
                let tape = outputs.begin(&info, out)?;
                *reel = Some(Reel::of(info, tape, now));
            }
            let begun = reel.as_ref().map(|reel| {
                let sink = reel.tape.as_ref().map(crate::tape::Tape::sink);
                (sink, now.saturating_sub(reel.start).as_secs_f64().max(reel.until_s))
            });
            Ok(begun.unwrap_or_default())
        };
        let leg = Leg::run(session, checked, phase, operator, &mut record)?;
        if let (Some(reel), Some(last)) = (reel, leg.samples.last()) {
            reel.until_s = last.time_s + 1e-6;
        }
        Ok(leg)
    }

    /// An approach is over. The recording is that of the motion: before the first one it is begun again.
    fn approached(&mut self, first: bool, leg: Leg, done: &mut Finished) {
        if !first {
            return self.take(&leg, done);
        }
        if let Some(Reel { info, tape, .. }) = self.reel.take() {
            done.push(Done { phase: leg.phase, summary: Summary::of(&info, &leg.samples) });
            if let Some(tape) = tape {
                tape.abandon();
            }
        }
    }

    /// Its figures; its samples are in the recording.
    fn take(&mut self, leg: &Leg, done: &mut Finished) {
        let Some(reel) = &self.reel else { return };
        done.push(Done { phase: leg.phase, summary: Summary::of(&reel.info, &leg.samples) });
    }
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
    /// A trajectory of this job, checked for a run from where the arm is.
    fn checked(
        &self,
        trajectory: &Trajectory,
        status: &Status,
        course: &Course,
    ) -> Result<CheckedTrajectory, CheckError> {
        CheckedTrajectory::check(trajectory, &self.arm, &status.positions(), &self.options(course))
    }

    /// How its motions are checked.
    fn options(&self, course: &Course) -> CheckOptions {
        let accept_device_limits = course.accepts_device_limits();
        CheckOptions { upload: course.upload(), accept_device_limits, device: self.device.clone() }
    }

    /// Prints what forbids to run it.
    fn not_checked(&self, error: CheckError, out: &Output) -> Failure {
        match error {
            CheckError::Refused(verdict) => self.refuse(&verdict, out),
            other => other.into(),
        }
    }
}
