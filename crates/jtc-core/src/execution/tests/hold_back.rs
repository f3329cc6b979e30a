//! Tests of a motion that is slowed down because it overloads a joint (J-75), and of the speed override (J-57).
use jtc_wire::{RAW_FULL_SCALE, VELOCITY_SCALE};

use super::*;
use crate::nodes::Nodes;

/// Longest total time for which a run of the path may be held back (J-75), ms.
const RUN_MS: u16 = 5_000;
/// Longest time for which the arm may stand on the path while it is held back (J-75), ms.
const STANDS_MS: u16 = 1_000;
/// Time without a joint at its torque limit after which the path returns to its normal rate (J-75), ms.
const QUIET_MS: u16 = 200;
const NO_JOINT: [bool; JOINTS] = [false; JOINTS];
const THIRD: [bool; JOINTS] = [false, false, true, false, false, false];

/// Returns a clock with this rate, whose target is full speed.
fn slowed(rate: f64) -> PathClock {
    let mut clock = PathClock::start(1.0);
    (clock.time, clock.rate) = (100.0, rate);
    clock
}

/// Returns a controller on the path at half speed, which has just begun to hold back the path and has not computed the
/// inertia of the arm yet.
fn held_back() -> Controller<[RawPoint; 4]> {
    let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
    (controller.phase, controller.clock, controller.braking_ms) =
        (Phase::Running { leave: None }, slowed(0.5), None);
    controller.motion.hold_back.begin();
    controller
}

/// Returns `true` if the controller has computed the inertia of the arm for a ramp.
fn has_inertia(controller: &Controller<[RawPoint; 4]>) -> bool {
    controller.motion.ramp.inertia() != [0.0; JOINTS]
}

/// Joint 3 is at its torque limit for 50 ms in every 100 ms. The times without overload are too short for the path to
/// return to its normal rate, and each overload is too short to stop the arm. The arm therefore stops when the path
/// has been held back for 5 s in total.
#[test]
fn j75_a_path_that_is_held_back_for_too_long_is_a_stop_of_the_joint_at_its_limit() {
    for (before_ms, stops) in [(RUN_MS - 1, false), (RUN_MS, true)] {
        let mut controller = held_back();
        for ms in 0..before_ms {
            let joints = if ms % 100 < 50 { THIRD } else { NO_JOINT };
            controller.motion.hold_back.step(&joints, &slowed(0.5));
        }
        controller.step_hold_back();
        let torque = if stops { joint_error::TORQUE } else { 0 };
        assert_eq!(joint_errors(&controller), [0, 0, torque, 0, 0, 0], "{before_ms} ms");
        assert_eq!(controller.errors.held_stop(), stops, "{before_ms} ms");
        assert_eq!(controller.phase.leave(), stops.then_some(TrajectoryState::Pause), "{before_ms} ms");
        if stops {
            let StopCause { kind, joint, .. } = controller.last_stop.cause;
            assert_eq!((kind, joint), (StopKind::Overload, 3));
        }
    }
}

/// Joint 5 lags if its position error is above 0.25 rad, half of its maximum of 0.5 rad. The set position of joint 5
/// is 0.
#[test]
fn j75_a_joint_that_lags_while_the_path_is_held_back_stops_the_arm() {
    let error = joint_error::POSITION_ERROR;
    for (position, pressed, leave, watched, expected) in [
        (0.25, false, None, true, [0; JOINTS]),
        (-0.25, false, None, true, [0; JOINTS]),
        (0.26, false, None, true, [0, 0, 0, 0, error, 0]),
        (-0.26, false, None, true, [0, 0, 0, 0, error, 0]),
        (0.25, true, None, true, [0; JOINTS]),
        // Joint 3 was also at its torque limit, so both joints are causes of the stop.
        (0.26, true, None, true, [0, 0, joint_error::TORQUE, 0, error, 0]),
        // The arm does not stop for joint 5 if it already stops, or if the path is not held back.
        (0.26, true, Some(TrajectoryState::Stop), true, [0; JOINTS]),
        (0.26, false, None, false, [0; JOINTS]),
    ] {
        let mut controller = held_back();
        controller.config.joints[4].position_error_max = 0.5;
        controller.nodes = Nodes::enabled_at([0.0, 0.0, 0.0, 0.0, position, 0.0], [0.0; JOINTS]);
        if pressed {
            controller.motion.hold_back.step(&THIRD, &slowed(0.5));
        }
        if !watched {
            controller.motion.hold_back.end();
        }
        controller.phase = Phase::Running { leave };
        controller.step_hold_back();
        let case = (position, pressed, leave, watched);
        assert_eq!(joint_errors(&controller), expected, "{case:?}");
        let stops = expected != [0; JOINTS];
        assert_eq!(controller.errors.held_stop(), stops, "{case:?}");
        if stops {
            let cause = controller.last_stop.cause;
            assert_eq!((cause.kind, cause.joint), (StopKind::PositionError, 5), "{case:?}");
            assert_eq!((cause.value, cause.limit), (-position as f32, 0.25), "{case:?}");
        }
    }
}

