//! What happened, in its order: events with numbers, so that whoever lost the connection asks for those behind the last one it has.
use std::collections::VecDeque;
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

use tokio::sync::watch;
use utoipa::ToSchema;

use crate::api::ErrorObject;

/// Events that are kept: some hours of work, or the last minutes of one that reports much.
const KEPT: usize = 4096;

/// What has happened.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Happening {
    /// Another client commands, or nobody does.
    Lease {
        /// Its name; missing: nobody commands.
        #[serde(skip_serializing_if = "Option::is_none")]
        holder: Option<String>,
    },
    /// Somebody stopped or paused the arm.
    Halt {
        /// `stop` or `pause`.
        command: String,
        /// Who it was.
        by: String,
    },
    /// The controller reports another state, or other errors.
    State {
        /// State, in the words of the protocol.
        state: String,
        /// What becomes of the trajectory.
        trajectory: String,
        /// Errors now.
        errors: Vec<String>,
    },
    /// The port is gone.
    Lost {
        /// Why.
        why: String,
    },
    /// A job began.
    Begun {
        /// Its number.
        job: u64,
        /// What it does.
        what: String,
        /// Who asked for it.
        client: String,
    },
    /// Something to know about a job.
    Note {
        /// Its number.
        job: u64,
        /// In words.
        text: String,
    },
    /// A motion passed the check.
    Checked {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// s.
        duration_s: f64,
        /// Points.
        points: usize,
        /// What does not forbid to run it.
        warnings: Vec<String>,
    },
    /// A motion is being uploaded.
    Uploading {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// Segments that the controller has.
        segments_done: usize,
        /// Of so many.
        segments: usize,
    },
    /// The controller has it.
    Uploaded {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// How long that took, s.
        time_s: f64,
        /// Bytes on the line.
        bytes: usize,
        /// Segments that were sent again.
        retries: u32,
    },
    /// The arm begins to move.
    Executing {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// s, at full speed.
        duration_s: f64,
    },
    /// The arm moves, reported once a second.
    Moving {
        /// The job.
        job: u64,
        /// `approach` or `motion`.
        phase: String,
        /// The 1 ms point that the controller is at.
        point: u32,
    },
    /// A motion of a job came to its end.
    Finished {
        /// The job.
        job: u64,
        /// How many motions of this job were finished, approaches not counted.
        runs: u32,
    },
    /// A job is over.
    Ended {
        /// Its number.
        job: u64,
        /// `finished`, `stopped` or `failed`.
        outcome: String,
        /// Why it failed.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<ErrorObject>,
    },
}

impl Happening {
    /// The job that it is about.
    pub fn job(&self) -> Option<u64> {
        match self {
            Self::Lease { .. } | Self::Halt { .. } | Self::State { .. } | Self::Lost { .. } => None,
            Self::Begun { job, .. }
            | Self::Note { job, .. }
            | Self::Checked { job, .. }
            | Self::Uploading { job, .. }
            | Self::Uploaded { job, .. }
            | Self::Executing { job, .. }
            | Self::Moving { job, .. }
            | Self::Finished { job, .. }
            | Self::Ended { job, .. } => Some(*job),
        }
    }
}

/// An event.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct EventObject {
    /// Counts up from 1 as long as this agent runs.
    pub number: u64,
    /// When, s since 1970 by the agent's clock.
    pub unix_s: f64,
    /// What has happened.
    pub event: Happening,
}

/// Events from a number on.
#[derive(Clone, Debug, PartialEq)]
pub struct Excerpt {
    /// Oldest first.
    pub events: Vec<EventObject>,
    /// Up to this one nothing else was asked for: the number to ask on from.
    pub last: u64,
    /// Some that were asked for are not kept any more.
    pub missed: bool,
}

struct Kept {
    events: VecDeque<EventObject>,
    last: u64,
}

/// The events of an agent.
pub struct Journal {
    kept: Mutex<Kept>,
    last: watch::Sender<u64>,
}

impl Default for Journal {
    fn default() -> Self {
        let kept = Kept { events: VecDeque::new(), last: 0 };
        Self { kept: Mutex::new(kept), last: watch::Sender::new(0) }
    }
}

impl Journal {
    /// Something has happened.
    pub fn write(&self, event: Happening) {
        let unix = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.last += 1;
        let number = kept.last;
        if kept.events.len() == KEPT {
            kept.events.pop_front();
        }
        kept.events.push_back(EventObject { number, unix_s: unix.as_secs_f64(), event });
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
    pub fn after(&self, after: u64, job: Option<u64>, most: usize) -> Excerpt {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let oldest = kept.events.front().map_or(kept.last + 1, |event| event.number);
        let wanted = |event: &&EventObject| {
            event.number > after && job.is_none_or(|job| event.event.job() == Some(job))
        };
        let mut found: Vec<EventObject> = kept.events.iter().filter(wanted).take(most + 1).cloned().collect();
        let more = found.len() > most;
        found.truncate(most);
        let last = if more { found.last().map_or(after, |event| event.number) } else { kept.last.max(after) };
        Excerpt { events: found, last, missed: after + 1 < oldest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(job: u64, text: &str) -> Happening {
        Happening::Note { job, text: text.into() }
    }

    /// However the connection breaks, asking on from the last number gives every event once and in its order.
    #[test]
    fn events_are_resumed_by_their_numbers() {
        let journal = Journal::default();
        for n in 0..100_u64 {
            journal.write(note(n % 3, &n.to_string()));
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
        for n in 0..KEPT as u64 + 5 {
            journal.write(note(1, &n.to_string()));
        }
        assert!(journal.after(4, None, 10).missed);
        let kept = journal.after(5, None, KEPT);
        assert!(!kept.missed && kept.events.len() == KEPT && kept.events[0].number == 6);
    }
}
