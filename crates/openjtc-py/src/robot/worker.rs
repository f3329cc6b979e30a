//! The thread that has the conversation with a controller, and how Python's threads ask it for something.
//!
//! A session is one conversation, so one thread has it. Python's threads hand jobs over and wait without the interpreter's lock; while they
//! wait they look for Ctrl-C, which stops the arm before it becomes an exception.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use jtc_host::session::Flow;
use jtc_sim::World;
use jtc_wire::Status;
use pyo3::prelude::*;

use super::machine::{Machine, Target, Way};
use crate::error::Failure;

/// How often a waiting thread looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait until an arm that is stopped stands; a second Ctrl-C ends it sooner.
const STANDSTILL: Duration = Duration::from_secs(15);

type Job = Box<dyn FnOnce(&mut Machine) + Send>;
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
    /// "waiting", "approach", "upload", "motion".
    pub phase: &'static str,
    /// s of its path, or segments.
    pub done: f64,
    /// Of so many.
    pub total: f64,
}

/// What the worker and those who wait for it share.
#[derive(Default)]
pub struct Shared {
    /// Counts the Stops: what was asked for before one is not done after it.
    halts: AtomicU64,
    /// A run is on its way, from the wait for the drives to its end: the worker has no time for questions.
    pub running: AtomicBool,
    /// What is wished of that run; looked at while its arm moves.
    pub wishes: Mutex<VecDeque<Wish>>,
    pub status: Mutex<Option<Status>>,
    /// What is to happen to a simulated arm, in whatever its controller is doing.
    pub touches: Mutex<Vec<Touch>>,
    /// Counts the statuses.
    pub seen: AtomicU64,
    pub progress: Mutex<Progress>,
}

impl Shared {
    /// Everything that was asked for so far is over.
    pub fn halt(&self) {
        self.halts.fetch_add(1, Ordering::SeqCst);
    }

    pub fn halts(&self) -> u64 {
        self.halts.load(Ordering::SeqCst)
    }

    /// A status that came.
    pub fn publish(&self, status: &Status) {
        *lock(&self.status) = Some(*status);
        self.seen.fetch_add(1, Ordering::SeqCst);
    }

    pub fn report(&self, phase: &'static str, done: f64, total: f64) {
        *lock(&self.progress) = Progress { phase, done, total };
    }
}

/// What it protects is whole between two statements of any thread.
pub fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A job's own view of the Stops.
#[derive(Clone)]
pub struct Asked {
    shared: Arc<Shared>,
    at: u64,
}

impl Asked {
    /// Somebody stopped the arm since this was asked for.
    pub fn is_halted(&self) -> bool {
        self.shared.halts() != self.at
    }
}

/// The connection's thread.
pub struct Worker {
    simulated: bool,
    jobs: Mutex<Option<Sender<Job>>>,
    pub shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

fn closed() -> Failure {
    let message = "the connection is closed".to_owned();
    let next = "connect again: `openjtc.connect(…)`".to_owned();
    Failure { kind: ErrorKind::NoLink, code: "closed".into(), message, next, facts: Default::default() }
}

impl Worker {
    /// Connects, in its thread.
    pub fn begin(py: Python<'_>, target: Target) -> PyResult<Self> {
        let shared = Arc::<Shared>::default();
        let simulated = matches!(target.way, Way::Simulated(_));
        let (jobs, waiting) = channel::<Job>();
        let (opened, is_open) = channel::<Result<(), Failure>>();
        let own = Arc::clone(&shared);
        let asked = Asked { shared: Arc::clone(&shared), at: 0 };
        let body = move || match Machine::open(target, own, &asked) {
            Err(failure) => drop(opened.send(Err(failure))),
            Ok(mut machine) => {
                let _ = opened.send(Ok(()));
                serve(&mut machine, &waiting);
            }
        };
        let thread = std::thread::Builder::new().name("openjtc".into()).spawn(body)?;
        let worker =
            Self { simulated, jobs: Mutex::new(Some(jobs)), shared, thread: Mutex::new(Some(thread)) };
        worker.wait(py, is_open)??;
        Ok(worker)
    }

