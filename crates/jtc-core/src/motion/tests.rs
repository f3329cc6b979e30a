//! Tests of the set values, of the position hold, and of joints that come to rest (J-40 to J-44).
use super::*;
use crate::DT;
use crate::interpolation::SetPoint;
use crate::motion::catch::Catch;
use crate::motion::deceleration::Deceleration;

mod parts;

/// Returns the motion of an arm in which these joints are held.
fn holding(joints: [bool; JOINTS]) -> Motion {
    let mut motion = Motion::default();
    motion.set.holding = joints;
    motion
}

#[test]
fn j34_on_the_approach_velocity_and_acceleration_are_the_derivatives_of_the_position() {
    let (from, to) = ([0.1, -0.2, 0.3, 0.0, 1.0, -1.0], [0.13, -0.2, 0.28, 0.05, 1.0, -0.96]);
    let at = |ms: f64| approach(&from, &to, ms / 200.0, 200.0);
    for ms in 1..200 {
        let (before, now, after) = (at(f64::from(ms - 1)), at(f64::from(ms)), at(f64::from(ms + 1)));
        for j in 0..JOINTS {
            let rate = (after.position[j] - before.position[j]) / (2.0 * DT);
            assert!((now.velocity[j] - rate).abs() < 1e-4, "{ms} ms: {} {rate}", now.velocity[j]);
            let change = (after.velocity[j] - before.velocity[j]) / (2.0 * DT);
            assert!((now.acceleration[j] - change).abs() < 5e-2, "{ms} ms: {} {change}", now.acceleration[j]);
        }
    }
    assert_eq!((at(0.0).position, at(200.0).velocity), (from, [0.0; JOINTS]));
    assert!(at(200.0).position.iter().zip(to).all(|(a, b)| (a - b).abs() < 1e-12));
}

/// An arm that is already at rest is held at once, without a deceleration. During a deceleration, the torque limits
/// would not apply and no new motion could begin.
#[test]
fn j25_an_arm_that_stands_is_held_at_once() {
    let (config, mut motion) = (Config::avena(), Motion::default());
    let nodes = Nodes::new(&config);
    motion.set.hold_for_test();
    motion.set.hold_measured(&nodes, 200.0, &config);
    assert!(motion.set.all_holding());
}

#[test]
fn j33_a_joint_moves_by_its_set_value_or_as_measured() {
    let (nodes, mut motion) = (Nodes::new(&Config::avena()), Motion::default());
    assert_eq!(motion.set.moving(&nodes), [false; JOINTS]);
    (motion.set.point.velocity[1], motion.set.point.velocity[4]) = (0.03, -0.03);
    assert_eq!(motion.set.moving(&nodes), [false, true, false, false, true, false]);
    let nodes = Nodes::enabled_at([0.0; JOINTS], [0.03, 0.01, 0.0, 0.02, 0.0, -0.03]);
    assert_eq!(motion.set.moving(&nodes), [true, true, false, false, true, true]);
}

#[test]
fn j33_on_a_ramp_of_path_time_velocity_and_acceleration_are_those_of_the_scaled_path() {
    let at = SetPoint { position: [0.5; JOINTS], velocity: [1.2; JOINTS], acceleration: [-3.0; JOINTS] };
    let mut motion = Motion::default();
    motion.set.follow(&at, 0.5, -4.0);
    // For q(s(t)), the velocity is q'·ṡ and the acceleration is q''·ṡ² + q'·s̈.
    assert_eq!((motion.set.point.position, motion.set.point.velocity), (at.position, [0.6; JOINTS]));
    assert!(motion.set.point.acceleration.iter().all(|a| (a - (-0.75 - 4.8)).abs() < 1e-12));
}

#[test]
fn j34_one_joint_that_is_not_at_rest_is_enough_to_wait_for() {
    let mut motion = Motion::default();
    motion.set.hold_for_test();
    assert!(motion.set.all_holding());
    let config = Config::avena();
    for j in 0..JOINTS {
        let mut decelerates = motion.clone();
        decelerates.set.deceleration[j] = Some(Deceleration::led(0.0, 0.3, 200.0, &config.joints[j]));
        let mut catches = motion.clone();
        catches.set.catch[j] = Catch::begin(&config);
        let mut off = motion.clone();
        off.set.holding[j] = false;
        assert!(
            [decelerates, catches, off].iter().all(|motion| !motion.set.all_holding()),
            "joint {}",
            j + 1
        );
    }
}

/// Teaching begins when the arm is held and the loads of its joints are known. If an obstacle may press on the arm (a
/// contact), Teaching begins after 2 s even if the loads are unknown.
#[test]
fn j25_an_arm_is_taught_when_it_is_held_and_what_it_carries_is_known() {
    for (held, contact, waits_ms, known, may) in [
        (true, false, 9_000, false, false),
        (true, false, 0, true, true),
        (true, true, KNOWN_MS - 1, false, false),
        (true, true, KNOWN_MS, false, true),
        (true, true, 0, true, true),
        (false, false, 9_000, true, false),
        (false, true, 9_000, false, false),
        (false, true, 9_000, true, false),
    ] {
        let mut motion = holding([held; JOINTS]);
        if known {
            motion.law.find_loads_for_test();
        }
        assert_eq!(
            motion.may_be_taught(&Config::avena(), contact, waits_ms),
            may,
            "{held} {contact} {waits_ms} {known}"
        );
    }
}

