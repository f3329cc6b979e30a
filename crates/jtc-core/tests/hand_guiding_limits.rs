//! Tests of the limits of hand guiding (J-25): joints that a hand moves too fast, lost answers, lifted loads, and clamps.
use jtc_core::{Config, ControllerState};
use jtc_dynamics::Dynamics;
use jtc_wire::{FrameType, StopKind};

use crate::hand_guiding::{arms, farthest, fastest, held, highest_speed, pose, teach};
use crate::hand_guiding_loads::lead;
use crate::plant::{ArmFile, Plant};
use crate::rig::Rig;

/// Result of a test in which a joint was pushed.
struct Pushed {
    state: ControllerState,
    fastest: f64,
    /// Speed of the pushed joint when Teaching ended, rad/s.
    ended_at: f64,
}

fn pushed(plant: &mut Plant, rig: &mut Rig, joint: usize, torque: f64, ms: usize) -> Pushed {
    let (mut most, mut ended_at) = (0.0_f64, 0.0);
    for k in 0..ms + 2_000 {
        plant.push[joint] = if k < ms { torque } else { 0.0 };
        plant.tick(rig);
        most = most.max(fastest(plant));
        if ended_at == 0.0 && rig.state() != ControllerState::Teaching {
            ended_at = plant.v[joint];
        }
    }
    Pushed { state: rig.state(), fastest: most, ended_at }
}

/// A hand pushes any joint with up to a quarter of the torque limit for a second. The damping uses delayed speeds, so
/// it cannot stop a joint with little inertia before this joint reaches its over-speed. Therefore Teaching ends
/// earlier, and the position controller stops the joint.
#[test]
fn j25_a_joint_that_is_led_too_fast_is_held_and_not_released() {
    let (mut ended, mut most) = (0, 0.0_f64);
    for arm in arms() {
        for (joint, share) in (0..6).flat_map(|j| [0.15, -0.25].map(|share| (j, share))) {
            let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
            teach(&mut plant, &mut rig);
            let torque = share * arm.config.joints[joint].torque_max;
            let came = pushed(&mut plant, &mut rig, joint, torque, 1_000);
            let about = format!("{} joint {} {torque} N·m", arm.name, joint + 1);
            println!("{about}: {:?}, {} rad/s", came.state, came.fastest);
            assert!(fastest(&plant) < 0.05, "{about}: still {} rad/s", fastest(&plant));
            most = most.max(came.fastest);
            if came.state == ControllerState::Teaching {
                assert!(came.fastest < 1.45, "{about}: {} rad/s", came.fastest);
                continue;
            }
            ended += 1;
            assert_eq!(came.state, ControllerState::HoldPos, "{about}");
            let cause = rig.controller.reactions().stop.expect("a cause").0;
            assert_eq!((cause.kind, usize::from(cause.joint)), (StopKind::Shove, joint + 1), "{about}");
            assert!(cause.limit > 1.3 && cause.value.abs() > cause.limit, "{about}: {cause:?}");
            assert!(came.ended_at.abs() < 2.0, "{about}: {}", came.ended_at);
        }
    }
    println!("{ended} ended Teaching, {most} rad/s");
    assert!(ended >= 4, "{ended}");
}

/// If a hand continues to push a held arm, the controller learns the push as a load. When the hand lets go, the
/// learned load may move the joint only slowly and over a small distance, and must then fade.
#[test]
fn j68_a_load_that_was_a_hand_does_not_drive_a_joint_for_long() {
    for (arm, joint, share) in [
        (ArmFile::z1(), 5, -0.25),
        (ArmFile::z1().slick(), 4, 0.25),
        (ArmFile::ur5(), 5, 0.2),
        (ArmFile::avena(), 1, 0.27),
        (ArmFile::avena().slick(), 1, 0.25),
        (ArmFile::avena().slick(), 2, -0.28),
    ] {
        let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
        teach(&mut plant, &mut rig);
        let torque = share * arm.config.joints[joint].torque_max;
        plant.push[joint] = torque;
        plant.run(&mut rig, 1_000);
        rig.send(FrameType::TeachingModeDisable, &[]);
        plant.run(&mut rig, 3_000);
        let from = plant.q[joint];
        plant.push[joint] = 0.0;
        plant.run(&mut rig, 4_000);
        let (way, about) =
            ((plant.q[joint] - from).abs(), format!("{} joint {} {torque} N·m", arm.name, joint + 1));
        println!("{about}: {way} rad, then {} rad/s", plant.v[joint]);
        assert_eq!(
            (rig.state(), rig.controller.reactions().yields),
            (ControllerState::HoldPos, 0),
            "{about}"
        );
        assert!(way < 0.5 && fastest(&plant) < 0.005, "{about}: {way} rad, {} rad/s", fastest(&plant));
    }
}

