//! Tests of the torque that Teaching adds to one joint (J-25).
use proptest::prelude::*;

use super::*;

const INERTIA: f64 = 3.0;

/// Returns joint 2 of the default arm, with 180 N·m and 90 N·m·s/rad.
fn limits() -> JointConfig {
    Config::avena().joints[1]
}

/// Returns a joint at rest at `position` (rad) with this Coulomb friction (N·m).
fn begun(position: f64, coulomb: f64) -> TaughtJoint {
    let mut joint = TaughtJoint::begin(position, &limits(), (-1.5, 1.5));
    joint.set_inertia(INERTIA);
    joint.set_friction(coulomb, coulomb);
    joint
}

fn led(limits: &JointConfig, position: f64, velocity: f64) -> LedJoint<'_> {
    LedJoint { position, velocity, limits, range: (-1.5, 1.5) }
}

fn tick_of(joint: &mut TaughtJoint, limits: &JointConfig, position: f64, velocity: f64) -> TaughtTorque {
    joint.step(&led(limits, position, velocity), 0.0, 0.0, &Config::avena()).0
}

fn tick(joint: &mut TaughtJoint, position: f64, velocity: f64) -> TaughtTorque {
    tick_of(joint, &limits(), position, velocity)
}

/// Moves a joint at `velocity` (rad/s) through position 0 for a second. Returns its last torque.
fn moving(velocity: f64, coulomb: f64) -> TaughtTorque {
    let mut joint = begun(-velocity, coulomb);
    let mut torque = TaughtTorque::default();
    for k in 0..1_000 {
        torque = tick(&mut joint, velocity * (f64::from(k) / 1_000.0 - 1.0), velocity);
    }
    torque
}

proptest! {
    /// Damping, friction compensation and dry friction together never drive a joint. Their total torque against the
    /// motion never falls with the speed.
    #[test]
    fn j25_the_faster_a_joint_is_the_more_torque_it_has_against_it(
        slow in 0.001..1.4f64, more in 0.001..0.3f64, coulomb in 0.0..10.0f64, sign in prop_oneof![Just(-1.0), Just(1.0)],
    ) {
        let at = |speed: f64| {
            let torque = moving(sign * speed, coulomb);
            -(torque.brake + torque.friction) * sign
        };
        let (first, second) = (at(slow), at(slow + more));
        prop_assert!(first >= -1e-9 && second >= first - 1e-2, "{first} N·m, then {second} N·m");
    }

    #[test]
    fn j25_the_damping_is_the_setting_where_the_joint_bears_it(damping in 0.0..1000.0f64, inertia in 0.05..10.0f64) {
        let limits = JointConfig { teach_damping: damping, rotor_inertia: 0.05, ..limits() };
        let mut joint = begun(0.0, 0.0);
        joint.set_inertia(inertia);
        // The test sets the dry friction to zero, so that the damping acts almost alone. At 0.39 rad/s, the damping
        // is not increased yet.
        joint.grip = 0.0;
        let torque = tick_of(&mut joint, &limits, 0.0, 0.39).brake;
        let expected = damping.min(90.0 * inertia) * 0.39;
        let dry = 0.03 * limits.torque_max * DT / GRIP_S;
        prop_assert!((torque + expected).abs() < dry + 1e-3, "{torque} N·m, not {expected}");
    }
}

#[test]
fn j25_a_joint_at_rest_is_held_by_dry_friction_up_to_its_breakaway_torque() {
    for (coulomb, breakaway) in [(0.0, 5.4), (3.0, 3.3), (6.0, 1.2), (8.0, 0.0)] {
        let mut joint = begun(0.2, coulomb);
        let at_rest = tick(&mut joint, 0.2, 0.0);
        assert!(at_rest.brake.abs() < 1e-3 && at_rest.friction == 0.0, "no step at the begin");
        // A joint that is pulled slowly slips. The dry friction then holds it at its new position.
        let slips = tick(&mut joint, 0.25, 0.0).brake;
        assert!((slips + breakaway).abs() < 1e-3, "{slips} N·m, not {breakaway}");
        let back = tick(&mut joint, 0.2, 0.0).brake;
        assert!((back - breakaway).abs() < 1e-3, "{back} N·m, not {breakaway}");
    }
}

