//! Facts about an error: joint, value, limit and cause.

use host_kit::{Facts, HeldStopFacts};
use jtc_core::ConfigError;
use jtc_core::settings::SettingError;
use jtc_plan::kinematics::PoseError;
use jtc_wire::{Joint, Status, StopCause};

use crate::check::{ProblemKind, Verdict};
use crate::held_stop::HeldStop;
use crate::plan::{MARGIN_PCT_MAX, PlanError};
use crate::{explain, held_stop, labels};

/// Returns the usual cause of a problem. The text `words` selects the page of `jtc explain` that contains this cause.
fn cause(words: &str) -> Option<&'static str> {
    explain::find(words).first().map(|page| page.cause)
}

/// Returns the facts of a joint value that exceeds its limit, with the usual cause of a problem of this kind.
fn problem(joint: Joint, value: f64, limit: f64, kind: ProblemKind) -> Facts {
    Facts { cause: cause(kind.words()), ..Facts::beyond(value, limit).at_joint(joint.number()) }
}

/// Returns facts that contain only the joint of an error.
pub(super) fn of_joint(joint: Joint) -> Facts {
    Facts::default().at_joint(joint.number())
}

/// Returns the facts about the worst problem that a check found.
pub(crate) fn of_verdict(verdict: &Verdict) -> Facts {
    let Some(worst) = verdict.refusals().next() else { return Facts::default() };
    Facts {
        joint: worst.joint.map(Joint::number),
        point: u32::try_from(worst.point).ok(),
        cause: cause(worst.kind.words()),
        ..Facts::beyond(worst.value, worst.limit)
    }
}

/// Returns the limit that `value` exceeds: `low` or `high`.
fn nearest(value: f64, low: f64, high: f64) -> f64 {
    if value < low { low } else { high }
}

/// Returns the facts about a motion that cannot be planned.
pub(crate) fn of_plan(error: &PlanError) -> Facts {
    use jtc_plan::PlanError as Of;
    match error {
        PlanError::Refused(verdict) => of_verdict(verdict),
        PlanError::Speed { percent, most } => Facts::beyond(*percent, *most),
        PlanError::Margin { percent } => Facts::beyond(*percent, nearest(*percent, 0.0, MARGIN_PCT_MAX)),
        PlanError::TooManyCorners { corners, most } => Facts::beyond(*corners as f64, *most as f64),
        PlanError::Plan(Of::Position { joint, value, min, max, .. }) => {
            problem(*joint, *value, nearest(*value, *min, *max), ProblemKind::Position)
        }
        PlanError::Plan(Of::Torque { joint, torque, limit, .. }) => {
            problem(*joint, *torque, *limit, ProblemKind::Torque)
        }
        PlanError::Plan(Of::TooEarly { joint, given, shortest, .. }) => {
            Facts::beyond(*given, *shortest).at_joint(joint.number())
        }
        PlanError::Plan(Of::Time { time, before, .. }) => Facts::beyond(*time, *before),
        PlanError::Plan(Of::NotFinite { joint, .. } | Of::Range { joint, .. }) => of_joint(*joint),
        PlanError::Plan(Of::Limit { joint, value, .. }) => Facts { value: Some(*value), ..of_joint(*joint) },
        PlanError::Plan(Of::Flange(error)) => of_pose(error),
        PlanError::Blend { value, most, .. } => Facts::beyond(*value, *most),
        _ => Facts::default(),
    }
}

/// Returns the facts about a pose that the flange cannot reach.
pub(crate) fn of_pose(error: &PoseError) -> Facts {
    match error {
        PoseError::Waypoint { source, .. } | PoseError::Leg { source, .. } => of_pose(source),
        PoseError::OutsideLimits { joint, value, low, high } => {
            problem(*joint, *value, nearest(*value, *low, *high), ProblemKind::Position)
        }
        PoseError::JointStep { joint, .. } => of_joint(*joint),
        PoseError::Configuration { joint, value, wanted } => {
            Facts::beyond(*value, *wanted).at_joint(joint.number())
        }
        _ => Facts::default(),
    }
}

