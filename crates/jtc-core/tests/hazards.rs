//! Tests of situations in which a controller that follows each rule separately would drop, jerk or misplace an arm.
use crate::rig;

use jtc_bus::{NodeState, Request, warning};
use jtc_core::{Config, ControllerState, TrajectoryState, error};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use rig::{Rig, floats, model_body, pieces, rad, rest, segment_body};

/// Returns a configuration with very high limits, except for the limits under test.
fn roomy(mut config: Config, acceleration_max: f64) -> Config {
    for j in &mut config.joints {
        j.torque_max = 1e6;
        j.position_error_max = 10.0;
        j.acceleration_max = acceleration_max;
    }
    config
}

#[test]
fn j16_drives_that_lost_their_supply_are_configured_again() {
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    for node in &mut rig.nodes {
        node.report.position = 0.7;
    }
    rig.defaults();
    rig.until(300, |r| r.nodes[2].configured && r.nodes[2].report.state == NodeState::INIT);
    rig.run(1);
    // An emergency stop also cuts the supply of the drives. At this time, the drives are configured but still in Init.
    // The drives must be configured again afterwards.
    rig.safety_input = false;
    rig.run(3);
    for node in &mut rig.nodes {
        node.restart();
        node.booting = 300;
    }
    rig.run(1000);
    rig.safety_input = true;
    rig.clear(true, 0x7F);
    rig.run(300);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert!(rig.nodes.iter().all(|n| n.configured));
    for joint in &rig.controller.telemetry().joints {
        assert!((joint.set_position - 0.7).abs() < 1e-6, "held where it is: {}", joint.set_position);
    }
}

#[test]
fn j33_a_stop_after_teaching_never_comes_back_after_a_trajectory() {
    let mut rig = Rig::holding();
    rig.ask(FrameType::TeachingModeEnable, &[]);
    rig.run(150);
    rig.nodes[0].report.velocity = 0.05;
    rig.run(2);
    rig.send(FrameType::TeachingModeDisable, &[]);
    let points = pieces(0, &[(0.05, 20), (0.0, 60), (-0.05, 20)]);
    rig.send(FrameType::Trajectory, &segment_body(7, 0, 1, 10, &points));
    rig.run(5);
    rig.nodes[0].report.velocity = 0.0;
    // The controller refuses Execute until the arm is at rest after hand guiding.
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    rig.run(500);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    let mut last = rig.controller.telemetry();
    for _ in 0..2500 {
        rig.tick();
        let t = rig.controller.telemetry();
        assert!((t.joints[0].set_position - last.joints[0].set_position).abs() < 2e-4, "{last:?} {t:?}");
        last = t;
    }
    assert_eq!(
        (last.trajectory, last.state, last.errors),
        (TrajectoryState::Finish, ControllerState::HoldPos, 0)
    );
    assert_eq!(last.joints[0].set_position, rad(points.last().unwrap().position[0]));
}

/// During a pause or a resume at any time of a valid motion, the arm stays within the acceleration limit. After the pause, the arm is at
/// rest.
#[test]
fn j33_pause_and_resume_keep_to_the_acceleration_limit() {
    let braking = pieces(0, &[(10.77, 13), (0.0, 60), (-10.77, 13)]);
    let stages = pieces(0, &[(2.0, 20), (0.0, 60), (3.8, 25), (0.0, 60), (-3.8, 35), (0.0, 5)]);
    for (points, limit, at) in [
        (&braking, 12.56637, [50, 100, 400, 650, 690, 710, 725, 735, 780]),
        (&stages, 4.0, [100, 400, 640, 680, 750, 800, 900, 1300, 1700]),
    ] {
        for pause_at in at {
            let mut rig = Rig::holding_with(roomy(Config::avena(), limit));
            rig.move_along(points, pause_at);
            rig.exec(ExecCommand::Pause);
            rig.until(4000, |r| r.trajectory() != TrajectoryState::Execute);
            assert_eq!(rig.errors(), 0, "pause at {pause_at}");
            if rig.trajectory() == TrajectoryState::Pause {
                rig.exec(ExecCommand::Execute);
                rig.until(6000, |r| r.trajectory() != TrajectoryState::Execute);
            }
            assert_eq!((rig.errors(), rig.trajectory()), (0, TrajectoryState::Finish), "pause at {pause_at}");
        }
    }
}

