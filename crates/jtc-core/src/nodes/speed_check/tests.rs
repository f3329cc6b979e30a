//! Tests of the check that compares the two encoders of each joint (J-35).
use jtc_bus::NodeState;
use jtc_wire::StopKind;

use super::*;
use crate::nodes::measure::{Late, Reading, Tick};

/// Stiffness of the gear in these tests, N·m/rad, and torque limit, N·m. The gear twists by 2 rad at the torque limit.
const STIFFNESS: f64 = 4.0;
const TORQUE_MAX: f64 = 8.0;

/// Returns settings with a permitted difference at rest of three steps of 0.25 rad, which is 0.75 rad.
fn config() -> Config {
    let mut config = Config { encoder_step: 0.25, gear_stiffness: STIFFNESS, ..Config::avena() };
    config.joints.iter_mut().for_each(|joint| joint.torque_max = TORQUE_MAX);
    config
}

/// Joint with the state of its check.
#[derive(Default)]
struct Joint {
    differs: Differs,
    node: Node,
}

impl Joint {
    /// Adds a check with these two distances, rad. The torque has not changed since the last check.
    fn check(&mut self, measured: f64, reported: f64) -> bool {
        let (config, ways) = (config(), Ways { measured, reported });
        self.differs.differ(&ways, &mut self.node, 0.0, &config.joints[0], &config)
    }

    /// Executes this check five times, and returns the result of the fifth check. The results of the first four
    /// checks must be `false`.
    fn five(&mut self, measured: f64, reported: f64) -> bool {
        (0..4).for_each(|n| assert!(!self.check(measured, reported) && !self.node.misbehaved, "check {n}"));
        self.check(measured, reported)
    }
}

/// The permitted difference includes the twist of the gear by the change of the torque. Here this twist is |6 − 2|
/// N·m / 4 N·m/rad = 1 rad.
#[test]
fn j35_the_twist_by_a_change_of_the_torque_is_permitted() {
    for (torque, before) in [(6.0, 2.0), (2.0, 6.0), (-6.0, -2.0), (-2.0, 2.0)] {
        for (measured, looks) in [(1.75, 0), (-1.75, 0), (1.8125, 3), (-1.8125, 3)] {
            let same = measured > 0.0;
            let mut differs = Differs { looks: 2, measured: if same { 2.0 } else { -2.0 }, reported: 0.0 };
            let mut node = Node::default();
            node.report.torque = torque;
            let ways = Ways { measured, reported: 0.0 };
            let config = config();
            assert!(!differs.differ(&ways, &mut node, before, &config.joints[0], &config));
            assert_eq!(differs.looks, looks, "{torque} {before} {measured}");
        }
    }
}

/// Five consecutive differences are a fault if their sum exceeds twice the twist at the torque limit. The twist at
/// the torque limit is 8 N·m / 4 N·m/rad = 2 rad.
#[test]
fn j35_five_differences_of_more_than_twice_the_twist_are_a_fault() {
    let mut joint = Joint::default();
    // In the fifth check, the sum of the differences is 5 · 2 − 5 · 1 = 5 rad. The reported speed is half of the rate
    // of the positions.
    assert!(joint.five(2.0, 1.0));
    assert_eq!(joint.node.measured.misfit(), Some((StopKind::SpeedScale, 2.0)));
    assert!(!joint.node.misbehaved);
    // After the fault is reported, the count of differences begins again at zero.
    assert!(joint.five(2.0, 1.0));
}

#[test]
fn j35_a_sum_of_exactly_twice_the_twist_is_not_a_fault() {
    for sign in [1.0, -1.0] {
        let mut joint = Joint::default();
        // The sum of the first five differences is 4 · 0.78125 + 0.875 = 4 rad, which is still permitted. The sixth
        // difference of 0.78125 rad exceeds the limit.
        (0..4).for_each(|_| assert!(!joint.check(sign * 0.78125, 0.0)));
        assert!(!joint.check(sign * 0.875, 0.0) && !joint.node.misbehaved);
        assert_eq!(joint.differs.looks, 5);
        assert!(!joint.check(sign * 0.78125, 0.0) && joint.node.misbehaved);
    }
}

/// A check with a permitted difference ends the sequence of differences. The sums of the next sequence start at zero.
#[test]
fn j35_a_sequence_of_differences_begins_without_the_earlier_distances() {
    let mut joint = Joint::default();
    (0..4).for_each(|_| assert!(!joint.check(8.0, 1.0)));
    assert!(!joint.check(0.5, 0.0));
    assert_eq!(joint.differs.looks, 0);
    assert!(joint.five(2.0, 1.0));
    // The ratio of the distances is 2. If the earlier distances were included, the ratio would be 42 / 9.
    assert_eq!(joint.node.measured.misfit(), Some((StopKind::SpeedScale, 2.0)));
}

