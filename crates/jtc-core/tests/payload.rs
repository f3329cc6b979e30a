//! Tests of a payload that the host sets (J-60): its blend into the torque, the states that accept it, and how long it remains set.
use crate::{plant, rig};

use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, Parameters, Payload, TrajectoryState, settings};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, ExecCommand, FrameType};
use plant::{LuGre, POSES, Plant, loaded};
use proptest::prelude::*;
use rig::{Rig, floats, model_body, pieces};

/// Time over which a payload is blended into the model, ms.
const BLEND: usize = 500;

fn point_mass(mass: f64) -> Payload {
    Payload { mass, ..Payload::NONE }
}

fn set(rig: &mut Rig, payload: &Payload) -> DataStatus {
    let body: Vec<u8> = settings::payload_values(payload).flat_map(|value| value.emit()).collect();
    rig.ask(FrameType::SetSettings, &body)
}

/// Returns a rig without physics whose arm is held at `pose`. The joints are at their commanded positions.
fn holding_at(pose: &[f64; 6]) -> Rig {
    let mut rig = Rig::new(Config::avena());
    for (node, q) in rig.nodes.iter_mut().zip(pose) {
        node.report.position = *q;
    }
    rig.follow = false;
    rig.defaults();
    rig.run(700);
    assert_eq!(rig.state(), ControllerState::HoldPos, "{:?}", rig.controller.telemetry());
    rig
}

fn torques(rig: &Rig) -> [f64; 6] {
    rig.controller.telemetry().joints.map(|joint| joint.torque)
}

fn gravity(payload: &Payload, q: &[f64; 6]) -> [f64; 6] {
    Dynamics::with_payload(&Parameters::avena().model, Config::avena().gravity, payload).gravity_torque(q)
}

/// Returns payloads that are cubes at random positions.
fn cubes() -> impl Strategy<Value = Payload> {
    (0.0..2.5f64, prop::array::uniform3(-0.1..0.1f64), 0.0..0.1f64).prop_map(|(mass, com, side)| {
        let i = mass * side * side / 6.0;
        Payload { mass, com, inertia: [i, 0.0, 0.0, i, 0.0, i] }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(40) })]

    /// The test sets any sequence of payloads in HoldPos and in Teaching, also while an earlier payload is being blended in. In a tick, the
    /// torque changes by at most 1/500 of the requested change. At the end, the joints hold the payload.
    #[test]
    fn j60_a_payload_makes_no_step_in_torque(
        q in prop::array::uniform6(-1.2..1.2f64), list in prop::collection::vec((cubes(), 1..700usize), 1..4), taught: bool,
    ) {
        let mut rig = holding_at(&q);
        let q = rig.controller.telemetry().joints.map(|joint| joint.position);
        if taught {
            rig.send(FrameType::TeachingModeEnable, &[]);
            rig.until(450, |r| r.state() == ControllerState::Teaching);
            rig.run(200);
        }
        let mut last = torques(&rig);
        let base: [f64; 6] = core::array::from_fn(|j| last[j] - gravity(&Payload::NONE, &q)[j]);
        for (payload, ticks) in &list {
            let target = gravity(payload, &q);
            let most: [f64; 6] = core::array::from_fn(|j| (target[j] + base[j] - last[j]).abs() / BLEND as f64 + 1e-6);
            let body: Vec<u8> = settings::payload_values(payload).flat_map(|value| value.emit()).collect();
            rig.send(FrameType::SetSettings, &body);
            for _ in 0..*ticks {
                rig.tick();
                let now = torques(&rig);
                for j in 0..6 {
                    prop_assert!((now[j] - last[j]).abs() <= most[j], "joint {}: {} to {} N·m", j + 1, last[j], now[j]);
                }
                last = now;
            }
        }
        rig.run(BLEND + 1);
        let target = gravity(&list[list.len() - 1].0, &q);
        for j in 0..6 {
            let now = torques(&rig)[j] - base[j];
            prop_assert!((now - target[j]).abs() < 1e-6, "joint {}: {now} instead of {} N·m", j + 1, target[j]);
        }
        prop_assert_eq!(rig.errors(), 0);
    }
}

