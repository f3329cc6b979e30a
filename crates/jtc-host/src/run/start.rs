//! Start of a run. The arm moves only after all motions of the run have passed the check (J-55).
use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts};
use jtc_core::JOINTS;
use jtc_wire::Joint;

use super::Order;
use crate::check::CheckedTrajectory;
use crate::error::CheckError;
use crate::plan::{ApproachError, approach, furthest_joint};
use crate::trajectory::Trajectory;

/// First motion of a run.
#[derive(Clone, Debug)]
pub struct Start {
    /// Motion that passed the check from the current position of the arm.
    pub checked: CheckedTrajectory,
    /// `true` if the motion is the approach to the first point.
    pub is_approach: bool,
}

/// Reason why a motion does not begin.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A trajectory of the run did not pass the check.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// The only problem is that the arm is not at the first point, and the order does not allow an approach.
    #[error(transparent)]
    Elsewhere(CheckError),
    /// The run needs an approach that is not possible.
    #[error("the straight path from the present position to the first point is refused: {0}")]
    Approach(#[from] ApproachError),
    /// The next run cannot begin at the end of the previous run.
    #[error(transparent)]
    Open(#[from] OpenPath),
}

/// The distance between the end of a path and the first point of the next run is too large.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the path ends {distance:.3} rad from where it begins ({joint}), limit {tolerance} rad, so it cannot be repeated; nothing was sent"
)]
pub struct OpenPath {
    /// Joint with the largest distance.
    pub joint: Joint,
    /// Distance of this joint, rad.
    pub distance: f64,
    /// Largest distance from the first point at which the controller starts a run, rad.
    pub tolerance: f64,
}

impl OpenPath {
    /// Compares the end of `before` with the first point of `next`. Returns `None` if the distance is at most `tolerance`
    /// (rad).
    pub fn between(before: &Trajectory, next: &Trajectory, tolerance: f64) -> Option<Self> {
        let (last, first) = before.points.last().zip(next.points.first())?;
        let (joint, distance) = furthest_joint(&last.position, &first.position);
        (distance > tolerance).then_some(Self { joint, distance, tolerance })
    }
}

impl Diagnose for StartError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Check(error) | Self::Elsewhere(error) => error.diagnosis(),
            Self::Approach(_) => Diagnosis::new(
                ErrorKind::Refused,
                "approach",
                "bring the arm nearer to the first point, by hand or with a motion of your own; nothing moved",
            ),
            Self::Open(error) => error.diagnosis(),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Check(error) | Self::Elsewhere(error) => error.facts(),
            Self::Approach(ApproachError::Plan(error)) => error.facts(),
            Self::Approach(ApproachError::Check(error)) => error.facts(),
            Self::Open(error) => error.facts(),
        }
    }
}

impl Diagnose for OpenPath {
    fn diagnosis(&self) -> Diagnosis {
        let next =
            "use `--approach` to return to the first point before each run; or end the path where it begins";
        Diagnosis::new(ErrorKind::Refused, "open-path", next)
    }

    fn facts(&self) -> Facts {
        Facts::beyond(self.distance, self.tolerance).at_joint(self.joint.number())
    }
}

