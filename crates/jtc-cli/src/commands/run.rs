//! `jtc traj run`: check, upload, execute, follow, report.

mod approach;

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use cli_kit::{ErrorKind, Failure, Output, OutputFile};
use jtc_host::check::{ProblemKind, Verdict};
use jtc_host::port::{Port, SerialPort};
use jtc_host::recording::{Ending, Format, RecordingInfo, SampleSink};
use jtc_host::report::{self, ReportInput, RunFailure, Summary};
use jtc_host::session::{Flow, Outcome, Run, UploadOptions, UploadReport};
use jtc_host::trajectory::Trajectory;
use jtc_host::{
    CheckError, CheckOptions, CheckedTrajectory, Error, MotionError, Sample, Session, StateError, words,
};
use jtc_wire::{ControllerState, Status};
use serde_json::json;

use super::job::Job;
use super::run_report;
use crate::args::RunArgs;
use crate::failure::output_lost;
use crate::limits;
use crate::operator::Operator;
use crate::progress::Progress;
use crate::tape::Tape;

/// How long the drives may take: 4 s for their first enable.
pub(super) const BRING_UP: Duration = Duration::from_secs(15);

/// Runs a trajectory from a file.
pub fn run(args: &RunArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    if let Some(path) = &args.record {
        Format::of(path)?; // a wrong ending is reported before anything moves
    }
    let mut job = Job::load(&args.file, &args.check, out)?;
    perform(args, &mut job, &progress, out).map_err(|failure| job.named(failure))
}

