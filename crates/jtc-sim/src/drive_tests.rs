//! Tests of the drives, with one test for each property.
use jtc_bus::{Answer, JointReport, Request, warning};

use super::*;
use crate::request::NodeRequest;

fn change(drive: &mut Drive, target: NodeState) -> NodeState {
    match drive.receive(0, &NodeRequest::ChangeFsm([target; 7])) {
        Some(Answer::State { state, .. }) => state,
        answer => panic!("{answer:?}"),
    }
}

fn configure(drive: &mut Drive, bits: u8) -> bool {
    match drive.receive(0, &Request::ChangeMode { mode: [1; 6], config: [bits; 6], gripper: 0 }.into()) {
        Some(Answer::Mode { accepted, .. }) => accepted,
        answer => panic!("{answer:?}"),
    }
}

fn command(drive: &mut Drive, torque: f64) -> JointReport {
    match drive.receive(0, &Request::Move { torque: [torque; 6], pump: false }.into()) {
        Some(Answer::Joint { report, .. }) => report,
        answer => panic!("{answer:?}"),
    }
}

fn run(drive: &mut Drive, ms: u32, q: f64) {
    (0..ms).for_each(|_| drive.tick(q, q, 25.0));
}

fn booted_at(q: f64) -> Drive {
    let mut drive = Drive::new(0, DriveConfig::default(), 364.0);
    run(&mut drive, 253, q);
    assert_eq!(drive.state(), NodeState::INIT);
    drive
}

fn booted() -> Drive {
    booted_at(0.5)
}

fn enabled_at(q: f64) -> Drive {
    let mut drive = booted_at(q);
    assert!(configure(&mut drive, 0x17));
    change(&mut drive, NodeState::READY);
    run(&mut drive, 2, q);
    assert_eq!(drive.state(), NodeState::READY);
    change(&mut drive, NodeState::ENABLED);
    run(&mut drive, 4010, q);
    assert_eq!(drive.state(), NodeState::ENABLED);
    drive
}

fn enabled() -> Drive {
    enabled_at(0.5)
}

#[test]
fn boot_is_silent_for_a_quarter_of_a_second() {
    let mut drive = Drive::new(3, DriveConfig::default(), 79.0);
    run(&mut drive, 249, 0.0);
    assert_eq!(drive.receive(0, &Request::Move { torque: [0.0; 6], pump: false }.into()), None);
    run(&mut drive, 1, 0.0);
    assert!(drive.on_bus());
}

#[test]
fn j16_position_is_zero_until_the_encoder_is_configured() {
    let mut drive = booted();
    assert_eq!(command(&mut drive, 0.0).position, 0.0);
    assert!(configure(&mut drive, 0x17));
    run(&mut drive, 1, 0.5);
    let step = core::f64::consts::TAU / 65_536.0;
    assert!((command(&mut drive, 0.0).position - 0.5).abs() <= step / 2.0 + 1e-6);
}

#[test]
fn j16_first_enable_takes_four_seconds_later_ones_a_rest() {
    let mut drive = booted();
    configure(&mut drive, 0x17);
    change(&mut drive, NodeState::READY);
    run(&mut drive, 2, 0.5);
    assert_eq!(
        change(&mut drive, NodeState::ENABLED),
        NodeState::READY,
        "the answer is the state before the change"
    );
    run(&mut drive, 3999, 0.5);
    assert_eq!(drive.state(), NodeState::READY_TO_ENABLED);
    run(&mut drive, 3, 0.5);
    assert_eq!(drive.state(), NodeState::ENABLED);
    change(&mut drive, NodeState::READY);
    run(&mut drive, 2, 0.5);
    assert_eq!(drive.state(), NodeState::READY);
    change(&mut drive, NodeState::ENABLED);
    run(&mut drive, 390, 0.5);
    assert_eq!(drive.state(), NodeState::READY_TO_ENABLED);
    run(&mut drive, 20, 0.5);
    assert_eq!(drive.state(), NodeState::ENABLED);
}

#[test]
fn j12_the_last_torque_stays_for_ever() {
    let mut drive = enabled();
    command(&mut drive, 12.0);
    assert_eq!(drive.torque(), 0.0, "it acts with the next tick");
    run(&mut drive, 60_000, 0.5);
    assert_eq!(drive.torque(), 12.0);
}

#[test]
fn j16_reported_torque_has_the_sign_of_the_command() {
    let mut drive = enabled();
    command(&mut drive, 12.0);
    run(&mut drive, 1, 0.5);
    assert_eq!(command(&mut drive, -1.0).torque, -12.0);
}

#[test]
fn torque_is_clamped_silently() {
    let mut drive = enabled();
    command(&mut drive, -1000.0);
    run(&mut drive, 1, 0.5);
    assert_eq!((drive.torque(), drive.state()), (-364.0, NodeState::ENABLED));
}

#[test]
fn speed_is_late_and_coarse() {
    let mut drive = enabled();
    for k in 1..=100 {
        let q = 0.5 + 0.3e-3 * f64::from(k);
        drive.tick(q, q, 25.0);
        let v = command(&mut drive, 0.0).velocity;
        if k == 5 {
            assert!((v - 0.15).abs() < 0.001, "half of the window: {v}");
        } else if k >= 10 {
            assert!((v - 0.3).abs() < 6e-4, "{v}");
        }
    }
}

#[test]
fn over_speed_trips_either_way_and_only_when_configured() {
    for (bits, state) in [(0x17, NodeState::FAULT), (0x07, NodeState::ENABLED)] {
        for speed in [-2.0e-3, 2.0e-3] {
            let mut drive = enabled();
            drive.bits = bits;
            (0..30).map(|k| 0.5 + speed * f64::from(k)).for_each(|q| drive.tick(q, q, 25.0));
            assert_eq!(drive.state(), state, "{speed} rad/ms");
            assert_eq!(drive.errors, if state == NodeState::FAULT { error_bit::OVER_SPEED } else { 0 });
        }
    }
}

