//! Tests of the set values of an arm that comes to rest, and of the motion that connects set values, control law and ramps.
use jtc_dynamics::Dynamics;

use super::*;
use crate::Parameters;

fn dynamics(config: &Config) -> Dynamics {
    Dynamics::new(&Parameters::avena().model, config.gravity)
}

/// Makes joint 3 yield.
fn yield_joint_3(motion: &mut Motion, config: &Config) {
    motion.law.begin_yield(2, (false, false), 0.0, 5.0, &config.joints[2]);
}

#[test]
fn j71_the_arm_is_held_when_every_present_joint_has_settled_and_none_yields() {
    for (settled, yields, absent, holds) in [
        (true, false, false, true),
        (false, false, false, false),
        (true, true, false, false),
        (false, true, false, false),
        (true, false, true, true),
        (false, false, true, true),
        (true, true, true, true),
    ] {
        let (mut config, mut motion) = (Config::avena(), Motion::default());
        motion.set.catch.iter_mut().for_each(Catch::calm_down);
        config.absent[2] = absent;
        if !settled {
            motion.set.catch[2] = Catch::begin(&config);
        }
        if yields {
            yield_joint_3(&mut motion, &config);
        }
        assert_eq!(motion.holds(&config), holds, "{settled} {yields} {absent}");
        assert_eq!(motion.set.settled(2), settled);
    }
}

/// All joints are held and their loads are known, but joint 3 yields. Teaching therefore does not begin.
#[test]
fn j25_teaching_does_not_begin_while_a_joint_yields() {
    let (config, mut motion) = (Config::avena(), holding([true; JOINTS]));
    motion.law.find_loads_for_test();
    assert!(motion.may_be_taught(&config, false, 0));
    yield_joint_3(&mut motion, &config);
    for contact in [true, false] {
        assert!(!motion.may_be_taught(&config, contact, KNOWN_MS), "{contact}");
    }
}

