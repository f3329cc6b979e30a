//! A run: waits until the arm can be moved, checks, uploads, executes and follows, and reports each step.
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use jtc_host::error::Facts;
use jtc_host::plan::kinematics::Target;
use jtc_host::plan::{self, MoveSpeed, Planner, RunCourse, RunStart, StartError};
use jtc_host::recording::RecordingInfo;
use jtc_host::report::{Digest, Summary};
use jtc_host::session::{Flow, Outcome};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Error, LinkError, Port as _, Session, Trajectory};
use jtc_wire::Status;

use super::report::{self, Made, MotionReport};
use super::{Given, Happening, Task, Wish};
use crate::api::ErrorObject;
use crate::owner::ClientPort;

/// How often is reported how far a motion is.
const MOVING: Duration = Duration::from_secs(1);

/// Where a run leads.
#[derive(Clone, Debug)]
pub enum Course {
    /// Along a trajectory.
    Along(Trajectory),
    /// From where the arm stands to a place.
    To {
        /// The place.
        target: Target,
        /// The flange keeps to a straight line; else straight in joint space where that takes no longer.
        line: bool,
        /// Torque that the move leaves, % of each limit.
        margin_pct: f64,
    },
}

/// What is run, and how.
#[derive(Clone, Debug)]
pub struct Order {
    /// Where it leads.
    pub course: Course,
    /// Where the arm stands elsewhere it is moved to the first point.
    pub approach: bool,
    /// % of the trajectory's own speed, or of what the limits allow. `None`: the trajectory's own speed, and the default one for a move or
    /// an approach.
    pub speed_percent: Option<f64>,
    /// How often.
    pub repeat: u32,
    /// The controller has no extensions, uses other limits than the agent's arm, and these are safe for it.
    pub accept_device_limits: bool,
}

/// How far a run came.
#[derive(Clone, Debug, Default)]
pub struct Done {
    /// To its end.
    pub finished: bool,
    /// Motions that were finished, approaches not counted.
    pub runs: u32,
    /// Figures of the last motion.
    pub summary: Option<Summary>,
    /// The report of the last motion, where there is room for it.
    pub report: report::Kept,
    /// What the controller was given of an arm.
    pub given: Option<Given>,
}

/// A run on its way.
struct Run<'a> {
    task: &'a Task<'a>,
    session: &'a mut Session<ClientPort>,
}

/// Runs what was ordered: how far it came, and what forbids it, or ended it in a fault.
pub fn run(task: &Task<'_>, session: &mut Session<ClientPort>, order: &Order) -> (Done, Option<ErrorObject>) {
    let mut done = Done::default();
    let error = Run { task, session }.go(order, &mut done).err();
    (done, error)
}

/// The arm that a motion is checked against, and how.
struct Site {
    arm: Arm,
    options: CheckOptions,
}