/// Returns the facts about a held stop (J-69). If the controller does not report the cause, the facts come from the errors in the status.
pub(super) fn of_held_stop(status: &Status, cause: Option<&StopCause>) -> Facts {
    let Some(cause) = cause else { return of_status(status) };
    let stop = HeldStop::new(cause, 0);
    Facts {
        joint: stop.joint,
        value: stop.value.map(f64::from),
        limit: stop.limit.map(f64::from),
        cause: held_stop::page(cause.kind).map(|page| page.cause),
        held_stop: Some(Box::new(HeldStopFacts { kind: stop.kind, unit: stop.unit, text: stop.text })),
        ..Facts::default()
    }
}

/// Returns the facts about a rejected setting.
pub(super) fn of_setting(error: &SettingError) -> Facts {
    match *error {
        SettingError::Unknown { joint, .. } => {
            Facts { joint: Joint::from_number(joint.into()).map(Joint::number), ..Facts::default() }
        }
        SettingError::Value { joint, value, low, high, .. } => Facts {
            joint: Joint::from_number(joint.into()).map(Joint::number),
            ..Facts::beyond(value, nearest(value, low, high))
        },
        SettingError::Config(
            ConfigError::Position { joint, value, limit }
            | ConfigError::Range { joint, value, limit }
            | ConfigError::TorqueScale { joint, value, limit }
            | ConfigError::SpeedScale { joint, value, limit }
            | ConfigError::SpeedTrip { joint, value, limit },
        ) => Facts { joint: Joint::from_number(joint).map(Joint::number), ..Facts::beyond(value, limit) },
        SettingError::Config(ConfigError::Braking { value, limit }) => {
            Facts::beyond(value.into(), limit.into())
        }
        SettingError::Bounds(bounds) => {
            Facts::beyond(bounds.value, nearest(bounds.value, bounds.low, bounds.high))
        }
        SettingError::Config(_) | SettingError::Payload(_) => Facts::default(),
    }
}

/// Returns the facts about the errors in a status.
pub fn of_status(status: &Status) -> Facts {
    let reports = |joint: &Joint| status.joints[joint.index()].internal != 0;
    Facts {
        joint: Joint::ALL.into_iter().find(reports).map(Joint::number),
        cause: labels::causes(status).first().and_then(|words| cause(words)),
        ..Facts::default()
    }
}

#[cfg(test)]
mod tests {
    use host_kit::Diagnose;

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
        let facts = refused.expect_err("it is over its limit").facts();
        assert_eq!((facts.joint, facts.point), (Some(2), Some(0)));
        assert_eq!(facts.limit, Some(limit));
        // The reported value is not exactly 0.5 rad beyond the limit, because it is rounded to the resolution of a
        // serial frame.
        assert!(facts.value.is_some_and(|value| (value - limit - 0.5).abs() < 1e-3), "{:?}", facts.value);
        assert!(facts.cause.is_some_and(|cause| !cause.is_empty()));
    }

    /// If the planner rejects a motion, the error contains the same facts as the error of the check. The test covers a position outside the
    /// limits, a position that needs too much torque, and a path that starts outside the limits.
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
            let facts = planner.to(&rest, &goal).expect_err("outside its limits").facts();
            assert_eq!((facts.joint, facts.value), (u8::try_from(joint).ok(), Some(place)));
            assert_eq!((facts.limit, facts.point), (Some(limit), None));
            assert!(facts.cause.is_some_and(|cause| !cause.is_empty()));
        }
        let mut weak = config.clone();
        weak.joints[1].torque_max = 1.0;
        let planner = Planner { model: Some(&arm.model), ..Planner::new(&weak) };
        let refused = planner.to(&[0.0, 0.5, 0.0, 0.0, 0.0, 0.0], &[0.5, 1.0, 0.0, 0.0, 0.0, 0.0]);
        let facts = refused.expect_err("no torque").facts();
        assert_eq!(facts.joint, Some(2));
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
            for words in labels::causes(&status) {
                assert!(cause(&words).is_some(), "{words}");
            }
        }
    }
}
