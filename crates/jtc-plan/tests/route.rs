//! Tests of routes through waypoints. The tests use forward kinematics that share no code with the paths.
use crate::{lines, robots};

use jtc_core::{Config, Parameters};
use jtc_dynamics::{JOINTS, JointVec, Pose};
use jtc_plan::kinematics::{Kinematics, LegKind, PoseError, Route, RoutePoint, Target};
use jtc_plan::{ArmDynamics, Limits, Motion, PlanError, State, on_route};
use lines::{Vec3, cross, moved, norm, sub};
use proptest::prelude::*;
use robots::difference;

const Q: JointVec = [0.3, -0.2, 1.2, 0.4, 0.9, 0.2];

fn kinematics() -> (Kinematics, Limits) {
    let limits = Limits::of(&Config::avena());
    (Kinematics::new(&robots::avena(), &limits.position), limits)
}

fn joints(q: JointVec, leg: LegKind) -> RoutePoint {
    RoutePoint { target: Target::Joints(q), leg }
}

fn flange(pose: Pose, leg: LegKind) -> RoutePoint {
    RoutePoint { target: Target::Flange(pose), leg }
}

fn at(q: &JointVec) -> Pose {
    robots::pose(&robots::avena(), q)
}

fn route(points: &[RoutePoint], blends: (f64, f64)) -> Result<Route, PlanError> {
    Route::new(&kinematics().0, points, &[0.0; JOINTS], blends)
}

/// Route of the tests: a path in joint space, two lines, an arc and a path in joint space. The arc is half a circle
/// whose centre is in the middle of a vertical line.
struct Mixed {
    points: Vec<RoutePoint>,
    corners: [Pose; 3],
    centre: Vec3,
}

const RADIUS: f64 = 0.08;

fn mixed() -> Mixed {
    let first = at(&Q);
    let corner = moved(&first, [-0.2, 0.1, 0.0], [0.1, 0.0, -0.2]);
    let top = moved(&corner, [0.0, -0.15, 0.1], [0.0; 3]);
    let centre = moved(&top, [0.0, 0.0, -RADIUS], [0.0; 3]).position;
    let mut via = top;
    via.position = [centre[0] - RADIUS, centre[1], centre[2]];
    let low = moved(&top, [0.0, 0.0, -2.0 * RADIUS], [0.0; 3]);
    let points = vec![
        joints([0.1, 0.1, 0.9, 0.2, 0.8, 0.0], LegKind::Joint),
        joints(Q, LegKind::Joint),
        flange(corner, LegKind::Line),
        flange(top, LegKind::Line),
        flange(via, LegKind::Via),
        flange(low, LegKind::Arc),
        joints([0.0, -0.1, 1.0, 0.3, 0.8, 0.0], LegKind::Joint),
    ];
    Mixed { points, corners: [first, corner, top], centre }
}

/// Returns the states between two waypoints (counted from 1), including both ends.
fn between(motion: &Motion, from: usize, to: usize) -> Vec<State> {
    let (from, to) = (motion.waypoint_times()[from - 1], motion.waypoint_times()[to - 1]);
    assert!(from < to, "{:?}", motion.waypoint_times());
    (0..=500).map(|k| motion.at(from + (to - from) * f64::from(k) / 500.0)).collect()
}

fn off_line(state: &State, a: &Pose, b: &Pose) -> f64 {
    let chord = sub(b.position, a.position);
    norm(cross(sub(at(&state.position).position, a.position), chord)) / norm(chord)
}

fn keeps_to(limits: &Limits, state: &State) {
    for j in 0..JOINTS {
        assert!(state.velocity[j].abs() <= limits.velocity[j] * (1.0 + 1e-9));
        assert!(state.acceleration[j].abs() <= limits.acceleration[j] * (1.0 + 1e-9));
    }
}

