//! Tests of the detection of encoder jumps (J-35).
use super::*;

/// Largest twist of the gear in these tests, rad.
const TWIST: f64 = 1.5;
/// Permitted difference at rest, rad: three encoder steps of 0.125 rad.
const TOLERANCE: f64 = 0.375;

fn config() -> Config {
    Config { encoder_step: 0.125, velocity_full_scale: 4.0, drive_speed_window_ms: 10, ..Config::avena() }
}

/// Joint with its stored answers and the state of the detection.
struct Joint {
    jumps: Jumps,
    history: History,
    ms: u32,
    config: Config,
}

impl Joint {
    /// Returns a joint whose answered positions have changed by `per_ms` (rad) per millisecond for 20 ms. The last
    /// answer is at 100 ms. The reported speed is zero.
    fn drifting(per_ms: f64) -> Self {
        let position = |ms: u32| per_ms * f64::from(ms);
        let mut history = History::of(&Answered { position: position(80), at_ms: 80 });
        for ms in 81..=100 {
            history.take(&Answered { position: position(ms), at_ms: ms }, true);
        }
        Self { jumps: Jumps::default(), history, ms: 100, config: config() }
    }

    fn at_rest() -> Self {
        Self::drifting(0.0)
    }

    /// Evaluates an answer at this time, but does not add the answer to the history.
    fn look_at(&mut self, position: f64, at_ms: u32) -> Seen {
        let answer = Reading { position, velocity: 0.0 };
        self.jumps.look(&answer, 0.0, at_ms, TWIST, &self.history, &self.config)
    }

    /// Evaluates the answer of the next millisecond, and adds it to the history. If the answer shows a jump or a
    /// possible jump, the history gets the position without this jump.
    fn see(&mut self, position: f64) -> Seen {
        self.ms += 1;
        let seen = self.look_at(position, self.ms);
        let way = match seen {
            Seen::Motion => 0.0,
            Seen::Perhaps(way) | Seen::Jump(way) => way,
        };
        self.history.take(&Answered { position: position - way, at_ms: self.ms }, true);
        seen
    }
}

/// The permitted difference is 3 encoder steps, at least 2e-5 rad, plus a tenth of the reported distance.
#[test]
fn j35_the_permitted_difference_is_three_steps_and_a_tenth_of_the_distance() {
    for (encoder_step, reported, tolerance) in [
        (0.25, 0.0, 0.75),
        // 0.75 rad + 0.1 · 10 rad.
        (0.25, 10.0, 1.75),
        (0.25, -10.0, 1.75),
        (0.0, 0.0, 2e-5),
        (1e-6, 0.0, 2e-5),
    ] {
        let config = Config { encoder_step, ..Config::avena() };
        let found = Ways { measured: 0.0, reported }.tolerance(&config);
        assert!((found - tolerance).abs() < 1e-12, "{encoder_step} {reported}: {found}");
    }
}

/// The controller does not use a speed above 98 % of its full scale, in either direction.
#[test]
fn j35_a_speed_above_98_percent_of_its_full_scale_is_not_compared() {
    // 98 % of 4 rad/s is 3.92 rad/s. The factor 4 is a power of two, so the product is exact.
    for (velocity, compared) in
        [(0.0, true), (3.92, true), (-3.92, true), (3.93, false), (-3.93, false), (4.0, false)]
    {
        let answer = Reading { position: 2.0, velocity };
        let ways = Ways::of(&answer, 0.5, &config());
        assert_eq!(ways.is_some(), compared, "{velocity} rad/s");
        if let Some(ways) = ways {
            // The window is 10 ms.
            assert!((ways.reported - 0.01 * velocity).abs() < 1e-12 && ways.measured == 1.5);
        }
    }
}

/// The size of a jump must exceed twice the permitted difference.
#[test]
fn j35_a_difference_up_to_twice_the_permitted_difference_is_not_a_jump() {
    for sign in [1.0, -1.0] {
        assert_eq!(Joint::at_rest().see(sign * 0.5), Seen::Motion);
        assert_eq!(Joint::at_rest().see(sign * 2.0 * TOLERANCE), Seen::Motion);
        assert_eq!(Joint::at_rest().see(sign * 0.8125), Seen::Perhaps(sign * 0.8125));
    }
}

/// A difference that stays for five answers is a jump. The controller treats the first four answers as a possible jump.
#[test]
fn j35_a_difference_that_stays_for_five_answers_is_a_jump() {
    let mut joint = Joint::at_rest();
    assert!(!joint.jumps.watching());
    for _ in 0..4 {
        assert_eq!(joint.see(1.0), Seen::Perhaps(1.0));
        assert!(joint.jumps.watching());
    }
    assert_eq!(joint.see(1.0), Seen::Jump(1.0));
    assert!(!joint.jumps.watching());
}

/// An answer close to its prediction ends a possible jump. A later difference must again stay for five answers.
#[test]
fn j35_an_expected_answer_ends_a_possible_jump() {
    let mut joint = Joint::at_rest();
    (0..4).for_each(|_| assert_eq!(joint.see(1.0), Seen::Perhaps(1.0)));
    joint.jumps.as_expected();
    assert!(!joint.jumps.watching());
    (0..4).for_each(|_| assert_eq!(joint.see(1.0), Seen::Perhaps(1.0)));
    assert_eq!(joint.see(1.0), Seen::Jump(1.0));
}

