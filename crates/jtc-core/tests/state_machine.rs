//! Tests of errors, and of the return from state Error (sections 3 and 4).
use crate::rig;

use jtc_bus::{Frame, NodeState, Request, Target, warning};
use jtc_core::{Config, ControllerState, TrajectoryState, error};
use jtc_wire::{DataStatus, FrameStatus, FrameType, RawPoint, Response};
use rig::{Rig, rest};

fn is_move(request: &Request) -> bool {
    matches!(request, Request::Move { .. })
}

fn torque_of(request: &Request) -> [f64; 6] {
    match request {
        Request::Move { torque, .. } => *torque,
        _ => [0.0; 6],
    }
}

#[test]
fn j21_errors_latch_until_the_cause_is_gone_and_the_host_clears() {
    let mut rig = Rig::holding();
    rig.safety_input = false;
    rig.tick();
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(rig.errors(), error::EMERGENCY_INPUT | error::EXTERNAL);
    // A clear has no effect while the cause of the error is present.
    rig.clear(true, 0x7F);
    assert_eq!(rig.state(), ControllerState::Error);
    // When the cause of the error ends without a clear, the controller must stay in state Error.
    rig.safety_input = true;
    rig.run(200);
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(
        rig.nodes[..6].iter().all(|n| n.report.state == NodeState::READY),
        "joints are in ReadyToOperate"
    );
    rig.clear(true, 0);
    rig.run(100);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    // Occurred errors stay recorded until ClearOccurredErrors (0x02).
    assert_eq!(rig.status().occurred, error::EMERGENCY_INPUT | error::EXTERNAL);
    assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), DataStatus::NoError);
    assert_eq!(rig.status().occurred, 0);
}

#[test]
fn j21_clearing_a_node_holds_the_command_until_it_follows() {
    let mut rig = Rig::holding();
    rig.nodes[1].fault();
    rig.run(3);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
    rig.clear(true, 0);
    assert_eq!(rig.state(), ControllerState::Error, "the node's fault is still there");
    // The drive ignores frames for some time in its fault reaction.
    rig.nodes[1].report.state = NodeState::FAULT_REACTION;
    rig.clear(true, 1 << 1);
    let from = rig.sent.len();
    rig.run(400);
    assert_eq!(rig.state(), ControllerState::Error);
    let asked = rig.sent[from..]
        .iter()
        .filter(|r| matches!(r, Request::ChangeFsm { target } if target[1] == Target::Init));
    assert!(asked.count() >= 90, "the command is repeated");
    rig.nodes[1].report.state = NodeState::FAULT;
    rig.run(300);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert_eq!(rig.nodes[1].report.errors, 0);
}

/// If a clear arrives in the same tick as a fault, it must not hide the fault.
#[test]
fn j21_a_clear_in_the_tick_of_a_fault_does_not_hide_it() {
    type Fault = fn(&mut Rig);
    let faults: [(&str, Fault); 4] = [
        ("error bit", |rig| rig.nodes[1].report.errors = 8),
        ("motor control", |rig| rig.nodes[1].report.mc_current = 4),
        ("fault state", |rig| rig.nodes[1].report.state = NodeState::FAULT),
        ("left OperationEnable", |rig| rig.nodes[1].report.state = NodeState::READY),
    ];
    for (name, fault) in faults {
        for occurred in [false, true] {
            for teaching in [false, true] {
                let mut rig = Rig::holding();
                if teaching {
                    rig.ask(FrameType::TeachingModeEnable, &[]);
                }
                rig.tick();
                fault(&mut rig);
                // The fault is in the answer to the Move of this tick. This answer arrives in the next tick, together
                // with the clear.
                rig.tick();
                if occurred {
                    rig.send(FrameType::ClearOccurredErrors, &[]);
                }
                rig.send(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0]);
                for _ in 0..30 {
                    let faulty = rig.nodes[1].report.errors | rig.nodes[1].report.mc_current != 0;
                    rig.tick();
                    assert_eq!(rig.state(), ControllerState::Error, "{name}");
                    assert_eq!(torque_of(rig.sent.last().unwrap()), [0.0; 6], "{name}");
                    if !faulty {
                        break;
                    }
                }
            }
        }
    }
    // The safety input is low in this tick only.
    let mut rig = Rig::holding();
    rig.send(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0]);
    rig.press_stop(1);
    rig.run(100);
    assert_eq!(
        (rig.state(), rig.errors()),
        (ControllerState::Error, error::EMERGENCY_INPUT | error::EXTERNAL)
    );
}

