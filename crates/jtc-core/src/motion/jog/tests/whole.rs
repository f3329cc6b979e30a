//! Tests of the jog of all joints: the acceleration limits of a command, the end of a jog, and the set values (J-33, J-58).
use super::*;

/// Returns limits that allow a jogged joint at most 2 rad/s² and 20 rad/s³. The first joint has this position range, rad.
fn ranged((low, high): (f64, f64)) -> Config {
    let mut config = config();
    for joint in &mut config.joints {
        (joint.velocity_max, joint.acceleration_max) = (2.0, 10.0);
        (joint.position_min, joint.position_max) = (-2.5, 2.5);
    }
    (config.joints[0].position_min, config.joints[0].position_max) = (low, high);
    config
}

/// Returns a jog in which the first joint has this state.
fn jog_of(joint: JointJog) -> Jog {
    let mut jog = Jog::begin();
    jog.joints[0] = joint;
    jog
}

/// Returns the first joint after a command with 0.5 rad/s and the highest acceleration `most` (rad/s²). Before the
/// command, the joint had the velocity `velocity` (rad/s) and a highest acceleration of 2 rad/s².
fn commanded(velocity: f64, most: f64, position: f64, range: (f64, f64)) -> JointJog {
    let mut jog = jog_of(JointJog { wanted: velocity, most: 2.0, velocity, acceleration: 0.0 });
    let mut wanted = [0.0; JOINTS];
    wanted[0] = 0.5;
    let mut at = [0.0; JOINTS];
    at[0] = position;
    jog.command(&wanted, &[most; JOINTS], &at, &ranged(range));
    jog.joints[0]
}

/// A joint at 1 rad/s stops with 1 rad/s² in 1 / 1 + 1 / 20 = 1.05 s, after 0.525 rad. With the margins, it needs
/// 1.01 · 0.525 + 0.004 + 0.000001 = 0.534251 rad. The lower acceleration limit of a command is used only if this
/// distance remains.
#[test]
fn j58_a_command_lowers_the_acceleration_only_if_the_joint_can_still_stop_within_its_range() {
    let cases = [
        // Columns: velocity, highest acceleration of the command, position, range, expected highest acceleration.
        (1.0, 1.0, 0.0, (-0.5, 0.6), 1.0),
        (1.0, 1.0, 0.0, (-0.5, 0.5), 2.0),
        (-1.0, 1.0, 0.0, (-0.6, 0.5), 1.0),
        (-1.0, 1.0, 0.0, (-0.5, 0.5), 2.0),
        (1.0, 1.0, 0.5, (-0.5, 1.1), 1.0),
        (1.0, 1.0, 0.5, (-0.5, 1.0), 2.0),
        (-1.0, 1.0, -0.5, (-1.1, 0.5), 1.0),
        (-1.0, 1.0, -0.5, (-1.0, 0.5), 2.0),
        // A higher acceleration limit is always used, even if the joint cannot stop within its range.
        (1.0, 3.0, 0.0, (-0.5, 0.1), 3.0),
        (-1.0, 3.0, 0.0, (-0.1, 0.5), 3.0),
    ];
    for (velocity, most, position, range, valid) in cases {
        let joint = commanded(velocity, most, position, range);
        let about = std::format!("{velocity} {most} at {position} in {range:?}");
        assert_eq!((joint.wanted, joint.most, joint.velocity), (0.5, valid, velocity), "{about}");
    }
}

#[test]
fn j58_a_command_may_let_a_joint_stop_exactly_at_the_end_of_its_range() {
    let needed = JointJog { velocity: 1.0, most: 1.0, ..JointJog::default() }.stopping_way(20.0);
    for (room, valid) in [(needed, 1.0), (0.9999 * needed, 2.0)] {
        assert_eq!(commanded(1.0, 1.0, 0.0, (-0.5, room)).most, valid);
        assert_eq!(commanded(-1.0, 1.0, 0.0, (-room, 0.5)).most, valid);
    }
}