/// If the difference changes its direction, a new sequence begins, without the earlier differences.
#[test]
fn j35_only_differences_in_one_direction_are_added() {
    for sign in [1.0, -1.0] {
        let mut joint = Joint::default();
        (0..4).for_each(|_| assert!(!joint.check(sign * 8.0, sign)));
        assert!(joint.five(sign, sign * 4.0));
        assert_eq!(joint.node.measured.misfit(), Some((StopKind::SpeedScale, 0.25)));
    }
}

/// If both encoders move over different distances, the scale of the reported speed is wrong. If one distance is less
/// than a tenth of the other distance, its encoder does not move, which is an error of the joint.
#[test]
fn j35_an_encoder_with_less_than_a_tenth_of_the_distance_does_not_move() {
    for (measured, reported, factor) in [
        (10.0, 1.0, Some(10.0)),
        (-10.0, -1.0, Some(10.0)),
        (-10.0, 1.0, Some(-10.0)),
        (10.0625, 1.0, None),
        (-10.0625, 1.0, None),
        (8.0, 0.0, None),
        (1.0, 10.0, Some(f64::from(0.1f32))),
        (1.0, -10.0, Some(f64::from(-0.1f32))),
        (0.9375, 10.0, None),
        (0.0, 10.0, None),
    ] {
        let mut joint = Joint::default();
        assert_eq!(joint.five(measured, reported), factor.is_some(), "{measured} {reported}");
        let misfit = factor.map(|factor| (StopKind::SpeedScale, factor));
        assert_eq!(joint.node.measured.misfit(), misfit, "{measured} {reported}");
        assert_eq!(joint.node.misbehaved, factor.is_none(), "{measured} {reported}");
    }
}

/// Returns the ticks in which the check reports joint 1. The positions of the joint change at 1 rad/s, but its drive
/// reports 0.5 rad/s. `state` returns the state of the drive in a tick.
fn reported(ticks: u32, state: impl Fn(u32) -> NodeState) -> [Option<u32>; 3] {
    let config = Config { gear_stiffness: 1e6, ..Config::avena() };
    let mut nodes = [Node { valid: true, ..Node::default() }];
    let (mut check, mut found, mut count) = (SpeedCheck::default(), [None; 3], 0);
    for n in 0..ticks {
        let answer = Some(Reading { position: 1e-3 * f64::from(n), velocity: 0.5 });
        nodes[0].report.state = state(n);
        let tick = Tick {
            answer,
            expected: true,
            asked: true,
            answers: 1,
            commanded: 0.0,
            elapsed_ms: 1,
            velocity_max: 2.0,
            enabled: true,
            joint: 0,
        };
        let past = |_: u8| Late { ms: 0, commanded: 0.0, commanded_way: 0.0 };
        nodes[0].measured.step(&tick, past, &config);
        let mask = check.step(&mut nodes, &config);
        assert!(mask <= 1);
        if mask == 1 {
            found[count] = Some(n);
            count += 1;
        }
    }
    found
}

/// A joint is checked in every tenth tick. The first check with a whole window is in tick 10, and the fifth of these checks reports the
/// joint.
#[test]
fn j35_each_joint_is_checked_every_ten_milliseconds() {
    assert_eq!(reported(101, |_| NodeState::ENABLED), [Some(50), Some(100), None]);
}

/// A joint without torque is not checked. After the torque was off in a check, the controller counts five differences again.
#[test]
fn j35_encoders_are_compared_only_while_torque_is_on() {
    assert_eq!(reported(101, |_| NodeState::READY), [None; 3]);
    let off_in = |n: u32| if n == 40 { NodeState::READY } else { NodeState::ENABLED };
    assert_eq!(reported(101, off_in), [Some(90), None, None]);
}

/// The torque of the last check of a joint is stored until its next check.
#[test]
fn j35_the_torque_of_the_last_check_is_ten_ticks_old() {
    let config = config();
    let (mut check, mut nodes) = (SpeedCheck::default(), [Node::default(); JOINTS]);
    for n in 0..30u8 {
        nodes.iter_mut().for_each(|node| node.report.torque = f64::from(n));
        assert_eq!(check.step(&mut nodes, &config), 0);
        for j in 0..JOINTS as u8 {
            // Joint 1 is checked in the ticks 0, 10 and 20, and joint 2 in the ticks 1, 11 and 21.
            let last = if n >= j { (n - j) / 10 * 10 + j } else { 0 };
            assert_eq!(check.torque[usize::from(j)], f32::from(last), "tick {n}, joint {}", j + 1);
        }
    }
}
