//! Thread that owns a session and runs requests in order. A stop is executed before all other requests.

use std::sync::{Arc, Mutex, mpsc};
use std::thread::JoinHandle;
use std::time::Duration;

use host_kit::ErrorKind;
use host_kit::owner::{Act, Kind, Refused, Request};
use pyo3::prelude::*;
use serde_json::Value;
use ucom_host::session::Link;

use super::shared::{Halt, Shared, failure, fault};
use super::worker_state::{Config, WorkerState};
use crate::error::Failure;
use crate::json;
use crate::threads::{Process, join, lock};

/// Interval of the checks for signals (Ctrl-C) while Python waits.
pub(super) const LOOK: Duration = Duration::from_millis(50);

/// Message to a call that waits.
enum Message<T> {
    Progress(Value),
    Done(Result<T, Failure>),
}

/// Channel that delivers the answers to a request.
type Answers<T> = Mutex<mpsc::Receiver<Message<T>>>;

/// Handle of the thread that owns a session.
pub(super) struct Owner {
    pub shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
    process: Process,
}

impl Owner {
    /// Starts the thread on an open bus.
    pub(super) fn new(config: Config, link: Link) -> Self {
        let shared = Arc::new(Shared::default());
        let own = shared.clone();
        let thread = std::thread::spawn(move || {
            // The guard closes the queue when this thread ends, also after a fault. Callers therefore do not wait
            // forever.
            let gone = Gone(&own);
            let mut state = WorkerState::new(own.clone(), config, link);
            match state.serve() {
                Ok(()) => {
                    own.left(state.leave());
                    own.close(failure(ErrorKind::NoLink, "closed", "the chain is closed", "connect again"));
                }
                Err(error) => {
                    own.left(state.started());
                    own.close(error.into());
                }
            }
            drop(gone);
        });
        Self { shared, thread: Mutex::new(Some(thread)), process: Process::this() }
    }

