//! A run at the terminal, with progress bars, keys, JSON events and the recording.

use std::cell::RefCell;
use std::mem::take;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use cli_kit::{Failure, ProgressBar};
use jtc_host::plan::MoveSpeed;
use jtc_host::port::Port as _;
use jtc_host::recording::{RecordingInfo, SampleSink};
use jtc_host::report::Summary;
use jtc_host::run::{Leg, Observer, Order, Phase, SampleReceiver, StartError};
use jtc_host::session::{Flow, Progress, UploadReport};
use jtc_host::{CheckError, CheckedTrajectory, Error, Sample, Session};
use jtc_wire::Status;
use serde_json::json;

use super::super::job::Job;
use super::super::run_report;
use super::conclude::{Done, Finished};
use super::outputs::Outputs;
use super::{Course, approach, open_path};
use crate::link::LinkPort;
use crate::operator::Operator;
use crate::tape::Tape;

/// Recording of a run, with its start time.
pub(super) struct Reel {
    pub info: RecordingInfo,
    pub tape: Option<Tape>,
    /// Start of the first motion in the recording, on the clock of the session.
    start: Duration,
    /// Earliest time that the next sample may have, s; directly after the last sample. Without this limit, times
    /// could decrease between two motions, because the clock of a fast simulator runs ahead of the clock of the
    /// computer.
    until_s: f64,
}

impl Reel {
    fn new(info: RecordingInfo, tape: Option<Tape>, start: Duration) -> Self {
        Self { info, tape, start, until_s: 0.0 }
    }
}

/// Recording and results of a run.
pub(super) struct Taken {
    /// Motions that ended before the last motion.
    pub done: Finished,
    /// Samples of the last motion, oldest first, on the clock of the complete run.
    pub samples: Vec<Sample>,
    pub reel: Reel,
    pub outputs: Outputs,
}

/// Terminal of a command that executes motions.
pub(super) struct Terminal<'a, 'o> {
    course: &'a Course,
    job: &'a Job,
    order: &'a Order<'a>,
    /// Speed of an approach to the first point.
    move_speed: MoveSpeed,
    outputs: Outputs,
    operator: &'a mut Operator<'o>,
    /// Recording of the run, which begins with the first motion.
    reel: Option<Reel>,
    done: Finished,
    /// Progress bar of the upload or of the present motion.
    bar: Option<ProgressBar>,
    /// Samples of the present motion. The clock of these samples starts `offset_s` after the clock of the run.
    samples: Rc<RefCell<Vec<Sample>>>,
    offset_s: f64,
    /// Samples of the motion that has ended.
    last: Vec<Sample>,
    /// Number of runs that have finished.
    runs: u32,
}

impl<'a, 'o> Terminal<'a, 'o> {
    pub(super) fn new(
        course: &'a Course,
        job: &'a Job,
        order: &'a Order<'a>,
        move_speed: MoveSpeed,
        outputs: Outputs,
        operator: &'a mut Operator<'o>,
    ) -> Self {
        Self {
            course,
            job,
            order,
            move_speed,
            outputs,
            operator,
            reel: None,
            done: Finished::default(),
            bar: None,
            samples: Rc::default(),
            offset_s: 0.0,
            last: Vec::new(),
            runs: 0,
        }
    }

    /// Returns the recording and the results of the run.
    pub(super) fn taken(self) -> Taken {
        let Self { job, outputs, reel, done, last: samples, .. } = self;
        // If the run ended before its first motion, the recording has not begun. The result then contains a recording
        // without samples.
        let reel = reel.unwrap_or_else(|| Reel::new(RecordingInfo::of(&job.arm), None, Duration::ZERO));
        Taken { done, samples, reel, outputs }
    }

    /// Begins the recording at the first motion of the run. Returns the sink for the samples of the motion.
    fn record(&mut self, phase: Phase, source: String, now: Duration) -> Result<Option<SampleSink>, Failure> {
        let reel = match &mut self.reel {
            Some(reel) => reel,
            empty => {
                let Course { name, .. } = self.course;
                let name = if phase == Phase::Approach { format!("{name}, approach") } else { name.clone() };
                let start_unix_ns = host_kit::unix_time().as_nanos() as u64;
                let mut info = run_report::info(&self.job.arm, &source, &name, start_unix_ns);
                info.commanded = Some(Arc::new(self.order.trajectory.clone()));
                info.runs = Some(self.order.runs);
                if let Some((device, hash)) = &self.job.identity {
                    (info.device, info.hash) = (Some(device.clone()), Some(*hash));
                }
                info.then = self.job.later.as_ref().map(|(later, _)| Arc::new(later.clone()));
                let tape = self.outputs.begin(&info, self.operator.out)?;
                empty.insert(Reel::new(info, tape, now))
            }
        };
        self.offset_s = now.saturating_sub(reel.start).as_secs_f64().max(reel.until_s);
        Ok(reel.tape.as_ref().map(Tape::sink))
    }

    /// Stores the results of the motion that has ended. The samples of this motion are already in the recording.
    fn keep_figures(&mut self, phase: Phase) {
        let Some(reel) = &self.reel else { return };
        self.done.push(Done { phase, summary: Summary::of(&reel.info, &self.last) });
    }

