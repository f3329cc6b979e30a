//! Thread that runs the session with a controller, and the calls from Python threads to this thread.
//!
//! The thread owns the session. Python threads put requests into the queue of this thread and wait without the GIL. During the wait, these
//! threads check for Ctrl-C. Ctrl-C stops the arm before the exception is raised.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use host_kit::owner::{Act, Kind, NEVER_LATE, Refused, Request};
use jtc_sim::World;
use pyo3::prelude::*;

use super::shared::{Asked, Shared};
use super::worker_state::{Target, Way, WorkerState};
use crate::error::Failure;
use crate::threads::{Process, join, lock};

/// Interval at which a waiting thread checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);
/// Maximum wait for standstill after a Stop; a second Ctrl-C ends the wait.
const STANDSTILL: Duration = Duration::from_secs(15);

/// Result of a wait.
pub(super) enum Waited<T> {
    Came(T),
    /// The result of the request can no longer arrive.
    Gone,
    /// The result of the request has not arrived within the waiting time.
    NotYet,
}

/// Thread of a connection.
pub(super) struct Worker {
    simulated: bool,
    process: Process,
    /// Name of the port.
    pub port: String,
    pub shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

/// Returns the error that a call on a closed connection raises.
pub(super) fn closed() -> Failure {
    Failure::new(ErrorKind::NoLink, "closed", "the connection is closed")
        .next("connect again: `openjtc.connect(…)`")
}

impl Worker {
    /// Starts the thread. The thread then connects to the controller.
    pub(super) fn begin(py: Python<'_>, target: Target) -> PyResult<Self> {
        let shared = Arc::<Shared>::default();
        let simulated = matches!(target.way, Way::Simulated(_));
        let (opened, is_open) = channel::<Result<String, Failure>>();
        let own = Arc::clone(&shared);
        let asked = Asked::now(&shared);
        let body = move || {
            let _closing = Closing(Arc::clone(&own));
            match WorkerState::open(target, own, &asked) {
                Err(failure) => drop(opened.send(Err(failure))),
                Ok(mut state) => {
                    let _ = opened.send(Ok(state.port_name()));
                    serve(&mut state);
                }
            }
        };
        let thread = std::thread::Builder::new().name("openjtc".into()).spawn(body)?;
        let mut worker = Self {
            simulated,
            process: Process::this(),
            port: String::new(),
            shared,
            thread: Mutex::new(Some(thread)),
        };
        worker.port = worker.wait(py, is_open)??;
        Ok(worker)
    }

    /// Puts a request into the queue, and returns the channel for the result. `at` is the number of Stops that had
    /// been requested when the request was made. If a later Stop is requested before this request begins, the request
    /// is refused.
    pub(super) fn ask<T: Send + 'static>(
        &self,
        at: u64,
        job: impl FnOnce(&mut WorkerState, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        let asked = Asked::after(&self.shared, at);
        self.put(at, move |state| {
            state.begin(&asked)?;
            // A Stop was possibly requested while `begin` waited.
            if asked.is_halted() {
                return Err(jtc_host::Error::Cancelled.into());
            }
            job(state, &asked)
        })
    }

    fn put<T: Send + 'static>(
        &self,
        after: u64,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        if self.is_closed() {
            self.is_here()?;
            return Err(closed());
        }
        let (act, came) = act(job);
        self.shared.queue.put(Request { kind: Kind::Command, after, tag: (), act });
        self.wake();
        Ok(came)
    }

    /// Requests a Stop. The thread executes `job` before all other requests.
    fn overtake<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> Result<Receiver<Result<T, Failure>>, Failure> {
        self.is_here()?;
        let (act, came) = act(job);
        self.shared.queue.stop((), act);
        self.wake();
        self.shared.queue.refuse_late();
        Ok(came)
    }

    /// Wakes the thread that waits for a request.
    fn wake(&self) {
        if let Some(thread) = &*lock(&self.thread) {
            thread.thread().unpark();
        }
    }

    /// Checks that the thread belongs to this process. After a fork, the thread belongs to the parent process, and
    /// locks in the child process are perhaps never released.
    fn is_here(&self) -> Result<(), Failure> {
        if self.is_foreign() {
            return Err(closed()
                .next("the connection belongs to the process that opened it: connect in this process, too"));
        }
        Ok(())
    }

    /// Returns the number of Stops that were requested so far. A later Stop cancels all requests that were made
    /// before it.
    pub(super) fn now(&self) -> Result<u64, Failure> {
        self.is_here()?;
        Ok(self.shared.queue.stops())
    }

    /// Cancels all earlier requests and stops the motion of this connection. Does not wait.
    pub(super) fn halt(&self) {
        if !self.is_foreign() {
            self.shared.halt();
        }
    }