/// The arm of the controller and that of the job are one (J-55): the controller's own where none was named, else a refusal. From
/// then on its settings count.
fn match_device(
    session: &mut Session<SerialPort>,
    job: &mut Job,
    args: &RunArgs,
    out: &Output,
) -> Result<(), Failure> {
    let accepted = args.accept.accept_device_limits;
    let info = session.info()?;
    job.device = session.device_config()?;
    match info {
        None => drop(limits::accept(&job.arm, &job.device, accepted, out)?),
        Some(info) if job.arm.hash().ok().flatten() == Some(info.hash) => {}
        Some(info) => {
            let has = session.device_arm()?;
            if args.check.arm.is_none() {
                let name = if has.name == job.arm.name { "as it is set" } else { info.arm.as_str() };
                out.note(format!("note: checked for the arm of the controller, {name}"));
                job.arm = has;
            } else {
                limits::same_arm(&job.arm, &has, accepted, out)?;
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

fn perform(args: &RunArgs, job: &mut Job, progress: &Progress, out: &Output) -> Result<(), Failure> {
    let options = UploadOptions { points_per_segment: args.points_per_segment, number: 0 };
    let verdict = job.verdict(&job.trajectory, None, options);
    if !verdict.is_ok() {
        return Err(job.refuse(&verdict, out));
    }
    for warning in verdict.warnings() {
        out.note(format!("warning: {warning}"));
    }

    let mut outputs = Outputs::open(args).map_err(Failure::nothing_sent)?;
    let mut operator = Operator::listen(out, progress)?;
    let mut session = args.link.session()?;
    progress.watch(&mut session);
    let status = ready(&mut session, &operator)?;
    match_device(&mut session, job, args, out)?;
    let job = &*job;
    let speed = session.speed()?;
    if speed < 1.0 {
        out.note(format!(
            "note: the controller's speed override is {:.0} %: `jtc traj speed 100` ends it",
            speed * 100.0
        ));
    }
    operator.speed = session.has_extensions().then_some((speed * 100.0).round() as u8);
    let name = args.file.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let source = session.port().name();
    let mut record = |phase: &str, start_unix_ns| {
        let name = if phase == APPROACH { format!("{name}, {APPROACH}") } else { name.clone() };
        let info = run_report::info(&job.arm, &source, &name, start_unix_ns);
        let tape = outputs.begin(&info, out)?;
        Ok((info, tape))
    };
    let mut motion = job.checked(&job.trajectory, &status, args, options);
    let mut broken_off = None;
    if let Err(CheckError::Refused(verdict)) = &motion
        && args.approach
        && verdict.problems.iter().any(|p| p.kind == ProblemKind::StartPose)
    {
        let path = approach::approach(job, &status, args, out)?;
        let leg = Leg::run(&mut session, &path, APPROACH, &mut operator, &mut record)?;
        if matches!(leg.outcome, Ok(Outcome::Finished(_))) {
            // The recording is that of the motion.
            if let Some(tape) = leg.tape {
                tape.abandon();
            }
            // From where the approach ended, not from where it should have.
            motion = job.checked(&job.trajectory, &session.fresh_status()?, args, options);
        } else {
            broken_off = Some((leg, path));
        }
    }
    let (leg, checked) = match broken_off {
        Some(ended) => ended,
        None => {
            let motion = motion.map_err(|e| job.not_checked(e, out))?;
            (Leg::run(&mut session, &motion, "motion", &mut operator, &mut record)?, motion)
        }
    };
    drop(operator);
    conclude(job, leg, checked.verdict(), &session, outputs, out)
}

/// Writes the files of a run and prints how it ended.
fn conclude(
    job: &Job,
    leg: Leg,
    verdict: &Verdict,
    session: &Session<SerialPort>,
    outputs: Outputs,
    out: &Output,
) -> Result<(), Failure> {
    let Leg { phase, upload, mut info, tape, samples, outcome } = leg;
    let link = session.statistics();
    // A run that ended in a fault is what one wants to look at most: it is recorded and reported as well.
    let facts = [run_report::link_facts(&upload, &link, session.port().baud())];
    let broken = outcome.as_ref().err().map(|e| {
        let found = RunFailure::find(&info, &samples);
        let found = found.unwrap_or_else(|| RunFailure::ended_by(&info, &samples, e.to_string()));
        match e {
            Error::Motion(MotionError::RunFault { status, .. }) => found.with_status(status),
            _ => found,
        }
    });
    let word = match &outcome {
        Ok(Outcome::Finished(_)) => "finished",
        Ok(Outcome::Stopped(_)) => "stopped",
        Err(_) => "fault",
    };
    let where_ =
        if phase == APPROACH { format!(" on the {APPROACH} to the first point") } else { String::new() };
    let reason = match &outcome {
        Ok(_) => where_.trim_start().to_owned(),
        Err(e) if where_.is_empty() => e.to_string(),
        Err(e) => format!("{}: {e}", where_.trim_start()),
    };
    info.ending = Ending { outcome: word.into(), reason };
    let input = ReportInput { info: &info, samples: &samples, facts: &facts, failure: broken.as_ref() };
    let (files, lost) = outputs.write(tape, &input);
    let summary = Summary::of(&info, &samples);
    // A file that is lost is reported even when the run failed, but the run comes first.
    for failure in lost.iter().skip(usize::from(outcome.is_ok())) {
        out.note(format!("jtc: {}", failure.message));
    }
    let of_run = outcome
        .as_ref()
        .err()
        .map(|e| job.named(Failure { message: info.ending.reason.clone(), ..Failure::of(e) }));
    let failure = of_run.or(lost.into_iter().next());
    let error = failure.as_ref().map(Failure::to_json);
    let value = json!({
        "outcome": word,
        "phase": phase,
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": summary.samples,
        "joints": summary.joints,
        "failure": broken,
        "verdict": verdict,
        "upload": upload,
        "link": link,
        "files": files,
        "error": error,
    });
    out.result(&value, || {
        let made: String = files.iter().map(|f| format!("\n{f}")).collect();
        let line = run_report::link_line(&upload, &link);
        format!(
            "\n{word}{where_}: {:.2} s\n{}\n{line}{made}",
            summary.executed_s,
            run_report::verdict(broken.as_ref(), &summary)
        )
    });
    match (outcome, failure) {
        (_, Some(failure)) if out.is_json() => {
            out.note(format!("jtc: {}\n     {}", failure.message, failure.hint));
            Err(Failure::printed(failure.kind))
        }
        (_, Some(failure)) => Err(failure),
        (Ok(Outcome::Stopped(_)), None) => Err(Failure::printed(ErrorKind::Fault)),
        (_, None) => Ok(()),
    }
}

/// The phase that a run begins with where the arm stands elsewhere.
const APPROACH: &str = "approach";

/// One motion of a run, with what was seen of it.
struct Leg {
    phase: &'static str,
    upload: UploadReport,
    info: RecordingInfo,
    tape: Option<Tape>,
    samples: Vec<Sample>,
    outcome: Result<Outcome, Error>,
}

impl Leg {
    /// Uploads and executes. An error before the motion begins is the command's own; one in motion is the outcome.
    fn run(
        session: &mut Session<SerialPort>,
        checked: &CheckedTrajectory,
        phase: &'static str,
        operator: &mut Operator,
        record: &mut impl FnMut(&str, u64) -> Result<(RecordingInfo, Option<Tape>), Failure>,
    ) -> Result<Self, Failure> {
        let warnings: Vec<String> = checked.verdict().warnings().map(ToString::to_string).collect();
        let (points, duration_s) = (checked.trajectory().points.len(), checked.trajectory().duration_s());
        let value =
            json!({ "phase": phase, "duration_s": duration_s, "points": points, "warnings": warnings });
        operator.progress.event("checked", value);
        let upload = upload(session, checked, phase, operator)?;
        operator.progress.event("uploaded", run_report::uploaded(phase, &upload));
        if operator.wants_the_end() {
            return Err(cancelled("upload"));
        }
        let start_unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64);
        let (info, tape) = record(phase, start_unix_ns).map_err(not_started)?;
        let Run { outcome, samples } =
            execute(session, checked, phase, tape.as_ref().map(Tape::sink), operator);
        operator.progress.watch(session);
        Ok(Self { phase, upload, info, tape, samples, outcome })
    }
}

/// The person ended the command before it moved anything; `during` names what went on.
fn cancelled(during: &str) -> Failure {
    let message = format!("cancelled during the {during}; the motion was not started");
    Failure { message, ..Failure::of(&Error::Cancelled) }
}

/// An output cannot be written, and nothing moved yet.
fn not_started(failure: Failure) -> Failure {
    Failure { message: format!("{}; the motion was not started", failure.message), ..failure }
        .hint("make room or name another place, and run again")
}

/// Waits until the controller holds the arm with all drives enabled.
fn ready(session: &mut Session<SerialPort>, operator: &Operator) -> Result<Status, Failure> {
    let mut status = session.fresh_status()?;
    if status.is_coming_up() && status.jtc_init == 0 && status.errors == 0 {
        operator.out.note("waiting until the drives hold the arm");
        status = session.wait_for("HoldPos", BRING_UP, |s| {
            s.state.is_in(&[ControllerState::HoldPos, ControllerState::Error]) || operator.wants_the_end()
        })?;
        if status.state == ControllerState::Error {
            return Err(StateError::Device { status: Box::new(status) }.into());
        }
    }
    if operator.wants_the_end() {
        return Err(cancelled("wait for the drives"));
    }
    if status.state != ControllerState::HoldPos {
        let failure = Failure::new(ErrorKind::Device, "not-ready", words::waiting_for(&status));
        return Err(failure.hint(words::next_step(&status)));
    }
    let absent: Vec<String> = words::absent(&status).iter().map(ToString::to_string).collect();
    if !absent.is_empty() {
        let message =
            format!("{}: set absent; no motion is executed, and nothing was sent", absent.join(", "));
        return Err(Failure::new(ErrorKind::Refused, "absent-joints", message)
            .hint("`jtc bench show` shows them; `jtc jog` moves the joints that are there; `jtc disable`, then `jtc bench present` ends it"));
    }
    if !words::is_held(&status) {
        operator.out.note("waiting until all drives are enabled");
        let reached = |s: &Status| words::is_held(s) || operator.wants_the_end();
        status = session.wait_for("all drives enabled", BRING_UP, reached)?;
        if operator.wants_the_end() {
            return Err(cancelled("wait for the drives"));
        }
    }
    Ok(status)
}

impl Job {
    /// A trajectory of this job, checked for a run from where the arm is.
    fn checked(
        &self,
        trajectory: &Trajectory,
        status: &Status,
        args: &RunArgs,
        upload: UploadOptions,
    ) -> Result<CheckedTrajectory, CheckError> {
        let accept_device_limits = args.accept.accept_device_limits;
        let options = CheckOptions { upload, accept_device_limits, device: self.device.clone() };
        CheckedTrajectory::check(trajectory, &self.arm, &status.positions(), &options)
    }

    /// Prints what forbids to run it.
    fn not_checked(&self, error: CheckError, out: &Output) -> Failure {
        match error {
            CheckError::Refused(verdict) => self.refuse(&verdict, out),
            other => other.into(),
        }
    }
}

fn upload(
    session: &mut Session<SerialPort>,
    checked: &CheckedTrajectory,
    phase: &str,
    operator: &Operator,
) -> Result<UploadReport, Failure> {
    operator.out.note(format!("uploading {} points", checked.trajectory().points.len()));
    let bar = operator.out.bar(1, if phase == APPROACH { APPROACH } else { "upload" });
    let report = session.upload(checked, |p| {
        bar.set_length(p.segments as u64);
        bar.set_position(p.segments_done as u64);
        operator.progress.uploading(phase, p);
        if operator.wants_the_end() { Flow::Cancel } else { Flow::Continue }
    });
    bar.finish_and_clear();
    match report {
        Err(Error::Cancelled) => Err(cancelled("upload")),
        other => Ok(other?),
    }
}

fn execute(
    session: &mut Session<SerialPort>,
    checked: &CheckedTrajectory,
    what: &str,
    sink: Option<SampleSink>,
    operator: &mut Operator,
) -> Run {
    operator.motion_begins();
    let duration_s = checked.trajectory().duration_s();
    operator.progress.event("executing", json!({ "phase": what, "duration_s": duration_s }));
    let bar = operator.out.motion_bar((duration_s * 1e3) as u64, what, operator.keys());
    let record = move |sample: &Sample| {
        if let Some(sink) = &sink {
            sink.write(sample);
        }
    };
    let run = session.run_observed(checked, record, |s| {
        bar.set_position(u64::from(s.point));
        bar.set_message(run_report::motion_line(s));
        operator.progress.see(s);
        operator.wish(s)
    });
    operator.motion_ended();
    bar.finish_and_clear();
    run
}

/// Files of a run, open since before it.
struct Outputs {
    record: Option<OutputFile>,
    report: Option<OutputFile>,
}

impl Outputs {
    fn open(args: &RunArgs) -> Result<Self, Failure> {
        let mut others: Vec<&Path> = vec![&args.file];
        others.extend(args.check.arm.as_deref());
        let force = args.force.force;
        let record = args.record.as_deref().map(|path| OutputFile::open(path, force, &others)).transpose()?;
        others.extend(args.record.as_deref());
        let report = args.report.as_deref().map(|path| OutputFile::open(path, force, &others)).transpose()?;
        Ok(Self { record, report })
    }

    /// Begins the recording, from its start where it was begun before.
    fn begin(&mut self, info: &RecordingInfo, out: &Output) -> Result<Option<Tape>, Failure> {
        self.record.as_mut().map(|file| Tape::begin(file, info, "the motion goes on", out)).transpose()
    }

    /// Completes all of them; one that is lost does not cost the other. Returns the names of those that are whole.
    fn write(self, tape: Option<Tape>, input: &ReportInput<'_>) -> (Vec<String>, Vec<Failure>) {
        let record = tape.map(|tape| (tape.name().to_owned(), tape.finish(&input.info.ending)));
        let report =
            self.report.map(|file| (file.name(), file.write(report::html(input)).map_err(output_lost)));
        let (mut files, mut lost) = (Vec::new(), Vec::new());
        for (name, done) in record.into_iter().chain(report) {
            match done {
                Ok(()) => files.push(name),
                Err(e) => lost.push(e),
            }
        }
        (files, lost)
    }
}
