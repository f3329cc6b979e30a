//! Where an error is, and by how much: what a program looks at instead of the words.

use jtc_wire::{Joint, Status};

use super::{CheckError, Error, ExtensionError, MotionError, StateError};
use crate::check::Verdict;
use crate::{explain, words};

/// What is known of an error beside its words; each part where it applies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Which joint.
    pub joint: Option<Joint>,
    /// Which point of the trajectory, from 0; in motion the 1 ms point.
    pub point: Option<u32>,
    /// What was found, in the unit of the message.
    pub value: Option<f64>,
    /// What is allowed.
    pub limit: Option<f64>,
    /// What usually causes it.
    pub cause: Option<&'static str>,
}

/// The cause on the page of what a screen shows.
fn cause(words: &str) -> Option<&'static str> {
    explain::find(words).first().map(|page| page.cause)
}

impl Facts {
    /// Those of the worst thing that a check has found.
    pub fn of_verdict(verdict: &Verdict) -> Self {
        let Some(worst) = verdict.refusals().next() else { return Self::default() };
        Self {
            joint: worst.joint,
            point: u32::try_from(worst.point).ok(),
            value: Some(worst.value),
            limit: Some(worst.limit),
            cause: cause(worst.kind.words()),
        }
    }

    /// Those of the errors that a controller reports.
    pub fn of_status(status: &Status) -> Self {
        Self {
            joint: Joint::ALL.into_iter().find(|joint| status.joints[joint.index()].internal != 0),
            cause: words::causes(status).first().and_then(|words| cause(words)),
            ..Self::default()
        }
    }
}

impl Error {
    /// Where it is, and by how much.
    pub fn facts(&self) -> Facts {
        match self {
            Self::Check(CheckError::Refused(verdict)) => Facts::of_verdict(verdict),
            Self::State(
                StateError::Device { status }
                | StateError::Timeout { status, .. }
                | StateError::NotReady { status },
            ) => Facts::of_status(status),
            Self::State(StateError::Absent { joints }) => {
                Facts { joint: joints.first().copied(), ..Facts::default() }
            }
            Self::Motion(
                MotionError::RunFault { point, status }
                | MotionError::PausedByController { point, status, .. },
            ) => Facts { point: Some(*point), ..Facts::of_status(status) },
            Self::Motion(MotionError::RestRefused { point, .. }) => {
                Facts { point: Some(*point), ..Facts::default() }
            }
            Self::Extension(ExtensionError::TooHeavy { joint, torque, limit, .. }) => {
                Facts { joint: Some(*joint), value: Some(*torque), limit: Some(*limit), ..Facts::default() }
            }
            _ => Facts::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::CheckOptions;
    use crate::{Arm, CheckedTrajectory, Point, Trajectory};

    #[test]
    fn what_a_check_refuses_has_joint_point_value_limit_and_cause() {
        let arm = Arm::avena();
        let limit = arm.config().joints[1].position_max;
        let outside = [0.0, limit + 0.5, 0.0, 0.0, 0.0, 0.0];
        let points = vec![Point { position: outside, ..Point::default() }; 3];
        let trajectory = Trajectory { points, step_ms: 100 };
        let refused = CheckedTrajectory::check(&trajectory, &arm, &outside, &CheckOptions::default());
        let facts = Error::from(refused.expect_err("it is over its limit")).facts();
        assert_eq!((facts.joint, facts.point), (Joint::from_number(2), Some(0)));
        assert_eq!(facts.limit, Some(limit));
        // As a frame carries it.
        assert!(facts.value.is_some_and(|value| (value - limit - 0.5).abs() < 1e-3), "{:?}", facts.value);
        assert!(facts.cause.is_some_and(|cause| !cause.is_empty()));
    }

    #[test]
    fn every_kind_of_problem_and_every_error_of_a_controller_has_a_cause() {
        for kind in crate::check::ProblemKind::ALL {
            assert!(cause(kind.words()).is_some(), "{kind:?}");
        }
        for bit in 0..16 {
            let mut status = Status { errors: 1 << bit, ..Status::default() };
            status.joints[2].internal = 1 << bit;
            for words in words::causes(&status) {
                assert!(cause(&words).is_some(), "{words}");
            }
        }
    }
}
