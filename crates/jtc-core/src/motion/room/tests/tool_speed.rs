//! Tests of the tool speed limit of a jog (J-58).
//!
//! The flange of the arm in these tests is 2 m from the axis of joint 1, 1 m from the axis of joint 2, and 0.5 m from the axis of joint 3.
//! The other axes go through the flange. The *contribution* of a joint is its speed times this distance, m/s.
use super::*;

impl Bench {
    /// Creates an arm with this tool speed limit, m/s.
    fn with_tool_speed(limit: f64) -> Self {
        let mut bench = Self::new();
        bench.config.tool_speed_max = limit;
        for (joint, x) in bench.model.joints.iter_mut().zip([0.0, 1.0, 0.5, 0.5]) {
            joint.xyz[0] = x;
        }
        bench
    }

    /// Sets the velocities (rad/s) of the first three joints.
    fn moving(mut self, velocity: [f64; 3]) -> Self {
        self.motion.set.point.velocity = three(velocity);
        self
    }

    /// Returns the velocities (rad/s) of the first three joints, reduced to the tool speed limit.
    fn slowed(&self, wanted: [f64; 3]) -> [f64; 3] {
        let slowed = self.ask(|motion, inputs| motion.slowed(&three(wanted), inputs));
        let [first, second, third, rest @ ..] = slowed;
        assert_eq!(rest, [0.0; 3]);
        [first, second, third]
    }
}

fn three([first, second, third]: [f64; 3]) -> [f64; JOINTS] {
    [first, second, third, 0.0, 0.0, 0.0]
}

/// The contributions of the wanted velocities are 2 · 1 + 1 · 1 + 0.5 · 0.5 = 3.25 m/s. If the limit is lower, all
/// velocities are reduced by the same factor.
#[test]
fn j58_a_jog_from_rest_is_scaled_down_to_the_tool_speed_limit() {
    let wanted = [1.0, -1.0, 0.5];
    for (limit, share) in [(8.0, 1.0), (3.25, 1.0), (1.625, 0.5), (0.8125, 0.25)] {
        let slowed = Bench::with_tool_speed(limit).slowed(wanted);
        assert!(all_near(&slowed, &wanted.map(|v| share * v)), "{limit}: {slowed:?}");
    }
}

#[test]
fn j58_a_tool_speed_limit_of_zero_does_not_limit_a_jog() {
    for (limit, share) in [(0.0, 1.0), (1.625, 0.5), (1e-3, 1e-3 / 3.25)] {
        let bench = Bench::with_tool_speed(limit);
        let wanted = three([1.0, -1.0, 0.5]);
        let velocity = bench.ask(|motion, inputs| motion.jog_room(&wanted, inputs)).unwrap().velocity;
        assert!(all_near(&velocity, &wanted.map(|v| share * v)), "{limit}: {velocity:?}");
    }
}

/// The wanted contributions of joints 1, 2 and 3 are 1, 2 and 1 m/s. The limit is 2 m/s, so the share is 2/4.
///
/// Joint 2 moves at 1.5 rad/s and must slow down to 1 rad/s. Its present contribution of 1.5 m/s leaves 0.5 m/s for
/// joints 1 and 3. Their wanted contributions are 2 m/s, so their share becomes 0.25. Joint 1 would then get 0.125
/// rad/s, but it already moves at 0.2 rad/s and may keep this speed. Joint 1 contributes 0.4 m/s. So 2 − 1.5 − 0.4 =
/// 0.1 m/s remain for joint 3, which is 0.2 rad/s.
#[test]
fn j58_joints_that_accelerate_share_the_tool_speed_that_the_other_joints_leave() {
    for sign in [1.0, -1.0] {
        let bench = Bench::with_tool_speed(2.0).moving([0.2, -1.5, 0.0].map(|v| sign * v));
        let slowed = bench.slowed([0.5, -2.0, 2.0].map(|v| sign * v));
        assert!(all_near(&slowed, &[0.2, -1.0, 0.2].map(|v| sign * v)), "{slowed:?}");
    }
    // Joint 1 moves against its wanted direction. Only the magnitude of its contribution counts, so the result is the
    // same.
    let slowed = Bench::with_tool_speed(2.0).moving([-0.2, -1.5, 0.0]).slowed([0.5, -2.0, 2.0]);
    assert!(all_near(&slowed, &[0.2, -1.0, 0.2]), "{slowed:?}");
}

/// Joint 2 alone is faster than the limit of 2 m/s. The other joints always get at least 0.5 % of the limit, 0.01 m/s.
/// Joints 1 and 3 want the same contribution, so each gets 0.005 m/s.
#[test]
fn j58_half_a_per_cent_of_the_tool_speed_limit_always_remains_for_joints_that_accelerate() {
    let slowed = Bench::with_tool_speed(2.0).moving([0.0, -3.0, 0.0]).slowed([0.5, -2.0, 2.0]);
    assert!(all_near(&slowed, &[0.0025, -1.0, 0.01]), "{slowed:?}");
    // Joint 1 moves exactly at its share of the limit (0.5 · 0.5 rad/s), so it is not too fast. Joint 1 shares the 0.01
    // m/s with joint 3, but it may also keep its present speed.
    let slowed = Bench::with_tool_speed(2.0).moving([0.25, -3.0, 0.0]).slowed([0.5, -2.0, 2.0]);
    assert!(all_near(&slowed, &[0.25, -1.0, 0.01]), "{slowed:?}");
}

/// A joint that accelerates at 2 rad/s² with a jerk limit of 20 rad/s³ needs 0.1 s until its acceleration is zero.
/// Until then it becomes faster by 0.5 · 2 · 0.1 = 0.1 rad/s.
///
/// The wanted contributions are 1 m/s each and the limit is 1 m/s, so the share is 1/2. Joint 2 moves at 0.8 rad/s
/// and leaves 0.2 m/s for joint 1, which would be 0.1 rad/s. Joint 1 reaches 0.175 rad/s in each case and may keep
/// this speed.
#[test]
fn j58_the_tool_speed_contains_the_speed_that_a_joint_reaches_until_its_acceleration_is_zero() {
    for (velocity, acceleration) in [
        (0.075, 2.0),
        (-0.075, -2.0),
        // 0.15 + 0.5 · 1 · 1/20.
        (0.15, 1.0),
        // The joint does not become faster later, so its present speed counts.
        (0.175, 0.0),
        (0.175, -2.0),
        (-0.175, 2.0),
        // The joint reverses and becomes faster: −0.025 + 0.5 · 8/20 = 0.175 rad/s.
        (-0.025, 2.0 * core::f64::consts::SQRT_2),
    ] {
        let mut bench = Bench::with_tool_speed(1.0).moving([velocity, -0.8, 0.0]);
        bench.motion.set.point.acceleration[0] = acceleration;
        let slowed = bench.slowed([0.5, -1.0, 0.0]);
        assert!(all_near(&slowed, &[0.175, -0.5, 0.0]), "{velocity} {acceleration}: {slowed:?}");
    }
}