impl Order<'_> {
    /// Returns the first motion of run `n` (from 1) for an arm at `here` (rad). Before the first run, the function
    /// also checks the trajectories and the approaches of all later runs. The checks use the limits, the payload and
    /// the settings of the controller.
    ///
    /// # Errors
    ///
    /// Returns a [`StartError`].
    pub fn start(&self, n: u32, here: &[f64; JOINTS]) -> Result<Start, StartError> {
        let trajectory = self.trajectory_of(n);
        let elsewhere = match CheckedTrajectory::check(trajectory, self.arm, here, self.options) {
            Ok(checked) => Ok(checked),
            Err(CheckError::Refused(verdict)) if verdict.is_only_elsewhere() => Err(verdict),
            Err(error) => return Err(error.into()),
        };
        if n == 1 && self.runs > 1 {
            self.check_later(here)?;
        }
        match (elsewhere, self.approach_pct) {
            (Ok(checked), _) => Ok(Start { checked, is_approach: false }),
            (Err(verdict), None) => Err(StartError::Elsewhere(CheckError::Refused(verdict))),
            (Err(_), Some(speed_pct)) => {
                let checked = approach(trajectory, self.arm, here, speed_pct, self.options)?;
                Ok(Start { checked, is_approach: true })
            }
        }
    }

    /// Checks the trajectories of all runs after the first run. Also checks the transition to each next run: a run ends
    /// at the start of the next run, or an approach leads from its end to this start.
    fn check_later(&self, here: &[f64; JOINTS]) -> Result<(), StartError> {
        let next = self.later;
        if next != self.trajectory {
            let begin = next.points.first().map_or(*here, |point| point.position);
            CheckedTrajectory::check(next, self.arm, &begin, self.options)?;
        }
        let tolerance = self.arm.config_on_device(&self.options.device).start_tolerance_rad;
        // The end of the second trajectory is checked only if a third run follows.
        let before = [self.trajectory, next];
        for before in before.into_iter().take(if self.runs > 2 { 2 } else { 1 }) {
            let Some(open) = OpenPath::between(before, next, tolerance) else { continue };
            let Some(speed_pct) = self.approach_pct else { return Err(open.into()) };
            let last = before.points.last().map_or(*here, |point| point.position);
            approach(next, self.arm, &last, speed_pct, self.options)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use jtc_core::Config;

    use super::*;
    use crate::Arm;
    use crate::check::{CheckOptions, ProblemKind};
    use crate::plan::joint_move;

    const THERE: [f64; JOINTS] = [0.3, 0.2, -0.3, 0.0, 0.0, 0.0];

    /// Returns a motion of joint 2 from the zero pose.
    fn trajectory(percent: f64) -> Trajectory {
        joint_move(&[0.0; JOINTS], &[0.0, 1.2, 0.0, 0.0, 0.0, 0.0], &Config::avena(), percent).unwrap()
    }

    /// Simplified order with `runs` runs. The first run is on `trajectory`, and all other runs are on `later`.
    struct Course<'a> {
        trajectory: &'a Trajectory,
        later: &'a Trajectory,
        runs: u32,
        approach_pct: Option<f64>,
    }

    fn start(
        course: &Course<'_>,
        here: [f64; JOINTS],
        device: impl Fn(&mut Config),
    ) -> Result<Start, StartError> {
        let mut options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
        device(&mut options.device);
        let &Course { trajectory, later, runs, approach_pct } = course;
        let arm = Arm::avena();
        Order { arm: &arm, options: &options, trajectory, later, runs, approach_pct }.start(1, &here)
    }

    #[test]
    fn j55_an_approach_begins_only_where_the_start_position_is_the_only_problem() {
        let motion = trajectory(40.0);
        let course = Course { trajectory: &motion, later: &motion, runs: 1, approach_pct: Some(25.0) };
        let begun = start(&course, THERE, |_| ()).unwrap();
        assert!(begun.is_approach);
        let end = begun.checked.trajectory().points.last().unwrap().position;
        assert!(furthest_joint(&end, &[0.0; JOINTS]).1 < 1e-3);
        assert!(!start(&course, [0.0; JOINTS], |_| ()).unwrap().is_approach);
        let without = Course { approach_pct: None, ..course };
        assert!(matches!(start(&without, THERE, |_| ()), Err(StartError::Elsewhere(_))));
        // The check finds each kind of problem. The check uses the limits, the payload and the settings of the controller.
        let slow = |config: &mut Config| config.joints[1].velocity_max = 0.3;
        let weak = |config: &mut Config| config.joints[1].torque_max = 90.0;
        let loaded = |config: &mut Config| config.payload.mass = 6.0;
        let short = |config: &mut Config| config.joints[1].position_max = 0.9;
        let changes: [&dyn Fn(&mut Config); 4] = [&slow, &weak, &loaded, &short];
        for (i, change) in changes.iter().enumerate() {
            let error = start(&course, THERE, change).unwrap_err();
            let StartError::Check(CheckError::Refused(verdict)) = &error else { panic!("{i}: {error}") };
            assert!(verdict.refusals().any(|p| p.kind == ProblemKind::StartPose), "{i}: {verdict}");
            assert!(verdict.refusals().any(|p| p.kind != ProblemKind::StartPose), "{i}: {verdict}");
        }
        let mut fast = motion.clone();
        for point in &mut fast.points {
            point.velocity[1] *= 2.5;
        }
        let error = start(&Course { trajectory: &fast, later: &fast, ..course }, THERE, |_| ()).unwrap_err();
        assert!(matches!(error, StartError::Check(_)), "{error}");
    }

    #[test]
    fn j55_the_runs_after_the_first_one_and_their_approaches_are_checked_before_it() {
        let (motion, mut outside) = (trajectory(50.0), trajectory(50.0));
        let course = Course { trajectory: &motion, later: &motion, runs: 3, approach_pct: Some(25.0) };
        assert!(start(&course, [0.0; JOINTS], |_| ()).is_ok());
        if let Some(point) = outside.points.last_mut() {
            point.position[1] = 2.0;
        }
        let then = Course { later: &outside, ..course };
        assert!(matches!(start(&then, [0.0; JOINTS], |_| ()), Err(StartError::Check(_))));
        // The second run needs an approach from the end of the path. At the invalid speed of 0 %, this approach
        // cannot be planned, so the function must return an error.
        let none = Course { approach_pct: Some(0.0), ..course };
        assert!(matches!(start(&none, [0.0; JOINTS], |_| ()), Err(StartError::Approach(_))));
    }

    #[test]
    fn j55_a_path_that_does_not_lead_back_is_not_repeated_without_an_approach() {
        let motion = trajectory(50.0);
        let course = |runs| Course { trajectory: &motion, later: &motion, runs, approach_pct: None };
        assert!(start(&course(1), [0.0; JOINTS], |_| ()).is_ok());
        let error = start(&course(2), [0.0; JOINTS], |_| ()).unwrap_err();
        let StartError::Open(open) = &error else { panic!("{error}") };
        assert!(open.joint.number() == 2 && (open.distance - 1.2).abs() < 1e-3, "{error}");
        assert_eq!(error.diagnosis().code, "open-path");
        // The second run does not end at the start of a third run. This is an error only if there is a third run.
        let there = motion.points.last().unwrap().position;
        let back = joint_move(&there, &[0.0; JOINTS], &Config::avena(), 30.0).unwrap();
        let and_back = |runs| Course { trajectory: &motion, later: &back, runs, approach_pct: None };
        let twice = start(&and_back(2), [0.0; JOINTS], |_| ());
        assert!(twice.is_ok(), "{twice:?}");
        assert!(matches!(start(&and_back(3), [0.0; JOINTS], |_| ()), Err(StartError::Open(_))));
        // With two runs, there are two problems: the arm is not at the first point, and the path is not closed. The
        // function reports the open path. With one run, only the position of the arm is a problem.
        assert!(matches!(start(&course(2), THERE, |_| ()), Err(StartError::Open(_))));
        assert!(matches!(start(&course(1), THERE, |_| ()), Err(StartError::Elsewhere(_))));
    }
}
