//! Tests of absent joints (J-53): substitute values, refused commands, and a drive that answers although its joint is declared absent.
use crate::rig;

use jtc_bus::{NodeState, Request, Target};
use jtc_core::{Config, ControllerState, Payload, error, settings};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, ExecCommand, FrameType, SettingValue};
use proptest::prelude::*;
use rig::{Rig, floats, pieces};

const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

fn set(rig: &mut Rig, values: &[(u8, usize, f64)]) -> DataStatus {
    let body: Vec<u8> = values
        .iter()
        .flat_map(|&(setting, j, value)| SettingValue { setting, joint: j as u8 + 1, value }.emit())
        .collect();
    rig.ask(FrameType::SetSettings, &body)
}

/// Returns the settings (absent flag and angle) of each joint that is declared absent.
fn absent(joints: &[(usize, f64)]) -> Vec<(u8, usize, f64)> {
    joints
        .iter()
        .flat_map(|&(j, q)| [(settings::ABSENT, j, 1.0), (settings::ABSENT_POSITION, j, q)])
        .collect()
}

/// Returns a rig in which these joints are absent. The nodes of absent joints never answer.
fn bench(joints: &[(usize, f64)]) -> Rig {
    bench_with(Config::avena(), joints)
}

fn bench_with(config: Config, joints: &[(usize, f64)]) -> Rig {
    let mut rig = Rig::new(config);
    for &(j, _) in joints {
        rig.nodes[j].silent = true;
    }
    rig.tick();
    rig.tick();
    assert_eq!(set(&mut rig, &absent(joints)), DataStatus::NoError);
    rig.defaults();
    rig.run(3_500);
    rig
}

fn is_absent(rig: &Rig, j: usize) -> bool {
    rig.controller.config().absent[j]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    /// For any combination of absent joints, the controller brings up the present joints. The controller holds them
    /// with the torque that the model of the whole arm requires.
    #[test]
    fn j53_absent_joints_are_waited_for_nowhere(mask in 1u8..63, angles in prop::array::uniform6(-1.5..1.5f64)) {
        let joints: Vec<_> = ALL.into_iter().filter(|j| mask & (1 << j) != 0).map(|j| (j, angles[j])).collect();
        let mut rig = bench(&joints);
        prop_assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{:?}", rig.controller.telemetry());
        let q: [f64; 6] = core::array::from_fn(|j| if is_absent(&rig, j) { angles[j] } else { rig.nodes[j].report.position });
        let model = jtc_core::Parameters::avena().model;
        let gravity = Dynamics::new(&model, Config::avena().gravity).gravity_torque(&q);
        let (status, telemetry) = (rig.status(), rig.controller.telemetry());
        prop_assert_eq!((status.node_init, status.can_current, status.can_occurred), (0, 0, 0));
        for j in ALL {
            let joint = &status.joints[j];
            if is_absent(&rig, j) {
                prop_assert_eq!((joint.state, joint.position, joint.velocity), (NodeState::START, angles[j] as f32, 0.0));
                prop_assert_eq!((telemetry.joints[j].torque, telemetry.joints[j].torque_model, rig.torque[j]), (0.0, 0.0, 0.0));
            } else {
                prop_assert_eq!(joint.state, NodeState::ENABLED);
                prop_assert!((telemetry.joints[j].torque_model - gravity[j]).abs() < 1e-3, "joint {}", j + 1);
            }
        }
        // The controller never sent a torque or a requested state to the nodes of absent joints.
        for request in &rig.sent {
            match request {
                Request::Move { torque, .. } => {
                    prop_assert!(joints.iter().all(|&(j, _)| torque[j] == 0.0));
                }
                Request::ChangeFsm { target } => {
                    prop_assert!(joints.iter().all(|&(j, _)| target[j] == Target::NoChange));
                }
                _ => {}
            }
        }
    }
}

