//! Tests of loads in hand guiding (J-25): loads that a hand moves to other poses, configured, removed or lifted loads, and arms with wrong
//! parameters.
use jtc_core::{ControllerState, Payload, settings};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, ExecCommand, FrameType};

use crate::hand_guiding::{arms, farthest, fastest, held, highest_speed, pose, teach, untouched};
use crate::plant::{ArmFile, LuGre, Plant, Random, loaded};
use crate::rig::{Rig, raw, rest};

/// Pose of the default arm that is stretched out, with joint 2 at `q2`.
fn at(q2: f64) -> [f64; 6] {
    [0.0, q2, 0.0, 0.0, 0.0, 0.0]
}

fn give(plant: &mut Plant, rig: &mut Rig, mass: f64) {
    let payload = if mass == 0.0 { Payload::NONE } else { Payload { mass, ..Payload::NONE } };
    let body: Vec<u8> = settings::payload_values(&payload).flat_map(|value| value.emit()).collect();
    rig.send(FrameType::SetSettings, &body);
    plant.run(rig, 1);
}

/// Simulates a hand that moves a joint by `way` (rad) at `speed` (rad/s) while the other joints are free, and then lets go.
pub(crate) fn lead(plant: &mut Plant, rig: &mut Rig, joint: usize, way: f64, speed: f64) {
    let (from, ms) = (plant.q[joint], (way.abs() / speed * 1000.0) as usize);
    for k in 0..ms + 500 {
        let to = from + way * f64::min(k as f64 / ms as f64, 1.0);
        plant.push[joint] = 3000.0 * (to - plant.q[joint]) - 100.0 * plant.v[joint];
        plant.tick(rig);
    }
    plant.push = [0.0; 6];
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
}

/// Replaces the mass at the flange of the simulated arm, without changing its positions and velocities.
fn reload(plant: &mut Plant, arm: &ArmFile, mass: f64) {
    let now = std::mem::replace(plant, Plant::of(arm, &loaded(arm.model, mass), plant.friction, plant.q));
    (plant.v, plant.rotor, plant.speeds, plant.brakes) = (now.v, now.rotor, now.speeds, now.brakes);
}

#[test]
fn j25_j60_a_payload_that_is_given_and_taken_away_leaves_no_load() {
    let arm = ArmFile::avena();
    let (mut plant, mut rig) = held(&arm, 1.0, 3.0, 1.0, at(1.2), 4_000);
    teach(&mut plant, &mut rig);
    give(&mut plant, &mut rig, 3.0);
    let (way, _) = untouched(&mut plant, &mut rig, 2_000);
    assert!(way < 0.01, "{way} rad with the payload given");
    reload(&mut plant, &arm, 0.0);
    give(&mut plant, &mut rig, 0.0);
    plant.run(&mut rig, 1_500);
    let (way, speed) = untouched(&mut plant, &mut rig, 5_000);
    println!("{way} rad, {speed} rad/s");
    assert!(speed < 0.1, "{way} rad, {speed} rad/s");
}

/// The controller learns a payload in a pose in which its full load acts on a joint. In the upright pose, in which
/// the payload causes no load, the host then configures this payload. Teaching must not use its weight twice.
#[test]
fn j25_j60_a_payload_given_at_another_pose_is_carried_once() {
    let (mut plant, mut rig) = held(&ArmFile::avena(), 1.0, 3.0, 1.0, at(1.3), 4_000);
    teach(&mut plant, &mut rig);
    lead(&mut plant, &mut rig, 1, -1.3, 0.3);
    give(&mut plant, &mut rig, 3.0);
    plant.run(&mut rig, 1_000);
    lead(&mut plant, &mut rig, 1, 1.3, 0.3);
    plant.run(&mut rig, 500);
    let (way, speed) = untouched(&mut plant, &mut rig, 3_000);
    println!("{way} rad, {speed} rad/s");
    assert!(speed < 0.1, "{way} rad, {speed} rad/s");
}

