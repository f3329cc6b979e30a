//! Tests of the control law as a part of the controller (section 6), and of torque without steps.
use crate::rig;

use jtc_core::{Config, ControllerState, Parameters, TrajectoryState, joint_error};
use jtc_dynamics::Dynamics;
use jtc_wire::{DataStatus, FrameType, RawPoint};
use rig::{Rig, floats, rest};

fn torques(rig: &Rig) -> [f64; 6] {
    rig.controller.telemetry().joints.map(|j| j.torque)
}

fn model(rig: &Rig) -> [f64; 6] {
    rig.controller.telemetry().joints.map(|j| j.torque_model)
}

/// Executes `ticks` and asserts that the torque of each joint changes per tick by at most its model part plus `slack` N·m.
fn run_without_steps(rig: &mut Rig, ticks: usize, slack: f64) {
    for _ in 0..ticks {
        let (t0, m0) = (torques(rig), model(rig));
        rig.tick();
        let (t1, m1) = (torques(rig), model(rig));
        for j in 0..6 {
            let step = ((t1[j] - t0[j]) - (m1[j] - m0[j])).abs();
            assert!(step < slack, "joint {j}: step of {step} N·m in {:?}", rig.state());
        }
    }
}

#[test]
fn j40_holds_with_gravity_and_follows_with_velocity_acceleration_and_rotor() {
    let mut rig = Rig::holding();
    let config = Config::avena();
    let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
    rig.follow = false;
    rig.nodes[1].report.position = 0.005;
    rig.run(3);
    let q = rig.controller.telemetry().joints.map(|j| j.position);
    assert_eq!(model(&rig), dynamics.gravity_torque(&q));

    let points: Vec<_> = (0..100i16)
        .map(|i| RawPoint {
            position: [i; 6],
            // The velocity of the path rises and falls again, because the motion must end at rest.
            velocity: [50 * i.min(99 - i), 0, 30 * i.min(99 - i), 0, 0, 0],
            acceleration: [300, 0, 200, 0, 0, 100],
        })
        .collect();
    let mut rig = Rig::holding();
    rig.move_along(&points, 105);
    let t = rig.controller.telemetry();
    let (q, qd, qdd) = (
        // J-62: the model uses the measured position plus the motion that was commanded since the measurement.
        t.joints.map(|j| j.position + (j.set_position - j.due_position)),
        t.joints.map(|j| j.set_velocity),
        t.joints.map(|j| j.set_acceleration),
    );
    let expected = dynamics.inverse(&q, &qd, &qdd);
    for j in 0..6 {
        let rotor = config.joints[j].rotor_inertia;
        assert!(rotor > 0.0);
        assert!((t.joints[j].torque_model - expected[j] - rotor * qdd[j]).abs() < 1e-9);
    }
}

#[test]
fn j40_gravity_is_a_setting() {
    let down = Rig::holding();
    let up = Rig::holding_with(Config { gravity: [0.0, 0.0, 9.81], ..Config::avena() });
    let sideways = Rig::holding_with(Config { gravity: [0.0, 9.81, 0.0], ..Config::avena() });
    for j in 0..6 {
        assert!((model(&down)[j] + model(&up)[j]).abs() < 1e-9);
    }
    // At position zero, the arm is stretched vertically. Gravity loads joint 2 (index 1) only if gravity is
    // horizontal.
    assert!(model(&down)[1].abs() < 1.0);
    assert!(model(&sideways)[1].abs() > 50.0);
}

#[test]
fn j41_no_derivative_kick_when_holding_begins() {
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    for j in 0..6 {
        rig.nodes[j].report.position = 0.3;
    }
    rig.defaults();
    for _ in 0..300 {
        rig.tick();
        for j in &rig.controller.telemetry().joints {
            assert!(j.torque_d.abs() < 1e-6 && j.torque_p.abs() < 1e-2);
        }
    }
    assert_eq!(rig.state(), ControllerState::HoldPos);
}

#[test]
fn j43_an_error_zeroes_the_torque_of_the_same_tick() {
    let config = Config { torque_release: true, torque_over_ms: 0, catch_ms_max: 0, ..Config::avena() };
    let mut rig = Rig::holding_with(config);
    rig.push(5, 0.02); // The computed torque is 80 N·m, the limit is 40 N·m.
    rig.run(2);
    assert_eq!(rig.state(), ControllerState::Error);
    assert_eq!(rig.status().joints[5].internal, joint_error::TORQUE);
    assert_eq!(rig.torque, [0.0; 6]);
    let sent = rig.sent.iter().rev().take(2);
    for request in sent {
        assert!(!matches!(request, jtc_bus::Request::Move { torque, .. } if *torque != [0.0; 6]));
    }
}