/// The arm counts as standing if the clock of its present motion runs at a rate below 0.02. An approach has its own
/// clock, so the rate of path time does not matter during an approach.
#[test]
fn j75_the_clock_of_the_present_motion_shows_whether_the_arm_stands() {
    let approach = |clock| Phase::Approaching { from: [0.0; JOINTS], length_ms: 500.0, clock, leave: None };
    let (stands, goes) = (slowed(0.01), slowed(0.5));
    for (phase, path, stops) in [
        (approach(stands), goes, true),
        (approach(goes), stands, false),
        (approach(stands), PathClock::default(), true),
        (Phase::Running { leave: None }, stands, true),
        (Phase::Running { leave: None }, goes, false),
    ] {
        let mut controller = held_back();
        (controller.phase, controller.clock) = (phase, path);
        for ms in 0..STANDS_MS {
            let joints = if ms == 0 { THIRD } else { NO_JOINT };
            controller.motion.hold_back.step(&joints, &stands);
        }
        controller.step_hold_back();
        let torque = if stops { joint_error::TORQUE } else { 0 };
        assert_eq!(joint_errors(&controller), [0, 0, torque, 0, 0, 0], "{phase:?}");
    }
}

/// The ramp back to the normal rate begins 200 ms after the last joint has left its torque limit. The controller
/// computes the inertia of the arm in this tick, because the bounds of the ramp depend on it.
#[test]
fn j75_the_inertia_is_computed_when_the_path_returns_to_its_rate() {
    for (quiet_ms, returns) in [(QUIET_MS - 2, false), (QUIET_MS - 1, true)] {
        let mut controller = held_back();
        controller.motion.hold_back.step(&THIRD, &slowed(0.5));
        for _ in 0..quiet_ms {
            controller.motion.hold_back.step(&NO_JOINT, &slowed(0.5));
        }
        controller.step_hold_back();
        assert_eq!(controller.motion.hold_back.is_active(), !returns, "{quiet_ms} ms");
        assert_eq!(has_inertia(&controller), returns, "{quiet_ms} ms");
        assert!(!controller.errors.held_stop(), "{quiet_ms} ms");
    }
}

/// When the controller begins to hold back the path, it computes the inertia of the arm, because the rate must change
/// in the same tick. In the next tick, the inertia is known and is not computed again.
#[test]
fn j75_the_inertia_is_computed_when_the_path_begins_to_be_held_back() {
    let mut controller = held_back();
    controller.motion.hold_back = HoldBack::default();
    assert!(controller.hold_back() && has_inertia(&controller));
    controller.motion.ramp = Default::default();
    assert!(controller.hold_back() && !has_inertia(&controller));
}

/// A change of the speed override in motion begins a ramp, and the controller computes the inertia of the arm for its
/// bounds. If the override does not change, or if the arm is at rest, no ramp begins.
#[test]
fn j57_the_inertia_is_computed_when_the_speed_changes_in_motion() {
    for (clock, speed, ramps) in [
        (PathClock::start(1.0), 0.5, true),
        (PathClock::start(1.0), 1.0, false),
        (PathClock::start(0.5), 0.5, false),
        (PathClock::start(0.5), 1.0, true),
        (PathClock::default(), 0.5, false),
    ] {
        let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
        controller.clock = clock;
        controller.set_speed(speed);
        assert_eq!(controller.config.speed, speed);
        assert_eq!(controller.clock.ramping(), ramps, "{clock:?} {speed}");
        assert_eq!(has_inertia(&controller), ramps, "{clock:?} {speed}");
    }
}

/// Joint 1 moves with the inertia M at the velocity v, and its torque is 10 % above its limit. If the path is held
/// back, the slope of its rate approaches −0.1·limit/(M·v), which removes this excess. In one tick, the slope changes
/// by a tenth of this value. If the path is not held back, its rate does not change.
#[test]
fn j75_a_path_at_full_speed_slows_down_while_it_is_held_back() {
    for held in [false, true] {
        let mut controller = moving_at_full_speed();
        let limit = controller.config.joints[0].torque_max;
        controller.motion.law.torque[0].model = 1.1 * limit;
        if held {
            assert!(controller.hold_back());
        }
        let inertia = controller.motion.ramp.inertia()[0];
        controller.walk();
        // 1000 steps of the wire format. The wire format has 32767 steps for 2π rad/s.
        let velocity = 1000.0 * (VELOCITY_SCALE / RAW_FULL_SCALE);
        let slope = if held { -0.1 * 0.1 * limit / (inertia * velocity) } else { 0.0 };
        assert!((controller.clock.slope - slope).abs() < 1e-9, "{held}: {:?} {slope}", controller.clock);
        let rate = 1.0 + slope * 0.001;
        assert!((controller.clock.rate - rate).abs() < 1e-9, "{held}: {:?} {rate}", controller.clock);
        let set = controller.motion.set.point.velocity[0];
        assert!((set - velocity * rate).abs() < 1e-9, "{held}: {set}");
    }
}

/// Returns a controller at full speed on a path of four points that are 100 ms apart. Joint 1 moves at a constant velocity.
fn moving_at_full_speed() -> Controller<[RawPoint; 4]> {
    let mut controller = braking(ControllerState::Operate, TrajectoryState::Execute);
    let mut body = [0; 8 + 4 * 36];
    (body[5], body[7]) = (1, 100);
    for (i, bytes) in body[8..].chunks_exact_mut(36).enumerate() {
        let mut point = RawPoint::default();
        (point.position[0], point.velocity[0]) = (200 * i as i16, 1000);
        bytes.copy_from_slice(&point.emit());
    }
    let segment = Segment::parse(&body).expect("four points");
    controller.store.begin(&segment, false, false);
    controller.store.copy(&segment, 0, 4);
    controller.store.commit(&segment, Default::default());
    (controller.phase, controller.clock, controller.braking_ms) =
        (Phase::Running { leave: None }, slowed(1.0), None);
    controller
}