/// Existing hosts show the answer to a clear. The controller refuses a clear without an effect, and does not execute it later without a new
/// request.
#[test]
fn j21_a_clear_that_cannot_clear_anything_yet_is_refused_and_not_remembered() {
    type Fault = fn(&mut Rig);
    let faults: [(&str, Fault); 4] = [
        ("fault state", |rig| rig.nodes[4].report.state = NodeState::FAULT),
        ("fault reaction", |rig| rig.nodes[4].report.state = NodeState::new(254)),
        ("error bit", |rig| {
            (rig.nodes[4].report.errors, rig.nodes[4].report.state) = (8, NodeState::FAULT);
        }),
        ("motor control", |rig| {
            (rig.nodes[4].report.mc_current, rig.nodes[4].report.state) = (4, NodeState::FAULT);
        }),
    ];
    for (name, fault) in faults {
        for plain in [false, true] {
            let mut rig = Rig::holding();
            fault(&mut rig);
            rig.run(100);
            assert_eq!(rig.state(), ControllerState::Error, "{name}");
            rig.plain = plain;
            let refused = if plain { DataStatus::IncorrectValue } else { DataStatus::NotAllowed };
            // The controller refuses all three clears, because they cannot clear anything. The first clear selects
            // only the controller's errors. The second clear also selects a joint without an error. The third clear
            // selects the occurred errors, which are all still current.
            assert_eq!(rig.clear(true, 0), refused, "{name}");
            assert_eq!(rig.clear(true, 0x01), refused, "{name}");
            assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), refused, "{name}");
            // The controller accepts a clear that selects only nodes. The controller's errors remain, so the state
            // stays Error.
            assert_eq!(rig.clear(false, 0x01), DataStatus::NoError, "{name}");
            rig.nodes[4].report.state = NodeState::FAULT;
            assert_eq!(rig.clear(false, 0x10), DataStatus::NoError, "{name}");
            rig.run(300);
            assert_eq!(
                rig.state(),
                ControllerState::Error,
                "{name}: the controller's own is still to be cleared"
            );
            assert!(rig.nodes[4].report.errors == 0 && !rig.nodes[4].report.state.is_fault());
            assert_eq!(rig.clear(true, 0), DataStatus::NoError, "{name}");
            rig.run(300);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{name}");
        }
    }
    // The controller accepts a clear that also selects the joint with the fault. The controller also accepts a clear
    // while this joint is already being cleared.
    for joint_first in [false, true] {
        let mut rig = Rig::holding();
        rig.nodes[4].report.state = NodeState::FAULT;
        rig.run(100);
        if joint_first {
            rig.send(FrameType::ClearCurrentErrors, &[0, 0x10, 0, 0]);
            assert_eq!(rig.clear(true, 0), DataStatus::NoError);
        } else {
            assert_eq!(rig.clear(true, 0x7F), DataStatus::NoError);
        }
        rig.run(300);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    }
    // The controller accepts a clear that clears at least one other error. The fault remains.
    let mut rig = Rig::holding();
    rig.press_stop(1);
    rig.nodes[4].report.state = NodeState::FAULT;
    rig.run(100);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
    assert_eq!(rig.clear(true, 0), DataStatus::NotAllowed);
    // The first clear of the occurred errors sets their word to zero. The second clear would have no effect, so the
    // controller refuses it.
    assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), DataStatus::NotAllowed);
    // A controller without errors accepts every clear.
    let mut rig = Rig::holding();
    assert_eq!(rig.clear(true, 0x7F), DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), DataStatus::NoError);
}

#[test]
fn j21_healthy_nodes_are_left_alone_by_a_clear() {
    let mut rig = Rig::holding();
    rig.clear(true, 0x7F);
    rig.run(50);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert!(rig.nodes.iter().all(|n| n.report.state == NodeState::ENABLED));
}

#[test]
fn j22_safety_input_acts_in_the_first_tick_and_output_follows_internal_errors() {
    let mut rig = Rig::holding();
    assert!(rig.last.safety_output);
    rig.safety_input = false;
    rig.tick();
    assert_eq!(torque_of(rig.sent.last().unwrap()), [0.0; 6]);
    assert!(is_move(rig.sent.last().unwrap()), "the first frame after an error is Move");
    assert!(rig.last.safety_output, "an external error does not pull the output");
    // An internal error sets the safety output to 0, and sets the bit for internal errors.
    let mut rig = Rig::holding();
    rig.nodes[4].silent = true;
    rig.until(20, |r| r.state() == ControllerState::Error);
    assert!(!rig.last.safety_output);
    assert_ne!(rig.errors() & error::EMERGENCY_OUTPUT, 0);
    rig.nodes[4].silent = false;
    rig.run(100);
    assert!(!rig.last.safety_output, "held while latched");
    rig.clear(true, 0);
    rig.run(2);
    assert!(rig.last.safety_output);
    assert_eq!(rig.errors() & error::EMERGENCY_OUTPUT, 0);
}

