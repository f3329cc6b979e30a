//! Thread that runs the session with a controller, and the calls that Python threads make to it.
//!
//! The thread owns the session. Python threads send jobs to it and wait without the interpreter's lock. During the wait they check for
//! Ctrl-C, which stops the arm before the exception is raised.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use jtc_sim::World;
use pyo3::prelude::*;

use super::shared::{Asked, Shared};
use super::worker_state::{Target, Way, WorkerState};
use crate::error::Failure;

/// Interval at which a waiting thread checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait for standstill after a Stop; a second Ctrl-C ends the wait.
const STANDSTILL: Duration = Duration::from_secs(15);

type Job = Box<dyn FnOnce(&mut WorkerState) + Send>;

/// Locks a mutex, even after a panic, because the protected data is consistent after each statement.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Result of a wait.
pub enum Waited<T> {
    Came(T),
    /// No result can arrive any more.
    Gone,
    /// No result arrived in this time.
    NotYet,
}

/// The connection's thread.
pub struct Worker {
    simulated: bool,
    /// Process that opened the connection. A forked child does not have the thread.
    process: u32,
    /// Name of the port.
    pub port: String,
    jobs: Mutex<Option<Sender<Job>>>,
    pub shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// Returns the error for a closed connection.
pub fn closed() -> Failure {
    Failure::new(ErrorKind::NoLink, "closed", "the connection is closed")
        .next("connect again: `openjtc.connect(…)`")
}

impl Worker {
    /// Starts the thread and connects in it.
    pub fn begin(py: Python<'_>, target: Target) -> PyResult<Self> {
        let shared = Arc::<Shared>::default();
        let simulated = matches!(target.way, Way::Simulated(_));
        let (jobs, waiting) = channel::<Job>();
        let (opened, is_open) = channel::<Result<String, Failure>>();
        let own = Arc::clone(&shared);
        let asked = Asked::now(&shared);
        let body = move || match WorkerState::open(target, own, &asked) {
            Err(failure) => drop(opened.send(Err(failure))),
            Ok(mut state) => {
                let _ = opened.send(Ok(state.port_name()));
                serve(&mut state, waiting);
            }
        };
        let thread = std::thread::Builder::new().name("openjtc".into()).spawn(body)?;
        let mut worker = Self {
            simulated,
            process: std::process::id(),
            port: String::new(),
            jobs: Mutex::new(Some(jobs)),
            shared,
            thread: Mutex::new(Some(thread)),
        };
        worker.port = worker.wait(py, is_open)??;
        Ok(worker)
    }

    /// Sends a job that was requested after `at` halts, and returns the channel for its result. A halt before the job begins discards the
    /// job.
    pub fn ask<T: Send + 'static>(
        &self,
        at: u64,
        job: impl FnOnce(&mut WorkerState, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let asked = Asked::after(&self.shared, at);
        self.hand_over(move |state| {
            asked.check()?;
            state.begin(&asked)?;
            job(state, &asked)
        })
    }

    /// Like [`Self::ask`], for jobs that a Stop does not cancel: jobs that bring the arm to rest or only read.
    pub fn ask_always<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        self.hand_over(job)
    }

