//! Tests of the order of the bring-up: when reports become valid, and which frames each node gets (J-16, J-20, J-21).
use crate::rig;

use jtc_bus::{Answer, Frame, JointReport, NodeState, Request, Target, warning};
use jtc_core::{Config, ControllerState, error};
use jtc_wire::{DataStatus, FrameType};
use rig::{Rig, SCALE};

const JOINT: usize = 2;

fn configures(request: &Request) -> bool {
    matches!(request, Request::ChangeMode { .. })
}

fn target_of(request: &Request) -> Target {
    match request {
        Request::ChangeFsm { target } => target[JOINT],
        _ => Target::NoChange,
    }
}

fn joint_answer(position: f64, state: NodeState) -> Frame {
    let report = JointReport { position, state, temperature: 25, ..JointReport::default() };
    Answer::Joint { node: JOINT as u8, report }.emit(SCALE)
}

/// A drive reports position 0 until it is configured, even in the tick in which it accepts its configuration. The
/// controller must not use this position.
#[test]
fn j16_the_position_does_not_count_in_the_tick_of_the_configuration() {
    for move_first in [false, true] {
        let mut rig = Rig::new(Config::avena());
        rig.follow = false;
        rig.until(300, |r| r.sent.last().is_some_and(configures));
        let mode = Answer::Mode { node: JOINT as u8, accepted: true }.emit(SCALE);
        let moved = joint_answer(0.6, NodeState::INIT);
        rig.inject = if move_first { vec![moved, mode] } else { vec![mode, moved] };
        rig.tick();
        let joint = rig.controller.telemetry().joints[JOINT];
        assert_eq!((joint.position, joint.state), (0.0, NodeState::INIT));
        assert_ne!(rig.status().node_init & 1 << JOINT, 1 << JOINT, "it counts from the next answer on");
        rig.inject = vec![joint_answer(0.01, NodeState::INIT)];
        rig.tick();
    }
}

/// After a restart, the controller ignores an answer that the node sent before its reset.
#[test]
fn j20_late_answers_after_a_reset_do_not_count() {
    let mut rig = Rig::holding();
    rig.ask(FrameType::ResetCanDevices, &[1 << JOINT, 0, 0, 0]);
    rig.until(20, |r| r.sent.last() == Some(&Request::Reset(JOINT as u8)));
    let late = [
        joint_answer(0.6, NodeState::ENABLED),
        Answer::Mode { node: JOINT as u8, accepted: true }.emit(SCALE),
        joint_answer(0.6, NodeState::READY),
    ];
    let from = rig.sent.len();
    for tick in 0..15 {
        let mut answers = vec![late[tick % 3]];
        for node in (0..6).filter(|&node| node != JOINT) {
            let report = JointReport { state: rig.nodes[node].report.state, ..rig.nodes[node].report };
            answers.push(Answer::Joint { node: node as u8, report }.emit(SCALE));
        }
        rig.inject = answers;
        rig.tick();
        assert_eq!(rig.state(), ControllerState::Init);
        assert_eq!(rig.controller.telemetry().joints[JOINT].position, 0.0);
    }
    assert!(rig.sent[from..].iter().all(|r| target_of(r) == Target::NoChange), "nothing is asked of it yet");
    rig.inject.clear();
    rig.run(500);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert!(rig.nodes[JOINT].configured);
}

/// Some drives accept their configuration only in Init. If a node in ReadyToOperate refuses its configuration, the
/// controller therefore requests Init.
#[test]
fn j20_a_ready_node_that_refuses_its_configuration_is_sent_to_init() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.nodes[JOINT].refuses_when_ready = true;
    rig.until(300, |r| r.nodes[JOINT].booting == 0 && r.nodes[JOINT].resets == 1);
    rig.nodes[JOINT].report.state = NodeState::READY;
    rig.run(400);
    let requests = &rig.sent;
    assert!(requests.iter().any(|r| target_of(r) == Target::Init));
    assert!(rig.nodes[JOINT].configured);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
}

/// The controller changes from Error to HoldPos only when the joints are in ReadyToOperate. The controller first disables a joint that is
/// still enabled.
#[test]
fn j21_error_is_not_left_for_hold_pos_while_a_joint_is_not_ready() {
    let mut rig = Rig::holding();
    rig.nodes[JOINT].stays_enabled = true;
    rig.press_stop(50);
    rig.clear(true, 0x7F);
    for _ in 0..200 {
        rig.tick();
        assert_eq!(rig.state(), ControllerState::Init);
        assert_eq!(rig.torque, [0.0; 6]);
    }
    rig.nodes[JOINT].stays_enabled = false;
    rig.run(800);
    assert_eq!(rig.state(), ControllerState::HoldPos);
}

