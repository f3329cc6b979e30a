//! Tests of the load of one joint in Teaching, and of the share of this load that acts (J-25).
use super::*;

/// Returns the load of a joint that holds `rest` (N·m), which no mass explains. The share `left_out` of the load does not act. The highest
/// load torque of the joint is 64 N·m.
fn carried(rest: f32, left_out: f32) -> Carried {
    Carried { rest, most: 64.0, left_out, inside: 0.0 }
}

fn assert_near(torque: f64, expected: f64, case: impl core::fmt::Display) {
    assert!((torque - expected).abs() < 1e-5, "{torque} N·m, expected {expected} N·m: {case}");
}

/// The reduction begins at `from` and is complete at `to`. The rule defines both speeds for a joint with little damping, and for a joint
/// whose damping balances the load. Half-way between these two dampings, each speed is the mean. The smooth ramp has the value 5/32 at a
/// quarter of the speed range, 1/2 at the half, and 27/32 at three quarters. With a time constant of 6 ms, the first tick executes a sixth
/// of the reduction.
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
    // If half of the load torque is already left out, one tick at full speed executes a sixth of the other half.
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
    // At 0.09 rad/s, half of the load torque of a joint without damping is left out. A joint that was faster approaches this value slowly.
    assert_near(carried(32.0, 1.0).step(0.0, 0.09, 0.0, 0.0), 32.0 * 0.5 / 300.0, "from zero to the half");
}

/// In the direction of the load torque, the share falls to zero at the position limit, 0.1 rad after the start of the soft end. The time
/// constant is 50 ms, so the first tick executes a fiftieth of the change.
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

/// A joint without a load moves in its soft end. A load that appears then acts completely. A load of zero counts as a positive load, so only
/// a motion in the positive direction reduces the acting share.
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

/// The mass drives the joint if the mass causes more than half of the load torque, and if the joint is faster than 0.1 rad/s in the
/// direction of the load torque. Damping and friction must be 0.8 to 1.3 times the load torque.
#[test]
fn j25_only_a_load_torque_that_is_mostly_of_the_mass_drives_a_joint() {
    for (by_mass, rest, velocity, against, expected) in [
        (16.0, 0.0, 0.25, 16.0, true),
        (-16.0, 0.0, -0.25, 16.0, true),
        (24.0, -8.0, 0.25, 16.0, true),
        (16.0, 0.0, 0.101, 16.0, true),
        // The mass causes half of the load torque, or less.
        (8.0, 8.0, 0.25, 16.0, false),
        (6.0, 10.0, 0.25, 16.0, false),
        (0.0, 16.0, 0.25, 16.0, false),
        // The load torque acts against the torque of the mass: 8 N·m - 24 N·m = -16 N·m.
        (8.0, -24.0, -0.25, 16.0, false),
        // The joint is not faster than 0.1 rad/s, or moves against the load torque.
        (16.0, 0.0, 0.1, 16.0, false),
        (-16.0, 0.0, -0.1, 16.0, false),
        (16.0, 0.0, -0.25, 16.0, false),
        // Damping and friction are 0.75 and 1.5 times the load torque.
        (16.0, 0.0, 0.25, 12.0, false),
        (16.0, 0.0, 0.25, 24.0, false),
    ] {
        let driven = carried(rest, 0.0).is_driven(by_mass, velocity, against);
        assert_eq!(driven, expected, "{by_mass} and {rest} N·m at {velocity} rad/s, {against} N·m against");
    }
}

/// A joint sinks if more than a tenth of its highest load torque of 64 N·m was removed, and if the joint is faster than 0.1 rad/s against
/// the removed torque. Damping and friction must be 0.8 to 1.3 times the removed torque.
#[test]
fn j25_a_joint_sinks_only_if_a_large_removed_torque_explains_its_motion() {
    for (gone, velocity, against, expected) in [
        (8.0, -0.25, 8.0, true),
        (-8.0, 0.25, 8.0, true),
        (8.0, -0.125, 8.0, true),
        (6.5, -0.25, 6.5, true),
        // The removed torque is a tenth of the highest load torque, or less.
        (0.1 * 64.0, -0.25, 6.4, false),
        (6.0, -0.25, 6.0, false),
        // The joint is not faster than 0.1 rad/s, or moves in the direction of the removed torque.
        (8.0, -0.1, 8.0, false),
        (-8.0, 0.1, 8.0, false),
        (8.0, 0.25, 8.0, false),
        // Damping and friction are 0.75 and 1.5 times the removed torque.
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