impl Run<'_> {
    fn go(&mut self, order: &Order, done: &mut Done) -> Result<(), ErrorObject> {
        let task = self.task;
        let waits = |what| task.note(format!("waiting until {what}"));
        let ready = self.session.ready_to_move(waits, || task.is_halted());
        let mut status = ready.map_err(|error| self.before_motion(&error))?;
        let site = self.site(order)?;
        let move_speed = self.session.move_speed(order.speed_percent);
        let move_speed = move_speed.map_err(|error| ErrorObject::of(&error.into()))?;
        let trajectory = self.trajectory(order, &site, &status, move_speed)?;
        closed(&trajectory, order, &site)?;
        for n in 1..=order.repeat.max(1) {
            let course = RunCourse {
                trajectory: &trajectory,
                then: (n == 1 && order.repeat > 1).then_some(&trajectory),
                approach_pct: order.approach.then_some(move_speed.percent),
            };
            let start = course.start(&site.arm, &status.positions(), &site.options);
            let RunStart { mut checked, is_approach } = start.map_err(not_begun)?;
            if is_approach {
                move_speed
                    .note("speed_percent")
                    .into_iter()
                    .for_each(|words| task.note(format!("approach {words}")));
                if !self.motion("approach", &checked, &site, done)? {
                    return Ok(());
                }
                // From where the approach ended, not from where it should have.
                status = self.fresh_status()?;
                let again =
                    CheckedTrajectory::check(&trajectory, &site.arm, &status.positions(), &site.options);
                checked = again.map_err(|e| ErrorObject::of(&e.into()))?;
            }
            if !self.motion("motion", &checked, &site, done)? {
                return Ok(());
            }
            done.runs = n;
            task.journal.write(Happening::Finished { job: task.job, runs: n });
            if n < order.repeat {
                status = self.fresh_status()?;
            }
        }
        done.finished = true;
        Ok(())
    }

    fn fresh_status(&mut self) -> Result<Status, ErrorObject> {
        self.session.fresh_status().map_err(|e| ErrorObject::of(&e.into()))
    }

    /// The arm of the controller, where it can be asked; else that of the agent.
    fn site(&mut self, order: &Order) -> Result<Site, ErrorObject> {
        let mut ask = || -> Result<Site, Error> {
            let device = self.session.device_config()?;
            let arm = if self.session.has_extensions() {
                self.session.device_arm()?
            } else {
                self.task.arm.clone()
            };
            let accept_device_limits = order.accept_device_limits;
            Ok(Site {
                arm,
                options: CheckOptions { accept_device_limits, device, ..CheckOptions::default() },
            })
        };
        ask().map_err(|error| ErrorObject::of(&error))
    }

    /// What is run.
    fn trajectory(
        &self,
        order: &Order,
        site: &Site,
        status: &Status,
        move_speed: MoveSpeed,
    ) -> Result<Trajectory, ErrorObject> {
        match &order.course {
            Course::Along(trajectory) => match order.speed_percent {
                None | Some(100.0) => Ok(trajectory.clone()),
                Some(percent) => plan::at_speed(trajectory, percent).map_err(|e| plan_error(&e)),
            },
            Course::To { target, line, margin_pct } => {
                let (config, friction) =
                    (site.arm.config_on_device(&site.options.device), site.arm.friction());
                let planner = Planner {
                    model: Some(&site.arm.model),
                    friction: friction.as_ref(),
                    speed_pct: move_speed.percent,
                    margin_pct: *margin_pct,
                    ..Planner::new(&config)
                };
                let planned = planner.to_target(&site.arm.model, &status.positions(), target, *line);
                let planned = planned.map_err(|e| plan_error(&e).message(e.of_move()))?;
                let of_speed = move_speed.note("speed_percent").map(|words| format!("move {words}"));
                let low = planned.verdict.margin.and_then(|margin| margin.warning());
                planned.notes.into_iter().chain(of_speed).chain(low).for_each(|text| self.task.note(text));
                Ok(planned.trajectory)
            }
        }
    }

    /// Uploads and executes one motion. False: it was stopped.
    fn motion(
        &mut self,
        phase: &str,
        checked: &CheckedTrajectory,
        site: &Site,
        done: &mut Done,
    ) -> Result<bool, ErrorObject> {
        let task = self.task;
        let Task { job, journal, wishes, .. } = *task;
        if task.is_halted() {
            return Err(task.stopped());
        }
        let phase = || phase.to_owned();
        journal.write(Happening::Checked {
            job,
            phase: phase(),
            duration_s: checked.trajectory().duration_s(),
            points: checked.trajectory().points.len(),
            warnings: checked.verdict().warnings().map(ToString::to_string).collect(),
        });
        let (mut shown, link) = (0, self.session.statistics());
        let uploaded = self.session.upload(checked, |progress| {
            let (segments_done, segments) = (progress.segments_done, progress.segments);
            // A tenth of it at a time.
            if segments_done * 10 >= (shown + 1) * segments.max(1) {
                shown = segments_done * 10 / segments.max(1);
                journal.write(Happening::Uploading { job, phase: phase(), segments_done, segments });
            }
            if task.is_halted() { Flow::Cancel } else { Flow::Continue }
        });
        let upload = uploaded.map_err(|error| self.before_motion(&error))?;
        let (time_s, bytes, retries) = (upload.time_s, upload.bytes, upload.retries);
        journal.write(Happening::Uploaded { job, phase: phase(), time_s, bytes, retries });
        // Somebody who stopped an arm that stood still meant that it is to stand.
        if task.is_halted() {
            return Err(task.stopped());
        }
        let duration_s = checked.trajectory().duration_s();
        journal.write(Happening::Executing { job, phase: phase(), duration_s });
        let digest = Rc::new(RefCell::new(Digest::new()));
        let (taken, mut reported, wish) = (Rc::clone(&digest), Instant::now(), Cell::new(None));
        let began = host_kit::unix_time();
        task.commander.motion_begins();
        let outcome = self.session.run_unkept(
            checked,
            move |sample| taken.borrow_mut().push(sample),
            |status| {
                if reported.elapsed() >= MOVING && status.is_executing() {
                    reported = Instant::now();
                    journal.write(Happening::Moving { job, phase: phase(), point: status.point });
                }
                let Ok(Wish { flow, done }) = wishes.try_recv() else { return Flow::Continue };
                wish.set(Some(done));
                flow
            },
            |_, did| {
                if let Some(done) = wish.take() {
                    // Whoever wished it may have gone.
                    let _ = done.send(match did {
                        Ok(()) => Ok(()),
                        Err(error) => Err(ErrorObject::of(error)),
                    });
                }
            },
        );
        task.commander.motion_ended(wishes);
        let digest = digest.take();
        done.summary = Some(digest.summary(&RecordingInfo::of(&site.arm)));
        let made = Made {
            phase: &phase(),
            before: done.runs,
            outcome: &outcome,
            upload: &upload,
            link: self.session.statistics().since(&link),
            began,
            port: self.session.port().name(),
            baud: self.session.port().baud(),
        };
        done.report = MotionReport::new(task, &site.arm, digest, &made).map(Arc::new);
        match outcome {
            Ok(Outcome::Finished(_)) => Ok(true),
            Ok(Outcome::Stopped(_)) => Ok(false),
            Err(error) => Err(self.before_motion(&error)),
        }
    }

    /// Why a motion was not begun: an error, or somebody who stopped it.
    fn before_motion(&self, error: &Error) -> ErrorObject {
        match error {
            Error::Cancelled => self.task.stopped(),
            Error::Link(LinkError::Denied { .. }) if self.task.is_halted() => self.task.stopped(),
            error => ErrorObject::of(error),
        }
    }
}