#[test]
fn j25_the_dry_friction_lets_go_of_a_joint_that_moves_and_takes_hold_again() {
    let mut joint = begun(0.0, 0.0);
    let mut position = 0.0;
    for _ in 0..1_000 {
        position += 0.3 * DT;
        tick(&mut joint, position, 0.3);
    }
    let only_damped = -limits().teach_damping * 0.3;
    assert!((tick(&mut joint, position, 0.3).brake - only_damped).abs() < 0.01);
    (0..300).for_each(|_| {
        tick(&mut joint, position, 0.0);
    });
    let held = tick(&mut joint, position + 0.02, 0.0).brake;
    assert!(held < -0.9 * 0.03 * limits().torque_max, "{held} N·m after 300 ms");
}

/// The friction compensation is half of the Coulomb friction. Its sign is smoothed within 0.1 rad/s, and it is zero
/// above 0.6 rad/s. If the damping is too low for the slope of the compensation, the compensation is reduced.
#[test]
fn j25_a_share_of_the_coulomb_friction_is_taken_away() {
    for (velocity, share) in
        [(0.0, 0.0), (0.05, 0.25), (0.1, 0.5), (0.3, 0.5), (0.45, 0.25), (0.6, 0.0), (1.0, 0.0)]
    {
        for sign in [1.0, -1.0] {
            let friction = moving(sign * velocity, 8.0).friction;
            assert!((friction - sign * share * 8.0).abs() < 1e-6, "{friction} N·m at {velocity} rad/s");
        }
    }
    let limits = JointConfig { teach_damping: 10.0, ..limits() };
    let slow = tick_of(&mut begun(0.0, 8.0), &limits, 0.0, 0.05).friction;
    assert!((slow - 0.25).abs() < 1e-6, "{slow} N·m");
}

#[test]
fn j25_at_a_soft_end_a_joint_is_pushed_back_and_one_that_begins_there_is_not() {
    let share = 0.3 * limits().torque_max;
    let mut joint = begun(1.0, 8.0);
    for (position, part) in [(1.4, 0.0), (1.45, 0.5), (1.5, 1.0), (1.6, 1.0)] {
        let torque = tick(&mut joint, position, 0.0).brake;
        assert!((torque + part * share).abs() < 1e-3, "{torque} N·m at {position} rad");
    }
    // Teaching begins with the joint inside its soft end or beyond its position limit. The spring does not move the
    // joint inwards. If the joint moves further outwards, the spring acts against this motion.
    for (found, further) in [(1.45, 1.5), (1.7, 1.75), (-1.45, -1.5)] {
        let mut joint = begun(found, 8.0);
        assert!(tick(&mut joint, found, 0.0).brake.abs() < 1e-3, "{found}");
        let torque = tick(&mut joint, further, 0.0).brake;
        assert!((torque + 0.5 * share * f64::signum(found)).abs() < 1e-3, "{torque} N·m at {further} rad");
        // After a hand has moved this joint out of the soft end and back into it, the spring acts over the whole soft
        // end.
        tick(&mut joint, 0.0, 0.0);
        let torque = tick(&mut joint, 1.45, 0.0).brake;
        assert!((torque + 0.5 * share).abs() < 1e-3, "{torque} N·m");
    }
}

#[test]
fn j25_towards_a_limit_the_damper_grows() {
    let damper = |position: f64, velocity: f64| {
        let mut joint = begun(0.0, 8.0);
        tick(&mut joint, position, velocity).brake - tick(&mut joint.clone(), position, 0.0).brake
    };
    let inward = damper(1.45, -0.2);
    assert!((inward - 0.2 * 90.0).abs() < 0.1, "{inward} N·m");
    assert!(damper(1.45, 0.2) < -1.4 * 0.2 * 90.0 && damper(1.5, 0.2) < damper(1.45, 0.2));
}

fn assert_near(value: f64, expected: f64, case: impl core::fmt::Display) {
    assert!((value - expected).abs() < 1e-3, "{value}, expected {expected}: {case}");
}

/// The over-speed threshold is `overspeed_factor` times the highest speed. Three quarters of 1.2 times 1.5 rad/s are 1.35 rad/s.
#[test]
fn j25_a_joint_is_too_fast_at_three_quarters_of_over_speed_or_at_1_4_rad_s() {
    for (overspeed_factor, velocity_max, expected) in [(1.2, 1.5, 1.35), (2.0, 0.5, 0.75), (1.2, 5.0, 1.4)] {
        let config = Config { overspeed_factor, ..Config::avena() };
        let speed = too_fast(&JointConfig { velocity_max, ..limits() }, &config);
        assert!((speed - expected).abs() < 1e-12, "{speed} rad/s, expected {expected} rad/s");
    }
}

