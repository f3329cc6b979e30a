//! A motion from the wish to the figures: ready, checked, uploaded, executed, followed.

use std::cell::Cell;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::{Arc, Mutex};

use jtc_host::error::Facts;
use jtc_host::plan::kinematics::Target;
use jtc_host::plan::{self, ApproachError, MoveSpeed, Planner, RunCourse, RunStart, StartError};
use jtc_host::recording::{Ending, RecordingInfo};
use jtc_host::report::RunFailure;
use jtc_host::session::{Flow, LinkStatistics, Outcome, UploadReport};
use jtc_host::trajectory::Trajectory;
use jtc_host::{
    Arm, CheckOptions, CheckedTrajectory, Error, LinkError, MotionError, Port as _, PortError, Sample,
};
use jtc_wire::{Status, TrajectoryState};

use super::machine::Machine;
use super::recording::Recording;
use super::shared::{Asked, Progress};
use super::worker::lock;
use crate::error::Failure;

/// Where a motion leads.
pub enum Course {
    /// Along a trajectory.
    Along(Arc<Trajectory>),
    /// From where the arm stands to this place; `line`: with the flange on a straight line; `margin_pct`: torque that the move leaves, % of
    /// each limit.
    To { target: Target, line: bool, margin_pct: f64 },
}

/// What is run, and how.
pub struct Order {
    pub course: Course,
    /// As recordings name it.
    pub name: String,
    /// Where the arm stands elsewhere it is moved to the first point.
    pub approach: bool,
    /// % of the trajectory's own speed, or of what the limits allow. `None`: the trajectory's own speed, and the default one for a move or
    /// an approach.
    pub speed: Option<f64>,
    /// How often.
    pub repeat: u32,
    /// The controller's limits, gravity and rotor inertia differ from the arm's, and are safe for it.
    pub accept_device_limits: bool,
    /// A recording, and whether one that is there is written over.
    pub record: Option<(PathBuf, bool)>,
    /// How far it is, for whoever looks.
    pub progress: Arc<Mutex<Progress>>,
}

/// What is run on which arm.
struct Way<'a> {
    order: &'a Order,
    trajectory: &'a Arc<Trajectory>,
    arm: &'a Arm,
    options: &'a CheckOptions,
    move_speed: MoveSpeed,
}

