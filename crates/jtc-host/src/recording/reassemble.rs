//! Reassembly of samples from messages, in time order. The messages may be in any order in the file.

use std::collections::VecDeque;

use crate::sample::Sample;

/// An incomplete sample.
struct Reassembled {
    time_ns: u64,
    sample: Sample,
    /// Topics whose message of this sample was received, as a mask with one bit for each topic.
    came: u8,
}

/// Reassembler of samples. Its buffer contains at most `room` incomplete samples. If the buffer is full, the oldest
/// sample is released, because no more of its messages are expected.
///
/// In a recording of this project, the messages of a sample follow each other. A program that rewrites a file may
/// group the messages by topic. The reassembler can still match messages whose distance in the file is at most one
/// chunk.
pub(super) struct Reassembler {
    /// Incomplete samples, sorted by time.
    waiting: VecDeque<Box<Reassembled>>,
    room: usize,
    /// Time of the last released sample.
    given_ns: Option<u64>,
    /// Largest number of messages received for a sample so far.
    most: u32,
    spare: Option<Box<Reassembled>>,
}

/// Error for a message that arrives too late: its sample, or a later sample, was already released.
#[derive(Debug)]
pub(super) struct Late;

impl Reassembler {
    /// Creates a buffer for `room` incomplete samples.
    pub(super) fn new(room: usize) -> Self {
        Self { waiting: VecDeque::new(), room, given_ns: None, most: 0, spare: None }
    }

    /// Returns the sample at time `time_ns`, to which the message `bit` belongs. If a sample must be released to make space, the sample is
    /// passed to `give`.
    pub(super) fn at(
        &mut self,
        time_ns: u64,
        bit: u8,
        give: &mut dyn FnMut(u64, Sample),
    ) -> Result<&mut Sample, Late> {
        let behind = self.waiting.back().is_none_or(|last| last.time_ns < time_ns);
        let i = if behind {
            self.make_room(give);
            self.waiting.len()
        } else {
            self.waiting.partition_point(|waiting| waiting.time_ns < time_ns)
        };
        if self.waiting.get(i).is_none_or(|found| found.time_ns != time_ns) {
            if self.given_ns.is_some_and(|given| time_ns <= given) {
                return Err(Late);
            }
            let mut new = self
                .spare
                .take()
                .unwrap_or_else(|| Box::new(Reassembled { time_ns, sample: Sample::default(), came: 0 }));
            *new = Reassembled { time_ns, sample: Sample::default(), came: 0 };
            self.waiting.insert(i, new);
        }
        let Some(found) = self.waiting.get_mut(i) else { return Err(Late) };
        found.came |= bit;
        self.most = self.most.max(found.came.count_ones());
        Ok(&mut found.sample)
    }

    fn make_room(&mut self, give: &mut dyn FnMut(u64, Sample)) {
        if self.waiting.len() >= self.room
            && let Some(first) = self.waiting.pop_front()
        {
            self.given_ns = Some(first.time_ns);
            give(first.time_ns, first.sample);
            self.spare = Some(first);
        }
    }

    /// Returns `true` if no message has been received.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.is_empty() && self.given_ns.is_none()
    }

    /// Releases the remaining samples at the end of the file. If messages of the last sample are missing in a truncated file (`cut`), the
    /// last sample is discarded.
    pub(super) fn finish(mut self, cut: bool, give: &mut dyn FnMut(u64, Sample)) {
        if cut && self.waiting.back().is_some_and(|last| last.came.count_ones() < self.most) {
            self.waiting.pop_back();
        }
        for waiting in self.waiting {
            give(waiting.time_ns, waiting.sample);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Reassembles samples from messages, with a buffer of `room` samples. Each message consists of a time and the bit
    /// of its topic. The function checks that each sample has the messages of both topics. The function returns the
    /// times of the samples in the order of their release.
    fn gathered(messages: &[(u64, u8)], room: usize) -> Result<Vec<u64>, Late> {
        let mut gatherer = Reassembler::new(room);
        let mut given = Vec::new();
        let mut give = |time: u64, sample: Sample| given.push((time, sample.point));
        for (time, bit) in messages {
            gatherer.at(*time, *bit, &mut give)?.point |= u32::from(*bit);
        }
        gatherer.finish(false, &mut give);
        assert!(given.iter().all(|(_, bits)| *bits == 0b11));
        Ok(given.into_iter().map(|(time, _)| time).collect())
    }

    proptest! {
        #[test]
        fn topics_apart_come_together_in_order(n in 1_usize..40, piece in 1_usize..10) {
            let times: Vec<u64> = (0..n as u64).map(|i| 10 * i).collect();
            let apart: Vec<(u64, u8)> = times
                .chunks(piece)
                .flat_map(|piece| [1, 2].into_iter().flat_map(move |bit| piece.iter().map(move |t| (*t, bit))))
                .collect();
            prop_assert_eq!(gathered(&apart, piece).unwrap(), times.clone());
            let backwards: Vec<(u64, u8)> =
                times.chunks(piece).flat_map(|piece| piece.iter().rev().flat_map(|t| [(*t, 1), (*t, 2)])).collect();
            prop_assert_eq!(gathered(&backwards, piece).unwrap(), times);
        }
    }

    #[test]
    fn a_message_that_comes_too_late_is_an_error() {
        let messages = [(0, 1), (1, 3), (2, 3), (3, 3), (0, 2)];
        assert_eq!(gathered(&messages, 4).unwrap(), [0, 1, 2, 3]);
        assert!(gathered(&messages, 3).is_err());
    }
}
