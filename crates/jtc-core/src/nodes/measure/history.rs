//! The last usable answers of a joint, and the rate of their positions.
use crate::DT;
use crate::remembered::remembered;

/// Answers that are looked at, and milliseconds over which a rate is taken at least.
const WINDOW: usize = 5;
/// Slots of the ring: a power of two, so that an index needs no comparison.
const SLOTS: usize = WINDOW.next_power_of_two();
const WINDOW_MS: u32 = 5;
/// One over the time that it is taken over while no answer is lost, 1/s.
const PER_WINDOW: f64 = 1.0 / (WINDOW_MS as f64 * DT);

/// A usable answer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Answered {
    /// rad.
    pub position: f64,
    /// When it came, ms.
    pub at_ms: u32,
}

impl Answered {
    /// Milliseconds after another one.
    fn since(&self, other: &Self) -> u32 {
        self.at_ms.wrapping_sub(other.at_ms)
    }
}

/// A rate of positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    /// rad/s.
    pub rad_s: f64,
    /// Every answer after the one that it is taken from was about where it had been predicted.
    pub as_predicted: bool,
}

/// The last answers, in a ring.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct History {
    answers: [Answered; SLOTS],
    /// Where the next one goes; it wraps around.
    next: u8,
    /// How many there are, of those that are looked at.
    known: u8,
    /// Which were about where they had been predicted; the newest is bit 0.
    as_predicted: u8,
}

remembered!(Answered { position, at_ms });
remembered!(History { answers, next, known, as_predicted });

impl History {
    /// Keeps an answer.
    pub fn push(&mut self, answer: Answered, as_predicted: bool) {
        self.answers[usize::from(self.next) % SLOTS] = answer;
        self.next = self.next.wrapping_add(1);
        self.known = (self.known + 1).min(WINDOW as u8);
        self.as_predicted = self.as_predicted << 1 | u8::from(as_predicted);
    }

    /// The rate from the youngest answer that is old enough to `now`; `None` when there is none.
    pub fn rate_to(&self, now: &Answered) -> Option<Rate> {
        // Nearly always there is an answer in each millisecond, so that the oldest is old enough, and it alone.
        let (oldest, next) = (self.nth(WINDOW - 1), self.nth(WINDOW - 2));
        let calm =
            self.known == WINDOW as u8 && now.since(oldest) == WINDOW_MS && now.since(next) < WINDOW_MS;
        if !calm {
            return self.rate_over_gaps(now);
        }
        let as_predicted = self.younger_as_predicted(WINDOW - 1);
        Some(Rate { rad_s: (now.position - oldest.position) * PER_WINDOW, as_predicted })
    }

    /// The same where answers have been lost.
    #[cold]
    fn rate_over_gaps(&self, now: &Answered) -> Option<Rate> {
        let n = (0..usize::from(self.known)).find(|&n| now.since(self.nth(n)) >= WINDOW_MS)?;
        let way = now.position - self.nth(n).position;
        let seconds = f64::from(now.since(self.nth(n))) * DT;
        Some(Rate { rad_s: way / seconds, as_predicted: self.younger_as_predicted(n) })
    }

    /// The `n` newest answers were about where they had been predicted.
    fn younger_as_predicted(&self, n: usize) -> bool {
        let younger = (1u8 << n) - 1;
        self.as_predicted & younger == younger
    }

    /// The answer before which `n` younger ones came.
    fn nth(&self, n: usize) -> &Answered {
        &self.answers[usize::from(self.next).wrapping_sub(1 + n) % SLOTS]
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..Default::default() })]

        /// The same as found by looking through a list of all answers: milliseconds since the one before, mostly one, position and
        /// whether it was as predicted.
        #[test]
        fn j63_the_rate_is_from_the_youngest_kept_answer_that_is_old_enough(
            answers in prop::collection::vec((prop_oneof![6 => Just(1u32), 1 => 0..9u32], -3.0..3.0, prop::bool::weighted(0.9)), 1..40),
            start in prop_oneof![Just(0), Just(u32::MAX - 9)],
        ) {
            let mut history = History::default();
            let (mut all, mut at_ms): (Vec<(Answered, bool)>, u32) = (Vec::new(), start);
            for (gap, position, as_predicted) in answers {
                at_ms = at_ms.wrapping_add(gap);
                let now = Answered { position, at_ms };
                let kept: Vec<_> = all.iter().rev().take(5).collect();
                let from = kept.iter().position(|(answer, _)| at_ms.wrapping_sub(answer.at_ms) >= 5);
                match (history.rate_to(&now), from) {
                    (None, None) => {}
                    (Some(rate), Some(n)) => {
                        let before = &kept[n].0;
                        let seconds = f64::from(at_ms.wrapping_sub(before.at_ms)) * 0.001;
                        prop_assert!((rate.rad_s - (position - before.position) / seconds).abs() < 1e-9);
                        prop_assert_eq!(rate.as_predicted, kept[..n].iter().all(|(_, as_predicted)| *as_predicted));
                    }
                    (rate, from) => prop_assert!(false, "{rate:?}, but answer {from:?}"),
                }
                history.push(now, as_predicted);
                all.push((now, as_predicted));
            }
        }
    }
}
