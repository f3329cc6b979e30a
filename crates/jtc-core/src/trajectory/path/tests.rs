//! Tests of path time: each tick of a ramp, and the duration of ramps (J-33).
extern crate std;
use super::*;
use proptest::prelude::*;

const FREE: Bounds = (f64::NEG_INFINITY, f64::INFINITY);

/// Executes one tick with the bounds ±`easy` and ±`full`.
fn tick(clock: &mut PathClock, easy: f64, full: f64) {
    clock.advance(1e9);
    if clock.halting() {
        clock.slow_down(200.0, 500.0, &SlopeBounds { easy: (-easy, easy), full: (-full, full) });
    } else if clock.ramping() {
        clock.change_pace(200.0, (-easy, easy));
    }
}

/// Returns the number of ticks from full speed to standstill. `bounds` returns the bounds of each tick.
fn stop(mut bounds: impl FnMut(u32, &PathClock) -> SlopeBounds) -> u32 {
    let mut clock = PathClock::start(1.0);
    clock.halt();
    for ms in 1..=2_000 {
        clock.advance(1e9);
        let now = bounds(ms, &clock);
        clock.slow_down(200.0, 500.0, &now);
        if clock.standing() {
            return ms;
        }
    }
    panic!("not within 2 s: {clock:?}");
}

#[test]
fn j33_full_speed_counts_whole_milliseconds() {
    let mut clock = PathClock::start(1.0);
    for k in 1..100_000 {
        tick(&mut clock, f64::INFINITY, f64::INFINITY);
        assert_eq!(clock.time, f64::from(k));
    }
}

#[test]
fn j33_a_ramp_takes_its_length() {
    let ticks = stop(|_, _| SlopeBounds { easy: FREE, full: FREE });
    assert!((195..=206).contains(&ticks), "{ticks}");
    let mut clock = PathClock::default();
    clock.go(1.0);
    let mut ticks = 0;
    while clock.ramping() && ticks < 1_000 {
        tick(&mut clock, f64::INFINITY, f64::INFINITY);
        ticks += 1;
    }
    assert!((195..=206).contains(&ticks), "{ticks}");
}

#[test]
fn j33_margins_give_way_before_a_stop_comes_late() {
    // The bounds with margins allow no slope, or a slope that is too small for the stop. The torque limits alone
    // allow a sufficient slope, so the stop must still end in time.
    for easy in [(0.0, 0.0), (1.0, -1.0), (0.5, 1.0), (-0.3, FREE.1)] {
        for most in [2.6, 4.0, 10.0, f64::INFINITY] {
            let ticks = stop(|_, _| SlopeBounds { easy, full: (-most, most) });
            assert!(ticks <= 480, "{ticks} ms with {easy:?} and {most}");
        }
    }
    // A stop also ends before its time limit if the bounds shrink after half of the ramp.
    let ticks = stop(|ms, _| SlopeBounds { easy: if ms < 100 { FREE } else { (0.0, 0.0) }, full: FREE });
    assert!(ticks <= 350, "{ticks}");
    // A stop along a ramp within the bounds is not hurried.
    let ticks = stop(|_, clock| {
        assert!(!clock.hurried);
        SlopeBounds { easy: (-4.5, 4.5), full: FREE }
    });
    assert!((250..=300).contains(&ticks), "{ticks}");
}

#[test]
fn j33_a_stop_uses_all_the_torque_but_no_more() {
    let most = 1.1;
    let ticks = stop(|_, clock| {
        assert!(clock.slope >= -most);
        SlopeBounds { easy: (0.0, 0.0), full: (-most, most) }
    });
    assert!((905..960).contains(&ticks), "{ticks}: 1/1.1 s");
    // For 100 ms, the arm gains speed even with all available torque. The stop must still end in time.
    let mut fastest: f64 = 0.0;
    let ticks = stop(|ms, clock| {
        fastest = fastest.max(clock.rate);
        let full = if (50..150).contains(&ms) { (2.0, 5.0) } else { (-3.0, 3.0) };
        SlopeBounds { easy: (0.0, 0.0), full }
    });
    assert!(ticks <= 500 && fastest > 0.9, "{ticks} {fastest}");
}

