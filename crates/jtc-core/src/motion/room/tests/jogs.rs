//! Tests of the velocities and accelerations of a jog that the torque limits allow (J-58).
use core::f64::consts::FRAC_PI_3;

use super::*;

impl Bench {
    /// Returns the velocities that the controller allows for a jog, rad/s.
    fn jog(&self, wanted: &[f64; JOINTS]) -> Option<[f64; JOINTS]> {
        self.room(wanted).map(|room| room.velocity)
    }

    fn room(&self, wanted: &[f64; JOINTS]) -> Option<JogRoom> {
        self.ask(|motion, inputs| motion.jog_room(wanted, inputs))
    }

    /// Returns the velocity that the controller allows for a jog of joint 1, rad/s.
    fn jog_first(&self, wanted: f64) -> Option<f64> {
        self.jog(&two(wanted, 0.0)).map(|velocity| velocity[0])
    }

    /// Returns the torques that remain for a jog, N·m.
    fn leaves(&self, velocity: &[f64; JOINTS]) -> [f64; JOINTS] {
        self.ask(|motion, inputs| motion.jog_leaves(velocity, inputs))
    }
}

/// `left` is 92 N·m minus the holding torque and the friction. Half of it must stop the velocity v within 0.3 s: 0.5
/// · left = inertia · v / 0.3 s. Therefore v = 0.15 s · left / inertia.
#[test]
fn j58_half_of_the_remaining_torque_can_stop_the_jog_within_300_ms() {
    for (inertia, held, friction, wanted, velocity) in [
        // 0.15 · 92 = 13.8.
        (13.8, 0.0, 0.0, 1.0, 1.0),
        (6.9, 0.0, 0.0, 1.0, 1.0),
        (27.6, 0.0, 0.0, 1.0, 0.5),
        (27.6, 0.0, 0.0, -1.0, -0.5),
        (27.6, 0.0, 0.0, 0.8, 0.5),
        (27.6, 0.0, 0.0, 0.4, 0.4),
        // 0.15 · (92 − 32) = 9.
        (18.0, 32.0, 0.0, 1.0, 0.5),
        (18.0, -32.0, 0.0, 1.0, 0.5),
        // inertia · v = 0.15 · (92 − 32 − 12) = 7.2. The friction of 12 N·m is subtracted for both directions of the
        // motion.
        (14.4, 32.0, 12.0, 1.0, 0.5),
        (14.4, -32.0, 12.0, 1.0, 0.5),
        (14.4, 32.0, 12.0, -1.0, -0.5),
    ] {
        let bench = Bench::new().inertia(&[(0, 0, inertia)]).integral(0, held).friction(friction, 0.0);
        let found = bench.jog_first(wanted).unwrap();
        assert!(near(found, velocity), "{inertia} {held} {friction} {wanted}: {found}");
    }
    // At the wanted velocities, joint 1 has the momentum |27.6 · 0.8| + |−11.04 · 0.5| = 27.6 N·m·s. Its torque can
    // stop only 0.15 · 92 = 13.8 N·m·s, so half of the velocities is allowed.
    let bench = Bench::new().inertia(&[(0, 0, 27.6), (0, 1, -11.04)]);
    let found = bench.jog(&two(0.8, 0.5)).unwrap();
    assert!(all_near(&found, &two(0.4, 0.25)), "{found:?}");
}

/// The friction is `viscous` times the speed of the joint. A joint below 0.1 rad/s has the friction of 0.1 rad/s.
#[test]
fn j58_a_jog_creeps_if_friction_leaves_no_torque_for_a_higher_speed() {
    for (inertia, viscous, wanted, velocity) in [
        // At 0.5 rad/s, the friction of 100 N·m leaves no torque. At the slow speed of 0.02 rad/s, 92 − 20 = 72 N·m
        // remain. This torque would allow 0.15 · 72/10 = 1.08 rad/s, so the jog gets 0.02 rad/s.
        (10.0, 200.0, 0.5, 0.02),
        (10.0, 200.0, -0.5, -0.02),
        // The torque that remains at 0.02 rad/s allows only 0.15 · 72/1080 = 0.01 rad/s.
        (1_080.0, 200.0, 0.5, 0.01),
        // At 0.5 rad/s, 92 − 91 = 1 N·m remains and allows 0.15/10 = 0.015 rad/s. At the slow speed, 92 − 18.2 N·m
        // remain, so the jog gets 0.02 rad/s.
        (10.0, 182.0, 0.5, 0.02),
        // At 0.5 rad/s, 92 − 90 = 2 N·m remain and allow 0.15 · 2/10 = 0.03 rad/s. This is faster than the slow speed
        // of 0.02 rad/s.
        (10.0, 180.0, 0.5, 0.03),
        // A jog never gets more than the requested speed, also below 0.02 rad/s.
        (10.0, 200.0, 0.02, 0.02),
        (10.0, 200.0, 0.01, 0.01),
        (10.0, 0.0, 0.01, 0.01),
    ] {
        let bench = Bench::new().inertia(&[(0, 0, inertia)]).friction(0.0, viscous);
        let found = bench.jog_first(wanted).unwrap();
        assert!(near(found, velocity), "{inertia} {viscous} {wanted}: {found}");
    }
}

