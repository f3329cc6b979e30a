//! Tests of the measurement and of its prediction (J-35, J-63).
extern crate std;

use super::*;

mod late;
mod readings;
mod unexpected;

const VELOCITY_MAX: f64 = 2.0;
/// Tolerance for the rounding error of a prediction (rad) or of a rate (rad/s). The error occurs because the history
/// has single precision.
const ROUNDED: f64 = 1e-6;

fn tick(answer: Option<f64>, velocity: f64) -> Tick {
    let answer = answer.map(|position| Reading { position, velocity });
    Tick {
        answer,
        expected: true,
        asked: true,
        answers: u8::from(answer.is_some()),
        commanded: velocity,
        elapsed_ms: 1,
        velocity_max: VELOCITY_MAX,
        enabled: false,
        joint: 0,
    }
}

/// Executes a step with an unchanged commanded velocity.
fn step(joint: &mut Measurement, tick: &Tick) -> bool {
    let past = |ticks: u8| Late {
        ms: ticks.into(),
        commanded: tick.commanded,
        commanded_way: tick.commanded * f64::from(ticks) * DT,
    };
    joint.step(tick, past, &Config::avena()) == Outcome::Used
}

/// Returns the measurement of a joint that has moved at this velocity for some time and is now at position 0.
fn moving(velocity: f64) -> Measurement {
    let mut joint = Measurement::default();
    for k in -20..=0 {
        assert!(step(&mut joint, &tick(Some(velocity * f64::from(k) * DT), velocity)));
    }
    joint
}

#[test]
fn j63_a_missing_answer_is_predicted_from_the_motion() {
    for velocity in [0.0, 0.4, -1.5] {
        let mut joint = moving(velocity);
        for k in 1..=4 {
            assert!(!step(&mut joint, &tick(None, velocity)));
            assert!((joint.used().position - velocity * f64::from(k) * DT).abs() < ROUNDED);
            assert_eq!(joint.used().velocity, velocity);
        }
    }
    // The predicted rate follows a change of the commanded velocity.
    let mut joint = moving(0.4);
    let slower = Tick { commanded: 0.1, ..tick(None, 0.4) };
    step(&mut joint, &slower);
    assert!((joint.used().position - 0.1 * DT).abs() < ROUNDED);
    assert!((joint.used().velocity - 0.1).abs() < 1e-12);
}

/// If an external force makes a joint faster than its velocity limit, the rate of the prediction is limited to 1.2
/// times this limit.
#[test]
fn j63_no_more_is_carried_on_than_a_little_over_the_velocity_limit() {
    for (velocity, carried) in [(1.7, 1.7), (2.5, 1.2 * VELOCITY_MAX), (-2.5, -1.2 * VELOCITY_MAX)] {
        let mut joint = moving(velocity);
        step(&mut joint, &tick(None, velocity));
        assert!((joint.used().position - carried * DT).abs() < ROUNDED, "{:?}", joint.used());
    }
}

#[test]
fn j35_the_reach_grows_with_the_time_since_the_last_usable_answer() {
    for silent in 0..4 {
        let reach = 3.0 * VELOCITY_MAX * f64::from(silent + 1) * DT;
        for (distance, usable) in [(reach, true), (1.01 * reach, false), (-1.01 * reach, false)] {
            let mut joint = moving(0.0);
            for _ in 0..silent {
                step(&mut joint, &tick(None, 0.0));
            }
            assert_eq!(step(&mut joint, &tick(Some(distance), 0.0)), usable);
        }
    }
}

#[test]
fn j35_the_reach_grows_with_the_length_of_a_tick() {
    for elapsed_ms in 1..5 {
        let reach = 3.0 * VELOCITY_MAX * f64::from(elapsed_ms) * DT;
        for (distance, usable) in [(0.99 * reach, true), (1.01 * reach, false), (-1.01 * reach, false)] {
            let mut joint = moving(0.0);
            let long = Tick { elapsed_ms, ..tick(Some(distance), 0.0) };
            assert_eq!(step(&mut joint, &long), usable, "{elapsed_ms} ms, {distance}");
        }
    }
}

