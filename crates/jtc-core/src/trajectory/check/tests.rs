//! Comparison of the check with dense samples of the values that the controller computes between points.
extern crate std;
use std::vec::Vec;

use jtc_wire::{ACCELERATION_SCALE, RAW_FULL_SCALE};
use proptest::prelude::*;

use super::*;
use crate::interpolation::interpolate;

/// Returns settings in which the lower and the upper position limit of each joint have different magnitudes.
fn config() -> Config {
    let mut config = Config::avena();
    for limit in &mut config.joints {
        (limit.position_min, limit.position_max) = (-0.7, 1.3);
        (limit.velocity_max, limit.acceleration_max) = (1.5, 8.0);
    }
    config
}

/// Returns a point with these values (rad, rad/s, rad/s²) in joint `j`, and zeros in the other joints.
fn point(j: usize, q: f64, v: f64, a: f64) -> RawPoint {
    let mut point = RawPoint::default();
    point.position[j] = (q / POSITION_STEP).round() as i16;
    point.velocity[j] = (v / VELOCITY_STEP).round() as i16;
    point.acceleration[j] = (a / (ACCELERATION_SCALE / RAW_FULL_SCALE)).round() as i16;
    point
}

/// Returns the largest effect of rounding on a position. This effect is one position step, plus a change in the
/// middle of the quintic. For this change, the velocities of the two points are wrong by one step in opposite
/// directions.
fn tolerance(step_ms: u16) -> f64 {
    let moving = |v: f64| SetPoint { velocity: [v * 6.283185 / 32767.0; JOINTS], ..SetPoint::default() };
    let (a, b) = (moving(1.0), moving(-1.0));
    3.141592 / 32767.0 + interpolate(&a, &b, f64::from(step_ms) / 1000.0, 0.5).position[0]
}

/// Returns the result of the check for `b` and for the interval from `a` to `b`.
fn between(config: &Config, step_ms: u16, a: &RawPoint, b: &RawPoint) -> Result<(), Violation> {
    let check = TrajectoryCheck::new(config, step_ms, None);
    check.behind(1, *a, Passed::default()).take(b)
}

/// Samples the motion of joint `j` between two points. Returns the extremes of the position, the velocity, and the derivative of the
/// position. The distance for this derivative is reduced by one position step.
fn sampled(j: usize, step_ms: u16, a: &RawPoint, b: &RawPoint) -> ([f64; 2], f64, f64) {
    let (a, b, h) = (SetPoint::from(a), SetPoint::from(b), f64::from(step_ms) / 1000.0);
    let (a0, a1) = (a.acceleration[j], b.acceleration[j]);
    let way = 0.5 * h * (a.velocity[j] + b.velocity[j]) + h * h * (a0 - a1) / 12.0;
    let rest = b.position[j] - a.position[j] - way;
    let rest = rest - rest.clamp(-POSITION_STEP, POSITION_STEP);
    let (mut position, mut velocity, mut speed) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0f64, 0.0f64);
    for k in 0..=1000 {
        let u = f64::from(k) / 1000.0;
        let at = interpolate(&a, &b, h, u);
        position = [position[0].min(at.position[j]), position[1].max(at.position[j])];
        velocity = velocity.max(at.velocity[j].abs());
        speed = speed.max((at.velocity[j] + 30.0 * rest / h * u * u * (1.0 - u) * (1.0 - u)).abs());
    }
    (position, velocity, speed)
}

