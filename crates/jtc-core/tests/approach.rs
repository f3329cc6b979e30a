//! Tests of the approach to a path, and of stops on the path. The state of a motion must not remain stored after this motion.
use crate::{plant, rig};

use jtc_core::{Config, ControllerState, Parameters, Payload, TrajectoryState, joint_error};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, UrgentCommand};
use plant::{LuGre, Plant, Random, highest, loaded, pose, shares};
use rig::{Rig, floats, model_body, raw, segment_body};

/// Returns the points of a motion with at most 0.1 rad/s that is at rest at both ends.
fn points() -> Vec<RawPoint> {
    (0..200)
        .map(|k| {
            let mut p = RawPoint::default();
            let v = if k == 0 || k == 199 { 0.0 } else { 0.1 };
            p.position[1] = (0.001 * f64::from(k) / 3.141592 * 32767.0) as i16;
            p.velocity[1] = (v / 6.283185 * 32767.0) as i16;
            p
        })
        .collect()
}

/// After a pause, the controller waits until the arm is at rest. When Teaching begins, the controller no longer
/// waits, because a hand then moves the joints. The motion in Teaching must not cause an error.
#[test]
fn j33_the_end_of_a_pause_is_no_matter_of_teaching() {
    let mut rig = Rig::holding();
    rig.move_along(&points(), 500);
    rig.urgent(0, UrgentCommand::Pause);
    // The arm still moves a little when path time is at rest.
    rig.nodes[1].report.velocity = 0.05;
    rig.until(600, |r| r.trajectory() == TrajectoryState::Pause);
    rig.run(2);
    rig.send(FrameType::TeachingModeEnable, &[]);
    rig.until(450, |r| r.state() == ControllerState::Teaching);
    rig.follow = false;
    rig.nodes[1].report.velocity = 0.4;
    for ms in 0..2_000 {
        rig.nodes[1].report.position += 0.0004;
        rig.tick();
        assert_eq!((rig.state(), rig.errors()), (ControllerState::Teaching, 0), "{ms} ms");
    }
}

/// After a Stop or a Pause, the controller must hold the arm. A Stop and a Pause therefore also cancel a teach request that waits until the
/// arm is at rest.
#[test]
fn j33_j25_a_stop_or_a_pause_ends_teaching_and_one_that_is_waited_for() {
    for command in [ExecCommand::Stop, ExecCommand::Pause] {
        for taught_ms in [0, 5, 1_000] {
            let mut rig = Rig::holding();
            if taught_ms < 1_000 {
                // Teaching does not begin while a joint moves.
                rig.nodes[1].report.velocity = 0.05;
            }
            assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), DataStatus::NoError);
            rig.run(taught_ms);
            assert_eq!(rig.exec(command), DataStatus::NoError, "{command:?} after {taught_ms} ms");
            rig.nodes[1].report.velocity = 0.0;
            rig.run(12_000);
            assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0), "{command:?} {taught_ms}");
            // The second Stop or Pause has no effect, because the arm is already stopped.
            assert_eq!(rig.exec(command), DataStatus::NotAllowed);
        }
    }
}

/// If the host sends a Pause while a Stop slows the arm down, the controller refuses the Pause, and the Stop
/// continues.
#[test]
fn j33_a_pause_while_a_stop_slows_the_arm_down_leaves_it_a_stop() {
    for ms in [1, 20, 100, 180] {
        let mut rig = Rig::holding();
        rig.move_along(&points(), 500);
        rig.urgent(0, UrgentCommand::Stop);
        rig.run(ms);
        assert_eq!(rig.trajectory(), TrajectoryState::Execute);
        assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NotAllowed, "{ms} ms");
        rig.until(520, |r| r.trajectory() != TrajectoryState::Execute);
        assert_eq!(rig.trajectory(), TrajectoryState::Stop, "{ms} ms");
    }
}

/// A person who touches the arm after a pause moves it slightly. The controller must continue to hold the arm,
/// because only path time that does not come to rest is an error.
#[test]
fn j33_an_arm_that_is_touched_after_a_pause_is_not_dropped() {
    let mut rig = Rig::holding();
    rig.move_along(&points(), 500);
    rig.exec(ExecCommand::Pause);
    rig.nodes[1].report.velocity = 0.05;
    rig.run(2_000);
    assert_eq!(
        (rig.state(), rig.trajectory(), rig.errors()),
        (ControllerState::HoldPos, TrajectoryState::Pause, 0)
    );
}

