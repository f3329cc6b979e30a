//! The start of a run, the same for each program: nothing moves before the whole run passed its check (J-55).

use jtc_core::JOINTS;

use super::{ApproachError, approach, furthest_joint};
use crate::arm::Arm;
use crate::check::{CheckOptions, CheckedTrajectory};
use crate::error::CheckError;
use crate::trajectory::Trajectory;

/// A run before its first motion.
#[derive(Clone, Copy, Debug)]
pub struct RunCourse<'a> {
    /// Trajectory that is run first.
    pub trajectory: &'a Trajectory,
    /// Trajectory of the runs after the first one; `None`: the run has one motion.
    pub then: Option<&'a Trajectory>,
    /// Speed of an approach, % of the limits; `None`: the arm has to stand at the first point.
    pub approach_pct: Option<f64>,
}

/// First motion of a run.
#[derive(Clone, Debug)]
pub struct RunStart {
    /// The motion, checked from where the arm stands.
    pub checked: CheckedTrajectory,
    /// It is the approach to the first point.
    pub is_approach: bool,
}

/// Why a run is not begun; nothing moves.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A trajectory of the run cannot be run.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// The arm does not stand at the first point, nothing else is wrong, and no approach was requested.
    #[error(transparent)]
    Elsewhere(CheckError),
    /// An approach of the run is not possible.
    #[error(transparent)]
    Approach(#[from] ApproachError),
}

impl RunCourse<'_> {
    /// Returns the first motion of the run, for an arm that stands at `here` (rad). Every trajectory of the run was checked then, and every
    /// approach, with the limits, the payload and the settings of the controller that `options` have.
    ///
    /// # Errors
    ///
    /// [`StartError`].
    pub fn start(
        &self,
        arm: &Arm,
        here: &[f64; JOINTS],
        options: &CheckOptions,
    ) -> Result<RunStart, StartError> {
        let first = match CheckedTrajectory::check(self.trajectory, arm, here, options) {
            Ok(checked) => RunStart { checked, is_approach: false },
            Err(CheckError::Refused(verdict)) if verdict.is_only_elsewhere() => {
                let Some(speed_pct) = self.approach_pct else {
                    return Err(StartError::Elsewhere(CheckError::Refused(verdict)));
                };
                let checked = approach(self.trajectory, arm, here, speed_pct, options)?;
                RunStart { checked, is_approach: true }
            }
            Err(error) => return Err(error.into()),
        };
        if let Some(then) = self.then {
            let begin = then.points.first().map_or(*here, |point| point.position);
            if then != self.trajectory {
                CheckedTrajectory::check(then, arm, &begin, options)?;
            }
            self.returns(then, arm, options)?;
        }
        Ok(first)
    }

    /// The approaches between the runs lead from the end of one trajectory to the first point of the next one.
    fn returns(&self, then: &Trajectory, arm: &Arm, options: &CheckOptions) -> Result<(), StartError> {
        let Some(speed_pct) = self.approach_pct else { return Ok(()) };
        let tolerance = arm.config_on_device(&options.device).start_tolerance_rad;
        for before in [self.trajectory, then] {
            let ends = before.points.last().zip(then.points.first());
            let Some((last, first)) = ends else { continue };
            if furthest_joint(&last.position, &first.position).1 > tolerance {
                approach(then, arm, &last.position, speed_pct, options)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use jtc_core::Config;

    use super::*;
    use crate::check::ProblemKind;
    use crate::plan::joint_move;

    const THERE: [f64; JOINTS] = [0.3, 0.2, -0.3, 0.0, 0.0, 0.0];

    /// A motion of joint 2 from the zero pose.
    fn trajectory(percent: f64) -> Trajectory {
        joint_move(&[0.0; JOINTS], &[0.0, 1.2, 0.0, 0.0, 0.0, 0.0], &Config::avena(), percent).unwrap()
    }

    fn start(
        course: RunCourse,
        here: [f64; JOINTS],
        device: impl Fn(&mut Config),
    ) -> Result<RunStart, StartError> {
        let mut options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
        device(&mut options.device);
        course.start(&Arm::avena(), &here, &options)
    }

    #[test]
    fn j55_an_approach_begins_only_where_the_start_position_is_the_only_problem() {
        let motion = trajectory(40.0);
        let course = RunCourse { trajectory: &motion, then: None, approach_pct: Some(25.0) };
        let begun = start(course, THERE, |_| ()).unwrap();
        assert!(begun.is_approach);
        let end = begun.checked.trajectory().points.last().unwrap().position;
        assert!(furthest_joint(&end, &[0.0; JOINTS]).1 < 1e-3);
        assert!(!start(course, [0.0; JOINTS], |_| ()).unwrap().is_approach);
        let without = RunCourse { approach_pct: None, ..course };
        assert!(matches!(start(without, THERE, |_| ()), Err(StartError::Elsewhere(_))));
        // Limits, payload and settings of the controller, and each kind of problem.
        let slow = |config: &mut Config| config.joints[1].velocity_max = 0.3;
        let weak = |config: &mut Config| config.joints[1].torque_max = 90.0;
        let loaded = |config: &mut Config| config.payload.mass = 6.0;
        let short = |config: &mut Config| config.joints[1].position_max = 0.9;
        let changes: [&dyn Fn(&mut Config); 4] = [&slow, &weak, &loaded, &short];
        for (i, change) in changes.iter().enumerate() {
            let error = start(course, THERE, change).unwrap_err();
            let StartError::Check(CheckError::Refused(verdict)) = &error else { panic!("{i}: {error}") };
            assert!(verdict.refusals().any(|p| p.kind == ProblemKind::StartPose), "{i}: {verdict}");
            assert!(verdict.refusals().any(|p| p.kind != ProblemKind::StartPose), "{i}: {verdict}");
        }
        let mut fast = motion.clone();
        for point in &mut fast.points {
            point.velocity[1] *= 2.5;
        }
        let error = start(RunCourse { trajectory: &fast, ..course }, THERE, |_| ()).unwrap_err();
        assert!(matches!(error, StartError::Check(_)), "{error}");
    }

    #[test]
    fn j55_the_runs_after_the_first_one_and_their_approaches_are_checked_before_it() {
        let (motion, mut outside) = (trajectory(50.0), trajectory(50.0));
        let course = RunCourse { trajectory: &motion, then: Some(&motion), approach_pct: Some(25.0) };
        assert!(start(course, [0.0; JOINTS], |_| ()).is_ok());
        if let Some(point) = outside.points.last_mut() {
            point.position[1] = 2.0;
        }
        let then = RunCourse { then: Some(&outside), ..course };
        assert!(matches!(start(then, [0.0; JOINTS], |_| ()), Err(StartError::Check(_))));
        // The pose at its end is left at the speed of an approach: too fast for what the controller allows there.
        let none = RunCourse { approach_pct: Some(0.0), ..course };
        assert!(matches!(start(none, [0.0; JOINTS], |_| ()), Err(StartError::Approach(_))));
    }
}
