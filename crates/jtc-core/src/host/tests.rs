//! Tests of the effect of single host commands, and of the share of a tick that each command uses (J-04, J-21, J-23, J-36).
extern crate std;
use std::vec::Vec;

use jtc_wire::{FrameRef, FrameStatus, FrameType, Segment, missing_parameter};

use super::*;
use crate::nodes::Nodes;
use crate::trajectory::check::TrajectoryCheck;
use crate::{Config, HOST_LINES};

mod commands;
mod uploads;

type Bench = Controller<[RawPoint; 64]>;

/// Event on line 0 for commands that the tests execute directly, without a frame.
const ON_LINE_0: HostEvent<'_> =
    HostEvent { line: 0, overtaken: false, plain: false, event: LinkEvent::Noise(Response::NONE) };

fn holding() -> Bench {
    let mut controller = Bench::new(Config::avena(), [RawPoint::default(); 64]);
    controller.state = ControllerState::HoldPos;
    controller
}

/// Sends three equal frames. Returns how many of them one tick completes.
fn done_of_three(controller: &mut Bench, frame_type: FrameType, body: &[u8]) -> usize {
    let bytes: Vec<u8> = [&[0; 4], body, &[0; 2]].concat();
    let event = LinkEvent::Frame(FrameRef { frame_type, bytes: &bytes });
    let host = [HostEvent { line: 0, overtaken: false, plain: false, event }; 3];
    controller.serve_host(&Inputs { host: &host, ..Inputs::QUIET })
}

#[test]
fn j04_commands_of_a_few_instructions_leave_time_for_others_in_the_same_tick() {
    use FrameType::*;
    for (frame_type, body, done) in [
        (TeachingModeDisable, &[][..], 3),
        (GripperControl, &[1, 0, 0, 0], 3),
        (GripperControl, &[0, 0, 0, 0], 3),
        (ClearOccurredErrors, &[], 3),
        (ClearCurrentErrors, &[1, 0x7F, 0, 0], 3),
        (ResetCanDevices, &[0x40, 0, 0, 0], 1),
        (PidParamUseDefault, &[], 1),
        // The state does not allow this command, and its refusal takes no time, so one tick completes all three
        // frames.
        (TrajSetExecStatus, &[3, 0, 0, 0], 3),
    ] {
        assert_eq!(done_of_three(&mut holding(), frame_type, body), done, "{frame_type:?} {body:?}");
    }
    // If a command changes the state of the controller, the next command must wait for the next tick.
    let mut teaching = holding();
    teaching.teaching = true;
    assert_eq!(done_of_three(&mut teaching, TeachingModeDisable, &[]), 1);
    let mut error = holding();
    error.state = ControllerState::Error;
    assert_eq!(done_of_three(&mut error, ClearOccurredErrors, &[]), 1);
}

/// The frame of an urgent Stop can be lost. Therefore the first event that arrived after the Stop clears the record
/// of the urgent commands on its line. Otherwise a later Stop would be reported as already accepted.
#[test]
fn j04_what_was_overtaken_is_forgotten_with_the_first_event_behind_it() {
    let before = Priority { stops: 2, pauses: 1, cancelled: true, stopped: true };
    for (overtaken, left) in [(true, before), (false, Priority::default())] {
        let mut controller = holding();
        controller.priorities = [before; HOST_LINES];
        let event = LinkEvent::Bad(Response::bad(0, FrameStatus::IncorrectHeader, 0));
        controller.serve(&HostEvent { line: 1, overtaken, plain: false, event });
        assert_eq!(controller.priorities, [before, left]);
    }
}

#[test]
fn j21_a_clear_of_nodes_alone_leaves_the_controller_its_own_errors() {
    for (jtc, left) in [(true, false), (false, true)] {
        let mut controller = holding();
        controller.errors.raise_device();
        controller.carry_out(&ON_LINE_0, Command::ClearCurrentErrors { jtc, nodes: 0x7F });
        assert_eq!(controller.errors.any(), left, "{jtc}");
    }
}

#[test]
fn j23_a_reset_switches_the_pump_off_with_its_gripper_only() {
    for (nodes, pump) in [(0x00, true), (0x3F, true), (0x40, false), (0x7F, false)] {
        let mut controller = holding();
        controller.pump = true;
        assert!(matches!(
            controller.carry_out(&ON_LINE_0, Command::ResetCanDevices { nodes }),
            SliceOutcome::Done
        ));
        assert_eq!(controller.pump, pump, "{nodes:#x}");
    }
}

