//! Timeout for an answer of the controller. Time in which the host computer was too busy to run this program does not
//! count.

use std::time::Duration;

/// Maximum duration of a single wait.
const STEP: Duration = Duration::from_millis(50);

/// Remaining time for an answer. If a wait takes longer than planned, only the planned time is subtracted. A computer
/// that is so busy that it wakes this program late may also have delayed the answer itself.
#[derive(Debug)]
pub(super) struct Limit {
    left: Duration,
}

impl Limit {
    /// Creates a time limit of this length.
    pub(super) fn new(time: Duration) -> Self {
        Self { left: time }
    }

    /// Returns the length of the next wait. Returns `None` if no time is left.
    pub(super) fn next_wait(&self) -> Option<Duration> {
        (!self.left.is_zero()).then(|| self.left.min(STEP))
    }

    /// Subtracts a wait that was planned to last `planned` and lasted `took`.
    pub(super) fn waited(&mut self, planned: Duration, took: Duration) {
        self.left = self.left.saturating_sub(took.min(planned));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the total time of all waits until the limit is used up. Each wait lasts `share` times as long as
    /// planned.
    fn waited(limit_ms: u64, share: f64) -> Duration {
        let mut limit = Limit::new(Duration::from_millis(limit_ms));
        let mut all = Duration::ZERO;
        while let Some(wait) = limit.next_wait() {
            let took = wait.mul_f64(share).max(Duration::from_micros(1));
            limit.waited(wait, took);
            all += took;
        }
        all
    }

    #[test]
    fn a_late_computer_does_not_use_up_the_limit() {
        for limit_ms in [1, 49, 50, 51, 300, 2000] {
            let limit = Duration::from_millis(limit_ms);
            assert_eq!(waited(limit_ms, 1.0), limit);
            assert_eq!(waited(limit_ms, 8.0), limit * 8, "woken late");
            assert!(
                waited(limit_ms, 0.3).abs_diff(limit) < Duration::from_millis(1),
                "woken early, by bytes"
            );
        }
    }
}
