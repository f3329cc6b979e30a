//! Tests of late answers, and of lost answers between late answers (J-63).
use std::vec::Vec;

use proptest::prelude::*;

use super::*;

/// Resolution of the encoders, rad.
const ENCODER: f64 = 96e-6;

/// Joint that moves back and forth.
#[derive(Clone, Copy, Debug)]
struct Motion {
    /// Amplitude of the motion, rad.
    amplitude: f64,
    /// Angular frequency of the motion, 1/s.
    rate: f64,
    /// Share of the motion that the controller commands. An external force causes the rest of the motion.
    commanded: f64,
}

/// Errors of the values that the control law uses, relative to the real motion of the joint, in one millisecond of
/// the test.
#[derive(Clone, Copy, Debug)]
struct Off {
    /// Difference of the position, rad.
    position: f64,
    /// Difference of the velocity, rad/s.
    velocity: f64,
}

impl Motion {
    fn position(&self, ms: f64) -> f64 {
        self.amplitude * (self.rate * ms * DT).sin()
    }

    fn velocity(&self, ms: f64) -> f64 {
        self.amplitude * self.rate * (self.rate * ms * DT).cos()
    }

    /// Returns the highest speed of the motion, rad/s.
    fn speed(&self) -> f64 {
        self.amplitude * self.rate
    }

    fn past(&self, ms: f64, ticks: u8) -> Late {
        let then = ms - f64::from(ticks);
        Late {
            ms: ticks.into(),
            commanded: self.commanded * self.velocity(then),
            commanded_way: self.commanded * (self.position(ms) - self.position(then)),
        }
    }

    /// Executes all milliseconds of the test. `came` contains the numbers of the answers that arrive in each millisecond.
    fn off(&self, came: &[Vec<u32>]) -> Vec<Off> {
        self.off_with(came, &Config::avena())
    }

    fn off_with(&self, came: &[Vec<u32>], config: &Config) -> Vec<Off> {
        let mut joint = Measurement::default();
        let mut off = Vec::new();
        for (now, came) in (0u32..).zip(came) {
            let ms = f64::from(now);
            let answer = came.last().map(|&n| Reading {
                position: ENCODER * (self.position(n.into()) / ENCODER).round(),
                velocity: self.velocity(n.into()),
            });
            let tick = Tick {
                answer,
                expected: true,
                asked: true,
                answers: came.len() as u8,
                commanded: self.commanded * self.velocity(ms),
                elapsed_ms: 1,
                velocity_max: VELOCITY_MAX,
                enabled: false,
                joint: 0,
            };
            let usable = joint.step(&tick, |ticks| self.past(ms, ticks), config) == Outcome::Used;
            assert_eq!(usable, answer.is_some(), "{now} ms");
            let Reading { position, velocity } = joint.used();
            off.push(Off { position: position - self.position(ms), velocity: velocity - self.velocity(ms) });
        }
        off
    }
}

/// Returns the numbers of the answers that arrive in each millisecond. `late` is the lateness of each answer. The order of the answers does
/// not change. `lost` marks answers that never arrive.
fn arrivals(late: &[u32], lost: &[u32]) -> Vec<Vec<u32>> {
    let mut came = std::vec![Vec::new(); late.len()];
    let mut last = 0;
    for (n, late) in (0u32..).zip(late).filter(|(n, _)| !lost.contains(n)) {
        last = last.max(n + late);
        if let Some(came) = came.get_mut(last as usize) {
            came.push(n);
        }
    }
    came
}

/// Returns the largest position error, rad.
fn most(off: &[Off]) -> f64 {
    off.iter().fold(0.0, |most, off| most.max(off.position.abs()))
}

