//! Tests of one jogged joint: its approach to a velocity, its stopping distance and its behaviour at the ends of its range (J-58).
use super::*;

/// Returns limits that allow a jogged joint at most 2 rad/s² and 20 rad/s³.
fn limits() -> JointConfig {
    JointConfig { velocity_max: 2.0, acceleration_max: 10.0, ..Config::avena().joints[0] }
}

/// Returns a joint with this velocity (rad/s), this acceleration and this highest acceleration (rad/s²).
fn moving(velocity: f64, acceleration: f64, most: f64) -> JointJog {
    JointJog { wanted: 0.0, most, velocity, acceleration }
}

fn near(value: f64, expected: f64) -> bool {
    (value - expected).abs() < 1e-12
}

#[test]
fn j58_a_jogged_joint_has_a_fifth_of_its_acceleration_limit_after_a_tenth_of_a_second() {
    assert_eq!(hardest(&limits()), 2.0);
    assert_eq!(jerk(&limits()), 2.0 / 0.1);
}

/// In one tick of 0.5 s at 4 rad/s³, the acceleration changes by at most 2 rad/s².
#[test]
fn j58_a_joint_approaches_its_velocity_with_bounded_acceleration_and_jerk() {
    let cases = [
        // Columns: velocity, acceleration, highest acceleration, target velocity, expected velocity and acceleration.
        // In the first row, the acceleration increases by the jerk of one tick, from 0 to 2 rad/s². The velocity
        // increases by 2 · 0.5 rad/s.
        (0.0, 0.0, 8.0, 8.0, (1.0, 2.0)),
        // The acceleration is already at its limit of 3 rad/s² and stays there. In 0.5 s, the joint gains 3 · 0.5 =
        // 1.5 rad/s.
        (0.0, 3.0, 3.0, 8.0, (1.5, 3.0)),
        // 6 rad/s are missing. The accelerations 6, 4 and 2 rad/s² in three ticks of 0.5 s add exactly (6 + 4 + 2) ·
        // 0.5 = 6 rad/s, so the next acceleration is 6 rad/s².
        (1.0, 6.0, 8.0, 7.0, (4.0, 6.0)),
        (1.0, 8.0, 8.0, 7.0, (4.0, 6.0)),
        // The next acceleration would be 5 - 2 = 3 rad/s², which is at most 1.5 times the largest change of 2 rad/s²
        // in one tick. The missing velocity of 0.5 rad/s is below 3 · 0.5 = 1.5 rad/s. The joint therefore reaches
        // its target in this tick.
        (0.0, 5.0, 8.0, 0.5, (0.5, 0.0)),
        // The acceleration can fall only to 5.25 - 2 = 3.25 rad/s², which is more than 1.5 times the largest change
        // of 2 rad/s². The joint therefore does not reach its target in this tick.
        (0.0, 5.25, 8.0, 0.5, (1.625, 3.25)),
        // A joint can gain at most 1.5 rad/s in the tick in which it reaches its target. If 1.75 rad/s are missing,
        // it accelerates with 0 + 2 rad/s² instead.
        (0.0, 0.0, 8.0, 1.5, (1.5, 0.0)),
        (0.0, 0.0, 8.0, 1.75, (1.0, 2.0)),
    ];
    for (velocity, acceleration, most, target, expected) in cases {
        for sign in [1.0, -1.0] {
            let next =
                moving(sign * velocity, sign * acceleration, most).toward(sign * target, 4.0, 16.0, 0.5);
            let found = (sign * next.velocity, sign * next.acceleration);
            let about = std::format!("from {velocity} and {acceleration} to {target}: {found:?}");
            assert!(near(found.0, expected.0) && near(found.1, expected.1), "{about}");
            assert_eq!(next.most, most, "{about}");
        }
    }
}

/// A joint at 0.75 rad/s accelerates with 6 rad/s². A tick can reduce this acceleration only to 4 rad/s², so the joint
/// would reach 0.75 + 4 · 0.5 = 2.75 rad/s. The velocity limit is 1 rad/s, so the acceleration in this tick is only
/// (1 - 0.75) / 0.5 = 0.5 rad/s².
#[test]
fn j58_a_joint_that_still_accelerates_does_not_exceed_its_velocity_limit() {
    for sign in [1.0, -1.0] {
        let next = moving(sign * 0.75, sign * 6.0, 8.0).toward(0.0, 4.0, 1.0, 0.5);
        assert_eq!((sign * next.velocity, sign * next.acceleration), (1.0, 0.5));
        let free = moving(sign * 0.75, sign * 6.0, 8.0).toward(0.0, 4.0, 2.75, 0.5);
        assert_eq!((sign * free.velocity, sign * free.acceleration), (2.75, 4.0));
    }
}

