//! Queue of requests to the owner of the bus, which runs one at a time.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use agent_kit::api::Problem;
use agent_kit::lease::ClientId;

use crate::owner::Hands;

/// Largest numbers of waiting commands, and of waiting questions without the lease; questions do not block commands.
const WAITING_MAX: usize = 32;
const QUESTIONS_MAX: usize = 8;

/// Kind of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Question, which moves nothing.
    Question,
    /// Command; a Stop ends it.
    Command,
    /// Update; once begun it is not ended by a Stop, because a board with half-written flash could not work afterwards.
    Update,
    /// Check that each board has stopped.
    Stop,
}

/// Function on the bus; if it is refused, it receives the reason.
pub(crate) type Act = Box<dyn FnOnce(Result<&mut Hands, Problem>) + Send>;

/// Request of the lease holder. Before its turn a Stop may come, or the lease may pass to another client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asked {
    pub client: ClientId,
    /// Number of the last Stop before the request.
    pub halt: u64,
    /// `true` if the request may move boards. Requests that can only end a motion are executed even if their client has
    /// disconnected.
    pub moves: bool,
}

/// Queued request.
pub(crate) struct Work {
    pub kind: Kind,
    /// Number of its job.
    pub job: Option<u64>,
    /// Request of the lease holder; missing: a question without the lease, or a Stop.
    pub asked: Option<Asked>,
    pub act: Act,
}

impl Work {
    /// Returns `true` for a question without the lease.
    fn looks(&self) -> bool {
        self.asked.is_none() && self.kind == Kind::Question
    }
}

/// Current request.
struct Current {
    kind: Kind,
    job: Option<u64>,
    asked: Option<Asked>,
    /// `true` if it must end.
    cancelled: bool,
}

#[derive(Default)]
struct Waiting {
    works: VecDeque<Work>,
    current: Option<Current>,
    /// `true` after the owner has closed the queue.
    closed: bool,
}

/// Cancelled job.
pub(crate) enum Cancelled {
    /// Running job, which undoes its steps.
    Current,
    /// Waiting job, which will not begin.
    Waiting(Work),
}

/// Queue of the owner.
#[derive(Default)]
pub(crate) struct Queue(Mutex<Waiting>);

/// Place in the queue, reserved by its lock.
pub(crate) struct Place<'a>(MutexGuard<'a, Waiting>);

impl Place<'_> {
    /// Puts a request in the place.
    pub fn fill(mut self, work: Work) {
        let works = &mut self.0.works;
        let behind = works.iter().position(|other| other.looks() && !work.looks()).unwrap_or(works.len());
        works.insert(behind, work);
    }
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns a place after all others of its kind; questions without the lease (`looks`) come after all others. While
    /// a job runs or waits, no other request is accepted.
    pub fn place(&self, looks: bool) -> Result<Place<'_>, Problem> {
        let waiting = self.lock();
        if waiting.closed {
            return Err(gone());
        }
        let current = waiting.current.iter().filter_map(|current| current.job);
        if let Some(job) = current.chain(waiting.works.iter().filter_map(|work| work.job)).next() {
            return Err(Problem::new(
                "busy",
                format!("job {job} is going on: one thing at a time"),
                "wait until it is over; a Stop is taken meanwhile, and DELETE /api/jobs/NUMBER cancels it",
            ));
        }
        let most = if looks { QUESTIONS_MAX } else { WAITING_MAX };
        if waiting.works.iter().filter(|work| work.looks() == looks).count() >= most {
            return Err(Problem::new("busy", "too much is asked at once", "ask again in a moment"));
        }
        Ok(Place(waiting))
    }

    /// Puts the check after a Stop in the first place, unless one waits there already.
    pub fn stop(&self, act: Act) {
        let mut waiting = self.lock();
        if !waiting.closed && waiting.works.front().is_none_or(|first| first.kind != Kind::Stop) {
            waiting.works.push_front(Work { kind: Kind::Stop, job: None, asked: None, act });
        }
    }

    /// Takes the next request, which becomes the current one.
    pub fn take(&self) -> Option<Work> {
        let mut waiting = self.lock();
        let work = waiting.works.pop_front();
        waiting.current = work.as_ref().map(|work| {
            let Work { kind, job, asked, .. } = *work;
            Current { kind, job, asked, cancelled: false }
        });
        work
    }

    /// Marks the current request as ended.
    pub fn done(&self) {
        self.lock().current = None;
    }

    /// Returns `true` if the current request must end.
    pub fn is_cancelled(&self) -> bool {
        self.lock().current.as_ref().is_some_and(|current| current.cancelled)
    }

    /// Cancels the current request because of a Stop, unless it is an update.
    pub fn cancel_by_stop(&self) {
        if let Some(current) = &mut self.lock().current {
            current.cancelled |= matches!(current.kind, Kind::Command | Kind::Question);
        }
    }

    /// Returns `true` while a request of this client that may move boards is running or waiting.
    pub fn moves_for(&self, client: ClientId) -> bool {
        let waiting = self.lock();
        let current = waiting.current.iter().filter_map(|current| current.asked);
        let mut all = current.chain(waiting.works.iter().filter_map(|work| work.asked));
        all.any(|asked| asked.moves && asked.client == client)
    }

    /// Cancels a job; `None`: it neither runs nor waits.
    pub fn cancel_job(&self, number: u64) -> Option<Cancelled> {
        let mut waiting = self.lock();
        if let Some(current) = waiting.current.as_mut().filter(|current| current.job == Some(number)) {
            current.cancelled = true;
            return Some(Cancelled::Current);
        }
        let place = waiting.works.iter().position(|work| work.job == Some(number))?;
        waiting.works.remove(place).map(Cancelled::Waiting)
    }

    /// Closes the queue: waiting requests are refused.
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