#[test]
fn j33_time_for_a_stop_runs_from_the_first_one() {
    let mut clock = PathClock::start(1.0);
    for ms in 0..480 {
        // The stop is requested in each tick.
        clock.halt();
        tick(&mut clock, 0.0, 2.8);
        if clock.standing() {
            return;
        }
        assert!(ms < 479, "{clock:?}");
    }
}

/// Tests each tick of a stop along ramps of 200 ms. The slope changes by at most 0.1125 1/s in a tick, or eight times as much in a hurried
/// stop.
#[test]
fn j33_each_tick_of_a_stop() {
    let (rounded, hurried) = (4.5 / 0.04 * DT, 8.0 * (4.5 / 0.04 * DT));
    let on_time = 0.001 * (PUNCTUAL * 500.0);
    for (rate, slope, easy, full, expected) in [
        (1.0, 0.0, FREE, FREE, -rounded),
        // In this row, the bounds with margins allow only one slope, which is larger than needed. In the next two
        // rows, the bounds contradict each other or allow no slope.
        (1.0, 0.0, (-1.0, -1.0), FREE, -rounded),
        (1.0, 0.0, (1.0, -1.0), FREE, -hurried),
        (1.0, 0.0, (0.0, 0.0), FREE, -hurried),
        // A stop within its bounds that ends exactly at its time limit is not hurried.
        (on_time, -5.0, (-1.0, FREE.1), (-7.0, 7.0), -1.0),
        // At full speed, path time does not become faster, for any motion of the arm.
        (1.0, 0.0, (2.0, 5.0), (2.0, 5.0), 0.0),
        // This tick covers the remaining rate, so path time is at rest and its slope is zero.
        (0.1 * DT, -5.0, (-0.1, FREE.1), FREE, 0.0),
        // The remaining rate counts as zero, although the bounds do not allow any slope.
        (1e-10, -5.0, (0.0, 0.0), (0.0, 0.0), 0.0),
    ] {
        let mut clock = PathClock { rate, slope, target: 1.0, ..PathClock::default() };
        clock.halt();
        clock.slow_down(200.0, 500.0, &SlopeBounds { easy, full });
        let what = (rate, slope, easy, full, clock);
        assert!((clock.slope - expected).abs() < 1e-12, "{what:?}");
        assert!((clock.rate - (rate + expected * DT)).abs() < 2e-4, "{what:?}");
        assert_eq!(clock.standing(), rate < 0.001, "{what:?}");
        assert_eq!(clock.hurried, matches!(easy, (1.0, -1.0) | (0.0, 0.0) | (2.0, 5.0)), "{what:?}");
    }
}

/// If a stop must end earlier than the ramp, its ramp is shortened.
#[test]
fn j33_a_stop_sooner_than_the_ramp_shortens_the_ramp() {
    let mut clock = PathClock::start(1.0);
    clock.halt();
    let free = SlopeBounds { easy: FREE, full: FREE };
    clock.slow_down(1_000.0, 500.0, &free);
    // The S-shaped ramp is shortened to 400 ms.
    assert!((clock.slope + 4.5 / 0.16 * DT).abs() < 1e-12, "{clock:?}");
}

