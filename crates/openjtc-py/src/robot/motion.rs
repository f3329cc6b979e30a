//! Execution of a motion (a run) that a Python program requested: progress, samples, and requests during the run.

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use jtc_host::plan::MoveSpeed;
use jtc_host::recording::{Ending, RecordingInfo};
use jtc_host::report::RunFailure;
use jtc_host::run::{self as runner, Ended, Leg, Observer, Phase, SampleReceiver, StartError};
use jtc_host::session::{self, Flow, LinkStatistics, Outcome, UploadReport};
use jtc_host::trajectory::Trajectory;
use jtc_host::{
    Arm, CheckOptions, CheckedTrajectory, Error, LinkError, MotionError, Port as _, PortError, Sample,
    Session,
};
use jtc_wire::{Status, TrajectoryState};

pub(crate) use jtc_host::run::Course;

use super::port::AnyPort;
use super::recording::Recording;
use super::shared::{Asked, Progress, Shared};
use super::tape::Tape;
use super::worker_state::{WorkerState, observe};
use crate::error::Failure;
use crate::threads::lock;

/// Order for a run: the motion and its options.
pub(crate) struct Order {
    pub course: Course,
    /// Name of the motion in recordings.
    pub name: String,
    /// `true` to move the arm to the first point if the arm is at another position.
    pub approach: bool,
    /// Speed in % of the speed of the trajectory. For a move or an approach, speed in % of the limits. `None` selects
    /// the original speed of the trajectory, or the default speed of a move or an approach.
    pub speed: Option<f64>,
    /// Number of times that the trajectory is executed.
    pub repeat: u32,
    /// `true` if the caller confirms that the limits, gravity and rotor inertia in the controller are safe for the
    /// arm, although they can differ from the values of the arm.
    pub accept_device_limits: bool,
    /// Path of a recording. The second field is `true` if an existing recording must be overwritten.
    pub record: Option<(PathBuf, bool)>,
    /// Progress of the run, which other threads can read.
    pub progress: Arc<Mutex<Progress>>,
}

/// Result of a run.
pub(crate) struct Ran {
    /// `true` if Execute was sent to the controller.
    moved: bool,
    /// Outcome of the run: "finished" or "stopped", or "fault" if there is a failure.
    pub outcome: &'static str,
    pub failure: Option<Failure>,
    pub broken: Option<RunFailure>,
    pub info: RecordingInfo,
    /// Samples of the motion, without the approach.
    pub samples: Vec<Sample>,
    pub upload: Option<UploadReport>,
    pub link: LinkStatistics,
    pub baud: Option<u32>,
    pub notes: Vec<String>,
}

impl Order {
    fn report(&self, phase: &'static str, done: f64, total: f64) {
        *lock(&self.progress) = Progress { phase, done, total };
    }
}

impl WorkerState {
    /// Executes an order. An error before the motion is returned as an error. An error during or after the motion is part of the
    /// returned result.
    pub(crate) fn run(&mut self, order: &Order, asked: &Asked) -> Result<Ran, Failure> {
        let recording = order.record.as_ref();
        let mut recording =
            recording.map(|(path, overwrite)| Recording::open(path, *overwrite)).transpose()?;
        let ran = self.run_recorded(order, asked, recording.as_mut());
        match recording {
            Some(recording) => recording.end(ran),
            None => ran,
        }
    }