/// With the jerk of 2 rad/s³, the acceleration is 2 · 0.001 rad/s² after one tick. This acceleration is computed
/// without the difference of two velocities, which would add a rounding error.
#[test]
fn j58_the_acceleration_within_the_velocity_limit_has_no_rounding_error_of_the_velocity() {
    for sign in [1.0, -1.0] {
        let next = moving(sign, 0.0, 1.0).toward(sign * 1.5, 2.0, 2.0, 0.001);
        assert_eq!(sign * next.acceleration, 0.002);
    }
}

/// While the clock of the jog is at rest, the joint keeps its state, even if the joint is above its velocity limit.
#[test]
fn j58_a_tick_without_time_changes_no_joint() {
    for (velocity, acceleration) in [(0.5, 1.0), (3.0, 0.0), (-3.0, -1.0)] {
        let joint = moving(velocity, acceleration, 2.0);
        assert_eq!(joint.toward(1.0, 20.0, 2.0, 0.0), joint);
    }
}

/// The stopping distance consists of the distance until the acceleration is zero, and of the distance from there. From a speed v without
/// acceleration, the joint stops in a symmetrical time T, so this distance is v · T / 2. If the joint reaches its highest acceleration A at
/// the jerk J, T is v / A + A / J. Otherwise T is 2 · √(v / J). The jerk of all cases is 8 rad/s³. The controller adds 1 %, the distance of
/// four ticks at the present speed, and 1 µrad.
#[test]
fn j58_the_stopping_distance_follows_from_the_jerk_and_the_highest_acceleration() {
    let cases = [
        // Columns: velocity, acceleration, highest acceleration, expected stopping distance without margins.
        (0.0, 0.0, 2.0, 0.0),
        // T = 0.75 / 2 + 2 / 8 = 0.625 s.
        (0.75, 0.0, 2.0, 0.5 * 0.75 * 0.625),
        // T = 1 / 2 + 2 / 8 = 0.75 s.
        (1.0, 0.0, 2.0, 0.5 * 0.75),
        // The joint just reaches its highest acceleration, so both formulas give the same time: T = 0.5 / 2 + 2 / 8 =
        // 0.5 s, and 2 · √(0.5 / 8) = 0.5 s.
        (0.5, 0.0, 2.0, 0.5 * 0.5 * 0.5),
        // The joint does not reach its highest acceleration: T = 2 · √(0.125 / 8) = 0.25 s.
        (0.125, 0.0, 2.0, 0.5 * 0.125 * 0.25),
        // The acceleration of 0.5 rad/s² is zero after 1/16 s. The speed is then 0.75 + 0.5 · 0.5 / 16 = 0.765625 rad/s, and the joint has
        // moved 0.75 / 16 + 0.5 · 0.5 / 16² - 8 / (6 · 16³) rad. T = 0.765625 / 2 + 0.25 = 0.6328125 s.
        (0.75, 0.5, 2.0, 0.75 / 16.0 + 0.25 / 256.0 - 8.0 / (6.0 * 4_096.0) + 0.5 * 0.765625 * 0.6328125),
        // The joint has already braked for 1/16 s. The distance of 0.765625 / 16 - 8 / (6 · 16³) rad that it moved in
        // this time is subtracted.
        (0.75, -0.5, 2.0, 0.5 * 0.765625 * 0.6328125 - (0.765625 / 16.0 - 8.0 / (6.0 * 4_096.0))),
        // A joint without velocity accelerates with 1 rad/s², above its highest acceleration of 0.5 rad/s². After 1/8 s its speed is
        // 0.5 / 8 = 0.0625 rad/s, and the joint has moved 0.5 / 8² - 8 / (6 · 8³) rad. T = 0.0625 / 0.5 + 0.5 / 8 = 0.1875 s.
        (0.0, 1.0, 0.5, 0.5 / 64.0 - 8.0 / (6.0 * 512.0) + 0.5 * 0.0625 * 0.1875),
    ];
    for (velocity, acceleration, most, distance) in cases {
        for sign in [1.0, -1.0] {
            let found = sign * moving(sign * velocity, sign * acceleration, most).stopping_way(8.0);
            let expected = 1.01 * distance + 4.0 * velocity * 0.001 + 1e-6;
            assert!(near(found, expected), "{velocity} {acceleration} {most}: {found}, expected {expected}");
        }
    }
}

/// Executes one tick of 0.125 s. The highest acceleration is 2 rad/s², and the acceleration changes by at most 20 · 0.125 = 2.5 rad/s².
fn step(mut joint: JointJog, mut position: f64, range: (f64, f64), goes: bool) -> (f64, f64, f64) {
    joint.step(&mut position, range, &limits(), 0.125, goes);
    (position, joint.velocity, joint.acceleration)
}

