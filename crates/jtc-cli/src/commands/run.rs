//! `jtc traj run`: check, upload, execute, follow, report.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use cli_kit::{Output, Stop};
use jtc_host::check::ProblemKind;
use jtc_host::port::{Port, SerialPort};
use jtc_host::recording::{self, Format, RecordingInfo};
use jtc_host::report::{self, ReportInput, Summary};
use jtc_host::session::{Flow, Outcome, UploadOptions, UploadReport};
use jtc_host::trajectory::Trajectory;
use jtc_host::{Sample, Session, plan, words};
use jtc_wire::Status;
use serde_json::json;

use super::run_report;
use super::traj::{Job, refuse};
use crate::args::RunArgs;
use crate::failure::{FAULT, Failure, REFUSED};

/// Drives take 4 s for their first enable.
const BRING_UP: Duration = Duration::from_secs(15);

/// Samples that an observer collects while the session goes on.
type Samples = Rc<RefCell<Vec<Sample>>>;

/// Runs a trajectory from a file.
pub fn run(args: &RunArgs, out: &Output) -> Result<(), Failure> {
    if let Some(path) = &args.record {
        Format::of(path)?; // a wrong ending is said before anything moves
    }
    let job = Job::load(&args.file, &args.check, out)?;
    let options = UploadOptions { points_per_segment: args.points_per_segment, number: 0 };
    let verdict = job.verdict(&job.trajectory, None, options);
    if !verdict.is_ok() {
        return Err(refuse(&verdict, out));
    }
    for warning in verdict.warnings() {
        out.note(format!("warning: {warning}"));
    }

    let stop = Stop::listen()?;
    let mut session = args.link.session()?;
    let status = ready(&mut session, out)?;
    let here = status.joints.map(|j| f64::from(j.position));
    let verdict = job.verdict(&job.trajectory, Some(here), options);
    if verdict.problems.iter().any(|p| p.kind == ProblemKind::StartPose) {
        if !args.approach {
            return Err(refuse(&verdict, out));
        }
        approach(&mut session, &job, here, args, &stop, out)?;
    }

    let upload = upload(&mut session, &job.trajectory, &options, "upload", &stop, out)?;
    let start_unix_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64);
    let samples = observe(&mut session, &job.trajectory);
    let outcome = execute(&mut session, &job.trajectory, "motion", &stop, out);
    session.stop_observing();

    let link = session.statistics();
    let name = args.file.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let info = run_report::info(&job.arm, &session.port().name(), &name, start_unix_ns);
    let samples = samples.take();
    // A run that ended in a fault is what one wants to look at most: it is recorded and reported as well.
    let files =
        write(args, &info, &samples, &[run_report::link_facts(&upload, &link, session.port().baud())])?;
    let summary = Summary::of(&info, &samples);
    let word = match &outcome {
        Ok(Outcome::Finished(_)) => "finished",
        Ok(Outcome::Stopped(_)) => "stopped",
        Err(_) => "fault",
    };
    let value = json!({
        "outcome": word,
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": summary.samples,
        "joints": summary.joints,
        "verdict": verdict,
        "upload": upload,
        "link": link,
        "files": files,
        "error": outcome.as_ref().err().map(|e| json!({ "code": e.code(), "message": e.to_string(), "hint": e.hint() })),
    });
    out.result(&value, || {
        let made: String = files.iter().map(|f| format!("\n{f}")).collect();
        let line = run_report::link_line(&upload, &link);
        format!("\n{word}: {:.2} s\n{}\n{line}{made}", summary.executed_s, run_report::figures(&summary))
    });
    match outcome {
        Ok(Outcome::Finished(_)) => Ok(()),
        Ok(Outcome::Stopped(_)) => Err(Failure::printed(FAULT)),
        Err(e) if out.is_json() => {
            out.note(format!("jtc: {e}\n     {}", e.hint()));
            Err(Failure::printed(e.exit_code()))
        }
        Err(e) => Err(e.into()),
    }
}

/// Waits until the controller holds the arm with all drives enabled.
fn ready(session: &mut Session<SerialPort>, out: &Output) -> Result<Status, Failure> {
    let mut status = session.fresh_status()?;
    if status.fsm <= 1 && status.jtc_init == 0 && status.errors == 0 {
        out.note("waiting until the drives hold the arm");
        status = session.wait_hold(BRING_UP)?;
    }
    if status.fsm != 2 {
        let failure =
            Failure { exit: 1, code: "not-ready".into(), ..Failure::usage(words::waiting_for(&status)) };
        return Err(failure.hint(words::next_step(&status)));
    }
    if status.joints.iter().any(|j| j.fsm != 3) {
        status = session.wait_for("all drives enabled", BRING_UP, |s| s.joints.iter().all(|j| j.fsm == 3))?;
    }
    Ok(status)
}

