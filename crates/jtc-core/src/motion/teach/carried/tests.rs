//! Tests of the load of one joint in Teaching, and of the share of this load that acts (J-25).
use super::*;

/// Returns the load of a joint that holds `rest` (N·m), without any torque of a mass. The share `left_out` of the
/// load does not act. The highest load torque of the joint is 64 N·m.
fn carried(rest: f32, left_out: f32) -> Carried {
    Carried { rest, most: 64.0, left_out, inside: 0.0 }
}

fn assert_near(torque: f64, expected: f64, case: impl core::fmt::Display) {
    assert!((torque - expected).abs() < 1e-5, "{torque} N·m, expected {expected} N·m: {case}");
}

/// The load torque begins to fall at the speed `from` and is zero at `to`. The rule defines both speeds for a joint
/// with little damping (0), and for a joint whose damping balances the load (1). At 0.5, each speed is the mean.
/// Between both speeds, the reduction is a smooth ramp: 5/32 at a quarter of the range, 1/2 at the half, and 27/32 at
/// three quarters. With a time constant of 6 ms, a sixth of the reduction takes effect in the first tick.
#[test]
fn j25_the_load_torque_falls_with_the_speed_in_its_direction() {
    for (balanced, from, to) in [(0.0, 0.03, 0.15), (0.5, 0.115, 0.325), (1.0, 0.2, 0.5)] {
        for (part, reduction) in
            [(0.0, 0.0), (0.25, 5.0 / 32.0), (0.5, 0.5), (0.75, 27.0 / 32.0), (1.0, 1.0), (2.0, 1.0)]
        {
            let speed = from + part * (to - from);
            for sign in [1.0, -1.0] {
                let case = format_args!("{speed} rad/s, {balanced} balanced, sign {sign}");
                let torque = carried(sign * 32.0, 0.0).step(0.0, f64::from(sign) * speed, balanced, 0.0);
                assert_near(torque, f64::from(sign) * 32.0 * (1.0 - reduction / 6.0), case);
                // A motion against the load torque does not reduce the torque.
                let torque = carried(sign * 32.0, 0.0).step(0.0, f64::from(sign) * -speed, balanced, 0.0);
                assert_near(torque, f64::from(sign) * 32.0, case);
            }
        }
    }
    // Half of the load torque is already left out. A tick at full speed removes a sixth of the other half.
    assert_near(carried(32.0, 0.5).step(0.0, 0.5, 0.0, 0.0), 32.0 * (0.5 - 0.5 / 6.0), "half left out");
}

/// The load torque returns with a time constant of 300 ms. If the joint moves at more than 0.1 rad/s against its load torque, the time
/// constant is 50 ms.
#[test]
fn j25_the_load_torque_returns_faster_if_the_joint_moves_against_it() {
    for (velocity, time_ms) in
        [(0.02, 300.0), (0.0, 300.0), (-0.05, 300.0), (-0.1, 300.0), (-0.101, 50.0), (-0.5, 50.0)]
    {
        for sign in [1.0, -1.0] {
            let torque = carried(sign * 32.0, 0.5).step(0.0, f64::from(sign) * velocity, 0.0, 0.0);
            let left_out = 0.5 - 0.5 / time_ms;
            assert_near(
                torque,
                f64::from(sign) * 32.0 * (1.0 - left_out),
                format_args!("{velocity} rad/s, {sign}"),
            );
        }
    }
    // At 0.09 rad/s, half of the load torque of a joint without damping acts. If the joint was faster before, the
    // torque returns to this half with the time constant of 300 ms.
    assert_near(carried(32.0, 1.0).step(0.0, 0.09, 0.0, 0.0), 32.0 * 0.5 / 300.0, "from zero to the half");
}

/// If the load torque pushes outwards, its acting share falls to zero at the position limit, 0.1 rad after the start
/// of the soft end. With a time constant of 50 ms, a fiftieth of the change takes effect in the first tick.
#[test]
fn j25_a_soft_end_reduces_only_a_load_torque_that_pushes_outwards() {
    for (load, depth, reduction) in [
        (32.0, 0.05, 0.5),
        (-32.0, -0.05, 0.5),
        (32.0, 0.1, 1.0),
        (-32.0, -0.2, 1.0),
        (32.0, -0.05, 0.0),
        (-32.0, 0.05, 0.0),
        (32.0, 0.0, 0.0),
    ] {
        let torque = carried(load, 0.0).step(0.0, 0.0, 0.0, depth);
        assert_near(
            torque,
            f64::from(load) * (1.0 - reduction / 50.0),
            format_args!("{load} N·m at {depth} rad"),
        );
    }
    let mut joint = Carried { inside: 0.5, ..carried(32.0, 0.0) };
    assert_near(joint.step(0.0, 0.0, 0.0, 0.0), 32.0 * (1.0 - 0.49), "back outside of the soft end");
}