/// A hand moves the arm over most of its range. The unknown payload causes another torque in each pose, but it must
/// not drive the arm.
#[test]
fn j25_an_unknown_payload_that_is_led_far_does_not_drive_the_arm() {
    for (mass, from, way, speed) in [
        (3.0, 1.3, -1.3, 0.2),
        (3.0, 1.3, -1.3, 0.35),
        (3.0, 1.3, -1.3, 0.8),
        (3.0, 1.3, -2.6, 0.4),
        (2.0, 1.3, -2.8, 0.3),
        (3.0, 0.8, 0.7, 0.3),
        (3.0, -1.3, 1.3, 0.5),
    ] {
        for friction in [0.7, 1.3] {
            let (mut plant, mut rig) = held(&ArmFile::avena(), 1.0, mass, friction, at(from), 4_000);
            teach(&mut plant, &mut rig);
            lead(&mut plant, &mut rig, 1, way, speed);
            let first = highest_speed(&mut plant, &mut rig, 2_000);
            let (far, after) = untouched(&mut plant, &mut rig, 8_000);
            println!(
                "{mass} kg from {from} by {way} at {speed}, friction {friction}: {first} rad/s, then {far} rad, {after} rad/s"
            );
            assert!(first < 0.6 && after < 0.1, "{first}, {after} rad/s");
        }
    }
}

/// A joint lowers a load that it cannot hold (J-70). The load that the controller learns meanwhile also contains the
/// torque that has damped the joint. When the load is then removed in Teaching, no joint may leave its position
/// range.
#[test]
fn j25_j70_a_load_that_was_lowered_and_is_taken_away_drives_no_joint_out_of_its_range() {
    let arm = ArmFile::avena();
    let (mut taught, mut lowered) = (0, 0);
    for (mass, q2) in [(4.0, 1.2), (6.0, 0.6), (6.0, -1.2), (8.0, -0.5), (9.0, 0.3), (12.0, 0.2)] {
        for friction in [0.3, 0.7, 1.3] {
            let (mut plant, mut rig) = held(&arm, 1.0, 0.0, friction, at(q2), 1_500);
            reload(&mut plant, &arm, mass);
            plant.run(&mut rig, 6_000);
            rig.send(FrameType::TeachingModeEnable, &[]);
            for _ in 0..10_000 {
                plant.tick(&mut rig);
                if rig.state() == ControllerState::Teaching {
                    break;
                }
            }
            let about = format!("{mass} kg at {q2}, friction {friction}, now at {}", plant.q[1]);
            if rig.state() != ControllerState::Teaching {
                println!("{about}: {:?}", rig.state());
                continue;
            }
            plant.run(&mut rig, 50);
            let side = plant.q[1].signum();
            let load = rig.controller.telemetry().joints[1].torque_other;
            reload(&mut plant, &arm, 0.0);
            let (mut speed, mut other) = (0.0_f64, 0.0_f64);
            for _ in 0..20_000 {
                plant.tick(&mut rig);
                speed = speed.max(fastest(&plant));
                other = other.max(-plant.q[1] * side);
            }
            let last = highest_speed(&mut plant, &mut rig, 1_000);
            println!(
                "{about}, {load} N·m: {speed} rad/s, to {other} rad on the other side, at last {last} rad/s"
            );
            assert!(
                speed < 0.6 && other < 1.56 && last < 0.1,
                "{about}: {speed} rad/s, {other} rad, {last} rad/s"
            );
            taught += 1;
            lowered += usize::from(load.abs() > 55.0);
        }
    }
    println!("{taught} taught, {lowered} with a load that was lowered");
    assert!(taught >= 10 && lowered >= 3, "{taught}, {lowered}");
}

