//! Limit on the number of events in any second.

const SECOND_US: u64 = 1_000_000;

/// Times of the last events, at most `N` in any second.
#[derive(Clone, Copy, Debug)]
pub(super) struct RateLimit<const N: usize> {
    /// Times of the last events in a ring; index `next` is the oldest. An entry without an event is `None`.
    times: [Option<u64>; N],
    next: usize,
}

impl<const N: usize> RateLimit<N> {
    pub(super) const fn new() -> Self {
        Self { times: [None; N], next: 0 }
    }

    /// Records an event and returns `true` if the rate limit allows the event now. At most `limit` events (and at most `N`) are allowed in
    /// any second.
    pub(super) fn allow(&mut self, now_us: u64, limit: u32) -> bool {
        let recent = |time: &&Option<u64>| time.is_some_and(|time| now_us.saturating_sub(time) < SECOND_US);
        if self.times.iter().filter(recent).count() >= (limit as usize).min(N) {
            return false;
        }
        if let Some(place) = self.times.get_mut(self.next) {
            *place = Some(now_us);
        }
        self.next = (self.next + 1) % N.max(1);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_more_than_the_limit_in_any_second() {
        let mut limit = RateLimit::<10>::new();
        let mut taken = std::vec::Vec::new();
        for now in (0..5_000_000).step_by(7_000) {
            if limit.allow(now, 10) {
                taken.push(now);
            }
        }
        for (i, start) in taken.iter().enumerate() {
            let within = taken[i..].iter().take_while(|time| **time < start + 1_000_000).count();
            assert!(within <= 10, "{within} from {start}");
        }
        assert!(taken.len() >= 45, "{}", taken.len());
        assert!(!RateLimit::<10>::new().allow(0, 0));
    }

    /// Section 9: the rate limit counts an event that occurred 999 999 µs ago, but not an event that occurred 1 s
    /// ago. The limit never allows more than `N` events in a second.
    #[test]
    fn a_second_is_a_second() {
        let mut limit = RateLimit::<2>::new();
        for (now, allowed) in [
            (7, true),
            (8, true),
            (9, false),
            (1_000_006, false),
            (1_000_007, true),
            (1_000_007, false),
            (1_000_008, true),
            (2_000_006, false),
            (2_000_007, true),
        ] {
            assert_eq!(limit.allow(now, 3), allowed, "{now}");
        }
    }
}