#[test]
fn each_leg_is_of_its_kind_and_the_arm_rests_where_they_change() {
    let (Mixed { points, corners, centre }, (_, limits)) = (mixed(), kinematics());
    let (config, parameters) = (Config::avena(), Parameters::avena());
    let arm = ArmDynamics::new(&config, &parameters.model, Some(&parameters.friction));
    for (blend_m, dynamics) in [(0.0, None), (0.03, None), (0.03, Some(&arm))] {
        let route = route(&points, (0.0, blend_m)).unwrap();
        let motion = on_route(&route, &[], &limits, dynamics).unwrap();
        let times = motion.waypoint_times();
        assert_eq!(times.len(), points.len());
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
        let speed = |n: usize| motion.at(times[n - 1]).velocity.iter().fold(0.0, |m: f64, v| v.abs().max(m));
        for n in [1, 2, 6, 7] {
            assert!(speed(n) < 1e-6, "waypoint {n}: {}", speed(n));
        }
        // The motion passes the via point of the arc and the blended corners without a stop.
        assert!(speed(5) > 0.1);
        assert_eq!(speed(3) > 0.05, blend_m > 0.0);
        let line = |state: &State, k: usize| off_line(state, &corners[k], &corners[k + 1]);
        let arc = |state: &State| {
            let off = sub(at(&state.position).position, centre);
            off[1].hypot(off[0].hypot(off[2]) - RADIUS)
        };
        let near_corner = |state: &State| {
            corners[1..].iter().any(|c| norm(sub(at(&state.position).position, c.position)) < blend_m + 1e-6)
        };
        for (from, to, aside) in [
            (2, 3, &(|s: &State| line(s, 0)) as &dyn Fn(&State) -> f64),
            (3, 4, &|s: &State| line(s, 1)),
            (4, 6, &arc),
        ] {
            for state in between(&motion, from, to) {
                assert!(aside(&state) < 1e-6 || near_corner(&state), "{from}: {}", aside(&state));
                keeps_to(&limits, &state);
            }
        }
        let there = at(&motion.at(times[4]).position).position;
        assert!(norm(sub(there, [centre[0] - RADIUS, centre[1], centre[2]])) < 1e-4, "{there:?}");
        // The last leg is straight in joint space and ends exactly at the target.
        let (a, b) = (motion.at(times[5]).position, motion.at(motion.duration()).position);
        assert_eq!(Target::Joints(b), points[6].target);
        for state in between(&motion, 6, 7) {
            let share = (state.position[0] - a[0]) / (b[0] - a[0]);
            for j in 0..JOINTS {
                assert!((state.position[j] - a[j] - share * (b[j] - a[j])).abs() < 1e-7);
            }
        }
        // The motion has no jump at any point.
        let mut before = motion.at(0.0);
        for k in 1..=20_000 {
            let state = motion.at(motion.duration() * f64::from(k) / 20_000.0);
            for j in 0..JOINTS {
                let step = motion.duration() / 20_000.0;
                let most = limits.velocity[j] * step * 1.01 + 1e-8;
                assert!((state.position[j] - before.position[j]).abs() < most);
            }
            before = state;
        }
    }
}