/// Returns the margins to the limits of joint 0 around two points, for any signs of the velocities and accelerations:
///
/// - margins of the hull of the positions to the lower and to the upper position limit, rad
/// - margin of the hull of the velocities to the velocity limit, rad/s; this hull includes the bump for the
///   unexplained distance, reduced by one step
/// - margin of the acceleration of `b`, rad/s²
fn room(config: &Config, step_ms: u16, a: &RawPoint, b: &RawPoint) -> [f64; 4] {
    let (limit, h, more) = (&config.joints[0], f64::from(step_ms) / 1000.0, tolerance(step_ms));
    let [a, b] = [a, b].map(|point| {
        let at = SetPoint::from(point);
        (at.position[0], at.velocity[0], at.acceleration[0])
    });
    let around = [a, b].map(|(_, v, a)| 2.0 / 5.0 * v.abs() * h + a.abs() * h * h / 20.0);
    let fastest = [a, b].map(|(_, v, a)| v.abs() + a.abs() * h / 3.0);
    let explained = h * (a.1 + b.1) / 2.0 + h * h * (a.2 - b.2) / 12.0;
    // The factor 30/16 is the maximum of 30·u²·(1 − u)², which is at u = 1/2.
    let bump = 30.0 / 16.0 * ((b.0 - a.0 - explained).abs() - POSITION_STEP).max(0.0) / h;
    let (around, fastest) = (around[0].max(around[1]), fastest[0].max(fastest[1]));
    [
        a.0.min(b.0) - around - limit.position_min + more,
        limit.position_max + more - a.0.max(b.0) - around,
        limit.velocity_max - fastest - bump,
        limit.acceleration_max - b.2.abs(),
    ]
}

