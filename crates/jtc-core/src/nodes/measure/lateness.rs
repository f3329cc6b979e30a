//! Lateness of the answers of a joint (J-63).
//!
//! An answer does not name the Move that it answers, but the answers of a node keep their order. So the newest answer is late by the number
//! of Moves sent after the Move that it answers: the *outstanding* Moves. A missing answer may be late or lost, and the answers that came
//! do not distinguish the two, until two answers come in one tick: the first of them was late. For a second after such *evidence*
//! unanswered Moves count as outstanding, never more of them than have come in together; without evidence, as lost. Evidence may be wrong:
//! a frame that the bus repeats comes twice. An answer that was lost nevertheless shows in the long run, because the count does not come
//! back to zero: the lowest count of a window is subtracted.
use crate::remembered::remembered;

/// Time for which evidence counts, ms.
const LASTS_MS: u16 = 1_000;
/// Ticks within which the count must come back to zero.
const WINDOW: u8 = 64;
/// Highest lateness of an answer, ticks.
const MOST: u8 = 7;

/// Unanswered Moves of a node.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lateness {
    /// Time for which the last evidence still counts, ms.
    left_ms: u16,
    /// Moves whose answers may still come.
    outstanding: u8,
    /// Upper bound of `outstanding`: the highest number of answers in one tick, less the last, while evidence counts.
    most: u8,
    /// Fewest outstanding Moves in this window, and ticks that the window has had.
    fewest: u8,
    window: u8,
    /// Ticks in which a Move was sent, as a mask of the last ones; the newest is bit 0.
    moves: u8,
}

remembered!(Lateness { left_ms, outstanding, most, fewest, window, moves });

impl Lateness {
    /// Returns `true` if no answer counts as late and the `answers` of a tick, at most one, are not evidence: this tick need not be
    /// counted.
    pub fn stands(&self, answers: u8) -> bool {
        self.left_ms == 0 && answers <= 1
    }

    /// Counts one tick, `elapsed_ms` after the last, with this number of `answers`; `asked`: a Move was sent for it. Returns the lateness
    /// of the newest answer, ticks.
    pub fn count(&mut self, asked: bool, answers: u8, elapsed_ms: u32) -> u8 {
        if self.left_ms == 0 {
            *self = Self { moves: u8::MAX, ..Self::default() };
        }
        if answers > 1 {
            self.left_ms = LASTS_MS;
            self.most = self.most.max(answers - 1).min(MOST);
        }
        self.left_ms = self.left_ms.saturating_sub(elapsed_ms.min(LASTS_MS.into()) as u16);
        // The Move was sent in the previous tick, which may be any time ago.
        let moves = self.moves << 1 | u8::from(asked);
        self.moves = moves.checked_shl(elapsed_ms.saturating_sub(1)).unwrap_or(0);
        // If there are more answers than Moves, some of them had counted as lost.
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

    /// Corrects the count: the newest answer was only `late` ticks late, because some of the outstanding answers were lost.
    pub fn lost(&mut self, late: u8) {
        let behind = self.moves & !u8::MAX.checked_shl(late.into()).unwrap_or(0);
        self.outstanding = self.outstanding.min(behind.count_ones() as u8);
        self.fewest = self.fewest.min(self.outstanding);
    }

    /// Returns the age of the Move after which as many Moves were sent as are outstanding, ticks.
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

    /// A Move that is sent or not, and its answer: lost, or so late.
    type Sent = (bool, bool, u8);

    /// Returns for each tick the counted lateness, and the real lateness of the newest answer, if there is one.
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

    /// A burst that shows how late answers may be, and then any; in every 24th tick all that is on its way has come. Some Moves are not
    /// sent, and `lost` of a hundred answers are lost in these `ticks`.
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

        /// If no answer is lost, the counted lateness of every answer after the burst is the real one.
        #[test]
        fn j63_unanswered_moves_are_how_late_an_answer_is(sent in (1..=MOST).prop_flat_map(|most| sent(most, 0, 700))) {
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(2 * usize::from(MOST)) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// If some answers were lost, every count is right again when the windows of the loss are over.
        #[test]
        fn j63_what_was_lost_is_taken_off(
            // With as many outstanding as possible, one more makes no difference: so there are fewer.
            some in (1..=MOST).prop_flat_map(|most| (sent(most, 20, 240), sent(most - 1, 0, 480))),
        ) {
            let (with, without) = some;
            let sent: Vec<_> = with.into_iter().chain(without).collect();
            let from = 240 + 2 * usize::from(WINDOW) + 3 * 24;
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(from) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// Without two answers in a tick, every missing answer counts as lost.
        #[test]
        fn j63_without_evidence_nothing_is_late(lost in prop::collection::vec(any::<bool>(), 300)) {
            let sent: Vec<Sent> = lost.into_iter().map(|lost| (true, lost, 0)).collect();
            prop_assert!(counted(&sent).iter().all(|(age, _)| *age == 0));
        }
    }

    /// Ticks that did not come make an answer later.
    #[test]
    fn j63_an_answer_is_as_late_as_the_ticks_were_long() {
        for long in 1..=u32::from(MOST) {
            let mut lateness = Lateness::default();
            lateness.count(true, 3, 1);
            assert_eq!(lateness.count(true, 1, 1), 0);
            lateness.count(true, 0, 1);
            assert_eq!(lateness.count(true, 1, long), long as u8);
            // And the answer to the Move of the tick before.
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
        // A long tick is as many.
        lateness.count(true, 2, 1);
        lateness.count(true, 1, u32::from(LASTS_MS) + 7);
        assert!(lateness.stands(1));
    }
}