proptest! {
    /// The test pauses the path at any time, also during a resume. The rate must stay within 0..1, must not fall
    /// before the pause, and must have no step. The slope is the derivative of the rate. Each pause must end before
    /// its time limit.
    #[test]
    fn j33_the_ramp_is_smooth(
        pauses in prop::collection::vec(1..400u32, 1..8),
        easy in 0.5..20.0f64,
        full in 6.0..40.0f64,
    ) {
        let mut clock = PathClock::start(1.0);
        for ticks in pauses {
            for ms in 0..ticks + 480 {
                let before = clock;
                if ms == ticks { clock.halt() }
                tick(&mut clock, easy.min(full), full);
                let change = clock.rate - before.rate;
                prop_assert!((0.0..=1.0).contains(&clock.rate));
                prop_assert!(change.abs() <= 0.04);
                if clock.rate != 0.0 && clock.rate != 1.0 {
                    prop_assert!((change - clock.slope * DT).abs() < 1e-12);
                }
                prop_assert!((clock.slope - before.slope).abs() < 1.7, "{:?} {:?}", before, clock);
                prop_assert!(clock.time >= before.time);
                if ms < ticks { prop_assert!(change >= 0.0) }
            }
            prop_assert!(clock.standing(), "{:?}", clock);
            clock.go(1.0);
        }
    }
}

/// Returns a clock after one tick of a ramp to full speed.
fn sped_up(rate: f64, slope: f64, bounds: Bounds) -> PathClock {
    let mut clock = PathClock { rate, slope, target: 1.0, ..PathClock::default() };
    clock.change_pace(200.0, bounds);
    clock
}

#[test]
fn j33_each_tick_of_a_resume() {
    let rounded = 4.5 / 0.04 * DT;
    for (rate, slope, bounds, expected) in [
        (0.0, 0.0, FREE, rounded),
        (0.5, -1.0, FREE, -1.0 + 8.0 * rounded),
        // The bounds allow only one slope. In the next rows, the bounds contradict each other, or allow only the
        // opposite direction or no slope.
        (0.5, 5.0, (2.0, 2.0), 2.0),
        (0.5, 5.0, (2.0, 1.0), 0.0),
        (0.5, 5.0, (-2.0, -1.0), 0.0),
        (0.5, 5.0, (0.0, 0.0), 0.0),
    ] {
        let clock = sped_up(rate, slope, bounds);
        assert!((clock.slope - expected).abs() < 1e-12, "{rate} {slope} {bounds:?}: {clock:?}");
        assert!(
            (clock.rate - (rate + clock.slope * DT)).abs() < 1e-12,
            "{rate} {slope} {bounds:?}: {clock:?}"
        );
    }
}

/// When a tick covers the remaining change of the rate, path time is at full speed and its slope is zero.
#[test]
fn j33_a_resume_ends_where_a_tick_covers_the_rest_of_the_way() {
    // `rest` is a remaining change of the rate. This change is a power of two, so it has no rounding error. `enough` is
    // the slope that just covers this change in one tick.
    let rest = 1.0 / 16_384.0;
    let enough = rest / DT;
    assert_eq!(enough * DT, rest);
    for (rest, high, full_speed) in [
        (rest, enough, true),
        (rest, 0.99 * enough, false),
        (rest, FREE.1, true),
        // The remaining change of the rate is so small that the bounds do not apply.
        (0.9e-9, 0.0, true),
        (1.1e-9, 0.0, false),
    ] {
        let clock = sped_up(1.0 - rest, enough, (0.0, high));
        assert_eq!(!clock.ramping(), full_speed, "{rest} {high}: {clock:?}");
        assert!(!full_speed || clock.slope == 0.0, "{rest} {high}: {clock:?}");
    }
}

#[test]
fn j33_the_rest_of_the_way_flattens_the_slope_out() {
    let ramp = Ramp::of(200.0);
    for ticks in [1.0, 2.0, 7.0, 40.0] {
        // `way` is the change of the rate while the slope falls from `ticks` steps to one step. A step is the change
        // of the slope per tick.
        let way = ramp.round * DT * ticks * (ticks + 1.0) / 2.0;
        assert!((ramp.flatten(way) - ticks * ramp.round).abs() < 1e-9, "{ticks}");
    }
    assert_eq!(ramp.next(-1.0, 1.0), -1.0 + 8.0 * ramp.round);
    assert_eq!(ramp.next(1.0, 1.0), 1.0 + ramp.round);
}

