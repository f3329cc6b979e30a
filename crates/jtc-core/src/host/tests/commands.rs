//! Tests of the states and conditions in which a command is accepted (J-06, J-21, J-25, J-34, J-53, J-69, J-71).
use std::format;

use jtc_bus::{Answer, JointReport, NodeState, Scale};

use super::*;
use crate::commanded::Commanded;
use crate::nodes::Goal;
use crate::trajectory::check::{Quantity, Violation};

/// Makes joint 1 yield.
fn push(controller: &mut Bench) {
    let config = Config::avena();
    controller.motion.begin_yields(&core::array::from_fn(|j| j == 0), &[false; JOINTS], &config);
}

/// Returns a controller in Error, in which joints 1 and 2 report a fault. The external error is the only error.
fn faulty() -> Bench {
    let mut controller = holding();
    controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
    let fault = JointReport { state: NodeState::READY, errors: 1, ..JointReport::default() };
    let scale = Scale { velocity: controller.config.velocity_full_scale };
    let bus = [0, 1].map(|node| Answer::Joint { node, report: fault }.emit(scale));
    let inputs = Inputs { bus: &bus, ..Inputs::QUIET };
    controller.nodes.take(&inputs, &Config::avena(), Goal::Down, &Commanded::default());
    assert!(controller.nodes.fault_stays());
    controller.state = ControllerState::Error;
    controller.errors.raise_external_joints();
    controller
}

fn outcome(outcome: SliceOutcome) -> Result<(), DataStatus> {
    match outcome {
        SliceOutcome::Done => Ok(()),
        SliceOutcome::Refused(status) => Err(status),
        SliceOutcome::Unfinished(_) => panic!("the command needs more than one slice"),
    }
}

fn carry_out(controller: &mut Bench, command: Command<'_>) -> Result<(), DataStatus> {
    outcome(controller.carry_out(&ON_LINE_0, command))
}

#[test]
fn j69_parameters_are_refused_while_a_joint_yields() {
    for (yields, expected) in [(false, Ok(())), (true, Err(DataStatus::NotAllowed))] {
        let mut controller = holding();
        if yields {
            push(&mut controller);
        }
        assert_eq!(carry_out(&mut controller, Command::PidParamUseDefault), expected, "{yields}");
        assert_eq!(controller.stops_held(), yields);
    }
}

/// ClearCurrentErrors with node bits only does not end the yield of a joint.
#[test]
fn j69_a_clear_of_nodes_does_not_end_a_yield() {
    let mut controller = holding();
    push(&mut controller);
    let before = format!("{:?}", controller.motion.law);
    carry_out(&mut controller, Command::ClearCurrentErrors { jtc: false, nodes: 0x7F }).expect("accepted");
    assert_eq!(format!("{:?}", controller.motion.law), before);
}

/// The clear succeeds for one of the two faulty joints, so the controller accepts it, although the fault of the other
/// joint stays.
#[test]
fn j21_a_clear_of_one_of_two_faulty_joints_is_accepted() {
    for (nodes, expected) in [(0x01, Ok(())), (0x40, Err(DataStatus::NotAllowed))] {
        let mut controller = faulty();
        let command = Command::ClearCurrentErrors { jtc: true, nodes };
        assert_eq!(carry_out(&mut controller, command), expected, "{nodes:#x}");
        assert_eq!(controller.errors.any(), expected.is_err(), "{nodes:#x}");
    }
}

#[test]
fn j69_the_cause_of_a_stop_is_cleared_with_the_occurred_errors() {
    for (mut controller, expected) in [(holding(), Ok(())), (faulty(), Err(DataStatus::NotAllowed))] {
        controller.last_stop.tick = 5;
        assert_eq!(carry_out(&mut controller, Command::ClearOccurredErrors), expected);
        assert_eq!(controller.last_stop.tick, if expected.is_ok() { 0 } else { 5 }, "{expected:?}");
    }
}

#[test]
fn j25_teaching_is_accepted_in_hold_pos_with_all_joints_and_without_a_later_stop() {
    for (state, absent, overtaken, stops, accepted) in [
        (ControllerState::HoldPos, false, false, None, true),
        (ControllerState::HoldPos, true, false, None, false),
        (ControllerState::HoldPos, false, true, None, false),
        (ControllerState::HoldPos, false, false, Some(0), false),
        (ControllerState::Operate, false, false, None, false),
    ] {
        let mut controller = holding();
        (controller.state, controller.safety_stop_ms) = (state, stops);
        controller.config.absent[5] = absent;
        let result = controller.carry_out(&HostEvent { overtaken, ..ON_LINE_0 }, Command::TeachingModeEnable);
        let expected = if accepted { Ok(()) } else { Err(DataStatus::NotAllowed) };
        assert_eq!(outcome(result), expected, "{state:?} {absent} {overtaken} {stops:?}");
        assert_eq!(controller.teaching, accepted, "{state:?} {absent} {overtaken} {stops:?}");
    }
}