/// The approach to the first point may be faster than the path, and faster than the friction table allows.
#[test]
fn j36_the_way_to_the_first_point_is_not_judged_by_the_table() {
    let mut rig = Rig::new(Config::avena());
    rig.follow = false;
    rig.nodes[1].report.position = 0.0195;
    rig.defaults();
    rig.run(300);
    rig.follow = true;
    let mut table = Vec::new();
    for _ in 0..6 {
        table.extend((0..20).map(|i| -0.15 + 0.3 * i as f32 / 19.0));
        table.extend((0..20).map(|i| 5.0 * i as f32));
        table.extend([0.0; 400]);
    }
    assert_eq!(rig.ask(FrameType::FrictionTable, &floats(table)), DataStatus::NoError);
    rig.execute(&points());
    rig.until(5_000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.errors(), 0);
}

/// After a Stop or a Pause during the approach, the arm slows down at once and comes to rest before it reaches the first point. The next
/// Execute begins an approach at that position.
#[test]
fn j33_j34_a_stop_on_the_way_to_the_first_point_leaves_the_arm_beside_it() {
    for (command, trajectory) in
        [(UrgentCommand::Stop, TrajectoryState::Stop), (UrgentCommand::Pause, TrajectoryState::Pause)]
    {
        for (start, after_ms) in [(0.019, 60), (0.4, 60), (0.4, 200), (0.49, 400)] {
            let mut rig = Rig::new(Config { start_tolerance_rad: 0.5, ..Config::avena() });
            rig.follow = false;
            rig.nodes[1].report.position = start;
            rig.defaults();
            rig.run(300);
            rig.follow = true;
            rig.execute(&points());
            let set = |rig: &Rig| {
                let joint = rig.controller.telemetry().joints[1];
                (joint.set_position, joint.set_velocity)
            };
            rig.until(1_000, |r| set(r).1 != 0.0);
            rig.run(after_ms);
            let (at, speed) = set(&rig);
            rig.urgent(0, command);
            let mut fastest = 0.0f64;
            let ticks = rig.until(520, |r| {
                fastest = fastest.max(set(r).1.abs());
                r.trajectory() == trajectory
            });
            let rest = set(&rig).0;
            assert!(ticks <= 230, "{start} after {after_ms} ms: {ticks} ms");
            // While path time begins to slow down, the arm may still accelerate a little, as on a path.
            assert!(fastest < speed.abs() + 0.4, "{start} after {after_ms} ms: {speed} {fastest} rad/s");
            assert!(0.0 < rest && rest <= at, "{start} after {after_ms} ms: {at} {rest} rad");
            assert!(at - rest < 0.13 * fastest + 1e-3, "{start} after {after_ms} ms: {at} {rest} rad");
            rig.run(100);
            assert_eq!((rig.state(), rig.errors(), set(&rig)), (ControllerState::HoldPos, 0, (rest, 0.0)));
            assert_eq!(rig.status().point, 0);
            rig.exec(ExecCommand::Execute);
            rig.until(5_000, |r| r.trajectory() == TrajectoryState::Finish);
            assert_eq!(rig.errors(), 0);
        }
    }
}