    fn hand_over<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let (done, came) = channel();
        let job: Job = Box::new(move |state| {
            let result = job(state);
            // The caller may have stopped waiting.
            let _ = done.send(result);
        });
        if self.is_foreign() {
            return Err(closed().next("the process that opened it has it: connect in this one, too"));
        }
        let jobs = lock(&self.jobs);
        jobs.as_ref().ok_or_else(closed)?.send(job).map_err(|_| closed())?;
        Ok(came)
    }

    /// Sends a job and waits for its result.
    pub fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut WorkerState, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.ask(self.shared.halts(), job)?;
        Ok(self.wait(py, came)??)
    }

    /// Like [`Self::call`], for jobs that a Stop does not cancel.
    pub fn call_always<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.ask_always(job)?;
        Ok(self.wait(py, came)??)
    }

    /// Waits without the interpreter's lock. Ctrl-C stops the arm, and the exception is raised after standstill.
    pub fn wait<T: Send>(&self, py: Python<'_>, came: Receiver<T>) -> PyResult<T> {
        match self.wait_for(py, &Mutex::new(came), None)? {
            Waited::Came(result) => {
                // Handles a Ctrl-C that came together with the result, because Python itself would not stop the arm.
                self.look_for_signals(py)?;
                Ok(result)
            }
            Waited::Gone | Waited::NotYet => Err(closed().into()),
        }
    }

    /// Like [`Self::wait`], for at most this time. Several threads may wait for the same result; exactly one receives it.
    pub fn wait_for<T: Send>(
        &self,
        py: Python<'_>,
        came: &Mutex<Receiver<T>>,
        longest: Option<Duration>,
    ) -> PyResult<Waited<T>> {
        let end = longest.and_then(|longest| Instant::now().checked_add(longest));
        loop {
            if self.is_foreign() {
                return Ok(Waited::Gone);
            }
            let left = end.map_or(LOOK, |end| end.saturating_duration_since(Instant::now()).min(LOOK));
            let result = py.detach(|| match came.try_lock() {
                Ok(came) => came.recv_timeout(left),
                Err(_) => {
                    std::thread::sleep(left.min(LOOK / 10));
                    Err(RecvTimeoutError::Timeout)
                }
            });
            match result {
                Ok(result) => return Ok(Waited::Came(result)),
                Err(RecvTimeoutError::Disconnected) => return Ok(Waited::Gone),
                Err(RecvTimeoutError::Timeout) => {}
            }
            self.look_for_signals(py)?;
            if end.is_some_and(|end| Instant::now() >= end) {
                return Ok(Waited::NotYet);
            }
        }
    }

    /// Waits for `time` while another thread works.
    pub fn pass(&self, py: Python<'_>, time: Duration) -> PyResult<()> {
        py.detach(|| std::thread::sleep(time));
        self.look_for_signals(py)
    }

    /// Checks for Ctrl-C and other signals whose handlers raise an exception. The arm is at rest before the exception is raised.
    pub fn look_for_signals(&self, py: Python<'_>) -> PyResult<()> {
        py.check_signals().inspect_err(|_| self.rest(py))
    }

    /// Stops the motion of this connection and waits for standstill. A signal ends the wait. Cancels all earlier requests.
    pub fn rest(&self, py: Python<'_>) {
        self.shared.halt();
        let Ok(came) = self.ask_always(WorkerState::rest).map(Mutex::new) else { return };
        let end = Instant::now() + STANDSTILL;
        while Instant::now() < end {
            let result = py.detach(|| lock(&came).recv_timeout(LOOK));
            if !matches!(result, Err(RecvTimeoutError::Timeout)) || py.check_signals().is_err() {
                return;
            }
        }
    }

    /// Applies a disturbance to the simulated arm, during any job.
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

    /// Takes no further jobs and waits until the thread has ended the connection. A signal ends the wait.
    pub fn end(&self, py: Python<'_>) -> PyResult<()> {
        lock(&self.jobs).take();
        let thread = lock(&self.thread).take();
        let Some(thread) = thread.filter(|_| !self.is_foreign()) else { return Ok(()) };
        while !thread.is_finished() {
            py.detach(|| std::thread::sleep(Duration::from_millis(2)));
            py.check_signals()?;
        }
        // A panic of the thread was already reported in the thread.
        let _ = thread.join();
        Ok(())
    }

    /// Returns `true` if another process owns the connection.
    pub fn is_foreign(&self) -> bool {
        self.process != std::process::id()
    }

    /// Returns `true` if the connection takes no more jobs.
    pub fn is_closed(&self) -> bool {
        self.is_foreign() || self.shared.is_gone() || lock(&self.jobs).is_none()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // Stops a motion that no caller follows any more. The thread ends after the motion.
        self.shared.halt();
    }
}

/// Runs jobs one after the other. Reads statuses between jobs, so that the last status is always recent. At the end, stops a motion of
/// this connection.
fn serve(state: &mut WorkerState, waiting: Receiver<Job>) {
    loop {
        let job = if state.time_passes() {
            match waiting.try_recv() {
                Ok(job) => Some(job),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => break,
            }
        } else {
            match waiting.recv() {
                Ok(job) => Some(job),
                Err(_) => break,
            }
        };
        let done = catch_unwind(AssertUnwindSafe(|| {
            match job {
                Some(job) => job(state),
                None => state.idle(),
            }
            state.look();
        }));
        if done.is_err() {
            // After a panic the state is unknown, so only a Stop is sent.
            state.shared.set_gone();
            drop(waiting);
            let _ = catch_unwind(AssertUnwindSafe(|| state.abandon()));
            return;
        }
    }
    // An error is ignored, because no caller is left to report it to.
    let _ = state.rest();
}