/// Only a change of the arm makes the controller compute the hash of the arm again.
#[test]
fn j52_commands_that_are_refused_do_not_clear_the_hash() {
    for command in [Command::TeachingModeEnable, Command::GripperControl { pump: true }] {
        let mut controller = holding();
        (controller.state, controller.config.gripper) = (ControllerState::Init, false);
        controller.extensions.hash = Some(7);
        let text = format!("{command}");
        assert_eq!(carry_out(&mut controller, command), Err(DataStatus::NotAllowed), "{text}");
        assert_eq!(controller.extensions.hash, Some(7), "{text}");
    }
}

/// The learned load is 0 N·m, and the integral holds 4 N·m. A load that is not learned yet counts as equal to the
/// integral. If the load is 4 N·m after a command, this command has therefore cleared the learned load.
#[test]
fn j60_j66_only_an_accepted_model_under_torque_clears_the_learned_loads() {
    let unfinished = || SliceOutcome::Unfinished(SliceProgress::Begin);
    let refused = || SliceOutcome::Refused(DataStatus::IncorrectValue);
    for (state, taken, load) in [
        (ControllerState::HoldPos, SliceOutcome::Done, 4.0),
        (ControllerState::HoldPos, unfinished(), 0.0),
        (ControllerState::HoldPos, refused(), 0.0),
        (ControllerState::Init, SliceOutcome::Done, 0.0),
        (ControllerState::Init, unfinished(), 0.0),
    ] {
        let mut controller = holding();
        controller.state = state;
        controller.motion.law.find_loads_for_test();
        controller.motion.law.torque[0].pid.i = 4.0;
        controller.model_taken(taken);
        assert_eq!(controller.motion.law.load(0), load, "{state:?}");
    }
}

#[test]
fn j71_only_other_gains_under_torque_begin_a_trial() {
    let mut other = defaults::PID;
    other[0].kp *= 0.5;
    for (state, gains, trial) in [
        (ControllerState::HoldPos, &defaults::PID, false),
        (ControllerState::HoldPos, &other, true),
        (ControllerState::Init, &other, false),
    ] {
        let mut controller = holding();
        controller.state = state;
        assert_eq!(controller.take_gains(gains), Ok(()), "{state:?}");
        assert_eq!(controller.parameters.trial.runs(), trial, "{state:?}");
        assert_eq!(&controller.parameters.pid, gains, "{state:?}");
    }
}

/// A Stop in HoldPos without a path is accepted if it cancels a request for Teaching.
#[test]
fn j25_a_stop_or_a_pause_cancels_a_request_for_teaching() {
    for command in [ExecCommand::Stop, ExecCommand::Pause] {
        for (teaching, expected) in [(true, Ok(())), (false, Err(DataStatus::NotAllowed))] {
            let mut controller = holding();
            controller.teaching = teaching;
            assert_eq!(controller.execute(command), expected, "{command:?}");
            assert!(!controller.teaching);
        }
    }
}

#[test]
fn j53_a_path_is_not_executed_with_absent_joints() {
    for (absent, expected) in [(false, Ok(())), (true, Err(DataStatus::NotAllowed))] {
        let mut controller = holding();
        load(&mut controller, 0, 2);
        load(&mut controller, 1, 2);
        controller.config.absent[4] = absent;
        assert_eq!(controller.execute(ExecCommand::Execute), expected, "{absent}");
        assert_eq!(controller.trajectory == TrajectoryState::Execute, !absent);
    }
}

#[test]
fn j36_a_refused_execute_shows_the_error_of_its_joint_only() {
    let violation =
        Violation { point: 0, fraction: 0.0, joint: 3, quantity: Quantity::Position, value: 9.0, limit: 3.0 };
    let mut controller = holding();
    load(&mut controller, 0, 2);
    load(&mut controller, 1, 2);
    controller.store.refuse(violation);
    assert_eq!(controller.execute(ExecCommand::Execute), Err(DataStatus::IncorrectValue));
    for j in 0..JOINTS {
        let expected = if j == 3 { crate::joint_error::POSITION } else { 0 };
        assert_eq!(controller.errors.joint(j), (0, expected), "{j}");
    }
    assert_eq!(controller.violation(), Some(&violation));
}