/// A fifth of the rotor inertia is used. If no rotor inertia is configured, a fifth of the torque limit divided by
/// 200 rad/s² is used: 100 N·m / (200 rad/s²) / 5 = 0.1 kg·m².
#[test]
fn j25_a_fifth_of_the_rotor_inertia_counts() {
    for (rotor_inertia, torque_max, expected) in [(1.25, 100.0, 0.25), (0.0, 100.0, 0.1), (0.0, 400.0, 0.4)] {
        let limits = JointConfig { rotor_inertia, torque_max, ..limits() };
        assert!((rotor(&limits) - expected).abs() < 1e-12, "{}", rotor(&limits));
        // The damping is bounded by this inertia until the inertia of the arm is known, and after an invalid inertia.
        let mut joint = TaughtJoint::begin(0.5, &limits, (-1.5, 1.5));
        for inertia in [f64::INFINITY, f64::NAN] {
            joint.set_inertia(inertia);
            let (damping, _) = joint.dampings(1e6, &limits);
            assert_near(damping, 90.0 * expected, "highest damping that the inertia tolerates");
        }
    }
}

/// The joint moves at 0.5 rad/s. Before each answer, the lag of the filtered position is the motion of 4 ms. The
/// filter, with a time constant of 4 ms, then moves by the motion of 1 ms, so the lag after the answer is 3 ms. Missing
/// answers and late ticks do not change this lag.
#[test]
fn j25_missing_answers_and_late_ticks_do_not_change_the_speed_from_positions() {
    let at = |ms: u16| 0.5 * 0.001 * f64::from(ms);
    let mut joint = begun(0.0, 0.0);
    joint.behind = -at(3) as f32;
    let mut ms = 0;
    for (missing, late) in [(0, 0), (0, 0), (1, 0), (0, 0), (2, 0), (0, 3), (0, 0), (5, 1), (3, 2), (0, 0)] {
        for _ in 0..missing {
            ms += 1;
            assert_eq!(joint.hear(false, 0.0, 0), 0.0);
        }
        ms += 1 + late;
        let speed = joint.hear(true, at(ms), late);
        assert!((speed - 0.5).abs() < 1e-4, "{speed} rad/s after {missing} missing answers, {late} ms late");
        assert!((at(ms) - f64::from(joint.behind) - at(3)).abs() < 1e-6, "{} rad at {ms} ms", joint.behind);
    }
    // A tick without an answer can also be late.
    assert_eq!(joint.hear(false, 0.0, 4), 0.0);
    let speed = joint.hear(true, at(ms + 6), 0);
    assert!((speed - 0.5).abs() < 1e-4, "{speed} rad/s");
    assert_eq!(begun(0.5, 0.0).hear(true, 0.5, 0), 0.0, "a joint at rest has no speed in its first tick");
}

/// From the third missing answer on, the springs fade by a fifth in each tick. Then damping and friction compensation
/// fade by a fifth in each tick. When answers arrive again, damping and friction compensation return first, and then
/// the springs.
#[test]
fn j25_a_joint_without_answers_loses_its_springs_and_then_its_damping() {
    let shares =
        |lost: i32| (1.0 - 0.2 * f64::from(lost.clamp(0, 5)), 1.0 - 0.2 * f64::from((lost - 5).clamp(0, 5)));
    let mut joint = begun(0.0, 0.0);
    let check = |joint: &TaughtJoint, lost: i32, case: core::fmt::Arguments<'_>| {
        let (heard, expected) = (joint.heard(), shares(lost));
        assert_near(heard.0, expected.0, case);
        assert_near(heard.1, expected.1, case);
    };
    check(&joint, 0, format_args!("no answer is missing"));
    for missing in 1..=14 {
        joint.hear(false, 0.0, 0);
        check(&joint, (missing - 2).min(10), format_args!("{missing} missing answers"));
    }
    for answers in 1..=11 {
        joint.hear(true, 0.0, 0);
        check(&joint, 10 - answers, format_args!("{answers} answers"));
    }
    // A delay of two ticks counts as two missing answers.
    joint.hear(false, 0.0, 2);
    check(&joint, 1, format_args!("a missing answer in a late tick"));
}