#[test]
fn j35_neither_position_nor_velocity_of_an_unusable_answer_is_used() {
    let mut joint = moving(0.2);
    let glitch = Tick { commanded: 0.2, ..tick(Some(0.05), 1.9) };
    assert!(!step(&mut joint, &glitch));
    assert!((joint.used().position - 0.2 * DT).abs() < ROUNDED && joint.used().velocity == 0.2);
    joint.forget();
    assert!(step(&mut joint, &glitch), "after the error the next answer is taken as it is");
    assert_eq!(joint.used(), Reading { position: 0.05, velocity: 1.9 });
}

#[test]
fn j63_the_return_of_the_answers_makes_no_step_and_ends_at_the_answer() {
    let mut joint = moving(0.0);
    for _ in 0..4 {
        step(&mut joint, &tick(None, 0.0));
    }
    let mut last = joint.used();
    let mut after_100_ms = last;
    for k in 0..1000 {
        step(&mut joint, &Tick { commanded: 0.0, ..tick(Some(0.01), 0.5) });
        let now = joint.used();
        assert!((now.position - last.position).abs() < 1.6 * 0.01 / 100.0, "{k}: {last:?} {now:?}");
        assert!((now.velocity - last.velocity).abs() < 1.6 * 0.5 / 100.0, "{k}: {last:?} {now:?}");
        last = now;
        if k == 100 {
            after_100_ms = now;
        }
    }
    assert_eq!(last, Reading { position: 0.01, velocity: 0.5 });
    // Most of the offset has faded within the configured time, 100 ms.
    assert!(
        (0.01 - after_100_ms.position).abs() < 0.2 * 0.01 && (0.5 - after_100_ms.velocity).abs() < 0.2 * 0.5
    );
}

#[test]
fn j63_a_long_tick_is_predicted_for_its_length() {
    let mut joint = moving(0.4);
    step(&mut joint, &Tick { elapsed_ms: 3, ..tick(None, 0.4) });
    assert!((joint.used().position - 0.4 * 3.0 * DT).abs() < ROUNDED);
}

/// Simulates a joint whose positions change at `rate` (rad/s), but whose drive reports the velocity `reported`. Then
/// an answer deviates by `off` (rad) from the expected position, `since` further answers have the same deviation, and
/// the next answer is missing. Returns the predicted rate, rad/s.
fn carried_after(rate: f64, reported: f64, off: f64, since: u8) -> f64 {
    let mut joint = Measurement::default();
    let answer = |k: f64, off: f64| Tick {
        answer: Some(Reading { position: rate * k * DT + off, velocity: reported }),
        ..tick(None, 0.0)
    };
    for k in -20..0 {
        assert!(step(&mut joint, &answer(f64::from(k), 0.0)));
    }
    for k in 0..=since {
        assert!(step(&mut joint, &answer(f64::from(k), off)));
    }
    let before = joint.used().position;
    step(&mut joint, &tick(None, 0.0));
    (joint.used().position - before) / DT
}

#[test]
fn j63_the_rate_of_the_positions_is_carried_on_unless_they_jumped() {
    let unexpected = 0.1 * 3.0 * VELOCITY_MAX * DT;
    for (rate, reported, off, since, carried) in [
        (0.4, 0.5, 0.0, 0, 0.4),
        (0.4, 0.3, 0.0, 0, 0.4),
        // A deviation up to a tenth of the implausible distance (of 1 ms) still counts as a motion, so the rate over
        // the last 5 ms includes this deviation. After a larger deviation, the prediction uses the reported velocity.
        (0.0, 0.0, unexpected, 0, unexpected / (5.0 * DT)),
        (0.0, 0.0, 1.01 * unexpected, 0, 0.0),
        (0.0, 0.1, -1.01 * unexpected, 0, 0.1),
        // After a larger deviation, the prediction uses the reported velocity until the window of 5 ms contains only
        // answers after the deviation.
        (0.4, 0.5, 2.0 * unexpected, 0, 0.5),
        (0.4, 0.5, 2.0 * unexpected, 4, 0.5),
        (0.4, 0.5, 2.0 * unexpected, 5, 0.4),
        (0.4, 0.5, 2.0 * unexpected, 6, 0.4),
    ] {
        let found = carried_after(rate, reported, off, since);
        assert!((found - carried).abs() < ROUNDED, "{rate} {reported} {off} {since}: {found}");
    }
}

