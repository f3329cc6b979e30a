//! Tests of the trajectory: segments, execution, Pause and Stop (section 5).
use crate::rig;

use jtc_core::{Config, ControllerState, POINTS_MAX, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use rig::{Rig, put, rad, rest, segment_body};

/// Returns a motion of joint 2, and a smaller motion of joint 5, that starts and ends at rest: `n` points, `step` ms apart.
fn motion(n: usize, step: u16) -> Vec<RawPoint> {
    let total = (n - 1) as f64 * f64::from(step) / 1000.0;
    (0..n)
        .map(|i| {
            let u = i as f64 / (n - 1) as f64;
            let p = u * u * u * (10.0 + u * (6.0 * u - 15.0));
            let v = 30.0 * u * u * (1.0 - u) * (1.0 - u) / total;
            let a = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (total * total);
            let mut point = RawPoint::default();
            for (j, way) in [(2, 0.4), (5, -0.2)] {
                put(&mut point, j, way * p, way * v, way * a);
            }
            point
        })
        .collect()
}

fn traj(
    rig: &mut Rig,
    number: u16,
    segment: u16,
    segments: u16,
    step: u16,
    points: &[RawPoint],
) -> DataStatus {
    rig.ask(FrameType::Trajectory, &segment_body(number, segment, segments, step, points))
}

#[test]
fn j30_segments_come_in_order_and_the_right_one_can_follow_a_refused_one() {
    use DataStatus::*;
    let mut rig = Rig::holding();
    let p = [rest(0), rest(0)];
    assert_eq!(traj(&mut rig, 1, 1, 3, 10, &p), IncorrectSegmentOrder, "segment 1 without segment 0");
    assert_eq!(traj(&mut rig, 1, 0, 3, 10, &p), NoError);
    assert_eq!(traj(&mut rig, 1, 2, 3, 10, &p), IncorrectSegmentOrder, "skipped");
    assert_eq!(traj(&mut rig, 2, 1, 3, 10, &p), IncorrectSegmentOrder, "another trajectory");
    assert_eq!(traj(&mut rig, 1, 1, 4, 10, &p), IncorrectSegmentOrder, "another number of segments");
    assert_eq!(traj(&mut rig, 1, 1, 3, 20, &p), IncorrectStepTime, "another step time");
    assert_eq!(traj(&mut rig, 1, 1, 3, 0, &p), IncorrectStepTime);
    assert_eq!(traj(&mut rig, 1, 3, 3, 10, &p), IncorrectSegmentOrder, "out of range");
    assert_eq!(traj(&mut rig, 1, 1, 3, 10, &[]), IncorrectValue, "empty");
    assert_eq!(traj(&mut rig, 1, 1, 3, 10, &p), NoError);
    assert_eq!(traj(&mut rig, 1, 1, 3, 10, &p), IncorrectSegmentOrder, "repeated");
    assert_eq!(rig.trajectory(), TrajectoryState::Null);
    assert_eq!(traj(&mut rig, 1, 2, 3, 10, &p), NoError);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    assert_eq!(traj(&mut rig, 1, 3, 3, 10, &p), IncorrectSegmentOrder, "after the last");
    assert_eq!(rig.exec(ExecCommand::Execute), NoError);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.controller.telemetry().point, 50, "six points, five steps of 10 ms");
}

#[test]
fn j30_counts_and_the_old_trajectory_survives_a_refused_segment_0() {
    use DataStatus::*;
    let mut rig = Rig::holding();
    rig.upload(&motion(100, 10), 10);
    let p = [rest(0)];
    assert_eq!(traj(&mut rig, 1, 0, 101, 10, &p), TooManySegments);
    assert_eq!(traj(&mut rig, 1, 100, 100, 10, &p), TooManySegments);
    assert_eq!(traj(&mut rig, 1, 99, 99, 10, &p), IncorrectSegmentOrder);
    assert_eq!(traj(&mut rig, 1, 0, 0, 10, &p), IncorrectSegmentOrder);
    assert_eq!(traj(&mut rig, 1, 0, 1, 10, &vec![rest(0); 1501]), TooManyPoints);
    assert_eq!(traj(&mut rig, 1, 0, 1, 0, &p), IncorrectStepTime);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    // The test fills the segment store up to its last point. The controller refuses a further point, but segment 0 of another trajectory
    // replaces all stored points.
    for s in 0..8 {
        assert_eq!(traj(&mut rig, 9, s, 9, 1, &vec![rest(0); 1500]), NoError);
    }
    assert_eq!(POINTS_MAX, 8 * 1500);
    assert_eq!(traj(&mut rig, 9, 8, 9, 1, &p), TooManyPoints);
    assert_eq!(traj(&mut rig, 9, 0, 1, 1, &vec![rest(0); 1500]), NoError);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    for s in 0..100 {
        assert_eq!(
            (rig.trajectory() == TrajectoryState::Stop, traj(&mut rig, 9, s, 100, 10, &p)),
            (s == 0, NoError),
            "{s}"
        );
    }
    assert_eq!(rig.trajectory(), TrajectoryState::Stop, "as many segments as there may be");
}

