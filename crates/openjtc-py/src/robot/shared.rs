//! What the thread of a connection and those who wait for it share.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use jtc_core::JOINTS;
use jtc_host::session::Flow;
use jtc_sim::World;
use jtc_wire::Status;

use super::worker::lock;
use crate::error::Failure;

/// What happens to a simulated arm.
pub type Touch = Box<dyn FnOnce(&mut World) + Send>;

/// Something that a motion on its way is to do, and who waits for what came of it.
pub struct Wish {
    pub flow: Flow,
    pub done: Sender<Result<(), Failure>>,
}

/// How far a motion is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// "waiting", "approach", "upload", "motion"; empty when it is over.
    pub phase: &'static str,
    /// s of its path, or segments.
    pub done: f64,
    /// Of so many.
    pub total: f64,
}

/// What the thread of a connection and those who wait for it share.
#[derive(Default)]
pub struct Shared {
    /// Counts what ends all that was asked for before it.
    halts: AtomicU64,
    /// Counts those of them that stop the arm whoever moves it.
    stops: AtomicU64,
    /// Runs that were asked for and are not over.
    pending: AtomicUsize,
    /// The controller was sent something that moves the arm, and did not report its end yet.
    moves: AtomicBool,
    /// The thread has ended by itself.
    gone: AtomicBool,
    /// Counts the statuses.
    seen: AtomicU64,
    /// What is wished of the run that is on its way, or of the next one; looked at while its arm moves.
    pub wishes: Mutex<VecDeque<Wish>>,
    pub status: Mutex<Option<Status>>,
    /// What is to happen to a simulated arm, in whatever its controller is doing.
    pub touches: Mutex<Vec<Touch>>,
    /// The speed override as it was read or set last.
    pub speed: Mutex<Option<f64>>,
    /// Where the arm was led by hand, with the times (s).
    pub taught: Mutex<Vec<(f64, [f64; JOINTS])>>,
}

impl Shared {
    /// Everything that was asked for so far is over; what moves here is stopped.
    pub fn halt(&self) {
        self.halts.fetch_add(1, Ordering::SeqCst);
    }

    /// The same, and the arm is stopped whoever moves it.
    pub fn stop(&self) {
        self.stops.fetch_add(1, Ordering::SeqCst);
        self.halt();
    }

    pub fn halts(&self) -> u64 {
        self.halts.load(Ordering::SeqCst)
    }

    pub fn stops(&self) -> u64 {
        self.stops.load(Ordering::SeqCst)
    }

    pub fn moves(&self) -> bool {
        self.moves.load(Ordering::SeqCst)
    }

    pub fn set_moves(&self, moves: bool) {
        self.moves.store(moves, Ordering::SeqCst);
    }

    /// A run was asked for and is not over: the thread has no time for questions.
    pub fn is_running(&self) -> bool {
        self.pending.load(Ordering::SeqCst) > 0
    }

    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::SeqCst)
    }

    pub fn set_gone(&self) {
        self.gone.store(true, Ordering::SeqCst);
    }

    pub fn seen(&self) -> u64 {
        self.seen.load(Ordering::SeqCst)
    }

    /// A status that came.
    pub fn publish(&self, status: &Status) {
        *lock(&self.status) = Some(*status);
        self.seen.fetch_add(1, Ordering::SeqCst);
    }

    /// Something that the run on its way is to do. Where there is none any more, the sender is dropped.
    pub fn wish(&self, wish: Wish) {
        lock(&self.wishes).push_back(wish);
        if !self.is_running() {
            lock(&self.wishes).clear();
        }
    }
}

/// A run that was asked for, until it is over or given up.
pub struct Pending(Arc<Shared>);

impl Pending {
    /// From now on it is.
    pub fn begin(shared: &Arc<Shared>) -> Self {
        shared.pending.fetch_add(1, Ordering::SeqCst);
        Self(Arc::clone(shared))
    }
}

impl Drop for Pending {
    fn drop(&mut self) {
        if self.0.pending.fetch_sub(1, Ordering::SeqCst) == 1 {
            // Who wished something of a run that is over learns that: the other end of the channel is gone.
            lock(&self.0.wishes).clear();
        }
    }
}

/// A job's own view of the halts.
#[derive(Clone)]
pub struct Asked {
    shared: Arc<Shared>,
    at: u64,
}

impl Asked {
    /// Of what is asked for now.
    pub fn now(shared: &Arc<Shared>) -> Self {
        Self::after(shared, shared.halts())
    }

    /// Of what was asked for after so many halts.
    pub fn after(shared: &Arc<Shared>, at: u64) -> Self {
        Self { shared: Arc::clone(shared), at }
    }

    /// How many halts there had been.
    pub fn at(&self) -> u64 {
        self.at
    }

    /// Somebody stopped the arm since this was asked for.
    pub fn is_halted(&self) -> bool {
        self.shared.halts() != self.at
    }

    /// An error where somebody did.
    pub fn check(&self) -> Result<(), Failure> {
        if self.is_halted() { Err(jtc_host::Error::Cancelled.into()) } else { Ok(()) }
    }
}
