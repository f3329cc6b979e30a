//! Tests of the gripper (J-14, J-23), which the controller brings up in parallel with the arm. The gripper never causes the arm to lose its
//! torque, and never starts its pump without a command.
use crate::rig;

use jtc_bus::{NodeState, Request};
use jtc_core::{Config, ControllerState, TrajectoryState};
use jtc_wire::{DataStatus, FrameType, RawPoint};
use rig::{Rig, rest};

const GRIPPER: usize = 6;
const FLAG: u32 = 1 << 14;
const POWERED: [ControllerState; 3] =
    [ControllerState::HoldPos, ControllerState::Operate, ControllerState::Teaching];

/// Returns a rig in a state with torque and with its pump on.
fn powered(state: ControllerState) -> Rig {
    powered_with(Config::avena(), state)
}

fn powered_with(config: Config, state: ControllerState) -> Rig {
    let mut rig = Rig::holding_with(config);
    pump(&mut rig, true);
    match state {
        ControllerState::Operate => {
            let points: Vec<RawPoint> = (0..400).map(|_| rest(0)).collect();
            rig.move_along(&points, 6);
        }
        ControllerState::Teaching => {
            rig.ask(FrameType::TeachingModeEnable, &[]);
            rig.run(200);
        }
        _ => {}
    }
    rig.run(3);
    assert_eq!((rig.state(), rig.pump), (state, true));
    rig
}

fn pump(rig: &mut Rig, on: bool) {
    assert_eq!(rig.ask(FrameType::GripperControl, &[u8::from(on), 0, 0, 0]), DataStatus::NoError);
    rig.run(2);
}

/// Executes ticks and checks that the gripper does not disturb the arm. The arm must have no error and keep its
/// state, and at most about one of 20 ticks may send a frame other than a Move.
fn undisturbed(rig: &mut Rig, ticks: usize, state: ControllerState) {
    let from = rig.sent.len();
    for _ in 0..ticks {
        rig.tick();
        assert_eq!((rig.state(), rig.errors()), (state, 0));
        assert!(rig.last.safety_output);
    }
    let others = rig.sent[from..].iter().filter(|r| !matches!(r, Request::Move { .. })).count();
    assert!(others <= ticks / 20 + 1, "{others} frames of {ticks} take the place of Move");
    assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED && n.resets == 1));
}

#[test]
fn j23_a_gripper_that_falls_silent_is_shown_and_nothing_more() {
    for state in POWERED {
        let mut rig = powered(state);
        rig.nodes[GRIPPER].silent = true;
        undisturbed(&mut rig, 300, state);
        let status = rig.status();
        assert_eq!((status.can_error, status.can_current, status.can_occurred), (0, FLAG, FLAG));
        assert_eq!((status.errors, status.occurred, status.node_init), (0, 0, 1 << GRIPPER));
        // The gripper did not answer for a time, but its pump has been on, so the gripper has kept its workpiece.
        rig.nodes[GRIPPER].silent = false;
        undisturbed(&mut rig, 300, state);
        let status = rig.status();
        assert_eq!((status.can_error, status.can_current, status.can_occurred), (0, 0, FLAG));
        assert_eq!((status.node_init, rig.nodes[GRIPPER].report.state), (0, NodeState::ENABLED));
        assert!(rig.pump);
    }
}

#[test]
fn j23_a_gripper_that_resets_is_configured_again_on_the_side() {
    for state in POWERED {
        for boot_ticks in [3, 300] {
            let mut rig = powered(state);
            rig.nodes[GRIPPER].restart();
            rig.nodes[GRIPPER].booting = boot_ticks;
            rig.statuses.clear();
            undisturbed(&mut rig, boot_ticks as usize + 200, state);
            assert!(boot_ticks == 3 || rig.statuses.iter().any(|s| s.node_init == 1 << GRIPPER));
            assert_eq!(rig.nodes[GRIPPER].report.state, NodeState::ENABLED);
            assert!(rig.nodes[GRIPPER].configured && rig.status().node_init == 0);
            assert!(!rig.pump, "J-23: the pump waits for a command");
            pump(&mut rig, true);
            assert!(rig.pump);
        }
    }
}

