//! What happened, in its order: events with numbers, so that whoever lost the connection asks for those behind the last one it has.
use std::collections::VecDeque;
use std::sync::{Mutex, OnceLock, PoisonError};

use tokio::sync::watch;
use utoipa::ToSchema;

/// Events that are kept: some hours of work, or the last minutes of one that reports much.
const KEPT: usize = 4096;

/// What can happen.
pub trait Happening: Clone {
    /// The job that it is about.
    fn job(&self) -> Option<u64>;
}

/// An event.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[schema(as = EventObject)]
pub struct Entry<E> {
    /// Counts up from 1 as long as this agent runs.
    pub number: u64,
    /// When, s since 1970 by the agent's clock.
    pub unix_s: f64,
    /// What has happened.
    pub event: E,
}

/// Events from a number on.
#[derive(Clone, Debug, PartialEq)]
pub struct Excerpt<E> {
    /// Oldest first.
    pub events: Vec<Entry<E>>,
    /// Up to this one nothing else was asked for: the number to ask on from.
    pub last: u64,
    /// Some that were asked for are not kept any more.
    pub missed: bool,
}

struct Kept<E> {
    events: VecDeque<Entry<E>>,
    last: u64,
}

/// Who sees each event when it is written.
type Follower<E> = Box<dyn Fn(&E) + Send + Sync>;

/// The events of an agent.
pub struct Journal<E> {
    kept: Mutex<Kept<E>>,
    last: watch::Sender<u64>,
    follower: OnceLock<Follower<E>>,
}

impl<E> Default for Journal<E> {
    fn default() -> Self {
        let kept = Kept { events: VecDeque::new(), last: 0 };
        Self { kept: Mutex::new(kept), last: watch::Sender::new(0), follower: OnceLock::new() }
    }
}

impl<E: Happening> Journal<E> {
    /// Has each event from now on seen by `follower`, in the thread that writes it; the first one stays.
    pub fn follow(&self, follower: impl Fn(&E) + Send + Sync + 'static) {
        let _ = self.follower.set(Box::new(follower));
    }

    /// Something has happened.
    pub fn write(&self, event: E) {
        if let Some(follower) = self.follower.get() {
            follower(&event);
        }
        let unix = host_kit::unix_time();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.last += 1;
        let number = kept.last;
        if kept.events.len() == KEPT {
            kept.events.pop_front();
        }
        kept.events.push_back(Entry { number, unix_s: unix.as_secs_f64(), event });
        // In the order of the numbers.
        self.last.send_replace(number);
    }

    /// Number of the last event; 0: there was none.
    pub fn last(&self) -> u64 {
        *self.last.borrow()
    }

    /// Announces each new last number.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.last.subscribe()
    }

    /// At most so many events behind the number `after`, of one job alone where one is given.
    pub fn after(&self, after: u64, job: Option<u64>, most: usize) -> Excerpt<E> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let oldest = kept.events.front().map_or(kept.last + 1, |event| event.number);
        let wanted =
            |event: &&Entry<E>| event.number > after && job.is_none_or(|job| event.event.job() == Some(job));
        let mut found: Vec<Entry<E>> = kept.events.iter().filter(wanted).take(most + 1).cloned().collect();
        let more = found.len() > most;
        found.truncate(most);
        let last = if more { found.last().map_or(after, |event| event.number) } else { kept.last.max(after) };
        Excerpt { events: found, last, missed: after.saturating_add(1) < oldest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone)]
    struct Note(u64);

    impl Happening for Note {
        fn job(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    /// However the connection breaks, asking on from the last number gives every event once and in its order.
    #[test]
    fn events_are_resumed_by_their_numbers() {
        let journal = Journal::default();
        for n in 0..100_u64 {
            journal.write(Note(n % 3));
        }
        for (job, most) in [(None, 7), (Some(1), 7), (Some(2), 1), (None, 1000), (Some(9), 5)] {
            let (mut after, mut seen) = (0, Vec::new());
            loop {
                let excerpt = journal.after(after, job, most);
                assert!(!excerpt.missed && excerpt.events.len() <= most);
                if excerpt.events.is_empty() {
                    assert_eq!(excerpt.last, 100);
                    break;
                }
                after = excerpt.last;
                seen.extend(excerpt.events.into_iter().map(|event| event.number));
            }
            let all: Vec<u64> = (1..=100).filter(|n| job.is_none_or(|job| (n - 1) % 3 == job)).collect();
            assert_eq!(seen, all, "{job:?}, {most} at once");
        }
    }

    #[test]
    fn events_that_are_kept_no_more_are_missed_and_said_to_be() {
        let journal = Journal::default();
        assert!(!journal.after(0, None, 10).missed);
        for _ in 0..KEPT + 5 {
            journal.write(Note(1));
        }
        assert!(journal.after(4, None, 10).missed);
        let kept = journal.after(5, None, KEPT);
        assert!(!kept.missed && kept.events.len() == KEPT && kept.events[0].number == 6);
    }
}