/// Arms whose rotors have less inertia than proposed do not swing. This also applies to the springs near the position
/// limits (soft ends), and above the tool speed limit.
#[test]
fn j25_an_arm_with_light_rotors_does_not_swing() {
    let mut ended = 0;
    for (arm, rotors) in arms().into_iter().flat_map(|arm| [0.2, 0.33, 1.0, 2.0].map(|r| (arm.clone(), r))) {
        let slow = ArmFile {
            config: jtc_core::Config { tool_speed_max: 0.05, ..arm.config.clone() },
            ..arm.clone()
        };
        for joint in 0..6 {
            let (low, high) = arm.config.position_range(joint);
            let mut q = pose(&arm);
            q[joint] = if joint % 2 == 0 { high - 0.15 } else { low + 0.15 };
            let outward = if joint % 2 == 0 { 1.0 } else { -1.0 };
            let (mut plant, mut rig) = held(&slow, 1.0, 0.0, 1.0, q, 1_500);
            teach(&mut plant, &mut rig);
            plant.rotor = arm.config.joints.map(|j| rotors * j.rotor_inertia);
            let (mut back, mut most) = (0.0_f64, 0.0_f64);
            for _ in 0..500 {
                plant.push[joint] = 0.12 * arm.config.joints[joint].torque_max * outward;
                plant.tick(&mut rig);
                back = back.max(-plant.v[joint] * outward);
                most = most.max(fastest(&plant));
            }
            plant.push = [0.0; 6];
            let about = format!("{} rotors {rotors} joint {}", arm.name, joint + 1);
            assert!(back < 0.4 && most < 1.8, "{about}: {back} rad/s against the hand, {most} rad/s");
            if rig.state() == ControllerState::HoldPos {
                // The joint was too fast for the damping, so Teaching has ended, and the position controller holds
                // the joint. Its gains are made for five times this rotor inertia, so this test does not evaluate the
                // hold.
                assert!(rotors < 0.5, "{about} is held");
                ended += 1;
                continue;
            }
            assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0), "{about}");
            plant.run(&mut rig, 1_500);
            let from = plant.q;
            plant.run(&mut rig, 2_000);
            println!(
                "{about}: {most} rad/s, {back} rad/s back, then {} rad, {} rad/s",
                farthest(&plant, &from),
                fastest(&plant)
            );
            assert!(fastest(&plant) < 0.1, "{about}: {} rad/s", fastest(&plant));
        }
    }
    assert!(ended <= 4, "{ended} of 144 ended Teaching");
}

/// A hand lifts a payload that is not configured, and knocks against the arm. Teaching must still hold the payload
/// afterwards.
#[test]
fn j25_a_payload_that_is_lifted_is_still_carried() {
    for (arm, mass, joint, way) in [
        (ArmFile::avena(), 3.0, 1, 0.5_f64),
        (ArmFile::z1(), 1.0, 1, 0.5),
        (ArmFile::z1(), 1.0, 2, 0.5),
        (ArmFile::ur5(), 2.0, 1, 0.5),
    ] {
        let unit = Dynamics::new(&arm.model, arm.config.gravity).flange_torque(&pose(&arm));
        // The hand moves the arm against gravity.
        let way = if unit[joint] > 0.0 { way } else { -way };
        for speed in [0.15, 0.25, 0.4, 0.8] {
            let (mut plant, mut rig) = held(&arm, 1.0, mass, 1.0, pose(&arm), 4_000);
            teach(&mut plant, &mut rig);
            lead(&mut plant, &mut rig, joint, way, speed);
            // The knock against the arm lasts 20 ms.
            for _ in 0..20 {
                plant.push[joint] = 0.5 * arm.config.joints[joint].torque_max * way.signum();
                plant.tick(&mut rig);
            }
            plant.push = [0.0; 6];
            plant.run(&mut rig, 1_000);
            let (far, after) = untouched(&mut plant, &mut rig, 3_000);
            println!("{} joint {} {mass} kg at {speed} rad/s: {far} rad, {after} rad/s", arm.name, joint + 1);
            assert!(after < 0.1, "{far} rad, {after} rad/s");
        }
    }
}

/// The host configures a small payload in HoldPos. The controller must learn the remaining load before Teaching begins.
#[test]
fn j25_j60_teaching_waits_until_a_load_is_found_again() {
    let (mut plant, mut rig) = held(&ArmFile::avena(), 1.0, 3.0, 1.0, at(1.2), 4_000);
    give(&mut plant, &mut rig, 0.1);
    teach(&mut plant, &mut rig);
    let (way, speed) = untouched(&mut plant, &mut rig, 5_000);
    println!("{way} rad, {speed} rad/s");
    assert!(way < 0.01 && speed < 0.05, "{way} rad, {speed} rad/s");
}

