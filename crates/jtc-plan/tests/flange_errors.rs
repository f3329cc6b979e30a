//! Tests of flange lines that the arm cannot follow. Each error must contain the correct location.
use crate::{lines, robots};

use std::f64::consts::PI;

use jtc_dynamics::{ArmModel, JointVec, Pose};
use jtc_plan::kinematics::{FlangePath, Kinematics, Leg, PoseError, SINGULAR, SingularKind};
use lines::{Vec3, WIDE, moved, on_leg};
use robots::difference;

fn line(model: &ArmModel, q: &JointVec, to: &Pose) -> PoseError {
    FlangePath::new(&Kinematics::new(model, &WIDE), q, &[Leg::Line { to: *to }], 0.0).unwrap_err()
}

/// Joint 5 of a spherical wrist moves through the position 0, in which the wrist is singular. The error must be at
/// the point of the line from which the wrist is near the singular pose.
#[test]
fn a_line_through_a_wrist_singularity_ends_there() {
    let with = |q5: f64| [0.3, -0.8, 0.9, 0.5, q5, 0.4];
    for model in [robots::puma560(), robots::kr5()] {
        let (from, to) = (with(0.4), robots::pose(&model, &with(-0.6)));
        let error = line(&model, &from, &to);
        let text = error.to_string();
        assert!(
            text.starts_with("leg 1 (to waypoint 2), 0.") && text.contains("wrist singularity"),
            "{text}"
        );
        assert!(text.contains("joints 4 and 6 would move far"), "{text}");
        assert!(error.hint().contains("joint space"), "{}", error.hint());
        let (leg, distance, source) = on_leg(error);
        let PoseError::Singular(singular) = source else { panic!("{source}") };
        assert_eq!((leg, singular.kind), (1, SingularKind::Wrist));
        assert!(singular.smallest < SINGULAR);
        // A rotation of 1 rad counts as a length of 0.25 m. Joint 5 turns from 0.4 to −0.6 rad, so the error is
        // expected after a rotation of about 0.4 rad.
        let turned = distance / 0.25;
        let chord = difference(&robots::pose(&model, &from), &to).0;
        if chord < 1e-9 {
            assert!((turned - 0.4).abs() < 0.04, "{text}");
        }
    }
}

#[test]
fn three_parallel_axes_have_the_same_wrist() {
    let model = robots::ur5();
    let with = |q5: f64| [0.3, -1.2, 1.1, 0.4, q5, 0.2];
    let (_, _, source) = on_leg(line(&model, &with(0.4), &robots::pose(&model, &with(-0.4))));
    let PoseError::Singular(singular) = source else { panic!("{source}") };
    assert_eq!(singular.kind, SingularKind::Wrist);
    let joints: Vec<u8> = singular.joints.iter().map(|joint| joint.number()).collect();
    assert!(joints.contains(&4) && joints.contains(&6) && !joints.contains(&1), "{joints:?}");
}

/// The end of the line is a pose that differs from the stretched arm by only half a degree. The error must report an
/// elbow singularity.
#[test]
fn a_line_to_the_stretched_arm_ends_at_the_elbow() {
    for (model, stretched) in [(robots::ur5(), 0.01), (robots::kr5(), PI / 2.0 - 0.12f64.atan2(0.62) - 0.01)]
    {
        let q = |q3: f64| [0.3, -0.6, q3, 0.4, 0.8, 0.2];
        let to = robots::pose(&model, &q(stretched));
        let (_, distance, source) = on_leg(line(&model, &q(stretched + 0.6), &to));
        let PoseError::Singular(singular) = source else { panic!("{source}") };
        assert_eq!(singular.kind, SingularKind::Elbow, "{singular}");
        assert!(singular.joints.iter().any(|joint| joint.number() == 3), "{singular}");
        assert!(distance > 0.05);
    }
}

/// Half-way along the line, the wrist of a KR 5 passes straight over the axis of joint 1. The error must report a
/// shoulder singularity.
#[test]
fn a_line_over_the_base_ends_at_the_shoulder() {
    let model = robots::kr5();
    let q = [0.4, -1.5, 0.0, 0.3, 0.9, 0.2];
    let from = robots::pose(&model, &q);
    let wrist: Vec3 = std::array::from_fn(|i| from.position[i] - 0.115 * from.rotation[i][2]);
    let to = moved(&from, [-2.0 * wrist[0], -2.0 * wrist[1], 0.0], [0.0; 3]);
    let half = wrist[0].hypot(wrist[1]);
    let (_, distance, source) = on_leg(line(&model, &q, &to));
    let PoseError::Singular(singular) = source else { panic!("{source}") };
    assert_eq!(singular.kind, SingularKind::Shoulder, "{singular}");
    assert!(singular.joints.iter().any(|joint| joint.number() == 1), "{singular}");
    assert!(half > 0.1 && distance < half && half - distance < 0.05, "{distance} of {half}");
}