/// Joint 1 moves at 0.5 rad/s. A stop may use half of its torque limit of 80 N·m, and its peak deceleration is twice the mean. With an
/// inertia of 16 kg·m², the stop takes 2 · 16 · 0.5 / 40 s, which is 0.4 s. A lighter arm stops within the ramp of 200 ms. A heavier arm
/// uses the longest permitted time of 500 ms. The first tick commands the measured position, so a stop takes one more tick.
#[test]
fn j25_j33_the_end_of_teaching_gives_a_heavy_arm_more_time_to_stop() {
    for (inertia, stop_ms) in [(6.0, 200), (16.0, 400), (40.0, 500)] {
        let mut config = Config::avena();
        let nodes = Nodes::enabled_at([0.3; JOINTS], [0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let dynamics = dynamics(&config);
        config.joints[0].rotor_inertia = inertia - dynamics.mass_matrix(&[0.3; JOINTS])[0][0];
        let mut motion = holding([true; JOINTS]);
        motion.ramp.begin(&nodes, &config, &dynamics);
        motion.end_teaching(&nodes, &config, &[PidGains::default(); JOINTS]);
        let mut ticks = 0;
        while motion.set.is_led() {
            motion.hold(&config);
            motion.set.led_to_rest(&config);
            ticks += 1;
        }
        assert!((stop_ms + 1..=stop_ms + 2).contains(&ticks), "{inertia} kg·m²: {ticks} ticks");
    }
}

/// At the end of Teaching, a catch of all joints begins together with the deceleration. A second catch begins when
/// the arm has come to rest. In between, no catch begins.
#[test]
fn j25_j43_a_catch_begins_with_the_deceleration_and_with_the_rest() {
    let config = Config::avena();
    let busy = |motion: &Motion| motion.set.catch.map(|catch| catch.busy());
    let mut stands = holding([true; JOINTS]);
    stands.set.catch.iter_mut().for_each(Catch::calm_down);
    stands.set.hold_measured(&Nodes::enabled_at([0.3; JOINTS], [0.0; JOINTS]), 200.0, &config);
    assert_eq!(busy(&stands), [false; JOINTS]);
    let mut motion = holding([true; JOINTS]);
    motion.set.catch.iter_mut().for_each(Catch::calm_down);
    motion.set.hold_measured(&Nodes::enabled_at([0.3; JOINTS], [0.3; JOINTS]), 200.0, &config);
    assert_eq!(busy(&motion), [true; JOINTS]);
    motion.set.catch.iter_mut().for_each(Catch::calm_down);
    for ms in 0..=200 {
        motion.hold(&config);
        let rests = motion.set.led_to_rest(&config);
        assert_eq!((rests, busy(&motion)), (ms == 200, [ms == 200; JOINTS]), "{ms} ms");
    }
}

/// A joint that a hand has moved at 0.5 rad/s stops within 0.2 s. Its velocity is 0.5 · (1 - t/T)², so its acceleration is
/// -2 · 0.5 · (1 - t/T) / 0.2 s: -5 rad/s² at the start and -2.5 rad/s² after 0.1 s. The deceleration of a joint that falls while it is
/// enabled does not affect its torque.
#[test]
fn j25_j40_only_a_joint_that_a_hand_has_moved_has_a_commanded_acceleration() {
    let config = Config::avena();
    let mut motion = holding([true; JOINTS]);
    motion.set.hold_measured(&Nodes::enabled_at([0.3; JOINTS], [0.5; JOINTS]), 200.0, &config);
    let mut falls = latched(false, true, 0.5);
    for ms in 0..=100 {
        motion.hold(&config);
        falls.hold(&config);
        let expected = -5.0 * (1.0 - f64::from(ms) / 200.0);
        for acceleration in motion.set.point.acceleration {
            assert!((acceleration - expected).abs() < 1e-9, "{ms} ms: {acceleration}");
        }
        assert_eq!(falls.set.point.acceleration, [0.0; JOINTS], "{ms} ms");
    }
    assert!(falls.set.point.velocity[3] > 0.02 && falls.set.point.velocity[3] < 0.5);
}

#[test]
fn j25_while_a_hand_moves_the_arm_its_set_position_is_its_measured_position() {
    let (config, mut motion) = (Config::avena(), Motion::default());
    motion.set.begin_at(&[0.1; JOINTS]);
    (motion.set.point.velocity, motion.set.point.acceleration) = ([0.5; JOINTS], [2.0; JOINTS]);
    motion.set.follow_measured(&Nodes::enabled_at([0.3; JOINTS], [0.2; JOINTS]));
    assert_eq!(motion.set.point, SetPoint::still([0.3; JOINTS]));
    assert_eq!(motion.set.due(&config), &[0.3; JOINTS]);
}

#[test]
fn j34_j58_an_arm_that_is_jogged_or_decelerates_is_not_at_rest() {
    let (config, mut motion) = (Config::avena(), Motion::default());
    motion.set.hold_for_test();
    assert!(motion.set.all_holding() && !motion.set.coming_to_rest());
    motion.set.jog(&[0.1; JOINTS], &[1.0; JOINTS], &config);
    assert!(motion.set.jogging() && !motion.set.all_holding() && motion.set.coming_to_rest());
    motion.set.drop_jog();
    assert!(!motion.set.jogging() && motion.set.all_holding() && !motion.set.coming_to_rest());
    motion.set.deceleration[4] = Some(Deceleration::led(0.0, 0.3, 200.0, &config.joints[4]));
    assert!(!motion.set.all_holding() && motion.set.coming_to_rest());
}

/// State of the path's clock before the tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Clock {
    Goes,
    Halts,
    SlowsDown,
}

/// Joint 1 moves at 1 rad/s with an inertia of 2 kg·m². A torque of 84 N·m exceeds its limit of 80 N·m by 4 N·m, so the path must slow down
/// at 2 1/s. The slope changes by a tenth of the difference in each tick: -0.2 1/s in the first tick. On a ramp of 200 ms, the slope changes
/// by 4.5 / (0.2 s)² in one second, which is 0.1125 1/s in a tick. A path that stops, or that is faster than its target, follows the ramp.
#[test]
fn j33_j75_a_path_is_held_back_unless_it_slows_down_anyway() {
    for (active, change, torque, slope) in [
        (false, Clock::Goes, 84.0, 0.0),
        (true, Clock::Goes, 84.0, -0.2),
        (true, Clock::Goes, 0.0, 0.0),
        (true, Clock::Halts, 0.0, -0.1125),
        (true, Clock::SlowsDown, 0.0, -0.1125),
        (false, Clock::SlowsDown, 0.0, -0.1125),
    ] {
        let (mut config, mut motion) = (Config::avena(), Motion::default());
        let dynamics = dynamics(&config);
        let nodes = Nodes::enabled_at([0.3; JOINTS], [0.0; JOINTS]);
        config.joints[0].rotor_inertia = 2.0 - dynamics.mass_matrix(&[0.3; JOINTS])[0][0];
        motion.ramp.begin(&nodes, &config, &dynamics);
        motion.law.torque[0].model = torque;
        if active {
            motion.hold_back.begin();
        }
        let mut clock = PathClock::start(1.0);
        match change {
            Clock::Goes => {}
            Clock::Halts => clock.halt(),
            Clock::SlowsDown => assert!(clock.set_pace(0.5)),
        }
        let mut at = SetPoint::still([0.3; JOINTS]);
        at.velocity[0] = 1.0;
        motion.follow(&at, &mut clock, &config);
        assert!((clock.slope - slope).abs() < 1e-9, "{active} {change:?} {torque}: {clock:?}");
        assert!((motion.set.point.velocity[0] - (1.0 + slope * DT)).abs() < 1e-9, "{active} {change:?}");
    }
}
