//! Tests of the check of a trajectory (J-36). The controller checks a trajectory when it is loaded, and again when it is executed, because
//! conditions may have changed.
use crate::rig;

use jtc_core::check::Quantity;
use jtc_core::{Config, ControllerState, TrajectoryState, Violation};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};
use rig::{Rig, floats, point, rad, rest, segment_body};

/// Returns a rig whose upper and lower position limits have different magnitudes. Its other limits are so high that
/// they have no effect.
fn rig() -> Rig {
    let mut config = Config::avena();
    for joint in &mut config.joints {
        (joint.position_min, joint.position_max) = (-0.5, 1.2);
        (joint.acceleration_max, joint.torque_max, joint.position_error_max) = (8.0, 1e6, 10.0);
    }
    Rig::holding_with(config)
}

fn load(rig: &mut Rig, segment: u16, segments: u16, points: &[RawPoint]) -> DataStatus {
    rig.ask(FrameType::Trajectory, &segment_body(7, segment, segments, 100, points))
}

/// Returns the cause of the last refusal: the point, the joint and the quantity.
fn why(rig: &Rig) -> Option<(u32, usize, Quantity)> {
    rig.controller.violation().map(|v| (v.point, v.joint, v.quantity))
}

#[test]
fn j36_what_no_path_may_do_is_refused_when_it_is_loaded() {
    use Quantity::*;
    let still = rest(0);
    for (points, expected) in [
        (vec![still, point(1, -0.51, 0.0, 0.0), still], (1, Position)),
        (vec![still, point(1, 1.21, 0.0, 0.0), still], (1, Position)),
        (vec![still, point(1, 0.0, 1.55, 0.0), still], (1, Velocity)),
        (vec![still, point(1, 0.0, 0.0, 9.0), still], (1, Acceleration)),
        (vec![still, point(1, 0.1, 0.0, 0.0), still], (0, PositionSpeed)),
        (vec![point(1, 0.0, 0.03, 0.0), still], (0, Rest)),
        (vec![still, point(1, 0.0, 0.03, 0.0)], (1, Rest)),
    ] {
        let mut rig = rig();
        assert_eq!(load(&mut rig, 0, 1, &points), DataStatus::IncorrectValue, "{expected:?}");
        assert_eq!(why(&rig), Some((expected.0, 1, expected.1)));
        assert_eq!(
            (rig.trajectory(), rig.exec(ExecCommand::Execute)),
            (TrajectoryState::Null, DataStatus::NotAllowed)
        );
        assert_eq!(load(&mut rig, 0, 1, &[still, still]), DataStatus::NoError);
        assert_eq!((rig.trajectory(), why(&rig)), (TrajectoryState::Stop, None));
    }
    let mut rig = rig();
    assert_eq!(load(&mut rig, 0, 1, &[still, point(1, 0.0, 0.0, 0.0), still]), DataStatus::NoError);
}

#[test]
fn j30_a_refused_segment_0_leaves_the_old_trajectory_as_it_was() {
    let mut rig = rig();
    let good: Vec<_> = (0..40).map(|i| point(2, 0.0005 * f64::from(i), 0.0, 0.0)).collect();
    assert_eq!(load(&mut rig, 0, 1, &good), DataStatus::NoError);
    // The refused trajectory has as many points as the stored trajectory, and must not overwrite any of its points.
    let mut bad = vec![point(2, 0.015, 0.0, 0.0); 39];
    bad.push(point(2, 3.0, 0.0, 0.0));
    assert_eq!(load(&mut rig, 0, 1, &bad), DataStatus::IncorrectValue);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    for (i, p) in good.iter().enumerate().skip(1) {
        rig.until(1000, |r| r.controller.telemetry().point == 100 * i as u32);
        assert_eq!(rig.controller.telemetry().joints[2].set_position, rad(p.position[2]));
    }
}

