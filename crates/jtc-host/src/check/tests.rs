//! Tests of the check of a trajectory, with generated and existing trajectories.

use jtc_core::Config;

use super::*;
use crate::arm::Arm;
use crate::plan;
use crate::trajectory::{Loaded, Point};

fn smooth() -> Trajectory {
    plan::joint_move(&[0.0; 6], &[0.5, -0.4, 0.3, 0.2, -0.1, 1.0], &Config::avena(), 100.0).unwrap()
}

fn check(t: &Trajectory) -> Verdict {
    Checker::new(&Config::avena()).check(t)
}

#[test]
fn a_planned_move_passes_with_torque_and_start_pose() {
    let arm = Arm::avena();
    let config = arm.config();
    let friction = arm.friction();
    let checker = Checker {
        model: Some(&arm.model),
        friction: friction.as_ref(),
        start: Some([0.001; 6]),
        ..Checker::new(&config)
    };
    let verdict = checker.check(&smooth());
    assert!(verdict.is_ok(), "{verdict}");
    assert!(verdict.joints[1].torque_peak_nm.unwrap() > 1.0);
}

/// J-34: the check compares the start pose with the first point, with the controller's start tolerance.
#[test]
fn j34_the_start_pose_is_checked_with_the_device_s_tolerance() {
    let config = Config::avena();
    let mut start = [0.0; 6];
    start[4] = 0.021;
    let verdict = Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth());
    let [problem] = &verdict.problems[..] else { panic!("{verdict}") };
    assert_eq!((problem.kind, problem.joint), (ProblemKind::StartPose, Joint::from_number(5)));
    assert!(verdict.hint().to_string().contains("--approach"));
    start[4] = 0.019;
    assert!(Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth()).is_ok());
    start[4] = f64::NAN;
    assert!(!Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth()).is_ok());
}

/// J-32: two points are within the limits, but the controller's interpolation exceeds a limit between them. The check
/// must find this.
#[test]
fn j32_limits_are_checked_between_points() {
    let at = |q: f64, v: f64| Point {
        position: [0.0, q, 0.0, 0.0, 0.0, 0.0],
        velocity: [0.0, v, 0.0, 0.0, 0.0, 0.0],
        ..Point::default()
    };
    // Between two points, joint 2 exceeds its position limit (1.57 rad), although its position is 1.5 rad at both
    // points.
    let t =
        Trajectory { step_ms: 1000, points: vec![at(1.5, 0.0), at(1.5, 1.0), at(1.5, -1.0), at(1.5, 0.0)] };
    let verdict = check(&t);
    let over = verdict.problems.iter().find(|p| p.kind == ProblemKind::Position).expect("found");
    assert_eq!((over.joint, over.point), (Joint::from_number(2), 1));
    assert!(over.ms > 0.0 && over.value > 1.57);
}

#[test]
fn jumps_are_named_one_by_one() {
    let mut t = smooth();
    let n = t.points.len();
    for p in &mut t.points[n / 2..] {
        p.position[2] += 1.0;
    }
    let verdict = check(&t);
    let jump = &verdict.problems[0];
    assert_eq!((jump.kind, jump.joint, jump.point), (ProblemKind::Jump, Joint::from_number(3), n / 2 - 1));
    assert!(
        verdict.to_string().contains(&format!("between points {} and {}", n / 2 - 1, n / 2)),
        "{verdict}"
    );
}

#[test]
fn all_problems_are_reported_with_their_worst_place() {
    let mut t = smooth();
    let middle = t.points.len() / 2;
    t.points[middle].velocity[5] = 3.0;
    t.points[3].acceleration[0] = 12.6;
    let kinds: Vec<ProblemKind> = check(&t).problems.iter().map(|p| p.kind).collect();
    assert!(
        kinds.contains(&ProblemKind::Velocity) && kinds.contains(&ProblemKind::AccelerationScale),
        "{kinds:?}"
    );
}

