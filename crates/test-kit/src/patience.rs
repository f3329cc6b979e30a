//! Timeouts of tests. All tests use the same timeout, which becomes longer while the computer is slow.
use std::fmt::Display;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Timeout of a test on a computer that causes no delays.
const TIME: Duration = Duration::from_secs(60);
/// Maximum timeout of a test on any computer. Blocking reads use this timeout.
pub const LONGEST: Duration = Duration::from_secs(300);
/// Time between two checks of a condition.
const PAUSE: Duration = Duration::from_millis(20);
/// Growth of the timeout, in seconds for each second that the computer delays the waiting thread.
const GROWTH: u32 = 4;

/// Wait of a test for a condition. If the computer delays the waiting thread, the timeout grows, because the awaited
/// programs are then delayed too.
#[derive(Debug)]
pub struct Patience {
    begun: Instant,
    late: Duration,
}

impl Patience {
    /// Begins a wait.
    pub fn begin() -> Self {
        Self { begun: Instant::now(), late: Duration::ZERO }
    }

    /// Sleeps for 20 ms before the next check. Panics with the text `missing` after the timeout. The text is
    /// formatted only in this case.
    #[track_caller]
    pub fn pause(&mut self, missing: impl Display) {
        self.wait(missing, std::thread::sleep);
    }

    /// Like `pause`, but calls `wait` instead of sleeping. `wait` blocks for at most the time that is passed to it. Returns the result
    /// of `wait`.
    #[track_caller]
    pub fn wait<T>(&mut self, missing: impl Display, wait: impl FnOnce(Duration) -> T) -> T {
        let (waited, late) = (self.begun.elapsed(), self.late);
        assert!(waited < self.limit(), "waited {waited:.1?} (pauses {late:.1?} late) for {missing}");
        self.slice(wait)
    }

    /// Receives the next value of a channel. Returns `None` after the timeout, or if all senders were dropped.
    pub fn receive<T>(&mut self, from: &Receiver<T>) -> Option<T> {
        while self.begun.elapsed() < self.limit() {
            match self.slice(|time| from.recv_timeout(time)) {
                Err(RecvTimeoutError::Timeout) => {}
                received => return received.ok(),
            }
        }
        None
    }

    fn slice<T>(&mut self, wait: impl FnOnce(Duration) -> T) -> T {
        let begun = Instant::now();
        let observed = wait(PAUSE);
        self.late += begun.elapsed().saturating_sub(PAUSE);
        observed
    }

    fn limit(&self) -> Duration {
        LONGEST.min(TIME + GROWTH * self.late)
    }
}

/// Waits until `reached` returns `true`. Panics with `what` after the timeout.
#[track_caller]
pub fn until(what: impl Display, mut reached: impl FnMut() -> bool) {
    let mut patience = Patience::begin();
    while !reached() {
        patience.pause(&what);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_grows_while_the_computer_is_late() {
        let limit = |late| Patience { late: Duration::from_secs(late), ..Patience::begin() }.limit();
        assert_eq!([0, 2, 1000].map(limit), [TIME, TIME + Duration::from_secs(8), LONGEST]);
    }

    #[test]
    #[should_panic = "(pauses 0.0ns late) for frame 1 of 2"]
    fn the_message_has_what_is_missing() {
        let begun = Instant::now().checked_sub(TIME).expect("the computer has run for a minute");
        Patience { begun, late: Duration::ZERO }.pause(format_args!("frame {} of 2", 1));
    }
}
