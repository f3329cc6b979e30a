//! Tests of the stop that the safety input begins (J-22).
use super::*;
use crate::execution::phase::Phase;
use crate::nodes::Nodes;
use crate::{Config, JOINTS};

const RAMP_MS: u16 = 100;

type Arm = Controller<[RawPoint; 4]>;

/// Returns a controller in this state with every joint enabled. Joint 2 moves at this velocity, rad/s.
fn arm(state: ControllerState, velocity: f64) -> Arm {
    let config = Config { safety_input_ramp_ms: RAMP_MS, ..Config::avena() };
    let mut arm = Controller::new(config, [RawPoint::default(); 4]);
    arm.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0, velocity, 0.0, 0.0, 0.0, 0.0]);
    arm.state = state;
    arm.motion.set.hold_for_test();
    arm
}

/// Returns a controller in HoldPos whose joint 2 comes to rest.
fn coming_to_rest() -> Arm {
    let mut arm = arm(ControllerState::HoldPos, 0.5);
    arm.motion.set.hold_measured(&arm.nodes, 200.0, &arm.config);
    assert!(arm.motion.set.coming_to_rest());
    arm
}

/// Lets joint 4 yield.
fn yielding(mut arm: Arm) -> Arm {
    let mut joints = [false; JOINTS];
    joints[3] = true;
    arm.motion.begin_yields(&joints, &[false; JOINTS], &arm.config);
    assert!(arm.motion.law.is_yielding());
    arm
}

/// Evaluates the safety input in one tick. Returns the time since the start of the stop (ms), or `None` if no stop is
/// in progress.
fn watched(arm: &mut Arm, safety_input: bool, missed_ticks: u16) -> Option<u16> {
    arm.watch_safety_input(&Inputs { safety_input, missed_ticks, ..Inputs::QUIET });
    arm.safety_stop_ms
}

/// A stop begins only if no joint yields, and if the arm comes to rest, is in Teaching, or executes a motion.
/// Otherwise the controller switches the torque off at once. A stop also begins if the arm does not move in Teaching,
/// and the arm is then at rest in the next tick.
#[test]
fn j22_an_arm_in_teaching_or_in_execution_or_that_comes_to_rest_stops_first() {
    let operate = |phase: Phase| Arm { phase, ..arm(ControllerState::Operate, 0.0) };
    let cases: [(&dyn Fn() -> Arm, bool); 12] = [
        (&|| arm(ControllerState::HoldPos, 0.0), false),
        // The arm moves, but neither a command nor Teaching causes this motion. The controller therefore switches the
        // torque off at once.
        (&|| arm(ControllerState::HoldPos, 0.5), false),
        (&coming_to_rest, true),
        (&|| yielding(coming_to_rest()), false),
        (&|| arm(ControllerState::Teaching, 0.0), true),
        (&|| arm(ControllerState::Teaching, 0.5), true),
        (&|| yielding(arm(ControllerState::Teaching, 0.5)), false),
        (&|| operate(Phase::Waiting { elapsed_ms: 9 }), false),
        (&|| operate(Phase::AtStart), true),
        (&|| operate(Phase::Running { leave: None }), true),
        (&|| arm(ControllerState::Init, 0.5), false),
        (&|| arm(ControllerState::Error, 0.5), false),
    ];
    for (n, (begin, stops)) in cases.into_iter().enumerate() {
        let mut arm = begin();
        assert_eq!(watched(&mut arm, false, 0), stops.then_some(0), "case {n}");
        assert_eq!(arm.safety_input_releases(false), !stops, "case {n}");
        let mut without_ramp = begin();
        without_ramp.config.safety_input_ramp_ms = 0;
        assert_eq!(watched(&mut without_ramp, false, 0), None, "case {n}");
        assert!(without_ramp.safety_input_releases(false));
        // While the input is 1, no stop begins.
        let mut quiet = begin();
        assert_eq!(watched(&mut quiet, true, 0), None, "case {n}");
        assert!(!quiet.safety_input_releases(true));
    }
}