/// What came of it.
pub struct Ran {
    /// The controller was sent Execute.
    moved: bool,
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

impl Order {
    fn report(&self, phase: &'static str, done: f64, total: f64) {
        *lock(&self.progress) = Progress { phase, done, total };
    }
}

impl Machine {
    /// Runs what was ordered. An error before the arm moves is the caller's own; one in motion, or behind it, is part of what came of it.
    pub fn run(&mut self, order: &Order, asked: &Asked) -> Result<Ran, Failure> {
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
        closed(&trajectory, order, &arm, &options)?;
        let speed = options.device.speed;
        *lock(&self.shared.speed) = Some(speed);
        if speed != 1.0 {
            notes.push(format!(
                "the controller ran it at {speed} of its speed, which was set before: `robot.speed = 1` ends that"
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
        let way = Way { order, trajectory: &trajectory, arm: &arm, options: &options, move_speed };
        let legs = self.legs(&way, asked, &mut ran, recording, status);
        self.tape.pause();
        match legs {
            Err(failure) if !ran.moved => return Err(failure),
            // Between two motions: that somebody stopped the arm is no failure of the run.
            Err(_) if asked.is_halted() && ran.outcome == "finished" => ran.outcome = "stopped",
            Err(failure) => (ran.outcome, ran.failure) = ("fault", Some(failure)),
            Ok(()) => {}
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

    /// Each motion with the approach to it, from the status that was seen last.
    fn legs(
        &mut self,
        way: &Way<'_>,
        asked: &Asked,
        ran: &mut Ran,
        mut recording: Option<&mut Recording>,
        mut status: Status,
    ) -> Result<(), Failure> {
        let Way { order, trajectory, arm, options, move_speed } = way;
        for n in 1..=order.repeat {
            let course = RunCourse {
                trajectory,
                then: (n == 1 && order.repeat > 1).then_some(trajectory),
                approach_pct: order.approach.then_some(move_speed.percent),
            };
            let start = course.start(arm, &status.positions(), options);
            let RunStart { mut checked, is_approach } = start.map_err(not_begun)?;
            if is_approach {
                ran.notes.extend(of_speed("approach", *move_speed).filter(|note| !ran.notes.contains(note)));
                if !self.leg(&checked, (order, "approach"), asked, ran, None)? {
                    return Ok(());
                }
                // From where the approach ended, not from where it should have.
                status = self.session.fresh_status()?;
                checked = CheckedTrajectory::check(trajectory, arm, &status.positions(), options)?;
            }
            if !self.leg(&checked, (order, "motion"), asked, ran, recording.as_deref_mut())? {
                return Ok(());
            }
            status = self.session.fresh_status()?;
        }
        Ok(())
    }

    /// Uploads and executes one motion; false where it did not come to its end.
    fn leg(
        &mut self,
        checked: &CheckedTrajectory,
        (order, phase): (&Order, &'static str),
        asked: &Asked,
        ran: &mut Ran,
        recording: Option<&mut Recording>,
    ) -> Result<bool, Failure> {
        let shared = Arc::clone(&self.shared);
        let upload = self.session.upload(checked, |progress| {
            order.report("upload", progress.segments_done as f64, progress.segments as f64);
            if asked.is_halted() { Flow::Cancel } else { Flow::Continue }
        });
        // Why it broke off is known where somebody has stopped the arm.
        asked.check()?;
        ran.upload = Some(upload?);
        if phase == "motion" {
            let sink = recording.map(|recording| recording.sink(&ran.info)).transpose()?;
            self.tape.record(sink.flatten());
        }
        let simulated = self.session.port().is_simulated();
        let (tape, total) = (Rc::clone(&self.tape), checked.trajectory().duration_s());
        // Both callbacks have it, one after the other.
        let current = Cell::new(None);
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
                order.report(phase, f64::from(status.point) * 1e-3, total);
                if asked.is_halted() {
                    return Flow::Stop;
                }
                let wish = lock(&shared.wishes).pop_front();
                wish.map_or(Flow::Continue, |wish| {
                    current.set(Some(wish.done));
                    wish.flow
                })
            },
            |flow, did| {
                if let (Flow::Speed(percent), Ok(())) = (flow, did) {
                    *lock(&shared.speed) = Some(f64::from(percent) / 100.0);
                }
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
        if let Err(Error::Link(LinkError::Port(PortError::Halted { .. }))) = outcome {
            // Stopped before it began.
            self.shared.set_moves(false);
            return Err(Error::Cancelled.into());
        }
        ran.moved = true;
        self.shared.set_moves(outcome.as_ref().is_err_and(|error| self.may_move(error)));
        match outcome {
            Ok(Outcome::Finished(_)) => return Ok(true),
            Ok(Outcome::Stopped(_)) => {
                ran.outcome = "stopped";
                if !asked.is_halted() {
                    // Somebody else did: what waits here was asked for before that, too.
                    self.shared.halt();
                }
            }
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

    /// A run has ended in this error, and its motion may go on all the same: on its way, or paused and resumed by whoever does that.
    fn may_move(&self, error: &Error) -> bool {
        let goes_on = [TrajectoryState::Execute, TrajectoryState::Pause];
        matches!(error, Error::Motion(MotionError::LinkLost { .. }))
            || self.session.last().is_some_and(|status| status.trajectory.is_in(&goes_on))
    }
}

/// Why nothing of the run was begun.
fn not_begun(error: StartError) -> Failure {
    match error {
        StartError::Check(error) => error.into(),
        StartError::Elsewhere(error) => {
            Failure::from(error).next("pass approach=True: the arm is moved to the first point")
        }
        StartError::Approach(error) => no_approach(&error),
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
    move_speed: MoveSpeed,
) -> Result<(Arc<Trajectory>, Vec<String>), Failure> {
    match &order.course {
        Course::Along(trajectory) => match order.speed {
            None | Some(100.0) => Ok((Arc::clone(trajectory), Vec::new())),
            Some(percent) => Ok((Arc::new(plan::at_speed(trajectory, percent)?), Vec::new())),
        },
        Course::To { target, line, margin_pct } => {
            let (config, friction) = (arm.config_on_device(&options.device), arm.friction());
            let planner = Planner {
                model: Some(&arm.model),
                friction: friction.as_ref(),
                speed_pct: move_speed.percent,
                margin_pct: *margin_pct,
                ..Planner::new(&config)
            };
            let planned = planner.to_target(&arm.model, &status.positions(), target, *line);
            let planned =
                planned.map_err(|error| Failure { message: error.of_move(), ..Failure::from(error) })?;
            let low = planned.verdict.margin.and_then(|margin| margin.warning());
            let notes = planned.notes.into_iter().chain(of_speed("move", move_speed)).chain(low).collect();
            Ok((Arc::new(planned.trajectory), notes))
        }
    }
}

/// A default speed in words.
fn of_speed(what: &str, speed: MoveSpeed) -> Option<String> {
    speed.note("`speed=`").map(|words| format!("{what} {words}"))
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
