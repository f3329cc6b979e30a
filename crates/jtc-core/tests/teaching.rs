//! Tests of Teaching with an arm that is heavier or lighter than its model (J-25, J-44).
use crate::{plant, rig};

use jtc_core::{Config, ControllerState, Parameters};
use jtc_dynamics::{ArmModel, Dynamics};
use jtc_wire::FrameType;
use plant::{LuGre, POSES, Plant, heavier, loaded};
use rig::Rig;

/// Returns how far a hand moves the joints from a pose, rad. After this motion, no joint is so close to a position
/// limit that the spring at the limit (soft end) acts on it.
fn led(pose: &[f64; 6]) -> [f64; 6] {
    let second = if pose[1] > 1.0 { -0.3 } else { 0.3 };
    [0.1, second, -0.3, 0.2, 0.3, 0.3]
}

fn model() -> ArmModel {
    Parameters::avena().model
}

/// Holds the arm for 4 s, then begins Teaching. Checks that the torque has no step.
fn taught(arm: &mut Plant, config: Config) -> Rig {
    let mut rig = arm.holding(config);
    arm.run(&mut rig, 4000);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
    rig.send(FrameType::TeachingModeEnable, &[]);
    without_steps(arm, &mut rig, 200);
    assert_eq!(rig.state(), ControllerState::Teaching);
    rig
}

fn without_steps(arm: &mut Plant, rig: &mut Rig, ticks: usize) {
    let torque = |rig: &Rig| rig.controller.telemetry().joints.map(|j| j.torque);
    let mut last = torque(rig);
    for _ in 0..ticks {
        arm.tick(rig);
        let now = torque(rig);
        for j in 0..6 {
            // A toggle of the last bit of the encoder causes 2.3 N·m of P and D torque. The torque for the motion of
            // the arm is added to this value.
            assert!((now[j] - last[j]).abs() < 4.0, "joint {}: {} to {} N·m", j + 1, last[j], now[j]);
        }
        last = now;
    }
}

/// Returns the longest motion of a joint within `ms`, rad.
fn drift(arm: &mut Plant, rig: &mut Rig, ms: usize) -> f64 {
    let from = arm.q;
    arm.run(rig, ms);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
    (0..6).map(|j| (arm.q[j] - from[j]).abs()).fold(0.0, f64::max)
}

/// Simulates a hand that moves every joint by `way` rad in a second and then lets go.
fn lead(arm: &mut Plant, rig: &mut Rig, way: [f64; 6]) {
    let from = arm.q;
    for k in 0..1300 {
        let u = f64::min(f64::from(k) / 1000.0, 1.0);
        let s = u * u * (3.0 - 2.0 * u);
        for j in 0..6 {
            arm.push[j] = 3000.0 * (from[j] + way[j] * s - arm.q[j]) - 100.0 * arm.v[j];
        }
        arm.tick(rig);
    }
    arm.push = [0.0; 6];
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
}

#[test]
fn j25_an_unknown_payload_floats_where_it_is_and_where_it_is_led() {
    for factor in [1.0, 0.3] {
        for pose in POSES {
            let mut arm = Plant::new(&loaded(model(), 2.0), LuGre::of_avena_times(factor), pose);
            let mut rig = taught(&mut arm, Config::avena());
            let still = drift(&mut arm, &mut rig, 3000);
            // With a third of its friction, the arm creeps because of the part of the load that the integral has not learned.
            assert!(still < if factor == 1.0 { 0.002 } else { 0.1 * 3.0 }, "{still} rad at {pose:?}");
            lead(&mut arm, &mut rig, led(&pose));
            let led = drift(&mut arm, &mut rig, 3000);
            println!("friction {factor}: {led} rad after having been led from {pose:?}");
            assert!(led < 0.025, "{led} rad after having been led from {pose:?}");
        }
    }
}

