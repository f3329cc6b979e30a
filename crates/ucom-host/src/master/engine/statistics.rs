//! Values for a bus monitor: frame rate of each board, bus load, foreign frames.

use crate::master::load::frame_bits;
use std::collections::{BTreeMap, VecDeque};
use ucom::{Foreign, Frame};

/// Time window of the rates, µs.
pub const WINDOW_US: u64 = 1_000_000;
const SLOTS: usize = 10;
const SLOT_US: u64 = WINDOW_US / SLOTS as u64;

/// Rate per second, computed as the sum of the amounts that were added in the last second.
#[derive(Clone, Debug, Default)]
pub struct Rate {
    /// Latest time slots, each with its index and the sum of its amounts.
    slots: VecDeque<(u64, u64)>,
}

impl Rate {
    pub(crate) fn add(&mut self, now: u64, amount: u64) {
        let slot = now / SLOT_US;
        match self.slots.back_mut() {
            Some((last, sum)) if *last == slot => *sum += amount,
            _ => self.slots.push_back((slot, amount)),
        }
        while self.slots.len() > SLOTS + 1 {
            self.slots.pop_front();
        }
    }

    /// Returns the sum of the amounts in the last second before `now`.
    pub fn per_second(&self, now: u64) -> u64 {
        let slot = now / SLOT_US;
        self.slots.iter().filter(|(s, _)| *s <= slot && slot - s < SLOTS as u64).map(|(_, sum)| sum).sum()
    }
}

/// Counters of the frames on the bus.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    bitrate: u32,
    bits: Rate,
    /// Frames received from boards, by board number. A report of a board without a number is counted under the number in its identifier.
    boards: BTreeMap<u8, Rate>,
    /// Number of received frames, except foreign frames.
    pub received: u64,
    /// Number of frames that this PC sent.
    pub sent: u64,
    /// Number of frames that are not of this protocol, by kind.
    pub foreign: Vec<(Foreign, u64)>,
    /// Number of received frames that only a PC sends.
    pub competing_master: u64,
    /// Number of frames of boards that are too short or have impossible contents.
    pub undecodable: u64,
}

impl Statistics {
    pub(crate) fn new(bitrate: u32) -> Self {
        Self { bitrate, ..Default::default() }
    }

    pub(crate) fn sent(&mut self, now: u64, frame: &Frame) {
        self.sent += 1;
        self.bits.add(now, frame_bits(frame.dlc()));
    }

    pub(crate) fn received(&mut self, now: u64, frame: &Frame) {
        self.received += 1;
        self.bits.add(now, frame_bits(frame.dlc()));
        let number = (frame.id() & 31) as u8;
        self.boards.entry(number).or_default().add(now, 1);
    }

    /// Counts a frame that is not of this protocol. The function returns `true` if the frame is the first of its
    /// kind.
    pub(crate) fn foreign(&mut self, now: u64, foreign: Foreign) -> bool {
        self.bits.add(now, frame_bits(8));
        if let Some((_, count)) = self.foreign.iter_mut().find(|(kind, _)| *kind == foreign) {
            *count += 1;
            return false;
        }
        self.foreign.push((foreign, 1));
        true
    }

    /// Returns the number of frames per second from a board.
    pub fn frames_per_s(&self, board: u8, now: u64) -> u64 {
        self.boards.get(&board).map_or(0, |rate| rate.per_second(now))
    }

    /// Returns the bus load of the last second in percent, assuming worst-case bit stuffing.
    pub fn load_percent(&self, now: u64) -> f64 {
        100.0 * self.bits.per_second(now) as f64 / f64::from(self.bitrate.max(1))
    }

    /// Returns the number of foreign frames of all kinds.
    pub fn foreign_count(&self) -> u64 {
        self.foreign.iter().map(|(_, count)| count).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_those_of_the_last_second() {
        let mut rate = Rate::default();
        (0..200).for_each(|i| rate.add(i * 10_000, 3));
        assert_eq!(rate.per_second(1_999_000), 300);
        assert_eq!(rate.per_second(2_499_000), 150);
        assert_eq!(rate.per_second(9_000_000), 0);
    }
}
