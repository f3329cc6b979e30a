//! A motion from the wish to the figures: ready, checked, uploaded, executed, followed.

use std::cell::Cell;
use std::fs::OpenOptions;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use jtc_host::check::ProblemKind;
use jtc_host::error::Facts;
use jtc_host::plan::kinematics::Target;
use jtc_host::plan::{self, ApproachError, Planner};
use jtc_host::recording::{Ending, Format, LiveRecorder, RecordingInfo};
use jtc_host::report::RunFailure;
use jtc_host::session::{Flow, LinkStatistics, Outcome, UploadReport};
use jtc_host::trajectory::Trajectory;
use jtc_host::{Arm, CheckError, CheckOptions, CheckedTrajectory, Error, MotionError, Port as _, Sample};
use jtc_wire::Status;

use super::machine::{AnyPort, Machine};
use super::worker::{Asked, lock};
use crate::error::Failure;

/// Where a motion leads.
pub enum Course {
    /// Along a trajectory.
    Along(Arc<Trajectory>),
    /// From where the arm stands to this place; `line`: with the flange on a straight line.
    To { target: Target, line: bool },
}

/// What is run, and how.
pub struct Order {
    pub course: Course,
    /// As recordings name it.
    pub name: String,
    /// Where the arm stands elsewhere it is moved to the first point.
    pub approach: bool,
    /// % of the trajectory's own speed, or of what the limits allow.
    pub speed: f64,
    /// How often.
    pub repeat: u32,
    /// The controller's limits, gravity and rotor inertia differ from the arm's, and are safe for it.
    pub accept_device_limits: bool,
    /// A recording, and whether one that is there is written over.
    pub record: Option<(PathBuf, bool)>,
}

/// What came of it.
pub struct Ran {
    /// "finished" or "stopped"; "fault" where there is a failure.
    pub outcome: &'static str,
    pub failure: Option<Failure>,
    pub broken: Option<RunFailure>,
    pub info: RecordingInfo,
    /// Of the motion, without an approach to it.
    pub samples: Vec<Sample>,
    pub upload: Option<UploadReport>,
    pub link: LinkStatistics,
    pub baud: Option<u32>,
    pub notes: Vec<String>,
}

/// A file that is written while the arm moves.
struct Recording {
    path: PathBuf,
    file: Option<std::fs::File>,
    live: Option<LiveRecorder>,
}

impl Recording {
    /// Opened before anything moves.
    fn open((path, force): &(PathBuf, bool)) -> Result<Self, Failure> {
        Format::of(path).map_err(|error| Failure::of(&error))?;
        let mut options = OpenOptions::new();
        options.write(true);
        if *force {
            options.create(true).truncate(true)
        } else {
            options.create_new(true)
        };
        let file = options.open(path).map_err(|error| {
            let exists = error.kind() == std::io::ErrorKind::AlreadyExists;
            let failure = Failure::usage(format!("{}: {error}; nothing was sent", path.display()));
            if exists { failure.next("name another file, or pass overwrite=True") } else { failure }
        })?;
        Ok(Self { path: path.clone(), file: Some(file), live: None })
    }
}

impl Machine {
    /// Runs what was ordered. An error before the arm moves is the caller's own; one in motion is part of what came of it.
    pub fn run(&mut self, order: &Order, asked: &Asked) -> Result<Ran, Failure> {
        if !(1.0..=100.0).contains(&order.speed) {
            let error = plan::PlanError::Speed { percent: order.speed, most: 100.0 };
            return Err(error.into());
        }
        let mut recording = order.record.as_ref().map(Recording::open).transpose()?;
        self.shared.running.store(true, Ordering::SeqCst);
        let ran = self.run_recorded(order, asked, &mut recording);
        self.shared.running.store(false, Ordering::SeqCst);
        // Who wished something of a run that is over learns that: the other end of the channel is gone.
        lock(&self.shared.wishes).clear();
        self.shared.report("", 0.0, 0.0);
        let Some(Recording { path, file, live }) = recording else { return ran };
        match (&ran, live) {
            (Ok(ran), Some(live)) => {
                let reason = ran.failure.as_ref().map(|failure| failure.message.clone()).unwrap_or_default();
                let ending = Ending { outcome: ran.outcome.into(), reason, ..Ending::default() };
                live.finish(&ending).map_err(|error| Failure::of(&error))?;
            }
            (_, live) => {
                // Nothing moved: an empty file is no recording.
                live.into_iter().for_each(LiveRecorder::abandon);
                drop(file);
                let _ = std::fs::remove_file(path);
            }
        }
        ran
    }

