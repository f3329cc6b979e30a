//! Tests of a simulated arm with encoders that jump, slip, or have another scale than configured (J-35, J-66, J-69).
use crate::plant::{LuGre, POSES, Plant, Random};
use crate::rig::{Rig, floats, pieces};
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType, StopCause, StopKind, error, joint_error};

/// Returns the default arm in a pose, with its friction multiplied by `friction`.
fn arm(pose: [f64; 6], friction: f64) -> Plant {
    let friction = if friction == 0.0 { [LuGre::NONE; 6] } else { LuGre::of_avena_times(friction) };
    Plant::new(&Parameters::avena().model, friction, pose)
}

fn held(pose: [f64; 6], friction: f64) -> (Plant, Rig) {
    let mut arm = arm(pose, friction);
    let mut rig = arm.holding(Config::avena());
    arm.brakes = false;
    arm.run(&mut rig, 2_000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    (arm, rig)
}

/// Returns the largest motion of a joint within `ticks`, rad.
fn moved(arm: &mut Plant, rig: &mut Rig, ticks: usize) -> f64 {
    let (from, mut most) = (arm.q, 0.0f64);
    for _ in 0..ticks {
        arm.tick(rig);
        most = (0..6).map(|j| (arm.q[j] - from[j]).abs()).fold(most, f64::max);
    }
    most
}

fn cause(rig: &mut Rig) -> Option<StopCause> {
    rig.info().reactions.expect("reported").stop.map(|(cause, _)| cause)
}

/// A held arm must not move when an encoder jumps. The jump must cause a held stop, and the status must show the
/// cause.
#[test]
fn j35_j66_an_encoder_that_jumps_does_not_move_a_held_arm() {
    let mut random = Random(35);
    for trial in 0..60 {
        let joint = trial % 6;
        let size = random.between(0.005, 0.3) * if trial % 4 < 2 { 1.0 } else { -1.0 };
        // Without friction, only the controller holds the joint.
        let friction = if trial % 3 == 0 { 0.0 } else { 1.0 };
        let (mut arm, mut rig) = held(POSES[trial % 4], friction);
        rig.nodes[joint].glitch = size;
        let way = moved(&mut arm, &mut rig, 1_000);
        let what = format!("seed 35, trial {trial}: joint {} by {size:.4} rad", joint + 1);
        assert!(way < 2e-3, "{what}: moved by {way:.4} rad");
        assert_eq!(rig.state(), ControllerState::HoldPos, "{what}");
        assert!(rig.last.safety_output);
        let status = rig.status();
        assert!(status.is_held_stop() && status.errors == error::INTERNAL_JOINTS, "{what}: {status:?}");
        assert_eq!(status.joints[joint].internal, joint_error::POSITION_ERROR);
        let told = cause(&mut rig).expect("a cause");
        assert_eq!((told.kind, told.joint), (StopKind::EncoderJump, joint as u8 + 1), "{what}");
        assert!((f64::from(told.value) - size).abs() < 4e-4, "{what}: {told}");
        assert_eq!(rig.info().reactions.unwrap().jumped, 1 << joint);
    }
}

/// If an encoder jumps during a motion, the arm must not follow the jump. The arm must come to rest on its true path.
#[test]
fn j35_j69_an_encoder_that_jumps_in_motion_stops_the_arm_on_its_path() {
    for (joint, size) in [(0, 0.01), (0, -0.2), (1, 0.006), (2, -0.02), (4, 0.1)] {
        let (mut arm, mut rig) = held([0.0; 6], 1.0);
        let a = 1.5;
        rig.upload(&pieces(joint, &[(a, 40), (0.0, 40), (-a, 40)]), 10);
        arm.run(&mut rig, 200);
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        arm.run(&mut rig, 500);
        rig.nodes[joint].glitch = size;
        let mut apart = 0.0f64;
        for _ in 0..1_500 {
            arm.tick(&mut rig);
            let due = rig.controller.telemetry().joints[joint].due_position;
            apart = apart.max((arm.q[joint] - due).abs());
        }
        let what = format!("joint {} by {size} rad", joint + 1);
        assert!(apart < 5e-3, "{what}: {apart:.4} rad beside the path");
        assert_eq!(
            (rig.state(), rig.trajectory()),
            (ControllerState::HoldPos, TrajectoryState::Pause),
            "{what}"
        );
        assert_eq!(cause(&mut rig).map(|cause| cause.kind), Some(StopKind::EncoderJump), "{what}");
    }
}

/// Tests which commands the controller accepts after a jump, until the drive is configured again. The controller
/// knows the correct positions, but the drive reports wrong positions.
#[test]
fn j35_after_a_jump_only_slow_jogs_and_teaching_are_taken() {
    let (mut arm, mut rig) = held([0.0; 6], 1.0);
    rig.upload(&pieces(0, &[(1.0, 30), (-1.0, 30)]), 10);
    rig.nodes[0].glitch = 0.05;
    arm.run(&mut rig, 100);
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    arm.run(&mut rig, 100);
    assert!(!rig.status().is_held_stop());
    let jog = |rig: &mut Rig, rate: f32| rig.ask(FrameType::Jog, &floats([rate, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    assert_eq!(jog(&mut rig, 0.11), DataStatus::NotAllowed);
    assert_eq!(jog(&mut rig, 0.1), DataStatus::NoError);
    arm.run(&mut rig, 2_000);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    arm.run(&mut rig, 2_000);
    assert_eq!(rig.state(), ControllerState::Teaching);
    assert_eq!(rig.ask(FrameType::TeachingModeDisable, &[]), DataStatus::NoError);
    arm.run(&mut rig, 1_000);
    // The drive is configured again, and the controller then uses the position of this drive without a correction.
    rig.send(FrameType::Disable, &[]);
    arm.run(&mut rig, 100);
    assert_eq!(rig.state(), ControllerState::Init);
    rig.send(FrameType::ResetCanDevices, &[0x3F, 0, 0, 0]);
    arm.brakes = true;
    arm.run(&mut rig, 1_000);
    assert_eq!(rig.info().reactions.unwrap().jumped, 0);
    let position = f64::from(rig.status().joints[0].position);
    assert!((position - arm.q[0] - 0.05).abs() < 2e-4, "{position} of {}", arm.q[0]);
}

/// A wrong encoder reading that lasts for fewer than five answers must not count as a jump.
#[test]
fn j35_a_glitch_shorter_than_five_answers_is_no_jump() {
    for ticks in 1..5 {
        let (mut arm, mut rig) = held(POSES[0], 1.0);
        rig.nodes[1].glitch = 0.02;
        arm.run(&mut rig, ticks);
        rig.nodes[1].glitch = 0.0;
        let way = moved(&mut arm, &mut rig, 500);
        assert!(way < 1e-3, "{ticks} ticks: moved by {way:.4} rad");
        assert_eq!((rig.state(), rig.errors(), cause(&mut rig)), (ControllerState::HoldPos, 0, None));
    }
}

/// A person moves the arm by hand when an encoder jumps, and must not feel the jump. Teaching must end, and the
/// controller must hold the arm at its present position.
#[test]
fn j35_j66_an_encoder_that_jumps_ends_teaching() {
    let (mut arm, mut rig) = held(POSES[0], 1.0);
    rig.send(FrameType::TeachingModeEnable, &[]);
    arm.run(&mut rig, 1_000);
    assert_eq!(rig.state(), ControllerState::Teaching);
    rig.nodes[2].glitch = -0.03;
    let way = moved(&mut arm, &mut rig, 1_000);
    assert!(way < 2e-3, "moved by {way:.4} rad");
    assert!(rig.state() == ControllerState::HoldPos && rig.status().is_held_stop());
    assert_eq!(cause(&mut rig).map(|cause| cause.kind), Some(StopKind::EncoderJump));
}

/// If the speed of a drive has another full scale than configured, the controller detects this in the first motion and reports the factor.
#[test]
fn j35_a_speed_of_another_scale_is_a_held_stop() {
    for (scale, reported) in
        [(core::f64::consts::PI, 1.0 / core::f64::consts::PI), (1.0 / 3.0, 3.0), (-1.0, -1.0)]
    {
        let (mut arm, mut rig) = held([0.0; 6], 1.0);
        arm.speed_scale = scale;
        for k in 0..600 {
            if k % 50 == 0 {
                rig.send(FrameType::Jog, &floats([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]));
            }
            arm.tick(&mut rig);
        }
        arm.run(&mut rig, 600);
        assert_eq!(rig.state(), ControllerState::HoldPos, "{scale}");
        let told = cause(&mut rig).expect("a cause");
        assert_eq!((told.kind, told.joint), (StopKind::SpeedScale, 3), "{scale}: {told}");
        assert!((f64::from(told.value) / reported - 1.0).abs() < 0.1, "{scale}: {told}");
    }
}

/// If an encoder changes while the motor is at rest, the controller cannot hold this joint. The controller must
/// therefore report an error of the drive.
#[test]
fn j35_an_encoder_that_slips_is_an_external_error() {
    let (mut arm, mut rig) = held(POSES[0], 1.0);
    for k in 0..200 {
        rig.nodes[3].glitch = 2e-4 * f64::from(k);
        arm.tick(&mut rig);
        if rig.state() == ControllerState::Error {
            assert!(rig.errors() & error::EXTERNAL_JOINTS != 0);
            assert!(k < 100, "{k} ms");
            return;
        }
    }
    panic!("not found: {:?}", rig.controller.telemetry().joints[3]);
}

/// If the speed window is 0, the controller does not compare positions and speeds.
#[test]
fn j35_without_a_window_nothing_is_compared() {
    let mut arm = arm([0.0; 6], 1.0);
    let mut rig = arm.holding(Config { drive_speed_window_ms: 0, ..Config::avena() });
    arm.run(&mut rig, 1_000);
    rig.nodes[0].glitch = 0.004;
    arm.run(&mut rig, 500);
    assert_eq!((rig.errors(), cause(&mut rig)), (0, None));
}

/// A jump does not always occur in a single step. A jump can pass through an intermediate value, consist of two parts,
/// go back, or coincide with lost answers or with a jump of another joint. In all these cases, the arm must not move.
#[test]
fn j35_a_jump_in_parts_or_with_lost_answers_does_not_move_the_arm() {
    // Each course contains offsets of joints 2 and 4 from the true position (rad), each with its start time (ms). The second element of a
    // course contains the ticks whose answers are lost.
    type Course = (&'static [(usize, f64, f64)], &'static [usize]);
    let courses: [Course; 7] = [
        (&[(0, 0.3, 0.0), (1, 0.02, 0.0)], &[]),
        (&[(0, 0.01, 0.0), (2, 0.02, 0.0)], &[]),
        (&[(0, 0.015, 0.0)], &[2]),
        (&[(0, 0.015, 0.0)], &[0, 3]),
        (&[(0, 0.05, -0.03)], &[]),
        (&[(0, 0.02, 0.0), (7, 0.0, 0.0)], &[]),
        (&[(0, 0.02, 0.0), (300, 0.0, 0.0), (600, 0.02, 0.0)], &[]),
    ];
    for (course, lost) in courses {
        let (mut arm, mut rig) = held(POSES[0], 1.0);
        let from = arm.q;
        for ms in 0..1_500 {
            if let Some((_, second, fourth)) = course.iter().find(|(at, ..)| *at == ms) {
                (rig.nodes[1].glitch, rig.nodes[3].glitch) = (*second, *fourth);
            }
            arm.tick(&mut rig);
            if lost.contains(&ms) {
                rig.drop_answers(1);
            }
            let way = (0..6).map(|j| (arm.q[j] - from[j]).abs()).fold(0.0, f64::max);
            assert!(way < 2e-3, "{course:?} {lost:?}: moved by {way:.4} rad after {ms} ms");
        }
        let (status, jumped) = (rig.status(), rig.info().reactions.unwrap().jumped);
        assert!(status.is_held_stop(), "{course:?} {lost:?}: {:?}", rig.controller.telemetry().joints[1]);
        let both = course[0].2 != 0.0;
        assert_eq!(jumped, if both { 0b1010 } else { 0b10 }, "{course:?} {lost:?}");
        assert_eq!(status.joints[3].internal != 0, both);
    }
}

/// If both the position and the speed of an answer are wrong, the controller must not use this answer, and must not
/// count it as a jump.
#[test]
fn j35_j63_neither_position_nor_speed_of_garbage_is_used() {
    for (position, velocity) in [(0.3, 1.9), (-0.3, 1.2), (0.02, -1.5)] {
        for ticks in 1..4 {
            let (mut arm, mut rig) = held(POSES[0], 1.0);
            let from = arm.q;
            for ms in 0..500 {
                if ms < ticks {
                    rig.nodes[1].glitch = position;
                    rig.nodes[1].report.velocity = velocity;
                } else {
                    rig.nodes[1].glitch = 0.0;
                }
                arm.tick(&mut rig);
                let way = (0..6).map(|j| (arm.q[j] - from[j]).abs()).fold(0.0, f64::max);
                assert!(way < 2e-3, "{position} {velocity} for {ticks}: moved by {way:.4} rad");
            }
            assert_eq!((rig.state(), rig.errors(), cause(&mut rig)), (ControllerState::HoldPos, 0, None));
        }
    }
}

/// Each drive has its own clock. Near the boundary of a tick, an answer contains the reading of this millisecond or of the previous
/// millisecond. A difference of one reading does not count as a jump or as another scale, even at full speed.
#[test]
fn j35_answers_of_drives_whose_clocks_drift_are_no_jump() {
    for seed in 0..6u64 {
        let mut random = Random(seed + 1);
        let (mut arm, mut rig) = held([0.0; 6], 1.0);
        let joint = [0, 2, 4][seed as usize % 3];
        let (mut last, mut late) = ([Default::default(); 6], [false; 6]);
        for ms in 0..1_500 {
            if ms % 50 == 0 && ms < 1_200 {
                let mut rates = [0.0f32; 6];
                rates[joint] = 1.4;
                rig.send(FrameType::Jog, &floats(rates));
            }
            arm.tick(&mut rig);
            for ((node, last), late) in rig.nodes.iter_mut().zip(&mut last).zip(&mut late) {
                let now = (node.report.position, node.report.velocity);
                *late ^= random.next() < 0.03;
                if *late && ms > 0 {
                    (node.report.position, node.report.velocity) = *last;
                }
                *last = now;
            }
        }
        // The positions in this test contain much noise, so the controller may detect a push and end the jog. Only a
        // detected jump or a wrong scale is a fault.
        let kind = cause(&mut rig).map(|cause| cause.kind);
        let alarm = matches!(kind, Some(StopKind::EncoderJump | StopKind::SpeedScale));
        assert!(!alarm && rig.state() == ControllerState::HoldPos, "seed {}: {kind:?}", seed + 1);
        assert!(arm.q[joint] > 0.15, "it has moved at speed: {}", arm.q[joint]);
    }
}

/// In Teaching, a hand twists the gears before the motors begin to turn. The controller must not detect this twist as
/// a slipping encoder.
#[test]
fn j25_j35_a_gear_that_a_hand_twists_is_no_slip() {
    for stiffness in [3_400.0, 10_000.0] {
        let mut arm = arm(POSES[0], 1.3);
        let mut rig = arm.holding(Config { gear_stiffness: stiffness, ..Config::avena() });
        arm.brakes = false;
        arm.run(&mut rig, 2_000);
        rig.send(FrameType::TeachingModeEnable, &[]);
        arm.run(&mut rig, 500);
        assert_eq!(rig.state(), ControllerState::Teaching);
        // The encoder of the joint moves back and forth within 60 ms while the motor is at rest.
        for k in 0..600 {
            let part = 0.5 - 0.5 * (f64::from(k) * core::f64::consts::TAU / 120.0).cos();
            for (node, breakaway) in rig.nodes.iter_mut().zip([18.0, 18.0, 16.0, 8.0, 8.0, 8.0]) {
                node.glitch = part * breakaway / stiffness;
            }
            arm.tick(&mut rig);
            assert_eq!(
                (rig.state(), rig.errors()),
                (ControllerState::Teaching, 0),
                "{stiffness} N·m/rad, {k} ms"
            );
        }
    }
}

/// After a wrong scale was found, the controller refuses fast motions until the drives have been configured with the correct scale.
#[test]
fn j35_a_speed_of_another_scale_is_not_trusted_until_the_setting_is_right() {
    let (mut arm, mut rig) = held([0.0; 6], 1.0);
    rig.upload(&pieces(0, &[(1.0, 30), (-1.0, 30)]), 10);
    arm.speed_scale = core::f64::consts::PI;
    for k in 0..900 {
        if k % 50 == 0 && k < 600 {
            rig.send(FrameType::Jog, &floats([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]));
        }
        arm.tick(&mut rig);
    }
    assert_eq!(rig.clear(true, 0), DataStatus::NoError);
    arm.run(&mut rig, 200);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    assert_eq!(rig.status().joints[2].internal_occurred, joint_error::POSITION_ERROR);
    assert_eq!(rig.info().reactions.unwrap().jumped, 1 << 2);
}