/// The controller executes the first tick of a jog in the tick in which it receives the Jog. Therefore the 201st tick is 200 ms later.
#[test]
fn j58_a_jog_ends_200_ms_after_the_last_jog_and_ends_once() {
    let (config, mut jog) = (config(), Jog::begin());
    for repeats in 0..2 {
        command(&mut jog, &[0.1; JOINTS], &[0.0; JOINTS], &config);
        for ms in 0..200 {
            assert!(!jog.ends() && jog.goes_on() && !jog.rests(), "{ms} ms after Jog {repeats}");
        }
    }
    assert!(jog.ends() && !jog.goes_on());
    for _ in 0..300 {
        assert!(!jog.ends() && !jog.goes_on());
    }
}

#[test]
fn j58_a_stop_ends_a_jog_in_the_next_tick_and_ends_it_once() {
    let mut jog = Jog::begin();
    command(&mut jog, &[0.1; JOINTS], &[0.0; JOINTS], &config());
    assert!(!jog.ends() && jog.goes_on());
    jog.end();
    assert!(jog.goes_on());
    assert!(jog.ends() && !jog.goes_on());
    assert!(!jog.ends() && !jog.goes_on());
}

#[test]
fn j58_a_jog_is_at_rest_if_no_joint_moves_or_its_clock_stands_and_no_velocity_is_commanded() {
    let (goes, stands) = (PathClock::start(1.0), PathClock::default());
    let cases = [
        // Columns: clock, commanded velocity, velocity, acceleration, expected result.
        (goes, 0.0, 0.0, 0.0, true),
        (goes, 0.0, 0.5, 0.0, false),
        (goes, 0.0, 0.0, 0.5, false),
        (goes, 0.0, -0.5, 0.5, false),
        (goes, 0.5, 0.0, 0.0, false),
        (goes, 0.5, 0.5, 0.0, false),
        (stands, 0.0, 0.0, 0.0, true),
        (stands, 0.0, 0.5, 0.5, true),
        (stands, -0.5, 0.0, 0.0, false),
        (stands, -0.5, 0.5, 0.5, false),
    ];
    for (clock, wanted, velocity, acceleration, rests) in cases {
        for joint in 0..JOINTS {
            let mut jog = Jog { clock, ..Jog::begin() };
            jog.joints[joint] = JointJog { wanted, most: 2.0, velocity, acceleration };
            assert_eq!(jog.rests(), rests, "{:?} of joint {}", jog.joints[joint], joint + 1);
        }
    }
}

/// In this tick the rate of the clock changes from 1 to 0.5, so the tick lasts 0.5 · (1 + 0.5) · 1 ms = 0.75 ms of the jog's clock. The
/// joint accelerates from 0.5 rad/s with 2 rad/s² to 0.5 + 2 · 0.00075 = 0.5015 rad/s. If q is the position, r the rate and s the slope of
/// the clock, the velocity of the set values is q' · r, and their acceleration is q'' · r² + q' · s.
#[test]
fn j33_j58_the_set_values_follow_the_rate_and_the_slope_of_the_clock() {
    for sign in [1.0, -1.0] {
        let joint =
            JointJog { wanted: sign * 1.5, most: 2.0, velocity: sign * 0.5, acceleration: sign * 2.0 };
        let (mut jog, mut point) = (jog_of(joint), SetPoint::still([0.0; JOINTS]));
        jog.step(&mut point, &ranged((-2.5, 2.5)), |at, clock| {
            // The function that advances the clock receives the state at the start of the tick.
            assert_eq!((at.velocity[0], at.acceleration[0]), (sign * 0.5, sign * 2.0));
            (clock.rate, clock.slope) = (0.5, -2.0);
        });
        let near = |value: f64, expected: f64| (sign * value - expected).abs() < 1e-12;
        // 0.5 · (0.5 + 0.5015) · 0.00075 = 0.0003755625 rad.
        assert!(near(point.position[0], 0.0003755625), "{}", point.position[0]);
        // 0.5015 · 0.5 = 0.25075 rad/s.
        assert!(near(point.velocity[0], 0.25075), "{}", point.velocity[0]);
        // 2 · 0.5² - 0.5015 · 2 = 0.5 - 1.003 = -0.503 rad/s².
        assert!(near(point.acceleration[0], -0.503), "{}", point.acceleration[0]);
        assert_eq!((point.velocity[1], point.acceleration[1]), (0.0, 0.0));
    }
}
