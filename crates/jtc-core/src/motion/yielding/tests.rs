//! Tests of yields and of lowered loads for single joints.
use proptest::prelude::*;

use super::*;
use crate::Config;

mod doubted_load;
mod end;
mod lowered_load;
mod torques;

const INERTIA: f64 = 5.0;
const SHARE: f64 = 0.3;

fn limits() -> JointConfig {
    Config::avena().joints[1]
}

/// The brake has zero torque in the first tick of a yield and its full torque soon after. The brake always acts against the motion.
#[test]
fn j68_a_fast_joint_is_braked_with_all_of_its_torque() {
    let limits = limits();
    for v in [1.2, -1.2] {
        let mut yields = Yield::begin(false, false, 0.0, 5.0, 0.0);
        let joint = Joint { young_velocity: v, ..at(&limits, 0.0, 0.0, 0.0) };
        assert_eq!(yields.step(&joint).d, 0.0);
        let torque = (0..20).fold(0.0, |_, _| yields.step(&joint).d);
        assert!((torque + limits.torque_max * v.signum()).abs() < 1e-3 * limits.torque_max, "{torque}");
        let slow = Joint { young_velocity: 0.19 * limits.velocity_max, ..joint };
        assert_eq!(yields.step(&slow).d, 0.0);
    }
}

/// Returns limits with round numbers: a torque limit of 100 N·m and a velocity limit of 2 rad/s.
fn round_limits() -> JointConfig {
    JointConfig { torque_max: 100.0, velocity_max: 2.0, ..limits() }
}

/// Returns the inputs of a joint in the middle of a wide range.
fn at<'a>(limits: &'a JointConfig, position: f64, velocity: f64, model: f64) -> Joint<'a> {
    Joint {
        position,
        velocity,
        young_velocity: 0.0,
        fresh: true,
        model,
        limits,
        range: (-2.9, 2.9),
        share: SHARE,
        lowering: 1,
    }
}

/// Drags the spring along with the joint, and executes one tick.
fn tick(yields: &mut Yield, joint: &Joint<'_>) -> PidTorque {
    yields.drag(joint.position);
    yields.step(joint)
}

proptest! {
    /// For any motion of the joint, the torque of the spring never exceeds its permitted share of the torque limit.
    /// The sum of spring and damper exceeds the share only if the damper alone exceeds it. The damper always acts
    /// against the motion.
    #[test]
    fn j68_a_slow_push_has_the_share_against_it_and_a_shove_the_limit(
        set in -3.0..3.0f64,
        way in -0.2..0.2f64,
        velocity in prop_oneof![Just(0.0), -3.0..3.0f64],
        model in -200.0..200.0f64,
        inertia in 0.1..10.0f64,
        load in -50.0..50.0f64,
    ) {
        let limits = limits();
        let most = SHARE * limits.torque_max;
        let mut yields = Yield::begin(false, false, set, inertia, load);
        // After 100 ticks, the damping has reached its final value.
        let joint = at(&limits, set + way, velocity, model);
        (0..100).for_each(|_| {
            tick(&mut yields, &joint);
        });
        let torque = tick(&mut yields, &joint);
        prop_assert!(torque.p.abs() <= most + 1e-9 && torque.d.abs() <= limits.torque_max);
        prop_assert!((torque.p + torque.d).abs() <= most.max(torque.d.abs()) + 1e-9);
        prop_assert!(torque.d * velocity <= 0.0 && (velocity != 0.0 || torque.d == 0.0));
        prop_assert_eq!(torque.i, load);
        // At half of the velocity limit, the damper torque is the torque limit minus the share of the spring. If the
        // inertia of the joint is too low for this damping, the damping is lower.
        let expected = (limits.torque_max - most) * velocity.abs() / (0.5 * limits.velocity_max);
        let light = DAMPING_RATE * inertia * velocity.abs();
        prop_assert!((torque.d.abs() - expected.min(light).min(limits.torque_max)).abs() < 1e-3);
    }

    /// A joint that lowers its load has no spring. The sum of model torque and load never exceeds the torque limit. The load never falls
    /// below its torque at the beginning.
    #[test]
    fn j70_a_load_that_is_lowered_is_damped_and_learned_within_the_limit(
        model in prop_oneof![-170.0..-20.0f64, 20.0..170.0f64],
        lowering in 1u8..4,
        velocities in prop::collection::vec(-0.4..0.4f64, 1..400),
    ) {
        let limits = limits();
        let mut yields = Yield::begin(true, false, 0.5, INERTIA, 0.0);
        for velocity in velocities {
            let before = yields.load();
            let torque = tick(&mut yields, &Joint { lowering, ..at(&limits, 0.1, velocity, model) });
            prop_assert_eq!(torque.p, 0.0);
            let most = LOWERING_RATE / f64::from(lowering) * INERTIA * velocity.abs();
            prop_assert!(torque.d.abs() <= most + 1e-9 && torque.d * velocity <= 0.0);
            prop_assert!((model + yields.load()).abs() <= limits.torque_max + 1e-9);
            prop_assert!((yields.load() - before).abs() <= most * DT / LEARNS_S + 1e-12);
            prop_assert!((yields.load() - before) * velocity <= 0.0, "it learns against the motion only");
            prop_assert!(yields.load() * model >= 0.0, "it carries no less than at the begin");
        }
    }
}

