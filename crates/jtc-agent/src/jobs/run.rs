//! Job that runs a motion. The job writes each of its steps into the journal, and ends after a Stop of another client.
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use jtc_host::plan::MoveSpeed;
use jtc_host::recording::RecordingInfo;
use jtc_host::report::{Digest, Summary};
use jtc_host::run::{self as runner, Ended, Leg, Observer, Phase, SampleReceiver, StartError};
use jtc_host::session::{Flow, LinkStatistics, Outcome, Progress, UploadReport};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Error, LinkError, Port as _, Session, Trajectory};
use jtc_wire::Status;
use tokio::sync::oneshot;

pub use jtc_host::run::Course;

use super::report::{self, Made, MotionReport};
use super::{ArmEvent, Given, Task, Wish};
use crate::owner::ClientPort;

/// Interval at which the job reports the progress of a motion.
const MOVING: Duration = Duration::from_secs(1);

/// Motion that the job runs, with the options of the motion.
#[derive(Clone, Debug)]
pub struct Order {
    /// Trajectory or target of the motion.
    pub course: Course,
    /// `true` if the arm first moves to the first point of the trajectory, unless it is already there.
    pub approach: bool,
    /// Speed in % of the trajectory's own speed, or of the arm's limits. With `None`, a trajectory runs at its own
    /// speed, and a move or an approach uses the default speed.
    pub speed_percent: Option<f64>,
    /// Number of runs of the trajectory.
    pub repeat: u32,
    /// `true` if the user confirms that the limits of a controller without extensions are safe. Such a controller
    /// cannot report its limits, so they may differ from the limits of the agent's arm.
    pub accept_device_limits: bool,
}

/// Progress and results of a run job.
#[derive(Clone, Debug, Default)]
pub struct Done {
    /// `true` if the run was completed.
    pub finished: bool,
    /// Number of finished motions; approaches are not counted.
    pub runs: u32,
    /// Results of the last motion.
    pub summary: Option<Summary>,
    /// Report about the last motion, if its size is within the limits.
    pub report: report::Kept,
    /// Arm parameters that were sent to the controller.
    pub given: Option<Given>,
}

/// Runs a motion. Returns the progress of the run, and the problem that ended the run or prevented its start.
pub fn run(task: &Task<'_>, session: &mut Session<ClientPort>, order: &Order) -> (Done, Option<Problem>) {
    let mut done = Done::default();
    let error = go(task, session, order, &mut done).err();
    (done, error)
}

/// Arm and options that the check of a motion uses.
struct Site {
    arm: Arm,
    options: CheckOptions,
}

fn go(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    order: &Order,
    done: &mut Done,
) -> Result<(), Problem> {
    let waits = |what| task.note(format!("waiting until {what}"));
    let ready = session.ready_to_move(waits, || task.is_halted());
    let status = ready.map_err(|error| before_motion(task, &error))?;
    let site = site(task, session, order).map_err(|error| Problem::of(&error))?;
    let move_speed = session.move_speed(order.speed_percent);
    let move_speed = move_speed.map_err(|error| Problem::of(&error))?;
    let trajectory = trajectory(task, order, &site, &status, move_speed)?;
    let runs = runner::Order {
        arm: &site.arm,
        options: &site.options,
        trajectory: &trajectory,
        later: &trajectory,
        runs: order.repeat,
        approach_pct: order.approach.then_some(move_speed.percent),
    };
    let mut job = RunJob {
        task,
        site: &site,
        move_speed,
        done,
        link: session.statistics(),
        upload_shown: 0,
        began: Duration::ZERO,
        digest: Rc::default(),
        reported: Instant::now(),
        wish: None,
    };
    let Ended { last, cut } = runner::run(session, &runs, &status, &mut job)?;
    match last.outcome {
        _ if cut => Err(task.stopped()),
        Ok(Outcome::Finished(_)) => {
            done.finished = true;
            Ok(())
        }
        Ok(Outcome::Stopped(_)) => Ok(()),
        Err(error) => Err(before_motion(task, &error)),
    }
}

/// Returns the arm that the controller reports. If the controller cannot return its arm, returns the agent's arm.
fn site(task: &Task<'_>, session: &mut Session<ClientPort>, order: &Order) -> Result<Site, Error> {
    let device = session.device_config()?;
    let arm = if session.has_extensions() { session.device_arm()? } else { task.arm.clone() };
    let accept_device_limits = order.accept_device_limits;
    Ok(Site { arm, options: CheckOptions { accept_device_limits, device, ..CheckOptions::default() } })
}

/// Returns the trajectory for an order, and writes the planner's notes into the journal.
fn trajectory(
    task: &Task<'_>,
    order: &Order,
    site: &Site,
    status: &Status,
    move_speed: MoveSpeed,
) -> Result<Arc<Trajectory>, Problem> {
    let (device, here) = (&site.options.device, status.positions());
    let speed = (move_speed, "speed_percent");
    let planned = order.course.planned(&site.arm, device, &here, order.speed_percent, speed);
    let planned = planned.map_err(|error| {
        let object = Problem::of(&error);
        object.message(order.course.message(&error))
    })?;
    planned.notes.into_iter().for_each(|text| task.note(text));
    Ok(planned.trajectory)
}

/// Job that is running.
struct RunJob<'a> {
    task: &'a Task<'a>,
    site: &'a Site,
    move_speed: MoveSpeed,
    done: &'a mut Done,
    /// Statistics of the connection at the end of the previous motion.
    link: LinkStatistics,
    /// Last reported progress of the upload, in tenths.
    upload_shown: usize,
    /// Start time of the motion, since 1970.
    began: Duration,
    digest: Rc<RefCell<Digest>>,
    reported: Instant,
    /// Client that waits for the result of its last request.
    wish: Option<oneshot::Sender<Result<(), Problem>>>,
}

