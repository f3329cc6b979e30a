//! Memory for the last usable answers of a joint, and computation of the rate of its positions.
use crate::DT;
use crate::bit_codec::bit_codec;

/// Number of answers over which the rate is computed. `WINDOW_MS` is the shortest time over which the rate is
/// computed, ms.
const WINDOW: usize = 5;
/// Number of slots in the ring buffer. The number of slots is a power of two, so that an index needs no comparison.
const SLOTS: usize = 16;
const WINDOW_MS: u32 = 5;
/// Inverse of the time over which the rate is computed while no answer is lost, 1/s.
const PER_WINDOW: f64 = 1.0 / (WINDOW_MS as f64 * DT);

/// A usable answer of the joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Answered {
    /// Position in the answer, rad.
    pub position: f64,
    /// Time to which the answer belongs, ms.
    pub at_ms: u32,
}

impl Answered {
    /// Returns the distance from this answer to the more recent answer `now`, rad. The distance of an answer to itself is zero.
    fn way_to(&self, now: &Self) -> f64 {
        // The two numbers are so close that their difference has no rounding error.
        f64::from(now.position as f32 - self.position as f32)
    }

    /// Returns the time from `other` to this answer, ms.
    fn since(&self, other: &Self) -> u32 {
        self.at_ms.wrapping_sub(other.at_ms)
    }
}

/// Rate of the positions of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    /// Rate of the positions, rad/s.
    pub rad_s: f64,
    /// `true` if all answers of the window, except the first, were close to their predictions.
    pub as_predicted: bool,
}

/// Stored form of an answer. The single precision of this form resolves 1/400 of the step of a 16-bit encoder.
#[derive(Clone, Copy, Debug, Default)]
struct Kept {
    /// Position in the answer, rad.
    position: f32,
    /// Time to which the answer belongs, ms.
    at_ms: u32,
}

/// Ring buffer of the last answers of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct History {
    answers: [Kept; SLOTS],
    /// Number of the slot for the next answer. The number is counted modulo 256.
    next: u8,
    /// Number of consecutive answers before the newest one, with one answer in each millisecond. The number can be
    /// higher than the number of stored answers.
    in_turn: u8,
    /// Mask of the answers that were close to their predictions. Bit 0 of this mask stands for the newest answer.
    as_predicted: u8,
}

bit_codec!(Kept { position, at_ms });
bit_codec!(History { answers, next, in_turn, as_predicted });

impl History {
    /// Creates a history that contains only this answer.
    pub(super) fn of(answer: &Answered) -> Self {
        let kept = Kept { position: answer.position as f32, at_ms: answer.at_ms };
        Self { answers: [kept; SLOTS], ..Self::default() }
    }

    /// Stores an answer in the history. Returns the rate between the newest stored answer that is old enough, and
    /// this answer. Returns `None` if every stored answer is too recent.
    #[inline(always)]
    pub(super) fn take(&mut self, now: &Answered, as_predicted: bool) -> Option<Rate> {
        let turn = now.since(&self.nth(0)) == 1;
        self.in_turn = if turn { self.in_turn.saturating_add(1) } else { 0 };
        // If five answers arrived without a gap, the oldest of them is the newest answer that is old enough.
        let rate = if self.in_turn >= WINDOW as u8 {
            let rad_s = self.nth(WINDOW - 1).way_to(now) * PER_WINDOW;
            Some(Rate { rad_s, as_predicted: self.younger_as_predicted(WINDOW - 1) })
        } else {
            self.rate_over_gaps(now)
        };
        let kept = Kept { position: now.position as f32, at_ms: now.at_ms };
        self.answers[usize::from(self.next) % SLOTS] = kept;
        self.next = self.next.wrapping_add(1);
        self.as_predicted = self.as_predicted << 1 | u8::from(as_predicted);
        rate
    }

    /// Returns the rate of the positions if answers have been lost.
    #[cold]
    fn rate_over_gaps(&self, now: &Answered) -> Option<Rate> {
        let n = (0..WINDOW).find(|&n| now.since(&self.nth(n)) >= WINDOW_MS)?;
        let from = self.nth(n);
        let seconds = f64::from(now.since(&from)) * DT;
        Some(Rate { rad_s: from.way_to(now) / seconds, as_predicted: self.younger_as_predicted(n) })
    }

    /// Returns `true` if the `n` newest answers were close to their predictions.
    fn younger_as_predicted(&self, n: usize) -> bool {
        let younger = (1u8 << n) - 1;
        self.as_predicted & younger == younger
    }

    /// Returns the position `ms` milliseconds before the newest answer, rad. Returns `None` if an answer is missing
    /// in this time. The newest answer must be at most one millisecond older than `now_ms`.
    pub(super) fn before(&self, now_ms: u32, ms: u8) -> Option<f64> {
        let since_newest = now_ms.wrapping_sub(self.nth(0).at_ms);
        (since_newest <= 1 && ms <= self.in_turn.min(SLOTS as u8 - 1)).then(|| self.nth(ms.into()).position)
    }

