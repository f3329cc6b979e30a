//! Tests of the conditions that end a yield, and of the conditions for sinking.
use super::*;

/// Executes the ticks with the same inputs. Returns `true` if the joint is calm afterwards.
fn calm_after(mut yields: Yield, ticks: u16, joint: &Joint<'_>) -> bool {
    (0..ticks).for_each(|_| {
        yields.step(joint);
    });
    yields.is_calm()
}

/// A joint is not calm while its brake needs more torque than the permitted share for a slow push. At 1.6 rad/s, four
/// fifths of the velocity limit, the brake uses the whole limit of 100 N·m.
#[test]
fn j68_a_joint_is_not_calm_while_its_brake_has_more_than_the_share() {
    let limits = round_limits();
    let begun = || Yield::begin(false, false, 0.0, INERTIA, 0.0);
    let calm = |young_velocity: f64| {
        calm_after(begun(), 300, &Joint { young_velocity, ..at(&limits, 0.0, 0.0, 0.0) })
    };
    assert!(calm(0.0) && !calm(1.6) && !calm(-1.6));
    // At 0.7 rad/s, the torque of the brake is 83.3 N·m·s/rad · (0.7 − 0.4) rad/s = 25 N·m. This is less than the
    // permitted share of 30 N·m, so the joint is calm.
    assert!(calm(0.7));
}

/// With an inertia of 1 kg·m², the damping is 100 N·m·s/rad, so the damper has 3.125 N·m at 1/32 rad/s. The share is
/// 1/32 of the limit of 100 N·m, which is the same torque. The joint is calm.
#[test]
fn j68_a_damper_torque_that_equals_the_share_is_within_the_share() {
    let limits = JointConfig { velocity_max: 1.0, ..round_limits() };
    let calm = |share: f64| {
        let begun = Yield { damping: 100.0, ..Yield::begin(false, false, 0.0, 1.0, 0.0) };
        calm_after(begun, 200, &Joint { share, ..at(&limits, 0.0, 0.03125, 0.0) })
    };
    assert!(calm(0.03125));
    assert!(!calm(0.03), "the share is 3 N·m");
}

/// The extended spring has its highest torque of 30 N·m, which is 0.75 times the load of 40 N·m. The load therefore
/// seems to drive the joint. After 50 ms the joint is not calm. The model torque balances the load, so the joint does
/// not sink.
#[test]
fn j68_a_joint_is_not_calm_once_its_load_has_driven_it_for_50_ms() {
    let limits = round_limits();
    let joint = at(&limits, 0.02, 0.01, -40.0);
    let mut yields = Yield::begin(false, false, 0.0, INERTIA, 40.0);
    for ms in 1..=300 {
        yields.step(&joint);
        assert_eq!(yields.calm_ms, if ms < 50 { ms } else { 0 }, "{ms} ms");
    }
    assert!(!yields.is_calm());
}

/// A downward motion counts as sinking only if gravity pulls with more than 5 % of the limit of 100 N·m.
#[test]
fn j68_a_joint_sinks_only_under_more_than_five_percent_of_its_limit() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        for (model, lowers) in [(5.0, false), (5.1, true)] {
            let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
            for _ in 0..2_000 {
                tick(&mut yields, &at(&limits, 0.0, -sign * 0.3, sign * model));
            }
            assert_eq!(yields.lowers(), lowers, "{model} N·m, sign {sign}");
        }
    }
}

/// The joint moves for 2.9 s under 4 N·m, and then for 0.2 s under 20 N·m. Only the last 0.2 s count as sinking,
/// because 4 N·m are less than 5 % of the limit. The joint moves by 0.093 rad in total.
#[test]
fn j68_the_time_of_sinking_begins_when_gravity_pulls_the_joint() {
    let limits = round_limits();
    let lowers = |first: f64| {
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        for ms in 0..3_100 {
            tick(&mut yields, &at(&limits, 0.0, -0.03, if ms < 2_900 { first } else { 20.0 }));
        }
        yields.lowers()
    };
    assert!(!lowers(4.0) && lowers(20.0));
}

#[test]
fn j68_a_joint_that_has_sunk_by_half_a_radian_is_not_overloaded_yet() {
    let limits = round_limits();
    for (sunk, lowers) in [(0.5, false), (0.501, true)] {
        let mut yields = Yield { sunk, ..Yield::begin(false, false, 0.0, INERTIA, 0.0) };
        tick(&mut yields, &at(&limits, 0.0, 0.0, 20.0));
        assert_eq!(yields.lowers(), lowers, "{sunk} rad");
    }
}

/// The load of 40 N·m was reduced to zero, so gravity does not pull the joint and the joint does not sink. At 0.03
/// rad/s, the joint is too slow for the load to return.
#[test]
fn j68_a_load_that_has_faded_does_not_make_the_joint_sink() {
    let limits = round_limits();
    let lowers = |load: f64| {
        let mut yields = Yield { load, ..Yield::begin(false, false, 0.0, INERTIA, 40.0) };
        for _ in 0..3_100 {
            tick(&mut yields, &at(&limits, 0.0, -0.03, 0.0));
        }
        yields.lowers()
    };
    assert!(!lowers(0.0) && lowers(40.0));
}