/// A node in state 10 (the transition from Start to Init) has not reached Init yet, so the clear is not complete.
#[test]
fn j21_a_clear_ends_in_init_and_not_on_the_way_there() {
    let mut rig = Rig::holding();
    rig.nodes[JOINT].fault();
    rig.run(3);
    rig.nodes[JOINT].report.state = NodeState::FAULT_REACTION;
    assert_eq!(rig.clear(true, 1 << JOINT), DataStatus::NoError);
    rig.run(20);
    rig.nodes[JOINT].report =
        JointReport { state: NodeState::START_TO_INIT, temperature: 25, ..JointReport::default() };
    rig.run(3);
    let from = rig.sent.len();
    rig.run(100);
    assert_eq!(rig.state(), ControllerState::Error, "it is still being cleared");
    assert!(rig.sent[from..].iter().any(|r| target_of(r) == Target::Init), "the command stands");
    rig.nodes[JOINT].report.state = NodeState::INIT;
    rig.nodes[JOINT].configured = false;
    rig.run(800);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
}

/// The controller does not configure a node in Error, or while it clears this node.
#[test]
fn j21_nodes_are_not_configured_in_error_nor_while_they_are_cleared() {
    let mut rig = Rig::holding();
    rig.safety_input = false;
    rig.run(50);
    // The node has restarted, so the node has lost its configuration.
    rig.nodes[JOINT].restart();
    let from = rig.sent.len();
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(!rig.sent[from..].iter().any(configures));

    // In Init, the node waits in ReadyToOperate without a configuration, and has an error that must be cleared.
    let mut rig = Rig::new(Config::avena());
    rig.until(300, |r| r.nodes[JOINT].booting == 0 && r.nodes[JOINT].resets == 1);
    rig.nodes[JOINT].report.state = NodeState::READY;
    rig.nodes[JOINT].report.mc_occurred = 4;
    rig.nodes[JOINT].refuses_when_ready = true;
    rig.nodes[JOINT].stays_ready = true;
    rig.run(3);
    rig.clear(false, 1 << JOINT);
    rig.run(150);
    let from = rig.sent.len();
    rig.run(200);
    assert_eq!(rig.state(), ControllerState::Init);
    assert!(!rig.sent[from..].iter().any(configures));
    assert!(rig.sent[from..].iter().any(|r| target_of(r) == Target::Init));
}

/// The words of occurred errors report past errors. The words of current errors report present errors.
#[test]
fn j21_occurred_errors_are_not_reported_as_current() {
    // The rig causes an error of a joint, and then a CAN timeout.
    let mut rig = Rig::holding_with(Config { torque_release: true, ..Config::avena() });
    rig.push(JOINT, 0.2);
    rig.run(50);
    assert_eq!(rig.state(), ControllerState::Error);
    rig.follow = true;
    rig.nodes[JOINT + 1].silent = true;
    rig.run(10);
    rig.nodes[JOINT + 1].silent = false;
    rig.run(10);
    let latched = rig.status();
    assert!(latched.errors != 0 && latched.can_current != 0 && latched.joints[JOINT].internal != 0);
    assert_eq!(latched.can_error, 1);
    rig.clear(true, 0x7F);
    rig.run(800);
    let status = rig.status();
    assert_eq!((status.errors, status.can_current, status.can_error), (0, 0, 0));
    assert_eq!(status.joints.map(|j| j.internal), [0; 6]);
    assert_eq!(rig.controller.telemetry().joints.map(|j| j.internal), [0; 6]);
    assert_eq!((status.occurred, status.can_occurred), (latched.occurred, latched.can_occurred));
    assert_eq!(status.joints[JOINT].internal_occurred, latched.joints[JOINT].internal_occurred);
    assert!(status.occurred != 0 && status.can_occurred != 0 && status.joints[JOINT].internal_occurred != 0);
}

/// The drive must change to Init to clear its error. Even if the last parameter arrives in the next frame, the arm is held only after the
/// drive has cleared its error.
#[test]
fn j21_what_is_being_cleared_in_init_is_cleared_before_the_arm_is_held() {
    let mut rig = Rig::new(Config::avena());
    rig.run(300);
    rig.send(FrameType::PidParamUseDefault, &[]);
    rig.send(FrameType::ArmModelUseDefault, &[]);
    rig.run(20);
    rig.nodes[2].report.mc_occurred = 4;
    rig.run(20);
    assert_eq!((rig.state(), rig.status().node_init), (ControllerState::Init, 0));
    rig.send(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0]);
    rig.send(FrameType::FrictionPolynomialUseDefault, &[]);
    rig.nodes[2].stays_ready = true;
    for _ in 0..50 {
        rig.tick();
        assert_eq!(rig.state(), ControllerState::Init);
    }
    rig.nodes[2].stays_ready = false;
    rig.until(500, |rig| rig.state() == ControllerState::HoldPos);
}

