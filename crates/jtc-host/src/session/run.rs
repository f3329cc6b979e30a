//! Execution of a trajectory from its start to its end, with a sample for each status.

use std::cell::RefCell;
use std::rc::Rc;

use jtc_wire::Status;

use super::{Flow, Outcome, Session, StatusClock};
use crate::check::CheckedTrajectory;
use crate::port::Port;
use crate::recording::RecordingInfo;
use crate::report::Summary;
use crate::sample::Sample;
use crate::{Arm, Error};

/// Result of the execution of a trajectory, with a sample for each status.
#[derive(Debug)]
#[must_use = "a run may have failed: check its outcome"]
pub struct Run {
    /// Result of the execution. If the run failed, the error is one of [`Session::execute`] or [`Session::follow`]. A failed run also has
    /// samples, with which the failure can be analysed.
    pub outcome: Result<Outcome, Error>,
    /// Samples, oldest first. The commanded values of a sample come from the trajectory, at the point that the
    /// controller reports.
    pub samples: Vec<Sample>,
}

impl Run {
    /// Returns the tracking error, speed and torque of each joint during the run. `arm` supplies names and limits.
    pub fn summary(&self, arm: &Arm) -> Summary {
        Summary::of(&RecordingInfo::of(arm), &self.samples)
    }
}

impl<P: Port> Session<P> {
    /// Executes the trajectory that was just uploaded and follows it to its end. **The arm moves.**
    ///
    /// `each` receives each status and returns the next action, for example to pause or to stop. This function removes
    /// an observer that was set earlier.
    pub fn run(&mut self, checked: &CheckedTrajectory, each: impl FnMut(&Status) -> Flow) -> Run {
        let samples = Rc::<RefCell<Vec<Sample>>>::default();
        let taken = Rc::clone(&samples);
        let outcome = self.run_with(checked, move |sample| taken.borrow_mut().push(*sample), each, |_, _| {});
        Run { outcome, samples: samples.take() }
    }

    /// Like [`Session::run`], for a run of any length. `observe` receives each sample when it arrives. `done` receives each
    /// [`Flow`] with its result, as in [`Session::follow_with`].
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::execute`] and [`Session::follow`].
    pub fn run_with(
        &mut self,
        checked: &CheckedTrajectory,
        mut observe: impl FnMut(&Sample) + 'static,
        each: impl FnMut(&Status) -> Flow,
        done: impl FnMut(Flow, &Result<(), Error>),
    ) -> Result<Outcome, Error> {
        let (trajectory, delay) = (checked.shared(), checked.delay_ticks());
        let mut clock = StatusClock::begin(self.now(), 0);
        self.observe(move |now, status| {
            observe(&Sample::following(clock.at(now, status), status, &trajectory, delay));
        });
        let outcome = self.execute(checked).and_then(|()| self.follow_with(each, done));
        self.stop_observing();
        outcome
    }
}
