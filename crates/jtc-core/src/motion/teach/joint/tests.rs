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

/// Moves a joint at `velocity` (rad/s) through 0 for a second, and returns its last torque.
fn moving(velocity: f64, coulomb: f64) -> TaughtTorque {
    let mut joint = begun(-velocity, coulomb);
    let mut torque = TaughtTorque::default();
    for k in 0..1_000 {
        torque = tick(&mut joint, velocity * (f64::from(k) / 1_000.0 - 1.0), velocity);
    }
    torque
}

proptest! {
    /// Together with the damping, the friction compensation and the dry friction never drive a joint. The total torque against the motion
    /// never decreases with the speed.
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
        // The test begins without dry friction. At 0.39 rad/s, the damping is not increased yet.
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
        // A joint that is pulled slowly slips, and the dry friction then holds it at its new position.
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

/// The friction compensation is half of the Coulomb friction, smoothed within 0.1 rad/s, and zero above 0.6 rad/s. The compensation is
/// lower if the damping does not allow its slope.
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
    // If Teaching begins with a joint inside its soft end, or beyond its position limit, the spring does not move the joint. If a joint
    // that began in its soft end moves further outwards, the spring acts.
    for (found, further) in [(1.45, 1.5), (1.7, 1.75), (-1.45, -1.5)] {
        let mut joint = begun(found, 8.0);
        assert!(tick(&mut joint, found, 0.0).brake.abs() < 1e-3, "{found}");
        let torque = tick(&mut joint, further, 0.0).brake;
        assert!((torque + 0.5 * share * f64::signum(found)).abs() < 1e-3, "{torque} N·m at {further} rad");
        // After a hand has moved this joint inwards and outwards again, the spring acts from the start of the soft end.
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