#[test]
fn j23_a_gripper_that_leaves_operation_enable_is_enabled_again_without_its_pump() {
    for state in POWERED {
        let mut rig = powered(state);
        rig.nodes[GRIPPER].report.state = NodeState::READY;
        undisturbed(&mut rig, 100, state);
        assert_eq!((rig.nodes[GRIPPER].report.state, rig.pump), (NodeState::ENABLED, false));
        // The status shows a fault of the gripper, and a host clears it like a fault of any other node.
        rig.nodes[GRIPPER].fault();
        undisturbed(&mut rig, 100, state);
        assert_eq!(rig.status().gripper.unwrap().state, NodeState::FAULT);
        rig.clear(false, 1 << GRIPPER);
        undisturbed(&mut rig, 300, state);
        assert_eq!((rig.nodes[GRIPPER].report.state, rig.pump), (NodeState::ENABLED, false));
    }
}

#[test]
fn j23_joints_are_not_reset_while_the_arm_may_move() {
    for state in [ControllerState::Operate, ControllerState::Teaching] {
        let mut rig = powered(state);
        for mask in [0x01, 0x20, 0x3F, 0x7F, 0xFF] {
            assert_eq!(rig.ask(FrameType::ResetCanDevices, &[mask, 0, 0, 0]), DataStatus::NotAllowed);
        }
        undisturbed(&mut rig, 100, state);
        assert_eq!(rig.nodes[GRIPPER].resets, 1, "a refused frame changes nothing at all");
        assert!(rig.pump);
        // A reset of the gripper alone switches the pump off.
        assert_eq!(rig.ask(FrameType::ResetCanDevices, &[0x40, 0, 0, 0]), DataStatus::NoError);
        undisturbed(&mut rig, 400, state);
        assert_eq!((rig.nodes[GRIPPER].resets, rig.nodes[GRIPPER].report.state), (2, NodeState::ENABLED));
        assert!(!rig.pump, "the pump does not start again by itself");
    }
}

#[test]
fn j23_the_pump_does_not_start_by_itself_after_a_reset() {
    for mask in [0x40, 0x7F] {
        let mut rig = powered(ControllerState::HoldPos);
        rig.ask(FrameType::ResetCanDevices, &[mask, 0, 0, 0]);
        let from = rig.sent.len();
        rig.run(800);
        assert!(rig.sent[from..].iter().all(|r| !matches!(r, Request::Move { pump: true, .. })));
        assert_eq!(rig.nodes[GRIPPER].resets, 2);
        assert_eq!(
            (rig.state(), rig.nodes[GRIPPER].report.state),
            (ControllerState::HoldPos, NodeState::ENABLED)
        );
        pump(&mut rig, true);
        assert!(rig.pump);
    }
    // A joint changes back to Init, and the controller therefore returns to Init. When the controller reaches HoldPos
    // again, the pump must not start without a command.
    let mut rig = powered(ControllerState::HoldPos);
    rig.nodes[2].configured = false;
    rig.nodes[2].report.state = NodeState::INIT;
    rig.run(400);
    assert_eq!((rig.state(), rig.pump), (ControllerState::HoldPos, false));
}

#[test]
fn j14_a_gripper_that_is_not_there_is_no_error_and_keeps_the_controller_in_init() {
    let mut rig = Rig::new(Config::avena());
    rig.nodes[GRIPPER].silent = true;
    rig.defaults();
    rig.run(3000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Init, 0));
    let status = rig.status();
    assert_eq!((status.can_error, status.can_current, status.node_init), (0, FLAG, 1 << GRIPPER));
    // When the gripper begins to answer, the controller brings it up like the other nodes.
    rig.nodes[GRIPPER].silent = false;
    rig.run(200);
    assert_eq!((rig.state(), rig.status().can_current), (ControllerState::HoldPos, 0));
}

/// Causes an error, clears it and returns to HoldPos.
fn error_and_clear(rig: &mut Rig) {
    rig.safety_input = false;
    rig.run(100);
    assert_eq!(rig.state(), ControllerState::Error);
    rig.safety_input = true;
}