/// The torque allows 0.15 · 92/inertia = 13.8/inertia rad/s. The jog is refused if the allowed speed is at most 0.001
/// rad/s, unless the host requested such a slow speed.
#[test]
fn j58_a_jog_is_refused_if_the_torque_allows_at_most_a_thousandth_of_a_radian_per_second() {
    for (inertia, wanted, velocity) in [
        (6_900.0, 0.5, Some(0.002)),
        (27_600.0, 0.5, None),
        (27_600.0, -0.5, None),
        // The allowed speed is exactly 0.001 rad/s: 0.015625 · 13800/0.3 = 718.75 N·m are needed for the request, and
        // 46/718.75 · 0.015625 = 0.001.
        (13_800.0, 0.015625, None),
        (13_799.0, 0.015625, Some(13.8 / 13_799.0)),
        (1.0, 0.0005, Some(0.0005)),
        (1.0, 0.001, Some(0.001)),
        (27_600.0, 0.001, None),
    ] {
        let found = Bench::new().inertia(&[(0, 0, inertia)]).jog_first(wanted);
        let same = match (found, velocity) {
            (Some(found), Some(velocity)) => near(found, velocity),
            (found, velocity) => found == velocity,
        };
        assert!(same, "{inertia} {wanted}: {found:?}");
    }
    assert_eq!(46.0 / 718.75 * 0.015625, 0.001, "the speed of 0.001 rad/s is exact");
}

/// The highest acceleration is 2 rad/s² for joint 1 and 4 rad/s² for joint 2. Half of the remaining torque is 46 N·m.
/// Joint 1 needs 46 · 2 = 92 N·m for its own acceleration, and 11.5 · 4 = 46 N·m for that of joint 2. Joint 2 needs
/// at most 11.5 · 2 + 4 · 4 = 39 N·m.
#[test]
fn j58_half_of_the_remaining_torque_accelerates_the_joints_that_move() {
    for (wanted, set, share) in [
        (two(0.1, 0.0), two(0.0, 0.0), 0.5),
        (two(-0.1, 0.0), two(0.1, 0.0), 0.5),
        (two(0.0, 0.1), two(0.0, 0.0), 1.0),
        // Both joints accelerate, so joint 1 needs 92 + 46 N·m. The share is 46/(92 + 46).
        (two(0.1, -0.1), two(0.0, 0.0), 1.0 / 3.0),
        // The second joint has no requested velocity, but it still moves and must come to rest, so both joints need
        // torque.
        (two(0.1, 0.0), two(0.0, 0.1), 1.0 / 3.0),
        (two(0.0, 0.1), two(-0.1, 0.0), 1.0 / 3.0),
    ] {
        let mut bench = Bench::new().inertia(&[(0, 0, 46.0), (0, 1, -11.5), (1, 0, -11.5), (1, 1, 4.0)]);
        bench.config.joints[1].acceleration_max = 20.0;
        bench.motion.set.point.velocity = set;
        let room = bench.room(&wanted).unwrap();
        assert_eq!(room.velocity, wanted);
        let expected = core::array::from_fn::<_, JOINTS, _>(|j| share * if j == 1 { 4.0 } else { 2.0 });
        assert!(all_near(&room.acceleration, &expected), "{wanted:?} {set:?}: {:?}", room.acceleration);
    }
}

/// Friction of 91.9 N·m leaves 0.1 N·m of 92 N·m. With 1 kg·m², half of this torque gives 1/40 of the highest
/// acceleration of 2 rad/s². With 2 kg·m² it would give 1/80, but the lower bound of 2 % applies.
#[test]
fn j58_a_jog_has_at_least_two_per_cent_of_its_highest_acceleration() {
    for (inertia, acceleration) in [(1.0, 2.0 / 40.0), (2.0, 0.04)] {
        let bench = Bench::new().inertia(&[(0, 0, inertia)]).friction(91.9, 0.0);
        let room = bench.room(&two(0.005, 0.0)).unwrap();
        assert!(all_near(&room.acceleration, &[acceleration; JOINTS]), "{inertia}: {:?}", room.acceleration);
    }
}