/// The answers of a joint are lost while a hand moves the joint. First the torque of the springs fades, and then the
/// damping and the friction compensation, because the last known speed is too old. The torque must have no step.
#[test]
fn j25_the_torque_of_a_joint_that_does_not_answer_fades() {
    let base = ArmFile::avena();
    let arm = ArmFile { config: Config { missed_moves_max: 40, ..base.config.clone() }, ..base };
    let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
    teach(&mut plant, &mut rig);
    plant.push[1] = 60.0;
    plant.run(&mut rig, 600);
    let of = |rig: &Rig| {
        let joint = rig.controller.telemetry().joints[1];
        (joint.torque_other, joint.torque_friction)
    };
    let (damped, friction) = of(&rig);
    assert!(damped < -20.0 && friction > 1.0, "{damped} N·m, {friction} N·m");
    let (mut last, mut step) = (damped, 0.0_f64);
    for missing in 1..=34 {
        if missing <= 20 {
            rig.drop_answers(1);
        }
        plant.tick(&mut rig);
        let (now, friction) = of(&rig);
        step = step.max((now - last).abs());
        last = now;
        if missing == 7 {
            assert!(now < -0.6 * damped.abs(), "still damped: {now} N·m");
        }
        if (16..=20).contains(&missing) {
            assert!(now.abs() < 0.5 && friction.abs() < 0.01, "{missing}: {now} N·m, {friction} N·m");
        }
    }
    println!("{damped} N·m, by {step} N·m a tick, and back to {last} N·m");
    assert!(step < 0.45 * damped.abs() && last < -0.6 * damped.abs(), "{step} N·m, {last} N·m");
}

/// A hand repeatedly lifts a payload that is not configured. At these speeds, the learned load alone would also lift
/// an arm without the payload. Teaching must still hold the payload afterwards.
#[test]
fn j25_a_payload_that_is_lifted_slowly_is_still_carried() {
    let arm = ArmFile::avena();
    let mut least = 1.0_f64;
    for (speed, friction) in [0.12, 0.2, 0.3, 0.5].into_iter().flat_map(|v| [(v, 0.3), (v, 1.0)]) {
        let (mut plant, mut rig) = held(&arm, 1.0, 3.0, friction, [0.0, 1.3, 0.0, 0.0, 0.0, 0.0], 4_000);
        teach(&mut plant, &mut rig);
        for way in [-0.7, 0.7, -0.7] {
            lead(&mut plant, &mut rig, 1, way, speed);
        }
        plant.run(&mut rig, 1_500);
        let unit = Dynamics::new(&arm.model, arm.config.gravity).flange_torque(&plant.q)[1];
        let share = rig.controller.telemetry().joints[1].torque_other / (3.0 * unit);
        let from = plant.q;
        plant.run(&mut rig, 3_000);
        let way = farthest(&plant, &from);
        println!(
            "{speed} rad/s, friction {friction}: {share} of it, then {way} rad, {} rad/s",
            fastest(&plant)
        );
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
        assert!(fastest(&plant) < 0.1, "{speed} rad/s, friction {friction}: {}", fastest(&plant));
        least = least.min(share);
    }
    assert!(least > 0.5, "{least} of the payload is left");
}