#[test]
fn j30_segments_are_accepted_in_holdpos_only() {
    let mut rig = Rig::new(Config::avena());
    rig.run(200);
    assert_eq!(traj(&mut rig, 1, 0, 1, 10, &[rest(0)]), DataStatus::NotAllowed);
    let mut rig = Rig::holding();
    rig.execute(&motion(100, 10));
    rig.run(300);
    assert_eq!(rig.state(), ControllerState::Operate);
    assert_eq!(traj(&mut rig, 1, 0, 1, 10, &[rest(0)]), DataStatus::NotAllowed);
    rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
    rig.run(2);
    assert_eq!(traj(&mut rig, 1, 0, 2, 10, &[rest(0)]), DataStatus::NoError);
    assert_eq!(rig.trajectory(), TrajectoryState::Null);
}

#[test]
fn j06_parameters_are_not_changed_under_a_moving_arm() {
    let mut rig = Rig::holding();
    rig.execute(&motion(100, 10));
    rig.run(300);
    for t in
        [FrameType::PidParamUseDefault, FrameType::ArmModelUseDefault, FrameType::FrictionTableUseDefault]
    {
        assert_eq!(rig.ask(t, &[]), DataStatus::NotAllowed);
    }
    assert_eq!(rig.state(), ControllerState::Operate);
}

#[test]
fn j31_first_and_last_point_are_commanded_exactly_and_the_index_counts_milliseconds() {
    let mut rig = Rig::holding();
    let points = motion(41, 25);
    rig.upload(&points, 25);
    rig.exec(ExecCommand::Execute);
    rig.until(1000, |r| r.controller.telemetry().point == 1);
    for k in 1..=1000u32 {
        let t = rig.controller.telemetry();
        assert_eq!(t.point, k);
        if k % 25 == 0 {
            let point = &points[(k / 25) as usize];
            assert_eq!(t.joints[2].set_position, rad(point.position[2]));
        }
        rig.tick();
    }
    let t = rig.controller.telemetry();
    assert_eq!((t.trajectory, t.point), (TrajectoryState::Finish, 1000));
    assert_eq!(t.joints[2].set_position, rad(points[40].position[2]));
    rig.run(500);
    // J-33: after Finish, the controller holds the last point.
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.controller.telemetry().joints[2].set_position, rad(points[40].position[2]));
    assert_eq!(rig.controller.telemetry().point, 1000);
}

#[test]
fn j31_point_0_is_commanded() {
    let mut rig = Rig::holding();
    let points: Vec<_> = (0..20).map(|i| rest(100 + i)).collect();
    rig.execute(&points);
    let mut seen = false;
    for _ in 0..400 {
        rig.tick();
        let t = rig.controller.telemetry();
        seen |= t.state == ControllerState::Operate && t.point == 0 && t.joints[3].set_position == rad(100);
    }
    assert!(seen);
}