/// A mass of 9 kg needs 90 N·m at the horizontal position. At π/3 before or after it, it needs 45 N·m, which leaves
/// 92 − 45 = 47 N·m. In the longest time that a jog can continue, 0.2 s + 0.15 s, it moves to another holding torque.
/// The higher holding torque of start and end is subtracted.
#[test]
fn j58_the_torque_at_the_end_of_the_jog_also_remains() {
    let jog = |position: f64, range: (f64, f64), velocity: f64| {
        let mut bench = Bench::new().mass(9.0).at(position);
        (bench.config.joints[0].position_min, bench.config.joints[0].position_max) = range;
        bench.leaves(&two(velocity, 0.0))[0]
    };
    let free = (-2.5, 2.5);
    for (position, range, velocity) in [
        // The holding torque at the end of the jog is higher.
        (-FRAC_PI_3 - 0.35, free, 1.0),
        (-FRAC_PI_3 - 0.175, free, 0.5),
        (FRAC_PI_3 + 0.35, free, -1.0),
        // The holding torque at the present position is higher.
        (-FRAC_PI_3, free, -1.0),
        (FRAC_PI_3, free, 0.5),
        // The jog ends at the limit of the joint.
        (-FRAC_PI_3 - 0.1, (-2.5, -FRAC_PI_3), 1.0),
        (FRAC_PI_3 + 0.1, (FRAC_PI_3, 2.5), -1.0),
        // A joint beyond its limit does not move further out.
        (-FRAC_PI_3, (-2.5, -FRAC_PI_3 - 0.1), 1.0),
        (FRAC_PI_3, (FRAC_PI_3 + 0.1, 2.5), -1.0),
    ] {
        let left = jog(position, range, velocity);
        assert!(near(left, 47.0), "{position} {range:?} {velocity}: {left}");
    }
}

/// The friction of a moving joint is 10 N·m plus 10 N·m·s/rad times its speed. A joint below 0.1 rad/s counts as if
/// it moved at 0.1 rad/s.
#[test]
fn j58_friction_reduces_the_remaining_torque_of_the_joints_that_move() {
    for (velocity, left) in
        [(0.0, 92.0), (0.5, 77.0), (-0.5, 77.0), (0.1, 81.0), (0.001, 81.0), (-0.001, 81.0)]
    {
        let leaves = Bench::new().friction(10.0, 10.0).leaves(&two(velocity, 0.0));
        assert!(all_near(&leaves, &[left, 92.0, 92.0, 92.0, 92.0, 92.0]), "{velocity}: {leaves:?}");
    }
}

/// A mass of 9 kg needs 90 N·m at the horizontal position, and less torque everywhere else. Therefore at least 1 N·m
/// is always available for a jog away from this position. The exception is a jog that would lift the mass with more
/// than the torque limit.
#[test]
fn j58_a_joint_may_move_to_a_position_with_a_lower_holding_torque() {
    for (friction, velocity, left) in [
        // 92 − 90 − 0.5.
        (0.5, 1.0, 1.5),
        // 92 − 90 − 5 = −3 N·m remain, so the minimum of 1 N·m applies. To lift the mass, the joint needs 90 + 5 N·m,
        // which is below the limit of 100 N·m.
        (5.0, 1.0, 1.0),
        (10.0, 1.0, 1.0),
        // To lift the mass, the joint needs 90 + 11 N·m, which is above the limit of 100 N·m. The minimum does not
        // apply, and 92 − 90 − 11 = −9 N·m remain.
        (11.0, 1.0, -9.0),
        // In the other direction the joint lowers the mass, so the minimum of 1 N·m applies.
        (11.0, -1.0, 1.0),
    ] {
        let bench = Bench::new().mass(9.0).inertia(&[(0, 0, 1.0)]).friction(friction, 0.0);
        let found = bench.leaves(&two(velocity, 0.0))[0];
        assert!(near(found, left), "{friction} {velocity}: {found}");
    }
}

/// A mass of 12 kg needs 120 N·m at the horizontal position, more than the limit of 100 N·m. Joints 1 and 2
/// accelerate in opposite directions, and their effects on joint 1 cancel. Joint 1 therefore needs no torque for the
/// acceleration, and the jog does not lift the mass.
#[test]
fn j58_a_joint_whose_couplings_cancel_out_does_not_lift_its_load() {
    let heavy = |second: f64| {
        let bench = Bench::new().mass(12.0).inertia(&[(0, 0, 1.0), (0, 1, second)]);
        bench.leaves(&two(1.0, -1.0))[0]
    };
    assert!(near(heavy(1.0), 1.0), "{}", heavy(1.0));
    assert!(near(heavy(2.0), 1.0), "{}", heavy(2.0));
    // Here joint 1 lifts the mass with its own torque, so 92 − 120 = −28 N·m remain.
    assert!(near(heavy(0.5), -28.0), "{}", heavy(0.5));
}

/// The integral holds 95 N·m at every position, so a motion does not reduce the holding torque. 92 − 95 = −3 N·m
/// remain, and the jog is refused.
#[test]
fn j58_a_jog_to_a_position_with_the_same_holding_torque_is_no_unloading() {
    for velocity in [1.0, -1.0] {
        let bench = Bench::new().integral(0, 95.0).inertia(&[(0, 0, 1.0)]);
        assert!(near(bench.leaves(&two(velocity, 0.0))[0], -3.0), "{velocity}");
        assert!(bench.room(&two(velocity, 0.0)).is_none(), "{velocity}");
    }
}