/// With all velocities 0, the arm would stop at every point. The check refuses this trajectory, because its positions
/// change although its velocities are 0.
#[test]
fn channels_that_contradict_each_other_all_along_are_refused() {
    let mut t = smooth();
    t.points.iter_mut().for_each(|p| p.velocity = [0.0; 6]);
    let verdict = check(&t);
    assert!(verdict.refusals().any(|p| p.kind == ProblemKind::VelocityMismatch), "{verdict}");
}

/// J-30: the check refuses too many points or segments.
#[test]
fn j30_counts_are_checked() {
    let t = Trajectory { step_ms: 10, points: vec![Point::default(); 12_001] };
    assert_eq!(check(&t).problems[0].kind, ProblemKind::TooManyPoints);
    let config = Config::avena();
    let few = UploadOptions { points_per_segment: Some(100), ..UploadOptions::default() };
    let t = Trajectory { step_ms: 10, points: vec![Point::default(); 10_001] };
    let verdict = Checker { upload: few, ..Checker::new(&config) }.check(&t);
    assert_eq!(verdict.problems[0].kind, ProblemKind::TooManySegments);
    assert!(
        verdict.hint().to_string().contains("--points-per-segment` from 101 to 1500"),
        "{}",
        verdict.hint()
    );
    assert_eq!(check(&Trajectory::default()).problems[0].kind, ProblemKind::Empty);
}

#[test]
fn torque_along_the_path_is_held_against_the_limits() {
    let arm = Arm::avena();
    let mut config = arm.config();
    config.joints[1].torque_max = 100.0;
    // In the horizontal pose, joint 2 needs about 130 N·m to hold the arm. Its limit in this test is 100 N·m, so the
    // check must refuse the motion.
    let t = plan::joint_move(&[0.0; 6], &[0.0, 1.5, 0.0, 0.0, 0.0, 0.0], &config, 50.0).unwrap();
    let verdict = Checker { model: Some(&arm.model), ..Checker::new(&config) }.check(&t);
    assert_eq!(
        (verdict.problems[0].kind, verdict.problems[0].joint),
        (ProblemKind::Torque, Joint::from_number(2)),
        "{verdict}"
    );
}

/// If two points are too far apart, the check reports that the motion is too fast, and suggests a speed that passes the check.
#[test]
fn a_move_that_is_too_fast_is_named_with_the_speed_that_works() {
    let to = Point { position: [0.0, 0.0, 2.5, 0.0, 0.0, 0.0], ..Point::default() };
    let t = Trajectory { step_ms: 300, points: vec![Point::default(), to] };
    let verdict = check(&t);
    assert_eq!(verdict.problems.len(), 1, "{verdict}");
    assert_eq!(
        (verdict.problems[0].kind, verdict.problems[0].joint),
        (ProblemKind::PositionSpeed, Joint::from_number(3)),
        "{verdict}"
    );
    // The peak velocity is 15/8 of the mean velocity, which is 2.5 rad in 0.3 s. The peak velocity occurs between the points.
    assert!((verdict.joints[2].velocity_peak_rad_s - 15.625).abs() < 0.01);
    assert!(verdict.hint().to_string().contains("--speed 9`"), "{}", verdict.hint());
    let slow = check(&plan::at_speed(&t, 9.0).unwrap());
    assert!(slow.is_ok(), "{slow}");
    // The trajectory was checked at half of the file's own speed. The suggested speed must still be a percentage of
    // the file's own speed.
    let half = check(&plan::at_speed(&t, 50.0).unwrap());
    assert!(
        half.hint_for("my.csv", 50.0).to_string().contains("traj check my.csv --speed 9`"),
        "{}",
        half.hint_for("my.csv", 50.0)
    );
}

#[test]
fn degrees_are_recognised() {
    let mut t = smooth();
    for p in &mut t.points {
        for channel in [&mut p.position, &mut p.velocity, &mut p.acceleration] {
            *channel = channel.map(f64::to_degrees);
        }
    }
    let verdict = check(&t);
    assert!(!verdict.is_ok() && verdict.hint().to_string().contains("degrees"), "{}", verdict.hint());
    assert!(verdict.to_string().lines().count() < 30, "{verdict}");
}