    fn run_recorded(
        &mut self,
        order: &Order,
        asked: &Asked,
        recording: Option<&mut Recording>,
    ) -> Result<Ran, Failure> {
        self.session.ask_to_move()?;
        let waits = |_| order.report("waiting", 0.0, 0.0);
        let status = self.session.ready_to_move(waits, || asked.is_halted())?;
        let arm = self.arm_to_move()?;
        let options = CheckOptions {
            accept_device_limits: order.accept_device_limits,
            device: self.session.device_config()?,
            ..CheckOptions::default()
        };
        let move_speed = self.session.move_speed(order.speed)?;
        let (trajectory, mut notes) = trajectory(order, &arm, &options, &status, move_speed)?;
        let speed = options.device.speed;
        *lock(&self.shared.speed) = Some(speed);
        if speed != 1.0 {
            notes.push(format!(
                "the controller ran the motion at {speed} of its speed, which was set earlier; set \
                 `robot.speed = 1` for the full speed"
            ));
        }
        let mut info = RecordingInfo {
            source: self.session.port().name(),
            trajectory: order.name.clone(),
            start_unix_ns: host_kit::unix_time().as_nanos() as u64,
            commanded: Some(Arc::clone(&trajectory)),
            runs: Some(order.repeat),
            ..RecordingInfo::of(&arm)
        };
        if self.session.port().is_simulated() {
            info.start_unix_ns = 0;
        }
        drop(self.tape.take());
        let mut ran = Ran {
            moved: false,
            outcome: "finished",
            failure: None,
            broken: None,
            info,
            samples: Vec::new(),
            upload: None,
            link: LinkStatistics::default(),
            baud: self.session.port().baud(),
            notes,
        };
        let runs = runner::Order {
            arm: &arm,
            options: &options,
            trajectory: &trajectory,
            later: &trajectory,
            runs: order.repeat,
            approach_pct: order.approach.then_some(move_speed.percent),
        };
        let mut follower = Follower {
            order,
            asked,
            ran: &mut ran,
            recording,
            move_speed,
            shared: Arc::clone(&self.shared),
            tape: Rc::clone(&self.tape),
            duration_s: 0.0,
            upload: None,
            waits: None,
        };
        let ended = runner::run(&mut self.session, &runs, &status, &mut follower);
        self.tape.pause();
        match ended {
            Err(failure) if !ran.moved => return Err(failure),
            // A Stop between two motions is not a failure of the run.
            Err(_) if asked.is_halted() && ran.outcome == "finished" => ran.outcome = "stopped",
            Err(failure) => (ran.outcome, ran.failure) = ("fault", Some(failure)),
            Ok(Ended { cut: true, .. }) => ran.outcome = "stopped",
            Ok(_) => {}
        }
        ran.link = self.session.statistics();
        ran.samples = self.tape.take();
        ran.info.ending = Ending {
            outcome: ran.outcome.into(),
            reason: ran.failure.as_ref().map(|failure| failure.message.clone()).unwrap_or_default(),
            ..Ending::default()
        };
        Ok(ran)
    }
}

/// Observer of a run that a Python program requested.
struct Follower<'a> {
    order: &'a Order,
    asked: &'a Asked,
    ran: &'a mut Ran,
    recording: Option<&'a mut Recording>,
    /// Speed of an approach.
    move_speed: MoveSpeed,
    shared: Arc<Shared>,
    tape: Rc<Tape>,
    /// Duration of the motion, s.
    duration_s: f64,
    /// Upload report of the motion.
    upload: Option<UploadReport>,
    /// Channel to a Python thread that waits for the result of its request.
    waits: Option<Sender<Result<(), Failure>>>,
}