    fn run_recorded(
        &mut self,
        order: &Order,
        asked: &Asked,
        recording: &mut Option<Recording>,
    ) -> Result<Ran, Failure> {
        self.session.ask_to_move()?;
        let shared = Arc::clone(&self.shared);
        let waits = |_| shared.report("waiting", 0.0, 0.0);
        let mut status = self.session.ready_to_move(waits, || asked.is_halted())?;
        let arm = self.device_arm()?;
        let options = CheckOptions {
            accept_device_limits: order.accept_device_limits,
            device: self.session.device_config()?,
            ..CheckOptions::default()
        };
        let (trajectory, notes) = trajectory(order, &arm, &options, &status)?;
        closed(&trajectory, order, &arm, &options)?;
        let mut info = RecordingInfo {
            source: self.session.port().name(),
            trajectory: order.name.clone(),
            start_unix_ns: host_kit::unix_time().as_nanos() as u64,
            commanded: Some(Arc::clone(&trajectory)),
            runs: Some(order.repeat),
            ..RecordingInfo::of(&arm)
        };
        if let AnyPort::Simulated(..) = self.session.port() {
            info.start_unix_ns = 0;
        }
        drop(self.tape.take());
        let mut ran = Ran {
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
        for number in 0..order.repeat.max(1) {
            let check =
                |status: &Status| CheckedTrajectory::check(&trajectory, &arm, &status.positions(), &options);
            let mut checked = check(&status);
            if order.approach && checked.as_ref().is_err_and(is_elsewhere) {
                let way = plan::approach(&trajectory, &arm, &status.positions(), order.speed, &options);
                let way = way.map_err(|error| no_approach(&error))?;
                if !self.leg(&way, "approach", asked, &mut ran, None)? {
                    break;
                }
                status = self.session.fresh_status()?;
                checked = check(&status);
            }
            let elsewhere = checked.as_ref().is_err_and(is_elsewhere);
            let checked = match checked {
                Ok(checked) => checked,
                Err(error) => {
                    let failure = Failure::from(error);
                    let failure = if elsewhere {
                        failure.next("pass approach=True: the arm is moved to the first point")
                    } else {
                        failure
                    };
                    if number == 0 {
                        return Err(failure);
                    }
                    (ran.outcome, ran.failure) = ("fault", Some(failure));
                    break;
                }
            };
            if !self.leg(&checked, "motion", asked, &mut ran, recording.as_mut())? {
                break;
            }
            status = self.session.fresh_status()?;
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

    /// Uploads and executes one motion; false where it did not come to its end.
    fn leg(
        &mut self,
        checked: &CheckedTrajectory,
        phase: &'static str,
        asked: &Asked,
        ran: &mut Ran,
        recording: Option<&mut Recording>,
    ) -> Result<bool, Failure> {
        let shared = Arc::clone(&self.shared);
        let upload = self.session.upload(checked, |progress| {
            shared.report("upload", progress.segments_done as f64, progress.segments as f64);
            if asked.is_halted() { Flow::Cancel } else { Flow::Continue }
        })?;
        if asked.is_halted() {
            return Err(Error::Cancelled.into());
        }
        ran.upload = Some(upload);
        let motion = phase == "motion";
        if motion {
            let sink = match recording {
                None => None,
                Some(recording) => {
                    if let Some(file) = recording.file.take() {
                        let live = LiveRecorder::begin(file, &recording.path, &ran.info, |_| {});
                        recording.live = Some(live.map_err(|error| Failure::of(&error))?);
                    }
                    recording.live.as_ref().map(LiveRecorder::sink)
                }
            };
            self.tape.record(sink);
        }
        let simulated = matches!(self.session.port(), AnyPort::Simulated(..));
        let (tape, total) = (Rc::clone(&self.tape), checked.trajectory().duration_s());
        // Both callbacks have it, one after the other.
        let current = Cell::new(None);
        self.in_motion = true;
        let outcome = self.session.run_unkept(
            checked,
            move |sample| {
                // The simulator takes one each millisecond by itself.
                if !simulated {
                    tape.push(sample);
                }
            },
            |status| {
                shared.publish(status);
                shared.report(phase, f64::from(status.point) * 1e-3, total);
                if asked.is_halted() {
                    return Flow::Stop;
                }
                let wish = lock(&shared.wishes).pop_front();
                wish.map_or(Flow::Continue, |wish| {
                    current.set(Some(wish.done));
                    wish.flow
                })
            },
            |_, did| {
                if let Some(done) = current.take() {
                    let came = match did {
                        Ok(()) => Ok(()),
                        Err(error) => Err(Failure::with(error, error.facts())),
                    };
                    // Who wished it may have gone.
                    let _ = done.send(came);
                }
            },
        );
        self.observe();
        self.tape.pause();
        let lost = matches!(&outcome, Err(Error::Motion(MotionError::LinkLost { .. })));
        self.in_motion = lost;
        match outcome {
            Ok(Outcome::Finished(_)) => return Ok(true),
            Ok(Outcome::Stopped(_)) => ran.outcome = "stopped",
            Err(error) => {
                ran.outcome = "fault";
                let samples = self.tape.take();
                let found = RunFailure::find(&ran.info, &samples)
                    .unwrap_or_else(|| RunFailure::ended_by(&ran.info, &samples, error.to_string()));
                ran.broken = Some(match &error {
                    Error::Motion(MotionError::RunFault { status, .. }) => found.with_status(status),
                    _ => found,
                });
                samples.iter().for_each(|sample| self.tape.keep(sample));
                let mut failure = Failure::from(error);
                if failure.facts.joint.is_none() {
                    failure.facts.joint = ran.broken.as_ref().and_then(|broken| broken.joint);
                }
                ran.failure = Some(failure);
            }
        }
        Ok(false)
    }
}

/// The arm is not at the first point, and that alone is wrong.
fn is_elsewhere(error: &CheckError) -> bool {
    match error {
        CheckError::Refused(verdict) => {
            verdict.refusals().next().is_some()
                && verdict.refusals().all(|p| p.kind == ProblemKind::StartPose)
        }
        _ => false,
    }
}

/// The way to the first point cannot be gone.
fn no_approach(error: &ApproachError) -> Failure {
    let facts = Facts::of_approach(error);
    let message =
        format!("the straight way from where the arm stands to the first point is refused: {error}");
    let next = "nothing moved: bring the arm nearer to the first point, by hand or with a motion of your own";
    Failure { facts: Box::new(facts), ..Failure::refused("approach", message, next) }
}

/// What is run, and what was changed for it.
fn trajectory(
    order: &Order,
    arm: &Arm,
    options: &CheckOptions,
    status: &Status,
) -> Result<(Arc<Trajectory>, Vec<String>), Failure> {
    match &order.course {
        Course::Along(trajectory) if order.speed == 100.0 => Ok((Arc::clone(trajectory), Vec::new())),
        Course::Along(trajectory) => Ok((Arc::new(plan::at_speed(trajectory, order.speed)?), Vec::new())),
        Course::To { target, line } => {
            let (config, friction) = (arm.config_on_device(&options.device), arm.friction());
            let planner = Planner {
                model: Some(&arm.model),
                friction: friction.as_ref(),
                speed_pct: order.speed,
                ..Planner::new(&config)
            };
            let planned = planner.to_target(&arm.model, &status.positions(), target, *line);
            let planned =
                planned.map_err(|error| Failure { message: error.of_move(), ..Failure::from(error) })?;
            Ok((Arc::new(planned.trajectory), planned.notes))
        }
    }
}

/// A motion that is repeated leads back to its start, or an approach does.
fn closed(trajectory: &Trajectory, order: &Order, arm: &Arm, options: &CheckOptions) -> Result<(), Failure> {
    let ends = trajectory.points.first().zip(trajectory.points.last());
    let Some((first, last)) = ends.filter(|_| order.repeat > 1 && !order.approach) else { return Ok(()) };
    let limit = arm.config_on_device(&options.device).start_tolerance_rad;
    let (joint, far) = plan::furthest_joint(&first.position, &last.position);
    if far <= limit {
        return Ok(());
    }
    let message = format!(
        "it ends {far:.3} rad from where it begins ({joint}), more than {limit} rad: it cannot be repeated as it is; nothing was sent"
    );
    let facts = Facts { joint: Some(joint), value: Some(far), limit: Some(limit), ..Facts::default() };
    let next = "approach=True leads back to its first point before each run";
    Err(Failure { facts: Box::new(facts), ..Failure::refused("open-path", message, next) })
}
