//! Tests of missing answers, and of answers with impossible positions (J-35, J-63). The torque has no step when these faults begin or end.
use crate::rig;

use jtc_bus::Request;
use jtc_core::{Config, ControllerState, JointTelemetry, error};
use jtc_wire::{FrameType, RawPoint};
use rig::{Rig, pieces};

const JOINT: usize = 1;
const NODE_ERROR: u16 = error::EXTERNAL | error::EXTERNAL_JOINTS;

/// Motion of the arm, with its speed in rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// Motion in HoldPos, while a hand pushes the arm at this velocity.
    Held(f64),
    Operate(f64),
    /// Motion in Teaching, while a hand moves the arm at this velocity.
    Led(f64),
}

const MOTIONS: [Motion; 7] = [
    Motion::Held(0.0),
    Motion::Held(0.3),
    Motion::Operate(0.0),
    Motion::Operate(1.0),
    Motion::Operate(-1.0),
    Motion::Led(0.0),
    Motion::Led(-0.9),
];

/// Fault of the answers of a joint.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    Glitch { rad: f64, ms: usize },
    Lost { ms: usize },
}

/// Returns a path that accelerates to a velocity in 0.2 s, keeps this velocity for 0.6 s, and stops in 0.2 s.
fn path(velocity: f64) -> Vec<RawPoint> {
    pieces(JOINT, &[(5.0 * velocity, 20), (0.0, 60), (-5.0 * velocity, 20)])
}

fn roomy() -> Config {
    let mut config = Config::avena();
    for joint in &mut config.joints {
        joint.torque_max = 360.0;
    }
    config
}

/// Returns the joint's telemetry over 400 ticks. The fault occurs in the middle of the motion.
fn run(motion: Motion, fault: Fault) -> Vec<JointTelemetry> {
    let mut rig = Rig::holding_with(roomy());
    let state = match motion {
        Motion::Held(_) => ControllerState::HoldPos,
        Motion::Operate(velocity) => {
            rig.move_along(&path(velocity), 2);
            ControllerState::Operate
        }
        Motion::Led(_) => {
            rig.follow = false;
            rig.ask(FrameType::TeachingModeEnable, &[]);
            rig.run(150);
            ControllerState::Teaching
        }
    };
    let mut all = Vec::new();
    for tick in 0..400 {
        let velocity = match motion {
            Motion::Operate(_) => rig.controller.telemetry().joints[JOINT].set_velocity,
            // A hand pushes the joint away and releases it.
            Motion::Held(velocity) => {
                if (170..220).contains(&tick) {
                    velocity
                } else {
                    0.0
                }
            }
            Motion::Led(velocity) => velocity,
        };
        match motion {
            Motion::Operate(_) => {}
            // A hand pushes the joint away and releases it.
            Motion::Held(_) => {
                rig.follow = velocity == 0.0;
                rig.nodes[JOINT].report.position += if tick < 220 { velocity * 0.001 } else { 0.0 };
            }
            Motion::Led(_) => rig.nodes[JOINT].report.position += velocity * 0.001,
        }
        rig.nodes[JOINT].report.velocity =
            if tick >= 220 && state == ControllerState::HoldPos { 0.0 } else { velocity };
        let within = |ms: usize| (200..200 + ms).contains(&tick);
        match fault {
            Fault::None => {}
            Fault::Glitch { rad, ms } => rig.nodes[JOINT].glitch = if within(ms) { rad } else { 0.0 },
            Fault::Lost { ms } => rig.nodes[JOINT].silent = within(ms),
        }
        rig.tick();
        assert_eq!((rig.state(), rig.errors()), (state, 0), "{motion:?} {fault:?} in tick {tick}");
        all.push(rig.controller.telemetry().joints[JOINT]);
    }
    all
}

/// Returns the torque that the controller adds to the model torque, N·m.
fn correction(joint: &JointTelemetry) -> f64 {
    joint.torque - joint.torque_model
}

