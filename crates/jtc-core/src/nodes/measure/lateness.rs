//! How late the answers of a joint are (J-63).
//!
//! An answer does not name the Move that it answers, but those of a node keep their order. So the newest answer is as late as there
//! are Moves behind the one that it answers: those that are *outstanding*. A missing answer may be late or lost, and nothing in what
//! has come distinguishes the two, until two answers come in one tick: the first of them was late. For a second after such
//! *evidence* unanswered Moves count as outstanding, never more of them than have come in together; without it, as lost. Evidence may be
//! wrong: a frame that the bus repeats comes twice.
//! An answer that was lost all the same shows in the long run, because the count does not come back to zero: what it does not fall
//! below is taken off.
use crate::remembered::remembered;

/// How long evidence counts, ms.
const LASTS_MS: u16 = 1_000;
/// Ticks over which the count is to come back to zero.
const WINDOW: u8 = 64;
/// Most that an answer is taken to be late, ticks.
const MOST: u8 = 7;

/// Which Moves of a node are unanswered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lateness {
    /// Time for which the last evidence still counts, ms.
    left_ms: u16,
    /// Moves whose answers may still come.
    outstanding: u8,
    /// As many of them there have been: the answers of one tick, but for the last.
    most: u8,
    /// The fewest of them in this window, and the ticks that it has had.
    fewest: u8,
    window: u8,
    /// In which of the last ticks a Move was sent; the newest is bit 0.
    moves: u8,
}

remembered!(Lateness { left_ms, outstanding, most, fewest, window, moves });

impl Lateness {
    /// No answer is taken for late, and none of so many in a tick is evidence of it: this tick need not be counted.
    pub fn stands(&self, answers: u8) -> bool {
        self.left_ms == 0 && answers <= 1
    }

    /// One tick, `elapsed_ms` after the last, with so many answers; `asked`: a Move was sent for it. Returns how late the newest answer
    /// is, ticks.
    pub fn count(&mut self, asked: bool, answers: u8, elapsed_ms: u32) -> u8 {
        if self.left_ms == 0 {
            *self = Self { moves: u8::MAX, ..Self::default() };
        }
        if answers > 1 {
            self.left_ms = LASTS_MS;
            self.most = self.most.max(answers - 1).min(MOST);
        }
        self.left_ms = self.left_ms.saturating_sub(elapsed_ms.min(LASTS_MS.into()) as u16);
        // The Move was sent in the tick before, however long ago that is.
        let moves = self.moves << 1 | u8::from(asked);
        self.moves = moves.checked_shl(elapsed_ms.saturating_sub(1)).unwrap_or(0);
        // Where there are more answers than Moves, some had been taken for lost.
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

    /// The newest answer was so many ticks late only: of those that were outstanding some were lost.
    pub fn lost(&mut self, late: u8) {
        let behind = self.moves & !u8::MAX.checked_shl(late.into()).unwrap_or(0);
        self.outstanding = self.outstanding.min(behind.count_ones() as u8);
        self.fewest = self.fewest.min(self.outstanding);
    }

    /// How long ago the Move was sent behind which there are as many as are outstanding, ticks.
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

    /// In each tick what is counted, and how late the newest answer really is, if there is one.
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

    /// A burst that shows how late answers may be, and then any; in every 24th tick all that is on its way has come. Moves that were not
    /// sent, and `lost` of a hundred answers for so many ticks.
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

        /// Where none is lost, every answer behind the burst is as late as it is.
        #[test]
        fn j63_unanswered_moves_are_how_late_an_answer_is(sent in (1..=MOST).prop_flat_map(|most| sent(most, 0, 700))) {
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(2 * usize::from(MOST)) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// And where some were, all are again when the windows of the loss are over.
        #[test]
        fn j63_what_was_lost_is_taken_off(
            // Where as many are outstanding as there can be, one more makes no difference: there are fewer.
            some in (1..=MOST).prop_flat_map(|most| (sent(most, 20, 240), sent(most - 1, 0, 480))),
        ) {
            let (with, without) = some;
            let sent: Vec<_> = with.into_iter().chain(without).collect();
            let from = 240 + 2 * usize::from(WINDOW) + 3 * 24;
            for (tick, (age, late)) in counted(&sent).into_iter().enumerate().skip(from) {
                prop_assert!(late.is_none_or(|late| late == age), "tick {tick}: {age}, but {late:?}");
            }
        }

        /// Never two answers in a tick: whatever is missing was lost.
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