/// A joint without a load moves in its soft end. If a load appears later, the whole load acts. Without a load, the
/// load torque counts as positive, so only a motion in the positive direction reduces the acting share.
#[test]
fn j25_without_a_load_a_soft_end_and_a_negative_motion_reduce_no_share() {
    for (velocity, depth, acts) in
        [(0.0, 0.05, 1.0), (0.0, -0.05, 1.0), (-0.5, 0.0, 1.0), (0.5, 0.0, 5.0 / 6.0)]
    {
        let mut joint = carried(0.0, 0.0);
        assert_eq!(joint.step(0.0, velocity, 0.0, depth), 0.0);
        assert_near(joint.torque(32.0), 32.0 * acts, format_args!("{velocity} rad/s at {depth} rad"));
    }
}

/// The mass alone drives the joint under three conditions. The mass causes more than half of the load torque. The
/// joint moves faster than 0.1 rad/s in the direction of the load torque. Damping and friction are 0.8 to 1.3 times
/// the load torque.
#[test]
fn j25_only_a_load_torque_that_is_mostly_of_the_mass_drives_a_joint() {
    for (by_mass, rest, velocity, against, expected) in [
        (16.0, 0.0, 0.25, 16.0, true),
        (-16.0, 0.0, -0.25, 16.0, true),
        (24.0, -8.0, 0.25, 16.0, true),
        (16.0, 0.0, 0.101, 16.0, true),
        // The mass causes at most half of the load torque, so it does not drive the joint alone.
        (8.0, 8.0, 0.25, 16.0, false),
        (6.0, 10.0, 0.25, 16.0, false),
        (0.0, 16.0, 0.25, 16.0, false),
        // The torque of the mass and the load torque have opposite signs: 8 N·m - 24 N·m = -16 N·m.
        (8.0, -24.0, -0.25, 16.0, false),
        // The joint is too slow (at most 0.1 rad/s), or moves against the load torque.
        (16.0, 0.0, 0.1, 16.0, false),
        (-16.0, 0.0, -0.1, 16.0, false),
        (16.0, 0.0, -0.25, 16.0, false),
        // Damping and friction are outside the range of 0.8 to 1.3: 0.75 and 1.5 times the load torque.
        (16.0, 0.0, 0.25, 12.0, false),
        (16.0, 0.0, 0.25, 24.0, false),
    ] {
        let driven = carried(rest, 0.0).is_driven(by_mass, velocity, against);
        assert_eq!(driven, expected, "{by_mass} and {rest} N·m at {velocity} rad/s, {against} N·m against");
    }
}

/// A joint sinks under three conditions. More than a tenth of its highest load torque of 64 N·m was removed. The
/// joint moves faster than 0.1 rad/s against the removed torque. Damping and friction are 0.8 to 1.3 times the
/// removed torque.
#[test]
fn j25_a_joint_sinks_only_if_a_large_removed_torque_explains_its_motion() {
    for (gone, velocity, against, expected) in [
        (8.0, -0.25, 8.0, true),
        (-8.0, 0.25, 8.0, true),
        (8.0, -0.125, 8.0, true),
        (6.5, -0.25, 6.5, true),
        // At most a tenth of the highest load torque was removed, which is too little.
        (0.1 * 64.0, -0.25, 6.4, false),
        (6.0, -0.25, 6.0, false),
        // The joint is too slow (at most 0.1 rad/s), or moves in the direction of the removed torque.
        (8.0, -0.1, 8.0, false),
        (-8.0, 0.1, 8.0, false),
        (8.0, 0.25, 8.0, false),
        // Damping and friction are outside the range of 0.8 to 1.3: 0.75 and 1.5 times the removed torque.
        (8.0, -0.25, 6.0, false),
        (8.0, -0.25, 12.0, false),
    ] {
        let sinks = carried(0.0, 0.0).sinks(gone, velocity, against);
        assert_eq!(sinks, expected, "{gone} N·m at {velocity} rad/s, {against} N·m against");
    }
}

#[test]
fn j25_a_load_torque_explains_damping_and_friction_of_0_8_to_1_3_times_itself() {
    for (against, expected) in
        [(0.79, false), (0.8, true), (1.0, true), (1.3, true), (1.31, false), (-1.0, false)]
    {
        assert_eq!((explains(1.0, against), explains(-1.0, against)), (expected, expected), "{against} N·m");
    }
}
