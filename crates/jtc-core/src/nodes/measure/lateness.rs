//! Detection of the lateness of a joint's answers (J-63).
//!
//! An answer does not identify its Move, but the answers of a node keep their order. The lateness of the newest
//! answer is therefore the number of Moves that were sent after the Move of this answer. These later Moves are called
//! *outstanding*.
//!
//! If an answer is missing, it may be late or lost. Two answers in one tick are the *evidence* that answers can be
//! late, because the first of these two answers was late. For a second after this evidence, the controller counts
//! unanswered Moves as outstanding. The number of outstanding Moves is at most the highest number of late answers in
//! one tick. Without evidence, the controller counts unanswered Moves as lost. The evidence can be wrong, because a
//! frame that the bus repeats arrives twice.
//!
//! After a lost answer, the number of outstanding Moves does not return to zero. Therefore the controller subtracts
//! the lowest number of outstanding Moves in a window.
use crate::bit_codec::bit_codec;

/// Time for which the evidence of late answers is valid, ms.
const LASTS_MS: u16 = 1_000;
/// Number of ticks in which the number of outstanding Moves must return to zero at least once.
const WINDOW: u8 = 64;
/// Highest lateness of an answer that is counted, ticks.
const MOST: u8 = 7;

/// State of the count of unanswered Moves of a node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lateness {
    /// Remaining time for which the last evidence of late answers is valid, ms.
    left_ms: u16,
    /// Number of Moves whose answers may still arrive.
    outstanding: u8,
    /// Upper bound of `outstanding`. While evidence is valid, this bound is the highest number of answers in one tick, minus one.
    most: u8,
    /// Lowest value of `outstanding` in this window. `window` is the number of ticks of the window so far.
    fewest: u8,
    window: u8,
    /// Mask of the recent ticks in which a Move was sent. Bit 0 stands for the newest tick.
    moves: u8,
}

bit_codec!(Lateness { left_ms, outstanding, most, fewest, window, moves });

impl Lateness {
    /// Returns `true` if no answer is considered late and the tick has at most one answer. A tick with one answer or
    /// none contains no evidence of late answers, so the caller does not need to call [`Self::count`].
    pub(super) fn stands(&self, answers: u8) -> bool {
        self.left_ms == 0 && answers <= 1
    }

    /// Counts one tick, `elapsed_ms` after the last tick, with this number of `answers`. `asked` is `true` if a Move for this tick was sent
    /// and acknowledged. Returns the lateness of the newest answer, ticks.
    pub(super) fn count(&mut self, asked: bool, answers: u8, elapsed_ms: u32) -> u8 {
        if self.left_ms == 0 {
            *self = Self { moves: u8::MAX, ..Self::default() };
        }
        if answers > 1 {
            self.left_ms = LASTS_MS;
            self.most = self.most.max(answers - 1).min(MOST);
        }
        self.left_ms = self.left_ms.saturating_sub(elapsed_ms.min(LASTS_MS.into()) as u16);
        // The Move for this tick was sent in the previous tick. If more than 1 ms has passed since then, its bit is
        // shifted further in the next line.
        let moves = self.moves << 1 | u8::from(asked);
        self.moves = moves.checked_shl(elapsed_ms.saturating_sub(1)).unwrap_or(0);
        // If more answers arrive than Moves are outstanding, the controller has counted some of these answers as
        // lost. The number of outstanding Moves is then zero.
        let outstanding = (self.outstanding + u8::from(asked)).saturating_sub(answers);
        self.outstanding = outstanding.min(self.most);
        self.fewest = self.fewest.min(self.outstanding);
        self.window += 1;
        if self.window >= WINDOW {
            self.outstanding -= self.fewest;
            (self.fewest, self.window) = (self.outstanding, 0);
        }
        self.age()
    }

    /// Corrects the number of outstanding Moves if the newest answer was only `late` ticks late, because some of the outstanding answers
    /// were lost.
    pub(super) fn lost(&mut self, late: u8) {
        let behind = self.moves & !u8::MAX.checked_shl(late.into()).unwrap_or(0);
        self.outstanding = self.outstanding.min(behind.count_ones() as u8);
        self.fewest = self.fewest.min(self.outstanding);
    }