/// Every commanded position of a paused motion must be on the path, and the motion must not skip any part of the
/// path.
#[test]
fn j33_pause_and_resume_follow_the_path() {
    let mut rig = Rig::holding();
    let points = motion(301, 10);
    rig.upload(&points, 10);
    // The trajectory without a pause gives the position of joint 5 as a function of the position of joint 2.
    rig.exec(ExecCommand::Execute);
    let mut path = Vec::new();
    while rig.trajectory() != TrajectoryState::Finish {
        rig.tick();
        let t = rig.controller.telemetry();
        if t.point > 0 {
            path.push((t.joints[2].set_position, t.joints[5].set_position));
        }
    }
    // Executes the same trajectory again with a pause.
    let mut rig = Rig::holding();
    rig.move_along(&points, 1400);
    assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
    let mut last = rig.controller.telemetry();
    let mut ticks_to_stand = 0;
    let check = |t: &jtc_core::Telemetry, last: &jtc_core::Telemetry| {
        let (x, y) = (t.joints[2].set_position, t.joints[5].set_position);
        let i = path.partition_point(|p| p.0 < x).clamp(1, path.len() - 1);
        let near = |p: &(f64, f64)| (p.0 - x).hypot(p.1 - y) < 5e-4;
        assert!(near(&path[i]) || near(&path[i - 1]), "({x}, {y}) is off the path");
        assert!(t.point >= last.point && t.point <= last.point + 1, "the index is monotone");
        // In one tick, the velocity changes by at most the effect of 12.6 rad/s², plus one step of the int16 resolution.
        let dv = (t.joints[2].set_velocity - last.joints[2].set_velocity).abs();
        assert!(dv < 0.0126 + 0.0004, "step of {dv} rad/s");
    };
    while rig.trajectory() == TrajectoryState::Execute {
        rig.tick();
        ticks_to_stand += 1;
        let t = rig.controller.telemetry();
        check(&t, &last);
        last = t;
    }
    assert_eq!(rig.trajectory(), TrajectoryState::Pause);
    assert!((150..=260).contains(&ticks_to_stand), "{ticks_to_stand}");
    let held = rig.controller.telemetry().joints[2].set_position;
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.controller.telemetry().joints[2].set_position, held, "the commanded position is held");
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    while rig.trajectory() != TrajectoryState::Finish {
        rig.tick();
        let t = rig.controller.telemetry();
        check(&t, &last);
        last = t;
    }
    assert_eq!(last.joints[2].set_position, rad(points[300].position[2]));
}

/// The controller accepts a Pause or Stop even if the motion ends before the ramp of the stop would end. The
/// trajectory must then end in the state Pause or Stop, and not in Finish.
#[test]
fn j33_an_accepted_pause_or_stop_ends_in_pause_or_stop() {
    let points = motion(101, 10);
    for (command, to) in
        [(ExecCommand::Pause, TrajectoryState::Pause), (ExecCommand::Stop, TrajectoryState::Stop)]
    {
        for before_the_end in [1, 2, 5, 20, 50, 99, 150, 199, 250] {
            let mut rig = Rig::holding();
            rig.move_along(&points, 1000 - before_the_end);
            rig.send(FrameType::TrajSetExecStatus, &[command as u8]);
            rig.tick();
            let ticks = rig.until(500, |r| r.trajectory() != TrajectoryState::Execute);
            assert_eq!(
                rig.trajectory(),
                to,
                "{command:?} {before_the_end} ms before the end, after {ticks} ms"
            );
            rig.run(100);
            assert_eq!((rig.trajectory(), rig.state(), rig.errors()), (to, ControllerState::HoldPos, 0));
            if to == TrajectoryState::Pause {
                assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
                rig.until(1000, |r| r.trajectory() == TrajectoryState::Finish);
                assert_eq!(rig.controller.telemetry().joints[2].set_position, rad(points[100].position[2]));
            }
        }
    }
}

#[test]
fn j33_a_pause_at_speed_takes_longer_rather_than_break_a_limit() {
    // Every joint starts at rest, moves at 1 rad/s, and ends at rest. A ramp of 200 ms would need 7.5 rad/s², which the settings of this
    // test do not allow.
    let n = 151;
    let speed = |i: i32| (0.04 * f64::from(i.min(n - 1 - i))).min(1.0);
    let mut way = 0.0;
    let points: Vec<_> = (0..n)
        .map(|i| {
            way += if i == 0 { 0.0 } else { 0.005 * (speed(i - 1) + speed(i)) };
            let mut p = RawPoint::default();
            for j in 0..6 {
                put(&mut p, j, way, speed(i), 0.0);
            }
            p
        })
        .collect();
    let mut config = Config::avena();
    for joint in &mut config.joints {
        joint.acceleration_max = 4.0;
    }
    let mut rig = Rig::holding_with(config);
    rig.move_along(&points, 300);
    rig.exec(ExecCommand::Stop);
    let ticks = rig.until(1000, |r| r.trajectory() != TrajectoryState::Execute);
    assert!((256..330).contains(&ticks), "{ticks}");
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Stop, 0));
}