/// If the size of a possible jump changes by at most the permitted difference, the count of answers continues. After
/// a larger change, the controller counts five answers again.
#[test]
fn j35_a_changed_size_counts_from_the_first_answer_with_this_size() {
    let mut joint = Joint::at_rest();
    assert_eq!(joint.see(2.0), Seen::Perhaps(2.0));
    assert_eq!(joint.see(2.0 + TOLERANCE), Seen::Perhaps(2.0));
    assert_eq!(joint.see(2.0 - TOLERANCE), Seen::Perhaps(2.0));
    (0..4).for_each(|_| assert_eq!(joint.see(2.5), Seen::Perhaps(2.5)));
    assert_eq!(joint.see(2.5), Seen::Jump(2.5));
}

/// The size of a possible jump can change twice. After a third change, the answer counts as a motion, even if the
/// size exceeds the twist of the gear.
#[test]
fn j35_the_size_of_a_possible_jump_may_change_twice() {
    for sign in [1.0, -1.0] {
        let mut joint = Joint::at_rest();
        for size in [2.0, 3.0, 4.0] {
            assert_eq!(joint.see(sign * size), Seen::Perhaps(sign * size));
        }
        assert_eq!(joint.see(sign * 5.0), Seen::Motion);
        assert!(!joint.jumps.watching());
    }
}

/// If the size of a possible jump changes, the new size must exceed the twist of the gear. Otherwise the answer
/// counts as a motion. The first size can be less than the twist.
#[test]
fn j35_a_changed_size_within_the_twist_of_the_gear_is_a_motion() {
    for (first, second, seen) in [
        (1.0, 1.0, Seen::Perhaps(1.0)),
        (1.0, TWIST, Seen::Motion),
        (2.0, TWIST, Seen::Motion),
        (2.0, 1.25, Seen::Motion),
        (2.0, 1.5625, Seen::Perhaps(1.5625)),
        (-2.0, -1.25, Seen::Motion),
        (-2.0, -1.5625, Seen::Perhaps(-1.5625)),
    ] {
        let mut joint = Joint::at_rest();
        assert_eq!(joint.see(first), Seen::Perhaps(first));
        assert_eq!(joint.see(second), seen, "{first} {second}");
    }
}

/// A difference of the encoders that existed before the jump is not counted as a part of the jump.
#[test]
fn j35_a_difference_before_the_jump_is_not_a_part_of_it() {
    // The positions change by 10 · 0.25 rad in the window, but the reported speed is zero. The encoders therefore
    // already differ before the jump.
    let mut joint = Joint::drifting(0.25);
    assert_eq!(joint.see(0.25 * 101.0 + 4.0), Seen::Perhaps(4.0));
    assert_eq!(joint.see(0.25 * 102.0 + 4.0), Seen::Perhaps(4.0));
    let mut joint = Joint::drifting(0.25);
    assert_eq!(joint.see(0.25 * 101.0 - 4.0), Seen::Perhaps(-4.0));
}

/// A jump is detected only if the previous answer is at most 3 ms older than the present answer.
#[test]
fn j35_a_jump_appears_between_two_answers_within_three_milliseconds() {
    for (after_ms, seen) in [
        (1, Seen::Perhaps(1.0)),
        (2, Seen::Perhaps(1.0)),
        (3, Seen::Perhaps(1.0)),
        (4, Seen::Motion),
        (5, Seen::Motion),
    ] {
        assert_eq!(Joint::at_rest().look_at(1.0, 100 + after_ms), seen, "{after_ms} ms");
    }
}

/// While the answers at the start of the window are missing, a possible jump can stay undecided for at most 15
/// answers. If no possible jump has begun before, such an answer counts as a motion.
#[test]
fn j35_a_possible_jump_stays_undecided_for_fifteen_answers() {
    let mut joint = Joint::at_rest();
    joint.history = History::of(&Answered { position: 0.0, at_ms: 90 });
    for at_ms in [91, 100] {
        joint.history.take(&Answered { position: 0.0, at_ms }, true);
    }
    // The window of the answer at 102 ms starts at 92 ms, and the history has no answer of this time.
    assert_eq!(joint.look_at(1.0, 102), Seen::Motion);
    assert!(!joint.jumps.watching());
    assert_eq!(joint.look_at(1.0, 101), Seen::Perhaps(1.0));
    for at_ms in (102..110).chain(111..117) {
        assert_eq!(joint.look_at(7.0, at_ms), Seen::Perhaps(1.0), "{at_ms} ms");
        assert!(joint.jumps.watching());
    }
    // This is the 16th answer, which ends the possible jump.
    assert_eq!(joint.look_at(7.0, 117), Seen::Motion);
    assert!(!joint.jumps.watching());
}

/// With a window of 0, the controller does not compare the encoders.
#[test]
fn j35_without_a_window_no_jump_is_seen() {
    let mut joint = Joint::at_rest();
    joint.config.drive_speed_window_ms = 0;
    for at_ms in [100, 101] {
        assert_eq!(joint.look_at(1.0, at_ms), Seen::Motion);
        assert!(!joint.jumps.watching());
    }
}
