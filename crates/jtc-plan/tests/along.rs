//! Tests of paths of any form, invalid input, long paths, and binding limits.
use std::f64::consts::TAU;

use jtc_core::{Config, Parameters, Payload};
use jtc_plan::{
    ArmDynamics, BlendedPath, JOINTS, JointVec, LimitKind, Limits, Path, PathPoint, PlanError, Waypoint,
    along, point_to_point, through,
};

use crate::judge;

/// A closed curve of sines, with a different frequency in each joint.
struct Lissajous {
    turns: f64,
    size: f64,
}

impl Path for Lissajous {
    fn end(&self) -> f64 {
        self.turns
    }

    fn at(&self, s: f64) -> PathPoint {
        let mut point = PathPoint::default();
        for j in 0..JOINTS {
            let rate = TAU * (1.0 + 0.5 * j as f64);
            let (sin, cos) = (rate * s + j as f64).sin_cos();
            point.position[j] = self.size * sin;
            point.first[j] = self.size * rate * cos;
            point.second[j] = -self.size * rate * rate * sin;
        }
        point
    }

    fn breaks(&self) -> Vec<f64> {
        (1..(8.0 * self.turns) as usize).map(|i| i as f64 / 8.0).collect()
    }
}

#[test]
fn a_curve_is_followed_within_all_limits() {
    const H: f64 = 5e-4;
    let (config, parameters) = (Config::avena(), Parameters::avena());
    let arm = ArmDynamics::new(&config, &parameters.model, Some(&parameters.friction));
    for limits in [Limits::of(&config), Limits::of(&config).without_jerk()] {
        for size in [0.02, 0.4] {
            let path = Lissajous { turns: 2.0, size };
            let motion = along(&path, &limits, Some(&arm)).unwrap();
            let count = (motion.duration() / H) as usize;
            // The motion must pass close to all points of the curve, in the order of these points.
            let mut s = 0.0;
            for k in 0..=count {
                let p: [JointVec; 4] = std::array::from_fn(|i| motion.at((k + i) as f64 * H).position);
                for j in 0..JOINTS {
                    let v = (p[1][j] - p[0][j]) / H;
                    let a = (p[2][j] - 2.0 * p[1][j] + p[0][j]) / (H * H);
                    let jerk = (p[3][j] - 3.0 * p[2][j] + 3.0 * p[1][j] - p[0][j]) / (H * H * H);
                    assert!(v.abs() <= limits.velocity[j] * 1.000_001, "velocity {v}");
                    assert!(a.abs() <= limits.acceleration[j] * 1.000_001, "acceleration {a}");
                    assert!(jerk.abs() <= limits.jerk[j] * 1.000_001 + 1e-3, "jerk {jerk}");
                }
                let torque = arm.torque(&motion.at(k as f64 * H));
                for j in 0..JOINTS {
                    assert!(torque[j].abs() <= limits.torque[j], "torque {torque:?}");
                }
                let away = nearest(&path, &p[0], &mut s);
                assert!(away < 1e-7, "{away} rad off the curve");
            }
            assert!((s - path.end()).abs() < 1e-4, "{s}");
        }
    }
}

/// Returns the distance from `q` to the curve near `s`, and moves `s` to the nearest parameter (Newton's method).
fn nearest(path: &Lissajous, q: &JointVec, s: &mut f64) -> f64 {
    for _ in 0..20 {
        let at = path.at(*s);
        let (mut slope, mut size) = (0.0, 0.0);
        for j in 0..JOINTS {
            slope += at.first[j] * (q[j] - at.position[j]);
            size += at.first[j] * at.first[j];
        }
        *s += slope / size;
    }
    let at = path.at(*s).position;
    (0..JOINTS).map(|j| (at[j] - q[j]).abs()).fold(0.0, f64::max)
}

#[test]
fn ten_thousand_waypoints_are_planned_through() {
    let limits = Limits::of(&Config::avena());
    let waypoints: Vec<Waypoint> = (0..10_000)
        .map(|i| Waypoint::from(std::array::from_fn(|j| 1.2 * (0.7 * f64::from(i) + 1.3 * j as f64).sin())))
        .collect();
    let motion = through(&waypoints, 0.1, &limits, None).unwrap();
    assert_eq!(motion.waypoint_times().len(), 10_000);
    assert!(motion.duration() > 5_000.0 && motion.duration() < 20_000.0, "{}", motion.duration());
}