    /// Stops the arm, even if another program moves the arm, and waits for standstill. All earlier requests are cancelled.
    pub(super) fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.will_stop_all();
        let came = self.overtake(WorkerState::stop)?;
        Ok(self.wait(py, came)??)
    }

    /// Puts a request into the queue and waits for the result.
    pub(super) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut WorkerState, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.ask(self.now()?, job)?;
        Ok(self.wait(py, came)??)
    }

    /// Like [`Self::call`], for requests that a Stop does not cancel. Requests of this kind only read data or end Teaching.
    pub(super) fn call_always<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let came = self.put(NEVER_LATE, job)?;
        Ok(self.wait(py, came)??)
    }

    /// Waits for a result without the GIL. Ctrl-C stops the arm, and the exception is raised when the arm is at rest.
    pub(super) fn wait<T: Send>(&self, py: Python<'_>, came: Receiver<T>) -> PyResult<T> {
        match self.wait_for(py, &Mutex::new(came), None)? {
            Waited::Came(result) => {
                // Handles a Ctrl-C that arrived together with the result. Otherwise Python would raise the exception
                // without stopping the arm.
                self.look_for_signals(py)?;
                Ok(result)
            }
            Waited::Gone | Waited::NotYet => Err(closed().into()),
        }
    }

    /// Like [`Self::wait`], but waits at most for this time. If several threads wait for one result, exactly one thread receives the
    /// result.
    pub(super) fn wait_for<T: Send>(
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

    /// Sleeps for `time`. Other Python threads can run during the sleep.
    pub(super) fn pass(&self, py: Python<'_>, time: Duration) -> PyResult<()> {
        py.detach(|| std::thread::sleep(time));
        self.look_for_signals(py)
    }

    /// Checks for Ctrl-C and for other signals whose handlers raise an exception. The exception is raised after the arm is at rest.
    pub(super) fn look_for_signals(&self, py: Python<'_>) -> PyResult<()> {
        py.check_signals().inspect_err(|_| self.rest(py))
    }

    /// Stops the motion of this connection, cancels all earlier requests, and waits for standstill. A signal ends the wait.
    pub(super) fn rest(&self, py: Python<'_>) {
        let Ok(came) = self.overtake(WorkerState::rest).map(Mutex::new) else { return };
        let end = Instant::now() + STANDSTILL;
        while Instant::now() < end {
            let result = py.detach(|| lock(&came).recv_timeout(LOOK));
            if !matches!(result, Err(RecvTimeoutError::Timeout)) || py.check_signals().is_err() {
                return;
            }
        }
    }

    /// Applies a disturbance to the simulated arm. The thread applies disturbances during any job.
    pub(super) fn touch(&self, touch: impl FnOnce(&mut World) + Send + 'static) -> Result<(), Failure> {
        if self.is_closed() {
            return Err(closed());
        }
        if !self.simulated {
            return Err(Failure::usage("this needs a simulator: a program cannot push a real arm")
                .next("connect to a simulator with `openjtc.connect(\"sim:\")`"));
        }
        lock(&self.shared.touches).push(Box::new(touch));
        Ok(())
    }

    /// Refuses further requests, stops the motion and the teaching of this connection, waits for standstill, and ends the connection.
    /// Waiting requests are refused, except Stops. A signal ends the wait. A second caller only waits for the end.
    pub(super) fn end(&self, py: Python<'_>) -> PyResult<()> {
        if self.is_foreign() || self.shared.is_gone() {
            return Ok(());
        }
        // The connection is marked as ended before the Stop, so that no request can begin after the Stop.
        let rested = match self.shared.end() {
            true => {
                self.overtake(WorkerState::rest).map_err(PyErr::from).and_then(|came| self.wait(py, came))
            }
            false => Ok(Ok(())),
        };
        join(py, &self.thread)?;
        Ok(rested??)
    }

    /// Returns `true` if another process owns the connection.
    pub(super) fn is_foreign(&self) -> bool {
        !self.process.is_this()
    }

    /// Returns `true` if the connection does not accept further requests.
    pub(super) fn is_closed(&self) -> bool {
        self.is_foreign() || self.shared.is_gone() || self.shared.has_ended()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // The motion is stopped, because no caller supervises the motion any more. The thread ends after the motion.
        self.halt();
        self.shared.end();
        if !self.is_foreign() {
            self.wake();
        }
    }
}

/// Returns the function that the queue runs for a request, and the channel for the result.
fn act<T: Send + 'static>(
    job: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
) -> (Act<WorkerState>, Receiver<Result<T, Failure>>) {
    let (done, came) = channel();
    let act = move |state: Result<&mut WorkerState, Refused>| {
        let refused = |refused| match refused {
            Refused::Stopped | Refused::Cancelled => jtc_host::Error::Cancelled.into(),
            Refused::Closed => closed(),
        };
        let result = state.map_err(refused).and_then(|state| {
            let result = job(state);
            state.shared.queue.done();
            result
        });
        // An error is ignored, because the caller has perhaps stopped waiting for the result.
        let _ = done.send(result);
    };
    (Box::new(act), came)
}

/// Guard that closes the queue when the thread ends for any reason. A caller therefore does not wait forever for an answer.
struct Closing(Arc<Shared>);

impl Drop for Closing {
    fn drop(&mut self) {
        self.0.queue.close();
    }
}

/// Executes the requests in order. Reads statuses between requests, so that the last status is always recent. At the end, executes the
/// waiting Stops, and stops a motion of this connection.
fn serve(state: &mut WorkerState) {
    let shared = Arc::clone(&state.shared);
    while !shared.has_ended() || shared.queue.stop_waits() {
        let done = catch_unwind(AssertUnwindSafe(|| {
            match shared.queue.take() {
                Some(turn) => {
                    turn.run(state);
                    shared.queue.done();
                }
                None if state.time_passes() => state.idle(),
                None => std::thread::park(),
            }
            state.look();
        }));
        if done.is_err() {
            // After a panic the state is unknown, so only a Stop is sent.
            shared.set_gone();
            shared.queue.close();
            let _ = catch_unwind(AssertUnwindSafe(|| state.abandon()));
            return;
        }
    }
    shared.queue.close();
    // An error is ignored, because no caller can receive it here.
    let _ = state.rest();
}
