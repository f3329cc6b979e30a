//! Where an error is, and by how much: what a program looks at instead of the words.

use jtc_core::ConfigError;
use jtc_core::settings::SettingError;
use jtc_plan::kinematics::PoseError;
use jtc_wire::{Joint, Status, StopCause};

use super::{CheckError, Error, ExtensionError, MotionError, StateError};
use crate::check::{ProblemKind, Verdict};
use crate::held_stop;
use crate::plan::{ApproachError, MARGIN_PCT_MAX, PlanError};
use crate::run::StartError;
use crate::waypoints::WaypointError;
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
    /// What was found first in a held stop (J-69), where the device tells it.
    pub stop: Option<StopCause>,
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
            stop: None,
        }
    }

    /// Those of a motion that cannot be planned.
    pub fn of_plan(error: &PlanError) -> Self {
        use jtc_plan::PlanError as Of;
        let known = |joint: Option<Joint>, value: f64, limit: f64| Self {
            joint,
            value: Some(value),
            limit: Some(limit),
            ..Self::default()
        };
        match error {
            PlanError::Refused(verdict) => Self::of_verdict(verdict),
            PlanError::Speed { percent, most } => known(None, *percent, *most),
            PlanError::Margin { percent } => {
                known(None, *percent, if *percent < 0.0 { 0.0 } else { MARGIN_PCT_MAX })
            }
            PlanError::TooManyCorners { corners, most } => known(None, *corners as f64, *most as f64),
            PlanError::Plan(Of::Position { joint, value, min, max, .. }) => {
                let limit = if value < min { *min } else { *max };
                known(Some(*joint), *value, limit).caused_by(ProblemKind::Position)
            }
            PlanError::Plan(Of::Torque { joint, torque, limit, .. }) => {
                known(Some(*joint), *torque, *limit).caused_by(ProblemKind::Torque)
            }
            PlanError::Plan(Of::TooEarly { joint, given, shortest, .. }) => {
                known(Some(*joint), *given, *shortest)
            }
            PlanError::Plan(Of::Time { time, before, .. }) => known(None, *time, *before),
            PlanError::Plan(Of::NotFinite { joint, .. } | Of::Range { joint, .. }) => {
                Self { joint: Some(*joint), ..Self::default() }
            }
            PlanError::Plan(Of::Limit { joint, value, .. }) => {
                Self { joint: Some(*joint), value: Some(*value), ..Self::default() }
            }
            PlanError::Plan(Of::Flange(error)) => Self::of_pose(error),
            PlanError::Blend { value, most, .. } => known(None, *value, *most),
            _ => Self::default(),
        }
    }

    /// Those of a pose that the flange cannot have.
    fn of_pose(error: &PoseError) -> Self {
        match error {
            PoseError::Waypoint { source, .. } | PoseError::Leg { source, .. } => Self::of_pose(source),
            PoseError::OutsideLimits { joint, value, low, high } => {
                let limit = if value < low { *low } else { *high };
                let known =
                    Self { joint: Some(*joint), value: Some(*value), limit: Some(limit), ..Self::default() };
                known.caused_by(ProblemKind::Position)
            }
            PoseError::JointStep { joint, .. } => Self { joint: Some(*joint), ..Self::default() },
            PoseError::Configuration { joint, value, wanted } => {
                Self { joint: Some(*joint), value: Some(*value), limit: Some(*wanted), ..Self::default() }
            }
            _ => Self::default(),
        }
    }

    /// Those of waypoints that the arm cannot be led through.
    pub fn of_waypoints(error: &WaypointError) -> Self {
        match error {
            WaypointError::Route(error) => Self::of_plan(error),
            WaypointError::Flange { source, .. } => Self::of_pose(source),
            WaypointError::File(_) | WaypointError::Pose { .. } => Self::default(),
        }
    }

    /// Those of a way to the first point that there is not.
    pub fn of_approach(error: &ApproachError) -> Self {
        match error {
            ApproachError::Plan(error) => Self::of_plan(error),
            ApproachError::Check(CheckError::Refused(verdict)) => Self::of_verdict(verdict),
            ApproachError::Check(_) => Self::default(),
        }
    }

    /// Facts of a motion that does not begin.
    pub fn of_start(error: &StartError) -> Self {
        match error {
            StartError::Check(CheckError::Refused(verdict))
            | StartError::Elsewhere(CheckError::Refused(verdict)) => Self::of_verdict(verdict),
            StartError::Check(_) | StartError::Elsewhere(_) => Self::default(),
            StartError::Approach(error) => Self::of_approach(error),
            StartError::Open(open) => Self {
                joint: Some(open.joint),
                value: Some(open.distance),
                limit: Some(open.tolerance),
                ..Self::default()
            },
        }
    }

    /// Those of a held stop (J-69): what the device has found, or else what its status shows.
    fn of_held_stop(status: &Status, cause: Option<&StopCause>) -> Self {
        let Some(cause) = cause else { return Self::of_status(status) };
        let (value, limit) = held_stop::figures(cause);
        let joint = held_stop::joint(cause);
        Self {
            joint,
            value: value.map(f64::from),
            limit: limit.map(f64::from),
            cause: held_stop::page(cause.kind).map(|page| page.cause),
            stop: Some(*cause),
            ..Self::default()
        }
    }

    /// Those of a setting that is not taken.
    fn of_setting(error: &SettingError) -> Self {
        let known =
            |joint, value, limit| Self { joint, value: Some(value), limit: Some(limit), ..Self::default() };
        let nearest = |value: f64, low: f64, high: f64| if value < low { low } else { high };
        match *error {
            SettingError::Unknown { joint, .. } => {
                Self { joint: Joint::from_number(joint.into()), ..Self::default() }
            }
            SettingError::Value { joint, value, low, high, .. } => {
                known(Joint::from_number(joint.into()), value, nearest(value, low, high))
            }
            SettingError::Config(
                ConfigError::Position { joint, value, limit }
                | ConfigError::Range { joint, value, limit }
                | ConfigError::TorqueScale { joint, value, limit }
                | ConfigError::SpeedScale { joint, value, limit }
                | ConfigError::SpeedTrip { joint, value, limit },
            ) => known(Joint::from_number(joint), value, limit),
            SettingError::Config(ConfigError::Braking { value, limit }) => {
                known(None, value.into(), limit.into())
            }
            SettingError::Bounds(bounds) => {
                known(None, bounds.value, nearest(bounds.value, bounds.low, bounds.high))
            }
            SettingError::Config(_) | SettingError::Payload(_) => Self::default(),
        }
    }

    fn caused_by(self, kind: ProblemKind) -> Self {
        Self { cause: cause(kind.words()), ..self }
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
            Self::State(StateError::Absent { joints } | StateError::EncoderJumped { joints }) => {
                Facts { joint: joints.first().copied(), ..Facts::default() }
            }
            Self::State(StateError::NotMeasured { joint }) => {
                Facts { joint: Some(*joint), ..Facts::default() }
            }
            Self::State(StateError::HeldStop { status, cause }) => {
                Facts::of_held_stop(status, cause.as_ref())
            }
            Self::Motion(MotionError::HeldStop { point, status, cause, .. }) => {
                Facts { point: Some(*point), ..Facts::of_held_stop(status, cause.as_ref()) }
            }
            Self::Motion(MotionError::RunFault { point, status }) => {
                Facts { point: Some(*point), ..Facts::of_status(status) }
            }
            Self::Motion(MotionError::LinkLost { last: Some(last), .. }) if last.is_executing() => {
                Facts { point: Some(last.point), ..Facts::default() }
            }
            Self::Motion(MotionError::RestRefused { point, why }) => {
                Facts { point: Some(*point), ..Facts::of_plan(why) }
            }
            Self::Extension(ExtensionError::TooHeavy { joint, torque, limit, .. }) => {
                Facts { joint: Some(*joint), value: Some(*torque), limit: Some(*limit), ..Facts::default() }
            }
            Self::Extension(ExtensionError::Setting(error)) => Facts::of_setting(error),
            _ => Facts::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::CheckOptions;
    use crate::plan::Planner;
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

    /// A place outside the limits, one that takes more torque than there is, and a way there from outside: what planning refuses has the same
    /// facts as what a check refuses.
    #[test]
    fn what_planning_refuses_has_joint_value_limit_and_cause() {
        let arm = Arm::avena();
        let config = arm.config().clone();
        let planner = Planner { model: Some(&arm.model), ..Planner::new(&config) };
        let rest = [0.0; 6];
        let (low, high) = (config.joints[3].position_min, config.joints[1].position_max);
        for (joint, place, limit) in [(4, low - 0.25, low), (2, high + 0.5, high)] {
            let mut goal = rest;
            goal[joint - 1] = place;
            let facts = Facts::of_plan(&planner.to(&rest, &goal).expect_err("outside its limits"));
            assert_eq!((facts.joint, facts.value), (Joint::from_number(joint), Some(place)));
            assert_eq!((facts.limit, facts.point), (Some(limit), None));
            assert!(facts.cause.is_some_and(|cause| !cause.is_empty()));
        }
        let mut weak = config.clone();
        weak.joints[1].torque_max = 1.0;
        let planner = Planner { model: Some(&arm.model), ..Planner::new(&weak) };
        let refused = planner.to(&[0.0, 0.5, 0.0, 0.0, 0.0, 0.0], &[0.5, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let facts = Facts::of_plan(&refused.expect_err("no torque"));
        assert_eq!(facts.joint, Joint::from_number(2));
        let (Some(value), Some(limit)) = (facts.value, facts.limit) else { panic!("{facts:?}") };
        assert!(value > limit && limit <= 1.0 && facts.cause.is_some(), "{facts:?}");
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