#[test]
fn j33_a_pause_during_a_resume_slows_down() {
    let points = pieces(0, &[(3.8, 35), (0.0, 100), (-3.8, 35)]);
    for wait in [20, 60, 100, 130, 160] {
        let mut rig = Rig::holding_with(roomy(Config::avena(), 4.0));
        rig.move_along(&points, 500);
        rig.exec(ExecCommand::Pause);
        rig.until(3000, |r| r.trajectory() == TrajectoryState::Pause);
        rig.exec(ExecCommand::Execute);
        rig.run(wait);
        let before = rig.controller.telemetry().joints[0].set_velocity;
        rig.exec(ExecCommand::Pause);
        let mut top = before;
        let ticks = rig.until(3000, |r| {
            top = top.max(r.controller.telemetry().joints[0].set_velocity);
            r.trajectory() == TrajectoryState::Pause
        });
        assert!(top < before + 0.06, "from {before} up to {top} rad/s");
        assert!(ticks < 600, "{ticks}");
        assert_eq!(rig.errors(), 0);
    }
}

#[test]
fn j33_a_pause_on_the_way_to_point_0_has_no_step_of_velocity() {
    let mut rig = Rig::holding();
    let points: Vec<_> = (0..10).map(|_| rest(200)).collect();
    rig.execute(&points);
    rig.run(98);
    rig.send(FrameType::TrajSetExecStatus, &[2]);
    let mut last = rig.controller.telemetry().joints[0].set_velocity;
    for _ in 0..300 {
        rig.tick();
        let v = rig.controller.telemetry().joints[0].set_velocity;
        assert!((v - last).abs() < 0.01, "{last} to {v} rad/s");
        last = v;
    }
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Pause, 0));
    // The arm has already left point 0.
    let set = rig.controller.telemetry().joints[0].set_position;
    assert!(0.0 < set && set < rad(200), "{set}");
    rig.exec(ExecCommand::Execute);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Finish);
}

#[test]
fn j21_a_clear_does_not_drop_a_joint_whose_fault_is_history() {
    for teaching in [false, true] {
        let mut rig = Rig::holding();
        rig.nodes[1].report.mc_occurred = 4;
        rig.run(5);
        if teaching {
            rig.ask(FrameType::TeachingModeEnable, &[]);
        }
        rig.ask(FrameType::ClearCurrentErrors, &[]);
        rig.run(50);
        assert_eq!(rig.errors(), 0);
        assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED));
    }
}

#[test]
fn j21_a_clear_waits_as_long_as_the_node_takes() {
    let mut rig = Rig::holding();
    rig.nodes[1].fault();
    rig.run(3);
    rig.nodes[1].report.state = NodeState::FAULT_REACTION;
    rig.clear(true, 1 << 1);
    rig.run(6000);
    rig.nodes[1].report.state = NodeState::FAULT;
    rig.run(300);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
}

#[test]
fn j21_healthy_joints_are_brought_to_ready_in_error() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.until(300, |r| r.nodes[2].configured && r.nodes[2].report.state == NodeState::INIT);
    rig.run(1);
    rig.safety_input = false;
    rig.run(50);
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::READY));
}

#[test]
fn j43_an_arm_beyond_a_position_limit_is_held_and_can_be_taught_back() {
    let mut rig = Rig::new(Config::avena());
    rig.nodes[1].report.position = 1.6;
    rig.follow = false;
    rig.defaults();
    rig.run(400);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::Teaching);
    // After Teaching, the controller must still refuse a trajectory outside the limits.
    rig.ask(FrameType::TeachingModeDisable, &[]);
    rig.run(300);
    rig.follow = true;
    let out: Vec<_> =
        (0..10).map(|_| RawPoint { position: [0, (1.6 / rad(1)) as i16, 0, 0, 0, 0], ..rest(0) }).collect();
    let answer = rig.ask(FrameType::Trajectory, &segment_body(7, 0, 1, 10, &out));
    assert_eq!((answer, rig.trajectory()), (DataStatus::IncorrectValue, TrajectoryState::Null));
}

