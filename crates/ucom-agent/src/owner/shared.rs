//! What the owner of a bus and those who ask it share: the boards as last seen, who commands, and who has stopped the boards.
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use agent_kit::halt::AskedAfter;
use agent_kit::lease::{ClientId, Leases};
use tokio::sync::watch;
use ucom::Profile;

use super::Hands;
use crate::happening::{Happening, Journal, Policy};
use crate::jobs::Jobs;
use crate::picture::Picture;
use crate::work::{Asked, Queue};

/// For so long after somebody else's Stop nothing is begun that moves.
const CALM: Duration = Duration::from_secs(3);

/// Stops that come within this time of one are one event together.
const TOGETHER: Duration = Duration::from_millis(100);

/// Codes of what was cancelled, and of what a Stop has ended.
pub(super) const CANCELLED: &str = "cancelled";
pub(super) const STOPPED: &str = "stopped";

/// A Stop: who asked for it, with the key of a lease or without, and when.
#[derive(Clone)]
struct Halt {
    by: String,
    client: Option<ClientId>,
    at: Instant,
}

/// The Stops that were asked for.
#[derive(Default)]
struct Halts {
    count: u64,
    /// When one was last an event, and how many have come since.
    shown: Option<Instant>,
    more: u64,
    last: Option<Halt>,
    /// The last one by somebody else than who asked for the last one.
    last_by_another: Option<Halt>,
}

impl Halts {
    fn add(&mut self, by: &str, client: Option<ClientId>) {
        self.count += 1;
        self.more += 1;
        let new = Halt { by: by.to_owned(), client, at: Instant::now() };
        if let Some(old) = self.last.replace(new).filter(|old| old.client != client) {
            self.last_by_another = Some(old);
        }
    }

    /// Who asked for the last one.
    fn last_by(&self) -> &str {
        self.last.as_ref().map_or("", |halt| halt.by.as_str())
    }

    /// Somebody else than this client has just stopped the boards.
    fn keeps_calm(&self, client: ClientId) -> Option<&Halt> {
        let others = |halt: &&Halt| halt.client != Some(client) && halt.at.elapsed() < CALM;
        self.last.iter().chain(&self.last_by_another).find(others)
    }
}