/// Both ends of the line are within reach, but some positions between them are not. These positions are in the column
/// around the axis of joint 1 that a PUMA 560 cannot enter. The error must contain the location.
#[test]
fn a_line_through_where_the_arm_cannot_reach_says_where() {
    let model = robots::puma560();
    let q = [0.4, 0.6, -0.6, 0.3, 0.9, 0.2];
    let from = robots::pose(&model, &q);
    let to = moved(&from, [-1.9 * from.position[0], -1.9 * from.position[1], 0.0], [0.0; 3]);
    let begin = from.position[0].hypot(from.position[1]);
    let (leg, distance, source) = on_leg(line(&model, &q, &to));
    let PoseError::OutOfReach { missing, .. } = source else { panic!("{source}") };
    assert!(leg == 1 && missing > 0.0, "{missing}");
    // The column has the radius 0.15005 m, which is the offset of the shoulder from the axis of joint 1.
    let inside = begin - distance;
    assert!((-0.15005..0.15005).contains(&inside), "{inside}");
    assert!((missing - (0.15005 - inside.abs())).abs() < 1e-6, "{missing} {inside}");
}

#[test]
fn what_is_no_path_is_refused_with_the_waypoint() {
    let model = robots::avena();
    let kin = Kinematics::new(&model, &WIDE);
    let q = [0.3, -0.2, 1.2, 0.4, 0.9, 0.2];
    let here = robots::pose(&model, &q);
    let near = moved(&here, [0.1, 0.0, 0.0], [0.0; 3]);
    let make = |legs: &[Leg], blend: f64| FlangePath::new(&kin, &q, legs, blend).map(|_| ()).unwrap_err();
    let lines = [Leg::Line { to: near }, Leg::Line { to: moved(&here, [0.0, 9.0, 0.0], [0.0; 3]) }];
    let error = make(&lines, 0.0);
    assert!(error.to_string().starts_with("waypoint 3: out of reach: "), "{error}");
    assert_eq!(make(&[], 0.0), PoseError::NoMotion);
    assert_eq!(make(&[Leg::Line { to: here }], 0.0), PoseError::NoMotion);
    for radius in [-0.1, f64::INFINITY] {
        assert_eq!(make(&lines, radius), PoseError::Blend { radius });
    }
    let half_turn = Pose { rotation: here.rotation.map(|[x, y, z]| [x, -y, -z]), ..near };
    let refused = |leg: Leg| match make(&[Leg::Line { to: near }, leg], 0.0) {
        PoseError::Waypoint { waypoint: 3, source } => *source,
        other => panic!("{other}"),
    };
    assert_eq!(refused(Leg::Line { to: half_turn }), PoseError::HalfTurn);
    let between = moved(&here, [0.2, 0.0, 0.0], [0.0; 3]);
    let far = moved(&here, [0.4, 0.0, 0.0], [0.0; 3]);
    let arc = |via: &Pose, to: &Pose| refused(Leg::Arc { via: via.position, to: *to });
    assert!(matches!(arc(&between, &far), PoseError::Arc { distance } if distance < 1e-12));
    assert_eq!(arc(&between, &near), PoseError::Arc { distance: 0.0 });
    let mut bent = between;
    bent.position[1] = f64::NAN;
    assert!(matches!(arc(&bent, &far), PoseError::NotFinite { .. }));
    let start = FlangePath::new(&kin, &[f64::NAN; 6], &lines, 0.0).unwrap_err();
    assert!(matches!(start, PoseError::Waypoint { waypoint: 1, .. }), "{start}");
    // Joint 4 starts at 0.4 rad. These limits exclude this position, so the error must contain waypoint 1.
    let mut limits = WIDE;
    limits[3] = (0.5, 1.0);
    let error = FlangePath::new(&Kinematics::new(&model, &limits), &q, &lines[..1], 0.0).unwrap_err();
    assert!(error.to_string().starts_with("waypoint 1: joint 4 would be at 0.4000 rad"), "{error}");
}