/// Returns a time between points from 1 ms to 1 s, and two points near the limits.
fn pair() -> impl Strategy<Value = (u16, RawPoint, RawPoint)> {
    let step = prop::sample::select(&[1u16, 2, 5, 10, 20, 50, 100, 250, 1000][..]);
    (
        step,
        -0.72..1.32f64,
        prop::array::uniform2(-1.52..1.52f64),
        prop::array::uniform2(-8.1..8.1f64),
        -0.3..0.3f64,
    )
        .prop_map(|(step, q, [v0, v1], [a0, a1], off)| {
            let h = f64::from(step) / 1000.0;
            // Scales an acceleration so that it changes the velocity within the interval by less than the velocity limit.
            let bend = |a: f64| a / (1.0 + 4.0 * h);
            let v1 = v0 + (v1 - v0) * (8.0 * h).min(1.0);
            let way = 0.5 * h * (v0 + v1) + off * h * 1.5;
            (step, point(0, q, v0, bend(a0)), point(0, q + way, v1, bend(a1)))
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// The check must refuse every motion with a sample outside the limits. The check must accept every motion whose
    /// samples keep a margin of 0.01 to the limits.
    #[test]
    fn j36_the_verdict_is_that_of_dense_samples((step, a, b) in pair()) {
        let config = config();
        let ([low, high], velocity, speed) = sampled(0, step, &a, &b);
        let (verdict, more) = (between(&config, step, &a, &b), tolerance(step));
        // This test uses only paths that begin inside the limits. Other tests cover the other paths.
        let before = a.position_rad()[0];
        prop_assume!((-0.7 - more..=1.3 + more).contains(&before));
        let over = |margin: f64| {
            low < -0.7 - more + margin || high > 1.3 + more - margin || velocity > 1.5 - margin || speed > 1.5 - margin
                || b.acceleration_rad_s2()[0].abs() > 8.0
        };
        if over(0.0) {
            prop_assert!(verdict.is_err(), "{low}..{high} rad, {velocity} and {speed} rad/s passed");
        }
        if !over(0.01) {
            prop_assert!(verdict.is_ok(), "{low}..{high} rad, {velocity} and {speed} rad/s: {verdict:?}");
        }
    }

    /// Each interval that passes the quick part of the check also passes the exact part.
    #[test]
    fn j36_the_screen_passes_nothing_that_the_judge_refuses((step, a, b) in pair()) {
        let mut check = TrajectoryCheck::new(&config(), step, None);
        check = check.behind(1, a, Passed::default());
        let passed = check.screen.passes(&Steps::from(&a), &Steps::from(&b));
        // The quick part of the check also uses the first point. The exact part checks only the second point and the interval before it.
        prop_assert!(!passed || check.judge(&b).is_ok(), "{:?}", check.judge(&b));
    }

    /// An interval passes the quick part of the check if and only if its whole hull is within the limits. In half of
    /// the cases, the test moves the points so that the hull ends within one step of a position limit.
    #[test]
    fn j36_the_screen_passes_what_has_its_hull_within_the_limits((step, a, b) in pair(), side in 0..4u8) {
        let (config, mut a, mut b) = (config(), a, b);
        let [low, high, ..] = room(&config, step, &a, &b);
        let shift = [0.0, 0.0, -low, high][usize::from(side)] / POSITION_STEP;
        for point in [&mut a, &mut b] {
            point.position[0] += shift.round() as i16;
        }
        let passed = TrajectoryCheck::new(&config, step, None).screen.passes(&Steps::from(&a), &Steps::from(&b));
        let room = room(&config, step, &a, &b);
        // If the hull ends in the last tenth of a step before a limit, the exact part decides.
        let tenth = 0.11 * POSITION_STEP;
        let left = [tenth, tenth, tenth / (f64::from(step) / 1000.0) + 1e-5, 1e-4];
        prop_assert!(!passed || room.iter().all(|&r| r >= -1e-6), "{room:?} passed");
        prop_assert!(passed || room.iter().zip(left).any(|(&r, left)| r <= left), "{room:?} did not pass");
    }

    /// A path within the velocity limit is accepted after rounding to steps of the wire format.
    #[test]
    fn j36_rounding_of_a_path_at_full_speed_is_no_violation(q in -0.5..0.5f64, step in 1u16..50) {
        let v = 7820.0 * VELOCITY_STEP;
        let way = v * f64::from(step) / 1000.0;
        prop_assert_eq!(between(&config(), step, &point(0, q, v, 0.0), &point(0, q + way, v, 0.0)), Ok(()));
    }
}

#[test]
fn j36_each_limit_is_found_and_named() {
    let config = config();
    let check = |a: RawPoint, b: RawPoint, step| {
        let v = between(&config, step, &a, &b).unwrap_err();
        assert_eq!(v.joint, 4);
        (v.point, v.quantity, v.limit, v.fraction)
    };
    let at = |q, v, a| point(4, q, v, a);
    use Quantity::*;
    // The lower and the upper position limit of a joint have different magnitudes.
    assert_eq!(check(at(-0.69, 0.0, 0.0), at(-0.71, 0.0, 0.0), 100), (1, Position, -0.7, 0.0));
    assert!(between(&config, 100, &at(0.69, 0.0, 0.0), &at(0.71, 0.0, 0.0)).is_ok());
    assert_eq!(check(at(1.29, 0.0, 0.0), at(1.31, 0.0, 0.0), 100), (1, Position, 1.3, 0.0));
    assert_eq!(check(at(0.0, 1.49, 0.0), at(0.015, 1.51, 0.0), 10), (1, Velocity, 1.5, 0.0));
    assert_eq!(check(at(0.0, -1.49, 0.0), at(-0.015, -1.51, 0.0), 10), (1, Velocity, -1.5, 0.0));
    assert_eq!(check(at(0.0, 0.0, 0.0), at(0.0, 0.0, -8.1), 10), (1, Acceleration, -8.0, 0.0));
    // The next violations lie between the points: a position above its upper limit, a velocity curve above the
    // velocity limit, and a derivative of the position that exceeds the velocity limit.
    let (point, quantity, limit, fraction) = check(at(1.25, 1.0, 0.0), at(1.25, -1.0, 0.0), 400);
    assert_eq!((point, quantity, limit), (0, Position, 1.3));
    assert!((0.2..0.8).contains(&fraction), "{fraction}");
    let (point, quantity, limit, _) = check(at(0.0, 1.4, 7.0), at(0.15, 1.4, -7.0), 100);
    assert_eq!((point, quantity, limit), (0, Velocity, 1.5));
    let (point, quantity, limit, fraction) = check(at(0.0, 0.0, 0.0), at(-0.0085, 0.0, 0.0), 10);
    assert_eq!((point, quantity, limit), (0, PositionSpeed, -1.5));
    assert!((0.3..0.7).contains(&fraction), "{fraction}");
    assert!(between(&config, 10, &at(0.0, 0.0, 0.0), &at(-0.0079, 0.0, 0.0)).is_ok());
}

#[test]
fn j36_a_path_begins_and_ends_at_rest() {
    let slow = |v: f64| point(2, 0.0, v, 0.0);
    let begin = |p| TrajectoryCheck::new(&config(), 10, None).take(&p);
    assert_eq!(begin(slow(0.0199)), Ok(()));
    assert_eq!(
        begin(slow(-0.021)).map_err(|v| (v.joint, v.quantity, v.limit)),
        Err((2, Quantity::Rest, -0.02))
    );
    let mut check = TrajectoryCheck::new(&config(), 10, None);
    assert_eq!((check.take(&slow(0.0)), check.take(&slow(0.03))), (Ok(()), Ok(())));
    assert_eq!(check.end().map_err(|v| (v.point, v.quantity)), Err((1, Quantity::Rest)));
    assert_eq!((check.take(&slow(0.01)), check.end()), (Ok(()), Ok(())));
}

#[test]
fn j36_velocities_are_inside_the_friction_table_in_use() {
    let crate::Friction::Table(tables) = crate::Parameters::avena_friction_table() else {
        panic!("no table")
    };
    let (low, high) = friction::velocities(&tables[3]);
    assert!(low > -1.0 && high < 1.0 && low != -high);
    let with = |v: f64| {
        let mut check = TrajectoryCheck::new(&config(), 1000, Some(&tables));
        [0.0, 0.4 * v, v]
            .map(|v| check.take(&point(3, 0.0, v, 0.0)))
            .into_iter()
            .collect::<Result<(), _>>()?;
        Ok(check.passed())
    };
    let inside = with(high - 0.001).expect("inside");
    assert_eq!(inside_tables(&inside.speeds, &tables), Ok(()));
    let refused = with(high + 0.001).map_err(|v: Violation| (v.point, v.joint, v.quantity, v.limit));
    assert_eq!(refused, Err((2, 3, Quantity::FrictionVelocity, high)));
    // The trajectory is loaded while the controller uses no friction table. The later check of the trajectory against
    // a table must find the same violation.
    let mut check = TrajectoryCheck::new(&config(), 1000, None);
    for v in [0.0, -0.4, low - 0.001, low - 0.001, 0.0] {
        check.take(&point(3, 0.0, v, 0.0)).unwrap();
    }
    let later =
        inside_tables(&check.passed().speeds, &tables).map_err(|v| (v.point, v.joint, v.quantity, v.limit));
    assert_eq!(later, Err((2, 3, Quantity::FrictionVelocity, low)));
    // If several points are equally fast, the check must report the first of them. The test covers both directions of
    // the motion.
    let mut check = TrajectoryCheck::new(&config(), 1000, None);
    for v in [0.0, 0.4, high + 0.001, high + 0.001, 0.0] {
        check.take(&point(3, 0.0, v, 0.0)).unwrap();
    }
    let later =
        inside_tables(&check.passed().speeds, &tables).map_err(|v| (v.point, v.joint, v.quantity, v.limit));
    assert_eq!(later, Err((2, 3, Quantity::FrictionVelocity, high)));
}

/// An accelerating joint can be faster between two points than at the points. The check therefore uses the hull of the velocity curve.
#[test]
fn j36_a_table_that_is_loaded_later_has_to_hold_what_lies_between_the_points() {
    let crate::Friction::Table(tables) = crate::Parameters::avena_friction_table() else {
        panic!("no table")
    };
    let (low, high) = friction::velocities(&tables[3]);
    // At a control point, the acceleration adds a third of the velocity change that it causes within the step.
    for (step, a) in [(100, 0.6), (300, 0.2)] {
        for (v, a) in [(high - 0.01, a), (high - 0.01, -a), (low + 0.01, -a), (low + 0.01, a)] {
            let later = |a: f64| {
                let mut check = TrajectoryCheck::new(&config(), step, None);
                for p in [point(3, 0.0, 0.0, 0.0), point(3, 0.0, v, a)] {
                    // The motion may violate other limits, which do not matter in this test.
                    let _ = check.take(&p);
                }
                inside_tables(&check.passed().speeds, &tables).map_err(|v| (v.point, v.limit))
            };
            assert_eq!(later(a), Err((1, if v > 0.0 { high } else { low })), "{step} ms");
            assert_eq!(later(0.4 * a), Ok(()), "{step} ms");
        }
    }
}

#[test]
fn j36_the_first_step_beyond_the_velocity_limit_is_refused_at_every_step_time() {
    for step in [1, 2, 5, 20, 100] {
        let at = |raw: f64| {
            let v = raw * VELOCITY_STEP;
            between(&config(), step, &point(1, 0.0, v, 0.0), &point(1, v * f64::from(step) / 1000.0, v, 0.0))
        };
        let last = (1.5 / VELOCITY_STEP).floor();
        assert_eq!((at(last), at(-last)), (Ok(()), Ok(())), "{step} ms");
        for sign in [1.0, -1.0] {
            let quantity = at(sign * (last + 1.0)).map_err(|v| v.quantity);
            assert_eq!(quantity, Err(Quantity::Velocity), "{step} ms");
        }
    }
}

#[test]
fn j36_a_table_that_leaves_standstill_out_is_no_table_for_a_path() {
    let crate::Friction::Table(mut tables) = crate::Parameters::avena_friction_table() else {
        panic!("no table")
    };
    tables[5].velocity = core::array::from_fn(|i| 0.01 + 0.1 * i as f32);
    let refused = TrajectoryCheck::new(&config(), 10, Some(&tables)).take(&point(5, 0.0, 0.015, 0.0));
    let v = refused.unwrap_err();
    assert_eq!((v.joint, v.quantity, v.value), (5, Quantity::FrictionVelocity, 0.0));
}

/// The host may change the friction model between two segments. Before the path is executed, the controller therefore
/// checks that the friction table contains the velocities of all points, and velocity 0.
#[test]
fn j36_standstill_is_asked_at_the_first_point_and_when_the_path_is_executed() {
    let crate::Friction::Table(mut tables) = crate::Parameters::avena_friction_table() else {
        panic!("no table")
    };
    tables[5].velocity = core::array::from_fn(|i| 0.01 + 0.1 * i as f32);
    let moving = |q: f64| point(5, q, 0.2, 0.0);
    let check = TrajectoryCheck::new(&config(), 10, Some(&tables));
    // The quick part of the check assumes velocities of both signs. This interval therefore does not pass the quick
    // part, and the exact part decides.
    let mut check = check.behind(1, moving(0.0), Passed::default());
    assert_eq!(check.take(&moving(0.002)), Ok(()));
    let later = inside_tables(&check.passed().speeds, &tables).map_err(|v| (v.joint, v.value));
    assert_eq!(later, Err((5, 0.0)));
}

#[test]
fn j36_where_the_halvings_are_used_up_the_hull_decides() {
    // The curve is a parabola with the maximum 0.5. Its control points, and therefore its hull, reach 1.
    let curve = [0.0, 1.0, 0.0];
    let mut many = HALVINGS;
    assert_eq!(leaves(curve, -1.0, 0.501, &mut many), None);
    assert!(many > 0 && many < HALVINGS);
    let (mut none, mut used) = (0, 1);
    let hull = Leaves { at: 0.5, value: 1.0, bound: 0.501 };
    assert_eq!(leaves(curve, -1.0, 0.501, &mut none), Some(hull));
    assert!(leaves(curve, -1.0, 0.4999, &mut used).is_some(), "seen outside where it is halved");
    let mut enough = HALVINGS;
    assert_eq!(
        leaves(curve, -1.0, 0.5, &mut enough),
        None,
        "the top itself is a control point of both halves"
    );
}

/// Returns the result of the check for a whole trajectory.
fn verdict(config: &Config, step_ms: u16, points: &[RawPoint]) -> Result<(), Violation> {
    let mut check = TrajectoryCheck::new(config, step_ms, None);
    points.iter().try_for_each(|point| check.take(point))?;
    check.end()
}

/// Returns a quintic motion of joint `j` from rest to rest, in `steps` steps.
fn quintic(j: usize, from: f64, to: f64, step_ms: u16, steps: u32) -> Vec<RawPoint> {
    let seconds = f64::from(steps) * f64::from(step_ms) / 1000.0;
    (0..=steps)
        .map(|k| {
            let (u, w) = (f64::from(k) / f64::from(steps), 1.0 - f64::from(k) / f64::from(steps));
            let q = from + (to - from) * u * u * u * (10.0 + u * (6.0 * u - 15.0));
            let v = (to - from) * 30.0 * u * u * w * w / seconds;
            let a = (to - from) * 60.0 * u * w * (1.0 - 2.0 * u) / (seconds * seconds);
            point(j, q, v, a)
        })
        .collect()
}

/// Returns a time between points and a number of steps that are sufficient for a distance of up to 0.5 rad within the limits.
fn steps() -> impl Strategy<Value = (u16, u32)> {
    let step = prop::sample::select(&[1u16, 2, 7, 10, 40, 100, 300, 1000][..]);
    (step, 1.0..4.0f64).prop_map(|(step, seconds)| (step, (seconds * 1000.0 / f64::from(step)).ceil() as u32))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    /// A path that is within its limits before the rounding to the wire format must pass, even if the path stays on a
    /// limit or ends on a limit.
    #[test]
    fn j36_a_path_that_ends_on_a_limit_passes(
        (step, count) in steps(), limit in -2.0..2.0f64, way in 0.0..0.5f64, up in any::<bool>(), joint in 0..JOINTS,
    ) {
        let (mut config, sign) = (config(), if up { 1.0 } else { -1.0 });
        let there = if up { &mut config.joints[joint].position_max } else { &mut config.joints[joint].position_min };
        *there = limit;
        let other = if up { &mut config.joints[joint].position_min } else { &mut config.joints[joint].position_max };
        *other = limit - 3.0 * sign;
        let mut points = quintic(joint, limit - sign * way, limit, step, count);
        prop_assert_eq!(verdict(&config, step, &points), Ok(()));
        let mut back = points.clone();
        back.reverse();
        back.iter_mut().for_each(|point| point.velocity[joint] = -point.velocity[joint]);
        points.extend(back);
        prop_assert_eq!(verdict(&config, step, &points), Ok(()));
    }

    /// A path must pass if its joint begins outside its position limits and moves inwards within the velocity limit.
    /// A joint that stays at its first position must pass as well.
    #[test]
    fn j36_a_path_that_begins_outside_and_goes_inwards_passes(
        (step, count) in steps(), out in 0.0..0.02f64, way in 0.0..0.5f64, up in any::<bool>(), joint in 0..JOINTS,
    ) {
        let from = if up { 1.3 + out } else { -0.7 - out };
        let to = if up { from - way } else { from + way };
        let points = quintic(joint, from, to, step, count);
        prop_assert_eq!(verdict(&config(), step, &points), Ok(()), "{} to {}, step {} {}", from, to, step, count);
    }

    /// The check refuses a path that moves further out of the limits by more than rounding, in any interval.
    #[test]
    fn j36_a_path_that_begins_outside_comes_no_further_out(
        (step, count) in steps(), out in 0.002..0.02f64, more in 0.0003..0.5f64, up in any::<bool>(), joint in 0..JOINTS,
        first in 0.0..0.9f64,
    ) {
        let from = if up { 1.3 + out } else { -0.7 - out };
        let away = |way: f64| if up { from + way } else { from - way };
        // The path moves inwards by a part of the distance to the limit, and then out again.
        let inner = -first * out;
        let mut points = quintic(joint, from, away(inner), step, count);
        points.extend(quintic(joint, away(inner), away(inner + more), step, count).into_iter().skip(1));
        let violation = verdict(&config(), step, &points).unwrap_err();
        let limit = if up { 1.3 } else { -0.7 };
        prop_assert_eq!((violation.joint, violation.quantity, violation.limit), (joint, Quantity::Position, limit));
        prop_assert!(violation.point >= count - 1, "{:?}", violation);
        prop_assert!((violation.value - limit).abs() > 1e-4 && (violation.value > limit) == up, "{:?}", violation);
    }
}

#[test]
fn j36_the_tolerance_of_a_position_ends_with_its_step() {
    for step in [1, 10, 100, 1000] {
        for (limit, sign) in [(1.3, 1.0), (-0.7, -1.0)] {
            let last = ((limit + sign * tolerance(step)) / POSITION_STEP).trunc();
            let at = |raw: f64| {
                let points: Vec<_> = [0.0, 0.0, 0.5]
                    .iter()
                    .map(|back| point(2, (raw - sign * back) * POSITION_STEP, 0.0, 0.0))
                    .collect();
                verdict(&config(), step, &[points[0], points[1], points[2]])
            };
            // All points of this path are at the same position outside the limit, by less than the start tolerance,
            // so the path passes.
            assert_eq!(at(last), Ok(()), "{step} ms");
            let from_inside = |raw: f64| {
                between(&config(), step, &point(2, limit, 0.0, 0.0), &point(2, raw * POSITION_STEP, 0.0, 0.0))
            };
            assert_eq!(from_inside(last), Ok(()), "{step} ms");
            let refused = from_inside(last + sign).map_err(|v| (v.point, v.joint, v.quantity, v.limit));
            assert_eq!(refused, Err((1, 2, Quantity::Position, limit)), "{step} ms");
        }
    }
    // The tolerance is one position step (96 µrad). At 1 s between points, the effect of one velocity step adds 60 µrad.
    assert!((tolerance(1) - 96e-6).abs() < 1e-6 && (tolerance(1000) - 156e-6).abs() < 1e-6);
}

#[test]
fn j36_the_tolerance_ends_with_the_working_area_of_the_drives() {
    let mut config = config();
    for joint in &mut config.joints {
        (joint.position_min, joint.position_max) = (-2.9905, 2.9905);
    }
    // In the wire format, 2.99048 rad is the last position inside the limits, and 2.99058 rad is outside by less than one step.
    for (raw, inside) in [(31_191, true), (31_192, false)] {
        for sign in [1, -1] {
            for keeps in [true, false] {
                config.joint_config_bits = if keeps { 1 } else { 0 };
                let at = |raw: i16| RawPoint { position: [0, 0, 0, sign * raw, 0, 0], ..RawPoint::default() };
                let passes = between(&config, 10, &at(31_191), &at(raw)).is_ok();
                assert_eq!(passes, inside || !keeps, "{sign} {raw} {keeps}");
            }
        }
    }
}

#[test]
fn j36_a_path_begins_outside_by_the_start_tolerance_at_most() {
    let mut config = config();
    for start in [0.02, 0.005] {
        config.start_tolerance_rad = start;
        for (limit, sign) in [(1.3, 1.0), (-0.7, -1.0)] {
            let begins = |out: f64| {
                let from = limit + sign * out;
                verdict(&config, 10, &quintic(1, from, limit - sign * 0.3, 10, 200))
            };
            assert_eq!((begins(start), begins(0.5 * start)), (Ok(()), Ok(())));
            let refused = begins(start + 0.0005).map_err(|v| (v.point, v.joint, v.quantity, v.limit));
            assert_eq!(refused, Err((0, 1, Quantity::Position, limit)));
        }
    }
}

#[test]
fn j36_a_path_that_has_come_inside_stays_there() {
    let config = config();
    // The path moves from 10 mrad outside the limit to 10 mrad inside, and then back to its first position.
    let mut points = quintic(4, 1.31, 1.29, 10, 150);
    points.extend(quintic(4, 1.29, 1.31, 10, 150).into_iter().skip(1));
    let violation = verdict(&config, 10, &points).unwrap_err();
    assert!(violation.point > 150 && violation.quantity == Quantity::Position, "{violation:?}");
    assert!((violation.value - 1.3001).abs() < 2e-4, "{violation:?}");
    // After the path has moved inside, it may end on the limit like any other path.
    let mut points = quintic(4, 1.31, 1.29, 10, 150);
    points.extend(quintic(4, 1.29, 1.3, 10, 150).into_iter().skip(1));
    assert_eq!(verdict(&config, 10, &points), Ok(()));
    // The allowance for a start outside the limits does not apply to a joint that was never outside.
    let mut points = quintic(4, 1.31, 1.29, 10, 150);
    points.last_mut().unwrap().position[3] = (1.301 / POSITION_STEP) as i16;
    let violation = verdict(&config, 10, &points).unwrap_err();
    assert_eq!((violation.joint, violation.quantity), (3, Quantity::Position));
}

/// The two points are outside the limits, and the second point is closer to the limit. The joint must not move
/// further out between the two points either.
#[test]
fn j36_between_two_points_a_path_comes_no_further_out_either() {
    let after = |step, a: RawPoint, b: RawPoint| {
        let mut check = TrajectoryCheck::new(&config(), step, None);
        // The first point is not at rest, which does not matter in this test.
        let _ = check.take(&a);
        check.take(&b)
    };
    for (v0, v1) in [(0.4, -0.4), (-0.4, 0.4)] {
        // The check must refuse both intervals of half a second. In the middle of the first interval, the joint is 62
        // mrad further out. In the middle of the second interval, it is 62 mrad further in, but then it moves out
        // again.
        let (a, b) = (point(1, 1.315, v0, 0.0), point(1, 1.31, v1, 0.0));
        let violation = after(500, a, b).unwrap_err();
        assert_eq!((violation.joint, violation.quantity, violation.limit), (1, Quantity::Position, 1.3));
        assert!(violation.value > 1.3 && violation.fraction > 0.0, "{violation:?}");
    }
    // Both points are outside the limits, and the middle of the interval is inside. The joint therefore moves out
    // again, which the check must refuse.
    let (a, b) = (point(1, 1.302, -0.05, 0.0), point(1, 1.301, 0.05, 0.0));
    assert!(after(400, a, b).is_err());
    let (a, b) = (point(1, 1.302, -0.005, 0.0), point(1, 1.301, 0.0, 0.0));
    assert_eq!(after(400, a, b), Ok(()));
}

/// The check of a path continues in the next segment. The last point of the previous segment shows whether the joint
/// is still outside its limits.
#[test]
fn j36_a_path_from_outside_goes_on_in_the_next_segment() {
    let config = config();
    let points = quintic(2, -0.715, -0.5, 10, 150);
    for cut in [1, 2, 20, 40, 100] {
        let (front, rear) = points.split_at(cut);
        let mut check = TrajectoryCheck::new(&config, 10, None);
        front.iter().for_each(|point| check.take(point).unwrap());
        let next = TrajectoryCheck::new(&config, 10, None);
        let mut next = next.behind(cut as u32, front[cut - 1], check.passed());
        rear.iter().for_each(|point| next.take(point).unwrap());
        let outer = point(2, -0.716, 0.0, 0.0);
        let next = TrajectoryCheck::new(&config, 10, None);
        assert!(next.behind(cut as u32, front[cut - 1], check.passed()).take(&outer).is_err(), "{cut}");
    }
}
