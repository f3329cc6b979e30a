//! Tests of the safety input with a ramp (J-22). The controller first stops all motion, and then switches the torque off.
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState, settings};
use jtc_wire::{DataStatus, ExecCommand, FrameType, SettingValue};

use crate::pairs::{Bench, UNDER_WAY};
use crate::plant::{LuGre, POSES, Plant};
use crate::rig::{Rig, floats};

fn config(ramp_ms: u16) -> Config {
    Config { safety_input_ramp_ms: ramp_ms, ..Config::avena() }
}

/// Returns the highest true speed and the highest commanded speed, rad/s.
fn speeds(bench: &Bench) -> (f64, f64) {
    let most = |speeds: [f64; 6]| speeds.into_iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    (most(bench.arm.v), most(bench.rig.controller.telemetry().joints.map(|joint| joint.set_velocity)))
}

/// Returns the number of ticks until the torque is off.
fn released(bench: &mut Bench) -> usize {
    for k in 1..2_000 {
        bench.arm.tick(&mut bench.rig);
        if !bench.rig.state().has_torque() {
            assert_eq!((bench.rig.state(), bench.rig.errors() & 1), (ControllerState::Error, 1));
            assert_eq!(bench.rig.torque, [0.0; 6]);
            return k;
        }
    }
    panic!("the torque stays");
}

/// A pulse of 1 ms at the safety input must be sufficient to begin the stop. The commanded motion must be at rest
/// before the torque is switched off. A joint that yields, or that a hand moves, may still move until the end of the
/// ramp.
#[test]
fn j22_with_a_ramp_what_moves_stops_before_the_torque_goes() {
    for (doing, begin) in UNDER_WAY {
        let mut bench = begin(config(500));
        let (_, before) = speeds(&bench);
        let operates = bench.rig.state() == ControllerState::Operate;
        bench.rig.safety_input = false;
        bench.arm.tick(&mut bench.rig);
        bench.rig.safety_input = true;
        let ms = if bench.rig.state() == ControllerState::Error { 0 } else { released(&mut bench) };
        let (speed, set) = speeds(&bench);
        println!("{doing}: from {before:.2} rad/s, {ms} ms, then {speed:.3} rad/s");
        assert!(ms <= 500, "{doing}: {ms} ms");
        match doing {
            // Without a commanded motion, a stop would only delay switching the torque off.
            _ if before == 0.0 && !operates && doing != "teaches" && doing != "slows down after a Stop" => {
                assert_eq!(ms, 0, "{doing}")
            }
            "jogs" => assert!(ms > 50 && set == 0.0 && speed < 0.05, "{doing}: {ms} ms, {speed} rad/s"),
            _ if operates => {
                assert!(ms > 50 && set == 0.0 && speed < 0.05, "{doing}: {ms} ms, {speed} rad/s")
            }
            _ => {}
        }
        bench.run(1_000);
        assert_eq!((bench.rig.state(), bench.rig.errors() & 1), (ControllerState::Error, 1), "{doing}");
    }
}

/// Returns an arm that moves on a path, with this ramp. The safety input of this arm has just become 0.
fn moving(ramp_ms: u16) -> Bench {
    let mut bench = Bench::holding(config(ramp_ms), 1.0, 0.0);
    bench.execute(1.0, 4.0);
    bench.until("the path", Bench::moves);
    bench.run(1_000);
    assert!(speeds(&bench).1 > 0.15, "{:?}", speeds(&bench));
    bench.rig.safety_input = false;
    bench
}

/// The ramp setting is the longest time until the torque is off. Without a ramp, the controller switches the torque off in the tick in
/// which it reads 0 at the safety input.
#[test]
fn j22_the_torque_goes_when_the_ramp_is_over_whatever_still_moves() {
    for ramp_ms in [0, 1, 20, 100] {
        assert_eq!(released(&mut moving(ramp_ms)), 1 + usize::from(ramp_ms));
    }
    // After a fault of a drive or another error, the controller switches the torque off without waiting.
    let mut bench = moving(500);
    bench.run(50);
    bench.rig.nodes[3].fault();
    let ticks = bench.rig.until(30, |rig| rig.state() == ControllerState::Error);
    assert!(ticks < 20, "{ticks} ms");
}

/// If another error switches the torque off during the ramp, the controller must still report the error of the safety
/// input.
#[test]
fn j22_j21_the_safety_input_is_an_error_however_the_ramp_ends() {
    for reset in [false, true] {
        let mut bench = moving(500);
        bench.run(1);
        bench.rig.safety_input = true;
        bench.run(50);
        if reset {
            // The drive restarts without reporting an error.
            bench.rig.nodes[3].report.state = jtc_bus::NodeState::START;
        } else {
            bench.rig.nodes[3].fault();
        }
        bench.run(10);
        assert_eq!((bench.rig.state(), bench.rig.errors() & 1), (ControllerState::Error, 1), "{reset}");
    }
}

/// While drives are being enabled, no commanded motion can be stopped. The controller must therefore switch the
/// torque off at once.
#[test]
fn j22_a_ramp_enables_no_drive() {
    let mut arm = Plant::new(&Parameters::avena().model, LuGre::of_avena_times(1.0), POSES[0]);
    let mut rig = Rig::with_speeds(config(500));
    rig.follow = false;
    arm.report(&mut rig);
    rig.defaults();
    while !rig.nodes[..6].iter().any(|node| node.report.state == jtc_bus::NodeState::ENABLED) {
        arm.tick(&mut rig);
    }
    rig.nodes[5].report.velocity = 0.1;
    rig.safety_input = false;
    rig.tick();
    assert_eq!(rig.state(), ControllerState::Error);
}

/// No motion can begin while the safety input stops the arm, even if the input is 1 again.
#[test]
fn j22_nothing_begins_during_the_ramp() {
    let mut bench = moving(500);
    bench.run(1);
    bench.rig.safety_input = true;
    bench.until("a path that stands", |rig| rig.trajectory() == TrajectoryState::Stop);
    // The path is at rest, but a hand keeps a joint in motion, so the stop still continues.
    bench.rig.follow = false;
    let rig = &mut bench.rig;
    rig.nodes[1].report.velocity = 0.1;
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    let body = floats([0.1f32, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(rig.ask(FrameType::Jog, &body), DataStatus::NotAllowed);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NotAllowed);
    rig.until(500, |rig| rig.state() == ControllerState::Error);
}

/// The ramp setting is part of the arm, so this setting can change only without torque.
#[test]
fn j22_j53_the_ramp_is_a_setting_that_changes_without_torque_only() {
    let row = settings::setting(80).expect("the setting");
    assert_eq!((row.name, row.low, row.high), ("safety_input_ramp_ms", 0.0, 500.0));
    let mut rig = Rig::holding();
    let body = SettingValue { setting: 80, joint: 0, value: 100.0 }.emit();
    assert_eq!(rig.ask(FrameType::SetSettings, &body), DataStatus::NotAllowed);
}