#[test]
fn j43_the_torque_saturates_at_its_limit_for_a_while_at_most_and_j41_holds_the_integral() {
    let mut rig = Rig::holding_with(Config { catch_ms_max: 0, ..Config::avena() });
    rig.push(5, -0.012);
    rig.run(1);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.controller.telemetry().joints[5].torque, 40.0);
    let integral = rig.controller.telemetry().joints[5].torque_i;
    rig.run(5);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.controller.telemetry().joints[5].torque_i, integral);
    rig.run(5);
    assert_eq!(rig.status().joints[5].internal, joint_error::TORQUE);
}

#[test]
fn j42_polynomial_order_and_lengths() {
    // The wire format begins with the coefficient of the highest index, so the order is c3, c2, c1, c0.
    let mut rig = Rig::holding();
    let four = floats((0..6).flat_map(|_| [0.0, 0.0, 0.0, 5.0]));
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &four), DataStatus::NoError);
    let speed = |i: i16| if i == 0 || i == 99 { 0 } else { 150 };
    let points: Vec<_> =
        (0..100).map(|i| RawPoint { position: [i * 3; 6], velocity: [speed(i); 6], ..rest(0) }).collect();
    rig.move_along(&points, 500);
    for j in &rig.controller.telemetry().joints {
        assert!((j.torque_friction - 5.0).abs() < 1e-9, "Coulomb friction only: {}", j.torque_friction);
    }
    // The frame contains six coefficients, c5..c0. c5 is the reference temperature. This temperature is equal to the
    // joint temperature of 25 °C, so the temperature factor is 1.
    let mut rig = Rig::holding();
    let six = floats((0..6).flat_map(|_| [25.0, -0.02, 0.0, 0.0, 10.0, 2.0]));
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &six), DataStatus::NoError);
    rig.move_along(&points, 500);
    let v = 150.0 * 6.283185 / 32767.0;
    for j in &rig.controller.telemetry().joints {
        assert!((j.torque_friction - (2.0 + 10.0 * v)).abs() < 1e-6);
    }
}

#[test]
fn j44_no_torque_step_at_any_switch() {
    let mut rig = Rig::holding();
    rig.follow = false;
    // The rig has a permanent position error, so the PID controller has a torque. This torque must not have a step
    // when the mode changes.
    for j in 0..6 {
        rig.nodes[j].report.position = 0.0003;
    }
    rig.run(300);
    assert!(rig.controller.telemetry().joints[0].torque_p.abs() > 2.0);
    assert_eq!(rig.ask(FrameType::FrictionTableUseDefault, &[]), DataStatus::NoError);
    let points: Vec<_> = (0..60).map(|_| rest(0)).collect();
    rig.upload(&points, 10);
    rig.send(FrameType::TrajSetExecStatus, &[3]);
    // The permitted change of 1.5 N·m per tick covers the change of the integral and the blend of the torque over 100
    // ms.
    run_without_steps(&mut rig, 1200, 1.5);
    assert_eq!(rig.trajectory(), TrajectoryState::Finish);
    rig.send(FrameType::TeachingModeEnable, &[]);
    run_without_steps(&mut rig, 300, 1.5);
    assert_eq!(rig.state(), ControllerState::Teaching);
    rig.send(FrameType::TeachingModeDisable, &[]);
    run_without_steps(&mut rig, 300, 1.5);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    // The host sets new gains while the arm is held.
    rig.send(FrameType::PidParam, &floats((0..6).flat_map(|_| [100.0, 10.0, 1.0, -1.0, 1.0])));
    run_without_steps(&mut rig, 300, 1.5);
}

#[test]
fn j25_teaching_compensates_gravity_and_damps_what_moves() {
    let mut rig = Rig::holding();
    rig.ask(FrameType::TeachingModeEnable, &[]);
    rig.run(150);
    rig.run(100);
    assert_eq!(torques(&rig), model(&rig), "nothing but the model");
    // The Coulomb friction of this joint is so high that Teaching adds no dry friction (J-25). Teaching adds only
    // damping, and compensates half of the Coulomb friction.
    rig.nodes[2].report.velocity = 0.2;
    rig.run(3);
    let t = rig.controller.telemetry().joints[2];
    assert!((t.torque_other + 60.0 * 0.2).abs() < 0.01, "{t:?}");
    assert!(t.torque_friction > 1.0 && t.torque_friction < 6.0, "{t:?}");
    assert!((t.torque - t.torque_model - t.torque_friction - t.torque_other).abs() < 1e-9, "{t:?}");
    // In Teaching, the torque must never exceed the torque limit of the joint, even close to the highest speed.
    rig.nodes[2].report.velocity = -1.999;
    rig.nodes[5].report.velocity = 1.999;
    rig.run(5);
    assert_eq!(rig.state(), ControllerState::Teaching);
}

