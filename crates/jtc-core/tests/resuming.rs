//! Tests of an Execute after a Pause: its conditions and its starting point (J-16, J-33, J-34). Also tests the timeout of a teach request
//! (J-25). The timeout of a teach request does not depend on how long the arm was held before.
use crate::rig;

use jtc_bus::NodeState;
use jtc_core::{Config, ControllerState, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType};
use rig::{Rig, pieces, rest};

#[test]
fn j16_an_execute_after_a_pause_waits_for_drives_as_well() {
    let mut rig = Rig::with_a_slow_drive(Config::avena());
    rig.run(50);
    let there_and_back = |n: i16| rest(if n < 25 { n } else { 50 - n });
    rig.upload(&(0..51).map(there_and_back).collect::<Vec<_>>(), 20);
    for command in [ExecCommand::Execute, ExecCommand::Pause, ExecCommand::Execute] {
        assert_eq!(rig.exec(command), DataStatus::NoError);
    }
    for _ in 0..1_000 {
        rig.tick();
        let t = rig.controller.telemetry();
        assert_eq!(
            (t.trajectory, t.point, t.joints[0].set_position),
            (TrajectoryState::Execute, 0, 0.0),
            "nothing moves"
        );
    }
    rig.nodes[2].slow_enable = false;
    rig.nodes[2].report.state = NodeState::ENABLED;
    rig.until(3_000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

/// Because of friction, the joint is at rest slightly off its commanded position. After Execute, the path continues
/// at once from the commanded position.
#[test]
fn j33_a_path_goes_on_at_once_and_from_where_it_was_commanded() {
    let mut rig = Rig::holding();
    rig.move_along(&pieces(2, &[(1.0, 30), (0.0, 100), (-1.0, 30)]), 600);
    assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
    rig.until(1_000, |r| r.trajectory() == TrajectoryState::Pause);
    let paused = rig.controller.telemetry();
    rig.push(2, paused.joints[2].set_position - 0.003);
    rig.run(100);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    let mut last = paused.joints[2].set_position;
    for _ in 0..60 {
        rig.tick();
        let now = rig.controller.telemetry().joints[2].set_position;
        assert!((last..last + 1e-3).contains(&now), "{last} to {now} rad");
        last = now;
    }
    assert!(rig.controller.telemetry().point > paused.point + 2, "{} after {}", last, paused.point);
}

/// A teach request may wait for its full timeout, even if the controller has already held the arm for a long time
/// before the request.
#[test]
fn j25_teaching_may_wait_however_long_the_arm_was_held() {
    let mut rig = Rig::holding_with(Config { enable_timeout_ms: 600, ..Config::avena() });
    rig.run(1_000);
    // A hand pushes against joint 2.
    rig.push(1, 0.002);
    rig.run(2);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
    rig.run(50);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    rig.push(1, 0.0);
    rig.run(400);
    assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0));
}