#[test]
fn j44_a_joint_that_is_enabled_late_starts_from_its_model_torque() {
    // A joint that has sagged is enabled late, while the other joints come to rest after Teaching.
    let mut rig = Rig::with_a_slow_drive(roomy(Config::avena(), 100.0));
    rig.run(50);
    rig.ask(FrameType::TeachingModeEnable, &[]);
    rig.run(150);
    rig.nodes[0].report.velocity = 0.3;
    rig.follow = false;
    rig.run(3);
    rig.send(FrameType::TeachingModeDisable, &[]);
    for _ in 0..60 {
        rig.nodes[2].report.position += 0.00005;
        rig.tick();
    }
    rig.nodes[2].report.state = NodeState::ENABLED;
    for _ in 0..20 {
        rig.tick();
        let t = rig.controller.telemetry().joints[2];
        assert!((t.torque - t.torque_model).abs() < 1.0 || t.state != NodeState::ENABLED, "{t:?}");
    }
    // In this frame, the range from the lower to the upper bound of the integral does not contain zero.
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.send(FrameType::PidParam, &floats((0..6).flat_map(|_| [100.0, 10.0, 1.0, 1.0, 2.0])));
    let mut last = 0.0;
    for _ in 0..300 {
        rig.tick();
        let t = rig.controller.telemetry().joints[0];
        let correction = t.torque - t.torque_model;
        assert!(f64::abs(correction - last) < 0.5, "{last} to {correction}");
        last = correction;
    }
}

#[test]
fn j25_the_brake_leaves_room_for_what_is_being_blended_out() {
    let mut rig = Rig::holding();
    rig.follow = false;
    rig.nodes[5].report.position = 0.0003;
    rig.run(30);
    rig.ask(FrameType::TeachingModeEnable, &[]);
    rig.nodes[5].report.velocity = 1.75;
    rig.run(40);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
}

#[test]
fn j12_torque_is_taken_away_before_anything_else_is_sent() {
    let mut rig = Rig::holding();
    rig.follow = false;
    rig.nodes[1].report.position = 0.002;
    rig.run(50);
    let from = rig.sent.len();
    rig.nodes[2].configured = false;
    rig.nodes[2].report.state = NodeState::INIT;
    rig.run(9);
    assert_eq!(rig.state(), ControllerState::Init);
    let mut rest = rig.sent[from..]
        .iter()
        .skip_while(|r| matches!(r, Request::Move { torque, .. } if *torque != [0.0; 6]));
    assert_eq!(*rest.next().unwrap(), Request::Move { torque: [0.0; 6], pump: false });
    // The controller disables joints that are still enabled before it configures the joint that has changed back to Init.
    let next = rest.find(|r| !matches!(r, Request::Move { .. })).unwrap();
    assert!(matches!(next, Request::ChangeFsm { .. }), "{next:?}");
}

#[test]
fn j12_the_first_frame_after_an_error_is_move_in_init_too() {
    let run = |ticks: usize| {
        let mut rig = Rig::new(Config::avena());
        rig.run(ticks);
        rig
    };
    // `others` contains the ticks of the bring-up in which the controller sends a reset, a configuration or a change of state instead of a
    // Move.
    let healthy = run(300).sent;
    let others: Vec<usize> =
        (0..300).filter(|&tick| !matches!(healthy[tick], Request::Move { .. })).collect();
    assert!(matches!(others[..], [reset, mode, state, ..]
        if healthy[reset] == Request::ResetAll
            && matches!(healthy[mode], Request::ChangeMode { .. })
            && matches!(healthy[state], Request::ChangeFsm { .. })));
    for tick in others {
        let mut rig = run(tick);
        assert_eq!(rig.state(), ControllerState::Init);
        rig.safety_input = false;
        rig.tick();
        assert_eq!(
            *rig.sent.last().unwrap(),
            Request::Move { torque: [0.0; 6], pump: false },
            "instead of {:?} in tick {tick}",
            healthy[tick]
        );
        // The emergency stop has only postponed the frame of the bring-up. The controller must send this frame after
        // the clear.
        rig.safety_input = true;
        rig.clear(true, 0x7F);
        rig.run(300);
        assert!(
            rig.nodes.iter().all(|n| n.report.state == NodeState::READY && n.configured && n.resets == 1)
        );
    }
}