/// Returns the lateness of each answer. The first answers are on time. Then several answers arrive in one tick (the
/// burst), and the oldest of them is `most` ticks late. After the burst, any lateness up to `most` may occur. In
/// every 24th tick, no answer is outstanding.
fn lateness(most: u32) -> impl Strategy<Value = Vec<u32>> {
    let burst = (0..=20).map(|_| 0).chain((0..=most).rev());
    let burst: Vec<u32> = burst.collect();
    prop::collection::vec(0..=most, 600).prop_map(move |late| {
        let late = (0..).zip(late).map(|(n, late)| late.min(23 - n % 24));
        burst.iter().copied().chain(late).collect()
    })
}

fn motion() -> impl Strategy<Value = Motion> {
    (0.05..0.5f64, 0.5..2.0f64, 0.5..1.0f64).prop_map(|(amplitude, rate, commanded)| Motion {
        amplitude,
        rate,
        commanded,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    /// After the burst of late answers, the error of the used position consists only of encoder steps and of the
    /// error of the predicted rate. If the controller treated a late answer like an answer on time, the error would
    /// be the lateness times the speed, which is up to 5 mrad.
    #[test]
    fn j63_late_answers_are_used_as_of_the_time_at_which_they_were_due(
        motion in motion(),
        late in (1u32..=5).prop_flat_map(lateness),
    ) {
        let off = motion.off(&arrivals(&late, &[]));
        // At the end of the burst, the used position has an offset from the answers. After 300 ticks, this offset has
        // faded.
        prop_assert!(most(&off[300..]) <= 4.0 * ENCODER, "{} rad", most(&off[300..]));
    }

    /// If a joint follows its command, the controller uses the velocity in the late answer, plus the change of the
    /// commanded velocity since the time of this answer.
    #[test]
    fn j63_late_velocities_are_taken_on_by_what_was_commanded(motion in motion(), late in lateness(3)) {
        let motion = Motion { commanded: 1.0, ..motion };
        for off in &motion.off(&arrivals(&late, &[]))[500..] {
            prop_assert!(off.velocity.abs() < 1e-4, "{off:?}");
        }
    }

    /// Answers between late answers may be lost. The position error must nevertheless stay below twice the distance
    /// that the joint moves in 4 ms. Half of this bound is the offset that the controller adds when it detects the
    /// loss. After this offset has faded, no error remains.
    #[test]
    fn j63_answers_lost_among_late_ones_are_taken_for_late_for_a_while_only(
        motion in motion(),
        late in lateness(3),
        lost in prop::collection::vec(30u32..300, 0..20),
    ) {
        // From answer 400 on, no answer is late. The controller may still detect earlier lost answers in this part of
        // the test.
        let late: Vec<u32> = late.iter().enumerate().map(|(n, late)| if n < 400 { *late } else { 0 }).collect();
        let off = motion.off(&arrivals(&late, &lost));
        let way = 4.0 * motion.speed() * DT;
        prop_assert!(most(&off) <= 2.0 * way + 8.0 * ENCODER, "{} rad, way {way}", most(&off));
        prop_assert!(most(&off[550..]) <= 4.0 * ENCODER, "{} rad", most(&off[550..]));
    }
}

/// After a lost answer, the next answer of a fast joint is at the predicted position. If this answer were late, it
/// would lag by the distance that the joint moves in a millisecond. The controller therefore detects the loss at
/// once, and not only at the end of the window.
#[test]
fn j63_a_fast_joint_shows_at_once_that_an_answer_was_lost() {
    let motion = Motion { amplitude: 0.5, rate: 2.0, commanded: 1.0 };
    let late: Vec<u32> = (0..400).map(|n| if n < 200 { [0, 1, 0, 2, 0, 0][n % 6] } else { 0 }).collect();
    let lost = [210, 213, 217, 240];
    let off = motion.off(&arrivals(&late, &lost));
    assert!(most(&off[190..250]) <= 3.0 * ENCODER, "{:?}", &off[190..250]);
}

/// Before the first evidence of late answers, the controller treats a late answer like an answer on time. The
/// difference from the prediction becomes an offset that fades, so the used position has no step.
#[test]
fn j63_the_first_late_answers_make_no_step() {
    let motion = Motion { amplitude: 0.6, rate: 1.0, commanded: 1.0 };
    for late in 1..=4 {
        let late: Vec<u32> = (0..400).map(|n| if (100..200).contains(&n) { late } else { 0 }).collect();
        let off = motion.off(&arrivals(&late, &[]));
        let step =
            off.windows(2).fold(0.0, |most: f64, off| most.max((off[1].position - off[0].position).abs()));
        assert!(step <= 3.0 * ENCODER, "{step} rad");
    }
}

/// After the controller has received several answers in one tick, a change of the lateness must not cause a step of
/// the used position, for any configured `encoder_step`.
#[test]
fn j63_a_lateness_that_shifts_makes_no_step() {
    let motion = Motion { amplitude: 0.6, rate: 1.0, commanded: 1.0 };
    for most in 1..=4u32 {
        for encoder_step in [0.0, ENCODER, 0.01] {
            let shifts = (0..1_500).map(|n| if n / 150 % 2 == 1 || n == 60 { most } else { 0 });
            let late: Vec<u32> = shifts.collect();
            let config = Config { encoder_step, ..Config::avena() };
            let off = motion.off_with(&arrivals(&late, &[]), &config);
            let steps = off.windows(2).map(|off| (off[1].position - off[0].position).abs());
            let step = steps.fold(0.0, f64::max);
            assert!(step <= 4.0 * ENCODER, "{most} ms, {encoder_step} rad: a step of {step} rad");
        }
    }
}

/// The controller does not detect a constant delay of all answers. The setting `delay_ticks` accounts for a constant delay. If all answers
/// have the same lateness, the used position follows these answers without a permanent offset.
#[test]
fn j63_answers_that_are_all_as_late_are_taken_as_they_come() {
    let motion = Motion { amplitude: 0.5, rate: 2.0, commanded: 1.0 };
    let late: Vec<u32> = (0..3_000).map(|n| if n < 100 { 0 } else { 2 }).collect();
    let came = arrivals(&late, &[]);
    let off = motion.off(&came);
    for (ms, off) in (0..3_000).zip(&off).skip(1_000) {
        let ms = f64::from(ms);
        let lag = motion.position(ms - 2.0) - motion.position(ms);
        assert!((off.position - lag).abs() <= ENCODER, "{ms} ms: {off:?}, a lag of {lag} rad");
    }
}

/// If answers repeatedly deviate from their predictions and return to them in small steps, the resulting offsets do
/// not add up.
#[test]
fn j63_what_was_bridged_is_taken_back() {
    let mut joint = moving(0.0);
    let mut answers = |off: f64, answers: u8| {
        step(&mut joint, &Tick { answers, ..tick(Some(off), 0.0) });
        let used = joint.used().position;
        step(&mut joint, &tick(None, 0.0));
        used
    };
    answers(0.0, 2);
    for k in 1..=20 {
        for off in [0.0, 3.1 * ENCODER, 1.6 * ENCODER] {
            let used = answers(off, 1);
            assert!((-ENCODER..=4.0 * ENCODER).contains(&used), "{k}: {used} rad at an answer of {off} rad");
        }
    }
}

/// A correction only reduces the offset, and never changes its sign.
#[test]
fn j63_only_what_is_left_is_taken_back() {
    for (left, by, remains) in [
        (2.0, -0.5, 1.5),
        (2.0, -3.0, 0.0),
        (2.0, 0.5, 2.0),
        (-2.0, 0.5, -1.5),
        (-2.0, 3.0, 0.0),
        (-2.0, -0.5, -2.0),
        (0.0, 1.0, 0.0),
        (0.0, -1.0, 0.0),
    ] {
        let mut fading = Fading { left, slope: 0.0 };
        fading.take_back(by);
        assert_eq!(fading.left, remains, "{left} {by}");
    }
}
