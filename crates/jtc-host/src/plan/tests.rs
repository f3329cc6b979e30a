//! Tests that every plan passes the check, and that the planner rejects impossible motions with the reason.

use host_kit::{Diagnose, ErrorKind};
use jtc_core::{POINTS_MAX, SetPoint};
use jtc_plan::kinematics::Target;
use proptest::prelude::*;

use super::*;
use crate::Arm;
use crate::check::{CheckOptions, HOLD_SHARE};
use crate::run::Order;

fn pose() -> impl Strategy<Value = [f64; JOINTS]> {
    prop::array::uniform6(-1.5..1.5f64)
}

fn waypoints(positions: &[[f64; JOINTS]]) -> Vec<Waypoint> {
    positions.iter().map(|position| Waypoint { position: *position, time: None }).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Every planned move passes the check at every speed, and ends exactly at the goal.
    #[test]
    fn planned_moves_pass_the_check(from in pose(), to in pose(), speed in 1.0..100.0f64) {
        let config = Config::avena();
        let plan = joint_move(&from, &to, &config, speed).unwrap();
        let verdict = Checker { start: Some(from), ..Checker::new(&config) }.check(&plan);
        prop_assert!(verdict.is_ok(), "{verdict}");
        prop_assert_eq!(plan.points.last().unwrap().position, to);
        prop_assert!(plan.points.len() <= POINTS_MAX);
    }

    /// The planner considers torques, friction and the ability to stop. If the drives cannot hold the arm, or cannot stop the arm at any
    /// speed, the planner returns an error with this reason.
    #[test]
    fn plans_of_an_arm_pass_its_check(places in prop::collection::vec(pose(), 2..5), blend in 0.0..0.3f64, jerk: bool) {
        let arm = Arm::avena();
        let (config, friction) = (arm.config(), arm.friction());
        let model = Some(&arm.model);
        let planner = Planner { model, friction: friction.as_ref(), blend, jerk, ..Planner::new(&config) };
        match planner.through(&waypoints(&places)) {
            Ok(planned) => {
                let verdict = Checker { model, friction: friction.as_ref(), ..Checker::new(&config) }.check(&planned.trajectory);
                prop_assert!(verdict.is_ok(), "{verdict}");
                prop_assert_eq!(planned.trajectory.points[0].position, places[0]);
                prop_assert_eq!(planned.trajectory.points.last().unwrap().position, *places.last().unwrap());
                prop_assert_eq!(planned.waypoint_times.len(), places.len());
                let end = planned.trajectory.duration_s() + 1e-9;
                prop_assert!(planned.binding.iter().all(|b| b.from_s <= b.to_s && b.to_s <= end));
            }
            Err(PlanError::Refused(verdict)) => prop_assert!(
                verdict.refusals().any(|p| matches!(p.kind, ProblemKind::HoldTorque | ProblemKind::Torque)),
                "{verdict}"
            ),
            Err(PlanError::Plan(jtc_plan::PlanError::Torque { .. })) => {}
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}

#[test]
fn a_target_outside_the_limits_is_refused() {
    let config = Config::avena();
    let error = joint_move(&[0.0; 6], &[0.0, 1.6, 0.0, 0.0, 0.0, 0.0], &config, 100.0).unwrap_err();
    assert!(error.to_string().contains("joint 2: 1.6 rad is outside -1.57..1.57 rad"), "{error}");
    assert!(joint_move(&[f64::NAN; 6], &[0.0; 6], &config, 100.0).is_err());
    for speed in [0.0, 0.5, 101.0, f64::NAN] {
        let error = joint_move(&[0.0; 6], &[0.0; 6], &config, speed).unwrap_err();
        assert_eq!(error.diagnosis().kind, ErrorKind::Usage, "{speed}: {error}");
    }
}

/// An arm without brakes has fallen onto an end stop outside its position limits. A planned motion moves the arm back inside the limits.
#[test]
fn j58_a_move_from_outside_is_planned_from_the_nearest_place_inside() {
    let arm = Arm::avena();
    let config = arm.config();
    let (limit, to) = (config.joints[1].position_max, [0.05, 1.45, -1.4, 0.0, 0.6, 0.0]);
    let planner = Planner { model: Some(&arm.model), ..Planner::new(&config) };
    for (out, planned) in [(0.0001, true), (0.0199, true), (0.0201, false)] {
        for sign in [1.0, -1.0] {
            let at = |q: f64| [0.0, q, -1.5, 0.0, 0.5, 0.0].map(|q| sign * q);
            let (here, to) = (at(limit + out), to.map(|q| sign * q));
            let target = |line| planner.to_target(&arm.model, &here, &Target::Joints(to), line);
            for (what, found) in
                [("move", planner.to(&here, &to)), ("target", target(false)), ("line", target(true))]
            {
                let case = format!("{what}, {out} rad outside at {sign}");
                if !planned {
                    let error = found.unwrap_err();
                    assert_eq!(error.waypoint(), Some(1), "{case}: {error}");
                    continue;
                }
                let found = found.unwrap_or_else(|error| panic!("{case}: {error}"));
                assert!(found.verdict.is_ok(), "{case}: {}", found.verdict);
                let first = found.trajectory.points[0].position;
                assert_eq!(first, at(limit), "{case}");
                let end = found.trajectory.points.last().unwrap().position;
                assert!(end.iter().zip(to).all(|(a, b)| (a - b).abs() < 1e-6), "{case}: {end:?}");
            }
        }
    }
}

/// The goal is 1.57 rad after the rounding of an int16 file: the raw position 16 376 is 1.570077 rad, slightly
/// outside the limit. The planner moves the goal to the limit.
#[test]
fn j36_the_goal_of_a_move_may_be_a_limit_as_a_file_has_rounded_it() {
    let config = Config::avena();
    for sign in [1.0, -1.0] {
        let to = |q: f64| joint_move(&[0.0; 6], &[0.0, sign * q, 0.0, 0.0, 0.0, 0.0], &config, 50.0);
        let planned = to(16_376.0 * 3.141592 / 32_767.0).unwrap();
        assert_eq!(planned.points.last().unwrap().position[1], sign * 1.57);
        assert!(to(1.570_1).unwrap_err().to_string().contains("joint 2"));
    }
}

/// If the arm is outside its limits, an approach begins at the nearest position inside the limits, like a move.
#[test]
fn j58_an_approach_from_outside_begins_at_the_nearest_place_inside() {
    let arm = Arm::avena();
    let t = joint_move(&[0.0, 1.0, 0.0, 0.0, 0.0, 0.0], &[0.3, 0.5, 0.0, 0.0, 0.0, 0.0], &arm.config(), 50.0)
        .unwrap();
    let here = [0.0, 1.585, 0.0, 0.0, 0.0, 0.0];
    let options = CheckOptions { accept_device_limits: true, ..CheckOptions::default() };
    let order =
        Order { arm: &arm, options: &options, trajectory: &t, later: &t, runs: 1, approach_pct: Some(25.0) };
    let start = order.start(1, &here).expect("an approach");
    assert!(start.is_approach);
    let points = &start.checked.trajectory().points;
    assert_eq!(points[0].position, [0.0, 1.57, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(points.last().unwrap().position, t.points[0].position);
    // The arm is outside its limits by more than the start tolerance, so no approach is possible. Only a jog can move
    // the arm back inside the limits.
    assert!(order.start(1, &[0.0, 1.595, 0.0, 0.0, 0.0, 0.0]).is_err());
}

/// If the torque of a motion would be too high, the planner plans the motion at a lower speed.
#[test]
fn moves_slow_down_for_torque() {
    let arm = Arm::avena();
    let mut config = arm.config();
    let to = [0.0, 1.5, 0.0, 0.0, 0.0, 0.0];
    config.joints[1].torque_max = 140.0;
    let fast = joint_move(&[0.0; 6], &to, &config, 100.0).unwrap();
    let with =
        |config: &Config| Planner { model: Some(&arm.model), ..Planner::new(config) }.to(&[0.0; 6], &to);
    let planned = with(&config).unwrap();
    assert!(planned.trajectory.duration_s() >= fast.duration_s());
    config.joints[1].torque_max = 60.0;
    let error = with(&config).unwrap_err();
    assert!(error.to_string().contains("joint 2"), "{error}");
    assert_eq!(error.diagnosis().kind, ErrorKind::Refused);
}

/// Long and slow motions have longer time steps. The memory of the controller limits the duration of a motion.
#[test]
fn any_length_fits_or_is_refused() {
    let config = Config::avena();
    let slow = joint_move(&[0.0; 6], &[2.9, 1.5, 0.0, 0.0, 0.0, 0.0], &config, 1.0).unwrap();
    assert!(
        slow.points.len() <= POINTS_MAX && slow.duration_s() > 120.0 && slow.step_ms > STEP_MS,
        "{}",
        slow.duration_s()
    );
    let places: Vec<[f64; JOINTS]> =
        (0..10_000).map(|i| [if i % 2 == 0 { 0.0 } else { 0.2 }; JOINTS]).collect();
    let error = Planner::new(&config).through(&waypoints(&places)).unwrap_err();
    assert!(matches!(error, PlanError::TooManyCorners { .. }), "{error}");
}

/// The motion passes each waypoint at the given time. If this is impossible, the planner returns an error with the
/// shortest possible time.
#[test]
fn given_times_are_kept_or_refused() {
    let config = Config::avena();
    let planner = Planner::new(&config);
    let timed = |t: f64| {
        let second = Waypoint { position: [0.5, 0.0, 0.0, 0.0, 0.0, 0.0], time: Some(t) };
        planner.through(&[Waypoint { position: [0.0; 6], time: Some(0.0) }, second])
    };
    let planned = timed(3.003).unwrap();
    assert!((planned.waypoint_times[1] - 3.003).abs() < 1e-6);
    assert!((planned.trajectory.duration_s() - 3.003).abs() < 0.0101, "{}", planned.trajectory.duration_s());
    let error = timed(0.1).unwrap_err();
    assert!(error.to_string().contains("waypoint 2") && error.to_string().contains("joint 1"), "{error}");
    assert_eq!(error.diagnosis().kind, ErrorKind::Refused);
}

/// Plans a move of joint 2 with a payload (kg), between the upright pose and a pose that needs most of the joint's torque.
fn lowered_with(mass: f64) -> Result<Planned, PlanError> {
    let arm = Arm::avena();
    let (mut config, friction) = (arm.config(), arm.friction());
    config.payload.mass = mass;
    let planner = Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
    let places = [0.0, 1.4, 0.0].map(|q| [0.0, q, 0.0, 0.0, 0.0, 0.0]);
    planner.through(&waypoints(&places))
}

/// The planner accepts a pose even if the arm needs the whole torque limit to hold and leave the pose. Other plans use a smaller share of
/// the torque limit.
#[test]
fn a_pose_that_can_be_held_can_be_left() {
    let (arm, mut masses) = (Arm::avena(), 0);
    let limit = arm.config().joints[1].torque_max;
    for tenths in 0..40 {
        let mut config = arm.config();
        config.payload.mass = 0.1 * f64::from(tenths);
        let hold = jtc_dynamics::Dynamics::with_payload(&arm.model, config.gravity, &config.payload).inverse(
            &[0.0, 1.4, 0.0, 0.0, 0.0, 0.0],
            &[0.0; 6],
            &[0.0; 6],
        )[1];
        if (0.8..0.93).contains(&(hold.abs() / limit)) {
            let planned = lowered_with(config.payload.mass).unwrap();
            assert!(planned.verdict.is_ok());
            masses += 1;
        }
    }
    assert!(masses > 0);
}

/// With a payload that is too heavy, the error contains the waypoint at which the drives cannot hold the arm. The error
/// also contains the necessary torque, and the share of the limit that may be used to hold the arm.
#[test]
fn too_much_payload_names_the_pose_that_cannot_be_held() {
    let error = lowered_with(8.0).unwrap_err();
    let PlanError::Plan(jtc_plan::PlanError::Torque { waypoint, joint, torque, limit, whole, holding }) =
        &error
    else {
        panic!("{error}")
    };
    assert_eq!((*waypoint, joint.number(), *holding), (2, 2, true), "{error}");
    let of_arm = Arm::avena().config().joints[1].torque_max;
    assert!(*whole == of_arm && (limit / of_arm - HOLD_SHARE).abs() < 1e-9 && torque > limit, "{error}");
    assert!(error.to_string().contains("97.0 % of its limit of 180.0 N·m"), "{error}");
}

/// If the waypoints have too many corners for the points of a trajectory, the motion is rejected before planning.
#[test]
fn too_many_corners_are_refused_at_once() {
    let places: Vec<[f64; JOINTS]> = (0..10_000)
        .map(|i| std::array::from_fn(|j| if (i * 7 + j * 3) % 5 < 2 { 0.3 } else { -0.2 }))
        .collect();
    let config = Config::avena();
    for blend in [0.0, 0.05] {
        let error = Planner { blend, ..Planner::new(&config) }.through(&waypoints(&places)).unwrap_err();
        assert!(matches!(error, PlanError::TooManyCorners { .. }), "{error}");
        assert!(!error.diagnosis().next.to_string().contains("speed"), "{error}");
    }
}

/// A motion that takes too long even at the highest speed is rejected at once. The planner does not first check that
/// the drives can hold the arm in the last pose. If the positions of the same waypoints are in degrees, the planner
/// reports a position outside the limits instead.
#[test]
fn too_long_a_way_is_refused_at_once() {
    let arm = Arm::avena();
    let mut config = arm.config();
    config.payload.mass = 8.0;
    let planner = Planner { model: Some(&arm.model), blend: 0.05, speed_pct: 1.0, ..Planner::new(&config) };
    let mut places: Vec<[f64; JOINTS]> =
        (0..100).map(|i| [if i % 2 == 0 { -1.4 } else { 1.4 }, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    places.push([0.0, 1.4, 0.0, 0.0, 0.0, 0.0]);
    let error = planner.through(&waypoints(&places)).unwrap_err();
    assert!(matches!(error, PlanError::TooLong { .. }), "{error}");
    let held = planner.through(&waypoints(&places[98..])).unwrap_err();
    assert!(matches!(held, PlanError::Plan(jtc_plan::PlanError::Torque { holding: true, .. })), "{held}");
    let degrees: Vec<[f64; JOINTS]> = places.iter().map(|q| q.map(f64::to_degrees)).collect();
    let error = planner.through(&waypoints(&degrees)).unwrap_err();
    assert!(matches!(error, PlanError::Plan(jtc_plan::PlanError::Position { .. })), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// The lower bound of the duration never exceeds the duration of the plan, even if most waypoints are nearer to
    /// each other than the blend.
    #[test]
    fn no_plan_is_shorter_than_the_least_time(places in prop::collection::vec(pose(), 2..20), dense: bool, blend in 0.0..BLEND_MAX, speed in 20.0..100.0f64) {
        let config = Config::avena();
        let planner = Planner { blend, speed_pct: speed, ..Planner::new(&config) };
        let size = if dense { 0.1 } else { 1.0 };
        let places: Vec<_> = places.iter().map(|q| q.map(|q| size * q)).collect();
        let velocity = planner.limits().unwrap().velocity;
        let least = least_s(&places, blend, &velocity);
        let planned = planner.through(&waypoints(&places)).unwrap();
        prop_assert!(least <= planned.trajectory.duration_s(), "{least} s");
    }

    /// Even without a jerk limit, the position that the controller computes between the points (J-32) respects the acceleration limit.
    #[test]
    fn j32_the_position_between_points_keeps_the_acceleration(places in prop::collection::vec(pose(), 2..5), blend in 0.0..0.2f64, jerk: bool) {
        let config = Config::avena();
        let planned = Planner { jerk, blend, ..Planner::new(&config) }.through(&waypoints(&places)).unwrap();
        let h = f64::from(planned.trajectory.step_ms) * 1e-3;
        for pair in planned.trajectory.points.windows(2) {
            let (a, b) = (SetPoint::from(&pair[0]), SetPoint::from(&pair[1]));
            for k in 1..20 {
                let at = |k: i32| jtc_core::interpolate(&a, &b, h, f64::from(k) / 20.0).position;
                let (p, q, r) = (at(k - 1), at(k), at(k + 1));
                for j in 0..JOINTS {
                    let acceleration = (p[j] - 2.0 * q[j] + r[j]) / (h * h / 400.0);
                    let share = acceleration.abs() / config.joints[j].acceleration_max;
                    prop_assert!(share < 1.05, "joint {}: {} of the limit", j + 1, share);
                }
            }
        }
    }
}
