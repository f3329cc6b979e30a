//! The last usable answers of a joint, and the rate of their positions.
use crate::DT;

/// Answers that are kept, and milliseconds over which a rate is taken at least.
const WINDOW: usize = 5;
const WINDOW_MS: u32 = 5;
/// One over the time that it is taken over while no answer is lost, 1/s.
const PER_WINDOW: f64 = 1.0 / (WINDOW_MS as f64 * DT);

/// A usable answer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Answered {
    /// rad.
    pub position: f64,
    /// When it came, ms.
    pub at_ms: u32,
}

impl Answered {
    /// Milliseconds after another one.
    fn since(&self, other: &Self) -> u32 {
        self.at_ms.wrapping_sub(other.at_ms)
    }
}

/// A rate of positions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    /// rad/s.
    pub rad_s: f64,
    /// Every answer after the one that it is taken from was about where it had been predicted.
    pub as_predicted: bool,
}

/// The last answers, in a ring.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct History {
    answers: [Answered; WINDOW],
    /// Where the next one goes: the oldest is there, once there are so many.
    next: u8,
    /// How many there are.
    known: u8,
    /// Which were about where they had been predicted; the newest is bit 0.
    as_predicted: u8,
}

impl History {
    /// Keeps an answer in place of the oldest.
    pub fn push(&mut self, answer: Answered, as_predicted: bool) {
        if let Some(slot) = self.answers.get_mut(usize::from(self.next)) {
            *slot = answer;
        }
        self.next = if usize::from(self.next) + 1 < WINDOW { self.next + 1 } else { 0 };
        self.known = self.known.saturating_add(1).min(WINDOW as u8);
        self.as_predicted = self.as_predicted << 1 | u8::from(as_predicted);
    }

    /// The rate from the youngest answer that is old enough to `now`; `None` when there is none.
    pub fn rate_to(&self, now: &Answered) -> Option<Rate> {
        // Nearly always there is an answer in each millisecond, so that the oldest is old enough, and it alone.
        let (oldest, next) = (self.nth(WINDOW - 1), self.nth(WINDOW - 2));
        let calm =
            self.known == WINDOW as u8 && now.since(oldest) == WINDOW_MS && now.since(next) < WINDOW_MS;
        if !calm {
            return self.rate_over_gaps(now);
        }
        let as_predicted = self.younger_as_predicted(WINDOW - 1);
        Some(Rate { rad_s: (now.position - oldest.position) * PER_WINDOW, as_predicted })
    }

    /// The same where answers have been lost.
    #[cold]
    fn rate_over_gaps(&self, now: &Answered) -> Option<Rate> {
        let n = (0..usize::from(self.known)).find(|&n| now.since(self.nth(n)) >= WINDOW_MS)?;
        let way = now.position - self.nth(n).position;
        let seconds = f64::from(now.since(self.nth(n))) * DT;
        Some(Rate { rad_s: way / seconds, as_predicted: self.younger_as_predicted(n) })
    }

    /// The `n` newest answers were about where they had been predicted.
    fn younger_as_predicted(&self, n: usize) -> bool {
        let younger = (1u8 << n) - 1;
        self.as_predicted & younger == younger
    }

    /// The answer before which `n` younger ones came.
    fn nth(&self, n: usize) -> &Answered {
        let behind = usize::from(self.next) + WINDOW - 1 - n.min(WINDOW - 1);
        // An index of this type's own; the first slot stands in rather than a panic.
        let at = if behind < WINDOW { behind } else { behind - WINDOW };
        self.answers.get(at).unwrap_or(&self.answers[0])
    }
}
