//! Tests of an arm without brakes that falls while its errors are cleared (J-16).
use jtc_bus::{NodeState, Request, Target};
use jtc_core::{ControllerState, error};
use jtc_sim::{Operator, SimConfig, Support, host};

/// Returns an arm that the controller holds. The upper arm is bent forward by the angle `shoulder`, so that gravity
/// pulls it down.
fn held(shoulder: f64) -> Operator {
    let start = [0.0, shoulder, -0.3, 0.0, 0.2, 0.0];
    let config = SimConfig { start, support: Support::Stand, baud: None, ..SimConfig::default() };
    let mut operator = Operator::new(config);
    operator.bring_up().unwrap();
    operator.run(500);
    operator
}

fn speed(operator: &Operator) -> f64 {
    operator.world.truth().qd.iter().fold(0.0, |most: f64, v| most.max(v.abs()))
}

fn asks_to_enable(operator: &Operator) -> bool {
    match operator.world.sent().map(Request::parse) {
        Some(Ok(Request::ChangeFsm { target })) => target[..6].contains(&Target::Enable),
        _ => false,
    }
}

/// Clears the errors `after_ms` milliseconds after the torque was switched off.
fn fall_and_clear(shoulder: f64, after_ms: u64) {
    let mut operator = held(shoulder);
    operator.world.set_safety_input(false);
    operator.run(20);
    operator.world.set_safety_input(true);
    operator.run(after_ms - 20);
    let (mut asked, mut last) = (None, [0.0; 6]);
    for ms in 0..15_000 {
        if ms % 500 == 0 && operator.state() == ControllerState::Error {
            // The test clears the errors repeatedly, because a drive reports over-speed again while its joint falls
            // faster than 1.8 rad/s.
            operator.world.host_write(&host::clear_all());
        }
        operator.step();
        let t = *operator.world.telemetry();
        assert_eq!(t.errors & error::INTERNAL, 0, "{after_ms} + {ms} ms: {t:?}");
        if asks_to_enable(&operator) {
            let speed = speed(&operator);
            if asked.replace(ms).is_none() {
                println!(
                    "{shoulder} rad, cleared after {after_ms} ms: enabled after {ms} ms at {speed:.3} rad/s"
                );
            }
            assert!(speed < 0.3, "{after_ms} + {ms} ms: {speed} rad/s");
        }
        for (joint, last) in t.joints.iter().zip(&mut last) {
            let correction =
                if joint.state == NodeState::ENABLED { joint.torque - joint.torque_model } else { 0.0 };
            let step = (correction - *last).abs();
            // The correction is the commanded torque minus the model torque. The correction may change by 12 N·m or
            // more only at a joint with an error, for example when the joint begins to yield (J-68).
            assert!(step < 12.0 || joint.internal != 0, "{after_ms} + {ms} ms: torque step of {step} N·m");
            *last = correction;
        }
    }
    assert!(asked.is_some() && enabled(&operator), "in the end it is held");
    assert!(speed(&operator) < 0.02);
}

fn enabled(operator: &Operator) -> bool {
    operator.world.telemetry().joints.iter().all(|joint| joint.state == NodeState::ENABLED)
}

#[test]
fn j16_an_arm_that_falls_is_enabled_when_it_is_slow_again_and_not_before() {
    for shoulder in [0.4, 0.9] {
        for after_ms in [30, 50, 80, 150, 300, 450, 1000] {
            fall_and_clear(shoulder, after_ms);
        }
    }
}
