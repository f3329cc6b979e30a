//! Tests of random motions of random arms with samples of the positions. A motion exceeds no limit, stays within the
//! blend at each corner, and begins and ends at rest exactly at the requested positions. `cargo run --profile dist -p
//! jtc-plan --example campaign` checks any number of motions.
use jtc_plan::{PlanError, point_to_point, through};
use proptest::prelude::*;

use crate::judge;

use judge::Case;

/// Two errors are permitted: the arm cannot be held at a position, or its payload is too heavy.
fn is_legal(error: &PlanError) -> bool {
    matches!(error, PlanError::Torque { .. })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn motions_through_waypoints_keep_all_limits_and_the_blend(seed in any::<u64>()) {
        let case = Case::random(seed);
        match through(&case.given(), case.blend, &case.limits, case.arm().as_ref()) {
            Ok(motion) => {
                let (wrong, _) = case.judge(&motion, true);
                prop_assert!(wrong.is_empty(), "seed {}: {}", seed, wrong);
            }
            Err(error) => prop_assert!(is_legal(&error), "seed {}: {}", seed, error),
        }
    }

    #[test]
    fn motions_from_point_to_point_keep_all_limits(seed in any::<u64>()) {
        let mut case = Case::random(seed);
        case.waypoints.truncate(2);
        match point_to_point(&case.waypoints[0], &case.waypoints[1], &case.limits, case.arm().as_ref()) {
            Ok(motion) => {
                let (wrong, _) = case.judge(&motion, false);
                prop_assert!(wrong.is_empty(), "seed {}: {}", seed, wrong);
            }
            Err(error) => prop_assert!(is_legal(&error), "seed {}: {}", seed, error),
        }
    }

    /// The states of a motion must be consistent: velocities are the slopes of the positions, and accelerations are
    /// the slopes of the velocities.
    #[test]
    fn velocity_and_acceleration_are_the_slopes(seed in any::<u64>()) {
        const H: f64 = 1e-5;
        let case = Case::random(seed);
        let limits = jtc_plan::Limits::of(&case.config);
        let Ok(motion) = through(&case.given(), case.blend, &limits, None) else { return Ok(()) };
        for i in 1..200 {
            let time = motion.duration() * f64::from(i) / 200.0;
            let (before, now, after) = (motion.at(time - H), motion.at(time), motion.at(time + H));
            for j in 0..6 {
                let slope = (after.position[j] - before.position[j]) / (2.0 * H);
                prop_assert!((slope - now.velocity[j]).abs() < 1e-6, "{} {}", slope, now.velocity[j]);
                let slope = (after.velocity[j] - before.velocity[j]) / (2.0 * H);
                let jump = limits.jerk[j] * H;
                prop_assert!((slope - now.acceleration[j]).abs() < 1e-6 + jump, "{} {}", slope, now.acceleration[j]);
            }
        }
    }
}
