//! Procedure of a run, in which each motion of an [`Order`] is checked, uploaded, executed and monitored until its end.
//!
//! All front ends use this procedure. A front end (the command line, the agent, Python) implements [`Observer`]. The observer shows the
//! steps, decides on changes of the motion, and stores the samples.
mod course;
mod start;

use std::cell::RefCell;

use jtc_core::JOINTS;
use jtc_wire::Status;

use crate::arm::Arm;
use crate::check::{CheckOptions, CheckedTrajectory};
use crate::error::Error;
use crate::port::Port;
use crate::sample::Sample;
use crate::session::{Flow, Outcome, Progress, Session, UploadReport};
use crate::trajectory::Trajectory;
pub use course::{Course, Planned};
pub use start::{OpenPath, Start, StartError};

/// Description of the motions of a run.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// Arm that the controller moves.
    pub arm: &'a Arm,
    /// Settings of the controller, and options for the check and upload of each motion.
    pub options: &'a CheckOptions,
    /// Trajectory of the first run.
    pub trajectory: &'a Trajectory,
    /// Trajectory of all runs after the first run.
    pub later: &'a Trajectory,
    /// Number of runs. 0 is treated as 1.
    pub runs: u32,
    /// Speed of an approach (the motion to the first point), % of the limits. If the value is `None`, the run makes
    /// no approaches, and the arm must be at the first point of each run.
    pub approach_pct: Option<f64>,
}

impl<'a> Order<'a> {
    fn trajectory_of(&self, n: u32) -> &'a Trajectory {
        if n <= 1 { self.trajectory } else { self.later }
    }
}

/// Purpose of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Straight motion to the first point.
    Approach,
    /// Motion along the trajectory.
    Motion,
}

impl Phase {
    /// Returns the name used in events and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Approach => "approach",
            Self::Motion => "motion",
        }
    }
}

/// Motion of a run that has ended.
#[derive(Debug)]
pub struct Leg {
    /// Purpose.
    pub phase: Phase,
    /// Trajectory of the motion, with the verdict of the check.
    pub checked: CheckedTrajectory,
    /// Statistics of the upload of the motion.
    pub upload: UploadReport,
    /// Result of the motion. If the motion failed, the result is an error of [`Session::execute`] or [`Session::follow`].
    pub outcome: Result<Outcome, Error>,
}

impl Leg {
    /// Returns `true` if the motion reached its last point.
    pub fn is_finished(&self) -> bool {
        matches!(self.outcome, Ok(Outcome::Finished(_)))
    }
}

/// Result of a run.
#[derive(Debug)]
pub struct Ended {
    /// Last motion of the run.
    pub last: Leg,
    /// `true` if the observer cancelled the run after the last motion had finished. The remaining motions were not
    /// executed.
    pub cut: bool,
}

/// Receiver of the samples of a motion. The receiver is called while the arm moves.
pub type SampleReceiver = Box<dyn FnMut(&Sample)>;

/// Interface of a front end that observes and controls a run. [`run`] calls the methods in the order in which they are listed here.
pub trait Observer<P: Port> {
    /// Error type of the front end.
    type Failure;

    /// Converts a [`StartError`], the reason why a motion does not begin, into an error of the front end.
    fn refused(&mut self, error: StartError) -> Self::Failure;

    /// Converts an error that occurred before a motion began into an error of the front end. The error is [`Error::Cancelled`] if
    /// [`Observer::is_cancelled`] has ended the run.
    fn failed(&mut self, error: Error) -> Self::Failure;

    /// Returns `true` if the run must end before its next motion. During a motion, [`Observer::status`] decides if the run ends.
    fn is_cancelled(&mut self) -> bool;

    /// Reports that the next motion has passed the check.
    fn checked(&mut self, phase: Phase, checked: &CheckedTrajectory);

    /// Reports that a part of the motion was uploaded.
    fn uploading(&mut self, phase: Phase, progress: &Progress);

    /// Reports that the whole motion was uploaded.
    fn uploaded(&mut self, phase: Phase, upload: &UploadReport);