/// A cause summarises the problems of one kind in all joints and points, with the first and the worst occurrence.
#[test]
fn long_lists_are_summed_by_cause() {
    let mut t = smooth();
    let n = t.points.len();
    // Joint 2 is too fast at three points in the middle, and joint 6 at one earlier point.
    for (i, joint, velocity) in [(n / 2, 1, 1.6), (n / 2 + 1, 1, -1.9), (n / 2 + 2, 1, 1.7), (n / 4, 5, 1.8)]
    {
        t.points[i].velocity[joint] = velocity;
    }
    let config = Config::avena();
    let verdict = check(&t);
    let cause = verdict.causes.iter().find(|c| c.kind == ProblemKind::Velocity).expect("found");
    assert_eq!(cause.joints.iter().map(|j| j.number()).collect::<Vec<_>>(), [2, 6]);
    assert_eq!(
        (cause.worst.joint, cause.worst.point, cause.worst.limit),
        (Joint::from_number(2), n / 2 + 1, -1.5),
        "{verdict}"
    );
    assert!((cause.worst.value + 1.9).abs() < 1e-3, "{verdict}");
    // The interpolated velocity exceeds the limit shortly before the point with the high velocity.
    assert_eq!((cause.first.joint, cause.first.point), (Joint::from_number(6), n / 4 - 1), "{verdict}");
    let time = (cause.first.point as f64 * f64::from(t.step_ms) + cause.first.ms) * 1e-3;
    assert_eq!(cause.first.time_s, time);
    assert!((4..=7).contains(&cause.points), "{}", cause.points);
    let text = verdict.to_string();
    assert!(
        text.contains("velocity over its limit: joints 2 and 6, at ")
            && text.contains("    worst: joint 2: "),
        "{text}"
    );
    assert!(text.contains(&format!("({:.3} s)", cause.worst.time_s)), "{text}");
    let kinds: Vec<ProblemKind> = verdict.causes.iter().map(|c| c.kind).collect();
    let once: std::collections::BTreeSet<ProblemKind> = kinds.iter().copied().collect();
    assert_eq!(kinds.len(), once.len(), "{text}");
    assert_eq!(config.joints[1].velocity_max, 1.5);
}

/// J-36: the check refuses every trajectory that the controller refuses.
#[test]
fn j36_nothing_passes_that_the_controller_refuses() {
    let mut t = smooth();
    t.points[20].position[4] += 0.02;
    let verdict = check(&t);
    let bump = verdict.refusals().next().expect("refused");
    assert_eq!((bump.kind, bump.joint), (ProblemKind::PositionSpeed, Joint::from_number(5)), "{verdict}");
    assert!((19..=20).contains(&bump.point) && bump.ms > 0.0, "{verdict}");
    // This position limit is beyond the range of the drives, so the check uses the limit of the drives (2.9905 rad).
    let mut config = Config::avena();
    config.joints[0].position_max = 3.05;
    let mut out = Trajectory { step_ms: 100, points: vec![Point::default(); 3] };
    out.points.iter_mut().for_each(|p| p.position[0] = 3.0);
    let verdict = Checker::new(&config).check(&out);
    assert_eq!((verdict.problems[0].kind, verdict.problems[0].limit), (ProblemKind::Position, 2.9905));
}

/// Returns settings in which each limit of joint 2 lies between two positions that a serial frame can represent. The
/// representable positions nearest to the limits are 1.150041 and −0.550044 rad, slightly outside the limits.
fn between_steps() -> Config {
    let mut config = Config::avena();
    (config.joints[1].position_min, config.joints[1].position_max) = (-0.55, 1.15);
    config
}

/// Returns a motion of joint 2.
fn of_joint_2(from: f64, to: f64) -> Trajectory {
    gentle(&[0.0, from, 0.0, 0.0, 0.0, 0.0], &[0.0, to, 0.0, 0.0, 0.0, 0.0], 2.25)
}