#[test]
fn j23_a_reset_touches_only_the_nodes_in_its_mask() {
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(FrameType::ResetCanDevices, &[0b10_0010, 0, 0, 0]), DataStatus::NoError);
    rig.run(600);
    let resets: Vec<_> = rig.nodes.iter().map(|n| n.resets).collect();
    assert_eq!(resets, [1, 2, 1, 1, 1, 2, 1]);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    // A reset with an empty mask has no effect.
    rig.ask(FrameType::ResetCanDevices, &[0, 0, 0, 0]);
    rig.run(50);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    // The controller ignores unused bits of the mask, because hosts send 0xFF for all nodes.
    rig.ask(FrameType::ResetCanDevices, &[0xFF, 0, 0, 0]);
    rig.run(600);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.sent.iter().filter(|r| **r == Request::ResetAll).count(), 2);
}

#[test]
fn j24_a_trajectory_is_not_resumed_after_an_error() {
    let mut rig = Rig::holding();
    let points: Vec<RawPoint> = (0..50).map(|i| rest(i * 10)).collect();
    rig.upload(&points, 10);
    rig.exec(jtc_wire::ExecCommand::Execute);
    rig.until(400, |r| r.controller.telemetry().point > 50);
    rig.safety_input = false;
    rig.tick();
    assert_eq!(rig.trajectory(), TrajectoryState::Null);
    rig.safety_input = true;
    rig.clear(true, 0);
    rig.run(500);
    assert_eq!((rig.state(), rig.trajectory()), (ControllerState::HoldPos, TrajectoryState::Null));
    assert_eq!(rig.exec(jtc_wire::ExecCommand::Execute), DataStatus::NotAllowed);
    let before = rig.controller.telemetry().joints[0].set_position;
    rig.run(500);
    assert_eq!(rig.controller.telemetry().joints[0].set_position, before);
}

#[test]
fn j12_one_broadcast_a_tick_and_other_frames_in_one_tick_of_four() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.run(300);
    rig.nodes[2].fault();
    rig.run(50);
    rig.clear(true, 0x7F);
    rig.run(300);
    rig.ask(FrameType::ResetCanDevices, &[0x3F, 0, 0, 0]);
    rig.run(600);
    let mut since = 100;
    for request in &rig.sent {
        if is_move(request) {
            since += 1;
        } else {
            assert!(since >= 3, "{request:?} after {since} Moves");
            since = 0;
        }
    }
}

#[test]
fn j12_ten_late_ticks_within_a_second_are_an_internal_error() {
    const OWN: u16 = error::EMERGENCY_OUTPUT | error::INTERNAL;
    // In each of these states with torque, every second tick is missed.
    for teaching in [false, true] {
        let mut rig = Rig::holding();
        if teaching {
            rig.ask(FrameType::TeachingModeEnable, &[]);
        }
        rig.run(3);
        for late in 1..=10 {
            assert_eq!(rig.errors(), 0, "{late} late ticks");
            rig.missed_ticks = 1;
            rig.tick();
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Error, OWN));
        assert_eq!(torque_of(rig.sent.last().unwrap()), [0.0; 6], "in the tick that finds it");
        assert!(!rig.last.safety_output);
        rig.run(1000);
        assert_eq!(rig.errors(), OWN, "it latches");
        rig.clear(true, 0);
        rig.run(600);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    }
    // The controller tolerates a few late ticks per second, for any length of time.
    let mut rig = Rig::holding();
    for _ in 0..100 {
        rig.missed_ticks = 5;
        rig.run(1000);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    }
}

#[test]
fn j15_frames_not_understood_are_counted_and_ignored() {
    let mut rig = Rig::holding();
    rig.inject = vec![
        Frame::new(0x3FF, &[0; 8]).unwrap(),
        Frame::new(0x203, &[0; 3]).unwrap(),
        Frame::new(0x000, &[0; 16]).unwrap(),
    ];
    rig.tick();
    rig.run(5);
    assert_eq!(rig.controller.ignored_frames(), 3);
    assert_eq!(rig.state(), ControllerState::HoldPos);
}

