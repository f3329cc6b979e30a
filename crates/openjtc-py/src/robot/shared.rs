//! State that the thread of a connection shares with the waiting callers.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use host_kit::owner::Queue;
use jtc_core::JOINTS;
use jtc_host::session::Flow;
use jtc_sim::World;
use jtc_wire::Status;

use super::worker_state::WorkerState;
use crate::error::Failure;
use crate::threads::lock;

/// Disturbance of a simulated arm.
pub(super) type Touch = Box<dyn FnOnce(&mut World) + Send>;

/// Request to a running motion, with the channel that returns the result.
pub(crate) struct Wish {
    pub flow: Flow,
    pub done: Sender<Result<(), Failure>>,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Progress {
    /// Phase of the run: "waiting", "approach", "upload", "motion"; empty after the end.
    pub phase: &'static str,
    /// Completed part of the phase: time on the path in s, or number of uploaded segments.
    pub done: f64,
    /// Total of the phase, in the unit of `done`.
    pub total: f64,
}

/// State that the thread of a connection shares with the waiting callers.
#[derive(Default)]
pub(crate) struct Shared {
    /// Requests to the thread, and the number of Stops.
    pub queue: Queue<WorkerState, ()>,
    /// Number of Stops that also stop the arm if another program moves the arm.
    stops_of_all: AtomicU64,
    /// Number of requested runs that have not ended.
    pending: AtomicUsize,
    /// `true` if this connection has started a motion whose end the controller has not reported yet.
    moves: AtomicBool,
    /// `true` if the thread must end.
    ended: AtomicBool,
    /// `true` if the thread has ended without a request to end.
    gone: AtomicBool,
    /// Number of received statuses.
    seen: AtomicU64,
    /// Requests to the current or next run. The run reads these requests while the arm moves.
    pub wishes: Mutex<VecDeque<Wish>>,
    pub status: Mutex<Option<Status>>,
    /// Disturbances of a simulated arm, applied during any job.
    pub touches: Mutex<Vec<Touch>>,
    /// Latest value of the speed override that was read or set.
    pub speed: Mutex<Option<f64>>,
    /// Times (s) and joint positions (rad) that were recorded while the arm was guided by hand.
    pub taught: Mutex<Vec<(f64, [f64; JOINTS])>>,
}

impl Shared {
    /// Cancels all earlier requests. The port then stops the motion of this connection.
    pub(crate) fn halt(&self) {
        self.queue.count_stop();
    }

    /// Announces a Stop that also stops the arm if another program moves the arm. The caller must request the Stop
    /// itself after this call.
    pub(crate) fn will_stop_all(&self) {
        self.stops_of_all.fetch_add(1, Ordering::SeqCst);
    }

    /// Returns the number of all Stops, and the number of Stops that also stop the arm if another program moves the
    /// arm.
    pub(crate) fn stops(&self) -> (u64, u64) {
        let all = self.queue.stops();
        (all, self.stops_of_all.load(Ordering::SeqCst))
    }

    /// Returns `true` if the thread must end.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended.load(Ordering::SeqCst)
    }

    /// Makes the thread end after its current request. Returns `true` for the first call.
    pub(crate) fn end(&self) -> bool {
        !self.ended.swap(true, Ordering::SeqCst)
    }

    pub(crate) fn moves(&self) -> bool {
        self.moves.load(Ordering::SeqCst)
    }

    pub(crate) fn set_moves(&self, moves: bool) {
        self.moves.store(moves, Ordering::SeqCst);
    }

    /// Returns `true` while any requested run has not ended. During this time, the thread does not answer queries.
    pub(crate) fn is_running(&self) -> bool {
        self.pending.load(Ordering::SeqCst) > 0
    }

    pub(crate) fn is_gone(&self) -> bool {
        self.gone.load(Ordering::SeqCst)
    }

    pub(crate) fn set_gone(&self) {
        self.gone.store(true, Ordering::SeqCst);
    }

    pub(crate) fn seen(&self) -> u64 {
        self.seen.load(Ordering::SeqCst)
    }

    /// Publishes a new status.
    pub(crate) fn publish(&self, status: &Status) {
        *lock(&self.status) = Some(*status);
        self.seen.fetch_add(1, Ordering::SeqCst);
    }

    /// Passes a request to the current run. Without a run, drops the result channel of the request, so that the
    /// caller receives an error.
    pub(crate) fn wish(&self, wish: Wish) {
        lock(&self.wishes).push_back(wish);
        if !self.is_running() {
            lock(&self.wishes).clear();
        }
    }
}

/// Guard of a requested run, which exists until the run has ended or was abandoned.
pub(super) struct Pending(Arc<Shared>);

impl Pending {
    /// Counts the run as pending.
    pub(super) fn begin(shared: &Arc<Shared>) -> Self {
        shared.pending.fetch_add(1, Ordering::SeqCst);
        Self(Arc::clone(shared))
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if self.0.pending.fetch_sub(1, Ordering::SeqCst) == 1 {
            // When the senders are dropped, the waiting threads detect that the run has ended.
            lock(&self.0.wishes).clear();
        }
    }
}

/// Number of Stops at the time of a request, which shows whether a later Stop cancels the request.
#[derive(Clone)]
pub(crate) struct Asked {
    shared: Arc<Shared>,
    at: u64,
}

impl Asked {
    /// Creates the value for a request that is made now.
    pub(crate) fn now(shared: &Arc<Shared>) -> Self {
        Self::after(shared, shared.queue.stops())
    }

    /// Creates the value for a request. `at` is the number of Stops that had been requested when the request was
    /// made.
    pub(crate) fn after(shared: &Arc<Shared>, at: u64) -> Self {
        Self { shared: Arc::clone(shared), at }
    }

    /// Returns the number of Stops at the time of the request.
    pub(crate) fn at(&self) -> u64 {
        self.at
    }

    /// Returns `true` if a Stop was requested after this request.
    pub(crate) fn is_halted(&self) -> bool {
        self.shared.queue.stops() != self.at
    }
}