#[test]
fn j16_a_joint_that_loses_its_position_in_motion_is_an_error() {
    let mut rig = Rig::holding();
    rig.nodes[3].report.warnings = warning::POSITION_NOT_ACCURATE;
    rig.run(2);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
    rig.nodes[3].report.warnings = 0;
    rig.run(300);
    assert_eq!(rig.state(), ControllerState::Error, "it does not hold again by itself");
}

#[test]
fn j42_drives_send_temperatures_below_zero_modulo_256() {
    let run = |byte: u8| {
        let mut rig = Rig::holding();
        rig.nodes[1].report.temperature = byte;
        let mut point = RawPoint::default();
        point.velocity[1] = 1000;
        let mut points = [point; 50];
        (points[0], points[49]) = (rest(0), rest(0));
        rig.move_along(&points, 20);
        rig.controller.telemetry().joints[1].torque_friction
    };
    assert!(run(251) > run(0), "cold grease is stiffer");
    assert!(run(0) > run(40));
}

#[test]
fn j14_a_silent_node_is_seen_within_seven_frames() {
    let mut rig = Rig::holding();
    rig.nodes[4].silent = true;
    let ticks = rig.until(30, |r| r.state() == ControllerState::Error);
    assert!(ticks <= 7, "{ticks}");
}

#[test]
fn j44_a_new_model_under_a_holding_arm_makes_no_step() {
    // For an arm on a wall, gravity acts on the links sideways. The host sends a model with heavier links.
    let mut rig = Rig::holding_with(Config { gravity: [0.0, 9.81, 0.0], ..Config::avena() });
    let mut model = jtc_core::Parameters::avena().model;
    model.links.iter_mut().for_each(|link| link.mass *= 1.2);
    let before = rig.controller.telemetry().joints[1].torque;
    rig.send(FrameType::ArmModel, &model_body(&model));
    let mut last = before;
    for _ in 0..200 {
        rig.tick();
        let torque = rig.controller.telemetry().joints[1].torque;
        assert!((torque - last).abs() < 1.0, "{last} to {torque}");
        last = torque;
    }
    assert!((last - 1.2 * before).abs() < 0.02 * before.abs(), "{before} to {last}");
}

/// A torque that alternates between its two limits stays at each limit only for a short time. The controller must
/// detect this as an error nevertheless.
#[test]
fn j43_torque_that_swings_between_its_limits_is_an_error() {
    for held_ms in [0, 1_000] {
        let swung = swings_until_error(held_ms);
        // Directly after enabling, the controller treats the first half of a swing as a load that it must catch. The
        // error may therefore come up to 10 ticks later.
        assert!((10..=40 + 10 * usize::from(held_ms == 0)).contains(&swung), "{swung}");
    }
}

/// Returns the number of ticks from the start of a swing between the torque limits until the error. Before this swing, the arm was held for
/// `held_ms`.
fn swings_until_error(held_ms: usize) -> usize {
    let mut config = Config { torque_release: true, ..Config::avena() };
    config.joints[0].torque_max = 10.0;
    // With these parameter bounds, a joint may have more friction than its torque limit.
    (config.parameter_bounds.friction_max, config.parameter_bounds.slow_friction_max) = (10.0, 10.0);
    let mut rig = Rig::holding_with(config);
    rig.run(held_ms);
    rig.follow = false;
    let mut swung = 0;
    for k in 0..200 {
        // At a Kp of 8000, a position error of 4 mrad causes a torque of 32 N·m. The sign of the position error
        // changes every 8 ms.
        rig.nodes[0].report.position = if (k / 8) % 2 == 0 { 4e-3 } else { -4e-3 };
        rig.tick();
        if rig.state() == ControllerState::Error {
            break;
        }
        swung += 1;
    }
    assert_ne!(rig.errors() & error::INTERNAL_JOINTS, 0);
    assert_eq!(rig.controller.telemetry().joints[0].internal, jtc_core::joint_error::TORQUE);
    swung
}