/// Moves the arm to the first point.
fn approach(
    session: &mut Session<SerialPort>,
    job: &Job,
    here: [f64; 6],
    args: &RunArgs,
    stop: &Stop,
    out: &Output,
) -> Result<(), Failure> {
    let refused =
        |e: plan::PlanError| Failure { exit: REFUSED, code: "approach".into(), ..Failure::usage(e) };
    let first = job.trajectory.points.first().map_or(here, |p| p.position);
    let config = job.arm.config();
    // Half of the limits: nobody has looked at this path for obstacles.
    let speed = args.check.speed.min(50.0);
    let path = plan::approach(&here, &first, &config, Some(&job.arm.model), speed).map_err(refused)?;
    let verdict = job.verdict(&path, Some(here), UploadOptions::default());
    if !verdict.is_ok() {
        return Err(refuse(&verdict, out));
    }
    out.note(format!("approach: {:.1} s to the first point", path.duration_s()));
    upload(session, &path, &UploadOptions::default(), "approach", stop, out)?;
    match execute(session, &path, "approach", stop, out)? {
        Outcome::Finished(_) => Ok(()),
        Outcome::Stopped(_) => {
            Err(Failure { exit: FAULT, code: "stopped".into(), ..Failure::usage("stopped on the approach") })
        }
    }
}

fn upload(
    session: &mut Session<SerialPort>,
    trajectory: &Trajectory,
    options: &UploadOptions,
    what: &str,
    stop: &Stop,
    out: &Output,
) -> Result<UploadReport, Failure> {
    let points = trajectory.raw().map_err(Failure::usage)?;
    let bar = out.bar(1, what);
    let report = session.upload(&points, trajectory.step_ms, options, |p| {
        bar.set_length(p.segments as u64);
        bar.set_position(p.segments_done as u64);
        if stop.asked() { Flow::Cancel } else { Flow::Continue }
    });
    bar.finish_and_clear();
    Ok(report?)
}

fn execute(
    session: &mut Session<SerialPort>,
    trajectory: &Trajectory,
    what: &str,
    stop: &Stop,
    out: &Output,
) -> Result<Outcome, jtc_host::Error> {
    let bar = out.bar((trajectory.duration_s() * 1e3) as u64, what);
    session.execute()?;
    let outcome = session.follow(|s| {
        bar.set_position(u64::from(s.point));
        if stop.asked() { Flow::Stop } else { Flow::Continue }
    });
    bar.finish_and_clear();
    outcome
}

/// Collects what each status carries; the commanded values come from the trajectory at the status' point index.
fn observe(session: &mut Session<SerialPort>, trajectory: &Trajectory) -> Samples {
    let samples = Samples::default();
    let (taken, trajectory) = (Rc::clone(&samples), trajectory.clone());
    let mut clock = Clock { arrived: session.now(), point: 0, time_s: 0.0 };
    session.observe(move |now, status| {
        let mut sample = Sample::from_status(clock.at(now, status), status);
        if status.fsm == 3
            && let Some(set) = trajectory.at_ms(status.point)
        {
            for (j, joint) in sample.joints.iter_mut().enumerate() {
                joint.set_position = set.position[j];
                joint.set_velocity = set.velocity[j];
                joint.set_acceleration = set.acceleration[j];
            }
        }
        taken.borrow_mut().push(sample);
    });
    samples
}

/// Time of statuses: the controller's own milliseconds while it follows the path, which no delay on the way to us can blur; the time of
/// arrival otherwise.
struct Clock {
    arrived: Duration,
    point: u32,
    time_s: f64,
}

impl Clock {
    fn at(&mut self, now: Duration, status: &Status) -> f64 {
        let moved = f64::from(status.point.saturating_sub(self.point)) * 1e-3;
        let waited = now.saturating_sub(self.arrived).as_secs_f64();
        self.time_s += if moved > 0.0 { moved } else { waited };
        (self.arrived, self.point) = (now, status.point);
        self.time_s
    }
}

fn write(
    args: &RunArgs,
    info: &RecordingInfo,
    samples: &[Sample],
    facts: &[report::Facts],
) -> Result<Vec<String>, Failure> {
    let mut files = Vec::new();
    if let Some(path) = &args.record {
        recording::write_all(path, info, samples)?;
        files.push(path.display().to_string());
    }
    if let Some(path) = &args.report {
        let page = report::html(&ReportInput { info, samples, facts });
        std::fs::write(path, page).map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
        files.push(path.display().to_string());
    }
    Ok(files)
}
