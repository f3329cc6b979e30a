//! Tests that the planner uses the fastest option within the blend, and that a motion has a binding limit at every
//! time.
use jtc_core::Config;
use jtc_plan::{JOINTS, JointVec, LimitKind, Limits, Motion, Waypoint, through};
use proptest::prelude::*;

use crate::judge;

use judge::Case;

fn given(positions: &[JointVec]) -> Vec<Waypoint> {
    positions.iter().copied().map(Waypoint::from).collect()
}

fn moves(case: &Case) -> bool {
    case.waypoints.iter().any(|q| *q != case.waypoints[0])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A stop at a corner is always within the blend. Therefore a motion with permission to round corners must never
    /// be slower than a motion with stops.
    #[test]
    fn a_blend_is_never_slower_than_stops(seed in any::<u64>(), small in 1e-9..0.05f64) {
        let case = Case::random(seed);
        let arm = case.arm();
        let Ok(stops) = through(&case.given(), 0.0, &case.limits, arm.as_ref()) else { return Ok(()) };
        for blend in [small, case.blend] {
            let blended = through(&case.given(), blend, &case.limits, arm.as_ref()).unwrap();
            let (blended, stops) = (blended.duration(), stops.duration());
            prop_assert!(blended <= stops * (1.0 + 1e-9), "seed {}, {} rad: {} s, {} s", seed, blend, blended, stops);
        }
    }

    /// Each part of a motion must have a binding limit.
    #[test]
    fn what_binds_is_named_for_all_of_a_motion(seed in any::<u64>()) {
        let case = Case::random(seed);
        let arm = case.arm();
        let Ok(motion) = through(&case.given(), case.blend, &case.limits, arm.as_ref()) else { return Ok(()) };
        prop_assume!(moves(&case));
        let named: f64 = motion.binding().iter().map(|b| b.to - b.from).sum();
        let rising = motion.binding().windows(2).all(|pair| pair[0].to <= pair[1].from + 1e-9);
        prop_assert!(rising && named >= 0.95 * motion.duration(), "seed {}: {} of {} s", seed, named, motion.duration());
    }

    /// A motion through many close waypoints on a smooth curve must take only a little longer than a motion through a
    /// few of these waypoints. The motion must pass each waypoint within the blend.
    #[test]
    fn more_waypoints_on_a_curve_cost_little_time(seed in any::<u64>(), blend in 0.02..0.1f64) {
        let rng = &mut fastrand::Rng::with_seed(seed);
        let amplitudes: [JointVec; 2] = std::array::from_fn(|_| std::array::from_fn(|_| rng.f64() - 0.5));
        let curve = |u: f64| -> JointVec {
            std::array::from_fn(|j| {
                let turn = std::f64::consts::TAU * u;
                amplitudes[0][j] * turn.sin() + amplitudes[1][j] * (1.0 - turn.cos())
            })
        };
        let through_some = |count: usize| {
            let positions: Vec<JointVec> = (0..count).map(|i| curve(i as f64 / (count - 1) as f64)).collect();
            (through(&given(&positions), blend, &Limits::of(&Config::avena()), None).unwrap(), positions)
        };
        let few = through_some(25).0.duration();
        let (many, positions) = through_some(401);
        prop_assert!(many.duration() < 1.25 * few, "seed {}: {} s, {} s", seed, many.duration(), few);
        passes_all(&many, &positions, blend, seed)?;
    }
}

/// If the limits that are reported as binding are doubled, the motion must become faster in nearly all cases.
/// Exceptions are possible, because a jerk-limited law is the best of several attempts, and other limits lead to
/// other attempts.
#[test]
fn what_is_named_is_what_binds() {
    let (mut faster, mut all) = (0, 0);
    for seed in 0..200 {
        let case = Case::random(seed);
        let arm = case.arm();
        let with = |limits: &Limits| through(&case.given(), case.blend, limits, arm.as_ref());
        let Ok(motion) = with(&case.limits) else { continue };
        if moves(&case) {
            let relaxed = with(&relaxed(&case.limits, &motion)).unwrap();
            all += 1;
            faster += u32::from(relaxed.duration() < 0.98 * motion.duration());
        }
    }
    assert!(all >= 150 && 100 * faster >= 97 * all, "{faster} of {all}");
}

/// Doubles the binding kinds of limits for all joints, because other joints can be as close to their limits as the
/// binding joint.
fn relaxed(limits: &Limits, motion: &Motion) -> Limits {
    let mut relaxed = limits.clone();
    for b in motion.binding() {
        let (relaxed, of) = match b.limit {
            LimitKind::Velocity => (&mut relaxed.velocity, limits.velocity),
            LimitKind::Acceleration => (&mut relaxed.acceleration, limits.acceleration),
            LimitKind::Jerk => (&mut relaxed.jerk, limits.jerk),
            _ => (&mut relaxed.torque, limits.torque),
        };
        *relaxed = of.map(|limit| 2.0 * limit);
    }
    relaxed
}

/// Checks that the motion passes each waypoint within the blend. Every point of the motion must also be within the
/// blend of a waypoint.
fn passes_all(motion: &Motion, positions: &[JointVec], blend: f64, seed: u64) -> Result<(), TestCaseError> {
    let distance = |a: &JointVec, b: &JointVec| (0..JOINTS).map(|j| (a[j] - b[j]).abs()).fold(0.0, f64::max);
    let places: Vec<JointVec> =
        (0..=4000).map(|i| motion.at(motion.duration() * f64::from(i) / 4000.0).position).collect();
    for q in positions {
        let nearest = places.iter().map(|p| distance(p, q)).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest <= blend, "seed {}: {} rad from a waypoint", seed, nearest);
    }
    for p in &places {
        let nearest = positions.iter().map(|q| distance(p, q)).fold(f64::INFINITY, f64::min);
        prop_assert!(nearest <= blend, "seed {}: {} rad from all waypoints", seed, nearest);
    }
    Ok(())
}
