//! Journal of numbered events. A client that lost its connection requests all events after the last event that it
//! received.
use std::collections::VecDeque;
use std::sync::{Mutex, OnceLock, PoisonError};

use tokio::sync::watch;
use utoipa::ToSchema;

/// Number of events that the journal stores. 4096 events are enough for some hours of work, or for the last minutes of
/// a device that reports often.
const KEPT: usize = 4096;

/// Event of a journal.
pub trait JournalEvent: Clone {
    /// Returns the job that the event belongs to.
    fn job(&self) -> Option<u64>;
}

/// Event with its number and time.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[schema(as = EventObject)]
pub struct Entry<E> {
    /// Number of the event; counts up from 1 as long as this agent runs.
    pub number: u64,
    /// Time of the event by the agent's clock, s since 1970.
    pub unix_s: f64,
    /// Event.
    pub event: E,
}

/// Excerpt of a journal: the events after a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Excerpt<E> {
    /// Events, oldest first.
    pub events: Vec<Entry<E>>,
    /// Number of the event after which the next request continues. The excerpt contains every requested event up to
    /// this number.
    pub last: u64,
    /// `true` if the journal has already dropped some of the requested events.
    pub missed: bool,
}

struct Kept<E> {
    events: VecDeque<Entry<E>>,
    last: u64,
}

/// Callback that receives each event when the event is written.
type Follower<E> = Box<dyn Fn(&E) + Send + Sync>;

/// Stored events of an agent.
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

impl<E: JournalEvent> Journal<E> {
    /// Sets the callback for all later events; the callback runs in the thread that writes the event. Only the first
    /// call of `follow` has an effect.
    pub fn follow(&self, follower: impl Fn(&E) + Send + Sync + 'static) {
        let _ = self.follower.set(Box::new(follower));
    }

    /// Writes an event to the journal.
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
        // The lock of the journal is still held, so the numbers of events are announced in order.
        self.last.send_replace(number);
    }

    /// Returns the number of the last event; 0 before the first event.
    pub fn last(&self) -> u64 {
        *self.last.borrow()
    }

    /// Returns a receiver that announces the number of each new event.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.last.subscribe()
    }

    /// Returns at most `most` events after the number `after`. If `job` is set, returns only the events of this job.
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

    impl JournalEvent for Note {
        fn job(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    /// A client that continues from its last number after a lost connection receives every event once and in order.
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
