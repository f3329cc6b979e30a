//! Tests of a learned load whose existence is doubtful, and of the load that remains after the yield.
use super::*;

/// Returns a yield that began with the load `least` (N·m) and now has the load `load` (N·m).
fn faded(least: f64, load: f64) -> Yield {
    Yield { load, ..Yield::begin(false, false, 0.0, INERTIA, least) }
}

/// Spring and damper must oppose the load of 40 N·m with 0.5 to 1.2 times its torque, which is 20 N·m to 48 N·m. The
/// joint must also move along the load, faster than 0.002 rad/s. Only then does the load seem to drive its joint.
#[test]
fn j68_a_load_drives_its_joint_only_along_the_load_and_against_a_similar_torque() {
    for sign in [1.0, -1.0] {
        for (velocity, torque, driven) in [
            (0.01, -30.0, true),
            (0.01, -21.0, true),
            (0.01, -47.0, true),
            (1.0, -30.0, true),
            (0.01, -10.0, false),
            (0.01, -19.0, false),
            (0.01, -20.0, false),
            (0.01, -48.0, false),
            (0.01, -49.0, false),
            (0.01, 30.0, false),
            (0.0021, -30.0, true),
            (0.002, -30.0, false),
            (0.0, -30.0, false),
            (-0.01, -30.0, false),
        ] {
            let mut yields = Yield { driven_ms: 10, ..faded(sign * 40.0, sign * 40.0) };
            yields.doubt(sign * velocity, sign * torque);
            let expected = if driven { 11 } else { 9 };
            assert_eq!(yields.driven_ms, expected, "{velocity} rad/s, {torque} N·m, sign {sign}");
            assert_eq!(yields.load, sign * 40.0);
        }
        // The load has fallen from 40 N·m to 20 N·m. The load seems to drive its joint against 10 N·m to 24 N·m,
        // which is 0.5 to 1.2 times 20 N·m.
        for (torque, expected) in [(-9.0, 9), (-11.0, 11), (-23.0, 11), (-25.0, 9)] {
            let mut yields = Yield { driven_ms: 10, ..faded(sign * 40.0, sign * 20.0) };
            yields.doubt(sign * 0.01, sign * torque);
            assert_eq!(yields.driven_ms, expected, "{torque} N·m against half of the load");
        }
    }
}

/// A load that has driven its joint for exactly 300 ms is unchanged. After that, each tick reduces the load by a
/// thousandth (1 ms of the time constant of 1 s).
#[test]
fn j68_a_load_fades_after_it_has_driven_its_joint_for_300_ms() {
    let mut yields = faded(40.0, 40.0);
    for ms in 1..=300 {
        yields.doubt(0.01, -30.0);
        assert_eq!(yields.load, 40.0, "{ms} ms");
    }
    yields.doubt(0.01, -30.0);
    // 40 N·m · (1 − 0.001) = 39.96 N·m
    assert!((yields.load - 39.96).abs() < 1e-9, "{} N·m", yields.load);
    yields.doubt(0.01, -30.0);
    // 39.96 N·m · (1 − 0.001) = 39.92004 N·m
    assert!((yields.load - 39.920_04).abs() < 1e-9, "{} N·m", yields.load);
}

/// The load was reduced from 40 N·m to 10 N·m. While the joint moves against the load, it returns with a time
/// constant of 0.3 s. In one tick of 1 ms it changes by 30 N·m / 300 = 0.1 N·m.
#[test]
fn j68_a_reduced_load_returns_only_while_the_joint_moves_against_the_load() {
    for sign in [1.0, -1.0] {
        for (velocity, load) in [
            (-0.1, 10.1),
            (-0.051, 10.1),
            (-0.05, 10.0),
            (-0.01, 10.0),
            (0.0, 10.0),
            (0.04, 10.0),
            (0.1, 10.0),
        ] {
            let mut yields = faded(sign * 40.0, sign * 10.0);
            yields.doubt(sign * velocity, 0.0);
            assert!((yields.load - sign * load).abs() < 1e-9, "{velocity} rad/s: {} N·m", yields.load);
        }
    }
}

/// If less than half of the load remains, it is doubtful whether the load exists. Teaching then uses only the part
/// that the spring has not opposed.
#[test]
fn j68_j25_teaching_uses_a_doubted_load_less_the_torque_of_the_spring() {
    for sign in [1.0, -1.0] {
        for (least, load, spring, taught) in [
            (40.0, 40.0, -15.0, 40.0),
            (40.0, 21.0, -15.0, 21.0),
            (40.0, 20.0, -15.0, 20.0),
            // 19 N·m are less than half of 40 N·m, and the spring opposes 4 N·m of them, so Teaching uses 15 N·m.
            (40.0, 19.0, -4.0, 15.0),
            // The spring holds a further 4 N·m of the load, so Teaching uses 23 N·m.
            (40.0, 19.0, 4.0, 23.0),
            (40.0, 5.0, -30.0, 0.0),
            // 0.2 N·m are less than half of 0.5 N·m, so the 0.1 N·m of the spring against the load are subtracted. 0.3
            // N·m are more than half, so nothing is subtracted.
            (0.5, 0.2, -0.1, 0.1),
            (0.5, 0.3, -0.1, 0.3),
            (0.0, 0.0, -30.0, 0.0),
        ] {
            let torque = faded(sign * least, sign * load).taught_load(sign * spring);
            assert!(
                (torque - sign * taught).abs() < 1e-9,
                "{load} of {least} N·m, spring {spring}: {torque}"
            );
        }
    }
}

/// After a yield, the controller stores the load only if it can have changed during the yield.
#[test]
fn j68_j70_a_load_is_learned_during_a_yield_if_it_has_changed_or_was_lowered() {
    assert!(!faded(40.0, 40.0).has_learned() && !faded(0.0, 0.0).has_learned());
    assert!(faded(40.0, 39.0).has_learned() && faded(-40.0, -39.0).has_learned());
    assert!(Yield::begin(true, false, 0.0, INERTIA, 40.0).has_learned(), "lowered");
}