/// An arm with a joint that is not enabled cannot stop. A joint that is marked as absent has no drive that could be enabled.
#[test]
fn j22_an_arm_stops_only_if_each_present_joint_has_torque() {
    for j in 0..JOINTS {
        for (absent, stops) in [(None, None), (Some(j), Some(0)), (Some((j + 1) % JOINTS), None)] {
            let mut arm = arm(ControllerState::Teaching, 0.5);
            arm.nodes = arm.nodes.with_torque_off(j);
            if let Some(absent) = absent {
                arm.config.absent[absent] = true;
            }
            assert_eq!(watched(&mut arm, false, 0), stops, "joint {}, {absent:?}", j + 1);
        }
    }
}

/// The stop ends Teaching, and ends the execution of a path in the state Stop. A path that is not being executed
/// keeps its state, so the host may resume a paused path.
#[test]
fn j22_a_stop_ends_teaching_and_the_execution_of_a_path() {
    for trajectory in [TrajectoryState::Null, TrajectoryState::Pause, TrajectoryState::Finish] {
        for mut arm in [arm(ControllerState::Teaching, 0.5), coming_to_rest()] {
            (arm.teaching, arm.trajectory) = (true, trajectory);
            assert_eq!(watched(&mut arm, false, 0), Some(0));
            assert_eq!((arm.teaching, arm.trajectory), (false, trajectory));
        }
    }
    let mut arm = arm(ControllerState::Operate, 0.5);
    (arm.trajectory, arm.phase) = (TrajectoryState::Execute, Phase::Running { leave: None });
    assert_eq!(watched(&mut arm, false, 0), Some(0));
    assert_eq!(arm.phase, Phase::Running { leave: Some(TrajectoryState::Stop) });
}

/// The stop ends after the time of the setting `safety_input_ramp_ms`. Missed ticks count as well.
#[test]
fn j22_the_stop_ends_after_the_time_of_the_setting() {
    for (before, missed_ticks, after) in [
        (0, 0, 1),
        (0, 5, 6),
        (RAMP_MS - 2, 0, RAMP_MS - 1),
        (RAMP_MS - 1, 0, OVER),
        (RAMP_MS - 2, 1, OVER),
        (RAMP_MS - 3, 1, RAMP_MS - 1),
        (0, u16::MAX, OVER),
    ] {
        for safety_input in [false, true] {
            let mut arm = coming_to_rest();
            arm.safety_stop_ms = Some(before);
            assert_eq!(watched(&mut arm, safety_input, missed_ticks), Some(after), "{before} {missed_ticks}");
            assert_eq!(arm.safety_input_releases(safety_input), after == OVER);
        }
    }
    // In the tick after the end of the stop, the controller evaluates the level of the input again.
    let mut arm = coming_to_rest();
    arm.safety_stop_ms = Some(OVER);
    assert_eq!(watched(&mut arm, true, 0), None);
}

/// The stop also ends if the arm is at rest, has no torque, or has a joint that yields.
#[test]
fn j22_the_stop_ends_with_the_motion() {
    let executing = || Arm { trajectory: TrajectoryState::Execute, ..arm(ControllerState::HoldPos, 0.0) };
    let cases: [(&dyn Fn() -> Arm, bool); 9] = [
        (&|| arm(ControllerState::HoldPos, 0.0), true),
        (&|| arm(ControllerState::HoldPos, 0.5), false),
        (&coming_to_rest, false),
        (&executing, false),
        (&|| arm(ControllerState::Operate, 0.0), false),
        (&|| yielding(arm(ControllerState::HoldPos, 0.5)), true),
        (&|| yielding(arm(ControllerState::Operate, 0.5)), true),
        (&|| arm(ControllerState::Error, 0.5), true),
        (&|| arm(ControllerState::Init, 0.5), true),
    ];
    for (n, (begin, over)) in cases.into_iter().enumerate() {
        let mut arm = begin();
        arm.safety_stop_ms = Some(5);
        assert_eq!(watched(&mut arm, true, 0), Some(if over { OVER } else { 6 }), "case {n}");
    }
}
