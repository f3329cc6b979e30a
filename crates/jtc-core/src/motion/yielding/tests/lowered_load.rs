//! Tests of the load torque of a joint that lowers its load.
use super::*;

/// Returns a joint of 2 kg·m² that lowers its load. Its damper already has the full damping of 40 1/s · 2 kg·m² = 80 N·m·s/rad.
fn lowering(load: f64) -> Yield {
    Yield { damping: 80.0, ..Yield::begin(true, false, 0.0, 2.0, load) }
}

/// At 0.5 rad/s, the torque of the damper is 40 N·m. This torque becomes load torque with a time constant of 0.5 s: 40
/// N·m · 1 ms / 0.5 s = 0.08 N·m in each tick, and 8 N·m in 100 ticks.
#[test]
fn j70_the_torque_of_the_damper_becomes_load_torque_within_half_a_second() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        let mut yields = lowering(sign * 10.0);
        for _ in 0..100 {
            let torque = tick(&mut yields, &at(&limits, 0.0, -sign * 0.5, sign * 50.0));
            assert_eq!((torque.p, torque.d), (0.0, sign * 40.0));
        }
        assert!((yields.load() - sign * 18.0).abs() < 1e-9, "{} N·m", yields.load());
    }
}

/// The model torque of 60 N·m leaves 40 N·m of the limit of 100 N·m for the load torque. The load torque reaches 40 N·m after 500 ticks.
#[test]
fn j70_the_load_torque_grows_up_to_the_whole_limit() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        let mut yields = lowering(0.0);
        for _ in 0..600 {
            tick(&mut yields, &at(&limits, 0.0, -sign * 0.5, sign * 60.0));
        }
        assert_eq!(yields.load(), sign * 40.0);
    }
}

/// The load sinks by 0.6 rad, and the load torque reaches 50 N·m. A hand then lifts the joint at 0.5 rad/s. The load torque falls by 0.08
/// N·m in each tick. After 625 ticks, the load torque is again the torque at the beginning.
#[test]
fn j70_a_joint_that_has_sunk_far_and_is_lifted_has_the_load_of_the_beginning() {
    let limits = round_limits();
    let mut yields = lowering(0.0);
    for ms in 0..1_200 + 700 {
        tick(&mut yields, &at(&limits, 0.0, if ms < 1_200 { -0.5 } else { 0.5 }, 50.0));
    }
    assert_eq!(yields.load(), 0.0);
}

/// In this pose, gravity pulls the joint with only 2 N·m, less than 5 % of the limit. The load torque of 10 N·m was
/// learned in another pose. If a hand moves the joint in this pose, the load torque does not change.
#[test]
fn j70_without_gravity_the_load_torque_does_not_follow_a_hand() {
    let limits = round_limits();
    for velocity in [0.5, -0.5] {
        let mut yields = Yield { load: 10.0, ..lowering(0.0) };
        tick(&mut yields, &at(&limits, 0.0, velocity, 2.0));
        assert_eq!(yields.load(), 10.0, "{velocity} rad/s");
        tick(&mut yields, &at(&limits, 0.0, velocity, 20.0));
        // If gravity pulls with 20 N·m, the load changes by 40 N·m · 1 ms / 0.5 s = 0.08 N·m in one tick.
        assert!((yields.load() - (10.0 - velocity.signum() * 0.08)).abs() < 1e-9, "{} N·m", yields.load());
    }
}

/// Two joints with an inertia of 2 kg·m² share the damping rate, so each has half of 80 N·m·s/rad. At 0.1 rad/s, each
/// damper has 4 N·m.
#[test]
fn j70_joints_that_lower_loads_share_the_damping() {
    let limits = round_limits();
    for (lowering, inertia, torque) in
        [(1, 2.0, 8.0), (2, 2.0, 4.0), (4, 2.0, 2.0), (3, 3.0, 4.0), (0, 2.0, 8.0)]
    {
        let mut yields = Yield::begin(true, false, 0.0, inertia, 0.0);
        let joint = Joint { lowering, ..at(&limits, 0.0, -0.1, 50.0) };
        let d = (0..200).fold(0.0, |_, _| tick(&mut yields, &joint).d);
        assert!((d - torque).abs() < 1e-9, "{lowering} joints, {inertia} kg·m²: {d} N·m");
    }
}

/// When a yielding joint begins to lower its load, the torque of the spring is added to the load torque. A later
/// lifting does not reduce the load torque below this sum.
#[test]
fn j70_the_torque_of_the_spring_becomes_load_torque() {
    for (load, spring, sum) in [(10.0, 4.0, 14.0), (10.0, -4.0, 6.0), (-10.0, 30.0, 20.0), (0.0, 3.0, 3.0)] {
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, load);
        yields.lower(spring);
        assert!(yields.lowers());
        assert_eq!((yields.load(), yields.least), (sum, sum));
    }
}

/// The limit is 100 N·m. The controller holds a joint again that needs at most 95 N·m.
#[test]
fn j70_a_load_of_exactly_95_percent_of_the_limit_is_held_again() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        for (load, held) in [(15.0, true), (15.5, false)] {
            let mut yields = Yield::begin(true, false, 0.0, INERTIA, sign * load);
            for _ in 0..200 {
                tick(&mut yields, &at(&limits, 0.0, 0.0, sign * 80.0));
            }
            assert_eq!((yields.is_calm(), yields.is_over()), (true, held), "{load} N·m");
        }
    }
}

/// Gravity pulls with 4 N·m, less than 5 % of the limit of 100 N·m. A hand moves the joint by 0.6 rad, and this does
/// not count as sinking. Then gravity pulls with 20 N·m. The joint may sink by 0.4 rad, but after another 0.2 rad it
/// is overloaded.
#[test]
fn j68_only_a_joint_that_gravity_pulls_sinks() {
    let limits = round_limits();
    for sign in [1.0, -1.0] {
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        for (ms, velocity, model, lowers) in
            [(2_000, -0.3, 4.0, false), (1_000, -0.4, 20.0, false), (500, -0.4, 20.0, true)]
        {
            for _ in 0..ms {
                tick(&mut yields, &at(&limits, 0.0, sign * velocity, sign * model));
            }
            assert_eq!(yields.lowers(), lowers, "{model} N·m");
        }
    }
}
