//! What the thread that owns a session and its callers share: what is asked of it, what has happened, who reads samples.

use std::collections::{BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use serde_json::{Value, json};
use ucom_host::master::io::Snapshot;
use ucom_host::session::Known;

use super::alarms::Alarms;
use super::hands::Hands;
use crate::error::Failure;

/// Events that are kept, newest last.
const EVENTS_MAX: usize = 4096;
/// Samples that wait for their reader.
const SAMPLES_MAX: usize = 65_536;

/// The kind of events with what an update has made of a board.
pub const UPDATED: &str = "updated";

/// What kind of thing is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A stop ends it.
    Command,
    /// A stop does not end it: a board whose flash is half written could do nothing afterwards.
    Update,
    /// It ends what runs.
    Stop,
}

/// Control loops that are to end before all else that is sent.
pub enum Halt {
    All,
    Boards(Vec<u8>),
    /// Those of the boards that this session has started.
    Started,
}

/// Does something with the session, or takes the reason why it is not done.
pub type Act = Box<dyn FnOnce(Result<&mut Hands, Failure>) + Send>;

/// A thing to do.
pub struct Work {
    pub id: u64,
    pub kind: Kind,
    pub act: Act,
}

#[derive(Default)]
struct Queue {
    works: VecDeque<Work>,
    /// What goes on, and whether it is to end.
    current: Option<(u64, Kind, bool)>,
    /// Nothing is taken any more, for this reason.
    closed: Option<Failure>,
}

/// All outputs of a board at one time.
pub struct Sample {
    pub known: Arc<Known>,
    pub snapshot: Snapshot,
}

/// Who reads samples.
pub struct Listener {
    /// Of these boards.
    pub boards: BTreeSet<u8>,
    /// What waits, and how many were dropped.
    waiting: Mutex<(VecDeque<Sample>, u64)>,
    arrived: Condvar,
}

impl Listener {
    pub fn new(boards: BTreeSet<u8>) -> Self {
        Self { boards, waiting: Mutex::default(), arrived: Condvar::new() }
    }

    /// The next sample; waits at most so long.
    pub fn next(&self, patience: Duration) -> Option<Sample> {
        let waiting = lock(&self.waiting);
        let waited = self.arrived.wait_timeout_while(waiting, patience, |(samples, _)| samples.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.0.pop_front()
    }

    /// Samples that were dropped, as nobody took them in time.
    pub fn dropped(&self) -> u64 {
        lock(&self.waiting).1
    }
}

/// What the thread and its callers share.
#[derive(Default)]
pub struct Shared {
    queue: Mutex<Queue>,
    halts: Mutex<Vec<Halt>>,
    ended: AtomicBool,
    next_id: AtomicU64,
    events: Mutex<(u64, VecDeque<Value>)>,
    pub alarms: Alarms,
    listeners: Mutex<Vec<Weak<Listener>>>,
    asked_at: Mutex<Option<Instant>>,
    /// Boards that the session has started, also for who comes when its thread is gone.
    started: Mutex<Vec<u8>>,
    /// Boards whose end is not certain.
    not_stopped: Mutex<Vec<u8>>,
    seen: Mutex<Value>,
}

/// Also where a thread has panicked meanwhile: nothing is left half changed.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A failure of the session itself.
pub fn failure(kind: ErrorKind, code: &'static str, message: &str, next: &'static str) -> Failure {
    Failure::new(kind, code, message).next(next)
}

fn stopped() -> Failure {
    failure(ErrorKind::Fault, "cancelled", "a stop came before its turn: it is not done", "")
}

/// The process in which something was begun: one that was forked from it has its memory, and none of its threads.
pub struct Process(u32);

impl Process {
    /// This one.
    pub fn this() -> Self {
        Self(std::process::id())
    }

    /// It is this one.
    pub fn is_this(&self) -> bool {
        self.0 == std::process::id()
    }
}

/// What should never happen has.
pub fn fault() -> Failure {
    failure(ErrorKind::Fault, "fault", "the thread of the chain has a fault", "connect again")
}

impl Shared {
    /// What goes on is to end.
    pub fn is_cancelled(&self) -> bool {
        self.has_ended() || lock(&self.queue).current.is_some_and(|(_, _, cancelled)| cancelled)
    }

    /// A number for the next thing to do.
    pub fn next_id(&self) -> u64 {
        self.next_id.fetch_add(1, Ordering::Relaxed)
    }

    /// Has the session end.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Control loops are to end before all else that is sent.
    pub fn halt(&self, halt: Halt) {
        lock(&self.halts).push(halt);
    }

    /// Boards that the session has started.
    pub fn has_started(&self, boards: Vec<u8>) {
        *lock(&self.started) = boards;
    }

    /// The thread has a fault: nobody has stopped what was started.
    pub fn all_left(&self) {
        self.left(std::mem::take(&mut *lock(&self.started)));
    }

    /// Boards whose end is not certain, at the end of the session.
    pub fn left(&self, boards: Vec<u8>) {
        *lock(&self.not_stopped) = boards;
    }

    /// The same, once.
    pub fn take_left(&self) -> Vec<u8> {
        std::mem::take(&mut *lock(&self.not_stopped))
    }

    /// The session is to end.
    pub fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Control loops that are to end now.
    pub fn halts(&self) -> Vec<Halt> {
        std::mem::take(&mut *lock(&self.halts))
    }

    /// A stop waits for its turn.
    pub fn stop_waits(&self) -> bool {
        lock(&self.queue).works.front().is_some_and(|work| work.kind == Kind::Stop)
    }