#[test]
fn bad_input_is_refused_with_waypoint_and_joint() {
    let limits = Limits::of(&Config::avena());
    let to = |q: [f64; 6]| {
        through(&[[0.0; 6].into(), [0.1; 6].into(), q.into()], 0.05, &limits, None).unwrap_err()
    };
    assert_eq!(through(&[], 0.0, &limits, None).unwrap_err(), PlanError::TooFew { count: 0 });
    assert_eq!(through(&[[0.0; 6].into()], 0.0, &limits, None).unwrap_err(), PlanError::TooFew { count: 1 });
    let error = to([0.0, 0.0, f64::NAN, 0.0, 0.0, 0.0]);
    assert_eq!(error.to_string(), "waypoint 3, joint 3: NaN is not a valid position");
    let error = to([0.0, 0.0, 0.0, 90.0, 0.0, 0.0]);
    assert_eq!(error.to_string(), "waypoint 3, joint 4: 90 rad is outside -2.97..2.97 rad");
    assert!(error.hint().contains("degrees"));
    let two = [[0.0; 6].into(), [0.1; 6].into()];
    for blend in [-0.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(through(&two, blend, &limits, None), Err(PlanError::Blend { .. })));
    }
    for value in [0.0, -1.0, f64::NAN, 1e-12] {
        let mut velocity = limits.clone();
        velocity.velocity[2] = value;
        let mut jerk = limits.clone();
        jerk.jerk[5] = value;
        for (limits, kind, number) in [(velocity, LimitKind::Velocity, 3), (jerk, LimitKind::Jerk, 6)] {
            let Err(PlanError::Limit { joint, limit, .. }) = through(&two, 0.0, &limits, None) else {
                panic!()
            };
            assert_eq!((limit, joint.number()), (kind, number));
            assert!(matches!(
                point_to_point(&[0.0; 6], &[0.1; 6], &limits, None),
                Err(PlanError::Limit { .. })
            ));
        }
    }
    assert!(BlendedPath::new(&[[f64::NAN; 6]; 2], 0.1).is_err());
    assert!(BlendedPath::new(&[[0.5; 6]; 3], 0.1).is_err());
}

#[test]
fn waypoints_at_one_place_are_a_rest() {
    let limits = Limits::of(&Config::avena());
    let at = Waypoint::from([0.3; 6]);
    for motion in [
        through(&[at, at, at], 0.1, &limits, None).unwrap(),
        point_to_point(&[0.3; 6], &[0.3; 6], &limits, None).unwrap(),
    ] {
        assert_eq!(motion.duration(), 0.01);
        assert_eq!(motion.at(0.005).position, [0.3; 6]);
        assert_eq!(motion.at(0.005).velocity, [0.0; 6]);
    }
}

/// J-60: the payload determines whether the arm can be held at the end position. The error contains the holding torque.
#[test]
fn j60_a_pose_that_cannot_be_held_is_named() {
    let (mut config, parameters) = (Config::avena(), Parameters::avena());
    config.payload = Payload { mass: 12.0, com: [0.0, 0.0, 0.1], inertia: [0.0; 6] };
    let limits = Limits::of(&config);
    let arm = ArmDynamics::new(&config, &parameters.model, None);
    let stretched = [0.0, 1.5, 0.0, 0.0, 0.0, 0.0];
    for error in [
        point_to_point(&[0.0; 6], &stretched, &limits, Some(&arm)).unwrap_err(),
        through(&[[0.0; 6].into(), stretched.into()], 0.0, &limits, Some(&arm)).unwrap_err(),
    ] {
        let PlanError::Torque { waypoint, joint, torque, limit, holding, .. } = error.clone() else {
            panic!("{error}")
        };
        assert!(holding && waypoint == 2 && joint.number() == 2 && torque > limit, "{error}");
        assert!(error.to_string().contains("holding the arm there"), "{error}");
    }
    // If two consecutive waypoints have this position, the error contains the first one of these waypoints.
    for blend in [0.0, 0.05] {
        let waypoints = [[0.0; 6], stretched, stretched, [0.0; 6]].map(Waypoint::from);
        let error = through(&waypoints, blend, &limits, Some(&arm)).unwrap_err();
        assert_eq!(error.waypoint(), Some(2), "{error}");
    }
    // Without the payload, the controller can hold the arm.
    config.payload = Payload::NONE;
    let arm = ArmDynamics::new(&config, &parameters.model, None);
    assert!(point_to_point(&[0.0; 6], &stretched, &limits, Some(&arm)).is_ok());
}

