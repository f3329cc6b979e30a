//! Tests of the start of a path and of the approach to it (J-34, J-44, J-60).
use super::*;
use crate::nodes::Nodes;

/// Returns a controller in state Stop with a path of four points at 0 rad. The joints are at 0 rad, and their set positions at `held` rad.
fn stopped_at(held: f64) -> Controller<[RawPoint; 4]> {
    let mut controller = halting_at(0.0);
    (controller.clock, controller.braking_ms) = (PathClock::default(), None);
    controller.trajectory = TrajectoryState::Stop;
    controller.motion.set.begin_at(&[held; JOINTS]);
    controller
}

/// With a torque limit of 1e-6 N·m, no approach is possible. If all joints are held, the controller refuses Execute.
/// If some joints are not enabled yet, the start positions are unknown, so the controller accepts Execute and checks
/// the approach later.
#[test]
fn j34_an_impossible_approach_refuses_execute_only_if_all_joints_are_held() {
    for (torque_max, held, accepted) in
        [(1e-6, false, true), (1e-6, true, false), (1e4, false, true), (1e4, true, true)]
    {
        let mut controller = stopped_at(0.01);
        controller.config.joints.iter_mut().for_each(|limits| limits.torque_max = torque_max);
        if held {
            controller.motion.set.hold_for_test();
        }
        let expected = if accepted { Ok(()) } else { Err(DataStatus::StartPositionMismatch) };
        assert_eq!(controller.start_path(), expected, "{torque_max} N·m, held: {held}");
        let executes = controller.trajectory == TrajectoryState::Execute;
        assert_eq!(executes, accepted, "{torque_max} N·m, held: {held}");
    }
}

/// An approach to a target exactly at the end of a joint's range is accepted. A target outside the range is refused.
#[test]
fn j34_j36_an_approach_does_not_leave_the_range_of_a_joint() {
    for joint in [0, 5] {
        let mut controller = stopped_at(0.0);
        controller.config.joints.iter_mut().for_each(|limits| limits.torque_max = 1e4);
        let (low, high) = PathRange::of(&controller.config, joint, 100).tolerated();
        assert!(low < 0.0 && high > 0.0, "{low} {high}");
        for (position, within) in
            [(low, true), (high, true), (low - 1e-9, false), (high + 1e-9, false), (0.5 * low, true)]
        {
            let mut point = [0.0; JOINTS];
            point[joint] = position;
            assert_eq!(controller.approach_to(&point).is_some(), within, "joint {joint} at {position}");
        }
    }
}

/// If the arm is already at the paused point, path time continues at once. If the arm is away from this point, path
/// time waits until the approach has ended.
#[test]
fn j34_path_time_stands_until_the_arm_is_at_the_paused_point() {
    for (held, runs) in [(0.0, true), (0.01, false)] {
        let mut controller = stopped_at(held);
        controller.config.joints.iter_mut().for_each(|limits| limits.torque_max = 1e4);
        (controller.clock.time, controller.trajectory) = (250.0, TrajectoryState::Pause);
        assert_eq!(controller.resume_path(), Ok(()), "{held} rad");
        assert_eq!(controller.trajectory, TrajectoryState::Execute);
        assert_eq!(controller.phase == Phase::Running { leave: None }, runs, "{held} rad");
        assert_eq!(matches!(controller.phase, Phase::Approaching { .. }), !runs, "{held} rad");
        assert_eq!(controller.clock.standing(), !runs, "{held} rad");
        assert_eq!((controller.clock.time, controller.clock.rate), (250.0, 0.0));
    }
}

/// If the arm is too far from the path when its joints are enabled, the controller stores the cause for the host.
#[test]
fn j34_j69_a_cancelled_approach_is_the_cause_of_the_stop() {
    for (position, cancelled) in [(0.0, false), (0.5, true)] {
        let mut controller = stopped_at(0.0);
        controller.nodes = Nodes::enabled_at([position; JOINTS], [0.0; JOINTS]);
        controller.motion.set.hold_for_test();
        (controller.trajectory, controller.phase) = (TrajectoryState::Execute, Phase::BEGIN);
        controller.walk();
        let expected = if cancelled { TrajectoryState::Stop } else { TrajectoryState::Execute };
        assert_eq!(controller.trajectory, expected, "{position} rad");
        if cancelled {
            let cause = StopCause { kind: StopKind::Approach, joint: 0, value: 0.0, limit: 0.0 };
            assert_eq!(controller.last_stop.cause, cause);
        } else {
            assert_eq!(controller.last_stop.cause, StopCause::default());
        }
    }
}

/// If the payload changes while the arm waits for the start of its path, the learned loads are cleared. The integral
/// still contains the torque of the new payload, so no new load can be learned from it yet.
#[test]
fn j60_a_payload_that_is_added_before_the_path_clears_the_learned_loads() {
    for changes in [false, true] {
        let mut controller = stopped_at(0.0);
        (controller.trajectory, controller.phase) = (TrajectoryState::Execute, Phase::BEGIN);
        controller.motion.law.find_loads_for_test();
        let config = Config::avena();
        if changes {
            controller.parameters.change_payload(&config, 0.5);
        }
        controller.walk();
        let known = controller.motion.law.knows_loads(&[true; JOINTS], &config, true);
        assert_eq!(known, !changes);
    }
}

/// The friction compensation begins with the approach. Only the model torque changes at once in the first tick, so
/// the new friction torque is blended in.
#[test]
fn j44_the_friction_of_an_approach_begins_without_a_step() {
    let from = [0.02, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut controller = stopped_at(0.0);
    controller.nodes = Nodes::enabled_at(from, [0.0; JOINTS]);
    controller.motion.set.hold_for_test();
    begin_approach(&mut controller, from);
    controller.trajectory = TrajectoryState::Execute;
    controller.control(ControlMode::Hold);
    let before = controller.motion.law.torque[0];
    controller.walk();
    controller.control(ControlMode::Approach);
    let after = controller.motion.law.torque[0];
    assert!(before.friction == 0.0 && after.friction.abs() > 1e-4, "{before:?} {after:?}");
    assert!((after.correction() - before.correction()).abs() < 1e-9, "{before:?} {after:?}");
}