/// Returns the largest difference between the steps of the correction in the two runs, N·m.
fn worst_step(clean: &[JointTelemetry], faulty: &[JointTelemetry]) -> f64 {
    let steps = |run: &[JointTelemetry]| -> Vec<f64> {
        run.windows(2).map(|pair| correction(&pair[1]) - correction(&pair[0])).collect()
    };
    let (clean, faulty) = (steps(clean), steps(faulty));
    clean.iter().zip(&faulty).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn j35_a_glitch_of_an_encoder_makes_no_torque_step() {
    for motion in MOTIONS {
        let clean = run(motion, Fault::None);
        for rad in [0.01, -0.01, 0.02, 0.05, -0.05, 0.3, -0.3] {
            for ms in [1, 2, 3, 4] {
                let worst = worst_step(&clean, &run(motion, Fault::Glitch { rad, ms }));
                assert!(worst < 1.0, "{motion:?}, {rad} rad for {ms} ms: {worst} N·m");
            }
        }
    }
}

#[test]
fn j63_lost_answers_make_no_torque_step() {
    for motion in MOTIONS {
        let clean = run(motion, Fault::None);
        for ms in 1..=4 {
            let faulty = run(motion, Fault::Lost { ms });
            let worst = worst_step(&clean, &faulty);
            assert!(worst < 1.0, "{motion:?}, {ms} answers lost: {worst} N·m");
            // With lost answers, the control law must use nearly the same position as without lost answers.
            for (clean, faulty) in clean.iter().zip(&faulty) {
                let off = (clean.position - faulty.position).abs();
                assert!(off < 2e-4, "{motion:?}, {ms} answers lost: {off} rad");
            }
        }
    }
}

#[test]
fn j35_a_position_that_stays_implausible_is_an_error_of_the_joint_and_is_then_taken() {
    for state in [ControllerState::HoldPos, ControllerState::Teaching] {
        let mut rig = Rig::holding();
        rig.follow = false;
        if state == ControllerState::Teaching {
            rig.ask(FrameType::TeachingModeEnable, &[]);
        }
        rig.run(3);
        rig.nodes[JOINT].glitch = 0.3;
        // An answer arrives one tick after its Move. The controller must tolerate four consecutive implausible
        // answers, and the fifth must be an error.
        rig.run(5);
        assert_eq!((rig.state(), rig.errors()), (state, 0));
        assert!(rig.controller.telemetry().joints[JOINT].position.abs() < 1e-9);
        rig.tick();
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Error, NODE_ERROR));
        assert_eq!(rig.torque, [0.0; 6]);
        let status = rig.status();
        assert_eq!((status.can_error, status.can_current, status.can_occurred), (0, 0, 0), "no CAN timeout");
        assert!((status.joints[JOINT].position - 0.3).abs() < 1e-6, "taken as it is");
        rig.clear(true, 0x7F);
        rig.run(300);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        assert!((rig.controller.telemetry().joints[JOINT].set_position - 0.3).abs() < 1e-6);
    }
}

/// The setting `missed_moves_max` limits the number of consecutive answers of a joint that are missing or implausible.
#[test]
fn j63_silence_and_implausible_answers_count_together() {
    for max in [3, 5, 20] {
        let mut rig = Rig::holding_with(Config { missed_moves_max: max, ..Config::avena() });
        rig.run(3);
        for tick in 0..max {
            assert_eq!(rig.errors(), 0, "{tick} of {max}");
            rig.nodes[JOINT].silent = tick % 2 == 0;
            rig.nodes[JOINT].glitch = 0.8;
            rig.tick();
        }
        rig.tick();
        assert_eq!(rig.errors(), NODE_ERROR, "{max}");
        // A usable answer sets the count of missing answers to zero, so repeated losses with usable answers in
        // between are not an error.
        let mut rig = Rig::holding_with(Config { missed_moves_max: max, ..Config::avena() });
        for tick in 0..500 {
            rig.nodes[JOINT].silent = tick % u32::from(max) != 0;
            rig.tick();
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    }
}

/// A drive that does not know its exact position yet may later correct its position suddenly. This correction must
/// not be an error.
#[test]
fn j35_a_position_that_becomes_accurate_may_jump() {
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    rig.defaults();
    rig.run(30);
    rig.nodes[JOINT].report.warnings = jtc_bus::warning::POSITION_NOT_ACCURATE;
    rig.run(300);
    rig.nodes[JOINT].report.position = 0.037;
    rig.nodes[JOINT].report.warnings = 0;
    rig.run(300);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert!((rig.controller.telemetry().joints[JOINT].position - 0.037).abs() < 1e-6);
}

#[test]
fn j14_five_unanswered_moves_are_a_receive_timeout() {
    for node in 0..6 {
        let mut rig = Rig::holding();
        rig.nodes[node].silent = true;
        let from = rig.sent.len();
        rig.until(30, |r| r.state() == ControllerState::Error);
        assert_eq!(rig.status().can_current, 1 << (8 + node));
        // The answer to the last Move before the silence still arrives. The five missing answers count only after this
        // answer.
        let moves = rig.sent[from..].iter().take_while(|r| matches!(r, Request::Move { .. })).count();
        assert!(moves >= 5);
        let mut rig = Rig::holding();
        rig.nodes[node].silent = true;
        rig.run(4);
        rig.nodes[node].silent = false;
        rig.run(20);
        assert_eq!(rig.state(), ControllerState::HoldPos, "four missed answers are no error yet");
    }
}

#[test]
fn j14_five_moves_without_acknowledge_are_a_transmit_timeout() {
    let mut rig = Rig::holding();
    rig.acknowledged = false;
    rig.run(4);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(rig.status().can_current, 1);
}

#[test]
fn j14_a_bus_on_which_every_node_boots_is_no_error_until_that_takes_too_long() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.acknowledged = false;
    rig.run(1500);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Init, 0));
    rig.run(600);
    assert_eq!((rig.state(), rig.status().can_current), (ControllerState::Error, 1));
}

#[test]
fn j14_bus_off_is_an_error_at_once() {
    let mut rig = Rig::holding();
    rig.bus_off = true;
    rig.tick();
    assert_eq!(rig.state(), ControllerState::Error);
    assert!(matches!(rig.sent.last(), Some(Request::Move { torque, .. }) if *torque == [0.0; 6]));
    assert_ne!(rig.errors() & error::INTERNAL_CAN, 0);
}