/// J-36: with any limits, the velocities of a motion must stay within the range of the friction table.
#[test]
fn j36_velocities_stay_inside_the_friction_table() {
    let (config, parameters) = (Config::avena(), Parameters::avena());
    let friction = Parameters::avena_friction_table();
    let arm = ArmDynamics::new(&config, &parameters.model, Some(&friction));
    let limits = Limits::of(&config);
    let to = [2.0, 0.3, -1.0, 0.5, 0.0, 1.0];
    for limits in [limits.clone(), limits.without_jerk()] {
        for motion in [
            point_to_point(&[0.0; 6], &to, &limits, Some(&arm)).unwrap(),
            through(&[[0.0; 6].into(), [0.5; 6].into(), to.into()], 0.1, &limits, Some(&arm)).unwrap(),
        ] {
            let fastest =
                (0..2000).flat_map(|i| motion.at(motion.duration() * f64::from(i) / 2000.0).velocity);
            let fastest = fastest.fold(0.0, |m: f64, v| m.max(v.abs()));
            assert!(fastest <= 0.815_71 && fastest > 0.7, "{fastest}");
        }
    }
}

#[test]
fn a_long_move_is_bound_by_the_speed_of_the_joint_that_goes_farthest() {
    let limits = Limits::of(&Config::avena());
    let motion =
        point_to_point(&[-2.5, 0.0, 0.0, 0.0, 0.0, 0.0], &[2.5, 0.4, 0.0, 0.0, 0.0, 0.0], &limits, None)
            .unwrap();
    let longest = motion.binding().iter().max_by(|a, b| (a.to - a.from).total_cmp(&(b.to - b.from))).unwrap();
    assert_eq!((longest.joint.number(), longest.limit), (1, LimitKind::Velocity));
    assert!(longest.to - longest.from > 0.8 * motion.duration());
    let first = &motion.binding()[0];
    assert_eq!((first.from, first.limit), (0.0, LimitKind::Jerk));
}

/// If the speed is halved, the duration of a motion must double.
#[test]
fn a_share_of_the_speed_stretches_the_motion() {
    let limits = Limits::of(&Config::avena());
    let waypoints =
        [[0.0; 6], [0.5, -0.3, 0.4, 0.0, 0.2, 0.0], [0.9, 0.1, 0.4, 0.5, 0.0, 0.3]].map(Waypoint::from);
    for limits in [limits.clone(), limits.without_jerk()] {
        let duration =
            |share: f64| through(&waypoints, 0.05, &limits.at_speed(share), None).unwrap().duration();
        let (whole, half) = (duration(1.0), duration(0.5));
        assert!((half / whole - 2.0).abs() < 0.01, "{half} {whole}");
        assert!((duration(0.05) / whole - 20.0).abs() < 0.1);
    }
}

/// A motion with a blend must never be slower than a motion with a stop at each waypoint.
#[test]
fn rounded_corners_are_faster_than_stops_without_a_limit_of_jerk() {
    let limits = Limits::of(&Config::avena()).without_jerk();
    for seed in 0..20 {
        let mut case = judge::Case::random(seed);
        case.limits = limits.clone();
        let stops = through(&case.given(), 0.0, &case.limits, None).unwrap().duration();
        let rounded = through(&case.given(), 0.2, &case.limits, None).unwrap().duration();
        assert!(rounded <= stops * 1.01, "seed {seed}: {rounded} {stops}");
    }
}