#[test]
fn j25_leaving_teaching_in_motion_comes_to_rest() {
    let mut rig = Rig::holding();
    rig.ask(FrameType::TeachingModeEnable, &[]);
    rig.run(150);
    rig.nodes[0].report.velocity = 0.8;
    rig.run(2);
    rig.ask(FrameType::TeachingModeDisable, &[]);
    rig.nodes[0].report.velocity = 0.0;
    rig.run(400);
    let t = rig.controller.telemetry();
    assert_eq!((t.state, t.errors), (ControllerState::HoldPos, 0));
    assert_eq!(t.joints[0].set_velocity, 0.0);
    assert!((t.joints[0].set_position - 0.8 * 0.2 / 3.0).abs() < 0.01, "{}", t.joints[0].set_position);
}

#[test]
fn j25_coming_to_rest_is_smooth_and_stays_inside_both_limits() {
    // The rig moves the joint independently of the torque. A high torque limit prevents an overload, which is not a
    // subject of this test.
    let mut config = Config::avena();
    config.joints[1].torque_max = 360.0;
    let limits = config.joints[1];
    for (limit, side) in [(limits.position_min, -1.0), (limits.position_max, 1.0)] {
        for (room, stays) in [(0.01, true), (0.3, false)] {
            let mut rig = Rig::new(config.clone());
            rig.follow = false;
            let from = limit - side * room;
            rig.nodes[1].report.position = from;
            rig.defaults();
            rig.run(300);
            rig.ask(FrameType::TeachingModeEnable, &[]);
            rig.run(650);
            rig.nodes[1].report.velocity = side * 0.4;
            rig.run(2);
            rig.send(FrameType::TeachingModeDisable, &[]);
            rig.until(20, |r| r.state() == ControllerState::HoldPos);
            rig.nodes[1].report.velocity = 0.0;
            rig.follow = true;
            let mut last = rig.controller.telemetry().joints[1];
            let mut fastest = last.set_velocity.abs();
            for _ in 0..400 {
                rig.tick();
                let t = rig.controller.telemetry().joints[1];
                assert!(side * (limit - t.set_position) >= 0.0, "{} beyond {limit}", t.set_position);
                assert!((t.set_velocity - last.set_velocity).abs() < 0.01, "{last:?} {t:?}");
                // J-40: the commanded torque is the sum of gravity and the torque that decelerates the joint.
                let now = rig.controller.telemetry().joints;
                let q = now.map(|j| j.position + (j.set_position - j.due_position));
                let (v, a) = (now.map(|j| j.set_velocity), now.map(|j| j.set_acceleration));
                let dynamics = Dynamics::new(&Parameters::avena().model, config.gravity);
                let torque = dynamics.inverse(&q, &v, &a)[1] + config.joints[1].rotor_inertia * a[1];
                assert!((t.torque_model - torque).abs() < 1e-9);
                fastest = fastest.max(t.set_velocity.abs());
                last = t;
            }
            assert!(fastest > 0.3, "it was not in motion: {fastest} rad/s");
            assert_eq!((last.set_velocity, rig.errors()), (0.0, 0));
            assert_eq!(last.set_position == limit, stays, "{}", last.set_position);
        }
    }
}

#[test]
fn j06_refused_parameters_change_nothing() {
    let mut rig = Rig::new(Config::avena());
    rig.run(200);
    let pid = |min: f32, kp: f32| floats((0..6).flat_map(|_| [kp, 1.0, 1.0, min, 1.0]));
    for bad in [pid(2.0, 1.0), pid(-1.0, f32::NAN), pid(-1.0, f32::INFINITY)] {
        assert_eq!(rig.ask(FrameType::PidParam, &bad), DataStatus::IncorrectValue);
    }
    let mut polynomial = vec![0.0f32; 24];
    polynomial[23] = f32::NEG_INFINITY;
    assert_eq!(rig.ask(FrameType::FrictionPolynomial, &floats(polynomial)), DataStatus::IncorrectValue);
    // In this table, two consecutive velocities of the last joint are equal, but velocities must increase strictly.
    let mut table: Vec<f32> = (0..6)
        .flat_map(|_| (0..20).map(|i| i as f32).chain((0..20).map(|i| i as f32)).chain((0..400).map(|_| 1.0)))
        .collect();
    table[5 * 440 + 7] = table[5 * 440 + 6];
    assert_eq!(rig.ask(FrameType::FrictionTable, &floats(table.clone())), DataStatus::IncorrectValue);
    // All values of this model are zero, so the masses of links 1..5 are zero.
    assert_eq!(rig.ask(FrameType::ArmModel, &vec![0; 532]), DataStatus::IncorrectValue);
    let status = rig.status();
    assert_eq!((status.jtc_init, status.friction_type), (0b111, 0));
    table[5 * 440 + 7] = 7.0;
    assert_eq!(rig.ask(FrameType::FrictionTable, &floats(table)), DataStatus::NoError);
    assert_eq!(rig.status().friction_type, 1);
}
