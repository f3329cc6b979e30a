//! Verdicts on made and existing trajectories.

use std::path::Path;

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

/// J-34.
#[test]
fn j34_the_start_pose_is_checked_with_the_device_s_tolerance() {
    let config = Config::avena();
    let mut start = [0.0; 6];
    start[4] = 0.021;
    let verdict = Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth());
    let [problem] = &verdict.problems[..] else { panic!("{verdict}") };
    assert_eq!((problem.kind, problem.joint), (ProblemKind::StartPose, Some(5)));
    assert!(verdict.hint().contains("--approach"));
    start[4] = 0.019;
    assert!(Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth()).is_ok());
    start[4] = f64::NAN;
    assert!(!Checker { start: Some(start), ..Checker::new(&config) }.check(&smooth()).is_ok());
}

/// J-32: both points are within limits, and what the controller computes between them is not.
#[test]
fn j32_limits_are_checked_between_points() {
    let at = |q: f64, v: f64| Point {
        position: [0.0, q, 0.0, 0.0, 0.0, 0.0],
        velocity: [0.0, v, 0.0, 0.0, 0.0, 0.0],
        ..Point::default()
    };
    // A swing over the position limit of joint 2 (1.57 rad) that both points stay below.
    let t =
        Trajectory { step_ms: 1000, points: vec![at(1.5, 0.0), at(1.5, 1.0), at(1.5, -1.0), at(1.5, 0.0)] };
    let verdict = check(&t);
    let over = verdict.problems.iter().find(|p| p.kind == ProblemKind::Position).expect("found");
    assert_eq!((over.joint, over.point), (Some(2), 1));
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
    assert_eq!((jump.kind, jump.joint, jump.point), (ProblemKind::Jump, Some(3), n / 2 - 1));
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

/// A file whose velocities say nothing would stop and go at every point.
#[test]
fn channels_that_contradict_each_other_all_along_are_refused() {
    let mut t = smooth();
    t.points.iter_mut().for_each(|p| p.velocity = [0.0; 6]);
    let verdict = check(&t);
    assert!(verdict.refusals().any(|p| p.kind == ProblemKind::VelocityMismatch), "{verdict}");
}

/// J-30.
#[test]
fn j30_counts_are_checked() {
    let t = Trajectory { step_ms: 10, points: vec![Point::default(); 12_001] };
    assert_eq!(check(&t).problems[0].kind, ProblemKind::TooManyPoints);
    let config = Config::avena();
    let few = UploadOptions { points_per_segment: Some(100), ..UploadOptions::default() };
    let t = Trajectory { step_ms: 10, points: vec![Point::default(); 10_001] };
    let verdict = Checker { upload: few, ..Checker::new(&config) }.check(&t);
    assert_eq!(verdict.problems[0].kind, ProblemKind::TooManySegments);
    assert_eq!(check(&Trajectory::default()).problems[0].kind, ProblemKind::Empty);
}

#[test]
fn torque_along_the_path_is_held_against_the_limits() {
    let arm = Arm::avena();
    let mut config = arm.config();
    config.joints[1].torque_max = 100.0;
    // Stretched out sideways, joint 2 carries some 130 N·m.
    let t = plan::joint_move(&[0.0; 6], &[0.0, 1.5, 0.0, 0.0, 0.0, 0.0], &config, 50.0).unwrap();
    let verdict = Checker { model: Some(&arm.model), ..Checker::new(&config) }.check(&t);
    assert_eq!(
        (verdict.problems[0].kind, verdict.problems[0].joint),
        (ProblemKind::Torque, Some(2)),
        "{verdict}"
    );
}

fn load(name: &str) -> Option<Trajectory> {
    let dir = std::env::var("OPENJTC_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/avena").to_owned());
    let path = Path::new(&dir).join(name);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
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
        // Five seams where the positions are a sample ahead of the velocities.
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
