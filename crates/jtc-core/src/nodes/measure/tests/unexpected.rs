//! Tests of answers that are far from their prediction, and of the first answer of a joint (J-35, J-63).
use super::*;

/// Settings with a permitted difference of 2e-5 rad between the encoders of a joint at rest.
fn config() -> Config {
    Config { encoder_step: 0.0, ..Config::avena() }
}

/// Returns a joint that has answered position 0 for 30 ms. The newest answer is of the time `clock_ms`.
fn at_rest() -> Measurement {
    let mut joint = Measurement::default();
    (0..30).for_each(|_| assert!(step(&mut joint, &tick(Some(0.0), 0.0))));
    joint
}

/// Returns the position that is used for an answer at `position` (rad), and the outcome. `off` is the prediction
/// minus the answer, and `reach` is the implausible distance, both in rad. The answer arrives `after_ms` after the
/// last answer.
fn used(
    joint: &mut Measurement,
    position: f64,
    off: f64,
    reach: f64,
    after_ms: u32,
    config: &Config,
) -> (Option<f64>, Outcome) {
    let answer = Reading { position, velocity: 0.0 };
    let at_ms = joint.clock_ms + after_ms;
    let unexpected = Unexpected { answer, off, reach, at_ms, looked_at: true, joint: 0 };
    let (answer, outcome) = joint.unexpected(unexpected, config);
    (answer.map(|answer| answer.position), outcome)
}

/// The positions of a drive wrap around at half a turn. After the jump of an encoder is subtracted, a position can
/// therefore be a whole turn away from its prediction. The controller must correct this.
#[test]
fn j35_a_position_without_its_jump_may_have_wrapped_around() {
    for (jump, off, reach, turn, outcome) in [
        // Without a jump, the answer is not usable: 6 rad is more than 1 rad.
        (0.0, 6.0, 1.0, None, Outcome::Predicted),
        (0.0, -6.0, 1.0, None, Outcome::Predicted),
        // The remaining difference is 2π − 6 rad = 0.28 rad.
        (0.5, 6.0, 1.0, Some(TAU), Outcome::Used),
        (0.5, -6.0, 1.0, Some(-TAU), Outcome::Used),
        // A difference of at most half a turn (π) is not a wrap-around.
        (0.5, 0.5, 1.0, Some(0.0), Outcome::Used),
        (0.5, -0.5, 1.0, Some(0.0), Outcome::Used),
        (0.5, PI, 4.0, Some(0.0), Outcome::Used),
        (0.5, -PI, 4.0, Some(0.0), Outcome::Used),
        (0.5, 3.0, 1.0, None, Outcome::Predicted),
    ] {
        let mut joint = Measurement::default();
        if jump != 0.0 {
            joint.jumps.take_off(jump);
        }
        let answer = Reading { position: 0.25, velocity: 0.125 };
        let unexpected = Unexpected { answer, off, reach, at_ms: 0, looked_at: false, joint: 0 };
        let (usable, found) = joint.unexpected(unexpected, &config());
        assert_eq!(found, outcome, "{jump} {off}");
        let position = turn.map(|turn| 0.25 + turn);
        assert_eq!(usable.map(|usable| usable.position), position, "{jump} {off}");
        assert!(usable.is_none_or(|usable| usable.velocity == 0.125));
    }
}

/// An answer at a tenth of the implausible distance is not checked for a jump. An answer at a larger distance is checked.
#[test]
fn j35_an_answer_within_a_tenth_of_the_implausible_distance_is_a_motion() {
    let (reach, config) = (0.25, config());
    let tenth = UNEXPECTED * reach;
    for sign in [1.0, -1.0] {
        let at = |distance: f64| used(&mut at_rest(), sign * distance, -sign * distance, reach, 1, &config);
        assert_eq!(at(tenth), (Some(sign * tenth), Outcome::Used));
        // The controller treats this answer as a possible jump, and uses the position without the jump.
        assert_eq!(at(0.03125), (Some(0.0), Outcome::Used));
    }
}

