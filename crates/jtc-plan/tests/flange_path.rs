//! Tests of lines and arcs of the flange. The tests use forward kinematics that share no code with the paths.
use crate::{lines, robots};

use jtc_core::{Config, Parameters};
use jtc_dynamics::{ArmModel, JOINTS, JointVec};
use jtc_plan::kinematics::{FlangePath, Kinematics, Leg, Orientation, PoseError};
use jtc_plan::{ArmDynamics, Limits, Path, along};
use lines::{Vec3, WIDE, cross, dot, moved, norm, on_leg, sub};
use proptest::prelude::*;
use robots::difference;

/// Returns arms with closed forms, and one arm without a closed form.
fn arms() -> [(&'static str, ArmModel); 4] {
    [("avena", robots::avena()), ("UR5", robots::ur5()), ("KR 5", robots::kr5()), ("Jaco 2", robots::jaco2())]
}

/// Returns a strategy for start positions that are not near a singular pose of any of the arms.
fn start() -> impl Strategy<Value = JointVec> {
    (-3.0..3.0f64, -1.2..-0.4f64, 0.6..1.6f64, -1.0..1.0f64, 0.5..1.5f64, -2.0..2.0f64)
        .prop_map(|(a, b, c, d, e, f)| [a, b, c, d, e, f])
}

fn small(size: f64) -> impl Strategy<Value = Vec3> {
    prop::array::uniform3(-size..size)
}

/// Returns the path, or `None` if a line passes near a singular pose or is out of reach.
fn path(model: &ArmModel, q: &JointVec, legs: &[Leg], blend: f64) -> Option<FlangePath> {
    match FlangePath::new(&Kinematics::new(model, &WIDE), q, legs, blend) {
        Ok(path) => Some(path),
        Err(PoseError::Leg { .. } | PoseError::Waypoint { .. }) => None,
        Err(error) => panic!("{error}"),
    }
}

/// Returns the largest deviation of the path's derivatives from differences of its positions and first derivatives.
fn deviation(path: &FlangePath, s: f64) -> f64 {
    let step = 1e-5;
    let (before, here, after) = (path.at(s - step), path.at(s), path.at(s + step));
    (0..JOINTS).fold(0.0, |worst: f64, j| {
        let first = (after.position[j] - before.position[j]) / (2.0 * step) - here.first[j];
        let second = (after.first[j] - before.first[j]) / (2.0 * step) - here.second[j];
        worst.max(first.abs() / (1.0 + here.first[j].abs())).max(second.abs() / (1.0 + here.second[j].abs()))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    /// The positions must be on the straight line between the ends, at equal distances. The orientation must rotate
    /// about one axis, in proportion to the distance.
    #[test]
    fn lines_are_straight(q in start(), shift in small(0.3), turn in small(0.6)) {
        for (name, model) in arms() {
            let from = robots::pose(&model, &q);
            let to = moved(&from, shift, turn);
            let Some(path) = path(&model, &q, &[Leg::Line { to }], 0.0) else { continue };
            prop_assert_eq!(path.waypoints(), vec![0.0, path.end()]);
            let (whole_shift, whole_turn) = difference(&from, &to);
            prop_assert!((path.end() - whole_shift.max(0.25 * whole_turn)).abs() < 1e-9);
            // Between two breaks, the joints must rotate only a little, because the planner treats this interval as one
            // simple curve.
            let ends: Vec<f64> = [0.0].into_iter().chain(path.breaks()).chain([path.end()]).collect();
            prop_assert!(ends.windows(2).all(|pair| pair[0] < pair[1]), "{name}: {ends:?}");
            for pair in ends.windows(2) {
                let (a, b) = (path.at(pair[0]).position, path.at(pair[1]).position);
                prop_assert!((0..JOINTS).all(|j| (a[j] - b[j]).abs() < 0.28), "{name}: {a:?} {b:?}");
            }
            let mut last = q;
            for k in 0..=200 {
                let share = f64::from(k) / 200.0;
                let at = path.at(share * path.end()).position;
                let here = robots::pose(&model, &at);
                let ideal = std::array::from_fn(|i| from.position[i] + share * (to.position[i] - from.position[i]));
                prop_assert!(norm(sub(here.position, ideal)) < 1e-9, "{name}: {}", norm(sub(here.position, ideal)));
                // Only on the shortest rotation between the two orientations, the angles to both ends add up to the
                // total angle.
                let (a, b) = (difference(&from, &here).1, difference(&here, &to).1);
                prop_assert!((a - share * whole_turn).abs() < 1e-7 && (b - (1.0 - share) * whole_turn).abs() < 1e-7);
                prop_assert!((0..JOINTS).all(|j| (at[j] - last[j]).abs() < 0.3), "{name}: {last:?} {at:?}");
                last = at;
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_positions(
        q in start(), shifts in prop::array::uniform3(small(0.15)), turn in small(0.4), share in 0.01..0.99f64
    ) {
        for (name, model) in arms() {
            let poses = shifts.map(|shift| moved(&robots::pose(&model, &q), shift, turn));
            let legs = [
                Leg::Line { to: poses[0] },
                Leg::Arc { via: poses[1].position, to: poses[2] },
                Leg::Line { to: robots::pose(&model, &q) },
            ];
            let Some(path) = path(&model, &q, &legs, 0.03) else { continue };
            let s = share * path.end();
            let at_break = path.breaks().iter().any(|other| (other - s).abs() < 2e-5);
            if !at_break {
                prop_assert!(deviation(&path, s) < 2e-3, "{name}: {} at {s}", deviation(&path, s));
            }
            // A blended corner must not cause a jump in the first or the second derivative.
            if path.stops().is_empty() {
                for corner in path.breaks() {
                    let (before, after) = (path.at(corner - 1e-7), path.at(corner + 1e-7));
                    for j in 0..JOINTS {
                        prop_assert!((before.first[j] - after.first[j]).abs() < 1e-3 * (1.0 + before.second[j].abs()));
                        let size = before.second[j].abs() + before.first.iter().map(|v| v.powi(2)).sum::<f64>();
                        prop_assert!((before.second[j] - after.second[j]).abs() < 1e-2 * (1.0 + size), "{name} at {corner}");
                    }
                }
            }
        }
    }

    /// The flange must stay on the circle through the three points.
    #[test]
    fn arcs_are_round(
        q in start(), radius in 0.03..0.2f64, plane in small(3.0), angles in (0.3..3.0f64, 0.3..2.5f64), turn in small(0.4)
    ) {
        for (name, model) in arms() {
            let from = robots::pose(&model, &q);
            let axes = Orientation::Rpy(plane).at([0.0; 3]).unwrap().rotation;
            let (x, y, normal) = (axes.map(|row| row[0]), axes.map(|row| row[1]), axes.map(|row| row[2]));
            let centre: Vec3 = std::array::from_fn(|i| from.position[i] - radius * x[i]);
            let point = |angle: f64| -> Vec3 {
                std::array::from_fn(|i| centre[i] + radius * (angle.cos() * x[i] + angle.sin() * y[i]))
            };
            let whole = angles.0 + angles.1;
            let mut to = moved(&from, [0.0; 3], turn);
            to.position = point(whole);
            let Some(path) = path(&model, &q, &[Leg::Arc { via: point(angles.0), to }], 0.0) else { continue };
            let whole_turn = difference(&from, &to).1;
            prop_assert!((path.end() - (radius * whole).max(0.25 * whole_turn)).abs() < 1e-9, "{name}");
            for k in 0..=100 {
                let share = f64::from(k) / 100.0;
                let here = robots::pose(&model, &path.at(share * path.end()).position);
                let off = sub(here.position, centre);
                prop_assert!((norm(off) - radius).abs() < 1e-9 && dot(off, normal).abs() < 1e-9, "{name}");
                prop_assert!(norm(sub(here.position, point(share * whole))) < 1e-8, "{name} at {share}");
                let (a, b) = (difference(&from, &here).1, difference(&here, &to).1);
                prop_assert!((a - share * whole_turn).abs() < 1e-7 && (b - (1.0 - share) * whole_turn).abs() < 1e-7);
            }
        }
    }

    /// The flange may leave the legs only within the radius of the corner, and must stay inside the triangle of the
    /// corner.
    #[test]
    fn corners_are_cut_within_their_radius(
        q in start(), shifts in prop::array::uniform2(small(0.2)), blend in 0.0..0.05f64
    ) {
        prop_assume!(shifts.iter().all(|shift| norm(*shift) > 0.02));
        for (name, model) in arms() {
            let from = robots::pose(&model, &q);
            let corner = moved(&from, shifts[0], [0.0; 3]);
            let to = moved(&corner, shifts[1], [0.0; 3]);
            let legs = [Leg::Line { to: corner }, Leg::Line { to }];
            let Some(path) = path(&model, &q, &legs, blend) else { continue };
            let bend = path.waypoints()[1];
            prop_assert!((bend - norm(shifts[0])).abs() < 1e-9);
            let radius = blend.min(0.5 * norm(shifts[0])).min(0.5 * norm(shifts[1]));
            for k in 0..=100 {
                let s = path.end() * f64::from(k) / 100.0;
                let here = robots::pose(&model, &path.at(s).position);
                let beyond = |a: Vec3, b: Vec3| norm(cross(sub(here.position, a), sub(b, a))) / norm(sub(b, a));
                let off = beyond(from.position, corner.position).min(beyond(corner.position, to.position));
                if (s - bend).abs() >= radius {
                    prop_assert!(off < 1e-9, "{name}: {off}");
                } else {
                    prop_assert!(norm(sub(here.position, corner.position)) <= radius + 1e-9);
                }
                let passed = path.waypoints().iter().filter(|&&at| at <= s).count();
                prop_assert_eq!(path.waypoint(s), Some(passed));
            }
        }
    }

    /// If a joint turns back on the path, its position range must include the turning point. A larger range must not
    /// be necessary.
    #[test]
    fn a_joint_that_turns_back_needs_the_range_up_to_there(q in start(), shift in small(0.3), turn in small(0.5)) {
        let model = robots::avena();
        let to = moved(&robots::pose(&model, &q), shift, turn);
        let Some(free) = path(&model, &q, &[Leg::Line { to }], 0.0) else { return Ok(()) };
        for joint in 0..JOINTS {
            for sign in [1.0, -1.0] {
                let at = |share: f64| sign * free.at(share * free.end()).position[joint];
                let highest = (1..200).max_by(|&a, &b| at(f64::from(a) / 200.0).total_cmp(&at(f64::from(b) / 200.0)));
                let middle = f64::from(highest.unwrap_or(0)) / 200.0;
                if at(middle) < at(0.0).max(at(1.0)) + 1e-4 {
                    continue;
                }
                let (mut low, mut high) = (middle - 0.005, middle + 0.005);
                while high - low > 1e-7 {
                    let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                    if at(a) < at(b) { low = a } else { high = b }
                }
                let top = at(low);
                let with = |limit: f64| {
                    let mut limits = WIDE;
                    if sign > 0.0 { limits[joint].1 = limit } else { limits[joint].0 = -limit }
                    FlangePath::new(&Kinematics::new(&model, &limits), &q, &[Leg::Line { to }], 0.0)
                };
                prop_assert!(with(top + 1e-6).is_ok(), "{:?}", with(top + 1e-6));
                let refused = match with(top - 1e-6) {
                    Ok(other) => {
                        // Near a singular pose, the joints may follow a different solution. This is permitted if the
                        // joint stays below `top` on the whole path.
                        let at = |k: u32| sign * other.at(other.end() * f64::from(k) / 1000.0).position[joint];
                        prop_assert!((0..=1000).all(|k| at(k) < top));
                        continue;
                    }
                    Err(error) => error,
                };
                let (_, distance, source) = on_leg(refused);
                let PoseError::OutsideLimits { joint: named, .. } = source else { panic!("{source}") };
                prop_assert_eq!(named.index(), joint);
                // The error is at the turning point of the joint, or at another turning point that is equally far.
                let short = top - at(distance / free.end());
                prop_assert!((distance - low * free.end()).abs() < 0.006 || short < 3e-6, "{distance} {low}");
            }
        }
    }

    /// The test reduces the position range of one joint. The error must be at the point at which the path without
    /// this limit leaves the range.
    #[test]
    fn a_limit_on_the_way_is_found_where_it_is(
        q in start(), shift in small(0.3), turn in small(0.5), joint in 0..JOINTS,
        share in 0.2..0.8f64
    ) {
        let model = robots::avena();
        let to = moved(&robots::pose(&model, &q), shift, turn);
        let Some(free) = path(&model, &q, &[Leg::Line { to }], 0.0) else { return Ok(()) };
        let at = |s: f64| free.at(s).position[joint];
        let all: Vec<f64> = (0..=1000).map(|k| at(free.end() * f64::from(k) / 1000.0)).collect();
        let highest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // The highest position of the joint must be clearly above its start position.
        prop_assume!(highest - q[joint] > 0.01);
        let mut limits = WIDE;
        limits[joint].1 = q[joint] + share * (highest - q[joint]);
        let error = FlangePath::new(&Kinematics::new(&model, &limits), &q, &[Leg::Line { to }], 0.0).unwrap_err();
        match error {
            PoseError::Leg { leg: 1, distance, length, source } => {
                let PoseError::OutsideLimits { joint: named, value, high, .. } = *source else { panic!("{source}") };
                prop_assert_eq!((named.index(), high), (joint, limits[joint].1));
                prop_assert!((length - free.end()).abs() < 1e-12);
                prop_assert!((at(distance) - value).abs() < 1e-9 && value > high && value < high + 0.03);
                // Until 11 mm before the reported distance, the joint must be within its limit.
                let before = all.iter().enumerate().take_while(|(k, _)| *k as f64 * free.end() / 1000.0 < distance - 0.011);
                prop_assert!(before.into_iter().all(|(_, q)| *q <= high + 1e-9), "{distance}");
            }
            // This error is also correct: every solution for the pose at the end of the line has a joint outside its
            // limits.
            PoseError::Waypoint { waypoint: 2, source } => {
                prop_assert!(matches!(*source, PoseError::OutsideLimits { .. }), "{source}");
            }
            other => panic!("{other}"),
        }
    }
}

/// During a motion along a path, the flange must be on its line at all times. The test also checks times between the
/// points that the planner checks.
#[test]
fn motions_along_lines_and_arcs_stay_on_them() {
    let (config, parameters, model) = (Config::avena(), Parameters::avena(), robots::avena());
    let limits = Limits::of(&config);
    let kin = Kinematics::new(&model, &limits.position);
    let arm = ArmDynamics::new(&config, &model, Some(&parameters.friction));
    let q = [0.3, -0.2, 1.2, 0.4, 0.9, 0.2];
    let from = robots::pose(&model, &q);
    let corner = moved(&from, [-0.3, 0.1, -0.1], [0.2, 0.1, -0.3]);
    // Half a circle, whose centre is in the middle of a vertical line.
    let mut to = moved(&corner, [0.0, 0.0, -0.2], [0.0; 3]);
    to.rotation = from.rotation;
    let centre = moved(&corner, [0.0, 0.0, -0.1], [0.0; 3]).position;
    let via = [centre[0] - 0.1, centre[1], centre[2]];
    let legs = [Leg::Line { to: corner }, Leg::Arc { via, to }];
    for blend in [0.0, 0.04] {
        let path = FlangePath::new(&kin, &q, &legs, blend).unwrap();
        assert_eq!(path.stops().len(), usize::from(blend == 0.0));
        for dynamics in [None, Some(&arm)] {
            let motion = along(&path, &limits, dynamics).unwrap();
            let mut on_legs = [0, 0];
            for k in 0..=2000 {
                let state = motion.at(motion.duration() * f64::from(k) / 2000.0);
                let here = robots::pose(&model, &state.position).position;
                let chord = sub(corner.position, from.position);
                let off_line = norm(cross(sub(here, from.position), chord)) / norm(chord);
                let off = sub(here, centre);
                let off_arc = off[1].hypot(off[0].hypot(off[2]) - 0.1);
                let at_corner = norm(sub(here, corner.position)) < blend + 1e-5;
                assert!(off_line.min(off_arc) < 1e-5 || at_corner, "{off_line} {off_arc} at {k}");
                on_legs[usize::from(off_line > off_arc)] += 1;
                for j in 0..JOINTS {
                    assert!(state.velocity[j].abs() <= limits.velocity[j] * (1.0 + 1e-9));
                    assert!(state.acceleration[j].abs() <= limits.acceleration[j] * (1.0 + 1e-9));
                }
            }
            assert!(on_legs.iter().all(|&n| n > 400), "{on_legs:?}");
            let (shift, turn) =
                difference(&robots::pose(&model, &motion.at(motion.duration()).position), &to);
            assert!(shift < 1e-9 && turn < 1e-9);
        }
    }
}