    /// Returns the last answer.
    pub(super) fn newest(&self) -> Answered {
        self.nth(0)
    }

    /// Returns the position of the answer that belongs to this time, rad, if the answer is still stored.
    pub(super) fn at(&self, at_ms: u32) -> Option<f64> {
        (0..SLOTS).map(|n| self.nth(n)).find(|answer| answer.at_ms == at_ms).map(|answer| answer.position)
    }

    /// Returns the answer after which `n` more recent answers arrived.
    #[inline(always)]
    fn nth(&self, n: usize) -> Answered {
        let Kept { position, at_ms } = self.answers[usize::from(self.next).wrapping_sub(1 + n) % SLOTS];
        Answered { position: position.into(), at_ms }
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

        /// The rate from the history must be equal to the rate that is computed from a list of all answers. Each
        /// entry of this list contains the time since the previous answer (usually 1 ms), the position, and `true` if
        /// the answer was close to its prediction.
        #[test]
        fn j63_the_rate_is_from_the_youngest_kept_answer_that_is_old_enough(
            answers in prop::collection::vec((prop_oneof![6 => Just(1u32), 1 => 0..9u32], -3.0..3.0, prop::bool::weighted(0.9)), 1..40),
            start in prop_oneof![Just(0), Just(u32::MAX - 9)],
        ) {
            let mut history: Option<History> = None;
            let (mut all, mut at_ms): (Vec<(Answered, bool)>, u32) = (Vec::new(), start);
            for (gap, position, as_predicted) in answers {
                at_ms = at_ms.wrapping_add(gap);
                let now = Answered { position, at_ms };
                let kept: Vec<_> = all.iter().rev().take(5).collect();
                let from = kept.iter().position(|(answer, _)| at_ms.wrapping_sub(answer.at_ms) >= 5);
                let as_predicted_now = as_predicted;
                let rate = match &mut history {
                    Some(history) => history.take(&now, as_predicted_now),
                    None => history.insert(History::of(&now)).take(&now, as_predicted_now),
                };
                match (rate, from) {
                    (None, None) => {}
                    (Some(rate), Some(n)) => {
                        let before = &kept[n].0;
                        let seconds = f64::from(at_ms.wrapping_sub(before.at_ms)) * 0.001;
                        prop_assert!((rate.rad_s - (position - before.position) / seconds).abs() < 1e-4);
                        prop_assert_eq!(rate.as_predicted, kept[..n].iter().all(|(_, as_predicted)| *as_predicted));
                    }
                    (rate, from) => prop_assert!(false, "{rate:?}, but answer {from:?}"),
                }
                all.push((now, as_predicted));
            }
        }
    }

    /// Returns a history with one answer in each millisecond from `first_ms` to `last_ms`. The position of an answer is its time, rad.
    fn in_turn(first_ms: u32, last_ms: u32) -> History {
        let answer = |at_ms: u32| Answered { position: f64::from(at_ms), at_ms };
        let mut history = History::of(&answer(first_ms));
        (first_ms..=last_ms).for_each(|at_ms| _ = history.take(&answer(at_ms), true));
        history
    }

    /// The position at the start of a window is known only if an answer arrived in each millisecond of the window.
    /// The window ends with the newest answer, which may be 1 ms old.
    #[test]
    fn j35_the_position_before_a_window_without_a_gap_is_known() {
        let history = in_turn(100, 110);
        for (now_ms, ms, from) in [
            (110, 0, Some(110.0)),
            (110, 1, Some(109.0)),
            (110, 10, Some(100.0)),
            // The history begins at 100 ms, so the position at 99 ms is unknown.
            (110, 11, None),
            (111, 0, Some(110.0)),
            (111, 1, Some(109.0)),
            (111, 10, Some(100.0)),
            (111, 11, None),
            // The newest answer is 2 ms old, so an answer is missing.
            (112, 2, None),
            (112, 10, None),
        ] {
            assert_eq!(history.before(now_ms, ms), from, "{ms} ms, at {now_ms} ms");
        }
        // The answer at 111 ms is missing, so only the positions from 112 ms on are known.
        let mut gap = in_turn(100, 110);
        (112..=115).for_each(|at_ms| _ = gap.take(&Answered { position: f64::from(at_ms), at_ms }, true));
        assert_eq!((gap.before(115, 3), gap.before(115, 4)), (Some(112.0), None));
    }

    /// The history has 16 slots, so the oldest known position is 15 ms older than the newest answer.
    #[test]
    fn j35_positions_up_to_the_oldest_stored_answer_are_known() {
        let history = in_turn(100, 140);
        assert_eq!((history.before(140, 15), history.before(140, 16)), (Some(125.0), None));
        assert_eq!((history.before(141, 15), history.before(141, 16)), (Some(125.0), None));
        for (at_ms, position) in
            [(140, Some(140.0)), (133, Some(133.0)), (125, Some(125.0)), (124, None), (141, None)]
        {
            assert_eq!(history.at(at_ms), position, "{at_ms} ms");
        }
    }
}