#[test]
fn j20_boot_resets_every_node_once_and_brings_them_to_ready() {
    let mut rig = Rig::new(Config::avena());
    rig.run(500);
    // Without parameters, the controller stays in Init and does not enable any joint.
    assert_eq!(rig.state(), ControllerState::Init);
    assert!(rig.nodes.iter().all(|n| n.resets == 1 && n.report.state == NodeState::READY && n.configured));
    let status = rig.status();
    assert_eq!((status.jtc_init, status.node_init), (0b111, 0));
    // Each received parameter clears its bit in the status. After the last parameter, Init ends.
    for (t, left) in [
        (FrameType::PidParamUseDefault, 0b101),
        (FrameType::FrictionTableUseDefault, 0b100),
        (FrameType::ArmModelUseDefault, 0b000),
    ] {
        assert_eq!(rig.ask(t, &[]), DataStatus::NoError);
        assert_eq!(rig.status().jtc_init, left);
    }
    assert_eq!(rig.state(), ControllerState::HoldPos);
    rig.run(100);
    assert!(rig.nodes.iter().all(|n| n.report.state == NodeState::ENABLED && n.resets == 1));
}

#[test]
fn j20_no_node_is_enabled_before_the_reset_of_the_boot() {
    let mut rig = Rig::new(Config::avena());
    for node in &mut rig.nodes {
        node.report.state = NodeState::READY;
        node.configured = true;
    }
    rig.defaults();
    rig.run(40);
    let reset = rig.sent.iter().position(|r| *r == Request::ResetAll).expect("a reset");
    for request in &rig.sent[..reset] {
        assert!(matches!(request, Request::Move { torque, .. } if *torque == [0.0; 6]));
    }
    assert_eq!(rig.sent.iter().filter(|r| **r == Request::ResetAll).count(), 1);
}

#[test]
fn j20_waits_for_accurate_positions() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.run(30);
    rig.nodes[3].report.warnings = warning::POSITION_NOT_ACCURATE;
    rig.run(300);
    assert_eq!(rig.state(), ControllerState::Init);
    assert_eq!(rig.status().node_init, 1 << 3);
    rig.nodes[3].report.warnings = 0;
    rig.run(5);
    assert_eq!(rig.state(), ControllerState::HoldPos);
}

#[test]
fn j20_a_node_that_falls_back_to_init_takes_the_controller_back() {
    let mut rig = Rig::holding();
    rig.nodes[2].configured = false;
    rig.nodes[2].report.state = NodeState::INIT;
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::Init);
    assert_eq!(rig.torque, [0.0; 6]);
    assert_eq!(rig.errors(), 0);
    rig.run(200);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert!(rig.nodes.iter().all(|n| n.resets == 1), "later entries reset none");
}

#[test]
fn j20_the_gripper_can_be_absent() {
    let mut rig = Rig::new(Config { gripper: false, ..Config::avena() });
    rig.nodes[6].silent = true;
    rig.defaults();
    rig.run(3000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
}

#[test]
fn j16_leaving_operation_enable_unasked_is_an_error() {
    let mut rig = Rig::holding();
    rig.nodes[3].report.state = NodeState::READY;
    rig.run(2);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
    assert_eq!(rig.torque, [0.0; 6]);
}

#[test]
fn j16_enabling_has_a_time_limit() {
    let mut rig = Rig::new(Config { enable_timeout_ms: 500, ..Config::avena() });
    rig.nodes[2].slow_enable = true;
    rig.defaults();
    rig.until(200, |r| r.state() == ControllerState::HoldPos);
    rig.run(490);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    // The arm must have been at rest for 50 ms before the controller requests enabling.
    rig.run(80);
    assert_eq!(
        (rig.state(), rig.errors()),
        (ControllerState::Error, error::EXTERNAL | error::EXTERNAL_JOINTS)
    );
    // The default enabling timeout leaves time for the motor alignment, which takes four seconds.
    assert_eq!(Config::avena().enable_timeout_ms, 10_000);
}

#[test]
fn j16_only_known_states_are_requested_and_positions_count_after_configuration() {
    let mut rig = Rig::new(Config::avena());
    for (j, node) in rig.nodes.iter_mut().enumerate() {
        node.report.position = 0.1 * j as f64;
    }
    rig.follow = false;
    rig.defaults();
    for _ in 0..400 {
        rig.tick();
        let t = rig.controller.telemetry();
        for j in 0..6 {
            let q = t.joints[j].position;
            assert!(q == 0.0 || (q - 0.1 * j as f64).abs() < 1e-6);
            // Before its configuration, a drive reports the position 0. The controller never latches this position as the hold position.
            if t.state == ControllerState::HoldPos {
                assert!((t.joints[j].set_position - 0.1 * j as f64).abs() < 1e-6);
            }
        }
    }
    assert_eq!(rig.state(), ControllerState::HoldPos);
}
