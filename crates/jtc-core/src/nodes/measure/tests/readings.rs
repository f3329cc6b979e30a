//! Tests of late answers, of the more recent velocity, and of the two distances of a joint (J-35, J-63, J-68).
use super::*;
use crate::interpolation::SetPoint;

/// The controller must find the command of the tick in which a late answer was due. The test commands joint 2 to k²
/// rad and 3·k rad/s in tick k, so the distance between any two ticks is different. The present tick is tick 9.
#[test]
fn j63_a_late_answer_belongs_to_the_commands_of_the_tick_in_which_it_was_due() {
    let mut commanded = Commanded::default();
    for k in 0..10 {
        commanded.next_tick();
        let (mut position, mut velocity) = ([7.0; JOINTS], [8.0; JOINTS]);
        (position[1], velocity[1]) = (f64::from(k * k), 3.0 * f64::from(k));
        commanded.put(&SetPoint { position, velocity, ..SetPoint::default() });
    }
    for (delay_ticks, ticks, ms, velocity, way) in [
        // With a delay of 2 ticks, an answer on time belongs to tick 7. An answer that is 3 ticks late belongs to
        // tick 4. The commanded distance since then is 7² − 4² = 33 rad.
        (2, 3, 3, 12.0, 33.0),
        (2, 0, 0, 21.0, 0.0),
        (2, 5, 5, 6.0, 45.0),
        // Only the commands of the last 7 ticks are stored. The answer counts as 5 ticks late and belongs to tick 2,
        // so the distance is 7² − 2² = 45 rad.
        (2, 7, 5, 6.0, 45.0),
        // Without a configured delay, an answer on time belongs to the last tick, tick 8. This answer belongs to tick
        // 6, so the distance is 8² − 6² = 28 rad.
        (0, 2, 2, 18.0, 28.0),
        (1, 2, 2, 18.0, 28.0),
        (4, 1, 1, 12.0, 9.0),
    ] {
        let config = Config { delay_ticks, ..Config::avena() };
        let late = Late::new(ticks, 1, &commanded, &config);
        let found = (late.ms, late.commanded, late.commanded_way);
        assert_eq!(found, (ms, velocity, way), "delay {delay_ticks}, {ticks} ticks late");
    }
}

/// `young_velocity` returns the rate of the positions over the last 5 ms (`rate`), within bounds around the commanded
/// velocity (`due`). The difference of the result from `due` has the sign of the difference between the reported
/// velocity and `due`, and is at most 2.5 times as large. The reported velocity is `used` minus the fading `offset`.
#[test]
fn j66_the_velocity_from_positions_is_bounded_around_the_commanded_velocity() {
    for (rate, used, offset, due, young) in [
        // The difference 1 − 0.25 = 0.75 is limited to 2.5 · (0.75 − 0.25 − 0.25) = 0.625. The result is `due` plus
        // 0.625.
        (1.0, 0.75, 0.25, 0.25, 0.875),
        (-1.0, -0.75, -0.25, -0.25, -0.875),
        // The difference 0.5 − 0.25 = 0.25 is less than its limit, 2.5 · (1 − 0.25 − 0.25) = 1.25.
        (0.5, 1.0, 0.25, 0.25, 0.5),
        // The magnitude of the difference 0.5 − 0.75 = −0.25 is less than its limit, 2.5 · |0.5 − 0.75| = 0.625.
        (0.5, 0.5, 0.0, 0.75, 0.5),
        (-1.0, 0.5, 0.0, 0.75, 0.125),
        // The two differences have opposite signs, so the encoder has jumped. The result is the commanded velocity.
        (0.75, 0.0, 0.0, 0.25, 0.25),
        (0.0, 0.75, 0.0, 0.25, 0.25),
        (0.75, 0.25, 0.25, 0.25, 0.25),
        // The first or the second difference is zero, so the result is the commanded velocity.
        (0.75, 0.25, 0.0, 0.25, 0.25),
        (0.25, 0.75, 0.0, 0.25, 0.25),
    ] {
        let joint = Measurement {
            rate,
            used: Reading { position: 1.0, velocity: used },
            velocity_offset: Fading { left: offset, slope: 0.0 },
            ..Measurement::default()
        };
        assert_eq!(joint.young_velocity(due), young, "{rate} {used} {offset} {due}");
    }
}