#[test]
fn j34_commands_follow_the_table() {
    use ExecCommand::*;
    let fresh = |trajectory: TrajectoryState| {
        let mut rig = Rig::holding();
        if trajectory == TrajectoryState::Null {
            return rig;
        }
        rig.upload(&motion(100, 10), 10);
        if trajectory == TrajectoryState::Stop {
            return rig;
        }
        rig.exec(Execute);
        rig.until(1000, |r| r.controller.telemetry().point > 300);
        if trajectory == TrajectoryState::Pause {
            rig.exec(Pause);
            rig.until(1000, |r| r.trajectory() == TrajectoryState::Pause);
        }
        if trajectory == TrajectoryState::Finish {
            // The path ends at another position than it begins, so the test moves the joints back to the start before
            // the second execution.
            rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
        }
        rig
    };
    let allowed = [
        (TrajectoryState::Stop, Execute),
        (TrajectoryState::Execute, Pause),
        (TrajectoryState::Execute, Stop),
        (TrajectoryState::Pause, Execute),
        (TrajectoryState::Pause, Stop),
        (TrajectoryState::Finish, Stop),
    ];
    for trajectory in [
        TrajectoryState::Null,
        TrajectoryState::Stop,
        TrajectoryState::Pause,
        TrajectoryState::Execute,
        TrajectoryState::Finish,
    ] {
        for command in [Stop, Pause, Execute] {
            if (trajectory, command) == (TrajectoryState::Finish, Execute) {
                continue; // The remainder of this test covers a second execution after Finish.
            }
            let mut rig = fresh(trajectory);
            let expected = if allowed.contains(&(trajectory, command)) {
                DataStatus::NoError
            } else {
                DataStatus::NotAllowed
            };
            assert_eq!(rig.exec(command), expected, "{trajectory:?} {command:?}");
            if expected == DataStatus::NotAllowed {
                let point = rig.controller.telemetry().point;
                rig.run(5);
                let moving = trajectory == TrajectoryState::Execute;
                assert_eq!(
                    rig.controller.telemetry().point > point,
                    moving,
                    "a refused command is forgotten"
                );
            }
        }
    }
}

#[test]
fn j34_a_finished_closed_path_runs_again() {
    let mut there = motion(60, 10);
    let back: Vec<_> =
        there.iter().rev().skip(1).map(|p| RawPoint { velocity: p.velocity.map(|v| -v), ..*p }).collect();
    there.extend(back);
    let mut rig = Rig::holding();
    rig.upload(&there, 10);
    for _ in 0..2 {
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
        rig.run(3);
    }
}

#[test]
fn j34_execute_from_pause_needs_the_arm_at_the_paused_point() {
    let mut config = Config::avena();
    config.joints[4].torque_max = 1000.0;
    let mut rig = Rig::holding_with(config);
    rig.move_along(&motion(100, 10), 301);
    rig.exec(ExecCommand::Pause);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Pause);
    // A person pushes the arm, first weakly and then too strongly.
    rig.follow = false;
    for (push, answer) in [(0.022, DataStatus::StartPositionMismatch), (-0.004, DataStatus::NoError)] {
        for _ in 0..20 {
            rig.nodes[4].report.position += push / 20.0;
            rig.tick();
        }
        assert_eq!(rig.exec(ExecCommand::Execute), answer);
        assert_eq!(rig.trajectory() == TrajectoryState::Execute, answer == DataStatus::NoError);
    }
}

#[test]
fn j34_execute_needs_the_arm_at_the_first_point() {
    let mut rig = Rig::holding();
    let points: Vec<_> = (0..10).map(|_| rest(250)).collect(); // The first point is 0.024 rad away.
    rig.upload(&points, 10);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::StartPositionMismatch);
    rig.run(300);
    assert_eq!((rig.trajectory(), rig.state()), (TrajectoryState::Stop, ControllerState::HoldPos));
    assert_eq!(rig.controller.telemetry().joints[0].set_position, 0.0, "nothing moves");
    let points: Vec<_> = (0..10).map(|_| rest(190)).collect(); // The first point is 0.018 rad away.
    rig.execute(&points);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}
