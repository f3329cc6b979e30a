//! One motion of a run: uploaded, executed and followed.

use std::time::Duration;

use cli_kit::Failure;
use jtc_host::recording::{RecordingInfo, SampleSink};
use jtc_host::session::{Flow, Outcome, Run, UploadReport};
use jtc_host::{CheckedTrajectory, Error, Sample, Session};
use serde_json::json;

use super::super::run_report;
use crate::link::LinkPort;
use crate::operator::Operator;
use crate::tape::Tape;

/// The phase that a run begins with where the arm stands elsewhere.
pub const APPROACH: &str = "approach";

/// One motion of a run, with what was seen of it.
pub struct Leg {
    pub phase: &'static str,
    pub upload: UploadReport,
    /// Oldest first, on the clock of the whole run.
    pub samples: Vec<Sample>,
    pub outcome: Result<Outcome, Error>,
}

/// What is recorded of the motions of a run.
pub struct Reel {
    pub info: RecordingInfo,
    pub tape: Option<Tape>,
    /// When its first motion began, on the clock of the session.
    pub start: Duration,
    /// Just behind its last sample, s. The next motion's come behind it also where the controller's time runs ahead of ours, as that of a
    /// simulator does that is faster than time.
    pub until_s: f64,
}

impl Reel {
    /// One whose first motion begins at this time of the session.
    pub fn of(info: RecordingInfo, tape: Option<Tape>, start: Duration) -> Self {
        Self { info, tape, start, until_s: 0.0 }
    }
}

impl Leg {
    /// Uploads and executes. `record` begins the recording of this motion or goes on with the one that was begun. An error before the
    /// motion begins is the command's own; one in motion is the outcome.
    pub fn run(
        session: &mut Session<LinkPort>,
        checked: &CheckedTrajectory,
        phase: &'static str,
        operator: &mut Operator,
        record: &mut impl FnMut(&str, u64, Duration) -> Result<(Option<SampleSink>, f64), Failure>,
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
        let start_unix_ns = host_kit::unix_time().as_nanos() as u64;
        let (sink, offset_s) = record(phase, start_unix_ns, session.now()).map_err(not_started)?;
        let Run { outcome, mut samples } = execute(session, checked, phase, (sink, offset_s), operator);
        samples.iter_mut().for_each(|sample| sample.time_s += offset_s);
        operator.progress.watch(session);
        Ok(Self { phase, upload, samples, outcome })
    }

    /// It came to its end.
    pub fn is_finished(&self) -> bool {
        matches!(self.outcome, Ok(Outcome::Finished(_)))
    }
}

/// The person ended the command before it moved anything; `during` names what went on.
pub fn cancelled(during: &str) -> Failure {
    let message = format!("cancelled during the {during}; the motion was not started");
    Failure { message, ..Failure::of(&Error::Cancelled) }
}

/// An output cannot be written, and nothing moved yet.
fn not_started(failure: Failure) -> Failure {
    Failure { message: format!("{}; the motion was not started", failure.message), ..failure }
        .hint("make room or name another place, and run again")
}

fn upload(
    session: &mut Session<LinkPort>,
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
    session: &mut Session<LinkPort>,
    checked: &CheckedTrajectory,
    what: &str,
    (sink, offset_s): (Option<SampleSink>, f64),
    operator: &mut Operator,
) -> Run {
    operator.motion_begins();
    let out = operator.out;
    let duration_s = checked.trajectory().duration_s();
    operator.progress.event("executing", json!({ "phase": what, "duration_s": duration_s }));
    let bar = operator.out.motion_bar((duration_s * 1e3) as u64, what, operator.keys());
    let record = move |sample: &Sample| {
        if let Some(sink) = &sink {
            sink.write(&Sample { time_s: sample.time_s + offset_s, ..*sample });
        }
    };
    let run = session.run_observed(
        checked,
        record,
        |s| {
            bar.set_position(u64::from(s.point));
            bar.set_message(run_report::motion_line(s));
            operator.progress.see(s);
            operator.wish(s)
        },
        |_, did| {
            if let Err(error) = did {
                out.note(format!("jtc: {error}"));
            }
        },
    );
    operator.motion_ended();
    bar.finish_and_clear();
    run
}