/// A simulated arm with a load that the controller knows begins paths in random poses. The first point is as far away
/// as the tolerance permits (0.02 or 0.3 rad). During the approach, no torque may reach its limit. Execute may be
/// refused only if little torque remains for an approach.
#[test]
fn j34_an_approach_never_takes_all_the_torque_in_any_pose() {
    let seed = 13;
    println!("seed {seed}");
    let mut random = Random(seed);
    let (mut refused, mut most, mut longest) = (0, 0.0_f64, 0);
    for trial in 0..500 {
        let mass = [0.0, 2.0, 4.0][trial % 3];
        let (pose, standing) = pose(&mut random, mass, 0.97);
        let tolerance = [0.02, 0.3][trial % 2];
        let payload = Payload { mass, ..Payload::NONE };
        let config = Config { payload, start_tolerance_rad: tolerance, ..Config::avena() };
        let ranges: [_; 6] = core::array::from_fn(|j| config.position_range(j));
        let mut arm = Plant::new(&loaded(Parameters::avena().model, mass), LuGre::of_avena_times(1.0), pose);
        let mut rig = arm.holding(config);
        arm.brakes = false;
        arm.run(&mut rig, 500);
        let mut rest = RawPoint::default();
        for (j, (low, high)) in ranges.into_iter().enumerate() {
            let aside = 0.95 * tolerance * random.between(-1.0, 1.0);
            rest.position[j] = raw((arm.q[j] + aside).clamp(low, high), 3.141592);
        }
        rig.send(FrameType::Trajectory, &segment_body(1, 0, 1, 10, &[rest; 10]));
        arm.run(&mut rig, 100);
        let about =
            format!("trial {trial}: {mass} kg, {tolerance} rad from {pose:.2?}, {standing:.2?} at rest");
        rig.send(FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
        let (mut highest_torque, mut ticks) = (0.0_f64, 0);
        arm.run(&mut rig, 5);
        if rig.trajectory() == TrajectoryState::Stop {
            refused += 1;
            assert!(highest(&standing) > 0.75, "{about}: refused");
            continue;
        }
        while rig.trajectory() == TrajectoryState::Execute {
            arm.tick(&mut rig);
            assert_eq!(rig.errors(), 0, "{about}");
            highest_torque = highest_torque.max(highest(&shares(&rig.torque)));
            ticks += 1;
        }
        assert_eq!(rig.trajectory(), TrajectoryState::Finish, "{about}");
        assert!(highest_torque < 0.995, "{about}: {highest_torque} of a limit after {ticks} ms");
        (most, longest) = (most.max(highest_torque), longest.max(ticks));
    }
    println!("{refused} of 500 refused; at most {:.0} % of a torque limit, {longest} ms", 100.0 * most);
}

/// A joint needs 98 % of its torque limit to hold its position, and its friction needs more than the remaining torque. Execute is refused
/// with data status 8, as for an arm at another position, so the joint does not move.
#[test]
fn j34_an_approach_for_which_too_little_torque_is_left_is_refused() {
    let holds = Parameters::avena().model;
    let pose = [0.0, 1.4, 0.2, 0.0, 0.0, 0.0];
    let standing = plant::standing(&holds, &pose)[1];
    for (share, answer) in [(0.5, DataStatus::NoError), (0.98, DataStatus::StartPositionMismatch)] {
        let mut config = Config::avena();
        config.joints[1].torque_max = standing.abs() / share;
        let mut rig = Rig::held_at(config, pose);
        assert_eq!((rig.state(), rig.errors()), (ControllerState::HoldPos, 0));
        let mut rest = RawPoint { position: pose.map(|q| raw(q, 3.141592)), ..RawPoint::default() };
        // The approach goes upwards, against gravity.
        rest.position[1] -= raw(0.015, 3.141592);
        assert_eq!(
            rig.ask(FrameType::Trajectory, &segment_body(1, 0, 1, 10, &[rest; 10])),
            DataStatus::NoError
        );
        assert_eq!(rig.exec(ExecCommand::Execute), answer, "{share}");
        rig.run(300);
        let stays = rig.trajectory() == TrajectoryState::Stop;
        assert_eq!(stays, answer != DataStatus::NoError, "{share}");
    }
}

/// A path can begin outside a position limit only if the arm is already there (J-36). If the arm is inside its
/// limits, the approach must not move it beyond a limit, for any start tolerance.
#[test]
fn j34_j36_an_approach_leads_no_joint_out_of_its_range() {
    for (at, first, tolerance, answer) in [
        (1.149, 1.168, 0.02, DataStatus::StartPositionMismatch),
        (1.14, 1.62, 0.5, DataStatus::StartPositionMismatch),
        (1.168, 1.168, 0.02, DataStatus::NoError),
        (1.168, 1.16, 0.02, DataStatus::NoError),
        (1.16, 1.149, 0.02, DataStatus::NoError),
    ] {
        let mut config = Config { start_tolerance_rad: tolerance, ..Config::avena() };
        let limit = 1.15;
        config.joints[1].position_max = limit;
        let mut rig = Rig::held_at(config, [0.0, at, 0.0, 0.0, 0.0, 0.0]);
        let mut inwards: Vec<RawPoint> = points();
        for (k, point) in inwards.iter_mut().enumerate() {
            point.position[1] = raw(first - 0.001 * k as f64, 3.141592);
            point.velocity[1] = -point.velocity[1];
        }
        rig.upload(&inwards, 10);
        assert_eq!(rig.exec(ExecCommand::Execute), answer, "{at} {first}");
        let mut furthest = f64::MIN;
        for _ in 0..4_000 {
            rig.tick();
            furthest = furthest.max(rig.controller.telemetry().joints[1].set_position);
        }
        assert!(furthest <= at.max(limit) + 2e-4, "{at} {first}: {furthest}");
        let finished = rig.trajectory() == TrajectoryState::Finish;
        assert_eq!((finished, rig.errors()), (answer == DataStatus::NoError, 0), "{at} {first}");
    }
}

/// An arm that is exactly at its paused point can continue, however little torque remains. In an earlier version, a friction table with
/// torque at standstill prevented the continuation.
#[test]
fn j34_a_path_goes_on_where_it_was_paused_with_any_torque_left() {
    let model = Parameters::avena().model;
    let (start, end) = ([0.0, 0.4, 0.2, 0.0, 0.0, 0.0], [0.0, 1.4, 0.2, 0.0, 0.0, 0.0]);
    let held = plant::standing(&model, &end)[1];
    let mut config = Config { delay_ticks: 1, ..Config::avena() };
    let limit = held.abs() / 0.95;
    config.joints[1].torque_max = limit;
    let mut rig = Rig::held_at(config, start);
    let mut table = Vec::new();
    for j in 0..6 {
        table.extend((0..20).map(|i| -1.6 + 3.2 * i as f32 / 19.0));
        table.extend((0..20).map(|i| 5.0 * i as f32));
        table.extend([if j == 1 { 0.03 * (limit * held.signum()) as f32 } else { 0.0 }; 400]);
    }
    assert_eq!(rig.ask(FrameType::FrictionTable, &floats(table)), DataStatus::NoError);
    rig.run(1_000);
    let path: Vec<RawPoint> = (0..=400)
        .map(|k| {
            let u = f64::from(k) / 400.0;
            let mut point = RawPoint { position: start.map(|q| raw(q, 3.141592)), ..RawPoint::default() };
            let (q, v) = (u.powi(3) * (10.0 + u * (6.0 * u - 15.0)), 7.5 * (u * (1.0 - u)).powi(2));
            rig::put(&mut point, 1, 0.4 + q, v, 3.75 * u * (1.0 - u) * (1.0 - 2.0 * u));
            point
        })
        .collect();
    rig.upload(&path, 10);
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
    rig.until(6_000, |rig| rig.controller.telemetry().joints[1].set_position > 1.35);
    assert_eq!(rig.exec(ExecCommand::Pause), DataStatus::NoError);
    rig.until(700, |rig| rig.trajectory() == TrajectoryState::Pause);
    rig.run(100);
    assert_eq!((rig.exec(ExecCommand::Execute), rig.errors()), (DataStatus::NoError, 0));
    rig.until(6_000, |rig| rig.trajectory() == TrajectoryState::Finish);
}

/// An arm at the first point starts on the path at once.
#[test]
fn j34_without_a_distance_there_is_no_approach() {
    for (aside, counts) in [(0, true), (1, false)] {
        let mut rig = Rig::holding();
        let mut path = points();
        path.iter_mut().for_each(|point| point.position[0] = aside);
        rig.execute(&path);
        rig.until(100, |rig| rig.state() == ControllerState::Operate);
        rig.run(100);
        assert_eq!(rig.controller.telemetry().point > 0, counts, "{aside}");
    }
}

/// An arm that is slightly beyond a position limit can move to a path inside its limits.
#[test]
fn j43_an_arm_beyond_a_limit_can_go_to_a_path_inside() {
    let mut config = Config::avena();
    config.joints[1].position_max = 0.0;
    let mut rig = Rig::new(config);
    rig.follow = false;
    rig.nodes[1].report.position = 0.015;
    rig.defaults();
    rig.run(300);
    rig.follow = true;
    let down = |mut p: RawPoint| {
        (p.position[1], p.velocity[1], p.acceleration[1]) =
            (-p.position[1], -p.velocity[1], -p.acceleration[1]);
        p
    };
    let points: Vec<_> = points().into_iter().map(down).collect();
    rig.execute(&points);
    rig.until(5_000, |r| r.trajectory() == TrajectoryState::Finish);
    assert_eq!(rig.status().joints[1].internal_occurred & joint_error::POSITION, 0);
}

/// J-16: an Execute waits for joints that are being enabled, but only for a limited time.
#[test]
fn j16_an_execute_does_not_wait_for_ever() {
    let mut rig = Rig::new(Config::avena());
    rig.defaults();
    rig.follow = false;
    rig.run(5);
    // A hand swings a joint too fast for the joint to be enabled.
    let mut phase = 0.0f64;
    let mut swing = |rig: &mut Rig| {
        phase += 0.001;
        rig.nodes[1].report.position = 0.12 * (4.0 * phase).sin();
        rig.nodes[1].report.velocity = 0.3;
    };
    for _ in 0..400 {
        swing(&mut rig);
        rig.tick();
    }
    let points = points();
    for (i, part) in points.chunks(100).enumerate() {
        let count = points.len().div_ceil(100) as u16;
        rig.send(FrameType::Trajectory, &segment_body(1, i as u16, count, 10, part));
    }
    let (mut sent, mut waited) = (false, 0);
    for _ in 0..30_000 {
        swing(&mut rig);
        if !sent && rig.trajectory() == TrajectoryState::Stop && rig.nodes[1].report.position.abs() < 0.005 {
            rig.send(FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
            sent = true;
        }
        rig.tick();
        waited += u32::from(rig.trajectory() == TrajectoryState::Execute);
    }
    assert!(sent && (9_900..=10_100).contains(&waited), "{waited} ms");
    assert_eq!((rig.trajectory(), rig.errors()), (TrajectoryState::Stop, 0));
}

/// J-06: if a model arrives before the positions of the joints are known, the controller checks this model as soon as the positions are
/// known.
#[test]
fn j06_a_model_of_an_arm_that_cannot_be_held_does_not_end_init() {
    let mut rig = Rig::new(Config::avena());
    let mut model = Parameters::avena().model;
    // The lengths in this model are in millimetres, but the controller takes them as metres.
    for joint in &mut model.joints {
        joint.xyz = joint.xyz.map(|x| 1000.0 * x);
    }
    for node in &mut rig.nodes[..6] {
        node.report.position = 0.6;
    }
    rig.follow = false;
    rig.tick();
    rig.send(FrameType::FrictionPolynomialUseDefault, &[]);
    rig.send(FrameType::PidParamUseDefault, &[]);
    assert_eq!(rig.ask(FrameType::ArmModel, &model_body(&model)), DataStatus::NoError);
    for _ in 0..1_000 {
        rig.tick();
        assert_eq!((rig.state(), rig.torque), (ControllerState::Init, [0.0; 6]));
    }
    assert_eq!(rig.status().jtc_init, 0b100, "the model is missing");
    assert_eq!(rig.ask(FrameType::ArmModelUseDefault, &[]), DataStatus::NoError);
    rig.until(500, |r| r.state() == ControllerState::HoldPos);
}

/// The joint has three times the friction of its model, and little torque remains. The approach slows down until the torque suffices, and
/// reaches the point.
#[test]
fn j75_an_approach_that_takes_too_much_torque_is_held_back() {
    let pose = plant::POSES[0];
    for (left, way) in [(16.0, -0.1), (20.0, -0.1), (26.0, -0.2), (35.0, -0.3)] {
        let mut config = Config { start_tolerance_rad: 0.5, ..Config::avena() };
        let held = plant::standing(&Parameters::avena().model, &pose)[1].abs();
        config.joints[1].torque_max = held + LuGre::avena(1, 1.2).coulomb + left;
        let mut arm = Plant::new(&Parameters::avena().model, LuGre::of_avena_times(3.0), pose);
        let mut rig = arm.holding(config);
        arm.brakes = false;
        arm.run(&mut rig, 3_500);
        let mut rest = RawPoint::default();
        for j in 0..6 {
            rest.position[j] = raw(arm.q[j] + if j == 1 { way } else { 0.0 }, 3.141592);
        }
        rig.send(FrameType::Trajectory, &segment_body(1, 0, 1, 10, &[rest; 10]));
        arm.run(&mut rig, 100);
        rig.send(FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
        let (mut ms, mut at_limit_ms) = (0, 0);
        while rig.trajectory() != TrajectoryState::Finish {
            arm.tick(&mut rig);
            assert_eq!(rig.errors(), 0, "{left} N·m, {way} rad: {:?}", rig.controller.telemetry());
            at_limit_ms +=
                usize::from(rig.torque[1].abs() >= 0.999 * rig.controller.config().joints[1].torque_max);
            ms += 1;
            assert!(ms < 10_000, "{left} N·m, {way} rad: it never arrives");
        }
        let back = rig.controller.reactions().held_back_ms;
        println!(
            "{left} N·m left, {way} rad: {ms} ms, held back for {back} ms, {at_limit_ms} ms at the limit"
        );
        assert!(back > 0, "{left} N·m, {way} rad");
    }
}