#[test]
fn j16_faults_show_even_without_error_bytes() {
    for state in [NodeState::FAULT_REACTION, NodeState::FAULT] {
        let mut rig = Rig::holding();
        rig.nodes[0].report.state = state;
        rig.run(2);
        assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS, "state {state}");
    }
    let mut rig = Rig::holding();
    rig.nodes[5].report.warnings = warning::SAFETY_LINE;
    rig.run(2);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
}

/// Real drives report their safety line as active until they are configured. The controller ignores the safety line
/// of a joint until the joint is configured.
#[test]
fn j16_the_safety_line_counts_once_a_joint_is_configured() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.run(10);
    for _ in 0..400 {
        for node in &mut rig.nodes[..6] {
            node.report.warnings = if node.configured { 0 } else { warning::SAFETY_LINE };
        }
        rig.tick();
        assert_eq!(rig.errors(), 0);
    }
    assert_eq!(rig.state(), ControllerState::HoldPos);
    // In Init, an active safety line is also an error if the joint is configured.
    let mut rig = Rig::new(Config::avena());
    rig.run(300);
    assert_eq!((rig.state(), rig.nodes[2].configured), (ControllerState::Init, true));
    rig.nodes[2].report.warnings = warning::SAFETY_LINE;
    rig.run(2);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
}

#[test]
fn j04_each_record_is_carried_once_and_in_order() {
    let mut rig = Rig::holding();
    rig.run(50);
    rig.statuses.clear();
    let bad =
        Response { frame_type: 4, status: FrameStatus::IncorrectCrc, data: DataStatus::Idle, length: 18014 };
    rig.send(FrameType::PidParamUseDefault, &[]);
    rig.send_bad(bad);
    for _ in 0..20 {
        rig.send(FrameType::FrictionPolynomialUseDefault, &[]);
    }
    rig.run(30);
    let records: Vec<_> =
        rig.statuses.iter().map(|s| s.response).filter(|r| *r != Response::default()).collect();
    assert_eq!(records.len(), 22);
    assert_eq!(records[0].frame_type, 0x08);
    assert_eq!(records[1], bad);
    assert!(records[2..].iter().all(|r| (r.frame_type, r.data, r.length) == (0x0F, DataStatus::NoError, 6)));
    // If no response record waits, the controller sends one status every 40 ms, with an empty record.
    rig.run(40);
    rig.statuses.clear();
    rig.run(400);
    assert_eq!(rig.statuses.len(), 10);
    assert!(rig.statuses.iter().all(|s| s.response == Response::default()));
}

#[test]
fn j25_teaching_is_refused_outside_holdpos() {
    let mut rig = Rig::new(Config::avena());
    rig.run(300);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NotAllowed);
    assert_eq!(rig.state(), ControllerState::Init);
    let mut rig = Rig::holding();
    rig.run(100);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::Teaching);
    assert_eq!(rig.ask(FrameType::TeachingModeDisable, &[]), DataStatus::NoError);
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::HoldPos);
}

#[test]
fn j12_j21_j24_after_a_failure_of_the_device_itself_the_host_must_clear_first() {
    const OWN: u16 = error::EMERGENCY_OUTPUT | error::INTERNAL;
    let mut rig = Rig::new(Config::avena());
    rig.controller.raise_internal();
    rig.defaults();
    rig.tick();
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(!rig.last.safety_output);
    assert!(is_move(&rig.sent[0]) && torque_of(&rig.sent[0]) == [0.0; 6]);
    rig.run(1000);
    // The device error is latched. This error sets the bit for internal errors that come neither from a joint nor from
    // the bus.
    let status = rig.status();
    assert_eq!((status.state, status.errors, status.occurred), (ControllerState::Error.into(), OWN, OWN));
    assert_eq!(status.can_occurred, 0);
    assert!(rig.sent.iter().all(|request| torque_of(request) == [0.0; 6]));
    assert!(rig.nodes.iter().all(|node| node.report.state != NodeState::ENABLED));

    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    rig.run(200);
    assert_eq!(
        (rig.state(), rig.trajectory(), rig.errors()),
        (ControllerState::HoldPos, TrajectoryState::Null, 0)
    );
    assert!(rig.last.safety_output);
    assert_eq!(rig.status().occurred, OWN, "what has occurred stays until it is cleared, too");
}
