//! Tests of the brake, and of the choice between brake and damper.
use super::*;

/// The limit is 100 N·m, and the velocity limit is 2 rad/s. The brake acts from 0.4 rad/s on, and uses the whole limit at 1.6 rad/s. For a
/// lowered load, these speeds are 0.8 rad/s and 2 rad/s. Both slopes are 100 N·m / 1.2 rad/s.
#[test]
fn j68_j70_the_torque_of_the_brake_rises_from_zero_to_the_whole_limit() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        for (inertia, brakes, young_velocity, torque) in [
            (5.0, BRAKES, 0.0, 0.0),
            (5.0, BRAKES, 0.4, 0.0),
            (5.0, BRAKES, 0.7, 25.0),
            (5.0, BRAKES, 1.0, 50.0),
            (5.0, BRAKES, 1.6, 100.0),
            (5.0, BRAKES, 3.0, 100.0),
            (5.0, BRAKES_LOWERED, 0.7, 0.0),
            (5.0, BRAKES_LOWERED, 1.1, 25.0),
            (5.0, BRAKES_LOWERED, 2.0, 100.0),
            // An inertia of 0.1 kg·m² bounds the slope to 250 1/s · 0.1 kg·m² = 25 N·m·s/rad.
            (0.1, BRAKES, 0.9, 12.5),
            (0.1, BRAKES, 1.4, 25.0),
            (0.1, BRAKES, 2.4, 50.0),
            // An inertia of 0.02 kg·m² bounds the slope to 5 N·m·s/rad.
            (0.02, BRAKES, 1.4, 5.0),
        ] {
            let joint = Joint { young_velocity: sign * young_velocity, ..at(&limits, 0.0, 0.0, 0.0) };
            let found = brake(&joint, inertia, brakes);
            assert!(
                (found + sign * torque).abs() < 1e-9,
                "{inertia} kg·m², {young_velocity} rad/s: {found} N·m"
            );
        }
    }
}

/// At 0.7 rad/s, which is 35 % of the velocity limit, the brake of a yielding joint has 25 N·m. The brake of a
/// lowered load begins only at 40 %.
#[test]
fn j70_the_brake_of_a_lowered_load_begins_at_a_higher_speed() {
    let limits = round_limits();
    for (lowers, young_velocity, torque) in [(false, 0.7, 25.0), (true, 0.7, 0.0), (true, 1.1, 25.0)] {
        let mut yields = Yield::begin(lowers, false, 0.0, INERTIA, 0.0);
        let joint = Joint { young_velocity, ..at(&limits, 0.0, 0.0, 0.0) };
        let d = (0..60).fold(0.0, |_, _| yields.step(&joint).d);
        assert!((d + torque).abs() < 1e-9, "lowers {lowers}, {young_velocity} rad/s: {d} N·m");
    }
}

/// The torque of the brake is 50 N·m. After more than two missing answers, it falls by a fifth in each tick.
#[test]
fn j68_without_answers_the_brake_fades() {
    let limits = round_limits();
    let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
    let mut torque = |fresh: bool| {
        let joint = Joint { young_velocity: 1.0, fresh, ..at(&limits, 0.0, 0.0, 0.0) };
        -yields.step(&joint).d
    };
    (0..60).for_each(|_| {
        torque(true);
    });
    // The third missing answer reduces the torque in the tick after it.
    for expected in [50.0, 50.0, 50.0, 40.0, 32.0, 25.6] {
        let found = torque(false);
        assert!((found - expected).abs() < 1e-9, "{found} N·m instead of {expected} N·m");
    }
}

/// The measured velocity and the velocity of the last 5 ms have opposite signs. Brake and damper therefore reach the
/// limit of 100 N·m in opposite directions. The brake replaces the damper only if its torque is higher, so the damper
/// acts.
#[test]
fn j68_a_brake_with_the_torque_of_the_damper_does_not_replace_the_damper() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        let joint = Joint { young_velocity: -sign * 2.0, ..at(&limits, 0.0, sign * 2.0, 0.0) };
        let d = (0..100).fold(0.0, |_, _| yields.step(&joint).d);
        assert_eq!(d, -sign * 100.0);
    }
}