#[test]
fn j36_a_path_that_ends_on_a_limit_passes() {
    let config = between_steps();
    for (from, limit) in [(0.5, 1.15), (0.3, -0.55)] {
        for t in [of_joint_2(from, limit), of_joint_2(limit, from)] {
            let verdict = Checker::new(&config).check(&t);
            assert!(verdict.is_ok() && verdict.problems.is_empty(), "{verdict}");
        }
        // The end of this motion is one step of the serial frame (96 µrad) beyond the limit, so the check refuses the
        // motion.
        let verdict = Checker::new(&config).check(&of_joint_2(from, limit + 96e-6 * f64::signum(limit)));
        let [problem] = &verdict.problems[..] else { panic!("{verdict}") };
        assert_eq!((problem.kind, problem.limit), (ProblemKind::Position, limit));
    }
    // The planner can also plan a motion to the limit. The planned motion ends exactly at the limit.
    let planned = plan::joint_move(&[0.0; 6], &[0.0, 1.15, 0.0, 0.0, 0.0, 0.0], &config, 50.0).unwrap();
    assert_eq!(planned.points.last().unwrap().position[1], 1.15);
}

#[test]
fn j36_what_is_beyond_a_limit_is_named_with_three_digits() {
    let config = between_steps();
    // `excess` is the expected excess over the limit. In the serial frames, the end positions are the raw values 11
    // 997, −5 739, 12 100 and 15 000. The rounding of the velocities changes the interpolated positions by some µrad.
    for (end, excess) in [(1.150233, 0.000233), (-0.550236, 0.000236), (1.160108, 0.0101), (1.438151, 0.288)]
    {
        let verdict = Checker::new(&config).check(&of_joint_2(0.2, end));
        let limit = if end > 0.0 { 1.15 } else { -0.55 };
        for text in [verdict.to_string(), verdict.problems[0].to_string()] {
            let (before, _) = text.split_once(&format!(" rad over the limit {limit})")).expect("it is named");
            let digits = before.rsplit('(').next().unwrap();
            let significant = digits.trim_start_matches(['0', '.']);
            let number: f64 = digits.parse().unwrap();
            assert!((number - excess).abs() < 1e-5 + 5e-3 * excess && significant.len() == 3, "{text}");
        }
    }
}

/// Like the controller, the check accepts a path that starts outside the limits by at most the start tolerance and moves inwards.
#[test]
fn j36_j58_a_path_from_outside_the_limits_inwards_passes() {
    let config = between_steps();
    let verdict = |from: f64, to: f64| {
        let start = Some([0.0, from, 0.0, 0.0, 0.0, 0.0]);
        Checker { start, ..Checker::new(&config) }.check(&of_joint_2(from, to))
    };
    for (from, to) in [(1.1699, 0.5), (1.1699, 1.15), (1.16, 1.155), (-0.5699, 0.3), (-0.56, -0.56)] {
        assert!(verdict(from, to).problems.is_empty(), "{from} to {to}: {}", verdict(from, to));
    }
    for (from, to) in
        [(1.155, 1.157), (-0.56, -0.57), (1.172, 0.5), (-0.572, 0.3), (1.1, 1.155), (-0.4, -0.56)]
    {
        let verdict = verdict(from, to);
        let problem = verdict.refusals().next().expect("refused");
        let limit = if from > 0.0 { 1.15 } else { -0.55 };
        let found = (problem.kind, problem.joint, problem.limit);
        assert_eq!(found, (ProblemKind::Position, Joint::from_number(2), limit), "{from} to {to}");
        assert!((problem.value - limit).abs() > 1e-4, "{from} to {to}: {verdict}");
    }
}

#[test]
fn j36_the_friction_table_bounds_the_speed() {
    let table = jtc_core::Parameters::avena_friction_table();
    let config = Config::avena();
    let with = |speed| {
        let t = plan::joint_move(&[0.0; 6], &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0], &config, speed).unwrap();
        Checker { friction: Some(&table), ..Checker::new(&config) }.check(&t)
    };
    assert!(with(50.0).is_ok(), "{}", with(50.0));
    let verdict = with(80.0);
    let over = verdict.refusals().next().expect("refused");
    assert_eq!((over.kind, over.joint), (ProblemKind::FrictionVelocity, Joint::from_number(4)), "{verdict}");
    assert!(verdict.hint().to_string().contains("--speed"), "{}", verdict.hint());
}

