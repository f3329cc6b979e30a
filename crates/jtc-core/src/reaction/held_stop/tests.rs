//! Tests of the held stop and its cause (J-25, J-69).
use jtc_wire::ControllerState;

use super::*;
use crate::Config;
use crate::execution::phase::Phase;
use crate::interpolation::SetPoint;
use crate::motion::{JointTorque, PidTorque};
use crate::nodes::Nodes;
use crate::trajectory::path::PathClock;

/// Index of the joint that moves in these tests.
const J: usize = 2;

#[test]
fn j69_only_the_joints_of_a_mask_get_the_error() {
    assert_eq!(errors_of(0b10_0010, 7), [0, 7, 0, 0, 0, 7]);
}

/// Returns `value` for the joint with index [`J`], and 0 for the other joints.
fn third(value: f64) -> [f64; JOINTS] {
    core::array::from_fn(|j| if j == J { value } else { 0.0 })
}

/// Returns a controller whose joint 3 has other limits than the other joints.
fn controller() -> Controller<[RawPoint; 4]> {
    let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
    let limits = &mut controller.config.joints[J];
    (limits.position_min, limits.position_max) = (-2.0, 1.0);
    (limits.velocity_max, limits.acceleration_max) = (1.5, 8.0);
    (limits.torque_max, limits.position_error_max) = (64.0, 0.125);
    controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
    controller.state = ControllerState::HoldPos;
    controller
}

/// The cause of a stop contains the value of the first joint with an error, and its limit, in the unit of its kind.
#[test]
fn j69_a_cause_shows_the_value_and_the_limit_of_its_kind() {
    let set = |position: f64, velocity: f64, acceleration: f64| SetPoint {
        position: third(position),
        velocity: third(velocity),
        acceleration: third(acceleration),
    };
    let still = set(0.0, 0.0, 0.0);
    for (kind, point, value, limit) in [
        // The value is the sum of 5 N·m (model), 2 − 0.5 + 1 N·m (position controller) and 3 N·m (friction).
        (StopKind::Overload, still, 10.5, 64.0),
        (StopKind::Unstable, still, 10.5, 64.0),
        // The value is the torque of the position controller alone. The limit is a quarter of the torque limit.
        (StopKind::Push, still, 2.5, 16.0),
        // The joint moves at 1 rad/s, and the commanded velocity is 0.25 rad/s. The limit is a fifth (`RUSH`) of the
        // velocity limit of 1.5 rad/s.
        (StopKind::Shove, set(0.0, 0.25, 0.0), 0.75, 0.3),
        (StopKind::Shove, set(0.0, -0.5, 0.0), 1.5, 0.3),
        // The due position is 0.75 rad, and the measured position is 0.5 rad.
        (StopKind::PositionError, still, 0.25, 0.125),
        (StopKind::Position, set(1.25, 0.0, 0.0), 1.25, 1.0),
        (StopKind::Position, set(0.0, 0.0, 0.0), 0.0, -2.0),
        (StopKind::Position, set(-2.5, 0.0, 0.0), -2.5, -2.0),
        (StopKind::Velocity, set(0.5, -1.75, 9.0), -1.75, 1.5),
        (StopKind::FrictionTable, set(0.5, 1.25, 9.0), 1.25, 1.5),
        (StopKind::Acceleration, set(0.5, 1.75, -9.0), -9.0, 8.0),
        (StopKind::Gains, set(0.5, 1.75, 9.0), 0.0, 0.0),
        (StopKind::Approach, set(0.5, 1.75, 9.0), 0.0, 0.0),
    ] {
        let mut controller = controller();
        controller.config.yield_torque_share = 0.25;
        controller.nodes = Nodes::enabled_at(third(0.5), third(1.0));
        controller.nodes.move_at(J, 1.0);
        controller.motion.set.commanded.rest(&third(0.75));
        controller.motion.set.point = point;
        controller.motion.law.torque[J] = JointTorque {
            model: 5.0,
            pid: PidTorque { p: 2.0, i: 1.0, d: -0.5 },
            friction: 3.0,
            ..JointTorque::default()
        };
        controller.motion.law.find_loads_for_test();
        let (found, most) = controller.measure(kind, J);
        assert!((found - value).abs() < 1e-12 && (most - limit).abs() < 1e-12, "{kind:?}: {found} {most}");
        controller.observed.tick = 1;
        controller.hold_stop(&[0, 0, 1, 0, 0, 2], kind);
        let expected = StopCause { kind, joint: 3, value: value as f32, limit: limit as f32 };
        assert_eq!(controller.last_stop.cause, expected);
    }
}