/// The configured damping is 90 N·m·s/rad. To balance loads of 60, 100 and 150 N·m at 0.5 rad/s, the damping must be
/// 120, 200 and 300 N·m·s/rad. The highest damping is 180 N·m·s/rad (the torque limit per rad/s), or the damping that
/// balances the load if this is higher. The inertia bounds both values. The bound for 3 kg·m² is 90 1/s · 3 kg·m² =
/// 270 N·m·s/rad.
#[test]
fn j25_the_damping_balances_the_load_within_the_bound_of_the_inertia() {
    for (inertia, load, expected) in [
        (3.0, 0.0, (90.0, 180.0)),
        (3.0, 60.0, (120.0, 180.0)),
        (3.0, -60.0, (120.0, 180.0)),
        (3.0, 100.0, (200.0, 200.0)),
        (3.0, 150.0, (270.0, 270.0)),
        (1.5, 0.0, (90.0, 135.0)),
        (0.5, 60.0, (45.0, 45.0)),
    ] {
        let mut joint = begun(0.0, 0.0);
        joint.set_inertia(inertia);
        assert_eq!(joint.dampings(load, &limits()), expected, "{inertia} kg·m², {load} N·m");
    }
}

/// With an inertia of 0.5 kg·m², the damping is at most 45 N·m·s/rad, which is 22.5 N·m at 0.5 rad/s. This balances
/// half of a load of 45 N·m. The balanced share is never above 1.
#[test]
fn j25_the_balanced_share_of_a_load_is_at_most_the_whole_load() {
    for (teach_damping, inertia, load, expected) in [
        (90.0, 3.0, 10.0, 1.0),
        (90.0, 3.0, 60.0, 1.0),
        (90.0, 0.5, 22.5, 1.0),
        (90.0, 0.5, 45.0, 0.5),
        (90.0, 0.5, -45.0, 0.5),
        (90.0, 0.5, 90.0, 0.25),
        // If both the damping and the load are zero, the share is 1.
        (0.0, 3.0, 0.0, 1.0),
    ] {
        let limits = JointConfig { teach_damping, ..limits() };
        let mut joint = begun(0.0, 8.0);
        joint.set_inertia(inertia);
        let (_, bears) = joint.step(&led(&limits, 0.0, 0.0), load, 0.0, &Config::avena());
        assert_eq!(bears.balanced, expected, "{teach_damping} N·m·s/rad, {inertia} kg·m², {load} N·m");
    }
}

/// The damping rises from 90 to 180 N·m·s/rad between 0.4 and 0.8 rad/s, or with the excess of the flange speed,
/// whichever is higher. Between 0.9 and 1.7 rad/s, a braking torque rises to 60 rad/s² · 3 kg·m² = 180 N·m. Both ramps
/// are smooth: 5/32 at a quarter of the range, 1/2 at the half, and 27/32 at three quarters. The joint's own friction
/// is high, so it gets no dry friction.
#[test]
fn j25_a_fast_joint_has_more_damping_and_a_braking_torque() {
    for (speed, haste, grown, braked) in [
        (0.2, 0.0, 0.0, 0.0),
        (0.4, 0.0, 0.0, 0.0),
        (0.5, 0.0, 5.0 / 32.0, 0.0),
        (0.6, 0.0, 0.5, 0.0),
        (0.7, 0.0, 27.0 / 32.0, 0.0),
        (0.8, 0.0, 1.0, 0.0),
        (0.9, 0.0, 1.0, 0.0),
        (1.1, 0.0, 1.0, 5.0 / 32.0),
        (1.3, 0.0, 1.0, 0.5),
        (1.5, 0.0, 1.0, 27.0 / 32.0),
        (1.7, 0.0, 1.0, 1.0),
        (2.0, 0.0, 1.0, 1.0),
        (0.2, 0.5, 0.5, 0.0),
        (0.6, 0.25, 0.5, 0.0),
        (0.6, 0.75, 0.75, 0.0),
    ] {
        for sign in [1.0, -1.0] {
            let (torque, _) =
                begun(0.0, 8.0).step(&led(&limits(), 0.0, sign * speed), 0.0, haste, &Config::avena());
            let expected = -sign * ((90.0 + 90.0 * grown) * speed + 180.0 * braked);
            assert_near(torque.brake, expected, format_args!("{} rad/s, excess {haste}", sign * speed));
        }
    }
}