#[test]
fn times_of_waypoints_on_lines_are_kept() {
    let (Mixed { points, corners, .. }, (_, limits)) = (mixed(), kinematics());
    for blend_m in [0.0, 0.03] {
        let route = route(&points, (0.0, blend_m)).unwrap();
        let wanted = [Some(0.0), None, Some(3.0), None, None, Some(7.0), Some(9.5)];
        let motion = on_route(&route, &wanted, &limits, None).unwrap();
        for (time, wanted) in motion.waypoint_times().iter().zip(wanted) {
            assert!(
                wanted.is_none_or(|wanted| (time - wanted).abs() < 1e-3),
                "{:?}",
                motion.waypoint_times()
            );
        }
        for state in between(&motion, 2, 3).iter().take(300) {
            assert!(off_line(state, &corners[0], &corners[1]) < 1e-6);
        }
        let early = [Some(0.0), None, Some(3.0), Some(3.05), None, None, None];
        match on_route(&route, &early, &limits, None).unwrap_err() {
            PlanError::TooEarly { from: 3, waypoint: 4, shortest, .. } => assert!(shortest > 0.05),
            other => panic!("{other}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    /// A line to joint positions must end at these positions, if the arm has the same configuration at both ends of
    /// the line. If the configurations differ, the error must contain a joint with a different position.
    #[test]
    fn joint_positions_at_the_end_of_a_line_are_of_its_configuration(shift in prop::array::uniform3(-0.15..0.15f64)) {
        prop_assume!(norm(shift) > 1e-3);
        let (kin, _) = kinematics();
        let target = moved(&at(&Q), shift, [0.0; 3]);
        let by_pose = route(&[joints(Q, LegKind::Line), flange(target, LegKind::Line)], (0.0, 0.0)).unwrap();
        let kept = by_pose.positions()[1];
        let (off, turned) = difference(&at(&kept), &target);
        prop_assert!(off < 1e-8 && turned < 1e-7);
        for q in kin.all(&target) {
            let made = route(&[joints(Q, LegKind::Line), joints(q, LegKind::Line)], (0.0, 0.0));
            let away = (0..JOINTS).map(|j| (q[j] - kept[j]).abs()).fold(0.0, f64::max);
            match made {
                Ok(made) => prop_assert!(away < 1e-5 && made.positions()[1] == q),
                Err(PlanError::Flange(PoseError::Waypoint { waypoint: 2, source })) => {
                    let PoseError::Configuration { joint, value, wanted } = *source else { panic!("{source}") };
                    prop_assert!((value - kept[joint.index()]).abs() < 1e-5 && wanted == q[joint.index()]);
                    prop_assert!(away > 1e-5);
                }
                Err(other) => panic!("{other}"),
            }
        }
    }
}

/// The waypoint numbers in errors must also count the via points of arcs.
#[test]
fn errors_name_the_waypoints_of_the_route() {
    let Mixed { points, .. } = mixed();
    let waypoint = |points: &[RoutePoint]| match route(points, (0.0, 0.0)).unwrap_err() {
        PlanError::Flange(PoseError::Waypoint { waypoint, source }) => (waypoint, *source),
        other => panic!("{other}"),
    };
    let with = |index: usize, leg: LegKind| {
        let mut changed = points.clone();
        changed[index].leg = leg;
        changed
    };
    assert_eq!(waypoint(&with(4, LegKind::Line)), (6, PoseError::NoVia));
    assert_eq!(waypoint(&with(5, LegKind::Line)), (5, PoseError::NoArc));
    assert_eq!(waypoint(&points[..5]), (5, PoseError::NoArc));
    let far = |index: usize| {
        let mut changed = points.clone();
        changed[index] = flange(moved(&at(&Q), [3.0, 0.0, 0.0], [0.0; 3]), points[index].leg);
        waypoint(&changed)
    };
    for index in [2, 3, 5] {
        let (number, source) = far(index);
        assert!(number == index + 1 && matches!(source, PoseError::OutOfReach { .. }), "{index}: {source}");
    }
    // The via point of this arc is out of reach.
    let mut changed = points.clone();
    let Target::Flange(via) = points[4].target else { panic!("a pose") };
    changed[4] = flange(moved(&via, [-3.0, 0.0, 0.0], [0.0; 3]), LegKind::Via);
    match route(&changed, (0.0, 0.0)).unwrap_err() {
        PlanError::Flange(PoseError::Leg { leg: 5, .. }) => {}
        other => panic!("{other}"),
    }
    let still = [joints(Q, LegKind::Joint), flange(at(&Q), LegKind::Line), joints(Q, LegKind::Joint)];
    assert_eq!(route(&still, (0.0, 0.0)).unwrap_err(), PoseError::NoMotion.into());
    assert_eq!(route(&points[..1], (0.0, 0.0)).unwrap_err(), PlanError::TooFew { count: 1 });
    assert!(matches!(route(&points, (-1.0, 0.0)).unwrap_err(), PlanError::Blend { .. }));
    assert_eq!(route(&points, (0.0, -1.0)).unwrap_err(), PoseError::Blend { radius: -1.0 }.into());
}

/// A leg without motion has its own waypoint. The motion must pass this waypoint at the time of the previous
/// waypoint.
#[test]
fn waypoints_at_one_place_are_passed_at_one_time() {
    let there = moved(&at(&Q), [-0.1, 0.0, 0.0], [0.0; 3]);
    let points = [
        joints(Q, LegKind::Joint),
        joints(Q, LegKind::Joint),
        flange(at(&Q), LegKind::Line),
        flange(there, LegKind::Line),
        flange(there, LegKind::Joint),
        flange(at(&Q), LegKind::Line),
    ];
    let route = route(&points, (0.0, 0.0)).unwrap();
    let motion = on_route(&route, &[], &kinematics().1, None).unwrap();
    let times = motion.waypoint_times();
    assert_eq!((times.len(), times[0], times[1], times[2]), (6, 0.0, 0.0, 0.0));
    assert!(times[3] > 0.1 && (times[3] - times[4]).abs() < 1e-9 && times[5] > 2.0 * times[3] - 0.01);
}
