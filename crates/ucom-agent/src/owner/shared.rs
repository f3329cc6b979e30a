//! State that the owner of a bus shares with its callers: the last known state of the boards, the lease and the Stops.
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use agent_kit::halt::AskedAfter;
use agent_kit::lease::{ClientId, Leases};
use host_kit::owner::Refused;
use tokio::sync::watch;
use ucom::Profile;

use super::Worker;
use super::ask::{Asked, Queue, Tag, cancelled};
use crate::event::{ChainEvent, Journal, Policy};
use crate::jobs::Jobs;
use crate::snapshot::BusSnapshot;

/// Hold-off after a Stop of another client.
const CALM: Duration = Duration::from_secs(3);

/// Time within which several Stops are reported as one event.
const TOGETHER: Duration = Duration::from_millis(100);

/// Error code of a cancelled request. `STOPPED` is the error code of a request that a Stop ended.
pub(super) const CANCELLED: &str = "cancelled";
pub(super) const STOPPED: &str = "stopped";

/// Data of a Stop: the name of its requester, the time, and the client if the requester has a lease key.
#[derive(Clone)]
struct Halt {
    by: String,
    client: Option<ClientId>,
    at: Instant,
}

/// Requesters of the last Stops. The queue of the owner counts the Stops.
#[derive(Default)]
struct Halts {
    /// Time of the last event about Stops. `more` is the number of Stops since that event.
    shown: Option<Instant>,
    more: u64,
    last: Option<Halt>,
    /// Last Stop by a client other than the requester of `last`.
    last_by_another: Option<Halt>,
}

impl Halts {
    fn add(&mut self, by: &str, client: Option<ClientId>) {
        self.more += 1;
        let new = Halt { by: by.to_owned(), client, at: Instant::now() };
        if let Some(old) = self.last.replace(new).filter(|old| old.client != client) {
            self.last_by_another = Some(old);
        }
    }

    /// Returns the name of the requester of the last Stop.
    fn last_by(&self) -> &str {
        self.last.as_ref().map_or("", |halt| halt.by.as_str())
    }

    /// Returns a Stop of another client if its hold-off is still active.
    fn keeps_calm(&self, client: ClientId) -> Option<&Halt> {
        let others = |halt: &&Halt| halt.client != Some(client) && halt.at.elapsed() < CALM;
        self.last.iter().chain(&self.last_by_another).find(others)
    }
}

/// State that the owner of the bus shares with its callers.
pub(crate) struct Shared {
    start: Instant,
    snapshot: Mutex<Arc<BusSnapshot>>,
    changed: watch::Sender<()>,
    pub(super) queue: Queue,
    halts: Mutex<Halts>,
    ended: AtomicBool,
    lost: Mutex<Option<String>>,
    pub journal: Journal,
    pub jobs: Jobs,
    leases: Mutex<Leases<Policy>>,
    /// Lease holder at the time of the last check.
    holder: Mutex<Option<String>>,
    /// `true` from shortly before the first frame that starts a board, until all started boards are stopped.
    pub(super) runs: Arc<AtomicBool>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // After a panic of another thread, the state may be incomplete, but a Stop is more important.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Returns the state for a bus with this protocol profile, before any board is known.
    pub(super) fn new(profile: Profile) -> Self {
        Self {
            start: Instant::now(),
            snapshot: Mutex::new(Arc::new(BusSnapshot::new(profile))),
            changed: watch::Sender::new(()),
            queue: Queue::default(),
            halts: Mutex::default(),
            ended: AtomicBool::new(false),
            lost: Mutex::default(),
            journal: Journal::default(),
            jobs: Jobs::default(),
            leases: Mutex::default(),
            holder: Mutex::default(),
            runs: Arc::default(),
        }
    }

    /// Returns the time since the start of the agent.
    pub(crate) fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// Returns the last snapshot of the boards.
    pub(crate) fn snapshot(&self) -> Arc<BusSnapshot> {
        lock(&self.snapshot).clone()
    }

    /// Returns a receiver that announces each new snapshot.
    pub(crate) fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// Returns the reason why the bus was lost; `None` while the bus is available.
    pub(crate) fn lost(&self) -> Option<String> {
        lock(&self.lost).clone()
    }

    /// Stops all boards before any other request is executed, and checks that the boards have stopped. Returns the number of this Stop.
    pub(crate) fn halt(&self, by: &str, client: Option<ClientId>) -> u64 {
        let act = |worker: Result<&mut Worker, Refused>| {
            if let Ok(worker) = worker {
                worker.see_to_stop();
            }
        };
        let number = {
            // The Stop counter and the requester change under one lock. A thread therefore never reads the number of
            // one Stop together with the requester of another Stop.
            let mut halts = lock(&self.halts);
            halts.add(by, client);
            self.queue.stop_alike(Tag::default(), Box::new(act))
        };
        self.show_halts();
        // The lock is released before `refuse_late` is called, because the refusals contain the name of the requester.
        self.queue.refuse_late();
        number
    }

