//! Teaching (J-25) and the approach to a path (J-34) begin only when the arm is held, even if the arm carries an unmodelled load.
use crate::{plant, rig};

use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use plant::{LuGre, Plant, loaded};
use rig::{Rig, floats};

const POSE: [f64; 6] = [0.0, 1.4, 0.2, 0.0, 0.0, 0.0];

/// Returns an arm with an unmodelled load of `mass` kg, and its controller, before the joints are enabled.
fn carrying(mass: f64, factor: f64) -> (Plant, Rig) {
    let friction = LuGre::of_avena_times(factor);
    let arm = Plant::new(&loaded(Parameters::avena().model, mass), friction, POSE);
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    arm.report(&mut rig);
    rig.defaults();
    (arm, rig)
}

fn way(arm: &Plant) -> f64 {
    (0..6).map(|j| (arm.q[j] - POSE[j]).abs()).fold(0.0, f64::max)
}

/// In the first tick of HoldPos, and while the load swings, the controller does not know the load of the arm.
/// Teaching must wait until the controller holds the load.
#[test]
fn j25_teaching_waits_until_the_load_is_held() {
    for factor in [0.3, 1.0] {
        for after in [0, 50, 100, 400] {
            let (mut arm, mut rig) = carrying(2.0, factor);
            while rig.state() != ControllerState::HoldPos {
                arm.tick(&mut rig);
            }
            arm.run(&mut rig, after);
            rig.send(FrameType::TeachingModeEnable, &[]);
            arm.run(&mut rig, 3_000);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0), "after {after} ms");
            // With a third of the modelled friction, the arm creeps because of the part of the load that the
            // controller has not learned.
            let most = if factor == 1.0 { 0.03 } else { 0.1 * 3.0 };
            assert!(way(&arm) < most, "after {after} ms, friction times {factor}: {} rad", way(&arm));
        }
    }
}

#[test]
fn j25_teaching_that_waits_can_be_called_off_does_not_wait_for_ever_and_starts_no_path() {
    let mut rig = Rig::holding();
    let waiting = |rig: &mut Rig| {
        rig.nodes[2].slow_enable = true;
        rig.nodes[2].report.state = NodeState::READY;
        rig.press_stop(50);
        rig.clear(true, 0x7F);
        rig.until(2_000, |rig| rig.state() == ControllerState::HoldPos);
    };
    waiting(&mut rig);
    rig.upload(&vec![RawPoint::default(); 30], 10);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::HoldPos, "joint 3 is not enabled");
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NotAllowed);
    assert_eq!(rig.ask(FrameType::TeachingModeDisable, &[]), DataStatus::NoError);
    rig.nodes[2].report.state = NodeState::ENABLED;
    rig.run(2_000);
    assert_eq!(
        (rig.state(), rig.trajectory()),
        (ControllerState::HoldPos, TrajectoryState::Stop),
        "called off"
    );

    waiting(&mut rig);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(10_100);
    rig.nodes[2].report.state = NodeState::ENABLED;
    rig.run(2_000);
    assert_eq!(rig.state(), ControllerState::HoldPos, "after ten seconds nobody expects it");
}

/// A drive enables its joint seconds later than the other drives. The load of the late joint then swings and disturbs
/// the other joints. The controller must catch the loads of these joints again.
#[test]
fn j43_a_joint_that_is_enabled_late_lets_the_others_catch_again() {
    for late in [1, 2] {
        for factor in [0.0, 0.1, 0.3] {
            let (mut arm, mut rig) = carrying(2.8, factor);
            rig.nodes[late].slow_enable = true;
            while rig.state() != ControllerState::HoldPos {
                arm.tick(&mut rig);
            }
            arm.run(&mut rig, 4_000);
            rig.nodes[late].report.state = NodeState::ENABLED;
            arm.run(&mut rig, 3_000);
            let about = format!("joint {} late, friction times {factor}", late + 1);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{about}");
        }
    }
}

/// While the controller catches the load of a joint that was just enabled, it tolerates a swing of this joint. The
/// controller must not tolerate a swing that unstable gains cause.
#[test]
fn j43_a_loop_that_drives_its_joint_to_and_fro_is_no_catch() {
    for [kp, ki, kd] in [[200.0, 14_000.0, 80.0], [1_000.0, 50_000.0, 0.0]] {
        let fastest = |catch_ms_max| {
            let (mut arm, _) = carrying(2.0, 0.1);
            let mut rig = Rig::new(Config { catch_ms_max, ..Config::avena() });
            rig.follow = false;
            arm.report(&mut rig);
            rig.defaults();
            let gains = floats([kp, ki, kd, -100.0, 100.0].repeat(6));
            assert_eq!(rig.ask(FrameType::PidParam, &gains), DataStatus::NoError);
            let mut fastest = 0.0_f64;
            for _ in 0..5_000 {
                arm.tick(&mut rig);
                if rig.state() != ControllerState::Error {
                    fastest = arm.v.iter().fold(fastest, |f, v| f.max(v.abs()));
                }
            }
            fastest
        };
        let (without, with) = (fastest(0), fastest(1_000));
        println!("{kp} {ki} {kd}: {without} without a catch, {with} rad/s with one");
        // Even while the controller tolerates a swing, the speed of the joint must stay below the velocity limit, and
        // far below the speed at which a drive switches off.
        assert!(with < 1.5, "{kp} {ki} {kd}: {with} rad/s, {without} without a catch");
    }
}

/// A hand moves the stretched arm downwards, and Teaching ends. For some time, stopping the arm needs more torque
/// than the torque limit. This is not an error.
#[test]
fn j25_leaving_teaching_in_motion_is_no_error_where_the_torque_is_at_its_limit() {
    for speed in [0.4, 0.6, 0.8] {
        let (mut arm, mut rig) = carrying(0.0, 1.0);
        arm.run(&mut rig, 3_000);
        rig.send(FrameType::TeachingModeEnable, &[]);
        arm.run(&mut rig, 700);
        assert_eq!(rig.state(), ControllerState::Teaching);
        for k in 0..400 {
            let wanted = speed * (f64::from(k) / 200.0).min(1.0);
            arm.push[1] = (wanted - arm.v[1]) * 400.0;
            arm.tick(&mut rig);
        }
        rig.send(FrameType::TeachingModeDisable, &[]);
        arm.tick(&mut rig);
        arm.push = [0.0; 6];
        let from = arm.q;
        arm.run(&mut rig, 2_000);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{speed} rad/s");
        assert!((arm.q[1] - from[1]).abs() < 0.25, "{speed} rad/s: {} rad", arm.q[1] - from[1]);
    }
}