impl Observer<AnyPort> for Follower<'_> {
    type Failure = Failure;

    fn refused(&mut self, error: StartError) -> Failure {
        not_begun(&error)
    }

    fn failed(&mut self, error: Error) -> Failure {
        // Every error after a Stop is treated as a result of the Stop.
        if self.asked.is_halted() { Error::Cancelled.into() } else { error.into() }
    }

    fn is_cancelled(&mut self) -> bool {
        self.asked.is_halted()
    }

    fn checked(&mut self, phase: Phase, checked: &CheckedTrajectory) {
        self.duration_s = checked.trajectory().duration_s();
        let note = of_speed("approach", self.move_speed).filter(|_| phase == Phase::Approach);
        let new = note.filter(|note| !self.ran.notes.contains(note));
        self.ran.notes.extend(new);
    }

    fn uploading(&mut self, _: Phase, progress: &session::Progress) {
        self.order.report("upload", progress.segments_done as f64, progress.segments as f64);
    }

    fn uploaded(&mut self, _: Phase, upload: &UploadReport) {
        self.upload = Some(*upload);
    }

    fn begins(
        &mut self,
        session: &mut Session<AnyPort>,
        phase: Phase,
        _: &CheckedTrajectory,
    ) -> Result<SampleReceiver, Failure> {
        self.ran.upload = self.upload;
        if phase == Phase::Motion {
            let sink = self.recording.as_mut().map(|recording| recording.sink(&self.ran.info)).transpose()?;
            self.tape.record(sink.flatten());
        }
        let (simulated, tape) = (session.port().is_simulated(), Rc::clone(&self.tape));
        Ok(Box::new(move |sample| {
            // A simulator itself records a sample in each millisecond, so only samples of a real controller are
            // recorded here.
            if !simulated {
                tape.push(sample);
            }
        }))
    }

    fn status(&mut self, phase: Phase, status: &Status) -> Flow {
        self.shared.publish(status);
        self.order.report(phase.name(), f64::from(status.point) * 1e-3, self.duration_s);
        if self.asked.is_halted() {
            return Flow::Stop;
        }
        let wish = lock(&self.shared.wishes).pop_front();
        wish.map_or(Flow::Continue, |wish| {
            self.waits = Some(wish.done);
            wish.flow
        })
    }

    fn applied(&mut self, flow: Flow, result: &Result<(), Error>) {
        if let (Flow::Speed(percent), Ok(())) = (flow, result) {
            *lock(&self.shared.speed) = Some(f64::from(percent) / 100.0);
        }
        if let Some(waits) = self.waits.take() {
            let came = result.as_ref().copied().map_err(Failure::of);
            // An error is ignored, because the waiting thread has perhaps stopped waiting for the result.
            let _ = waits.send(came);
        }
    }

    fn ended(&mut self, session: &mut Session<AnyPort>, leg: &Leg) -> Result<(), Failure> {
        observe(session, &self.shared);
        self.tape.pause();
        // A request that arrived with the last status is too late and has no effect. The waiting thread detects the
        // end of the motion when `waits` is dropped.
        self.waits = None;
        if let Err(Error::Link(LinkError::Port(PortError::Halted { .. }))) = leg.outcome {
            // A Stop prevented the start of the motion.
            self.shared.set_moves(false);
            return Err(Error::Cancelled.into());
        }
        self.ran.moved = true;
        self.shared.set_moves(leg.outcome.as_ref().is_err_and(|error| may_move(session, error)));
        match &leg.outcome {
            Ok(Outcome::Finished(_)) => {}
            Ok(Outcome::Stopped(_)) => {
                self.ran.outcome = "stopped";
                if !self.asked.is_halted() {
                    // Another program has stopped the arm. Waiting requests of this program were made before that
                    // Stop, so they are discarded.
                    self.shared.halt();
                }
            }
            Err(error) => self.broke(error),
        }
        Ok(())
    }
}

impl Follower<'_> {
    /// Records that the motion has ended with an error.
    fn broke(&mut self, error: &Error) {
        self.ran.outcome = "fault";
        let samples = self.tape.take();
        let broken = RunFailure::of(error, &self.ran.info, &samples);
        samples.iter().for_each(|sample| self.tape.keep(sample));
        let mut failure = Failure::of(error);
        failure.facts.joint = failure.facts.joint.or(broken.joint.map(|joint| joint.number()));
        (self.ran.failure, self.ran.broken) = (Some(failure), Some(broken));
    }
}

/// Returns `true` if the arm possibly still moves after this error. The arm is then on its path, or it is paused and
/// another program can resume the motion.
fn may_move(session: &Session<AnyPort>, error: &Error) -> bool {
    let goes_on = [TrajectoryState::Execute, TrajectoryState::Pause];
    matches!(error, Error::Motion(MotionError::LinkLost { .. }))
        || session.last().is_some_and(|status| status.trajectory.is_in(&goes_on))
}

/// Returns the failure of a run that did not start.
fn not_begun(error: &StartError) -> Failure {
    let failure = Failure::of(error);
    match error {
        StartError::Check(_) => failure,
        StartError::Elsewhere(_) => failure.next("pass approach=True to move the arm to the first point"),
        StartError::Approach(_) => failure
            .next("nothing moved: bring the arm nearer to the first point, by hand or with another motion"),
        StartError::Open(_) => {
            failure.next("pass approach=True to move the arm back to the first point before each run")
        }
    }
}

/// Returns the trajectory of an order, and the notes of the planner.
fn trajectory(
    order: &Order,
    arm: &Arm,
    options: &CheckOptions,
    status: &Status,
    move_speed: MoveSpeed,
) -> Result<(Arc<Trajectory>, Vec<String>), Failure> {
    let speed = (move_speed, "`speed=`");
    let planned = order.course.planned(arm, &options.device, &status.positions(), order.speed, speed);
    let planned = planned.map_err(|error| Failure::of(&error).message(order.course.message(&error)))?;
    Ok((planned.trajectory, planned.notes))
}

/// Returns a default speed as text for a note.
fn of_speed(what: &str, speed: MoveSpeed) -> Option<String> {
    speed.note("`speed=`").map(|words| format!("{what} {words}"))
}
