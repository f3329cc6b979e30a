//! A run from its start to its end, with what was seen on the way.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use jtc_wire::Status;

use super::{Flow, Outcome, Session};
use crate::check::CheckedTrajectory;
use crate::port::Port;
use crate::recording::RecordingInfo;
use crate::report::Summary;
use crate::sample::Sample;
use crate::{Arm, Error};

/// What a run was: how it ended, and a sample of each status from its start.
#[derive(Debug)]
#[must_use = "a run may have failed: look at its outcome"]
pub struct Run {
    /// How it ended: an error of [`Session::execute`] or of [`Session::follow`] when it failed. Such a run has samples, too, those that
    /// one wants to look at most.
    pub outcome: Result<Outcome, Error>,
    /// Oldest first; commanded values are those of the trajectory at the point that the controller reports.
    pub samples: Vec<Sample>,
}

impl Run {
    /// The figures of the run: tracking error, speed and torque of each joint. `arm` gives names and limits.
    pub fn summary(&self, arm: &Arm) -> Summary {
        Summary::of(&RecordingInfo::of(arm), &self.samples)
    }
}

impl<P: Port> Session<P> {
    /// Executes the trajectory that was just uploaded and follows it to its end. **The arm moves.**
    ///
    /// `each` is called with each status and returns what to do: go on, pause, resume, stop. An observer that was set before is replaced.
    pub fn run(&mut self, checked: &CheckedTrajectory, each: impl FnMut(&Status) -> Flow) -> Run {
        self.run_observed(checked, |_| {}, each)
    }

    /// The same; `observe` is called with each sample as it comes, to record it while the arm moves.
    pub fn run_observed(
        &mut self,
        checked: &CheckedTrajectory,
        observe: impl FnMut(&Sample) + 'static,
        each: impl FnMut(&Status) -> Flow,
    ) -> Run {
        let samples = self.collect(checked, observe);
        let outcome = self.execute(checked).and_then(|()| self.follow(each));
        self.stop_observing();
        Run { outcome, samples: samples.take() }
    }

    /// Collects a sample of each status from now on.
    fn collect(
        &mut self,
        checked: &CheckedTrajectory,
        mut observe: impl FnMut(&Sample) + 'static,
    ) -> Rc<RefCell<Vec<Sample>>> {
        let (trajectory, delay) = (checked.shared(), checked.delay_ticks());
        let samples = Rc::<RefCell<Vec<Sample>>>::default();
        let taken = Rc::clone(&samples);
        let mut clock = Clock { start: self.now(), arrived: self.now(), point: 0, time_s: 0.0 };
        self.observe(move |now, status| {
            let sample = Sample::following(clock.at(now, status), status, &trajectory, delay);
            observe(&sample);
            taken.borrow_mut().push(sample);
        });
        samples
    }
}

/// Longest that a status is taken to be on its way, s.
const DELAY_S: f64 = 0.1;

/// Time of statuses: the controller's own milliseconds while it follows the path, which no delay on the way to us can blur; the time
/// of arrival otherwise. Path time does not pass as fast at another speed (J-57): it never leaves that of arrival for long.
struct Clock {
    start: Duration,
    arrived: Duration,
    point: u32,
    time_s: f64,
}

impl Clock {
    fn at(&mut self, now: Duration, status: &Status) -> f64 {
        let moved = f64::from(status.point.saturating_sub(self.point)) * 1e-3;
        let waited = now.saturating_sub(self.arrived).as_secs_f64();
        self.time_s += if moved > 0.0 { moved } else { waited };
        let passed = now.saturating_sub(self.start).as_secs_f64();
        self.time_s = self.time_s.clamp((passed - DELAY_S).max(0.0), passed + DELAY_S);
        (self.arrived, self.point) = (now, status.point);
        self.time_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(statuses: &[(u64, u32)]) -> Vec<f64> {
        let mut clock =
            Clock { start: Duration::from_secs(5), arrived: Duration::from_secs(5), point: 0, time_s: 0.0 };
        let status = |point| Status { point, ..Status::default() };
        statuses
            .iter()
            .map(|(ms, point)| clock.at(Duration::from_millis(5000 + ms), &status(*point)))
            .collect()
    }

    #[test]
    fn j57_time_is_the_controllers_at_full_speed_and_never_far_from_ours() {
        // Delays do not blur it.
        assert_eq!(times(&[(40, 40), (95, 80), (121, 120), (160, 160)]), [0.04, 0.08, 0.12, 0.16]);
        // At half the speed, and while it stands.
        let slow: Vec<_> = (1..=100).map(|n| (40 * n, 20 * n as u32)).collect();
        assert!((times(&slow)[99] - 3.9).abs() < 1e-9);
        assert!((times(&[(40, 40), (80, 40), (1_080, 40)])[2] - 1.08).abs() < 1e-9);
    }
}