impl Observer<ClientPort> for RunJob<'_> {
    type Failure = Problem;

    fn refused(&mut self, error: StartError) -> Problem {
        not_begun(&error)
    }

    fn failed(&mut self, error: Error) -> Problem {
        before_motion(self.task, &error)
    }

    /// A Stop before the start of the motion also cancels the run. The person who stops the arm expects that it stays
    /// at rest.
    fn is_cancelled(&mut self) -> bool {
        self.task.is_halted()
    }

    fn checked(&mut self, phase: Phase, checked: &CheckedTrajectory) {
        let Task { job, journal, .. } = *self.task;
        if phase == Phase::Approach
            && let Some(words) = self.move_speed.note("speed_percent")
        {
            self.task.note(format!("approach {words}"));
        }
        journal.write(ArmEvent::Checked {
            job,
            phase: phase.name().to_owned(),
            duration_s: checked.trajectory().duration_s(),
            points: checked.trajectory().points.len(),
            warnings: checked.verdict().warnings().map(ToString::to_string).collect(),
        });
        self.upload_shown = 0;
    }

    fn uploading(&mut self, phase: Phase, progress: &Progress) {
        let Task { job, journal, .. } = *self.task;
        let (segments_done, segments) = (progress.segments_done, progress.segments);
        // The job reports the progress of the upload in steps of 10 %.
        if segments_done * 10 >= (self.upload_shown + 1) * segments.max(1) {
            self.upload_shown = segments_done * 10 / segments.max(1);
            let phase = phase.name().to_owned();
            journal.write(ArmEvent::Uploading { job, phase, segments_done, segments });
        }
    }

    fn uploaded(&mut self, phase: Phase, upload: &UploadReport) {
        let Task { job, journal, .. } = *self.task;
        let (time_s, bytes, retries) = (upload.time_s, upload.bytes, upload.retries);
        journal.write(ArmEvent::Uploaded { job, phase: phase.name().to_owned(), time_s, bytes, retries });
    }

    fn begins(
        &mut self,
        _: &mut Session<ClientPort>,
        phase: Phase,
        checked: &CheckedTrajectory,
    ) -> Result<SampleReceiver, Problem> {
        let Task { job, journal, http_session, .. } = *self.task;
        let (phase, duration_s) = (phase.name().to_owned(), checked.trajectory().duration_s());
        journal.write(ArmEvent::Executing { job, phase, duration_s });
        self.digest.replace(Digest::new());
        (self.reported, self.began) = (Instant::now(), host_kit::unix_time());
        http_session.motion_begins();
        let digest = Rc::clone(&self.digest);
        Ok(Box::new(move |sample| digest.borrow_mut().push(sample)))
    }

    fn status(&mut self, phase: Phase, status: &Status) -> Flow {
        let Task { job, journal, wishes, .. } = *self.task;
        if self.reported.elapsed() >= MOVING && status.is_executing() {
            self.reported = Instant::now();
            let phase = phase.name().to_owned();
            journal.write(ArmEvent::Moving { job, phase, point: status.point });
        }
        let Ok(Wish { flow, done }) = wishes.try_recv() else { return Flow::Continue };
        self.wish = Some(done);
        flow
    }

    fn applied(&mut self, _: Flow, result: &Result<(), Error>) {
        if let Some(done) = self.wish.take() {
            // If the client has disconnected, no receiver exists for the result.
            let _ = done.send(result.as_ref().copied().map_err(Problem::of));
        }
    }

    fn ended(&mut self, session: &mut Session<ClientPort>, leg: &Leg) -> Result<(), Problem> {
        let (task, done) = (self.task, &mut *self.done);
        // A request that arrives with the last status comes too late to have an effect. Its client then receives the
        // answer that the motion has ended.
        self.wish = None;
        task.http_session.motion_ended(task.wishes);
        let digest = self.digest.take();
        done.summary = Some(digest.summary(&RecordingInfo::of(&self.site.arm)));
        let now = session.statistics();
        let made = Made {
            phase: leg.phase.name(),
            before: done.runs,
            outcome: &leg.outcome,
            upload: &leg.upload,
            link: now.since(&self.link),
            began: self.began,
            port: session.port().name(),
            baud: session.port().baud(),
        };
        done.report = MotionReport::new(task, &self.site.arm, digest, &made).map(Arc::new);
        self.link = now;
        if leg.phase == Phase::Motion && leg.is_finished() {
            done.runs += 1;
            task.journal.write(ArmEvent::Finished { job: task.job, runs: done.runs });
        }
        Ok(())
    }
}

/// Returns the reason why a motion was not begun or has failed: an error, or a Stop of a client.
fn before_motion(task: &Task<'_>, error: &Error) -> Problem {
    match error {
        Error::Cancelled => task.stopped(),
        Error::Link(LinkError::Denied { .. }) if task.is_halted() => task.stopped(),
        error => Problem::of(error),
    }
}

/// Returns the reason why the run did not begin.
fn not_begun(error: &StartError) -> Problem {
    let object = Problem::of(error);
    match error {
        StartError::Check(_) => object,
        StartError::Elsewhere(_) => object.next("request the run with approach: true"),
        StartError::Approach(_) => object.next(
            "bring the arm nearer to the first point by hand (teaching), or with a trajectory around the \
             obstacle",
        ),
        StartError::Open(_) => object.next(
            "request the run with approach: true, which moves the arm to the first point before each run",
        ),
    }
}