/// A hand lifts a joint that lowers its load, and then lets go. The load torque that held the joint still acts
/// afterwards.
#[test]
fn j70_a_joint_that_is_lifted_keeps_what_carries_it() {
    let limits = limits();
    let mut yields = Yield::begin(true, false, 0.5, 16.0, 0.0);
    for k in 0..4_000 {
        let velocity = if k % 500 < 250 { 0.1 } else { 0.0 };
        tick(&mut yields, &at(&limits, 0.1, velocity, 150.0));
        assert!(yields.load() >= 0.0, "{k}: {} N·m", yields.load());
    }
}

#[test]
fn j68_the_spring_is_dragged_along() {
    let limits = limits();
    let mut yields = Yield::begin(false, false, 1.0, INERTIA, 0.0);
    for (position, set) in [(1.0, 1.0), (1.01, 1.0), (1.05, 1.03), (1.04, 1.03), (0.5, 0.52)] {
        assert!((yields.drag(position) - set).abs() < 1e-12, "{position}");
        let torque = yields.step(&at(&limits, position, 0.0, 0.0));
        assert!((torque.p - SHARE * limits.torque_max * (set - position) / STRETCH).abs() < 1e-9);
        // A joint with little inertia has a softer spring.
        let light = Yield { inertia: 0.1, ..yields }.step(&at(&limits, position, 0.0, 0.0));
        assert!((light.p - 90.0 * (set - position)).abs() < 1e-9);
    }
}

#[test]
fn j68_without_answers_the_spring_fades() {
    let limits = limits();
    let mut yields = Yield::begin(false, false, 0.01, INERTIA, 0.0);
    let mut pull = |fresh: bool| tick(&mut yields, &Joint { fresh, ..at(&limits, 0.0, 0.0, 0.0) }).p;
    let whole = pull(true);
    assert_eq!((pull(false), pull(false)), (whole, whole), "two missing answers change nothing");
    let mut last = whole;
    for _ in 0..40 {
        let now = pull(false);
        assert!(now < last && last - now < 0.25 * whole, "no step");
        last = now;
    }
    assert!(last < 1e-3 * whole && pull(true) < 0.25 * whole);
}

#[test]
fn j68_at_the_end_of_its_range_a_joint_is_pushed_back() {
    let limits = limits();
    let pull = |position: f64| {
        let mut yields = Yield::begin(false, false, position, INERTIA, 0.0);
        tick(&mut yields, &at(&limits, position, 0.0, 0.0)).p
    };
    let most = SHARE * limits.torque_max;
    for sign in [1.0, -1.0] {
        for (position, share) in [(2.8, 0.0), (2.85, 0.5), (2.9, 1.0), (3.0, 1.0)] {
            assert!((pull(sign * position) + sign * share * most).abs() < 1e-6, "{position}");
        }
    }
}

/// Returns the number of ticks at this speed (rad/s) until the yield of the joint is over.
fn over_after(velocity: f64) -> Option<usize> {
    let limits = limits();
    let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
    (1..1_000).find(|_| {
        tick(&mut yields, &at(&limits, 0.0, velocity, 0.0));
        yields.is_over()
    })
}

#[test]
fn j68_a_joint_that_is_calm_for_200_ms_is_held_again() {
    assert_eq!((over_after(0.0), over_after(-0.049), over_after(0.05)), (Some(200), Some(200), None));
    let limits = limits();
    let mut stays = Yield::begin(false, true, 0.0, INERTIA, 0.0);
    for _ in 0..300 {
        tick(&mut stays, &at(&limits, 0.0, 0.0, 0.0));
    }
    assert!(stays.is_calm() && !stays.is_over(), "the host decides");
    stays.clear();
    assert!(stays.is_over());
    // Another motion begins the time of calm again, so the joint is not calm.
    tick(&mut stays, &at(&limits, 0.0, 0.2, 0.0));
    assert!(!stays.is_calm());
}