    /// Returns the number of requested Stops, which is also the number of the last Stop.
    pub(crate) fn halts(&self) -> u64 {
        self.queue.stops()
    }

    /// Returns `true` while a request of this client that may move boards runs or is queued.
    pub(crate) fn moves_for(&self, client: ClientId) -> bool {
        self.queue.has(|tag| tag.moves_for(client))
    }

    /// Creates a request of this client. For a request that may move boards, `after` is the number of the last Stop
    /// that the client knows.
    ///
    /// # Errors
    ///
    /// Only for a request that may move boards: a Stop later than `after` exists, or another client stopped the
    /// boards within the last 3 s.
    pub(crate) fn asked(&self, client: ClientId, after: Option<AskedAfter>) -> Result<Asked, Problem> {
        let halts = lock(&self.halts);
        let count = self.queue.stops();
        if let Some(AskedAfter(after)) = after {
            if count != after {
                return Err(stopped(halts.last_by()));
            }
            if let Some(halt) = halts.keeps_calm(client) {
                return Err(stopped(&halt.by));
            }
        }
        Ok(Asked { client, halt: count, moves: after.is_some() })
    }

    /// Returns the leases and the current time. Ends a lapsed lease and applies its policy before another client can take the lease.
    pub(crate) fn leases(&self) -> (MutexGuard<'_, Leases<Policy>>, Duration) {
        let (mut leases, now) = (lock(&self.leases), self.now());
        let lapsed = leases.lapse(now);
        let holder = leases.lease().map(|lease| lease.holder);
        if std::mem::replace(&mut *lock(&self.holder), holder.clone()) != holder {
            self.journal.write(ChainEvent::Lease { holder });
        }
        if let Some(client) = lapsed
            && client.policy == Policy::Stop
            && (self.runs.load(Ordering::Relaxed) || self.moves_for(client.id))
        {
            self.halt(&format!("the policy of the disconnected client {}", client.name), None);
        }
        (leases, now)
    }
}

/// Functions for the owner of the bus: the thread that runs the bus loop.
impl Shared {
    /// Asks the owner's thread to end.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Returns `true` if the owner's thread must end.
    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Returns `true` if the current request must end.
    pub(super) fn is_cancelled(&self) -> bool {
        self.has_ended() || self.queue.is_cancelled()
    }

    /// Writes events for new Stops: the first Stop at once, and the Stops after it in one event.
    pub(super) fn show_halts(&self) {
        let mut halts = lock(&self.halts);
        if halts.more > 0 && halts.shown.is_none_or(|at| at.elapsed() >= TOGETHER) {
            let by = halts.last_by().to_owned();
            let more = std::mem::take(&mut halts.more);
            halts.shown = Some(Instant::now());
            self.journal.write(ChainEvent::Halt { by, times: Some(more).filter(|more| *more > 1) });
        }
    }

    /// Returns the problem for a request whose client lost the lease before the request was executed.
    pub(super) fn too_late(&self, asked: Asked) -> Option<Problem> {
        let may = !asked.moves || lock(&self.leases).holds(asked.client, self.now());
        (!may).then(|| {
            let message = "the request was not carried out, because its client had lost the lease";
            Problem::new("late", message, "take the lease again and repeat the request")
        })
    }

    /// Returns the problem for a request that is older than the last Stop.
    pub(super) fn stopped(&self) -> Problem {
        stopped(lock(&self.halts).last_by())
    }

    /// Returns the reason why a request was cancelled.
    pub(super) fn why_cancelled(&self) -> Problem {
        match &lock(&self.halts).last {
            Some(halt) if halt.at.elapsed() < CALM => stopped(&halt.by),
            _ => cancelled(),
        }
    }

    /// Returns `true` if a client holds the lease.
    pub(super) fn is_commanded(&self) -> bool {
        lock(&self.leases).lease().is_some()
    }

    /// Publishes a snapshot and then the events. A client that reads an event therefore finds the new state in the snapshot.
    pub(super) fn publish(&self, snapshot: BusSnapshot, happened: Vec<ChainEvent>) {
        *lock(&self.snapshot) = Arc::new(snapshot);
        happened.into_iter().for_each(|event| self.journal.write(event));
        self.changed.send_replace(());
    }

    /// Marks the bus as lost for the reason `why`; queued requests are refused.
    pub(super) fn close(&self, why: String) {
        *lock(&self.lost) = Some(why.clone());
        self.queue.close();
        self.journal.write(ChainEvent::Lost { why });
        self.changed.send_replace(());
    }
}

fn stopped(by: &str) -> Problem {
    let message = format!("{by} has stopped the boards: requests from before the Stop are not carried out");
    Problem::new(STOPPED, message, "wait three seconds, and repeat the request when the boards may move")
}