#[test]
fn j69_a_joint_index_out_of_range_is_the_last_joint() {
    let mut controller = controller();
    controller.config.joints[5].velocity_max = 0.5;
    controller.motion.set.point.velocity[5] = 0.75;
    for joint in [5, 6, usize::MAX] {
        assert_eq!(controller.measure(StopKind::Velocity, joint), (0.75, 0.5));
    }
}

/// If a Stop was accepted before the held stop, the trajectory still ends in the state Stop. A held stop alone ends
/// the execution in the state Pause.
#[test]
fn j33_j69_a_held_stop_does_not_change_the_end_of_a_stop() {
    let (pause, stop) = (Some(TrajectoryState::Pause), Some(TrajectoryState::Stop));
    for (executes, leave, expected) in
        [(true, None, pause), (true, pause, pause), (true, stop, stop), (false, None, None)]
    {
        let mut controller = controller();
        controller.phase = Phase::Running { leave };
        controller.trajectory = if executes { TrajectoryState::Execute } else { TrajectoryState::Finish };
        controller.hold_stop(&errors_of(1 << J, joint_error::TORQUE), StopKind::Push);
        assert_eq!(controller.phase.leave(), expected, "{executes} {leave:?}");
        assert_eq!(controller.braking_ms.is_some(), executes && leave.is_none(), "{executes} {leave:?}");
    }
}

/// The limit is three quarters of the over-speed threshold, here 0.75 · 2 · ⅓ rad/s = 0.5 rad/s. The speed from positions is the distance
/// from the filtered position divided by 4 ms, so 4 mrad in the first tick are 1 rad/s. The reported speed must be above half of the limit.
#[test]
fn j25_teaching_ends_if_both_speeds_show_that_a_hand_moves_a_joint_too_fast() {
    const WAY: f64 = 0.004_f32 as f64;
    for (way, reported, ends) in [
        (WAY, 0.5, true),
        (WAY, 0.26, true),
        (WAY, 0.25, false),
        (WAY, 0.0, false),
        (WAY, -0.5, false),
        (0.5 * WAY, 0.5, false),
        (0.51 * WAY, 0.5, true),
        (0.25 * WAY, 2.0, false),
    ] {
        for sign in [1.0, -1.0] {
            let mut controller = controller();
            controller.config.overspeed_factor = 2.0;
            controller.config.joints[J].velocity_max = 1.0 / 3.0;
            assert_eq!(too_fast(&controller.config.joints[J], &controller.config), 0.5);
            controller.state = ControllerState::Teaching;
            controller.teaching = true;
            controller.motion.law.begin_teaching(&controller.nodes, &controller.config);
            controller.nodes = Nodes::enabled_at(third(sign * way), third(sign * reported));
            controller.end_fast_teaching(0);
            let case = (sign * way, sign * reported);
            assert_eq!(controller.teaching, !ends, "{case:?}");
            let torque = if ends { joint_error::TORQUE } else { 0 };
            let errors: [u16; JOINTS] = core::array::from_fn(|j| controller.errors.joint(j).0);
            assert_eq!(errors, [0, 0, torque, 0, 0, 0], "{case:?}");
            if ends {
                let StopCause { kind, joint, value, limit } = controller.last_stop.cause;
                assert_eq!((kind, joint, limit), (StopKind::Shove, 3, 0.5), "{case:?}");
                let speed = (sign * way / 0.004) as f32;
                assert!((value - speed).abs() < 1e-6, "{case:?}: {value}");
            }
        }
    }
}

/// In the mask of the yielding joints, bit 0 is joint 1. The rate is the rate of path time, or of the approach during
/// an approach. Without an execution, the rate is 0.
#[test]
fn j69_the_reactions_show_the_joints_that_yield_and_the_rate_of_the_motion() {
    let (mut path, mut approach) = (PathClock::start(1.0), PathClock::start(1.0));
    (path.rate, approach.rate) = (0.5, 0.25);
    let approaching =
        Phase::Approaching { from: [0.0; JOINTS], length_ms: 200.0, clock: approach, leave: None };
    let running = Phase::Running { leave: None };
    for (phase, trajectory, rate) in [
        (running, TrajectoryState::Execute, 0.5),
        (approaching, TrajectoryState::Execute, 0.25),
        (running, TrajectoryState::Pause, 0.0),
        (approaching, TrajectoryState::Finish, 0.0),
    ] {
        let mut controller = controller();
        (controller.phase, controller.trajectory, controller.clock) = (phase, trajectory, path);
        assert_eq!(controller.reactions().yields, 0);
        let yields = [false, true, false, false, true, false];
        controller.motion.begin_yields(&yields, &[false; JOINTS], &controller.config);
        let reactions = controller.reactions();
        assert_eq!(reactions.yields, 0b01_0010);
        assert_eq!((reactions.rate, reactions.stop), (rate, None), "{trajectory:?}");
    }
}