#[test]
fn j68_j70_a_joint_that_sinks_for_long_enough_lowers_its_load() {
    let limits = limits();
    let lowers_after = |velocity: f64, model: f64| {
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        (1..10_000).find(|_| {
            tick(&mut yields, &at(&limits, 0.0, velocity, model));
            yields.lowers()
        })
    };
    // The model torque of 20 N·m holds the joint up, so a motion in the negative direction is a motion down.
    assert_eq!(lowers_after(-0.3, 20.0), Some(1_667), "0.5 rad");
    // A joint that a hand moves down and up again and again has not sunk.
    let mut led = Yield::begin(false, false, 0.0, INERTIA, 0.0);
    for k in 0..10_000 {
        let velocity = if k % 1_000 < 500 { -0.3 } else { 0.3 };
        tick(&mut led, &at(&limits, 0.0, velocity, 20.0));
    }
    assert!(!led.lowers());
    assert_eq!(lowers_after(0.1, -20.0), Some(3_001), "3 s");
    for (velocity, model) in [(0.5, 20.0), (-0.5, -20.0), (-0.5, 8.9), (-0.02, 20.0)] {
        assert_eq!(lowers_after(velocity, model), None, "{velocity} rad/s, {model} N·m");
    }
}

/// A lowered load within the torque limit comes to rest. The controller holds it again if a small part of the torque
/// limit remains for the position controller.
#[test]
fn j70_a_load_at_rest_is_held_again_where_the_limit_leaves_something() {
    let limits = limits();
    for (load, held) in [(0.0, true), (70.0, true), (71.5, false)] {
        let mut yields = Yield::begin(true, false, 0.0, INERTIA, load);
        let over = (0..300).any(|_| {
            tick(&mut yields, &at(&limits, 0.0, 0.0, 100.0));
            yields.is_over()
        });
        assert_eq!(over, held, "{load} N·m");
        // The joint is at rest, so the controller holds it again if the host requests this.
        assert!(yields.is_calm());
        yields.clear();
        assert!(yields.is_over());
    }
    let mut moves = Yield::begin(true, false, 0.0, INERTIA, 0.0);
    for _ in 0..300 {
        tick(&mut moves, &at(&limits, 0.0, -0.02, 100.0));
    }
    assert!(!moves.is_calm());
}

#[test]
fn j68_the_third_time_within_ten_seconds_each_is_too_often() {
    let mut yielded = Yielded::default();
    let wait = |yielded: &mut Yielded, ms: u16| (0..ms).for_each(|_| yielded.step());
    assert!(!yielded.count(2));
    wait(&mut yielded, AGAIN_MS - 1);
    assert!(!yielded.count(2) && !yielded.count(3));
    wait(&mut yielded, AGAIN_MS - 1);
    assert!(yielded.count(2) && !yielded.count(3) && yielded.count(2));
    wait(&mut yielded, AGAIN_MS);
    assert!(!yielded.count(2));
}

/// Moves the yielding joint for `ms` at `velocity`, rad/s. Returns the load of the joint after this motion, N·m.
fn moves(yields: &mut Yield, velocity: f64, ms: u16) -> f64 {
    let limits = limits();
    let mut position = yields.set;
    for _ in 0..ms {
        position += velocity * DT;
        // The model torque opposes the load, so that the motion along the load is not a motion down.
        tick(yields, &at(&limits, position, velocity, -40.0));
    }
    yields.load()
}

/// The load of 40 N·m drives the joint, and spring and damper oppose it with 40 N·m. The controller assumes that a
/// person leaned on the arm while the load was learned. The load fades within a second, and returns if the joint
/// sinks. If a hand moves the joint faster, or against its load, the load does not change.
#[test]
fn j68_a_load_that_drives_the_joint_by_itself_goes() {
    let begun = || Yield::begin(false, false, 0.0, INERTIA, 40.0);
    for (velocity, ms) in [(0.01, DRIVEN_MS), (1.0, 1_000), (-0.01, 1_000), (-0.3, 1_000)] {
        assert_eq!(moves(&mut begun(), velocity, ms), 40.0, "{velocity} rad/s for {ms} ms");
    }
    let mut yields = begun();
    let left = moves(&mut yields, 0.01, 1_300);
    assert!((10.0..30.0).contains(&left) && yields.has_learned(), "{left} N·m");
    let led = moves(&mut yields, 1.0, 400);
    assert!((0.9 * left..=left).contains(&led), "{led} N·m");
    let back = moves(&mut yields, -0.1, 1_000);
    assert!((0.9 * 40.0..=40.0).contains(&back), "{back} N·m");
}

/// After a yield, the position controller takes over the part of the load that the spring has not opposed. This part
/// is never larger than the load, and never has the opposite sign.
#[test]
fn j68_the_position_controller_takes_over_what_the_spring_leaves() {
    for (load, spring, left) in [
        (40.0, 0.0, 40.0),
        (40.0, -15.0, 25.0),
        (40.0, -54.0, 0.0),
        (40.0, 20.0, 40.0),
        (-40.0, 54.0, 0.0),
        (-40.0, -9.0, -40.0),
    ] {
        assert_eq!(Yield::begin(false, false, 0.0, INERTIA, load).left(spring), left, "{load}, {spring} N·m");
        assert_eq!(Yield::begin(true, false, 0.0, INERTIA, load).left(spring), load, "lowered");
    }
}
