//! Tests of enabling (J-16): the controller enables joints only while the arm is almost at rest. If a joint moves
//! when it is enabled, the joint comes to rest without a torque step.
use crate::rig;

use jtc_bus::{NodeState, Request, Target};
use jtc_core::{Config, ControllerState, error};
use jtc_wire::FrameType;
use rig::Rig;

const JOINT: usize = 1;

/// Swings joint 2 while the controller is in Error. The cause of the error has ended, and the host has cleared the
/// error. `report` maps the true position and velocity to the reported position and velocity.
fn swing(rig: &mut Rig, ticks: usize, speed: f64, report: Report) {
    let start = rig.nodes[JOINT].report.position;
    for k in 0..ticks {
        // The joint moves for 0.2 s in each direction, so it stays near its position.
        let phase = (k % 400) as f64;
        let (way, sign) = if phase < 200.0 { (phase, 1.0) } else { (400.0 - phase, -1.0) };
        let (position, velocity) = report(speed * way * 0.001, sign * speed);
        rig.nodes[JOINT].report.position = start + position;
        rig.nodes[JOINT].report.velocity = velocity;
        rig.tick();
    }
}

/// Function that maps a true position and velocity to the reported position and velocity.
type Report = fn(f64, f64) -> (f64, f64);

fn asked_to_enable(requests: &[Request]) -> bool {
    requests
        .iter()
        .any(|r| matches!(r, Request::ChangeFsm { target } if target[..6].contains(&Target::Enable)))
}

/// Returns a rig in Error, after the host has cleared all errors.
fn stopped(config: Config) -> Rig {
    let mut rig = Rig::new(config);
    rig.defaults();
    rig.until(500, |r| r.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED));
    rig.run(3);
    rig.follow = false;
    rig.press_stop(100);
    rig
}

#[test]
fn j16_no_joint_is_enabled_while_one_moves() {
    // Three kinds of drives: with true reports, with a reported velocity of zero, and with a true velocity but the old position.
    let reports: [Report; 3] = [|q, v| (q, v), |q, _| (q, 0.0), |_, v| (0.0, v)];
    for report in reports {
        for speed in [0.3, 1.5] {
            let config = Config { enable_timeout_ms: 500, ..Config::avena() };
            let mut rig = stopped(config);
            swing(&mut rig, 100, speed, report);
            rig.send(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0]);
            let from = rig.sent.len();
            // The enabling timeout runs only while the controller requests enabling.
            swing(&mut rig, 3000, speed, report);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{speed} rad/s");
            assert!(!asked_to_enable(&rig.sent[from..]), "{speed} rad/s");
            assert!(
                rig.nodes[..6].iter().all(|n| n.report.state == NodeState::READY),
                "which the status shows"
            );
            // The controller may enable the joints only after joint 2 has been slow for 50 ms.
            let from = rig.sent.len();
            swing(&mut rig, 49, 0.2, report);
            assert!(!asked_to_enable(&rig.sent[from..]), "{speed} rad/s");
            swing(&mut rig, 30, 0.2, report);
            assert!(asked_to_enable(&rig.sent[from..]), "{speed} rad/s");
            rig.run(100);
            assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED));
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        }
    }
}

#[test]
fn j16_the_speed_and_the_time_are_settings() {
    let config = Config { enable_speed_max: 0.5, enable_still_ms: 200, ..Config::avena() };
    let mut rig = stopped(config);
    swing(&mut rig, 500, 1.0, |q, v| (q, v));
    rig.send(FrameType::ClearCurrentErrors, &[1, 0x7F, 0, 0]);
    let from = rig.sent.len();
    swing(&mut rig, 198, 0.45, |q, v| (q, v));
    assert!(!asked_to_enable(&rig.sent[from..]));
    swing(&mut rig, 30, 0.45, |q, v| (q, v));
    assert!(asked_to_enable(&rig.sent[from..]));
}

#[test]
fn j16_a_joint_that_moves_when_it_is_enabled_comes_to_rest_without_a_torque_step() {
    for velocity in [0.2, -0.7, 1.4] {
        // Enabling the motor takes a long time, and the joint begins to fall during this time.
        let mut rig = stopped(Config::avena());
        rig.nodes[JOINT].slow_enable = true;
        rig.clear(true, 0x7F);
        rig.until(500, |r| r.nodes[JOINT].report.state == NodeState::new(12));
        let mut falling = 0.0;
        for _ in 0..100 {
            falling += velocity * 0.01;
            rig.nodes[JOINT].report.velocity = falling;
            rig.nodes[JOINT].report.position += falling * 0.001;
            rig.tick();
        }
        rig.nodes[JOINT].report.state = NodeState::ENABLED;
        let (start, mut last) = (rig.nodes[JOINT].report.position, 0.0);
        for tick in 0..900 {
            // The simulated joint moves as commanded. The controller receives an answer two ticks after the command that this answer
            // reflects (J-62).
            let t = rig.controller.telemetry().joints[JOINT];
            if t.set_velocity != 0.0 {
                rig.nodes[JOINT].report.velocity = t.set_velocity;
                rig.nodes[JOINT].report.position = t.set_position;
            } else if tick < 3 {
                rig.nodes[JOINT].report.position += velocity * 0.001;
            }
            rig.tick();
            let t = rig.controller.telemetry().joints[JOINT];
            let correction = t.torque - t.torque_model;
            assert!(
                f64::abs(correction - last) < 3.0,
                "{velocity} rad/s, tick {tick}: {last} to {correction}"
            );
            last = if t.state == NodeState::ENABLED { correction } else { 0.0 };
        }
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        let t = rig.controller.telemetry().joints[JOINT];
        let way = t.set_position - start;
        assert_eq!(t.set_velocity, 0.0);
        // The stop takes 200 ms. The stop takes longer if a deceleration of 3 rad/s² requires more time.
        let seconds = f64::max(0.2, 1.5 * f64::abs(velocity) / 3.0);
        assert!(
            (way - 0.5 * seconds * velocity).abs() < 0.01,
            "{velocity} rad/s: came to rest after {way} rad"
        );
    }
}

/// After a stop, the motor control of a drive pauses. The controller must not request enabling during this pause.
/// Otherwise the drive would enable the joint at the end of the pause, even if the arm moves by then.
#[test]
fn j16_joints_are_not_asked_while_their_drives_rest_after_a_stop() {
    let mut rig = Rig::holding();
    rig.press_stop(1);
    let from = rig.sent.len();
    rig.clear(true, 0x7F);
    rig.until(600, |r| asked_to_enable(&r.sent[from..]));
    let ticks = rig.sent.len() - from;
    assert!((400..=410).contains(&ticks), "{ticks} ms");
}

/// If a joint leaves OperationEnable after it was enabled, this must be an error, whether the arm moves or not.
#[test]
fn j16_the_gate_hides_no_joint_that_leaves_operation_enable() {
    let mut rig = Rig::holding();
    rig.follow = false;
    rig.nodes[JOINT].report.velocity = 1.0;
    rig.run(3);
    rig.nodes[JOINT].report.state = NodeState::READY;
    rig.run(2);
    assert_eq!(rig.errors(), error::EXTERNAL | error::EXTERNAL_JOINTS);
}