/// Returns a motion along a quintic polynomial that starts and ends at rest.
fn gentle(from: &[f64; 6], to: &[f64; 6], seconds: f64) -> Trajectory {
    let steps = (seconds * 100.0).round() as usize;
    let point = |k: usize| {
        let (u, w) = (k as f64 / steps as f64, 1.0 - k as f64 / steps as f64);
        let of = |j: usize, factor: f64| (to[j] - from[j]) * factor;
        Point {
            position: std::array::from_fn(|j| from[j] + of(j, u * u * u * (10.0 + u * (6.0 * u - 15.0)))),
            velocity: std::array::from_fn(|j| of(j, 30.0 * u * u * w * w / seconds)),
            acceleration: std::array::from_fn(|j| {
                of(j, 60.0 * u * w * (1.0 - 2.0 * u) / (seconds * seconds))
            }),
        }
    };
    Trajectory { step_ms: 10, points: (0..=steps).map(point).collect() }
}

/// J-33: the torque limit is sufficient for the motion, but not to stop the stretched arm while it moves downwards.
/// The check refuses this path.
#[test]
fn j33_a_path_that_cannot_be_stopped_in_time_is_refused() {
    let arm = Arm::avena();
    let mut config = arm.config();
    // The motion passes the horizontal pose at up to 1.1 rad/s, and starts and ends smoothly.
    let t = gentle(&[0.0, 0.2, 0.0, 0.0, 0.0, 0.0], &[0.0, 1.5, 0.0, 0.0, 0.0, 0.0], 2.25);
    let verdict = |config: &Config| Checker { model: Some(&arm.model), ..Checker::new(config) }.check(&t);
    let peak = verdict(&config).joints[1].torque_peak_nm.unwrap();
    assert!(verdict(&config).is_ok(), "{}", verdict(&config));
    // The test sets the torque limit just above the peak torque of the motion.
    config.joints[1].torque_max = peak + 0.5;
    let refused = verdict(&config);
    let stop = refused.refusals().next().expect("refused");
    assert_eq!((stop.kind, stop.joint), (ProblemKind::NoStop, Joint::from_number(2)), "{refused}");
    assert!(stop.value.abs() > stop.limit.abs() && stop.limit.abs() == peak + 0.5, "{refused}");
    assert!(
        refused.hint().to_string().contains("--speed") && refused.hint().to_string().contains("payload"),
        "{}",
        refused.hint()
    );
    // With a stop time of 5 s, the check accepts the path.
    config.stop_ms = 5_000;
    assert!(verdict(&config).is_ok(), "{}", verdict(&config));
}