/// A joint at 0.5 rad/s moves 5 mrad in a window of 10 ms. If the answer of this tick is missing, the window ends at
/// the last answer, because the distance must not contain a prediction. Without a window, or if two answers are
/// missing, the distances are not known.
#[test]
fn j35_the_distance_of_the_positions_contains_only_answers() {
    let velocity = 0.5;
    for (window_ms, missing, measured) in
        [(10, 0, Some(0.005)), (10, 1, Some(0.005)), (10, 2, None), (4, 0, Some(0.002)), (0, 0, None)]
    {
        let config = Config { drive_speed_window_ms: window_ms, ..Config::avena() };
        let mut joint = moving(velocity);
        for _ in 0..missing {
            step(&mut joint, &tick(None, velocity));
        }
        let ways = joint.ways(&config);
        assert_eq!(ways.is_some(), measured.is_some(), "{window_ms} ms, {missing} missing");
        if let (Some(ways), Some(measured)) = (ways, measured) {
            assert!((ways.measured - measured).abs() < ROUNDED, "{window_ms} ms: {ways:?}");
            let reported = velocity * f64::from(window_ms) * DT;
            assert!((ways.reported - reported).abs() < 1e-12, "{window_ms} ms: {ways:?}");
        }
    }
}

/// If the distance of an answer from its prediction is at most a tenth of the implausible distance, the controller
/// uses the answer unchanged. Such an answer shows neither a jump nor a wrap-around of the drive's positions, even
/// while an earlier jump is being subtracted. After 10 s without an answer, the implausible distance is 60 rad, and a
/// tenth of it is 6 rad.
#[test]
fn j35_an_answer_near_its_prediction_is_used_as_it_is() {
    let bound = UNEXPECTED * (IMPLAUSIBLE * DT * VELOCITY_MAX * 10_000.0);
    assert!((bound - 6.0).abs() < 1e-9, "{bound}");
    for position in [bound, -bound, 4.0, -4.0, 3.0] {
        let mut joint = moving(0.0);
        joint.jumps.take_off(0.25);
        let long = Tick { elapsed_ms: 10_000, ..tick(Some(position), 0.0) };
        assert!(step(&mut joint, &long));
        assert_eq!(joint.used().position, position);
    }
}

/// An answer cannot be older than the last answer, which arrived one tick ago. The second answer of this tick is only
/// a frame that the bus has repeated, so the answer belongs to this tick.
#[test]
fn j63_an_answer_is_never_older_than_the_last_answer() {
    let mut joint = moving(0.1);
    let twice = Tick { asked: false, answers: 2, ..tick(Some(0.1 * DT), 0.1) };
    assert!(step(&mut joint, &twice), "the answer is usable");
    assert_eq!(joint.answered_ms, joint.clock_ms);
    assert!((joint.used().position - 0.1 * DT).abs() < ROUNDED);
}

/// Before the first usable answer, nothing limits the lateness of an answer. The answer of this test was due one tick
/// ago, so the used position also contains the distance that was commanded since then.
#[test]
fn j63_the_first_answer_may_be_late() {
    let mut joint = Measurement::default();
    let twice = Tick { asked: false, answers: 2, ..tick(Some(0.25), 0.5) };
    assert!(step(&mut joint, &twice));
    assert_eq!(joint.answered_ms, joint.clock_ms - 1);
    assert!((joint.used().position - (0.25 + 0.5 * DT)).abs() < 1e-12);
}

/// When the prediction is discarded, the evidence of late answers remains valid.
#[test]
fn j63_the_evidence_of_late_answers_survives_a_discarded_prediction() {
    let mut joint = moving(0.0);
    step(&mut joint, &Tick { answers: 2, ..tick(Some(0.0), 0.0) });
    assert!(!joint.lateness.stands(1));
    joint.forget();
    assert!(step(&mut joint, &tick(Some(0.5), 0.0)));
    assert_eq!(joint.used().position, 0.5);
    assert!(!joint.lateness.stands(1));
}

/// A joint at rest answers at 4 mrad. The implausible distance is 6 mrad. An answer beyond a tenth of this distance
/// may show a jump of the encoder, and the controller then assumes that the joint has not moved. A late answer is not
/// checked for a jump, because its speed belongs to another window. The encoder of a joint without torque is not
/// checked either.
#[test]
fn j35_only_an_answer_on_time_of_an_enabled_joint_may_show_a_jump() {
    for (enabled, late, watched) in
        [(true, false, true), (true, true, false), (false, false, false), (false, true, false)]
    {
        let mut joint = moving(0.0);
        let at = |answers: u8, position: f64| Tick {
            answers,
            enabled,
            ..tick((answers > 0).then_some(position), 0.0)
        };
        // No answer arrives in the first tick, and two answers arrive in the second tick. This is the evidence of
        // late answers.
        step(&mut joint, &at(0, 0.0));
        step(&mut joint, &at(2, 0.0));
        if late {
            step(&mut joint, &at(0, 0.0));
        }
        assert!(step(&mut joint, &at(1, 0.004)), "{enabled} {late}");
        assert_eq!(joint.clock_ms - joint.answered_ms, u32::from(late));
        assert_eq!(joint.jumps.watching(), watched, "{enabled} {late}");
        let expected = if watched { 0.0 } else { 0.004 };
        assert!((joint.answer.position - expected).abs() < ROUNDED, "{enabled} {late}: {joint:?}");
    }
}
