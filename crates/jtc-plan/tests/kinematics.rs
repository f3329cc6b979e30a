//! Tests of the inverse kinematics. The tests use forward kinematics that share no code with the inverse kinematics.
use crate::robots;

use std::f64::consts::{PI, TAU};

use jtc_dynamics::{ArmModel, JOINTS, JointVec, Pose};
use jtc_plan::Path;
use jtc_plan::kinematics::{
    FlangePath, Kinematics, Leg, Orientation, PoseError, SingularKind, Target, resolve,
};
use proptest::prelude::*;
use robots::difference;

/// Position range of one turn for each joint.
const TURN: [(f64, f64); JOINTS] = [(-PI, PI); JOINTS];
/// A pose is not near a singular pose if its smallest singular value is above this limit.
const AWAY: f64 = 0.01;

fn positions() -> impl Strategy<Value = JointVec> {
    prop::array::uniform6(-3.1..3.1f64)
}

fn apart(a: &JointVec, b: &JointVec) -> f64 {
    let turn = |d: f64| (d - TAU * (d / TAU).round()).abs();
    a.iter().zip(b).map(|(a, b)| turn(a - b)).fold(0.0, f64::max)
}

fn length(a: &JointVec, b: &JointVec) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// Checks the properties that hold for every arm and every pose in reach.
fn check_all(name: &str, model: &ArmModel, q: &JointVec, most: usize) -> Result<(), TestCaseError> {
    let kin = Kinematics::new(model, &TURN);
    let pose = robots::pose(model, q);
    let all = kin.all(&pose);
    prop_assert!(all.len() <= most, "{name}: {} solutions", all.len());
    for (n, found) in all.iter().enumerate() {
        let (shift, turn) = difference(&robots::pose(model, found), &pose);
        prop_assert!(shift <= 1e-9 && turn <= 1e-9, "{name}: {shift} m, {turn} rad at {found:?}");
        prop_assert!(found.iter().all(|a| a.abs() <= PI), "{name}: {found:?}");
        prop_assert!(all[..n].iter().all(|other| apart(found, other) > 1e-5), "{name}: {found:?} twice");
    }
    let smallest = kin.singularity(q).smallest;
    if smallest > AWAY {
        prop_assert!(all.iter().any(|found| apart(found, q) < 1e-7), "{name}: {q:?} is not among {all:?}");
        let same = kin.solve(&pose, q).unwrap();
        prop_assert!(length(&same, q) < 1e-7, "{name}: {same:?}");
    }
    Ok(())
}

