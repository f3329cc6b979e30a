//! What is asked of the owner of the bus, one thing after the other.
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use agent_kit::api::Problem;
use agent_kit::lease::ClientId;

use crate::owner::Hands;

/// Commands that may wait for their turn, and questions of those who look: these keep no command waiting.
const WAITING_MAX: usize = 32;
const QUESTIONS_MAX: usize = 8;

/// What kind of thing it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Nothing moves by it.
    Question,
    /// A Stop that comes before it ends it.
    Command,
    /// A Stop does not end it once it has begun: a board whose flash is half written could not do anything afterwards.
    Update,
    /// Sees to it that each board has stopped.
    Stop,
}

/// Does something with the bus, or takes the reason why it is not done.
pub(crate) type Act = Box<dyn FnOnce(Result<&mut Hands, Problem>) + Send>;

/// What a client asks for that commands. Until its turn a Stop may come, or the lease go to somebody else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asked {
    pub client: ClientId,
    /// The last Stop that it was asked for after.
    pub halt: u64,
    /// Something may move by it. What can only end something is done also for a client that has gone.
    pub moves: bool,
}

/// A thing to do.
pub(crate) struct Work {
    pub kind: Kind,
    /// The job that it is.
    pub job: Option<u64>,
    /// Missing: a question of somebody who looks, or a Stop.
    pub asked: Option<Asked>,
    pub act: Act,
}

impl Work {
    /// Somebody who only looks asks for it.
    fn looks(&self) -> bool {
        self.asked.is_none() && self.kind == Kind::Question
    }
}

/// What goes on.
struct Current {
    kind: Kind,
    job: Option<u64>,
    asked: Option<Asked>,
    /// It is to end.
    cancelled: bool,
}

#[derive(Default)]
struct Waiting {
    works: VecDeque<Work>,
    current: Option<Current>,
    /// The owner takes nothing any more.
    closed: bool,
}

/// A job that is cancelled.
pub(crate) enum Cancelled {
    /// It undoes what it has begun.
    Current,
    /// It will not be begun.
    Waiting(Work),
}

/// What waits for the owner.
#[derive(Default)]
pub(crate) struct Queue(Mutex<Waiting>);

/// A place in the queue, which nobody else takes meanwhile.
pub(crate) struct Place<'a>(MutexGuard<'a, Waiting>);

impl Place<'_> {
    /// Takes it.
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

    /// A place behind all others of its kind: for a question of somebody who `looks` behind all. While a job goes on nothing else is
    /// taken.
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

    /// A Stop takes the first place; one that waits is enough.
    pub fn stop(&self, act: Act) {
        let mut waiting = self.lock();
        if !waiting.closed && waiting.works.front().is_none_or(|first| first.kind != Kind::Stop) {
            waiting.works.push_front(Work { kind: Kind::Stop, job: None, asked: None, act });
        }
    }

    /// The next one, which is the current one from now on.
    pub fn take(&self) -> Option<Work> {
        let mut waiting = self.lock();
        let work = waiting.works.pop_front();
        waiting.current = work.as_ref().map(|work| {
            let Work { kind, job, asked, .. } = *work;
            Current { kind, job, asked, cancelled: false }
        });
        work
    }

    /// The current one has ended.
    pub fn done(&self) {
        self.lock().current = None;
    }

    /// The current one is to end.
    pub fn is_cancelled(&self) -> bool {
        self.lock().current.as_ref().is_some_and(|current| current.cancelled)
    }

    /// A Stop ends what goes on, but for what it does not end.
    pub fn cancel_by_stop(&self) {
        if let Some(current) = &mut self.lock().current {
            current.cancelled |= matches!(current.kind, Kind::Command | Kind::Question);
        }
    }

    /// Something goes on or waits that this client asked for, and that moves.
    pub fn moves_for(&self, client: ClientId) -> bool {
        let waiting = self.lock();
        let current = waiting.current.iter().filter_map(|current| current.asked);
        let mut all = current.chain(waiting.works.iter().filter_map(|work| work.asked));
        all.any(|asked| asked.moves && asked.client == client)
    }

    /// Cancels a job; `None`: it neither goes on nor waits.
    pub fn cancel_job(&self, number: u64) -> Option<Cancelled> {
        let mut waiting = self.lock();
        if let Some(current) = waiting.current.as_mut().filter(|current| current.job == Some(number)) {
            current.cancelled = true;
            return Some(Cancelled::Current);
        }
        let place = waiting.works.iter().position(|work| work.job == Some(number))?;
        waiting.works.remove(place).map(Cancelled::Waiting)
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