#[test]
fn j58_a_joint_does_not_approach_its_commanded_velocity_after_the_jog_has_ended() {
    let joint = JointJog { wanted: 1.0, ..moving(0.0, 0.0, 2.0) };
    assert_eq!(step(joint, 0.0, (-2.0, 2.0), false), (0.0, 0.0, 0.0));
    // The joint accelerates with 2 rad/s². After 0.125 s it has 2 · 0.125 = 0.25 rad/s, and it has moved 0.5 · 0.25 ·
    // 0.125 rad.
    assert_eq!(step(joint, 0.0, (-2.0, 2.0), true), (0.015625, 0.25, 2.0));
}

/// A joint at 1 rad/s stops in 1 / 2 + 2 / 20 = 0.6 s, after 0.3 rad. With the distance of this tick and the margins,
/// it needs 0.125 + 1.01 · 0.3 + 0.004 + 0.000001 = 0.432001 rad. If less distance remains, the joint slows down.
#[test]
fn j58_a_joint_slows_down_as_soon_as_it_could_not_stop_within_its_range() {
    for sign in [1.0, -1.0] {
        let joint = JointJog { wanted: sign, ..moving(sign, 0.0, 2.0) };
        let range = |room: f64| if sign > 0.0 { (-2.0, 1.0 + room) } else { (-1.0 - room, 2.0) };
        // With 0.45 rad to the end of its range, the joint keeps its velocity.
        assert_eq!(step(joint, sign, range(0.45), true), (sign * 1.125, sign, 0.0));
        // With 0.4 rad to the end of its range, the joint brakes with 2 rad/s². Its velocity is then 1 - 2 · 0.125 =
        // 0.75 rad/s, and it has moved 0.5 · 1.75 · 0.125 = 0.109375 rad.
        assert_eq!(step(joint, sign, range(0.4), true), (sign * 1.109375, sign * 0.75, sign * -2.0));
        // With 0.0625 rad to the end of its range, the braking joint reaches this end in the tick and stops there.
        assert_eq!(step(joint, sign, range(0.0625), true), (sign * 1.0625, 0.0, 0.0));
    }
}

#[test]
fn j58_a_joint_whose_stopping_distance_ends_exactly_at_the_end_of_its_range_slows_down() {
    for sign in [1.0, -1.0] {
        let joint = JointJog { wanted: sign, ..moving(sign, 0.0, 2.0) };
        // A joint that keeps its velocity has the same state after this tick, so the stopping distance is computed
        // from the present state.
        let needed = (0.125 + joint.stopping_way(20.0).abs()) * sign;
        let range = |end: f64| if sign > 0.0 { (-2.0, end) } else { (end, 2.0) };
        assert_eq!(step(joint, 0.0, range(needed), true).1, sign * 0.75);
        assert_eq!(step(joint, 0.0, range(1.0001 * needed), true).1, sign);
    }
}

/// A joint is beyond the end of its range and moves back towards it with 0.125 rad/s. The host commands the opposite
/// direction. With 2 rad/s², the joint would reverse to 0.125 rad/s away from its range in one tick. The joint stops
/// instead.
#[test]
fn j58_a_joint_outside_its_range_does_not_reverse_away_from_its_range() {
    for sign in [1.0, -1.0] {
        let joint = JointJog { wanted: sign, ..moving(sign * -0.125, sign * 2.0, 2.0) };
        let found = step(joint, sign * 2.0, (-1.0, 1.0), true);
        assert_eq!(found, (sign * (2.0 - 0.5 * 0.125 * 0.125), 0.0, 0.0));
    }
}

/// A joint reverses in one tick. The distance that it moves in this tick and its stopping distance after the reversal
/// are equal and opposite, so it would stop at its present position. Inside its range, the joint reverses. At the
/// upper end of its range, no margin remains, so the joint comes to rest instead.
#[test]
fn j58_a_joint_reverses_to_its_present_position_only_inside_its_range() {
    let mut found = 0;
    for wanted in (108..=136).map(|n| f64::from(n) / 1_024.0) {
        // The motion in this tick, 0.5 · (velocity + wanted) · 0.125, must be equal to the negative stopping
        // distance. The test skips velocities for which rounding prevents this equality.
        let stopping = moving(wanted, 0.0, 2.0).stopping_way(20.0);
        let velocity = -(16.0 * stopping + wanted);
        if 0.5 * (velocity + wanted) * 0.125 + stopping != 0.0 {
            continue;
        }
        found += 1;
        let joint = JointJog { wanted, ..moving(velocity, 0.0, 2.0) };
        // The joint can gain at most 1.5 · 2.5 · 0.125 = 0.46875 rad/s in the tick in which it reaches its target
        // velocity.
        assert!(wanted - velocity < 0.46875);
        assert_eq!(step(joint, 0.0, (-1.0, 1.0), true).1, wanted);
        assert_eq!(step(joint, 0.0, (-1.0, 0.0), true).1, 0.0);
    }
    assert!(found > 0);
}