    /// Returns the age of the newest answered Move, ticks. All outstanding Moves were sent after this Move.
    fn age(&self) -> u8 {
        let (mut behind, mut age) = (self.outstanding, 0);
        while age < MOST && (behind > 0 || self.moves >> age & 1 == 0) {
            behind -= self.moves >> age & 1;
            age += 1;
        }
        age
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    /// Data of one tick: `true` if a Move was sent, `true` if its answer is lost, and the lateness of the answer.
    type Sent = (bool, bool, u8);

    /// Returns two values for each tick: the counted lateness, and the real lateness of the newest answer, if an answer arrived.
    fn counted(sent: &[Sent]) -> Vec<(u8, Option<u8>)> {
        let mut lateness = Lateness::default();
        let (mut due, mut last) = (Vec::new(), 0);
        for (tick, (asked, lost, late)) in sent.iter().enumerate() {
            if *asked && !*lost {
                last = last.max(tick + usize::from(*late));
                due.push((tick, last));
            }
        }
        let mut all = Vec::new();
        for (tick, (asked, ..)) in sent.iter().enumerate() {
            let came: Vec<_> = due.iter().filter(|(_, due)| *due == tick).collect();
            let stands = lateness.stands(came.len() as u8);
            let age = if stands { 0 } else { lateness.count(*asked, came.len() as u8, 1) };
            all.push((age, came.last().map(|(sent, _)| (tick - sent) as u8)));
        }
        all
    }

    /// Returns a sequence of `ticks` ticks after a burst of answers in one tick. The burst shows the highest
    /// lateness, which is `most`. After the burst, any lateness up to `most` may occur, some Moves are not sent, and
    /// `lost` of 100 answers are lost. In every 24th tick, no answer is outstanding.
    fn sent(most: u8, lost: u32, ticks: usize) -> impl Strategy<Value = Vec<Sent>> {
        let any = (prop::bool::weighted(0.9), 0..100u32, 0..=most);
        prop::collection::vec(any, ticks).prop_map(move |any| {
            let burst = (0..=most).rev().map(|late| (true, false, late));
            let ran = any
                .into_iter()
                .enumerate()
                .map(|(n, (asked, draw, late))| (asked, draw < lost, late.min((23 - n % 24) as u8)));
            burst.chain(ran).collect()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        /// If no answer is lost, the controller counts the correct lateness for every answer after the burst in the
        /// function `sent`.
        #[test]
        fn j63_unanswered_moves_are_how_late_an_answer_is(sent in (1..=MOST).prop_flat_map(|most| sent(most, 0, 700))) {
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(2 * usize::from(MOST)) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// The controller needs some windows to subtract lost answers. When these windows are over, every counted
        /// lateness must be correct again.
        #[test]
        fn j63_what_was_lost_is_taken_off(
            // The number of outstanding Moves is never above `most`. If `most` answers are late, this number
            // therefore cannot include a lost answer. In the second part of the test, the lateness is at most `most -
            // 1`.
            some in (1..=MOST).prop_flat_map(|most| (sent(most, 20, 240), sent(most - 1, 0, 480))),
        ) {
            let (with, without) = some;
            let sent: Vec<_> = with.into_iter().chain(without).collect();
            let from = 240 + 2 * usize::from(WINDOW) + 3 * 24;
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(from) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// Without two answers in the same tick, the controller counts every missing answer as lost.
        #[test]
        fn j63_without_evidence_nothing_is_late(lost in prop::collection::vec(any::<bool>(), 300)) {
            let sent: Vec<Sent> = lost.into_iter().map(|lost| (true, lost, 0)).collect();
            prop_assert!(counted(&sent).iter().all(|(age, _)| *age == 0));
        }
    }

    /// If ticks were missed, the lateness of an answer includes the missed ticks.
    #[test]
    fn j63_an_answer_is_as_late_as_the_ticks_were_long() {
        for long in 1..=u32::from(MOST) {
            let mut lateness = Lateness::default();
            lateness.count(true, 3, 1);
            assert_eq!(lateness.count(true, 1, 1), 0);
            lateness.count(true, 0, 1);
            assert_eq!(lateness.count(true, 1, long), long as u8);
            // In this tick, the answer to the Move of the previous tick also arrives.
            lateness.count(true, 2, 1);
            assert_eq!(lateness.count(true, 1, long), long as u8 - 1);
        }
    }

    #[test]
    fn j63_evidence_counts_for_a_second() {
        let mut lateness = Lateness::default();
        lateness.count(true, 2, 1);
        for _ in 1..LASTS_MS {
            assert!(!lateness.stands(1));
            lateness.count(true, 1, 1);
        }
        assert!(lateness.stands(0) && lateness.stands(1) && !lateness.stands(2));
        // A long tick is counted as several ticks.
        lateness.count(true, 2, 1);
        lateness.count(true, 1, u32::from(LASTS_MS) + 7);
        assert!(lateness.stands(1));
    }

    /// Until the first evidence of late answers, the controller assumes that every tick has a Move and its answer. If
    /// no Move was sent for the tick of this evidence, the newest answer belongs to the previous Move and is one tick
    /// late.
    #[test]
    fn j63_before_the_first_evidence_each_tick_counts_as_a_tick_with_a_move() {
        assert_eq!(Lateness::default().count(true, 2, 1), 0);
        assert_eq!(Lateness::default().count(false, 2, 1), 1);
    }

    /// The number of outstanding Moves is at most the highest number of late answers in one tick. The controller
    /// discards this bound when the evidence expires.
    #[test]
    fn j63_no_more_moves_are_outstanding_than_answers_were_late_in_one_tick() {
        let mut lateness = Lateness::default();
        for answers in [2, 4, 3, 8, 9, 2] {
            lateness.count(true, answers, 1);
            (0..10).for_each(|_| _ = lateness.count(true, 0, 1));
            // In the tick with several answers, all answers except the last one were late. The highest lateness that
            // the controller counts is 7.
            assert_eq!(lateness.count(true, 1, 1), (answers - 1).min(7), "{answers} answers");
            lateness.count(true, 1, u32::from(LASTS_MS));
            assert!(lateness.stands(1));
        }
    }

    /// A lost answer is subtracted at the end of the next window in which the number of outstanding Moves does not return to zero. A window
    /// has 64 ticks.
    #[test]
    fn j63_a_lost_answer_is_subtracted_at_the_end_of_the_first_whole_window_of_64_ticks() {
        let mut lateness = Lateness::default();
        for tick in 1..=200 {
            // The answer of the second tick is lost. No Move is outstanding in the first tick, so the first window subtracts nothing.
            let answers = match tick {
                1 => 2,
                2 => 0,
                _ => 1,
            };
            let late = lateness.count(true, answers, 1);
            if tick > 2 {
                assert_eq!(late, u8::from(tick < 128), "tick {tick}");
            }
        }
    }

    /// If the newest answer is `late` ticks late, only the Moves that were sent after its Move remain outstanding.
    /// Each set bit of `moves` marks a tick with a Move; bit 0 is the newest tick.
    #[test]
    fn j63_the_moves_before_a_later_answer_are_lost() {
        for (moves, late, outstanding) in [
            (0b1111_1111u8, 0, 0),
            (0b1111_1111, 1, 1),
            (0b1111_1111, 2, 2),
            (0b1111_1111, 3, 3),
            // The correction must not increase the number of outstanding Moves.
            (0b1111_1111, 7, 3),
            // In the last two ticks, one Move was sent.
            (0b1111_1101, 2, 1),
            (0b1111_1110, 2, 1),
            (0b1111_1100, 2, 0),
            (0b1010_1010, 5, 2),
        ] {
            let mut lateness = Lateness { left_ms: 9, outstanding: 3, most: 7, fewest: 3, window: 5, moves };
            lateness.lost(late);
            let found = (lateness.outstanding, lateness.fewest, lateness.moves, lateness.window);
            assert_eq!(found, (outstanding, outstanding, moves, 5), "{moves:#b} {late}");
        }
    }

    /// The highest counted lateness is 7 ticks, even if no Move was sent for a longer time.
    #[test]
    fn j63_a_lateness_of_more_than_seven_ticks_is_not_counted() {
        let mut lateness = Lateness::default();
        lateness.count(true, 2, 1);
        for ticks in 1..=12 {
            assert_eq!(lateness.count(false, 0, 1), ticks.min(7), "{ticks} ticks without a Move");
        }
    }
}