/// The arm file specifies friction, but the simulated arm has no friction. Teaching must damp the arm nevertheless.
#[test]
fn j25_friction_that_is_not_there_leaves_an_arm_damped() {
    for arm in [ArmFile::avena(), ArmFile::z1(), ArmFile::rough_ur5()] {
        let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_000);
        plant.friction = [LuGre::NONE; 6];
        plant.run(&mut rig, 2_000);
        teach(&mut plant, &mut rig);
        let (way, speed) = untouched(&mut plant, &mut rig, 10_000);
        assert!(plant.q.iter().all(|q| q.is_finite()));
        println!("{} untouched: {way} rad, {speed} rad/s", arm.name);
        assert!(way < 0.05 && speed < 0.1, "{}: {way} rad, {speed} rad/s", arm.name);
        let mut random = Random(7);
        for _ in 0..300 {
            plant.push = arm.config.joints.map(|joint| random.between(-0.1, 0.1) * joint.torque_max);
            plant.tick(&mut rig);
        }
        let from = plant.q;
        plant.push = [0.0; 6];
        plant.run(&mut rig, 1_000);
        let (way, speed) = (farthest(&plant, &from), fastest(&plant));
        println!("{} pushed: {way} rad, {speed} rad/s", arm.name);
        assert!(speed < 0.05, "{}: {way} rad, {speed} rad/s", arm.name);
    }
}

/// While the arm comes to rest after hand guiding, the controller must refuse the next motion and new gains.
#[test]
fn j25_nothing_is_executed_before_an_arm_that_was_led_is_at_rest() {
    let arm = ArmFile::avena();
    let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
    teach(&mut plant, &mut rig);
    plant.push[0] = 60.0;
    plant.run(&mut rig, 400);
    plant.push = [0.0; 6];
    rig.send(FrameType::TeachingModeDisable, &[]);
    plant.run(&mut rig, 10);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    let defaults = rig.ask(FrameType::PidParamUseDefault, &[]);
    assert_eq!(defaults, DataStatus::NotAllowed);
    let at = plant.q.map(|q| raw(q, 3.141592));
    rig.upload(&[jtc_wire::RawPoint { position: at, ..rest(0) }; 3], 50);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    plant.run(&mut rig, 1_500);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    assert_eq!(rig.ask(FrameType::PidParamUseDefault, &[]), DataStatus::NoError);
}

/// A hand moves an arm from any pose to any other pose, with any payload up to 3 kg that is not configured. When the
/// hand lets go, the arm stays or creeps.
#[test]
fn j25_unknown_payloads_that_are_led_anywhere_stay_or_creep() {
    println!("seed 11");
    let mut random = Random(11);
    let (mut most, mut worst) = (0.0_f64, 0.0_f64);
    for arm in [ArmFile::avena(), ArmFile::ur5(), ArmFile::rough_ur5(), ArmFile::z1()] {
        for trial in 0..24 {
            let mass = random.between(0.0, if arm.name == "z1" { 1.0 } else { 3.0 });
            let (masses, friction) = (random.between(0.9, 1.1), random.between(0.7, 1.3));
            let from = pose(&arm).map(|q| q + random.between(-0.3, 0.3));
            let to: [f64; 6] = std::array::from_fn(|j| {
                let (low, high) = arm.config.position_range(j);
                (from[j] + random.between(-1.0, 1.0)).clamp(low + 0.1, high - 0.1)
            });
            let (mut plant, mut rig) = held(&arm, masses, mass, friction, from, 4_000);
            teach(&mut plant, &mut rig);
            let ms = random.between(1_500.0, 6_000.0);
            for k in 0..ms as usize + 500 {
                let u = f64::min(k as f64 / ms, 1.0);
                for j in 0..6 {
                    let limit = arm.config.joints[j].torque_max;
                    let aim = from[j] + (to[j] - from[j]) * u * u * (3.0 - 2.0 * u);
                    plant.push[j] = 10.0 * limit * (aim - plant.q[j]) - limit * plant.v[j];
                }
                plant.tick(&mut rig);
            }
            plant.push = [0.0; 6];
            let first = highest_speed(&mut plant, &mut rig, 1_000);
            let (way, after) = untouched(&mut plant, &mut rig, 5_000);
            println!(
                "{} trial {trial} {mass} kg, masses {masses}, friction {friction}, {ms} ms: {first} rad/s, then {way} rad, {after} rad/s",
                arm.name
            );
            (most, worst) = (most.max(first), worst.max(after));
        }
    }
    println!("{most} rad/s, then {worst} rad/s");
    assert!(most < 0.6 && worst < 0.2, "{most} rad/s, then {worst} rad/s");
}