#[test]
fn the_pump_is_switched_off_by_an_error_where_the_setting_says_so() {
    for state in POWERED {
        let mut rig = powered(state);
        rig.safety_input = false;
        rig.tick();
        let off = matches!(rig.sent.last(), Some(Request::Move { pump: false, .. }));
        assert!(off, "in the tick of the error: {:?}", rig.sent.last());
        let mut rig = powered(state);
        error_and_clear(&mut rig);
        assert_eq!((rig.nodes[GRIPPER].report.state, rig.pump), (NodeState::READY, false));
        assert_eq!(rig.ask(FrameType::GripperControl, &[1, 0, 0, 0]), DataStatus::NotAllowed);
        rig.clear(true, 0x7F);
        rig.run(400);
        assert_eq!(
            (rig.state(), rig.trajectory(), rig.pump),
            (ControllerState::HoldPos, TrajectoryState::Null, false)
        );
    }
}

#[test]
fn the_gripper_keeps_its_part_over_an_error_where_the_setting_says_so() {
    let config = Config { pump_off_on_error: false, ..Config::avena() };
    for state in POWERED {
        let mut rig = powered_with(config.clone(), state);
        let held = |rig: &Rig| rig.pump && rig.nodes[GRIPPER].report.state == NodeState::ENABLED;
        let from = rig.sent.len();
        error_and_clear(&mut rig);
        assert!(held(&rig), "{:?}", rig.nodes[GRIPPER]);
        assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::READY));
        rig.clear(true, 0x7F);
        rig.run(400);
        assert_eq!(rig.state(), ControllerState::HoldPos);
        assert!(held(&rig));
        // A joint loses its configuration, so the controller returns to Init. The gripper must hold its workpiece all
        // the time.
        rig.nodes[2].configured = false;
        rig.nodes[2].report.state = NodeState::INIT;
        rig.run(400);
        assert_eq!(rig.state(), ControllerState::HoldPos);
        assert!(held(&rig));
        assert!(rig.sent[from..].iter().all(|r| !matches!(r, Request::Move { pump: false, .. })));
        // In Error, the host can make the gripper release its workpiece.
        error_and_clear(&mut rig);
        pump(&mut rig, false);
        assert!(!rig.pump);
        rig.clear(true, 0x7F);
        rig.run(400);
        assert!(!rig.pump, "it does not start by itself");
    }
    // If the pump was off when the error occurred, the pump does not start after the error.
    let mut rig = Rig::holding_with(config);
    rig.nodes[GRIPPER].report.state = NodeState::new(12);
    rig.nodes[GRIPPER].slow_enable = true;
    pump(&mut rig, true);
    error_and_clear(&mut rig);
    rig.nodes[GRIPPER].report.state = NodeState::READY;
    rig.nodes[GRIPPER].slow_enable = false;
    rig.clear(true, 0x7F);
    rig.run(400);
    assert_eq!(
        (rig.state(), rig.nodes[GRIPPER].report.state, rig.pump),
        (ControllerState::HoldPos, NodeState::ENABLED, false)
    );
}

/// A pump command that arrives during the bring-up of the gripper takes effect after the bring-up. After a restart of
/// the gripper, an earlier command has no effect.
#[test]
fn j23_a_pump_command_in_init_holds_until_the_gripper_restarts() {
    let mut rig = Rig::new(Config::avena());
    rig.run(20);
    assert!(rig.nodes[GRIPPER].booting > 0 && !rig.nodes[GRIPPER].configured);
    pump(&mut rig, true);
    rig.run(400);
    assert_eq!(
        (rig.state(), rig.pump, rig.nodes[GRIPPER].report.state),
        (ControllerState::Init, true, NodeState::READY)
    );
    rig.nodes[GRIPPER].restart();
    rig.run(400);
    assert_eq!(
        (rig.state(), rig.pump, rig.nodes[GRIPPER].report.state),
        (ControllerState::Init, false, NodeState::READY)
    );
}
