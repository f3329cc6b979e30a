//! The thread that has the conversation with a controller, and how Python's threads ask it for something.
//!
//! A session is one conversation, so one thread has it. Python's threads hand jobs over and wait without the interpreter's lock; while they
//! wait they look for Ctrl-C, which stops the arm before it becomes an exception.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use jtc_sim::World;
use pyo3::prelude::*;

use super::machine::{Machine, Target, Way};
use super::shared::{Asked, Shared};
use crate::error::Failure;

/// How often a waiting thread looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);
/// Longest wait until an arm that is stopped stands; a second Ctrl-C ends it sooner.
const STANDSTILL: Duration = Duration::from_secs(15);

type Job = Box<dyn FnOnce(&mut Machine) + Send>;

/// What it protects is whole between two statements of any thread.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What came of waiting.
pub enum Waited<T> {
    Came(T),
    /// Nothing will come any more.
    Gone,
    /// Nothing came in this time.
    NotYet,
}

/// The connection's thread.
pub struct Worker {
    simulated: bool,
    /// The process that opened it: a child of it has no such thread.
    process: u32,
    /// Where the port leads.
    pub port: String,
    jobs: Mutex<Option<Sender<Job>>>,
    pub shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// Nothing can be asked any more.
pub fn closed() -> Failure {
    Failure::new(ErrorKind::NoLink, "closed", "the connection is closed")
        .next("connect again: `openjtc.connect(…)`")
}

impl Worker {
    /// Connects, in its thread.
    pub fn begin(py: Python<'_>, target: Target) -> PyResult<Self> {
        let shared = Arc::<Shared>::default();
        let simulated = matches!(target.way, Way::Simulated(_));
        let (jobs, waiting) = channel::<Job>();
        let (opened, is_open) = channel::<Result<String, Failure>>();
        let own = Arc::clone(&shared);
        let asked = Asked::now(&shared);
        let body = move || match Machine::open(target, own, &asked) {
            Err(failure) => drop(opened.send(Err(failure))),
            Ok(mut machine) => {
                let _ = opened.send(Ok(machine.port_name()));
                serve(&mut machine, waiting);
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

    /// Hands a job over that was asked for after so many halts; what comes of it is received. It is not done where somebody has stopped the
    /// arm by the time it is its turn.
    pub fn ask<T: Send + 'static>(
        &self,
        at: u64,
        job: impl FnOnce(&mut Machine, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let asked = Asked::after(&self.shared, at);
        self.hand_over(move |machine| {
            asked.check()?;
            machine.begin(&asked)?;
            job(machine, &asked)
        })
    }

    /// The same of what a Stop does not end: what brings the arm to rest, and what looks at it.
    pub fn ask_always<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Machine) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        self.hand_over(job)
    }

    fn hand_over<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Machine) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let (done, came) = channel();
        let job: Job = Box::new(move |machine| {
            let result = job(machine);
            // Whoever asked may have gone.
            let _ = done.send(result);
        });
        if self.is_foreign() {
            return Err(closed().next("the process that opened it has it: connect in this one, too"));
        }
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
        let came = self.ask(self.shared.halts(), job)?;
        Ok(self.wait(py, came)??)
    }

    /// The same of what a Stop does not end.
    pub fn call_always<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Machine) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.ask_always(job)?;
        Ok(self.wait(py, came)??)
    }

    /// Waits without the interpreter's lock. At Ctrl-C the arm is stopped, and stands before the exception is raised.
    pub fn wait<T: Send>(&self, py: Python<'_>, came: Receiver<T>) -> PyResult<T> {
        match self.wait_for(py, &Mutex::new(came), None)? {
            Waited::Came(result) => {
                // One that came with the result is not left to Python, which does not know that it stops the arm.
                self.look_for_signals(py)?;
                Ok(result)
            }
            Waited::Gone | Waited::NotYet => Err(closed().into()),
        }
    }

    /// The same for at most this time. Several threads may wait for one thing, which one of them gets.
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

    /// Waits for a moment, for what another thread does.
    pub fn pass(&self, py: Python<'_>, time: Duration) -> PyResult<()> {
        py.detach(|| std::thread::sleep(time));
        self.look_for_signals(py)
    }

    /// At Ctrl-C, and at any other signal whose handler raises something: the arm is stopped, and stands before that is raised.
    pub fn look_for_signals(&self, py: Python<'_>) -> PyResult<()> {
        py.check_signals().inspect_err(|_| self.rest(py))
    }

    /// Stops what moves here, and waits until it stands; a signal ends the wait. Nothing that was asked for before is done any more.
    pub fn rest(&self, py: Python<'_>) {
        self.shared.halt();
        let Ok(came) = self.ask_always(Machine::rest).map(Mutex::new) else { return };
        let end = Instant::now() + STANDSTILL;
        while Instant::now() < end {
            let result = py.detach(|| lock(&came).recv_timeout(LOOK));
            if !matches!(result, Err(RecvTimeoutError::Timeout)) || py.check_signals().is_err() {
                return;
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

    /// No further jobs; the thread ends with the connection. A signal ends the wait for that.
    pub fn end(&self, py: Python<'_>) -> PyResult<()> {
        lock(&self.jobs).take();
        let thread = lock(&self.thread).take();
        let Some(thread) = thread.filter(|_| !self.is_foreign()) else { return Ok(()) };
        while !thread.is_finished() {
            py.detach(|| std::thread::sleep(Duration::from_millis(2)));
            py.check_signals()?;
        }
        // What it panicked of was reported where it did.
        let _ = thread.join();
        Ok(())
    }

    /// This process is not the one that has the connection.
    pub fn is_foreign(&self) -> bool {
        self.process != std::process::id()
    }

    /// Nothing can be asked any more.
    pub fn is_closed(&self) -> bool {
        self.is_foreign() || self.shared.is_gone() || lock(&self.jobs).is_none()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // A motion that nobody follows any more is stopped: the thread ends behind it.
        self.shared.halt();
    }
}

/// Does what is asked for, one thing after the other; in between statuses are taken, so that none of them is old. What moves at the end is
/// stopped.
fn serve(machine: &mut Machine, waiting: Receiver<Job>) {
    loop {
        let job = if machine.time_passes() {
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
                Some(job) => job(machine),
                None => machine.idle(),
            }
            machine.look();
        }));
        if done.is_err() {
            // What broke is not known, so nothing but a Stop is sent any more.
            machine.shared.set_gone();
            drop(waiting);
            let _ = catch_unwind(AssertUnwindSafe(|| machine.abandon()));
            return;
        }
    }
    // Nobody is left to report to; the controller was sent what could be sent.
    let _ = machine.rest();
}