/// When the host sets the payload that the arm carries, the torque of the load moves from the integral to the model.
/// The arm must not move.
#[test]
fn j60_a_payload_that_is_given_takes_the_load_from_the_integral() {
    for pose in POSES {
        let mut arm = Plant::new(&loaded(Parameters::avena().model, 2.0), LuGre::of_avena_times(0.3), pose);
        let mut rig = arm.holding(Config::avena());
        arm.run(&mut rig, 4_000);
        let missing = |rig: &Rig| {
            rig.controller
                .telemetry()
                .joints
                .map(|j| j.torque - j.torque_model)
                .iter()
                .fold(0.0, |a: f64, t| a.max(t.abs()))
        };
        let before = missing(&rig);
        // Friction holds a part of the load, so the integral contains only the rest.
        assert!(before > 4.0, "{before} N·m at {pose:?}");
        assert_eq!(set(&mut rig, &point_mass(2.0)), DataStatus::NoError);
        let from = arm.q;
        let mut way: f64 = 0.0;
        for _ in 0..3_000 {
            arm.tick(&mut rig);
            way = (0..6).map(|j| (arm.q[j] - from[j]).abs()).fold(way, f64::max);
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        assert!(way < 0.01, "{way} rad at {pose:?}");
        assert!(missing(&rig) < 0.5 * before, "{before} to {} N·m at {pose:?}", missing(&rig));
    }
}

/// Teaching uses the mass of a payload that the controller has estimated. When the host sets this payload, the arm
/// must stay balanced.
#[test]
fn j25_j60_a_payload_given_in_teaching_takes_the_place_of_the_one_that_was_found() {
    for pose in [POSES[0], POSES[2]] {
        let mut arm = Plant::new(&loaded(Parameters::avena().model, 2.0), LuGre::of_avena_times(0.3), pose);
        let mut rig = arm.holding(Config::avena());
        arm.run(&mut rig, 4_000);
        rig.send(FrameType::TeachingModeEnable, &[]);
        arm.run(&mut rig, 700);
        assert_eq!(rig.state(), ControllerState::Teaching);
        let carried = torques(&rig);
        let was_found = rig.controller.telemetry().joints.map(|joint| joint.torque_other);
        assert_eq!(set(&mut rig, &point_mass(2.0)), DataStatus::NoError);
        let from = arm.q;
        arm.run(&mut rig, 3_000);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
        // Friction causes an error of the learned load. At most a fifth of this load may therefore remain in addition
        // to the payload.
        let most = was_found.iter().fold(0.0, |most: f64, found| most.max(found.abs()));
        let telemetry = rig.controller.telemetry();
        for j in 0..6 {
            assert!((arm.q[j] - from[j]).abs() < 0.005, "joint {}: {} rad", j + 1, arm.q[j] - from[j]);
            assert!((torques(&rig)[j] - carried[j]).abs() < 4.0, "joint {}", j + 1);
            let found = telemetry.joints[j].torque_other;
            assert!(found.abs() < 0.2 * most, "joint {}: {found} of {most} N·m are carried twice", j + 1);
        }
    }
}

/// If the host sets a payload that is smaller than the learned load, Teaching must still hold the rest of the load.
/// The test sets several payloads in succession, up to half of the load.
#[test]
fn j25_j60_a_small_payload_given_in_teaching_drops_nothing() {
    for pose in [POSES[0], POSES[2]] {
        let mut arm = Plant::new(&loaded(Parameters::avena().model, 2.0), LuGre::of_avena_times(0.3), pose);
        let mut rig = arm.holding(Config::avena());
        arm.run(&mut rig, 4_000);
        taught(&mut arm, &mut rig);
        arm.run(&mut rig, 1_000);
        // The second payload arrives while the first payload is being blended in.
        for (mass, wait) in [(0.1, 1_000), (0.5, 200), (1.0, 3_000), (0.8, 3_000)] {
            let way = set_and_wait(&mut arm, &mut rig, &point_mass(mass), wait);
            assert!(way < 0.005 && rig.state() == ControllerState::Teaching, "{mass} kg: {way} rad");
        }
    }
}

#[test]
fn j60_teaching_waits_until_the_payload_is_in_the_model() {
    let mut rig = holding_at(&POSES[0]);
    assert_eq!(set(&mut rig, &point_mass(1.0)), DataStatus::NoError);
    rig.send(FrameType::TeachingModeEnable, &[]);
    // After the blend, Teaching waits another 3 s, until the integral has released the torque that it contained for
    // the payload.
    let waited = rig.until(4_000, |r| r.state() == ControllerState::Teaching);
    assert!((BLEND + 2_900..=BLEND + 3_100).contains(&waited), "{waited} ms");
}

/// After a Pause, the host sets a payload and then sends Execute. The path must wait for the end of the blend,
/// because the model must not change on a path.
#[test]
fn j60_an_execute_waits_until_the_payload_is_in_the_model() {
    let mut rig = Rig::holding();
    rig.upload(&pieces(2, &[(1.0, 30), (0.0, 100), (-1.0, 30)]), 10);
    for mass in [1.0, 2.0] {
        assert_eq!(set(&mut rig, &point_mass(mass)), DataStatus::NoError);
        let before = rig.controller.telemetry().point;
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        assert_eq!(set(&mut rig, &point_mass(9.0)), DataStatus::NotAllowed, "it is about to move");
        let waited = rig.until(2_000, |r| r.controller.telemetry().point > before + 100);
        assert!(waited > BLEND, "{waited} ms");
        assert_eq!(set(&mut rig, &Payload::NONE), DataStatus::NotAllowed, "it moves");
        assert_eq!(rig.controller.config().payload, point_mass(mass));
        assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
        rig.until(1_000, |r| r.trajectory() == TrajectoryState::Pause);
        rig.run(2);
    }
    assert_eq!(set(&mut rig, &Payload::NONE), DataStatus::NoError, "it stands");
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(6_000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j60_j58_joints_are_not_jogged_on_the_way_and_a_payload_is_not_set_while_they_are() {
    let mut rig = Rig::holding();
    let jog = floats([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
    assert_eq!(set(&mut rig, &point_mass(1.0)), DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::Jog, &jog), DataStatus::NotAllowed);
    rig.run(BLEND);
    assert_eq!(rig.ask(FrameType::Jog, &jog), DataStatus::NoError);
    assert_eq!(set(&mut rig, &point_mass(2.0)), DataStatus::NotAllowed);
    rig.run(1_000);
    assert_eq!(set(&mut rig, &point_mass(2.0)), DataStatus::NoError);
}

/// The controller must refuse a payload that a joint cannot hold in its present position, or that is not a valid body.
/// The controller must never apply a part of a refused payload.
#[test]
fn j60_a_payload_is_taken_whole_or_refused() {
    let mut rig = holding_at(&POSES[1]);
    let q = rig.controller.telemetry().joints.map(|joint| joint.position);
    let model = Parameters::avena().model;
    // `most` is the highest mass that the torque limits allow, kg, computed from the Jacobian of the flange alone.
    let dynamics = Dynamics::new(&model, Config::avena().gravity);
    let (arm, unit) = (dynamics.gravity_torque(&q), dynamics.flange_torque(&q));
    let most = (0..6)
        .map(|j| (Config::avena().joints[j].torque_max - arm[j] * unit[j].signum()) / unit[j].abs().max(1e-9))
        .fold(f64::INFINITY, f64::min);
    assert!((1.0..20.0).contains(&most), "{most} kg");
    let good = point_mass(0.999 * most);
    assert_eq!(set(&mut rig, &point_mass(1.001 * most)), DataStatus::IncorrectValue);
    assert_eq!(rig.controller.config().payload, Payload::NONE);
    assert_eq!(set(&mut rig, &good), DataStatus::NoError);
    for bad in [
        Payload { mass: -1.0, ..good },
        Payload { mass: f64::NAN, ..good },
        Payload { com: [0.0, 6.0, 0.0], ..good },
        Payload { mass: 0.0, inertia: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], ..good },
        Payload { inertia: [0.1, 0.0, 0.0, 0.1, 0.0, 0.3], ..good },
        Payload { inertia: [0.1, 0.2, 0.0, 0.1, 0.0, 0.1], ..good },
        Payload { mass: 51.0, ..good },
    ] {
        assert_eq!(set(&mut rig, &bad), DataStatus::IncorrectValue, "{bad:?}");
        assert_eq!(rig.controller.config().payload, good);
    }
    // While a payload is being blended out, its remaining part may be too heavy for the arm. The controller must
    // accept a further reduction of the payload.
    rig.run(BLEND);
    rig.send(FrameType::TeachingModeEnable, &[]);
    rig.until(4_000, |r| r.state() == ControllerState::Teaching);
    rig.push(2, 0.0);
    assert_eq!(set(&mut rig, &point_mass(0.99 * most)), DataStatus::NoError);
    assert_eq!(set(&mut rig, &Payload::NONE), DataStatus::NoError);
}

/// The payload must remain set after errors and new models. Without torque, a change of the payload takes effect at
/// once. The payload is not part of the arm.
#[test]
fn j60_the_payload_stays_through_errors_and_new_models() {
    let payload = point_mass(1.5);
    let mut rig = holding_at(&POSES[0]);
    let q = rig.controller.telemetry().joints.map(|joint| joint.position);
    let wanted = gravity(&payload, &q);
    let carried = |rig: &Rig| {
        rig.controller
            .telemetry()
            .joints
            .iter()
            .zip(wanted)
            .all(|(joint, w)| (joint.torque_model - w).abs() < 1e-6)
    };
    assert_eq!(set(&mut rig, &payload), DataStatus::NoError);
    rig.run(100);
    assert!(!carried(&rig));
    rig.press_stop(10);
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(set(&mut rig, &point_mass(2.5)), DataStatus::NoError, "also in Error");
    assert_eq!(set(&mut rig, &payload), DataStatus::NoError);
    rig.clear(true, 0x7F);
    rig.until(5_000, |r| r.nodes[..6].iter().all(|node| node.report.state == NodeState::ENABLED));
    rig.run(3);
    assert!(carried(&rig), "{:?}", rig.controller.telemetry());
    rig.run(1_500);
    let body = model_body(&Parameters::avena().model);
    assert_eq!(rig.ask(FrameType::ArmModel, &body), DataStatus::NoError);
    rig.run(300);
    let model = rig.controller.telemetry().joints.map(|joint| joint.torque_model);
    // The frame contains values with a precision of about six digits.
    assert!((0..6).all(|j| (model[j] - wanted[j]).abs() < 1e-3), "{model:?} {wanted:?}");
    assert_eq!(rig.controller.config().payload, payload);
    let arm = |config: &Config| settings::values(config, 0, true).collect::<Vec<_>>();
    let of_the_bench = Config { drive_speed_window_ms: 0, ..Config::avena() };
    assert_eq!(arm(rig.controller.config()), arm(&of_the_bench));
}

/// The controller must refuse a model if the torque limits cannot hold this model with the present payload. Without a
/// payload, it must also refuse a model that is too heavy.
#[test]
fn j06_j60_a_model_is_held_with_its_payload() {
    let mut rig = holding_at(&POSES[1]);
    assert_eq!(set(&mut rig, &point_mass(2.0)), DataStatus::NoError);
    rig.run(BLEND);
    let body = |mass: f64| model_body(&loaded(Parameters::avena().model, mass));
    let (mut low, mut high) = (0.0, 20.0);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        match rig.ask(FrameType::ArmModel, &body(middle)) {
            DataStatus::NoError => low = middle,
            _ => high = middle,
        }
    }
    assert_eq!(set(&mut rig, &Payload::NONE), DataStatus::NoError);
    rig.run(BLEND);
    assert_eq!(rig.ask(FrameType::ArmModel, &body(low + 1.99)), DataStatus::NoError);
    assert_eq!(rig.ask(FrameType::ArmModel, &body(low + 2.01)), DataStatus::IncorrectValue);
}

/// Returns the longest motion of a joint within `ms`, rad.
fn drift(arm: &mut Plant, rig: &mut Rig, ms: usize) -> f64 {
    let from = arm.q;
    let mut farthest = 0.0f64;
    for _ in 0..ms {
        arm.tick(rig);
        farthest = arm.q.iter().zip(from).map(|(q, from)| (q - from).abs()).fold(farthest, f64::max);
    }
    farthest
}

/// Sets a payload. Returns the longest motion of a joint within the following `ms`, rad.
fn set_and_wait(arm: &mut Plant, rig: &mut Rig, payload: &Payload, ms: usize) -> f64 {
    let body: Vec<u8> = settings::payload_values(payload).flat_map(|value| value.emit()).collect();
    rig.send(FrameType::SetSettings, &body);
    drift(arm, rig, ms)
}

fn taught(arm: &mut Plant, rig: &mut Rig) {
    rig.send(FrameType::TeachingModeEnable, &[]);
    for _ in 0..5_000 {
        if rig.state() == ControllerState::Teaching {
            return;
        }
        arm.tick(rig);
    }
    panic!("no Teaching: {:?}", rig.controller.telemetry());
}

/// The host sets the learned load as a payload, or sends it in a new model, just before Teaching. Teaching must not
/// use this load twice, so an arm that no hand moves must keep its position.
#[test]
fn j25_j60_an_arm_that_is_taught_right_after_its_load_was_given_stays() {
    for (mass, pose) in [(2.0, 0), (2.0, 1), (2.0, 2), (2.0, 3), (4.0, 0), (4.0, 3)] {
        for (friction, by_model, wait) in
            [(1.0, false, 0), (0.3, false, 0), (0.3, false, 600), (0.3, true, 0)]
        {
            if by_model && mass > 3.0 {
                continue;
            }
            let model = loaded(Parameters::avena().model, mass);
            let mut arm = Plant::new(&model, LuGre::of_avena_times(friction), POSES[pose]);
            let mut rig = arm.holding(Config::avena());
            arm.run(&mut rig, 4_000);
            if by_model {
                rig.send(FrameType::ArmModel, &model_body(&model));
            } else {
                let body: Vec<u8> =
                    settings::payload_values(&point_mass(mass)).flat_map(|v| v.emit()).collect();
                rig.send(FrameType::SetSettings, &body);
            }
            arm.run(&mut rig, 2 + wait);
            taught(&mut arm, &mut rig);
            let way = drift(&mut arm, &mut rig, 3_000);
            let state = rig.state();
            let case =
                format!("{mass} kg, pose {pose}, friction {friction}, by model {by_model}, after {wait} ms");
            assert!(way < 0.005 && state == ControllerState::Teaching, "{case}: {way} rad, {state:?}");
        }
    }
}

/// If the host sets a centre of mass but no mass, this is not a payload. This setting must not reduce the load that
/// Teaching holds.
#[test]
fn j60_no_payload_at_another_place_drops_nothing_in_teaching() {
    let mut arm = Plant::new(&loaded(Parameters::avena().model, 2.0), LuGre::of_avena_times(0.3), POSES[0]);
    let mut rig = arm.holding(Config::avena());
    arm.run(&mut rig, 4_000);
    taught(&mut arm, &mut rig);
    arm.run(&mut rig, 1_000);
    let nowhere = Payload { com: [0.1, 0.0, 0.0], ..Payload::NONE };
    let body: Vec<u8> = settings::payload_values(&nowhere).flat_map(|value| value.emit()).collect();
    rig.send(FrameType::SetSettings, &body);
    let way = drift(&mut arm, &mut rig, 2_000);
    assert!(way < 0.005, "{way} rad");
    assert_eq!(rig.controller.config().payload, nowhere, "it is taken");
}