#[test]
fn j23_a_pump_is_switched_where_there_is_a_gripper_and_never_on_in_error() {
    for (gripper, state, pump, done) in [
        (true, ControllerState::HoldPos, true, true),
        (true, ControllerState::HoldPos, false, true),
        (true, ControllerState::Error, true, false),
        (true, ControllerState::Error, false, true),
        (false, ControllerState::HoldPos, true, false),
        (false, ControllerState::HoldPos, false, false),
        (false, ControllerState::Error, false, false),
    ] {
        let mut controller = holding();
        (controller.config.gripper, controller.state, controller.pump) = (gripper, state, !pump);
        let progress = controller.carry_out(&ON_LINE_0, Command::GripperControl { pump });
        assert_eq!(matches!(progress, SliceOutcome::Done), done, "{gripper} {state:?} {pump}");
        assert_eq!(controller.pump == pump, done, "{gripper} {state:?} {pump}");
    }
}

/// Returns segment `segment` of a trajectory with two segments, for an arm at rest, with points 10 ms apart.
fn body(segment: u8, points: usize) -> Vec<u8> {
    let mut body = [0, 1, 0, segment, 0, 2, 0, 10].to_vec();
    body.resize(body.len() + 36 * points, 0);
    body
}

/// Loads a segment and returns the number of ticks that its check needed.
fn load(controller: &mut Bench, segment: u8, points: usize) -> usize {
    let body = body(segment, points);
    let (segment, mut checks) = (Segment::parse(&body).expect("a segment"), 0);
    controller.slice_progress = SliceProgress::Begin;
    loop {
        checks += usize::from(!matches!(controller.slice_progress, SliceProgress::PointCopy(_)));
        match controller.take_segment(&segment, &ON_LINE_0) {
            SliceOutcome::Unfinished(next) => controller.slice_progress = next,
            SliceOutcome::Done => return checks,
            SliceOutcome::Refused(status) => panic!("{status:?}"),
        }
    }
}

#[test]
fn j36_a_segment_is_checked_with_its_last_point() {
    for (points, checks) in [(1, 1), (15, 1), (16, 1), (17, 2), (32, 2), (33, 3), (48, 3)] {
        assert_eq!(load(&mut holding(), 0, points), checks, "{points} points");
    }
}

/// The check of segment 0 uses the present friction parameters. If friction parameters arrive after segment 0, later
/// segments do not clear the flag `friction_is_new`, so Execute checks the path again.
#[test]
fn j36_friction_given_between_two_segments_is_new_to_the_path() {
    let mut controller = holding();
    controller.parameters.friction_is_new = true;
    load(&mut controller, 0, 4);
    assert!(!controller.parameters.friction_is_new);
    controller.parameters.friction_is_new = true;
    load(&mut controller, 1, 4);
    assert!(controller.parameters.friction_is_new);
    assert_eq!(controller.trajectory, TrajectoryState::Stop);
}

/// The velocities of this path are outside the friction table. If the table is newer than the path, Execute checks
/// the velocity range of the path against the table and refuses the path. Without new friction parameters, Execute
/// does not repeat this check, because the segments have already passed an exact check.
#[test]
fn j36_the_velocities_of_the_path_are_asked_again_when_friction_is_new() {
    let body = body(0, 1);
    let segment = Segment::parse(&body).expect("a segment");
    for (table, new, refused) in
        [(true, true, true), (true, false, false), (false, true, false), (false, false, false)]
    {
        let mut controller = holding();
        (controller.parameters.friction_is_table, controller.parameters.friction_is_new) = (table, new);
        for table in &mut controller.parameters.tables {
            // The table contains the temperature of the bearings, 0 °C.
            table.temperature = core::array::from_fn(|i| i as f32);
        }
        let mut fast = TrajectoryCheck::new(&controller.config, 10, None);
        let point = RawPoint { velocity: [0, 0, 0, i16::MAX, 0, 0], ..RawPoint::default() };
        assert!(fast.take(&point).is_err(), "it is beyond every limit");
        controller.store.commit(&segment, fast.passed());
        let verdict = controller.check_friction();
        assert_eq!(verdict, if refused { Err(DataStatus::IncorrectValue) } else { Ok(()) }, "{table} {new}");
        assert_eq!(controller.violation.map(|v| v.joint), refused.then_some(3), "{table} {new}");
    }
}

/// Gravity acts sideways, so a torque limit of 0.01 N·m cannot hold the arm. The controller refuses the model only if
/// all joint positions are known.
#[test]
fn j06_whether_a_model_can_be_held_is_asked_when_every_position_is_known() {
    for (known, torque_max, taken) in [(false, 0.01, true), (true, 0.01, false), (true, 500.0, true)] {
        let mut controller = holding();
        controller.config.gravity = [9.81, 0.0, 0.0];
        controller.config.joints.iter_mut().for_each(|joint| joint.torque_max = torque_max);
        if known {
            controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        }
        let outcome = loop {
            match controller.carry_out(&ON_LINE_0, Command::ArmModelUseDefault) {
                SliceOutcome::Unfinished(next) => controller.slice_progress = next,
                outcome => break outcome,
            }
        };
        assert_eq!(matches!(outcome, SliceOutcome::Done), taken, "{known} {torque_max}");
        let missing = controller.parameters.missing() & missing_parameter::MODEL;
        assert_eq!(missing == 0, taken, "{known} {torque_max}");
    }
}