    /// Something happened.
    pub fn event(&self, time_s: f64, kind: &str, board: Option<u8>, text: String) {
        let mut events = lock(&self.events);
        events.0 += 1;
        let number = events.0;
        let text = text.replace('`', "");
        events.1.push_back(
            json!({ "number": number, "time_s": time_s, "kind": kind, "board": board, "text": text }),
        );
        if events.1.len() > EVENTS_MAX {
            events.1.pop_front();
        }
    }

    /// The number of the last event.
    pub fn last_event(&self) -> u64 {
        lock(&self.events).0
    }

    /// Events with higher numbers, oldest first.
    pub fn events(&self, after: u64) -> Value {
        self.asked();
        let events = lock(&self.events);
        events.1.iter().filter(|event| event["number"].as_u64() > Some(after)).cloned().collect()
    }

    /// What updates have made of boards since this event.
    pub fn outcomes(&self, after: u64) -> Vec<String> {
        let events = self.events(after);
        let of_updates = events.as_array().into_iter().flatten().filter(|event| event["kind"] == UPDATED);
        of_updates.filter_map(|event| Some(event["text"].as_str()?.to_owned())).collect()
    }

    /// The bus as it was last seen.
    pub fn seen(&self, value: Value) {
        *lock(&self.seen) = value;
    }

    /// Load and frames of the bus.
    pub fn bus(&self) -> Value {
        self.asked();
        lock(&self.seen).clone()
    }

    /// Nothing was asked for so long, while boards ran: they were stopped, but for those whose end is not certain.
    pub fn deadline(&self, time_s: f64, deadline: Duration, not_stopped: &[u8]) {
        let mut text = format!(
            "nothing was asked of the chain for {} s: its boards are stopped",
            deadline.as_secs_f64()
        );
        if !not_stopped.is_empty() {
            let numbers: Vec<String> = not_stopped.iter().map(u8::to_string).collect();
            text += &format!(", not for certain: board {}", numbers.join(", "));
        }
        self.event(time_s, "deadline", None, text.clone());
        let next = "ask in time, or connect with a longer deadline_s";
        self.alarms.add(failure(ErrorKind::Fault, "deadline", &text, next));
    }

    /// Somebody has asked for something, or what was asked for is done.
    pub fn asked(&self) {
        *lock(&self.asked_at) = Some(Instant::now());
    }

    /// How long nothing was asked for.
    pub fn silence(&self) -> Duration {
        lock(&self.asked_at).map_or(Duration::ZERO, |at| at.elapsed())
    }

    /// Reports what has to be an error, once.
    pub fn check(&self) -> Result<(), Failure> {
        self.asked();
        self.alarms.check()
    }

    /// A snapshot for those who read it.
    pub fn sampled(&self, known: &Arc<Known>, snapshot: &Snapshot) {
        lock(&self.listeners).retain(|listener| {
            let Some(listener) = listener.upgrade() else { return false };
            if listener.boards.contains(&known.board) {
                let mut waiting = lock(&listener.waiting);
                if waiting.0.len() >= SAMPLES_MAX {
                    waiting.0.pop_front();
                    waiting.1 += 1;
                }
                waiting.0.push_back(Sample { known: known.clone(), snapshot: snapshot.clone() });
                listener.arrived.notify_one();
            }
            true
        });
    }

    /// Somebody reads samples from now on.
    pub fn listen(&self, listener: &Arc<Listener>) {
        lock(&self.listeners).push(Arc::downgrade(listener));
    }

    /// The next thing to do.
    pub fn take(&self, hands: &mut Hands) -> bool {
        let work = {
            let mut queue = lock(&self.queue);
            let work = queue.works.pop_front();
            queue.current = work.as_ref().map(|work| (work.id, work.kind, false));
            work
        };
        let Some(work) = work else { return false };
        hands.quiet();
        (work.act)(Ok(hands));
        self.asked();
        lock(&self.queue).current = None;
        true
    }

    /// Why nothing is done any more; `None`: it goes on.
    pub fn gone(&self) -> Option<Failure> {
        lock(&self.queue).closed.clone()
    }

    /// Nothing is taken any more.
    pub fn close(&self, why: Failure) {
        let works = {
            let mut queue = lock(&self.queue);
            queue.closed.get_or_insert(why.clone());
            std::mem::take(&mut queue.works)
        };
        works.into_iter().for_each(|work| (work.act)(Err(why.clone())));
    }

    /// Puts a thing to do in its place; a stop ends what goes on, what waits is not done.
    pub fn put(&self, work: Work) {
        self.asked();
        let (refused, why) = {
            let mut queue = lock(&self.queue);
            match (&queue.closed, work.kind) {
                (Some(why), _) => (VecDeque::from([work]), why.clone()),
                (None, Kind::Stop) => {
                    if let Some((_, Kind::Command, cancelled)) = &mut queue.current {
                        *cancelled = true;
                    }
                    let waiting = std::mem::take(&mut queue.works);
                    let (stops, others) = waiting.into_iter().partition(|other| other.kind == Kind::Stop);
                    queue.works = stops;
                    queue.works.push_front(work);
                    (others, stopped())
                }
                (None, _) => {
                    queue.works.push_back(work);
                    return;
                }
            }
        };
        refused.into_iter().for_each(|work: Work| (work.act)(Err(why.clone())));
    }

    /// Ends one thing: what it has to undo on the boards is still done.
    pub fn cancel(&self, id: u64) {
        let waiting = {
            let mut queue = lock(&self.queue);
            if let Some((current, _, cancelled)) = &mut queue.current
                && *current == id
            {
                *cancelled = true;
            }
            let place = queue.works.iter().position(|work| work.id == id);
            place.and_then(|place| queue.works.remove(place))
        };
        if let Some(work) = waiting {
            (work.act)(Err(stopped()));
        }
    }
}