/// The gear of a joint twists by 8 N·m / 4 000 N·m/rad = 2 mrad at its torque limit. If the size of a possible jump changes to a size within
/// this twist, the answer shows a motion.
#[test]
fn j35_the_twist_of_the_gear_is_its_torque_limit_over_its_stiffness() {
    let mut config = Config { gear_stiffness: 4_000.0, ..config() };
    config.joints[0].torque_max = 8.0;
    for (second, position) in [(0.0015, 0.0015), (0.0019, 0.0019), (0.0021, 0.0), (0.003, 0.0)] {
        let mut joint = at_rest();
        for (n, size, position) in [(1, 0.006, 0.0), (2, second, position)] {
            let (found, outcome) = used(&mut joint, size, -size, 0.01, n, &config);
            assert_eq!(outcome, Outcome::Used);
            assert!((found.expect("usable") - position).abs() < 1e-8, "{second}: {found:?}");
        }
    }
}

/// After the jump is subtracted, the distance of the position from the prediction must be at most half of the
/// implausible distance.
#[test]
fn j35_a_jump_must_leave_an_answer_near_its_prediction() {
    // The answer shows a jump by 0.25 rad, so it is at 0 rad without the jump. The implausible distance is 0.5 rad.
    for (off, position, outcome) in [
        (-0.25, Some(0.0), Outcome::Used),
        // Without the jump, the position is 0.25 rad from the prediction, which is still near enough.
        (-0.5, Some(0.0), Outcome::Used),
        // Without the jump, the position is 0.5 rad from the prediction, which is too far. The answer itself is 0.75
        // rad away, so it is not usable.
        (-0.75, None, Outcome::Predicted),
        // Without the jump, the position is 0.375 rad from the prediction, which is too far. The answer itself is
        // only 0.125 rad away, so it is used as it is.
        (0.125, Some(0.25), Outcome::Used),
    ] {
        assert_eq!(used(&mut at_rest(), 0.25, off, 0.5, 1, &config()), (position, outcome), "{off}");
    }
}

/// The fifth answer confirms a jump, but only if it is near its prediction without the jump.
#[test]
fn j35_a_jump_is_subtracted_if_its_fifth_answer_is_near_the_prediction() {
    for (off, position, outcome, taken_off) in [
        (-0.25, Some(0.0), Outcome::Jumped, 0.25),
        (-0.5, Some(0.0), Outcome::Jumped, 0.25),
        (-0.75, None, Outcome::Predicted, 0.0),
    ] {
        let mut joint = at_rest();
        for n in 1..=4 {
            assert_eq!(used(&mut joint, 0.25, -0.25, 0.5, n, &config()), (Some(0.0), Outcome::Used));
        }
        assert_eq!(used(&mut joint, 0.25, off, 0.5, 5, &config()), (position, outcome), "{off}");
        assert_eq!(joint.taken_off(), taken_off, "{off}");
        assert_eq!(joint.misfit().is_some(), outcome == Outcome::Jumped, "{off}");
    }
}

/// The first answer after a restart of the measurement does not show the rate of the joint. The jump of its encoder is still subtracted.
#[test]
fn j35_the_first_answer_has_no_rate_and_keeps_the_jump() {
    let mut joint = Measurement::default();
    (0..20).for_each(|_| _ = step(&mut joint, &tick(None, 0.0)));
    joint.jumps.take_off(0.5);
    assert!(step(&mut joint, &tick(Some(1.0), 0.0)));
    assert_eq!((joint.used().position, joint.speed(), joint.taken_off()), (1.0, 0.0, 0.5));
    joint.forget();
    assert!(step(&mut joint, &tick(Some(-1.0), 0.0)));
    assert_eq!((joint.used().position, joint.speed(), joint.taken_off()), (-1.0, 0.0, 0.5));
}

