//! Tests that the waypoint number of an error is equal to the number in the message.
use jtc_plan::kinematics::PoseError;
use jtc_plan::{LimitKind, PlanError};
use jtc_wire::Joint;

const JOINT: Joint = Joint::ALL[1];

fn about(waypoint: usize) -> Vec<PlanError> {
    let source = || Box::new(PoseError::HalfTurn);
    let torque = |holding| PlanError::Torque {
        waypoint,
        joint: JOINT,
        torque: 90.0,
        limit: 77.6,
        whole: 80.0,
        holding,
    };
    vec![
        PlanError::NotFinite { waypoint, joint: JOINT, value: f64::NAN },
        PlanError::Position { waypoint, joint: JOINT, value: 5.0, min: -1.0, max: 1.0 },
        PlanError::Time { waypoint, time: 1.0, before: 2.0 },
        PlanError::TooEarly {
            from: 2,
            waypoint,
            joint: JOINT,
            limit: LimitKind::Velocity,
            given: 1.0,
            shortest: 2.0,
        },
        torque(true),
        torque(false),
        PoseError::Waypoint { waypoint, source: source() }.into(),
        PoseError::Leg { leg: waypoint - 1, distance: 0.1, length: 0.2, source: source() }.into(),
    ]
}

/// The method `waypoint` must return the first number after the word `waypoint` in the message.
#[test]
fn the_waypoint_is_the_one_that_the_message_names() {
    for error in about(17) {
        let text = error.to_string();
        assert_eq!(error.waypoint(), Some(17), "{text}");
        let (_, rest) = text.split_once("waypoint ").unwrap();
        assert!(rest.starts_with("17") && !rest[2..].starts_with(|c: char| c.is_ascii_digit()), "{text}");
    }
}

#[test]
fn what_is_about_no_waypoint_names_none() {
    let reason = String::from("none");
    for error in [
        PlanError::TooFew { count: 1 },
        PlanError::Limit { joint: JOINT, limit: LimitKind::Jerk, value: 0.0 },
        PlanError::Range { joint: JOINT, min: 1.0, max: 0.0 },
        PlanError::Blend { value: -1.0 },
        PlanError::Path { leg: 3, parameter: 0.5 },
        PlanError::NoTimeLaw { leg: 3, reason },
        PoseError::NoMotion.into(),
    ] {
        assert_eq!(error.waypoint(), None, "{error}");
    }
}