    /// Reports that the motion will begin after this call returns. Returns the receiver for the samples of the motion.
    ///
    /// # Errors
    ///
    /// If this method returns an error, the motion does not begin, and the run ends with this error.
    fn begins(
        &mut self,
        session: &mut Session<P>,
        phase: Phase,
        checked: &CheckedTrajectory,
    ) -> Result<SampleReceiver, Self::Failure>;

    /// Evaluates a status during the motion. Returns the action that the run must carry out next.
    fn status(&mut self, phase: Phase, status: &Status) -> Flow;

    /// Receives an action that [`Observer::status`] returned, and the result of this action. If the controller
    /// rejects a change of speed or a Resume, the motion continues.
    fn applied(&mut self, flow: Flow, result: &Result<(), Error>);

    /// Reports the end of the motion. The run ignores the action that [`Observer::status`] returned for the last status.
    ///
    /// # Errors
    ///
    /// If this method returns an error, the run ends with this error.
    fn ended(&mut self, session: &mut Session<P>, leg: &Leg) -> Result<(), Self::Failure>;

    /// Reports that run `n` (from 1) has finished and that the next run follows.
    fn goes_on(&mut self, _n: u32) {}
}

/// Executes all motions of `order`. `status` must come from an arm that the drives hold at rest. If a motion does not
/// reach its end, no further motion follows. **The arm moves.**
///
/// # Errors
///
/// Returns a failure that occurs before a motion begins. If a motion itself fails, the function returns `Ok`, and the
/// failure is in [`Leg::outcome`].
pub fn run<P: Port, O: Observer<P>>(
    session: &mut Session<P>,
    order: &Order<'_>,
    status: &Status,
    observer: &mut O,
) -> Result<Ended, O::Failure> {
    let mut here = status.positions();
    let mut n = 1;
    loop {
        let start = order.start(n, &here).map_err(|error| observer.refused(error))?;
        let mut checked = start.checked;
        if start.is_approach {
            let last = motion(session, Phase::Approach, checked, observer)?;
            if !last.is_finished() {
                return Ok(Ended { last, cut: false });
            }
            // The approach may have ended at a small distance from the first point. Therefore the motion is checked
            // again from the measured position.
            here = positions(session, observer)?;
            let again = CheckedTrajectory::check(order.trajectory_of(n), order.arm, &here, order.options);
            checked = again.map_err(|error| observer.refused(error.into()))?;
        }
        let last = motion(session, Phase::Motion, checked, observer)?;
        let over = n >= order.runs || !last.is_finished();
        if over || observer.is_cancelled() {
            return Ok(Ended { last, cut: !over });
        }
        observer.goes_on(n);
        here = positions(session, observer)?;
        n += 1;
    }
}

fn positions<P: Port, O: Observer<P>>(
    session: &mut Session<P>,
    observer: &mut O,
) -> Result<[f64; JOINTS], O::Failure> {
    let status = session.fresh_status().map_err(|error| observer.failed(error.into()))?;
    Ok(status.positions())
}

/// Uploads, executes and monitors one motion.
fn motion<P: Port, O: Observer<P>>(
    session: &mut Session<P>,
    phase: Phase,
    checked: CheckedTrajectory,
    observer: &mut O,
) -> Result<Leg, O::Failure> {
    if observer.is_cancelled() {
        return Err(observer.failed(Error::Cancelled));
    }
    observer.checked(phase, &checked);
    let upload = session.upload(&checked, |progress| {
        observer.uploading(phase, progress);
        if observer.is_cancelled() { Flow::Cancel } else { Flow::Continue }
    });
    let upload = upload.map_err(|error| observer.failed(error))?;
    observer.uploaded(phase, &upload);
    if observer.is_cancelled() {
        return Err(observer.failed(Error::Cancelled));
    }
    let receiver = observer.begins(session, phase, &checked)?;
    let both = RefCell::new(&mut *observer);
    let outcome = session.run_with(
        &checked,
        receiver,
        |status| both.borrow_mut().status(phase, status),
        |flow, result| both.borrow_mut().applied(flow, result),
    );
    let leg = Leg { phase, checked, upload, outcome };
    observer.ended(session, &leg)?;
    Ok(leg)
}