/// A person leans on an arm whose rotors have a fifth of the proposed inertia. The contact lasts so long that the
/// controller learns it as a load. When the person lets go, no joint reaches its over-speed.
#[test]
fn j25_a_lean_on_an_arm_with_light_rotors_drives_no_joint_to_over_speed() {
    println!("seed 13");
    let (mut random, mut most) = (Random(13), 0.0_f64);
    for (arm, rotors) in [ArmFile::ur5(), ArmFile::z1(), ArmFile::z1().slick()]
        .into_iter()
        .flat_map(|a| [(a.clone(), 0.2), (a, 0.33)])
    {
        for trial in 0..6 {
            let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
            plant.push = arm.config.joints.map(|joint| random.between(-0.29, 0.29) * joint.torque_max);
            plant.run(&mut rig, 12_000);
            if rig.errors() != 0 {
                // The controller detects this contact as a push, and the joints yield to it.
                continue;
            }
            teach(&mut plant, &mut rig);
            plant.run(&mut rig, 50);
            plant.rotor = plant.rotor.map(|rotor| rotors * rotor);
            plant.push = [0.0; 6];
            let speed = highest_speed(&mut plant, &mut rig, 4_000);
            let after = highest_speed(&mut plant, &mut rig, 1_000);
            println!("{} rotors {rotors} trial {trial}: {speed} rad/s, then {after}", arm.name);
            most = most.max(speed);
        }
    }
    println!("{most} rad/s");
    assert!((0.3..1.5).contains(&most), "{most} rad/s");
}

/// Teaching does not hold a load that the controller has not learned. A payload that is hung on the arm in Teaching
/// therefore sinks slowly.
#[test]
fn j25_a_payload_that_is_hung_on_in_teaching_sinks_slowly() {
    let arm = ArmFile::avena();
    let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 0.3, at(0.9), 2_000);
    teach(&mut plant, &mut rig);
    reload(&mut plant, &arm, 4.0);
    let from = plant.q;
    let speed = highest_speed(&mut plant, &mut rig, 3_000);
    let way = farthest(&plant, &from);
    println!("{way} rad, {speed} rad/s");
    assert!(way > 0.3 && speed < 0.6, "{way} rad, {speed} rad/s");
}

/// In Teaching, the load torque must be equal to the whole learned load while the arm is at rest.
#[test]
fn j25_the_load_that_was_found_is_carried() {
    let arm = ArmFile::avena();
    for mass in [1.0, 2.0, 3.0] {
        let (mut plant, mut rig) = held(&arm, 1.0, mass, 1.0, at(1.2), 4_000);
        let found = rig.controller.telemetry().joints[1].torque_i;
        teach(&mut plant, &mut rig);
        plant.run(&mut rig, 1_000);
        let carried = rig.controller.telemetry().joints[1].torque_other;
        assert!(found.abs() > 6.0 * mass && (carried - found).abs() < 3.0, "{found} N·m, {carried} N·m");
    }
}

/// In Teaching, a payload that is not configured is taken off the arm. The learned load then moves the arm slowly
/// upwards, until the controller detects that only this load drives the arm.
#[test]
fn j25_an_arm_whose_payload_is_put_down_rises_slowly_and_stops() {
    for (mass, friction) in [1.0, 3.0].into_iter().flat_map(|m| [0.7, 1.0, 1.3].map(|f| (m, f))) {
        let arm = ArmFile::avena();
        let (mut plant, mut rig) = held(&arm, 1.0, mass, friction, at(1.2), 4_000);
        teach(&mut plant, &mut rig);
        reload(&mut plant, &arm, 0.0);
        let from = plant.q;
        let speed = highest_speed(&mut plant, &mut rig, 8_000);
        let last = highest_speed(&mut plant, &mut rig, 1_000);
        let way = farthest(&plant, &from);
        println!("{mass} kg, friction {friction}: {way} rad, {speed} rad/s, after 8 s {last} rad/s");
        assert!(
            speed < 0.4 && way < 1.6 && last < 0.1,
            "{mass} kg, friction {friction}: {way} rad, {speed}, {last} rad/s"
        );
    }
}
