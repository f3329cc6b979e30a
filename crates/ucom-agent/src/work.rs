//! What is asked of the owner of the bus, one thing after the other.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use agent_kit::api::Problem;

use crate::owner::Hands;

/// Short things that may wait for their turn.
const WAITING_MAX: usize = 32;

/// What kind of thing it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nothing moves by it.
    Question,
    /// A Stop that comes before it ends it.
    Command,
    /// A Stop does not end it: a board whose flash is half written could not do anything afterwards.
    Update,
    /// Sees to it that each board has stopped.
    Stop,
}

/// Does something with the bus, or takes the reason why it is not done.
pub(crate) type Act = Box<dyn FnOnce(Result<&mut Hands, Problem>) + Send>;

/// A thing to do.
pub(crate) struct Work {
    pub kind: Kind,
    /// The job that it is.
    pub job: Option<u64>,
    /// The last Stop that it was asked for after.
    pub halt: u64,
    pub act: Act,
}

#[derive(Default)]
struct Waiting {
    works: VecDeque<Work>,
    current: Option<(Kind, Option<u64>)>,
    /// The owner takes nothing any more.
    closed: bool,
}

/// What waits for the owner.
#[derive(Default)]
pub(crate) struct Queue(Mutex<Waiting>);

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes its place, a Stop before all else. While a job goes on nothing else is taken.
    pub fn push(&self, work: Work) -> Result<(), Problem> {
        let mut waiting = self.lock();
        if waiting.closed {
            return Err(gone());
        }
        if work.kind == Kind::Stop {
            if waiting.works.front().is_none_or(|first| first.kind != Kind::Stop) {
                waiting.works.push_front(work);
            }
            return Ok(());
        }
        let current = waiting.current.into_iter().filter_map(|(_, job)| job);
        if let Some(job) = current.chain(waiting.works.iter().filter_map(|work| work.job)).next() {
            return Err(Problem::new(
                "busy",
                format!("job {job} is going on: one thing at a time"),
                "wait until it is over; a Stop is taken meanwhile, and DELETE /api/jobs/NUMBER cancels it",
            ));
        }
        if waiting.works.len() >= WAITING_MAX {
            return Err(Problem::new("busy", "too much is asked at once", "ask again in a moment"));
        }
        waiting.works.push_back(work);
        Ok(())
    }

    /// The next one, which is the current one from now on.
    pub fn take(&self) -> Option<Work> {
        let mut waiting = self.lock();
        let work = waiting.works.pop_front();
        waiting.current = work.as_ref().map(|work| (work.kind, work.job));
        work
    }

    /// The current one has ended.
    pub fn done(&self) {
        self.lock().current = None;
    }

    /// What goes on.
    pub fn current(&self) -> Option<(Kind, Option<u64>)> {
        self.lock().current
    }

    /// The owner goes: what waits is not done.
    pub fn close(&self) {
        let works = {
            let mut waiting = self.lock();
            waiting.closed = true;
            std::mem::take(&mut waiting.works)
        };
        works.into_iter().for_each(|work| (work.act)(Err(gone())));
    }
}

fn gone() -> Problem {
    Problem::new(
        "gone",
        "the bus is gone, or the agent ends",
        "GET /api/status shows whether the bus is there",
    )
    .kind(host_kit::ErrorKind::NoLink)
}