#[test]
fn j53_absent_is_set_in_init_and_error_only() {
    for j in ALL {
        let mut rig = Rig::holding();
        let all = absent(&[(j, 0.4)]);
        assert_eq!(set(&mut rig, &all), DataStatus::NotAllowed, "HoldPos");
        rig.send(FrameType::TeachingModeEnable, &[]);
        rig.until(1_000, |r| r.state() == ControllerState::Teaching);
        assert_eq!(set(&mut rig, &all), DataStatus::NotAllowed, "Teaching");
        rig.send(FrameType::TeachingModeDisable, &[]);
        rig.run(700);
        rig.move_along(&pieces(2, &[(1.0, 30), (0.0, 100), (-1.0, 30)]), 100);
        assert_eq!(set(&mut rig, &all), DataStatus::NotAllowed, "Operate");
        assert!(!is_absent(&rig, j));
        // After a drive has stopped answering, the controller is in Error. In this state, it accepts the settings
        // that declare the joint absent.
        rig.nodes[j].silent = true;
        rig.until(50, |r| r.state() == ControllerState::Error);
        assert_eq!(set(&mut rig, &all), DataStatus::NoError);
        rig.clear(true, 0x7F);
        rig.until(5_000, |r| r.state() == ControllerState::HoldPos);
        rig.run(1_500);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        assert_eq!(rig.controller.telemetry().joints[j].position, 0.4);
    }
}

#[test]
fn j53_absent_joints_forbid_motion_and_teaching_and_are_not_jogged() {
    for j in ALL {
        let mut rig = bench(&[(j, 0.0)]);
        rig.upload(&pieces((j + 1) % 6, &[(1.0, 30), (0.0, 100), (-1.0, 30)]), 10);
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
        assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NotAllowed);
        let jog = |k: usize| {
            let mut velocity = [0.0f32; 6];
            velocity[k] = 0.1;
            floats(velocity)
        };
        for k in ALL {
            let expected = if k == j { DataStatus::NotAllowed } else { DataStatus::NoError };
            assert_eq!(rig.ask(FrameType::Jog, &jog(k)), expected, "joint {}", k + 1);
            let before = rig.controller.telemetry().joints[k].position;
            rig.run(150);
            let moved = rig.controller.telemetry().joints[k].position - before;
            assert_eq!(moved > 0.001, k != j, "joint {}: {moved} rad", k + 1);
            rig.run(1_500);
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    }
}

/// If a drive of an absent joint answers, either the drive or the setting is wrong. The arm has no torque until the drive or the setting is
/// corrected.
#[test]
fn j53_absent_joints_whose_drives_answer_are_an_error() {
    for j in ALL {
        // The drive of the absent joint answers from the start, or is connected later.
        for later in [false, true] {
            let mut rig = if later {
                let mut rig = bench(&[(j, 0.3)]);
                assert_eq!(rig.state(), ControllerState::HoldPos);
                rig.nodes[j].silent = false;
                rig
            } else {
                let mut rig = Rig::new(Config::avena());
                rig.run(300);
                assert_eq!(set(&mut rig, &absent(&[(j, 0.3)])), DataStatus::NoError);
                rig
            };
            rig.until(10, |r| r.state() == ControllerState::Error);
            assert_ne!(rig.errors() & error::EXTERNAL_JOINTS, 0);
            // The status shows the state of this drive, so that the operator can identify the joint.
            let shown = rig.status().joints.map(|joint| joint.state);
            assert_eq!(shown[j], rig.nodes[j].report.state);
            rig.clear(true, 0x7F);
            rig.run(500);
            assert_eq!(rig.state(), ControllerState::Error, "it answers still");
            assert!(rig.torque == [0.0; 6]);
            // The joint is now declared present again.
            assert_eq!(set(&mut rig, &[(settings::ABSENT, j, 0.0)]), DataStatus::NoError);
            rig.run(50);
            rig.clear(true, 0x7F);
            rig.defaults();
            rig.until(8_000, |r| r.nodes[..6].iter().all(|node| node.report.state == NodeState::ENABLED));
            rig.run(50);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        }
    }
}

/// If the drive of an absent joint is enabled for any reason, the controller disables this drive.
#[test]
fn j53_absent_joints_are_disabled_where_they_are_enabled() {
    let mut rig = bench(&[(2, 0.0)]);
    rig.nodes[2].silent = false;
    rig.nodes[2].configured = true;
    rig.nodes[2].report.state = NodeState::ENABLED;
    rig.until(50, |r| r.nodes[2].report.state == NodeState::READY);
    assert_eq!(rig.state(), ControllerState::Error);
}