/// The soft ends begin at 1.4 rad and at -1.4 rad. Their springs have 30 % of 180 N·m at the limit, which is 54 N·m. Outwards, the damping
/// increases from 90 N·m·s/rad to 180 N·m·s/rad at the limit. Inwards, the damping does not increase. The torque against the motion is the
/// damping torque and the friction of 10 N·m, without the friction compensation. The compensation has a slope of 40 N·m·s/rad and reaches
/// half of the Coulomb friction of 8 N·m.
#[test]
fn j25_at_both_soft_ends_damping_and_friction_act_against_the_motion() {
    for (position, velocity, depth, grown, compensation) in [
        (0.0, 0.2, 0.0, 0.0, 4.0),
        (1.45, 0.2, 0.5, 0.5, 4.0),
        (1.45, 0.05, 0.5, 0.5, 2.0),
        (1.5, 0.2, 1.0, 1.0, 4.0),
        (1.6, 0.2, 1.0, 1.0, 4.0),
        (1.45, -0.2, 0.5, 0.0, 4.0),
        (1.45, -0.025, 0.5, 0.0, 1.0),
        (1.45, 0.0, 0.5, 0.0, 0.0),
    ] {
        for sign in [1.0, -1.0] {
            let (position, velocity) = (sign * position, sign * velocity);
            let case = format_args!("{velocity} rad/s at {position} rad");
            let mut joint = begun(0.0, 8.0);
            joint.set_friction(8.0, 10.0);
            let torque = tick(&mut joint, position, velocity);
            let damping = 90.0 + 90.0 * grown;
            assert_near(torque.brake, -damping * velocity - sign * 54.0 * depth, case);
            assert_near(torque.friction.abs(), compensation, case);
            assert_near(joint.against(), damping * velocity.abs() + 10.0 - compensation, case);
        }
    }
}

/// The dry friction is 5.4 N·m, and the damping is 90 N·m·s/rad. The first speed is 5.4 / 90 rad/s = 0.06 rad/s. From
/// 0.06 to 0.24 rad/s, the dry friction fades smoothly, with 1/2 at 0.15 rad/s. With a time constant of 0.1 s, a
/// hundredth of the change takes effect in the first tick.
#[test]
fn j25_the_dry_friction_fades_between_its_first_speed_and_four_times_this_speed() {
    for (speed, left) in [
        (0.0, 1.0),
        (0.03, 1.0),
        (0.06, 1.0),
        (0.105, 27.0 / 32.0),
        (0.15, 0.5),
        (0.195, 5.0 / 32.0),
        (0.24, 0.0),
        (0.3, 0.0),
    ] {
        for velocity in [speed, -speed] {
            let mut joint = begun(0.0, 0.0);
            tick(&mut joint, 0.0, velocity);
            let expected = 1.0 - (1.0 - left) / 100.0;
            assert!((f64::from(joint.grip) - expected).abs() < 1e-6, "{} at {velocity} rad/s", joint.grip);
        }
    }
}

/// The spring slips at an extension of 5 mrad. For a joint with low inertia, the spring is softer: with 0.5 kg·m², the spring of 5.4 N·m
/// slips at 5.4 N·m / ((30 1/s)² · 0.5 kg·m²) = 12 mrad.
#[test]
fn j25_the_dry_friction_is_softer_for_a_joint_with_low_inertia() {
    for (inertia, position, expected) in [
        (3.0, 0.0025, -2.7),
        (3.0, -0.0025, 2.7),
        (3.0, 0.006, -5.4),
        (0.5, 0.003, -1.35),
        (0.5, 0.006, -2.7),
        (0.5, 0.02, -5.4),
    ] {
        let mut joint = begun(0.0, 0.0);
        joint.set_inertia(inertia);
        let torque = joint.dry_spring(position, &limits(), &Config::avena());
        assert_near(torque, expected, format_args!("{inertia} kg·m² at {position} rad"));
        assert_near(tick(&mut joint, position, 0.0).brake, expected, "the tick applies the same torque");
    }
}

/// The anchor of the spring moves with a joint that is too fast for dry friction. The anchor also moves with a joint
/// that gets no dry friction, because its own friction is high. The torque therefore has no step when the dry friction
/// begins to act later.
#[test]
fn j25_the_anchor_of_the_dry_friction_moves_with_a_fast_joint_and_without_dry_friction() {
    // The joint is 0.02 rad away from its anchor. At 0.3 rad/s the spring does not act, so the torque is the damping
    // torque with 90 N·m·s/rad.
    for sign in [1.0, -1.0] {
        let mut fast = begun(0.0, 0.0);
        assert_near(tick(&mut fast, sign * 0.02, sign * 0.3).brake, -sign * 27.0, "only damping");
        // With a Coulomb friction of 8 N·m, the joint gets no dry friction: 5.4 N·m - 0.7 · 8 N·m is below zero.
        let mut rubs = begun(0.0, 8.0);
        assert_near(tick(&mut rubs, sign * 0.0025, 0.0).brake, 0.0, "no dry friction");
        rubs.set_friction(0.0, 0.0);
        assert_near(tick(&mut rubs, sign * 0.0025, 0.0).brake, 0.0, "dry friction without extension");
    }
}