/// What the owner and those who ask it share.
pub(crate) struct Shared {
    start: Instant,
    picture: Mutex<Arc<Picture>>,
    changed: watch::Sender<()>,
    pub(super) queue: Queue,
    halts: Mutex<Halts>,
    ended: AtomicBool,
    lost: Mutex<Option<String>>,
    pub journal: Journal,
    pub jobs: Jobs,
    leases: Mutex<Leases<Policy>>,
    /// Who commanded when it was last looked.
    holder: Mutex<Option<String>>,
    /// This agent has started boards: before anything is sent to them, and until they are stopped.
    pub(super) runs: Arc<AtomicBool>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic of another thread leaves no half-done state behind that matters more than a Stop.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Of a bus that nothing is known of but how its boards read the protocol.
    pub(super) fn new(profile: Profile) -> Self {
        Self {
            start: Instant::now(),
            picture: Mutex::new(Arc::new(Picture::new(profile))),
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

    /// Time of the agent.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// The boards as last seen.
    pub fn picture(&self) -> Arc<Picture> {
        lock(&self.picture).clone()
    }

    /// Announces each new picture.
    pub fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// Why the bus is gone; `None` while it is there.
    pub fn lost(&self) -> Option<String> {
        lock(&self.lost).clone()
    }

    /// Stops all boards, ahead of all else, and sees to it that they have stopped.
    /// Returns its number.
    pub fn halt(&self, by: &str, client: Option<ClientId>) -> u64 {
        let number = {
            // Both at once: what goes on ends, and what takes its turn now finds the Stop.
            let mut halts = lock(&self.halts);
            self.queue.cancel_by_stop();
            halts.add(by, client);
            halts.count
        };
        self.show_halts();
        let act = |hands: Result<&mut Hands, Problem>| {
            if let Ok(hands) = hands {
                hands.see_to_stop();
            }
        };
        self.queue.stop(Box::new(act));
        number
    }

    /// How many Stops were asked for until now: the number of the last.
    pub fn halts(&self) -> u64 {
        lock(&self.halts).count
    }

    /// Something goes on or waits that this client asked for, and that moves.
    pub fn moves_for(&self, client: ClientId) -> bool {
        self.queue.moves_for(client)
    }

    /// What this client asks for now. Where something may move by it, it was asked for behind the Stop of the number `after`.
    ///
    /// # Errors
    ///
    /// Something may, and another Stop has come since, whoever asked for that; or somebody else has just stopped the boards.
    pub fn asked(&self, client: ClientId, after: Option<AskedAfter>) -> Result<Asked, Problem> {
        let halts = lock(&self.halts);
        if let Some(AskedAfter(after)) = after {
            if halts.count != after {
                return Err(stopped(halts.last_by()));
            }
            if let Some(halt) = halts.keeps_calm(client) {
                return Err(stopped(&halt.by));
            }
        }
        Ok(Asked { client, halt: halts.count, moves: after.is_some() })
    }

    /// The leases, and the time. One that has lapsed by then has ended, and what it moved follows its policy: before somebody else
    /// takes it.
    pub fn leases(&self) -> (MutexGuard<'_, Leases<Policy>>, Duration) {
        let (mut leases, now) = (lock(&self.leases), self.now());
        let lapsed = leases.lapse(now);
        let holder = leases.lease().map(|lease| lease.holder);
        if std::mem::replace(&mut *lock(&self.holder), holder.clone()) != holder {
            self.journal.write(Happening::Lease { holder });
        }
        if let Some(client) = lapsed
            && client.policy == Policy::Stop
            && (self.runs.load(Ordering::Relaxed) || self.moves_for(client.id))
        {
            self.halt(&format!("the policy of {}, who has gone,", client.name), None);
        }
        (leases, now)
    }
}

/// The owner's side.
impl Shared {
    /// Has the owner end.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// The owner is to end.
    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// What goes on is to end.
    pub(super) fn is_cancelled(&self) -> bool {
        self.has_ended() || self.queue.is_cancelled()
    }

    /// Writes the Stops down that are no event yet: the first one at once, others together.
    pub(super) fn show_halts(&self) {
        let mut halts = lock(&self.halts);
        if halts.more > 0 && halts.shown.is_none_or(|at| at.elapsed() >= TOGETHER) {
            let by = halts.last_by().to_owned();
            let more = std::mem::take(&mut halts.more);
            halts.shown = Some(Instant::now());
            self.journal.write(Happening::Halt { by, times: Some(more).filter(|more| *more > 1) });
        }
    }

    /// Why something is not done any more whose turn has come: a Stop came before it, or its client commands no more.
    pub(super) fn too_late(&self, asked: Asked) -> Option<Problem> {
        {
            let halts = lock(&self.halts);
            if halts.count > asked.halt {
                return Some(stopped(halts.last_by()));
            }
        }
        let may = !asked.moves || lock(&self.leases).holds(asked.client, self.now());
        (!may).then(|| {
            let message = "its client commanded no more when its turn came: it is not done";
            Problem::new("late", message, "take the lease again, and ask again")
        })
    }

    /// Why something was cancelled.
    pub(super) fn why_cancelled(&self) -> Problem {
        match &lock(&self.halts).last {
            Some(halt) if halt.at.elapsed() < CALM => stopped(&halt.by),
            _ => cancelled(),
        }
    }

    /// Somebody has the lease.
    pub(super) fn is_commanded(&self) -> bool {
        lock(&self.leases).lease().is_some()
    }

    /// Shows a new picture, then what has happened: who reads of it finds it there.
    pub(super) fn publish(&self, picture: Picture, happened: Vec<Happening>) {
        *lock(&self.picture) = Arc::new(picture);
        happened.into_iter().for_each(|event| self.journal.write(event));
        self.changed.send_replace(());
    }

    /// The bus is gone, and why; what waits is not done.
    pub(super) fn close(&self, why: String) {
        *lock(&self.lost) = Some(why.clone());
        self.queue.close();
        self.journal.write(Happening::Lost { why });
        self.changed.send_replace(());
    }
}

/// Somebody has cancelled it.
pub(super) fn cancelled() -> Problem {
    Problem::new(CANCELLED, "it was cancelled", "ask for it again")
}

fn stopped(by: &str) -> Problem {
    let message = format!("{by} has stopped the boards: what was asked for before that is not done");
    Problem::new(STOPPED, message, "wait three seconds, and ask again when the boards may move")
}