/// Absent joints do not hide errors of other nodes. The controller supervises the other nodes as usual.
#[test]
fn j53_absent_joints_hide_no_error_of_the_others() {
    for j in ALL {
        let mut rig = bench(&[(j, 0.0)]);
        let other = (j + 2) % 6;
        rig.nodes[other].silent = true;
        rig.until(10, |r| r.state() == ControllerState::Error);
        assert_eq!(rig.status().can_current & !(1 << 14), 1 << (8 + other));
    }
}

/// While the only present node is starting, no node acknowledges a frame. This must not cause an error.
#[test]
fn j53_absent_joints_acknowledge_nothing() {
    let five: Vec<_> = (1..6).map(|j| (j, 0.0)).collect();
    let mut rig = bench_with(Config { gripper: false, ..Config::avena() }, &five);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    for nodes in [0x3E, 0x3F] {
        assert_eq!(rig.ask(FrameType::ResetCanDevices, &[nodes, 0, 0, 0]), DataStatus::NoError);
    }
    rig.acknowledged = false;
    rig.nodes[0].silent = true;
    rig.run(200);
    rig.acknowledged = true;
    rig.nodes[0].silent = false;
    rig.run(3_000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    let resets = rig.sent.iter().filter(|request| matches!(request, Request::Reset(n) if *n > 0));
    assert_eq!(resets.count(), 0, "what is not there is not reset");
}

/// The list of absent joints is not part of the arm's settings. The controller can use a payload with and without absent joints.
#[test]
fn j53_j60_absent_joints_are_no_part_of_the_arm() {
    let mut rig = bench(&[(1, 0.9), (4, -0.3)]);
    let arm = |config: &Config| settings::values(config, 0, true).collect::<Vec<_>>();
    let of_the_bench = Config { drive_speed_window_ms: 0, ..Config::avena() };
    assert_eq!(arm(rig.controller.config()), arm(&of_the_bench));
    let payload = Payload { mass: 1.0, ..Payload::NONE };
    let body: Vec<u8> = settings::payload_values(&payload).flat_map(|value| value.emit()).collect();
    assert_eq!(rig.ask(FrameType::SetSettings, &body), DataStatus::NoError);
    rig.run(600);
    let telemetry = rig.controller.telemetry();
    let q = telemetry.joints.map(|joint| joint.position);
    let model = jtc_core::Parameters::avena().model;
    let wanted = Dynamics::with_payload(&model, Config::avena().gravity, &payload).gravity_torque(&q);
    assert!((telemetry.joints[2].torque_model - wanted[2]).abs() < 1e-3);
    assert_eq!((q[1], q[4]), (0.9, -0.3));
}

/// If the load of a payload or of a model is too high only for an absent joint, the controller must accept it.
#[test]
fn j53_absent_joints_hold_nothing() {
    let payload = |mass: f64| {
        let payload = Payload { mass, ..Payload::NONE };
        settings::payload_values(&payload).flat_map(|value| value.emit()).collect::<Vec<u8>>()
    };
    // The arm is stretched out, so joint 2 can hold hardly any load in addition to the arm.
    for there in [true, false] {
        let mut rig = if there { Rig::new(Config::avena()) } else { bench(&[(1, 1.5)]) };
        if there {
            rig.nodes[1].report.position = 1.5;
            rig.follow = false;
            rig.defaults();
            rig.run(700);
        }
        assert_eq!(rig.state(), ControllerState::HoldPos);
        let expected = if there { DataStatus::IncorrectValue } else { DataStatus::NoError };
        assert_eq!(rig.ask(FrameType::SetSettings, &payload(8.0)), expected);
        // The controller passes through Error and Init again. At the end of Init, it checks the load once more and
        // must accept it.
        rig.press_stop(10);
        rig.clear(true, 0x7F);
        rig.run(3_000);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        assert_eq!(rig.ask(FrameType::ArmModelUseDefault, &[]), DataStatus::NoError);
    }
}