    /// Sends a request and waits for its result without holding the GIL. Ctrl-C cancels the request, and stops all boards that this
    /// session has started.
    pub(super) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let after = self.now()?;
        self.call_after(py, after, act)
    }

    /// Like [`Self::call`], for a request that was made when `after` was the number of the last Stop (see
    /// [`Self::now`]).
    pub(super) fn call_after<T: Send + 'static>(
        &self,
        py: Python<'_>,
        after: u64,
        act: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        self.call_with(py, (Kind::Command, after), None, |state, _| act(state))
    }

    /// Returns the number of the last Stop. A method that reads files before its request must call this function first. A Stop while
    /// the method reads the files is then detected.
    pub(super) fn now(&self) -> Result<u64, Failure> {
        // In a forked process, the lock of the queue is perhaps never released, so the process is checked first.
        self.is_here()?;
        Ok(self.shared.queue.stops())
    }

    /// Like [`Self::call_after`], but calls `progress` with each progress report.
    pub(super) fn call_with<T: Send + 'static>(
        &self,
        py: Python<'_>,
        (kind, after): (Kind, u64),
        progress: Option<&Bound<'_, PyAny>>,
        act: impl FnOnce(&mut WorkerState, &dyn Fn(Value)) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        self.is_here()?;
        let before = self.shared.last_event();
        let (id, act, answers) = self.request(act);
        self.shared.queue.put(Request { kind, after, tag: id, act });
        loop {
            self.is_here()?;
            let reported = match self.wait(py, &answers)? {
                Received::Done(result) => return Ok(result?),
                Received::Progress(value) => progress.map_or(Ok(()), |progress| {
                    json::to_python(py, &value).and_then(|value| progress.call1((value,))).map(drop)
                }),
                Received::Nothing => Ok(()),
            };
            // Signals are also checked here, because reports can arrive without a pause.
            let result = reported.and_then(|()| py.check_signals());
            if let Err(error) = result {
                self.shared.queue.cancel(|request| *request == id);
                self.interrupted(py);
                self.add_outcomes(py, before, &error);
                return Err(error);
            }
        }
    }

    /// Adds the result of each board to the exception that ended an update. An update that ends with an exception returns no report.
    fn add_outcomes(&self, py: Python<'_>, after: u64, error: &PyErr) {
        for text in self.shared.outcomes(after) {
            // Errors are ignored: exceptions accept notes only since Python 3.11, and the events contain the same
            // texts.
            let _ = error.value(py).call_method1("add_note", (text,));
        }
    }

    /// After a Ctrl-C, stops all boards that this session has started, and waits until they are stopped. A second
    /// Ctrl-C only ends the wait.
    pub(super) fn interrupted(&self, py: Python<'_>) {
        if !self.process.is_this() {
            return;
        }
        let answers = self.overtake(Halt::Started, |state| {
            state.leave();
            Ok(())
        });
        while let Ok(Received::Nothing) = self.wait(py, &answers) {
            if py.check_signals().is_err() {
                return;
            }
        }
    }

    /// Stops boards at once, even in the middle of a request, and then runs `act`.
    pub(super) fn stop<T: Send + 'static>(
        &self,
        py: Python<'_>,
        halt: Halt,
        act: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        self.is_here()?;
        let answers = self.overtake(halt, act);
        loop {
            match self.wait(py, &answers)? {
                Received::Done(result) => return Ok(result?),
                // A signal needs no further stop here, because the stop is already in progress.
                _ => py.check_signals()?,
            }
        }
    }

    /// Checks that the thread belongs to this process. After a fork, the thread belongs to the parent process.
    fn is_here(&self) -> Result<(), Failure> {
        match self.process.is_this() {
            true => Ok(()),
            false => Err(failure(
                ErrorKind::Usage,
                "forked",
                "the chain belongs to the parent process of this process",
                "connect in the process that uses the chain",
            )),
        }
    }

    /// Requests a Stop. The thread sends the stop frames of `halt` at once, and runs `act` before all other requests.
    fn overtake<T: Send + 'static>(
        &self,
        halt: Halt,
        act: impl FnOnce(&mut WorkerState) -> Result<T, Failure> + Send + 'static,
    ) -> Answers<T> {
        let (id, act, answers) = self.request(|state, _| act(state));
        self.shared.queue.stop(id, act);
        // The current request is cancelled first, so that it sends no frame after the stop frames.
        self.shared.halt(halt);
        self.shared.queue.refuse_late();
        answers
    }

    /// Returns the number of a new request, the function that the queue runs for it, and the channel for the answers.
    fn request<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut WorkerState, &dyn Fn(Value)) -> Result<T, Failure> + Send + 'static,
    ) -> (u64, Act<WorkerState>, Answers<T>) {
        let (sender, answers) = mpsc::channel();
        let id = self.shared.next_id();
        let own = self.shared.clone();
        let act = move |state: Result<&mut WorkerState, Refused>| {
            let report = |value| drop(sender.send(Message::Progress(value)));
            let done = state.map_err(|refused| own.refusal(refused)).and_then(|state| {
                let done = act(state, &report);
                state.settle();
                done
            });
            // Errors are ignored, because a caller that has stopped waiting does not need an answer.
            let _ = sender.send(Message::Done(done));
        };
        self.shared.asked();
        (id, Box::new(act), Mutex::new(answers))
    }

    fn wait<T: Send>(&self, py: Python<'_>, answers: &Answers<T>) -> PyResult<Received<T>> {
        py.detach(|| match lock(answers).recv_timeout(LOOK) {
            Ok(Message::Progress(value)) => Ok(Received::Progress(value)),
            Ok(Message::Done(result)) => Ok(Received::Done(result)),
            Err(mpsc::RecvTimeoutError::Timeout) => Ok(Received::Nothing),
            Err(mpsc::RecvTimeoutError::Disconnected) => Err(fault().into()),
        })
    }

    /// Stops all boards that this session has started, and releases the bus. Returns the boards that possibly still
    /// run.
    pub(super) fn close(&self, py: Python<'_>) -> PyResult<Vec<u8>> {
        if !self.process.is_this() {
            // A forked process does not have the thread, and the boards belong to the parent process.
            return Ok(Vec::new());
        }
        self.shared.end();
        join(py, &self.thread)?;
        Ok(self.shared.take_left())
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        // The thread stops the started boards. The destructor does not wait for the thread, because the caller may hold the GIL.
        self.shared.end();
    }
}

/// Result of one short wait.
enum Received<T> {
    Nothing,
    Progress(Value),
    Done(Result<T, Failure>),
}

struct Gone<'a>(&'a Shared);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.all_left();
        }
        self.0.close(fault());
    }
}