#[test]
fn j33_a_clock_stands_halts_or_goes() {
    let mut clock = PathClock::default();
    let states = |clock: &PathClock| (clock.standing(), clock.halting(), clock.ramping());
    assert_eq!(states(&clock), (true, false, false));
    clock.go(1.0);
    assert_eq!(states(&clock), (false, false, true), "about to go");
    tick(&mut clock, FREE.1, FREE.1);
    assert_eq!(states(&clock), (false, false, true));
    clock.halt();
    assert_eq!(states(&clock), (false, true, true));
    clock.rest();
    assert_eq!(states(&clock), (true, false, false));
    assert_eq!(states(&PathClock::start(1.0)), (false, false, false));
}

#[test]
fn j33_a_rate_below_a_billionth_is_standstill() {
    for (rate, stands) in [(1.01e-9, false), (1e-9, false), (0.99e-9, true)] {
        let mut clock = PathClock { rate, target: 1.0, ..PathClock::default() };
        clock.halt();
        // The bounds do not allow any slope for the remaining rate.
        clock.slow_down(200.0, 500.0, &SlopeBounds { easy: (0.0, 0.0), full: (0.0, 0.0) });
        assert_eq!(clock.standing(), stands, "{clock:?}");
    }
}

proptest! {
    /// Path time reaches each requested speed, for any sequence of speeds. The rate stays within the range of the targets so far, and the
    /// slope never has a step.
    #[test]
    fn j57_path_time_gets_to_every_speed_along_the_ramp(
        start in 0.05..1.0f64,
        changes in prop::collection::vec((0.05..1.0f64, 1u32..400), 1..12),
    ) {
        let mut clock = PathClock::start(start);
        let (round, mut wanted) = (Ramp::of(200.0).round, std::vec![start]);
        for (pace, ticks) in changes {
            clock.set_pace(pace);
            wanted.push(pace);
            for ms in 0..ticks {
                let before = clock;
                clock.advance(1e9);
                if clock.ramping() {
                    clock.change_pace(200.0, FREE);
                }
                // The rate stays within the range of the targets so far.
                let (least, most) = wanted.iter().fold((1.0f64, 0.0f64), |(l, m), w| (l.min(*w), m.max(*w)));
                prop_assert!(clock.rate >= least - 1e-9 && clock.rate <= most + 1e-9, "{clock:?}");
                prop_assert!((clock.slope - before.slope).abs() <= REVERSAL * round + 1e-9, "{before:?} {clock:?}");
                prop_assert!(clock.slope.abs() <= 1.5 / 0.2 + 1e-9, "the middle of an S of 200 ms");
                prop_assert!(clock.time > before.time);
                prop_assert!(ms < 300 || clock.rate == pace, "{ms} ms: {clock:?}");
            }
        }
    }
}

/// A new speed must not end a pause. A pause that begins at a lower speed must not take longer than a pause from full
/// speed.
#[test]
fn j57_a_speed_that_is_set_does_not_undo_a_pause() {
    let mut clock = PathClock::start(0.5);
    clock.halt();
    assert!(!clock.set_pace(1.0));
    let mut ticks = 0;
    while !clock.standing() {
        assert!(clock.halting());
        tick(&mut clock, f64::INFINITY, f64::INFINITY);
        ticks += 1;
        assert!(ticks < 206);
    }
    assert!(!clock.set_pace(0.3) && clock.standing());
    clock.go(0.3);
    while clock.ramping() {
        tick(&mut clock, f64::INFINITY, f64::INFINITY);
    }
    assert_eq!(clock.rate, 0.3);
}

#[test]
fn j57_the_speed_keeps_to_what_the_arm_can_follow() {
    for bounds in [(-0.5, 0.5), (-0.1, 2.0), (0.3, 1.0), (1.0, -1.0)] {
        let mut clock = PathClock::start(1.0);
        clock.set_pace(0.2);
        for _ in 0..100 {
            clock.advance(1e9);
            clock.change_pace(200.0, bounds);
            assert!(clock.slope <= 0.0 && clock.slope >= bounds.0.min(0.0) - 1e-12, "{bounds:?}: {clock:?}");
        }
    }
}