/// J-43: the check refuses a path on which a joint at rest needs nearly its whole torque limit, because the arm would
/// fall after some time.
#[test]
fn j43_torque_is_in_hand_where_the_arm_stands() {
    let arm = Arm::avena();
    let config = arm.config();
    let (low, high) = ([0.0, 0.7, 0.0, 0.0, 0.0, 0.0], [0.0, 1.1, 0.0, 0.0, 0.0, 0.0]);
    let zero = [0.0; 6];
    let holding = Dynamics::new(&arm.model, config.gravity).inverse(&high, &zero, &zero)[1].abs();
    let below = Dynamics::new(&arm.model, config.gravity).inverse(&low, &zero, &zero)[1].abs();
    assert!(below < 0.9 * holding);
    let there = plan::joint_move(&low, &high, &config, 30.0).unwrap();
    let back = plan::joint_move(&high, &low, &config, 30.0).unwrap();
    let mut both = there.clone();
    both.points.extend(back.points.iter().skip(1));
    let check = |t: &Trajectory, share: f64, start| {
        let mut config = config.clone();
        config.joints[1].torque_max = holding / share;
        Checker { model: Some(&arm.model), start, ..Checker::new(&config) }.check(t)
    };
    let refusal = |t: &Trajectory, share, start| {
        let verdict = check(t, share, start);
        let found = verdict.refusals().find(|p| p.kind == ProblemKind::HoldTorque).cloned();
        found.map(|p| (p.joint, p.point, p.value.abs() > p.limit.abs(), verdict.hint()))
    };
    let last = there.points.len() - 1;
    for share in [0.98, 0.975] {
        let (joint, point, over, hint) = refusal(&there, share, None).expect("at its end");
        // Near its end, the motion is so slow that the arm already counts as at rest. Therefore the problem may be
        // found some points before the last point.
        assert!(
            joint == Joint::from_number(2) && over && (last - 5..=last).contains(&point),
            "{point} of {last}"
        );
        assert!(
            hint.to_string().contains("poses")
                && hint.to_string().contains("payload")
                && !hint.to_string().contains("--speed"),
            "{hint}"
        );
        let (joint, point, ..) = refusal(&both, share, None).expect("where it rests on the way");
        assert!(
            joint == Joint::from_number(2) && (last - 5..=last + 5).contains(&point),
            "{point} of {last}"
        );
        assert!(refusal(&back, share, None).is_some(), "at its start");
        // If the arm is already in the pose with the high holding torque, a motion out of this pose is accepted.
        assert_eq!(refusal(&back, share, Some(high)), None);
        assert!(refusal(&there, share, Some(low)).is_some());
    }
    for t in [&there, &both, &back] {
        assert_eq!(refusal(t, 0.965, None), None);
    }
    let text = check(&there, 0.98, None).to_string();
    assert!(text.contains("joint 2: rest at point") && text.contains("98.0 % of the torque limit"), "{text}");
    // Joint 1 now rotates about the vertical axis while the arm is in the pose with the high holding torque.
    // Therefore the arm is not at rest there, and the check accepts the motion.
    let (n, h) = ((both.points.len() - 1) as f64, f64::from(both.step_ms) * 1e-3);
    for (i, point) in both.points.iter_mut().enumerate() {
        let (sin, cos) = (std::f64::consts::PI * i as f64 / n).sin_cos();
        let omega = std::f64::consts::PI / (n * h);
        point.position[0] = 0.1 * (1.0 - cos);
        point.velocity[0] = 0.1 * omega * sin;
        point.acceleration[0] = 0.1 * omega * omega * cos;
    }
    assert_eq!(refusal(&both, 0.98, None), None);
}

fn load(name: &str) -> Option<Trajectory> {
    let path = test_kit::existing::file(name)?;
    Some(Loaded::load(&path, None).expect("it is read").trajectory)
}

#[test]
fn the_existing_trajectories_pass() {
    let arm = Arm::avena();
    let (config, friction) = (arm.config(), arm.friction());
    for name in ["TrajectoryInt.csv", "TrajectoryFloat.csv"] {
        let Some(t) = load(name) else { continue };
        let checker =
            Checker { model: Some(&arm.model), friction: friction.as_ref(), ..Checker::new(&config) };
        let verdict = checker.check(&t);
        // The trajectory consists of several pieces. At five joins between them, the positions are one sample ahead
        // of the velocities. The check reports only warnings.
        assert!(verdict.is_ok(), "{name}: {verdict}");
        assert!(
            verdict.warnings().all(|p| p.kind == ProblemKind::VelocityMismatch && p.count == 5),
            "{verdict}"
        );
    }
}

#[test]
fn the_existing_long_file_is_refused_by_name() {
    let Some(t) = load("TrajectoryInt_Long.csv") else { return };
    let verdict = check(&t);
    let jumps: Vec<&Problem> = verdict.problems.iter().filter(|p| p.kind == ProblemKind::Jump).collect();
    let mut places: Vec<usize> = jumps.iter().map(|p| p.point).collect();
    places.dedup();
    assert_eq!((places.len(), places[0]), (11, 1053), "{verdict}");
    let worst = jumps.iter().map(|p| p.value.abs()).fold(0.0, f64::max);
    assert!((2.8..3.0).contains(&worst), "{worst}");
    assert!(!verdict.is_ok());
    assert!(verdict.to_string().contains("between points 1053 and 1054"), "{verdict}");
}