#[test]
fn j30_the_right_segment_can_follow_one_that_was_refused() {
    let mut rig = rig();
    let at = |q| point(3, q, 0.0, 0.0);
    assert_eq!(load(&mut rig, 0, 2, &[at(0.0), at(0.02)]), DataStatus::NoError);
    // The motion from the last point of a segment to the first point of the next segment is also part of the path.
    assert_eq!(load(&mut rig, 1, 2, &[at(0.2), at(0.2)]), DataStatus::IncorrectValue);
    assert_eq!(why(&rig), Some((1, 3, Quantity::PositionSpeed)));
    assert_eq!(load(&mut rig, 1, 2, &[at(0.04), point(3, 0.05, 0.2, 0.0)]), DataStatus::IncorrectValue);
    assert_eq!(why(&rig), Some((3, 3, Quantity::Rest)), "only the last segment has the last point");
    assert_eq!(load(&mut rig, 1, 2, &[at(0.04), at(0.05)]), DataStatus::NoError);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.controller.telemetry().joints[3].set_position, rad(at(0.05).position[3]));
}

#[test]
fn j30_points_of_a_segment_that_loses_holdpos_do_not_count() {
    let mut rig = rig();
    rig.send(FrameType::Trajectory, &segment_body(7, 0, 1, 100, &vec![rest(0); 1500]));
    rig.run(34);
    rig.safety_input = false;
    rig.run(2);
    assert_eq!(rig.statuses.last().unwrap().response.data, DataStatus::NotAllowed);
    rig.safety_input = true;
    rig.clear(true, 0);
    rig.until(500, |r| r.state() == ControllerState::HoldPos);
    assert_eq!(
        (rig.trajectory(), rig.exec(ExecCommand::Execute)),
        (TrajectoryState::Null, DataStatus::NotAllowed)
    );
    // The controller has discarded the whole trajectory, so a later segment cannot continue it.
    let second = segment_body(7, 1, 2, 100, &[rest(0)]);
    assert_eq!(rig.ask(FrameType::Trajectory, &second), DataStatus::IncorrectSegmentOrder);
}

#[test]
fn j36_the_verdict_on_the_longest_segment_comes_within_40_ms() {
    for (n, last) in [(1500, rest(0)), (1500, point(0, 2.0, 0.0, 0.0)), (500, rest(0)), (1, rest(0))] {
        let mut rig = rig();
        let mut points = vec![rest(0); n - 1];
        points.push(last);
        rig.send(FrameType::Trajectory, &segment_body(7, 0, 1, 10, &points));
        let before = rig.statuses.len();
        let kind = FrameType::Trajectory as u8;
        let ticks = rig.until(40, |r| r.statuses[before..].iter().any(|s| s.response.frame_type == kind));
        assert!(ticks <= 39, "{n} points: {ticks}");
    }
}

/// Returns friction tables of six joints with these velocities and temperatures.
fn table(low: f32, high: f32, cold: f32, warm: f32) -> Vec<u8> {
    let axis = |from: f32, to: f32| (0..20).map(move |i| from + (to - from) * i as f32 / 19.0);
    floats(
        (0..6).flat_map(|_| axis(low, high).chain(axis(cold, warm)).chain((0..400).map(|i| (i % 20) as f32))),
    )
}

/// Returns the points of a motion in which joint 4 moves out and back with a peak speed of `v` rad/s, at rest at both ends.
fn swing(v: f64) -> Vec<RawPoint> {
    [0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0].map(|share| point(4, 0.0, share * v, 0.0)).to_vec()
}