/// The true masses of all links are wrong by a tenth, which no mass at the flange can explain. Friction holds the
/// remaining torque, so the arm must not drift.
#[test]
fn j25_masses_that_are_wrong_by_a_tenth_do_not_make_the_arm_drift() {
    for mass in [0.9, 1.1] {
        for pose in POSES {
            let mut arm = Plant::new(&heavier(model(), mass), LuGre::of_avena_times(1.0), pose);
            let mut rig = taught(&mut arm, Config::avena());
            let still = drift(&mut arm, &mut rig, 3000);
            lead(&mut arm, &mut rig, led(&pose));
            let led = drift(&mut arm, &mut rig, 3000);
            assert!(still < 0.002 && led < 0.005, "masses times {mass}: {still}, {led} rad from {pose:?}");
            // With a third of the modelled friction, the arm still stays at its first position. At other positions,
            // such an arm may creep.
            let mut arm = Plant::new(&heavier(model(), mass), LuGre::of_avena_times(0.3), pose);
            let mut rig = taught(&mut arm, Config::avena());
            let still = drift(&mut arm, &mut rig, 3000);
            assert!(still < 0.02, "masses times {mass}: {still} rad at {pose:?}");
        }
    }
}

#[test]
fn j25_teaching_is_left_without_a_step_and_without_sag() {
    for pose in POSES {
        let mut arm = Plant::new(&loaded(model(), 2.0), LuGre::of_avena_times(0.3), pose);
        let mut rig = taught(&mut arm, Config::avena());
        lead(&mut arm, &mut rig, led(&pose));
        arm.run(&mut rig, 1000);
        let from = arm.q;
        rig.send(FrameType::TeachingModeDisable, &[]);
        without_steps(&mut arm, &mut rig, 200);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        arm.run(&mut rig, 2000);
        for (j, q) in from.iter().enumerate() {
            let sag = (arm.q[j] - q).abs();
            assert!(sag < 0.002, "joint {} sags by {sag} rad at {pose:?}", j + 1);
        }
    }
}

/// Returns the highest speed of a joint after the end of a contact that HoldPos has learned as a load, rad/s. The contact is a load of
/// `mass` kg at the flange or, for 0 kg, a push on the joints. Returns `None` if Teaching waits until the contact has ended.
fn fastest_after_contact(pose: [f64; 6], factor: f64, mass: f64) -> Option<f64> {
    let mut arm = Plant::new(&model(), LuGre::of_avena_times(factor), pose);
    // With this setting, the controller learns a long contact as a load instead of detecting it as a push.
    let mut rig = arm.holding(Config { yield_torque_share: 0.8, ..Config::avena() });
    let unit = Dynamics::new(&model(), Config::avena().gravity).flange_torque(&pose);
    let push = if mass == 0.0 { [30.0, 0.0, 0.0, 5.0, 0.0, 0.0] } else { unit.map(|u| mass * u) };
    for k in 0..13_000 {
        arm.push = push.map(|p| p * f64::min(f64::from(k) / 500.0, 1.0));
        arm.tick(&mut rig);
    }
    rig.send(FrameType::TeachingModeEnable, &[]);
    arm.run(&mut rig, 150);
    if rig.state() != ControllerState::Teaching {
        return None;
    }
    arm.push = [0.0; 6];
    let mut fastest = 0.0f64;
    for _ in 0..3000 {
        arm.tick(&mut rig);
        fastest = arm.v.iter().fold(fastest, |fastest, v| fastest.max(v.abs()));
    }
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
    Some(fastest)
}

/// When Teaching begins, a person leans on the arm, or the arm lies on an object. When this contact ends, the learned
/// load drives the arm, but it may drive the arm only slowly.
#[test]
fn j25_a_contact_that_goes_does_not_make_the_arm_jump() {
    let (mut taught, mut reached) = (0, 0.0_f64);
    for factor in [1.0, 0.7, 0.3] {
        for (pose, mass) in POSES.into_iter().flat_map(|pose| [(pose, -3.0), (pose, 0.0), (pose, 4.0)]) {
            let fastest = fastest_after_contact(pose, factor, mass);
            println!("friction {factor}, {mass} kg: {fastest:?} rad/s");
            assert!(
                fastest.is_none_or(|fastest| fastest < 0.6),
                "{fastest:?} rad/s after {mass} kg at {pose:?}"
            );
            taught += usize::from(fastest.is_some());
            reached = reached.max(fastest.unwrap_or(0.0));
        }
    }
    // In at least 24 of the 36 cases, Teaching begins during the contact. In the other cases, Teaching waits until
    // the contact has ended, for example because joint 1 yields to a push of 30 N·m.
    assert!(taught >= 24, "{taught} of 36");
    assert!(reached > 0.3, "{reached} rad/s: nothing was learned");
}