#[test]
fn closed_forms_are_recognised() {
    for (name, model) in robots::named() {
        let closed = Kinematics::new(&model, &TURN).is_closed_form();
        assert_eq!(closed, !["Jaco 2", "crooked"].contains(&name), "{name}");
    }
    for (name, model) in robots::more_closed_forms() {
        assert!(Kinematics::new(&model, &TURN).is_closed_form(), "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn closed_forms_reach_the_pose_in_up_to_eight_ways(q in positions()) {
        for (name, model) in robots::named().into_iter().chain(robots::more_closed_forms()) {
            if Kinematics::new(&model, &TURN).is_closed_form() {
                check_all(name, &model, &q, 8)?;
            }
        }
    }

    /// The kinematics must find a solution for extreme poses, with right angles and stretched arms.
    #[test]
    fn poses_at_and_near_singular_ones_are_reached(
        quarters in prop::array::uniform6(-2..=2i32), off in prop::array::uniform6(prop_oneof![
            4 => Just(0.0), 1 => -1e-9..1e-9f64, 1 => -1e-6..1e-6f64, 1 => -1e-3..1e-3f64
        ])
    ) {
        let q: JointVec = std::array::from_fn(|j| f64::from(quarters[j]) * 0.5 * PI + off[j]);
        for (name, model) in robots::named() {
            let kin = Kinematics::new(&model, &[(-4.0, 4.0); JOINTS]);
            let pose = robots::pose(&model, &q);
            let found = kin.solve(&pose, &q);
            prop_assert!(found.is_ok(), "{name} at {q:?}: {found:?}");
            let (shift, turn) = difference(&robots::pose(&model, &found.unwrap()), &pose);
            prop_assert!(shift <= 1e-9 && turn <= 1e-9, "{name}: {shift} m, {turn} rad at {q:?}");
        }
    }

    #[test]
    fn each_turn_within_the_limits_counts(q in positions(), wide in prop::array::uniform6(any::<bool>())) {
        let limits = wide.map(|wide| if wide { (-TAU, TAU) } else { (-PI, PI) });
        for model in [robots::ur5(), robots::kr5()] {
            let pose = robots::pose(&model, &q);
            let (single, all) =
                (Kinematics::new(&model, &TURN).all(&pose), Kinematics::new(&model, &limits).all(&pose));
            let each = 2usize.pow(wide.iter().filter(|&&wide| wide).count() as u32);
            // In a range of ±2π, each joint position has two equivalent positions. Only exactly 0 has three, and
            // random positions are never exactly 0.
            prop_assert_eq!(all.len(), single.len() * each);
            for (n, found) in all.iter().enumerate() {
                let (shift, turn) = difference(&robots::pose(&model, found), &pose);
                prop_assert!(shift <= 1e-9 && turn <= 1e-9);
                prop_assert!(found.iter().zip(limits).all(|(a, (low, high))| (low..=high).contains(a)));
                prop_assert!(all[..n].iter().all(|other| length(found, other) > 1e-5));
            }
        }
    }

    #[test]
    fn of_all_solutions_the_nearest_is_taken(
        q in positions(), near in prop::array::uniform6(-6.0..6.0f64), width in 3.2..7.0f64
    ) {
        let limits = [(-width, width); JOINTS];
        for model in [robots::avena(), robots::puma560()] {
            let kin = Kinematics::new(&model, &limits);
            prop_assume!(kin.singularity(&q).smallest > AWAY);
            let pose = robots::pose(&model, &q);
            let found = kin.solve(&pose, &near).unwrap();
            let nearest = kin.all(&pose).iter().map(|q| length(q, &near)).fold(f64::INFINITY, f64::min);
            // `all` contains each joint at its principal value and up to one turn away, and `near` is within one
            // turn. Therefore `all` contains the solution nearest to `near`.
            prop_assert!((length(&found, &near) - nearest).abs() < 1e-6);
            prop_assert!(found.iter().all(|a| a.abs() <= width));
        }
    }

    /// For the default arm, the kinematics must return only solutions within the position limits.
    #[test]
    fn the_default_arm_keeps_to_its_limits(share in prop::array::uniform6(0.01..0.99f64)) {
        let limits = robots::avena_limits();
        let q: JointVec = std::array::from_fn(|j| limits[j].0 + share[j] * (limits[j].1 - limits[j].0));
        let kin = Kinematics::new(&robots::avena(), &limits);
        prop_assume!(kin.singularity(&q).smallest > AWAY);
        let all = kin.all(&robots::pose(&robots::avena(), &q));
        prop_assert!(all.iter().any(|found| apart(found, &q) < 1e-7));
        prop_assert!(all.iter().flatten().zip(limits.iter().cycle()).all(|(a, l)| (l.0..=l.1).contains(a)));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    #[test]
    fn searches_reach_the_pose_in_up_to_sixteen_ways(q in positions()) {
        for (name, model) in [("Jaco 2", robots::jaco2()), ("crooked", robots::crooked())] {
            check_all(name, &model, &q, 16)?;
        }
    }

    /// The calibration of the arm differs by 1 mrad and 1 mm from an ideal geometry with a closed form. The
    /// kinematics must still find the solutions.
    #[test]
    fn an_arm_off_its_ideal_geometry_is_solved_too(
        q in positions(), off in prop::array::uniform6(prop::array::uniform6(-1e-3..1e-3f64))
    ) {
        for (name, mut model) in [("UR5", robots::ur5()), ("KR 5", robots::kr5())] {
            for (joint, off) in model.joints[1..].iter_mut().zip(&off) {
                for i in 0..3 {
                    joint.xyz[i] += off[i];
                    joint.rpy[i] += off[i + 3];
                }
            }
            prop_assert!(!Kinematics::new(&model, &TURN).is_closed_form());
            check_all(name, &model, &q, 16)?;
        }
    }
}

fn at(position: [f64; 3]) -> Pose {
    Orientation::Rpy([0.0; 3]).at(position).unwrap()
}

/// The wrist of a PUMA 560 is 0.15005 m to the side of the axis of joint 1. The height of the wrist above the shoulder
/// is at most the length of the two links together. Errors must contain the distance from the reach of the arm to a
/// position out of reach.
#[test]
fn out_of_reach_says_how_far() {
    let kin = Kinematics::new(&robots::puma560(), &TURN);
    let up = 0.4318 + 0.0203f64.hypot(0.4318);
    let error = kin.solve(&at([0.0, 0.0, 3.0]), &[0.0; 6]).unwrap_err();
    let PoseError::OutOfReach { distance, missing } = error else { panic!("{error}") };
    assert!((distance - 3.0).abs() < 1e-12 && (missing - (3.0 - up).hypot(0.15005)).abs() < 1e-6, "{error}");
    let text = error.to_string();
    assert_eq!(
        text,
        "out of reach: 3.000 m from the origin of the base; the nearest position of the flange is 2.1412 m away from it"
    );
    assert!(error.hint().contains("base frame"));
    // The position is in the unreachable column around the axis of joint 1.
    let error = kin.solve(&at([0.05, 0.0, 0.3]), &[0.0; 6]).unwrap_err();
    let PoseError::OutOfReach { missing, .. } = error else { panic!("{error}") };
    assert!((missing - 0.10005).abs() < 1e-6, "{error}");
}

/// At the limit of the reach of the UR5, the flange can point outwards or sideways, but not back to the base. The
/// error must report the orientation, not the position.
#[test]
fn an_orientation_out_of_reach_is_told_from_a_position_out_of_reach() {
    let model = robots::ur5();
    let kin = Kinematics::new(&model, &TURN);
    let q = [0.3, -1.0, 0.1, -1.5, 0.4, 0.0];
    let mut pose = robots::pose(&model, &q);
    // The pose is a reachable pose, rotated by half a turn about the x axis of the flange.
    pose.rotation = pose.rotation.map(|[x, y, z]| [x, -y, -z]);
    let error = kin.solve(&pose, &q).unwrap_err();
    let PoseError::Orientation { distance, missing } = error else { panic!("{error}") };
    assert!((distance - pose.position.iter().map(|x| x * x).sum::<f64>().sqrt()).abs() < 1e-12);
    assert!(missing > 0.01 && missing < PI, "{error}");
    // If the orientation is rotated back by half a turn, it is within reach again. After a rotation by only half of
    // the missing angle, in either direction, it is still out of reach.
    let turned = |angle: f64| {
        let (s, c) = angle.sin_cos();
        let rotation = pose.rotation.map(|[x, y, z]| [x, c * y + s * z, c * z - s * y]);
        kin.solve(&Pose { rotation, ..pose }, &q).is_ok()
    };
    assert!(turned(PI) && !turned(0.5 * missing) && !turned(-0.5 * missing));
}

#[test]
fn a_joint_outside_its_limits_is_named_with_value_and_limits() {
    let model = robots::kr5();
    let q = [0.4, -0.8, 0.5, 0.6, 0.9, -0.4];
    let pose = robots::pose(&model, &q);
    let all = Kinematics::new(&model, &TURN).all(&pose);
    for joint in 0..JOINTS {
        let mut limits = TURN;
        // Selects a range of this joint that contains no solution. The limits of the other joints permit a full turn,
        // so the error must report this joint.
        let (low, high) = (0..60)
            .map(|k| (-3.0 + 0.1 * f64::from(k), -2.99 + 0.1 * f64::from(k)))
            .find(|(low, high)| all.iter().all(|q| q[joint] < low - 0.02 || q[joint] > high + 0.02))
            .unwrap();
        limits[joint] = (low, high);
        let error = Kinematics::new(&model, &limits).solve(&pose, &q).unwrap_err();
        let PoseError::OutsideLimits { joint: named, value, low: l, high: h } = error else {
            panic!("{error}")
        };
        assert_eq!((named.index(), l, h), (joint, low, high), "{error}");
        let beyond = |a: f64| {
            let turns = [-TAU, 0.0, TAU].map(|turn| (low - a - turn).max(a + turn - high));
            turns.into_iter().fold(f64::INFINITY, f64::min)
        };
        let least = all.iter().map(|q| beyond(q[joint])).fold(f64::INFINITY, f64::min);
        assert!((beyond(value) - least).abs() < 1e-7, "{error}");
        assert!(error.to_string().starts_with(&format!("joint {} would be at", joint + 1)), "{error}");
        assert!(Kinematics::new(&model, &limits).all(&pose).is_empty());
    }
}

#[test]
fn what_is_no_pose_has_no_solution_and_an_error_that_says_so() {
    let kin = Kinematics::new(&robots::avena(), &TURN);
    let mut pose = kin.flange(&[0.1; 6]);
    pose.position[1] = f64::NAN;
    let error = kin.solve(&pose, &[0.0; 6]).unwrap_err();
    assert!(matches!(error, PoseError::NotFinite { what: "position y", .. }), "{error}");
    assert!(kin.all(&pose).is_empty());
    let mut pose = kin.flange(&[0.1; 6]);
    pose.rotation[0] = [0.0; 3];
    assert!(matches!(kin.solve(&pose, &[0.0; 6]), Err(PoseError::NotRotation { .. })));
    let pose = kin.flange(&[0.1; 6]);
    let nowhere = kin.solve(&pose, &[0.0, 0.0, f64::INFINITY, 0.0, 0.0, 0.0]);
    assert!(matches!(nowhere, Err(PoseError::NotFinite { .. })));
    assert!(kin.solve(&at([1e300, 0.0, 0.0]), &[0.0; 6]).is_err());
}

/// Returns numbers of all kinds. Most of them are invalid.
fn any_number() -> impl Strategy<Value = f64> {
    let special =
        vec![0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 1e300, 1e-300, 1e9];
    prop_oneof![4 => -2.0..2.0f64, 1 => prop::sample::select(special), 1 => any::<f64>()]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    /// An invalid pose, start or limit results in an error or in no solution. The search does not panic, and always
    /// ends.
    #[test]
    fn no_number_does_any_harm(
        position in prop::array::uniform3(any_number()), quaternion in prop::array::uniform4(any_number()),
        rotation in prop::array::uniform9(any_number()), near in prop::array::uniform6(any_number()),
        limit in prop::array::uniform2(any_number()), joint in 0..JOINTS, blend in any_number(), is_unit in any::<bool>()
    ) {
        let mut limits = TURN;
        limits[joint] = (limit[0], limit[1]);
        let length = quaternion.iter().map(|v| v * v).sum::<f64>().sqrt();
        let orientation = Orientation::Quaternion(quaternion.map(|v| if is_unit { v / length } else { v }));
        let rows = std::array::from_fn(|i| std::array::from_fn(|k| rotation[3 * i + k]));
        let pose = orientation.at(position).unwrap_or(Pose { rotation: rows, position });
        for model in [robots::ur5(), robots::kr5()] {
            let kin = Kinematics::new(&model, &limits);
            let within = |q: &JointVec| q.iter().zip(&limits).all(|(q, l)| l.0 <= *q && *q <= l.1);
            prop_assert!(kin.solve(&pose, &near).is_ok_and(|q| within(&q)) || kin.solve(&pose, &near).is_err());
            prop_assert!(kin.all(&pose).iter().all(within));
            let singular = kin.singularity(&near);
            prop_assert!(singular.smallest >= 0.0 || singular.smallest.is_nan());
            let legs = [Leg::Line { to: pose }, Leg::Arc { via: position, to: kin.flange(&[0.5; 6]) }];
            for start in [near, [0.5; JOINTS]] {
                if let Ok(path) = FlangePath::new(&kin, &start, &legs, blend) {
                    prop_assert!(path.at(blend).position.iter().all(|q| q.is_finite()));
                }
            }
        }
    }
}

/// The kinematics must report the correct kind of singular pose for both closed-form geometries. The test finds the
/// singular poses from their definitions.
#[test]
fn singular_poses_have_their_names() {
    use SingularKind::{Elbow, Shoulder, Wrist};
    let away = [0.3, -1.2, 1.1, 0.4, 0.8, 0.2];
    let with = |j: usize, value: f64| {
        let mut q = away;
        q[j] = value;
        q
    };
    for (model, name, q, kind, joints) in [
        (robots::ur5(), "UR5", with(4, 0.0), Wrist, [4, 6].as_slice()),
        (robots::ur5(), "UR5", with(2, 0.0), Elbow, &[2, 3, 4]),
        (robots::puma560(), "PUMA 560", with(4, 0.0), Wrist, &[4, 6]),
        (robots::puma560(), "PUMA 560", with(2, -PI / 2.0 + 0.0203f64.atan2(0.4318)), Elbow, &[2, 3]),
        // The arm is folded: its two links have equal length, and the wrist is close to the axis of joint 2.
        (robots::puma560(), "PUMA 560", with(2, PI / 2.0 + 0.0203f64.atan2(0.4318)), Elbow, &[2]),
        (robots::kr5(), "KR 5", with(4, PI), Wrist, &[4, 6]),
        (robots::kr5(), "KR 5", over_the_base(), Shoulder, &[1]),
    ] {
        let found = Kinematics::new(&model, &TURN).singularity(&q);
        assert!(found.smallest < 1e-3, "{name}: {found}");
        assert_eq!(found.kind, kind, "{name}: {found}");
        for joint in joints {
            assert!(found.joints.iter().any(|j| j.number() == *joint), "{name}: {found}");
        }
    }
    let far = Kinematics::new(&robots::ur5(), &TURN).singularity(&away);
    assert!(far.smallest > 0.05, "{far}");
}

/// Returns joint positions of a KR 5 with the wrist over the axis of joint 1. The function finds these positions by
/// bisection.
fn over_the_base() -> JointVec {
    let with = |q2: f64| [0.3, q2, 0.3, 0.4, 0.8, 0.2];
    let radius = |q2: f64| {
        let pose = robots::pose(&robots::kr5(), &with(q2));
        let wrist: [f64; 3] = std::array::from_fn(|i| pose.position[i] - 0.115 * pose.rotation[i][2]);
        wrist[0] * 0.3f64.cos() + wrist[1] * 0.3f64.sin()
    };
    let (mut low, mut high) = (-PI + 0.5, -0.5);
    assert!(radius(low) * radius(high) < 0.0, "{} {}", radius(low), radius(high));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if radius(middle) * radius(low) > 0.0 { low = middle } else { high = middle }
    }
    with(low)
}

#[test]
fn targets_are_resolved_one_after_the_other_and_errors_name_the_waypoint() {
    let (model, limits) = (robots::avena(), robots::avena_limits());
    let kin = Kinematics::new(&model, &limits);
    let way: [JointVec; 4] = std::array::from_fn(|k| {
        let s = k as f64;
        [0.3 * s, 0.2 - 0.2 * s, 0.8 + 0.1 * s, 0.3, 0.5 + 0.2 * s, -0.4 * s]
    });
    let targets = [
        Target::Flange(robots::pose(&model, &way[0])),
        Target::Joints(way[1]),
        Target::Flange(robots::pose(&model, &way[2])),
        Target::Flange(robots::pose(&model, &way[3])),
    ];
    let found = resolve(&kin, &targets, &[0.0, 0.1, 0.7, 0.2, 0.4, 0.0]).unwrap();
    for (found, wanted) in found.iter().zip(&way) {
        assert!(length(found, wanted) < 1e-7, "{found:?} {wanted:?}");
    }
    let mut far = targets;
    far[2] = Target::Flange(at([0.0, 0.0, 9.0]));
    let error = resolve(&kin, &far, &way[0]).unwrap_err();
    assert!(matches!(error, PoseError::Waypoint { waypoint: 3, .. }), "{error}");
    assert!(error.to_string().starts_with("waypoint 3: out of reach: 9.000 m"), "{error}");
    far[1] = Target::Joints([0.0, 0.0, 0.0, 3.1, 0.0, 0.0]);
    let error = resolve(&kin, &far, &way[0]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "waypoint 2: joint 4 would be at 3.1000 rad, its limits are -2.9700 and 2.9700 rad"
    );
    far[0] = Target::Joints([f64::NAN; 6]);
    let error = resolve(&kin, &far, &way[0]).unwrap_err();
    assert!(matches!(error, PoseError::Waypoint { waypoint: 1, .. }), "{error}");
}

/// The velocity and the angular velocity of the flange must be equal to central differences of independent forward
/// kinematics.
#[test]
fn the_jacobian_is_the_rate_of_the_forward_kinematics() {
    let q = [0.3, -0.7, 1.1, 0.4, -0.9, 2.0];
    let h = 1e-6;
    for model in robots::all() {
        let jacobian = Kinematics::new(&model, &TURN).jacobian(&q);
        for joint in 0..JOINTS {
            let at = |s: f64| {
                let mut moved = q;
                moved[joint] += s;
                robots::pose(&model, &moved)
            };
            let (before, here, after) = (at(-h), at(0.0), at(h));
            // The rate of the rotation matrix, times the transposed matrix, is the angular velocity as a skew-symmetric
            // matrix.
            let spin = |i: usize, k: usize| {
                let rate = |m: usize| (after.rotation[i][m] - before.rotation[i][m]) / (2.0 * h);
                (0..3).map(|m| rate(m) * here.rotation[k][m]).sum::<f64>()
            };
            let turned = [spin(2, 1), spin(0, 2), spin(1, 0)];
            for axis in 0..3 {
                let moved = (after.position[axis] - before.position[axis]) / (2.0 * h);
                assert!((jacobian[axis][joint] - moved).abs() < 1e-8, "joint {joint}, axis {axis}");
                assert!(
                    (jacobian[axis + 3][joint] - turned[axis]).abs() < 1e-8,
                    "joint {joint}, axis {axis}"
                );
            }
        }
    }
}