#[test]
fn j36_velocities_outside_the_friction_table_are_refused_at_loading_and_at_execute() {
    let mut rig = rig();
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-0.3, 0.4, 0.0, 60.0)), DataStatus::NoError);
    assert_eq!(load(&mut rig, 0, 1, &swing(0.35)), DataStatus::IncorrectValue);
    assert_eq!(why(&rig), Some((6, 4, Quantity::FrictionVelocity)), "the table ends sooner below zero");
    assert_eq!(load(&mut rig, 0, 1, &swing(0.25)), DataStatus::NoError);
    // After the trajectory, the host loads friction tables with a smaller range of velocities. The controller must
    // therefore refuse Execute.
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-0.3, 0.2, 0.0, 60.0)), DataStatus::NoError);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::IncorrectValue);
    assert_eq!(why(&rig), Some((2, 4, Quantity::FrictionVelocity)));
    rig.run(300);
    assert_eq!(
        (rig.state(), rig.trajectory()),
        (ControllerState::HoldPos, TrajectoryState::Stop),
        "nothing moves"
    );
    // The friction polynomial has no limited range of velocities.
    assert_eq!(rig.ask(FrameType::FrictionPolynomialUseDefault, &[]), DataStatus::NoError);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(2000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j36_a_new_table_in_pause_is_asked_before_the_path_goes_on() {
    let mut rig = rig();
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-0.4, 0.4, 0.0, 60.0)), DataStatus::NoError);
    assert_eq!(load(&mut rig, 0, 1, &swing(0.3)), DataStatus::NoError);
    rig.exec(ExecCommand::Execute);
    rig.until(1000, |r| r.controller.telemetry().point == 50);
    rig.exec(ExecCommand::Pause);
    rig.until(1000, |r| r.trajectory() == TrajectoryState::Pause);
    rig.run(2);
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-0.2, 0.2, 0.0, 60.0)), DataStatus::NoError);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::IncorrectValue);
    assert_eq!((rig.trajectory(), rig.state()), (TrajectoryState::Pause, ControllerState::HoldPos));
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-0.4, 0.4, 0.0, 60.0)), DataStatus::NoError);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(3000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j36_temperature_is_asked_at_execute_and_j42_in_motion_the_nearest_column_is_used() {
    let mut rig = rig();
    assert_eq!(rig.ask(FrameType::FrictionTable, &table(-1.0, 1.0, 20.0, 58.0)), DataStatus::NoError);
    rig.nodes[4].report.temperature = 19;
    rig.run(5);
    assert_eq!(
        load(&mut rig, 0, 1, &swing(0.3)),
        DataStatus::NoError,
        "a path may be loaded into a cold arm"
    );
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::IncorrectValue);
    let Some(Violation { joint, quantity, value, limit, .. }) = rig.controller.violation() else { panic!() };
    assert_eq!((*joint, *quantity, *value, *limit), (4, Quantity::FrictionTemperature, 19.0, 20.0));
    for (temperature, column) in [(20, 0.0), (58, 19.0)] {
        rig.nodes[4].report.temperature = temperature;
        rig.run(5);
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        rig.until(1000, |r| r.controller.telemetry().point == 150);
        assert!((rig.controller.telemetry().joints[4].torque_friction - column).abs() < 1e-6);
        // During the motion, the joint temperature leaves the range of the friction table.
        rig.nodes[4].report.temperature = if temperature == 20 { 251 } else { 70 };
        rig.run(20);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Operate, 0));
        assert!((rig.controller.telemetry().joints[4].torque_friction - column).abs() < 1e-6);
        rig.until(2000, |r| r.trajectory() == TrajectoryState::Finish);
        assert_eq!(rig.errors(), 0);
        assert_eq!(
            rig.exec(ExecCommand::Execute),
            DataStatus::IncorrectValue,
            "and again when it starts anew"
        );
    }
}