    /// Returns the failure of a motion that did not pass the trajectory check.
    fn not_checked(&self, error: CheckError) -> Failure {
        match error {
            CheckError::Refused(verdict) => self.job.refuse(&verdict, self.operator.out),
            other => other.into(),
        }
    }
}

impl Observer<LinkPort> for Terminal<'_, '_> {
    type Failure = Failure;

    fn refused(&mut self, error: StartError) -> Failure {
        match error {
            StartError::Check(error) | StartError::Elsewhere(error) => self.not_checked(error),
            StartError::Approach(error) => approach::not_possible(error, self.course, self.operator.out),
            StartError::Open(open) => open_path(&open, self.course),
        }
    }

    fn failed(&mut self, error: Error) -> Failure {
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
        match error {
            Error::Cancelled => cancelled("upload"),
            other => other.into(),
        }
    }

    fn is_cancelled(&mut self) -> bool {
        self.operator.wants_the_end()
    }

    fn checked(&mut self, phase: Phase, checked: &CheckedTrajectory) {
        let (points, duration_s) = (checked.trajectory().points.len(), checked.trajectory().duration_s());
        let out = self.operator.out;
        if phase == Phase::Approach {
            approach::note(duration_s, self.course, self.move_speed, out);
        }
        let warnings: Vec<String> = checked.verdict().warnings().map(ToString::to_string).collect();
        let value = json!({
            "phase": phase.name(), "duration_s": duration_s, "points": points, "warnings": warnings,
        });
        self.operator.progress.event("checked", value);
        out.note(format!("uploading {points} points"));
        let what = if phase == Phase::Approach { phase.name() } else { "upload" };
        self.bar = Some(out.bar(1, what));
    }

    fn uploading(&mut self, phase: Phase, progress: &Progress) {
        if let Some(bar) = &self.bar {
            bar.set_length(progress.segments as u64);
            bar.set_position(progress.segments_done as u64);
        }
        self.operator.progress.uploading(phase.name(), progress);
    }

    fn uploaded(&mut self, phase: Phase, upload: &UploadReport) {
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
        self.operator.progress.event("uploaded", run_report::uploaded(phase.name(), upload));
    }

    fn begins(
        &mut self,
        session: &mut Session<LinkPort>,
        phase: Phase,
        checked: &CheckedTrajectory,
    ) -> Result<SampleReceiver, Failure> {
        let sink = self.record(phase, session.port().name(), session.now()).map_err(not_started)?;
        let operator = &mut *self.operator;
        operator.motion_begins();
        let duration_s = checked.trajectory().duration_s();
        operator.progress.event("executing", json!({ "phase": phase.name(), "duration_s": duration_s }));
        self.bar = Some(operator.out.motion_bar((duration_s * 1e3) as u64, phase.name(), operator.keys()));
        let (samples, offset_s) = (Rc::clone(&self.samples), self.offset_s);
        Ok(Box::new(move |sample| {
            let sample = Sample { time_s: sample.time_s + offset_s, ..*sample };
            if let Some(sink) = &sink {
                sink.write(&sample);
            }
            samples.borrow_mut().push(sample);
        }))
    }

    fn status(&mut self, _: Phase, status: &Status) -> Flow {
        if let Some(bar) = &self.bar {
            bar.set_position(u64::from(status.point));
            bar.set_message(run_report::motion_line(status));
        }
        self.operator.progress.see(status);
        self.operator.wish(status)
    }

    fn applied(&mut self, _: Flow, result: &Result<(), Error>) {
        if let Err(error) = result {
            self.operator.out.note(format!("jtc: {error}"));
        }
    }

    fn ended(&mut self, session: &mut Session<LinkPort>, leg: &Leg) -> Result<(), Failure> {
        self.operator.motion_ended();
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
        self.operator.progress.watch(session);
        self.last = self.samples.take();
        if let (Some(reel), Some(last)) = (&mut self.reel, self.last.last()) {
            reel.until_s = last.time_s + 1e-6;
        }
        if leg.phase == Phase::Approach && leg.is_finished() {
            self.keep_figures(leg.phase);
            // The recording must contain only the runs, not the approach. Therefore the command discards the
            // recording of the approach before the first run.
            if self.runs == 0
                && let Some(tape) = take(&mut self.reel).and_then(|reel| reel.tape)
            {
                tape.abandon();
            }
        }
        Ok(())
    }

    fn goes_on(&mut self, n: u32) {
        self.operator.out.note(format!("run {n} of {} finished", self.order.runs));
        self.keep_figures(Phase::Motion);
        self.runs = n;
    }
}

/// Returns the failure if the user ended the command before the arm moved. `during` is the name of the current step.
pub(super) fn cancelled(during: &str) -> Failure {
    let message = format!("cancelled during the {during}; the motion was not started");
    Failure { message, ..Failure::of(&Error::Cancelled) }
}

/// Returns the failure if the command cannot write an output file and the arm has not moved yet.
fn not_started(failure: Failure) -> Failure {
    Failure { message: format!("{}; the motion was not started", failure.message), ..failure }
        .next("free disk space or choose another place, then run again")
}
