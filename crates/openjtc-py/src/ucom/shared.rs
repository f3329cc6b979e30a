//! State that the thread of the session shares with its callers: requests, events and readers of samples.

use std::collections::{BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use host_kit::owner::{Queue, Refused};
use serde_json::{Value, json};
use ucom_host::master::io::Snapshot;
use ucom_host::session::Known;

use super::alarms::Alarms;
use super::worker_state::WorkerState;
use crate::error::Failure;
use crate::threads::lock;

/// Maximum number of stored events. The newest event is the last event in the list.
const EVENTS_MAX: usize = 4096;
/// Maximum number of samples that a reader has not read yet.
const SAMPLES_MAX: usize = 65_536;

/// Kind of the events that contain the update result of a board.
pub(super) const UPDATED: &str = "updated";

/// Control loops that the thread must stop before it sends any other frame.
pub(super) enum Halt {
    All,
    Boards(Vec<u8>),
    /// The control loops of all boards that this session has started.
    Started,
}

/// Set of all outputs of a board at one time.
pub(super) struct Sample {
    pub known: Arc<Known>,
    pub snapshot: Snapshot,
}

/// Reader of samples.
pub(super) struct Listener {
    /// Boards whose samples are read.
    pub boards: BTreeSet<u8>,
    /// Samples that the reader has not read yet, and number of dropped samples.
    waiting: Mutex<(VecDeque<Sample>, u64)>,
    arrived: Condvar,
}

impl Listener {
    pub(super) fn new(boards: BTreeSet<u8>) -> Self {
        Self { boards, waiting: Mutex::default(), arrived: Condvar::new() }
    }

    /// Returns the next sample. Waits at most `patience` for it.
    pub(super) fn next(&self, patience: Duration) -> Option<Sample> {
        let waiting = lock(&self.waiting);
        let waited = self.arrived.wait_timeout_while(waiting, patience, |(samples, _)| samples.is_empty());
        waited.unwrap_or_else(PoisonError::into_inner).0.0.pop_front()
    }

    /// Returns the number of samples that were dropped because the reader was too slow.
    pub(super) fn dropped(&self) -> u64 {
        lock(&self.waiting).1
    }
}

/// State that the thread of the session shares with its callers.
#[derive(Default)]
pub(super) struct Shared {
    /// Requests to the thread; each request has a number.
    pub queue: Queue<WorkerState, u64>,
    /// Reason why the request queue is closed.
    closed: Mutex<Option<Failure>>,
    halts: Mutex<Vec<Halt>>,
    ended: AtomicBool,
    next_id: AtomicU64,
    events: Mutex<(u64, VecDeque<Value>)>,
    pub alarms: Alarms,
    listeners: Mutex<Vec<Weak<Listener>>>,
    asked_at: Mutex<Option<Instant>>,
    /// Boards that the session has started. The list of boards can be read even after the thread of the session has ended.
    started: Mutex<Vec<u8>>,
    /// Boards that possibly still run.
    not_stopped: Mutex<Vec<u8>>,
    seen: Mutex<Value>,
}

/// Makes a failure of the session itself.
pub(super) fn failure(kind: ErrorKind, code: &'static str, message: &str, next: &'static str) -> Failure {
    Failure::new(kind, code, message).next(next)
}

fn stopped() -> Failure {
    failure(ErrorKind::Fault, "cancelled", "the call was cancelled by a stop before it began", "")
}

/// Returns the failure for an internal fault of the thread that runs the session.
pub(super) fn fault() -> Failure {
    failure(ErrorKind::Fault, "fault", "internal error of the chain's thread", "connect again")
}

impl Shared {
    /// Returns `true` if the running request is cancelled, or if the session ends.
    pub(super) fn is_cancelled(&self) -> bool {
        self.has_ended() || self.queue.is_cancelled()
    }

    /// Returns a number for the next request.
    pub(super) fn next_id(&self) -> u64 {
        self.next_id.fetch_add(1, Ordering::Relaxed)
    }

    /// Ends the session.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Requests that the thread stops these control loops before it sends any other frame.
    pub(super) fn halt(&self, halt: Halt) {
        lock(&self.halts).push(halt);
    }

    /// Sets the boards that the session has started.
    pub(super) fn has_started(&self, boards: Vec<u8>) {
        *lock(&self.started) = boards;
    }

    /// Marks all started boards as possibly still running, after a fault of the thread.
    pub(super) fn all_left(&self) {
        self.left(std::mem::take(&mut *lock(&self.started)));
    }

    /// Sets the boards that possibly still run at the end of the session.
    pub(super) fn left(&self, boards: Vec<u8>) {
        *lock(&self.not_stopped) = boards;
    }

    /// Removes and returns the boards that possibly still run.
    pub(super) fn take_left(&self) -> Vec<u8> {
        std::mem::take(&mut *lock(&self.not_stopped))
    }

    /// Returns `true` after a call of [`Self::end`].
    pub(super) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }

    /// Removes and returns the control loops that the thread must stop now.
    pub(super) fn halts(&self) -> Vec<Halt> {
        std::mem::take(&mut *lock(&self.halts))
    }

    /// Adds an event.
    pub(super) fn event(&self, time_s: f64, kind: &str, board: Option<u8>, text: String) {
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

    /// Returns the number of the last event.
    pub(super) fn last_event(&self) -> u64 {
        lock(&self.events).0
    }

    /// Returns the events with higher numbers than `after`, oldest first.
    pub(super) fn events(&self, after: u64) -> Value {
        self.asked();
        let events = lock(&self.events);
        events.1.iter().filter(|event| event["number"].as_u64() > Some(after)).cloned().collect()
    }

    /// Returns the results of updates that were reported after this event.
    pub(super) fn outcomes(&self, after: u64) -> Vec<String> {
        let events = self.events(after);
        let of_updates = events.as_array().into_iter().flatten().filter(|event| event["kind"] == UPDATED);
        of_updates.filter_map(|event| Some(event["text"].as_str()?.to_owned())).collect()
    }

    /// Stores the last known state of the bus.
    pub(super) fn seen(&self, value: Value) {
        *lock(&self.seen) = value;
    }

    /// Returns the load and the frame counts of the bus.
    pub(super) fn bus(&self) -> Value {
        self.asked();
        lock(&self.seen).clone()
    }

    /// Reports that running boards were stopped because the program made no call within the deadline. `not_stopped`
    /// contains the boards that possibly still run.
    pub(super) fn deadline(&self, time_s: f64, deadline: Duration, not_stopped: &[u8]) {
        let mut text =
            format!("no call was made to the chain for {} s: its boards are stopped", deadline.as_secs_f64());
        if !not_stopped.is_empty() {
            let numbers: Vec<String> = not_stopped.iter().map(u8::to_string).collect();
            text += &format!(", not for certain: board {}", numbers.join(", "));
        }
        self.event(time_s, "deadline", None, text.clone());
        let next = "call a method of the chain more often, or connect with a longer deadline_s";
        self.alarms.add(failure(ErrorKind::Fault, "deadline", &text, next));
    }

    /// Restarts the deadline. The thread calls this function when a request arrives and after a request ends.
    pub(super) fn asked(&self) {
        *lock(&self.asked_at) = Some(Instant::now());
    }

    /// Returns the time since the last request.
    pub(super) fn silence(&self) -> Duration {
        lock(&self.asked_at).map_or(Duration::ZERO, |at| at.elapsed())
    }

    /// Returns each waiting alarm once. The alarm is returned as an error.
    pub(super) fn check(&self) -> Result<(), Failure> {
        self.asked();
        self.alarms.check()
    }

    /// Passes a snapshot of outputs to its readers.
    pub(super) fn sampled(&self, known: &Arc<Known>, snapshot: &Snapshot) {
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

    /// Adds a reader of samples.
    pub(super) fn listen(&self, listener: &Arc<Listener>) {
        lock(&self.listeners).push(Arc::downgrade(listener));
    }

    /// Removes the next request from the queue and runs it.
    pub(super) fn take(&self, state: &mut WorkerState) -> bool {
        let Some(turn) = self.queue.take() else { return false };
        state.quiet();
        turn.run(state);
        self.asked();
        self.queue.done();
        true
    }

    /// Returns the reason why the request queue is closed. `None` means that the queue is open.
    pub(super) fn gone(&self) -> Option<Failure> {
        lock(&self.closed).clone()
    }

    /// Closes the request queue.
    pub(super) fn close(&self, why: Failure) {
        lock(&self.closed).get_or_insert(why);
        self.queue.close();
    }

    /// Returns the failure of a request that was not executed.
    pub(super) fn refusal(&self, refused: Refused) -> Failure {
        match refused {
            Refused::Stopped | Refused::Cancelled => stopped(),
            Refused::Closed => self.gone().unwrap_or_else(fault),
        }
    }
}