    /// Hands a job over; what comes of it is received.
    pub fn ask<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Machine, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let (done, came) = channel();
        let asked = Asked { shared: Arc::clone(&self.shared), at: self.shared.halts() };
        let job: Job = Box::new(move |machine| {
            let result = job(machine, &asked);
            // Whoever asked may have gone.
            let _ = done.send(result);
        });
        let jobs = lock(&self.jobs);
        jobs.as_ref().ok_or_else(closed)?.send(job).map_err(|_| closed())?;
        Ok(came)
    }

    /// Hands a job over and waits for it.
    pub fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Machine, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.ask(job)?;
        Ok(self.wait(py, came)??)
    }

    /// Waits without the interpreter's lock. At Ctrl-C the arm is stopped, and stands before the exception is raised.
    pub fn wait<T: Send>(&self, py: Python<'_>, came: Receiver<T>) -> PyResult<T> {
        match self.wait_for(py, came, None)? {
            Ok(result) => Ok(result),
            Err(_) => Err(closed().into()),
        }
    }

    /// The same for at most this time: the receiver again where nothing came.
    pub fn wait_for<T: Send>(
        &self,
        py: Python<'_>,
        mut came: Receiver<T>,
        longest: Option<Duration>,
    ) -> PyResult<Result<T, Receiver<T>>> {
        let end = longest.map(|longest| Instant::now() + longest);
        loop {
            let left = end.map_or(LOOK, |end| end.saturating_duration_since(Instant::now()).min(LOOK));
            let (back, result) = look(py, came, left);
            came = back;
            match result {
                Ok(result) => return Ok(Ok(result)),
                Err(RecvTimeoutError::Disconnected) => return Err(closed().into()),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(interrupt) = py.check_signals() {
                self.shared.halt();
                let end = Instant::now() + STANDSTILL;
                while Instant::now() < end {
                    let (back, result) = look(py, came, LOOK);
                    came = back;
                    if !matches!(result, Err(RecvTimeoutError::Timeout)) || py.check_signals().is_err() {
                        break;
                    }
                }
                return Err(interrupt);
            }
            if end.is_some_and(|end| Instant::now() >= end) {
                return Ok(Err(came));
            }
        }
    }

    /// Does something to the simulated arm, whatever its controller is doing.
    pub fn touch(&self, touch: impl FnOnce(&mut World) + Send + 'static) -> Result<(), Failure> {
        if self.is_closed() {
            return Err(closed());
        }
        if !self.simulated {
            return Err(Failure::usage("this is no simulator, and nobody can touch it from here")
                .next("`openjtc.connect(\"sim:\")` is one"));
        }
        lock(&self.shared.touches).push(Box::new(touch));
        Ok(())
    }

    /// No further jobs; the thread ends with the connection.
    pub fn end(&self, py: Python<'_>) {
        lock(&self.jobs).take();
        let thread = lock(&self.thread).take();
        py.detach(|| {
            if let Some(thread) = thread {
                // What it panicked of was reported where it did.
                let _ = thread.join();
            }
        });
    }

    /// Nothing can be asked any more.
    pub fn is_closed(&self) -> bool {
        lock(&self.jobs).is_none()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // A motion that nobody follows any more is stopped: the thread ends behind it.
        self.shared.halt();
    }
}

fn look<T: Send>(
    py: Python<'_>,
    came: Receiver<T>,
    longest: Duration,
) -> (Receiver<T>, Result<T, RecvTimeoutError>) {
    py.detach(move || {
        let result = came.recv_timeout(longest);
        (came, result)
    })
}

/// Does what is asked for, one thing after the other; in between statuses are taken, so that none of them is old.
fn serve(machine: &mut Machine, waiting: &Receiver<Job>) {
    loop {
        let job = if machine.time_passes() {
            match waiting.try_recv() {
                Ok(job) => Some(job),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => return,
            }
        } else {
            match waiting.recv() {
                Ok(job) => Some(job),
                Err(_) => return,
            }
        };
        match job {
            Some(job) => job(machine),
            None => machine.idle(),
        }
    }
}