/// A motion that is repeated leads back to its start, or an approach does.
fn closed(trajectory: &Trajectory, order: &Order, site: &Site) -> Result<(), ErrorObject> {
    if order.repeat <= 1 || order.approach {
        return Ok(());
    }
    let Some((first, last)) = trajectory.points.first().zip(trajectory.points.last()) else { return Ok(()) };
    let limit = site.arm.config_on_device(&site.options.device).start_tolerance_rad;
    let (joint, far) = plan::furthest_joint(&first.position, &last.position);
    if far <= limit {
        return Ok(());
    }
    let message = format!(
        "it ends {far:.3} rad from where it begins ({joint}), more than {limit} rad: it cannot be repeated as it is; nothing was sent"
    );
    let object =
        ErrorObject::new("open-path", message, "`approach` leads back to its first point before each run");
    let facts = Facts { joint: Some(joint), value: Some(far), limit: Some(limit), ..Facts::default() };
    Err(object.with(&facts))
}

/// Why nothing of the run was begun.
fn not_begun(error: StartError) -> ErrorObject {
    match error {
        StartError::Check(error) => ErrorObject::of(&error.into()),
        StartError::Elsewhere(error) => {
            ErrorObject::of(&error.into()).next("ask for the run with approach: true")
        }
        StartError::Approach(error) => approach_error(&error),
    }
}

/// There is no such motion.
fn plan_error(error: &plan::PlanError) -> ErrorObject {
    ErrorObject::diagnosed(error).with(&Facts::of_plan(error))
}

/// The trajectory itself may be sound: what is refused is the way to it.
fn approach_error(error: &plan::ApproachError) -> ErrorObject {
    let message =
        format!("the straight way from where the arm stands to the first point is refused: {error}");
    let next = "bring the arm nearer to its first point, by hand with teaching or with a trajectory of your own around what is in the way";
    ErrorObject::new("approach", message, next).with(&Facts::of_approach(error))
}