#[test]
fn outside_the_working_area_only_inward_torque_acts() {
    let mut drive = enabled_at(2.995);
    command(&mut drive, 5.0);
    run(&mut drive, 1, 2.995);
    assert_eq!((drive.torque(), drive.state()), (0.0, NodeState::ENABLED));
    assert_eq!(command(&mut drive, -5.0).warnings, warning::OUTSIDE_WORKING_AREA);
    run(&mut drive, 1, 2.995);
    assert_eq!(drive.torque(), -5.0);
}

#[test]
fn j16_safety_line_drops_to_ready_without_an_error() {
    let mut drive = enabled();
    drive.fault.safety_line = true;
    // The drive must change its state in one tick, without an intermediate transition state.
    run(&mut drive, 1, 0.5);
    assert_eq!(drive.state(), NodeState::READY);
    let report = command(&mut drive, 0.0);
    assert_eq!((report.errors, report.warnings), (0, warning::SAFETY_LINE));
}

#[test]
fn j21_fault_is_left_by_init_only_and_comes_back_while_the_cause_stands() {
    let mut drive = enabled();
    drive.fault.motor_control = 0x40;
    run(&mut drive, 1, 0.5);
    assert_eq!(drive.state(), NodeState::FAULT_REACTION);
    assert_eq!(drive.torque(), 0.0);
    run(&mut drive, 2, 0.5);
    assert_eq!(drive.state(), NodeState::FAULT);
    change(&mut drive, NodeState::READY);
    run(&mut drive, 5, 0.5);
    assert_eq!(drive.state(), NodeState::FAULT);
    change(&mut drive, NodeState::INIT);
    run(&mut drive, 10, 0.5);
    assert_eq!(drive.state(), NodeState::FAULT, "the cause stands");
    drive.fault.motor_control = 0;
    assert_eq!(command(&mut drive, 0.0).mc_occurred, 0x40);
    change(&mut drive, NodeState::INIT);
    run(&mut drive, 3, 0.5);
    let report = command(&mut drive, 0.0);
    assert_eq!((report.state, report.mc_occurred, report.errors), (NodeState::INIT, 0, 0));
}

#[test]
fn j16_an_echoed_fault_byte_is_a_command_to_move() {
    let mut drive = booted();
    change(&mut drive, NodeState::READY);
    run(&mut drive, 2, 0.5);
    change(&mut drive, NodeState::FAULT);
    run(&mut drive, 1, 0.5);
    assert_eq!(drive.state(), NodeState::READY_TO_ENABLED);
}

#[test]
fn a_request_of_zero_cancels_a_pending_one() {
    let mut drive = booted();
    change(&mut drive, NodeState::READY);
    change(&mut drive, NodeState::START);
    run(&mut drive, 5, 0.5);
    assert_eq!(drive.state(), NodeState::INIT);
    // A completed transition must also clear a pending request.
    change(&mut drive, NodeState::READY);
    run(&mut drive, 1, 0.5);
    change(&mut drive, NodeState::ENABLED);
    run(&mut drive, 5, 0.5);
    assert_eq!(drive.state(), NodeState::READY);
}

#[test]
fn configuration_is_refused_when_enabled_and_lost_by_a_reset() {
    let mut drive = enabled();
    assert!(!configure(&mut drive, 0x17));
    assert_eq!(drive.receive(0, &Request::Reset(1).into()), None);
    assert_eq!(drive.state(), NodeState::ENABLED);
    assert_eq!(drive.receive(0, &Request::ResetAll.into()), None);
    run(&mut drive, 260, 0.5);
    assert_eq!(command(&mut drive, 0.0).position, 0.0);
}

#[test]
fn j16_the_safety_line_warns_until_the_first_configuration() {
    let mut drive = booted();
    assert_eq!(command(&mut drive, 0.0).warnings, warning::SAFETY_LINE);
    configure(&mut drive, 0x17);
    run(&mut drive, 1, 0.5);
    assert_eq!(command(&mut drive, 0.0).warnings, 0);
    drive.reset();
    run(&mut drive, 260, 0.5);
    assert_eq!(
        command(&mut drive, 0.0).warnings,
        warning::SAFETY_LINE,
        "a reset takes the configuration away"
    );
}

#[test]
fn j16_a_request_of_254_forces_the_fault_state_without_an_error_bit() {
    for mut drive in [booted(), enabled()] {
        change(&mut drive, NodeState::FAULT_REACTION);
        run(&mut drive, 1, 0.5);
        let report = command(&mut drive, 5.0);
        assert_eq!((report.state, report.errors, report.mc_occurred), (NodeState::FAULT, 0, 0));
        run(&mut drive, 5, 0.5);
        assert_eq!((drive.state(), drive.torque()), (NodeState::FAULT, 0.0));
        change(&mut drive, NodeState::INIT);
        run(&mut drive, 3, 0.5);
        assert_eq!(drive.state(), NodeState::INIT);
    }
}

#[test]
fn a_drive_that_ignores_its_state_command_answers_and_stays() {
    let mut drive = enabled();
    drive.fault.ignores_state = true;
    command(&mut drive, 5.0);
    assert_eq!(change(&mut drive, NodeState::READY), NodeState::ENABLED);
    run(&mut drive, 100, 0.5);
    assert_eq!((drive.state(), drive.torque()), (NodeState::ENABLED, 5.0));
}