/// During a loss of answers, the predicted velocity follows the commanded velocity. After the loss, the velocity has
/// no step.
#[test]
fn j63_commands_during_a_loss_make_no_step_when_it_ends() {
    let mut joint = moving(0.4);
    step(&mut joint, &Tick { commanded: 0.1, ..tick(None, 0.0) });
    let predicted = joint.used();
    let back = Reading { position: predicted.position + 0.1 * DT, velocity: 0.1 };
    step(&mut joint, &Tick { answer: Some(back), commanded: 0.1, ..tick(None, 0.0) });
    assert!((joint.used().velocity - 0.1).abs() < 1e-9, "{:?}", joint.used());
}

/// After a missing or unusable answer, the difference between the prediction and the next answer fades. If no Move
/// has requested an answer, no answer is missing, and the controller uses the next answer directly.
#[test]
fn j63_only_what_was_expected_or_came_can_be_missing() {
    for (lost, jumps) in [
        (Tick { expected: true, ..tick(None, 0.0) }, false),
        (Tick { expected: false, ..tick(Some(0.5), 0.0) }, false),
        (Tick { expected: false, ..tick(None, 0.0) }, true),
    ] {
        let mut joint = moving(0.0);
        assert!(!step(&mut joint, &lost));
        assert!(step(&mut joint, &tick(Some(0.003), 0.0)));
        assert_eq!(joint.used().position > 0.002, jumps, "{lost:?}: {:?}", joint.used());
    }
}

#[test]
fn j16_the_speed_is_seen_where_the_reported_velocity_is_wrong() {
    let mut joint = Measurement::default();
    for k in 0..20 {
        let answer = Some(Reading { position: 0.3 * f64::from(k) * DT, velocity: 0.0 });
        step(&mut joint, &Tick { answer, ..tick(None, 0.0) });
    }
    assert!((joint.speed() - 0.3).abs() < ROUNDED);
}

/// The offset decays like a filter with a double pole, from any state and for any length of the ticks.
#[test]
fn j63_an_offset_fades_like_a_critically_damped_filter() {
    let config = Config::avena();
    let pole = FADING / f64::from(config.blend_ms);
    for (left, slope) in [(0.01, 0.0), (0.0, 1e-3), (-0.01, 2e-4), (-1e-3, (1.0 + pole) * 1e-3)] {
        for ms in [1u32, 2, 5] {
            let mut fading = Fading { left, slope };
            fading.step(ms, &config);
            let (t, both) = (f64::from(ms), slope + pole * left);
            let decay = (-pole * t).exp();
            let exact = ((left + both * t) * decay, (slope - pole * both * t) * decay);
            assert!((fading.left - exact.0).abs() < 1e-4 * 0.01, "{ms} ms: {fading:?} {exact:?}");
            assert!((fading.slope - exact.1).abs() < 1e-4 * 1e-3, "{ms} ms: {fading:?} {exact:?}");
        }
    }
    // A small remainder of an offset also fades, and is not set to zero at once.
    let mut little = Fading { left: 1e-6, slope: 0.0 };
    little.step(1, &config);
    assert!(little.left > 0.9e-6, "{little:?}");
    // An offset does not fade if no time has elapsed. The controller sets an offset to zero only if its value and its
    // slope are both below `FADED`.
    for (left, slope, dropped) in [
        (FADED, 0.0, false),
        (0.0, -FADED, false),
        (0.9 * FADED, 2.0 * FADED, false),
        (0.9 * FADED, -0.9 * FADED, true),
    ] {
        let mut fading = Fading { left, slope };
        fading.step(0, &config);
        let kept = if dropped { (0.0, 0.0) } else { (left, slope) };
        assert_eq!((fading.left, fading.slope), kept);
    }
}