#[test]
fn j42_friction_acts_at_the_commanded_velocity_not_at_the_measured_one() {
    let mut rig = rig();
    // In this friction table, the torque depends only on the velocity. The torque is equal to the index of its row.
    let rows = floats((0..6).flat_map(|_| {
        let axis = |from: f32, to: f32| (0..20).map(move |i| from + (to - from) * i as f32 / 19.0);
        axis(-0.95, 0.95).chain(axis(0.0, 60.0)).chain((0..400).map(|i| (i / 20) as f32))
    }));
    assert_eq!(rig.ask(FrameType::FrictionTable, &rows), DataStatus::NoError);
    assert_eq!(load(&mut rig, 0, 1, &swing(0.3)), DataStatus::NoError);
    // The measured velocity is far outside the friction table. The controller must use the commanded velocity, and
    // must not look up the measured velocity in the table.
    rig.nodes[4].report.velocity = -1.2;
    rig.exec(ExecCommand::Execute);
    for at in [130, 250, 420, 610] {
        rig.until(1000, |r| r.controller.telemetry().point == at);
        let joint = rig.controller.telemetry().joints[4];
        let row = (joint.set_velocity + 0.95) / 0.1;
        assert!((joint.torque_friction - row).abs() < 1e-3, "{joint:?}");
    }
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j34_the_start_is_checked_again_when_every_joint_is_enabled() {
    for (away, trajectory) in [
        (0.015, TrajectoryState::Finish),
        (-0.015, TrajectoryState::Finish),
        (0.025, TrajectoryState::Stop),
        (-0.025, TrajectoryState::Stop),
    ] {
        let mut rig = Rig::new(Config::avena());
        // Enabling a drive takes a long time, and the arm sags during this time.
        rig.nodes[5].slow_enable = true;
        rig.defaults();
        rig.until(300, |r| r.state() == ControllerState::HoldPos);
        assert_eq!(load(&mut rig, 0, 1, &[rest(0), rest(0)]), DataStatus::NoError);
        rig.follow = false;
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        rig.run(50);
        assert_eq!(
            (rig.state(), rig.trajectory()),
            (ControllerState::Operate, TrajectoryState::Execute),
            "it waits"
        );
        for mm in 1..=100 {
            rig.nodes[5].report.position = away * f64::from(mm) / 100.0;
            rig.tick();
        }
        rig.follow = true;
        rig.nodes[5].report.state = jtc_bus::NodeState::ENABLED;
        rig.until(1000, |r| r.trajectory() != TrajectoryState::Execute);
        assert_eq!((rig.trajectory(), rig.errors()), (trajectory, 0), "{away} rad away");
        if trajectory == TrajectoryState::Stop {
            let held = rig.controller.telemetry().joints[5].set_position;
            assert!((held - away).abs() < 1e-3, "nothing moves: {held}");
        }
    }
}

/// For trajectory files that are already in use, the result of the check must not change. These files have 19 columns
/// of int16, and their points are 10 ms apart.
#[test]
fn j36_the_existing_trajectories_keep_their_verdicts() {
    for (name, passes) in [("TrajectoryInt.csv", true), ("TrajectoryInt_Long.csv", false)] {
        let Some(points) = test_kit::existing::points(name) else { continue };
        let points: Vec<RawPoint> = points
            .into_iter()
            .map(|[position, velocity, acceleration]| RawPoint { position, velocity, acceleration })
            .collect();
        let mut rig = Rig::holding();
        let chunks: Vec<_> = points.chunks(500).collect();
        let answers: Vec<_> = (0u16..)
            .zip(&chunks)
            .map(|(i, chunk)| {
                let body = segment_body(7, i, chunks.len() as u16, 10, chunk);
                rig.ask(FrameType::Trajectory, &body)
            })
            .take_while(|&answer| answer == DataStatus::NoError)
            .collect();
        assert_eq!(
            (answers.len() == chunks.len(), rig.trajectory() == TrajectoryState::Stop),
            (passes, passes),
            "{name}"
        );
        if !passes {
            let v = rig.controller.violation().expect("kept");
            assert_eq!((v.point, v.quantity), (1053, Quantity::PositionSpeed), "{v:?}");
        }
    }
}

/// Returns a path of joint 2 from `from` to `to` in 1.5 s, at rest at both ends, with points 10 ms apart.
fn quintic(from: f64, to: f64) -> Vec<RawPoint> {
    (0..=150)
        .map(|k| {
            let (u, way, seconds) = (f64::from(k) / 150.0, to - from, 1.5);
            let q = from + way * u.powi(3) * (10.0 + u * (6.0 * u - 15.0));
            let v = way * 30.0 * u.powi(2) * (1.0 - u).powi(2) / seconds;
            let a = way * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (seconds * seconds);
            point(1, q, v, a)
        })
        .collect()
}

/// Returns a rig whose joint 2 is at rest at `at`. The position limits of joint 2 are -0.55 and 1.15 rad.
fn standing(at: f64) -> Rig {
    let mut config = Config::avena();
    (config.joints[1].position_min, config.joints[1].position_max) = (-0.55, 1.15);
    (config.joints[1].torque_max, config.joints[1].position_error_max) = (1e6, 10.0);
    let mut rig = Rig::new(config);
    rig.follow = false;
    rig.nodes[1].report.position = at;
    rig.defaults();
    rig.run(700);
    rig.follow = true;
    assert_eq!(rig.state(), ControllerState::HoldPos);
    rig
}

/// Executes a path to its end. Returns the lowest and the highest set position of joint 2.
fn executed(rig: &mut Rig, points: &[RawPoint]) -> (f64, f64) {
    for (n, part) in points.chunks(60).enumerate() {
        let body = segment_body(3, n as u16, points.len().div_ceil(60) as u16, 10, part);
        assert_eq!(
            rig.ask(FrameType::Trajectory, &body),
            DataStatus::NoError,
            "{:?}",
            rig.controller.violation()
        );
    }
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    let mut ends = (f64::INFINITY, f64::NEG_INFINITY);
    rig.until(5_000, |rig| {
        let set = rig.controller.telemetry().joints[1].set_position;
        ends = (ends.0.min(set), ends.1.max(set));
        rig.trajectory() != TrajectoryState::Execute
    });
    let status = rig.status();
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Finish, 0));
    assert_eq!((status.occurred, status.joints[1].internal_occurred), (0, 0));
    ends
}