/// The controller uses the first answer directly, even if it is the second answer of its tick. Without an earlier
/// position, the used position cannot have a step.
#[test]
fn j63_the_first_answer_is_not_bridged() {
    let mut joint = Measurement::default();
    let burst = Tick { answers: 2, ..tick(Some(1.0), 0.0) };
    assert!(step(&mut joint, &burst));
    assert_eq!(joint.used().position, 1.0);
}

/// If an answer on time follows a missing answer, the used position has no step, even if the answer is close to its
/// prediction.
#[test]
fn j63_a_returned_answer_on_time_makes_no_step() {
    let mut joint = at_rest();
    step(&mut joint, &tick(None, 0.0));
    // The answer is 100 µrad from its prediction. Two encoder steps are 192 µrad.
    assert!(step(&mut joint, &tick(Some(1e-4), 0.0)));
    assert!(joint.used().position.abs() < 1e-9, "{:?}", joint.used());
}

/// Returns a joint at rest at position 0 with evidence of late answers. An answer is outstanding, so the next answer is one tick late.
fn one_outstanding() -> Measurement {
    let mut joint = at_rest();
    assert!(step(&mut joint, &Tick { answers: 2, ..tick(Some(0.0), 0.0) }));
    step(&mut joint, &tick(None, 0.0));
    assert_eq!(joint.used(), Reading::default());
    joint
}

/// Returns a function with the motion that was commanded since a late answer was due: the velocity at that time
/// (rad/s), and the distance since then (rad).
fn past(commanded: f64, commanded_way: f64) -> impl Fn(u8) -> Late {
    move |ticks| match ticks {
        0 => Late { ms: 0, commanded: 0.0, commanded_way: 0.0 },
        ticks => Late { ms: ticks.into(), commanded, commanded_way },
    }
}

/// A late answer that is two encoder steps from its prediction is used directly, for the time at which it was due.
#[test]
fn j63_a_late_answer_two_steps_from_its_prediction_is_in_its_place() {
    // Two steps of 2⁻¹⁴ rad are 2⁻¹³ rad.
    let (step, two) = (1.0 / 16_384.0, 1.0 / 8_192.0);
    let config = Config { encoder_step: step, ..Config::avena() };
    for way in [two, -two] {
        let mut joint = one_outstanding();
        assert_eq!(joint.step(&tick(Some(0.0), 0.0), past(0.0, way), &config), Outcome::Used);
        assert_eq!(joint.used().position, way);
    }
    // If this answer were late, it would be three steps from its prediction. As an answer on time, it is exactly at
    // its prediction. The controller therefore assumes that the outstanding answer was lost.
    let mut joint = one_outstanding();
    assert_eq!(joint.step(&tick(Some(0.0), 0.0), past(0.0, 1.5 * two), &config), Outcome::Used);
    assert_eq!(joint.used().position, 0.0);
}

/// Without a known position, the controller uses the counted lateness of an answer.
#[test]
fn j63_the_first_late_answer_has_the_counted_lateness() {
    let mut joint = one_outstanding();
    joint.forget();
    let late = tick(Some(0.0), 0.0);
    assert_eq!(joint.step(&late, past(0.0, 0.5), &Config::avena()), Outcome::Used);
    assert_eq!(joint.used().position, 0.5);
}

/// A late answer far from its prediction must not cause a step of the velocity. The used velocity contains the change
/// of the commanded velocity since the answer was due.
#[test]
fn j63_a_late_velocity_makes_no_step() {
    let mut joint = one_outstanding();
    let late = Tick {
        answer: Some(Reading { position: 7e-4, velocity: 0.125 }),
        commanded: 0.25,
        ..tick(None, 0.0)
    };
    // The prediction is at 0.25 mrad. The late answer is at 0.7 mrad. Extrapolated to this tick, it is at 0.575 mrad,
    // because the joint is slower than its command by 0.125 rad/s.
    assert_eq!(joint.step(&late, past(0.125, 0.0), &Config::avena()), Outcome::Used);
    assert!((joint.used().velocity - 0.25).abs() < 1e-12, "{:?}", joint.used());
    assert!((joint.used().position - 0.25 * DT).abs() < 1e-9, "{:?}", joint.used());
}