/// Returns the motion of an arm after joint 4 was measured at this `velocity` (rad/s). `held` and `enabled` are the
/// states of joint 4. All other joints are held.
fn latched(held: bool, enabled: bool, velocity: f64) -> Motion {
    let (config, at, off) = (Config::avena(), [0.3; JOINTS], 3);
    let mut velocities = [0.0; JOINTS];
    velocities[off] = velocity;
    let nodes = Nodes::enabled_at(at, velocities);
    let nodes = if enabled { nodes } else { nodes.with_torque_off(off) };
    let mut motion = Motion::default();
    motion.set.begin_at(&[0.1; JOINTS]);
    motion.set.hold_for_test();
    motion.set.holding[off] = held;
    motion.latch(&nodes, &config);
    motion
}

#[test]
fn j16_j43_what_becomes_of_a_joint_and_of_the_others_when_it_is_enabled() {
    for (held, enabled, velocity, follows, catches, falls) in [
        (true, true, 0.0, false, false, false),
        (true, true, 0.5, false, false, false),
        // Joint 4 was just enabled, so it is latched at its measured position. A moving load of joint 4 can also move
        // the other joints, so their catch begins again.
        (false, true, 0.0, true, true, false),
        (false, true, 0.5, true, true, true),
        // Joint 4 is not enabled, so its set values follow its measured values, even if it was held before.
        (false, false, 0.0, true, false, false),
        (false, false, 0.5, true, false, false),
        (true, false, 0.5, true, false, false),
    ] {
        let motion = latched(held, enabled, velocity);
        let what = (held, enabled, velocity);
        let position: [f64; JOINTS] = core::array::from_fn(|j| if follows && j == 3 { 0.3 } else { 0.1 });
        assert_eq!(motion.set.point.position, position, "{what:?}");
        assert_eq!(motion.set.catch.map(|catch| catch.busy()), [catches; JOINTS], "{what:?}");
        assert_eq!(
            core::array::from_fn::<bool, JOINTS, _>(|j| motion.set.deceleration[j].is_some()),
            core::array::from_fn(|j| falls && j == 3),
            "{what:?}"
        );
        assert_eq!(motion.set.holding, core::array::from_fn(|j| enabled || j != 3), "{what:?}");
    }
}

#[test]
fn j16_j25_what_moves_and_was_held_comes_to_rest() {
    for (velocity, decelerates) in [(0.0, false), (0.02, false), (0.021, true), (-0.5, true)] {
        // If joint 2 moves faster than 0.02 rad/s, all joints that are held decelerate.
        let nodes = Nodes::enabled_at([0.3; JOINTS], [0.0, velocity, 0.0, 0.0, 0.0, 0.0]);
        let mut motion = holding([true, true, true, false, true, true]);
        motion.set.hold_measured(&nodes, 200.0, &Config::avena());
        assert_eq!(motion.set.point, SetPoint::still([0.3; JOINTS]));
        let found: [bool; JOINTS] = core::array::from_fn(|j| motion.set.deceleration[j].is_some());
        assert_eq!(found, core::array::from_fn(|j| decelerates && j != 3), "{velocity}");
    }
}

/// At the end of Teaching, an arm that moves comes to rest, and the controller catches it like a load. An arm at rest
/// is held at once.
#[test]
fn j25_the_end_of_teaching_catches_an_arm_that_moves() {
    for (velocity, moves) in [(0.0, false), (0.02, false), (0.3, true)] {
        let (nodes, config) = (Nodes::enabled_at([0.3; JOINTS], [velocity; JOINTS]), Config::avena());
        let mut motion = holding([true; JOINTS]);
        motion.end_teaching(&nodes, &config, &[PidGains::default(); JOINTS]);
        assert_eq!((motion.set.is_led(), motion.set.all_holding()), (moves, !moves), "{velocity} rad/s");
        let mut ms = 0;
        while motion.set.is_led() {
            motion.hold(&config);
            motion.set.led_to_rest(&config);
            ms += 1;
        }
        assert_eq!(ms > 0, moves);
        assert!(ms <= 501, "{ms} ms");
        assert_eq!(motion.set.catch.map(|catch| catch.busy()), [moves; JOINTS], "{velocity} rad/s");
    }
}

#[test]
fn j21_an_arm_without_torque_is_held_nowhere_and_shown_where_it_is() {
    let nodes = Nodes::enabled_at([0.3; JOINTS], [0.1; JOINTS]);
    let mut motion = holding([true; JOINTS]);
    motion.law.torque[2].friction = 7.0;
    motion.set.catch[1] = Catch::begin(&Config::avena());
    motion.set.begin_at(&[0.1; JOINTS]);
    motion.release(&nodes);
    assert_eq!(motion.set.point, SetPoint::still([0.3; JOINTS]));
    // J-62: the due position is equal to the measured position, so the position error is zero.
    assert_eq!(motion.set.due(&Config::avena()), &[0.3; JOINTS]);
    assert_eq!((motion.set.holding, motion.law.torque), Default::default());
    assert!(!motion.set.catch[1].busy());
}