/// The wire format cannot represent these position limits exactly. The nearest positions in the wire format are
/// 1.150041 and -0.550044 rad, which are outside the limits. The controller must still execute a path that ends on a
/// limit.
#[test]
fn j36_j43_a_path_that_ends_on_a_limit_is_executed() {
    for limit in [1.15, -0.55] {
        let mut rig = standing(limit - 0.4 * f64::signum(limit));
        let points = quintic(limit - 0.4 * f64::signum(limit), limit);
        let last = points.last().unwrap().position_rad()[1];
        assert!((last - limit) * limit > 0.0 && (last - limit).abs() < 96e-6, "{last}");
        let ends = executed(&mut rig, &points);
        let reached = if limit > 0.0 { ends.1 } else { ends.0 };
        assert!(
            (last - limit).abs() <= (reached - limit).abs() && (reached - limit).abs() < 96e-6,
            "{ends:?}"
        );
        assert_eq!(rig.controller.telemetry().joints[1].set_position, last);
        // The controller also executes the path back from the limit.
        executed(&mut rig, &quintic(limit, limit - 0.3 * f64::signum(limit)));
    }
}

/// An arm without brakes falls to its end stop, and the host moves the arm away from the end stop. The controller
/// must execute this path although it begins outside the limits.
#[test]
fn j36_j58_a_path_from_outside_the_limits_inwards_is_executed() {
    for plain in [true, false] {
        for (from, to) in [(1.1695, 0.8), (1.1695, 1.15), (1.162, 1.156), (-0.5695, 0.0), (-0.56, -0.56)] {
            let mut rig = standing(from);
            rig.plain = plain;
            let points = quintic(from, to);
            let (low, high) = executed(&mut rig, &points);
            // The start position has an error of at most one step of the wire format.
            let (lowest, highest) = (from.min(to) - 97e-6, from.max(to) + 97e-6);
            assert!(low >= lowest && high <= highest, "{from} to {to}: {low}..{high}");
        }
    }
    // The controller must refuse a path that moves further out of the limits, or that begins too far outside.
    for (from, to) in [(1.165, 1.169), (-0.555, -0.56), (1.175, 0.8), (-0.575, 0.0)] {
        let mut rig = standing(from);
        let body = segment_body(3, 0, 1, 10, &quintic(from, to));
        assert_eq!(rig.ask(FrameType::Trajectory, &body), DataStatus::IncorrectValue);
        let violation = rig.controller.violation().copied().expect("kept");
        let limit = if from > 0.0 { 1.15 } else { -0.55 };
        assert_eq!((violation.joint, violation.quantity, violation.limit), (1, Quantity::Position, limit));
    }
}

/// The points in memory change after the check. The check cannot detect this error, but the controller detects the error in motion.
#[test]
fn j43_beyond_what_is_tolerated_a_position_ends_the_motion() {
    let mut points = quintic(0.8, 1.15);
    // The points are moved by two steps after the check, so that only the supervision in motion can detect the error.
    let mut rig = standing(0.8);
    assert_eq!(rig.ask(FrameType::Trajectory, &segment_body(3, 0, 1, 10, &points)), DataStatus::NoError);
    points.iter_mut().skip(140).for_each(|point| point.position[1] += 2);
    rig.controller.put_points(0, &points);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(5_000, |rig| rig.trajectory() != TrajectoryState::Execute);
    assert_eq!(rig.trajectory(), TrajectoryState::Pause);
    assert_eq!(rig.status().joints[1].internal_occurred, jtc_core::joint_error::POSITION);
}