/// A clamp holds a joint away from its commanded position, with up to a quarter of the torque limit of the joint. The
/// controller has learned a part of this torque as a load, and Teaching begins with this part. The learned torque
/// fades when the clamp is opened and a hand moves the joint away.
#[test]
fn j25_a_clamp_is_carried_as_a_load_and_goes_when_the_arm_is_led() {
    for (arm, joint, share) in
        [(ArmFile::avena(), 1, 0.25), (ArmFile::avena(), 2, -0.1), (ArmFile::ur5(), 2, 0.2)]
    {
        let limit = arm.config.joints[joint].torque_max;
        let (mut plant, mut rig) = held(&arm, 1.0, 0.0, 1.0, pose(&arm), 1_500);
        // A spring of 3,000 N·m/rad acts on the joint. The displacement of this spring causes the torque of the clamp.
        let end = plant.q[joint] + share * limit / 3_000.0;
        let clamp = |plant: &mut Plant| plant.push[joint] = 3_000.0 * (end - plant.q[joint]);
        for _ in 0..14_000 {
            clamp(&mut plant);
            plant.tick(&mut rig);
        }
        rig.send(FrameType::TeachingModeEnable, &[]);
        let mut most = 0.0_f64;
        for _ in 0..3_000 {
            clamp(&mut plant);
            plant.tick(&mut rig);
            most = most.max(plant.push[joint].abs());
        }
        let about = format!("{} joint {} {share} of the limit", arm.name, joint + 1);
        // With weak gains, the controller may have detected the clamp as a push before. Teaching must begin
        // nevertheless.
        assert_eq!(rig.state(), ControllerState::Teaching, "{about}");
        assert!(most <= (share.abs() + 0.06) * limit, "{about}: {most} N·m");
        // The clamp is opened, and a hand moves the joint away from the clamp by half a radian.
        let to = plant.q[joint] - 0.5 * share.signum();
        plant.push[joint] = 0.0;
        for k in 0..3_000 {
            let aim = to + 0.5 * share.signum() * (1.0 - f64::min(f64::from(k) / 2_000.0, 1.0));
            plant.push[joint] = 3_000.0 * (aim - plant.q[joint]) - 100.0 * plant.v[joint];
            plant.tick(&mut rig);
        }
        plant.push[joint] = 0.0;
        let from = plant.q;
        let fast = highest_speed(&mut plant, &mut rig, 6_000);
        println!(
            "{about}: {most} N·m; led away: {} rad, {fast} rad/s, at last {}",
            farthest(&plant, &from),
            fastest(&plant)
        );
        assert!(fast < 0.4 && fastest(&plant) < 0.1, "{about}: {fast} rad/s, at last {}", fastest(&plant));
    }
}

/// The arm hits a person while it comes to rest after Teaching. After the impact, the joint presses against the
/// person with at most the configured share of its torque limit.
#[test]
fn j25_an_arm_that_comes_to_rest_does_not_clamp_whom_it_meets() {
    for (arm, joint, way, payload) in [
        (ArmFile::avena(), 1, 1.0, 0.0),
        (ArmFile::avena(), 1, 1.0, 3.0),
        (ArmFile::avena(), 1, -1.0, 3.0),
        (ArmFile::avena(), 0, 1.0, 0.0),
        (ArmFile::avena(), 2, 1.0, 0.0),
        (ArmFile::ur5(), 2, 1.0, 0.0),
        (ArmFile::z1(), 3, 1.0, 0.0),
    ] {
        let limit = arm.config.joints[joint].torque_max;
        let (mut plant, mut rig) = held(&arm, 1.0, payload, 1.0, pose(&arm), 4_000);
        teach(&mut plant, &mut rig);
        plant.push[joint] = 0.8 * limit * way;
        for _ in 0..1_000 {
            plant.tick(&mut rig);
            if plant.v[joint] * way > 1.2 {
                break;
            }
        }
        plant.push[joint] = 0.0;
        rig.send(FrameType::TeachingModeDisable, &[]);
        plant.tick(&mut rig);
        // The simulated body has a stiffness of 5,000 N·m/rad. `touched_ms` is the time since the first contact.
        let (wall, speed) = (plant.q[joint] + 0.02 * way, plant.v[joint]);
        let (mut touched_ms, mut blow, mut most) = (0, 0.0_f64, 0.0_f64);
        for _ in 0..2_000 {
            let inside = ((plant.q[joint] - wall) * way).max(0.0);
            plant.push[joint] =
                if inside > 0.0 { -5_000.0 * inside * way - 20.0 * plant.v[joint] } else { 0.0 };
            plant.tick(&mut rig);
            touched_ms += usize::from(touched_ms > 0 || inside > 0.0);
            let pressed = -plant.push[joint] * way;
            blow = blow.max(pressed);
            most = if touched_ms > 250 { most.max(pressed) } else { most };
        }
        let about = format!("{} joint {}, {payload} kg: {speed} rad/s", arm.name, joint + 1);
        println!("{about}: {blow} N·m, after 250 ms {most} of {limit} N·m, touched for {touched_ms} ms");
        assert_eq!(rig.state(), ControllerState::HoldPos, "{about}");
        assert!(touched_ms > 1_000 && most < 0.42 * limit, "{about}: {most} N·m");
    }
}
