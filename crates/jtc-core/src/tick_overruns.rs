//! Late and missing ticks (J-12). A few late ticks are tolerated, but ten within a second are a failure of the device.
use crate::bit_codec::bit_codec;

/// Number of late ticks within the window that counts as a failure of the device.
const COUNT: usize = 10;
/// Length of the window, ms. If the time between the first and the last of [`COUNT`] late ticks is shorter than the window, the device has
/// failed.
const WINDOW_MS: u64 = 1_000;

/// Times of the last late or missing ticks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickOverruns {
    now_ms: u64,
    /// Ring buffer with the times of the last late ticks. Empty entries contain times that are outside the window.
    at_ms: [u64; COUNT],
    next: usize,
}

bit_codec!(TickOverruns { now_ms, at_ms, next });

impl Default for TickOverruns {
    fn default() -> Self {
        Self { now_ms: WINDOW_MS, at_ms: [0; COUNT], next: 0 }
    }
}

impl TickOverruns {
    /// Records one tick, before which `missed` ticks were missing or late. Returns `true` if too many ticks were missing or late.
    pub(crate) fn count(&mut self, missed: u16) -> bool {
        self.now_ms += 1 + u64::from(missed);
        let mut too_many = false;
        for _ in 0..usize::from(missed).min(COUNT) {
            if let Some(slot) = self.at_ms.get_mut(self.next) {
                *slot = self.now_ms;
            }
            self.next = (self.next + 1) % COUNT;
            // The entry `next` now contains the oldest of the last ten times.
            too_many |= self.at_ms.get(self.next).is_some_and(|oldest| self.now_ms - oldest < WINDOW_MS);
        }
        too_many
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the tick in which the number of late ticks becomes too high, if every `n`-th tick comes after `missed` missing ticks.
    fn until_too_many(n: u32, missed: u16) -> Option<u32> {
        let mut late = TickOverruns::default();
        (1..20_000).find(|tick| late.count(if tick % n == 0 { missed } else { 0 }))
    }

    #[test]
    fn j12_ten_late_ticks_within_a_second_are_too_many() {
        assert_eq!(until_too_many(1, 1), Some(10));
        assert_eq!(until_too_many(2, 1), Some(20), "every second or third one");
        assert_eq!(until_too_many(100, 1), Some(1000), "the tenth 909 ms after the first");
        // With a late tick every 112 ms, the first and the tenth late tick are 1008 ms apart.
        assert_eq!(until_too_many(111, 1), None);
        assert_eq!(until_too_many(109, 1), Some(1090));
        // If several ticks are missing at once, each of them is counted.
        assert_eq!(until_too_many(50, 5), Some(100));
        assert_eq!(until_too_many(1_500, 9), None);
        assert_eq!(until_too_many(1_500, 10), Some(1_500));
        assert_eq!(until_too_many(1_500, u16::MAX), Some(1_500));
    }

    #[test]
    fn j12_ten_late_ticks_in_exactly_a_second_are_borne() {
        // Nine late ticks, each with 2 ms, are followed by `between` ticks on time and the tenth late tick. The first
        // and the tenth late tick are then 18 + `between` ms apart. This is a failure only if the time is less than a
        // second.
        for (between, too_many) in [(981, true), (982, false)] {
            let mut late = TickOverruns::default();
            assert!(!(0..9).any(|_| late.count(1)));
            assert!(!(0..between).any(|_| late.count(0)));
            assert_eq!(late.count(1), too_many, "{} ms", 18 + between);
        }
    }
}
