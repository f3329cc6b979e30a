//! Handle of a running motion. Python threads use the handle to wait for the motion.

use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use pyo3::prelude::*;

use super::Link;
use super::motion::{Order, Ran};
use super::shared::{Pending, Progress};
use super::worker::{Waited, closed};
use crate::error::Failure;
use crate::number;
use crate::run::Samples;
use crate::threads::lock;

/// Interval between two checks for a result that another thread has received but not stored yet. The next constant is
/// the maximum number of checks.
const LOOK: Duration = Duration::from_millis(2);
const LOOKS: u32 = 50;

/// Samples of the run, and the error that ended the run.
type Came = (Py<Samples>, Option<Py<PyAny>>);
/// Samples and error of the run, or the error that prevented the motion.
type Over = Result<Came, Py<PyAny>>;

/// Motion that was started.
#[pyclass(frozen, module = "openjtc._native")]
pub(super) struct Motion {
    link: Py<Link>,
    came: Mutex<Receiver<Result<Ran, Failure>>>,
    over: Mutex<Option<Over>>,
    progress: Arc<Mutex<Progress>>,
}

impl Motion {
    /// Passes the motion to the thread of the connection. `asked` is the number of Stops at the time of the request.
    pub(super) fn begin(link: &Bound<'_, Link>, order: Order, asked: u64) -> Result<Self, Failure> {
        let worker = &link.get().worker;
        let progress = Arc::clone(&order.progress);
        *lock(&progress) = Progress { phase: "waiting", ..Progress::default() };
        let pending = Pending::begin(&worker.shared);
        let of_run = Arc::clone(&progress);
        // The guard `pending` belongs to the job. If the job never begins, the guard is dropped with the job, and the
        // run no longer counts as pending.
        let came = worker.ask(asked, move |state, asked| {
            let _pending = pending;
            let ran = state.run(&order, asked);
            *lock(&of_run) = Progress::default();
            ran
        })?;
        Ok(Self { link: link.clone().unbind(), came: Mutex::new(came), over: Mutex::new(None), progress })
    }

    fn is_over(&self, py: Python<'_>) -> Option<Over> {
        lock(&self.over).as_ref().map(|over| match over {
            Ok((samples, error)) => {
                Ok((samples.clone_ref(py), error.as_ref().map(|error| error.clone_ref(py))))
            }
            Err(error) => Err(error.clone_ref(py)),
        })
    }
}

fn raised(py: Python<'_>, failure: Failure) -> Py<PyAny> {
    PyErr::from(failure).into_value(py).into_any()
}

#[pymethods]
impl Motion {
    /// Returns the samples and the error that ended the motion. Returns `None` if the motion does not end within `timeout` (s). Every
    /// waiting thread gets the result.
    #[pyo3(signature = (timeout=None))]
    fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<Option<Came>> {
        let longest = timeout.map(|seconds| number::timeout(seconds, "timeout")).transpose()?;
        let worker = &self.link.get().worker;
        let mut looks = 0;
        loop {
            if let Some(over) = self.is_over(py) {
                return match over {
                    Ok(came) => Ok(Some(came)),
                    Err(error) => Err(PyErr::from_value(error.into_bound(py))),
                };
            }
            let over = match worker.wait_for(py, &self.came, longest)? {
                Waited::NotYet => return Ok(None),
                Waited::Came(Ok(mut ran)) => {
                    let error = ran.failure.take().map(|failure| raised(py, failure));
                    Ok((Py::new(py, Samples::of_run(ran))?, error))
                }
                Waited::Came(Err(failure)) => Err(raised(py, failure)),
                // Another thread has received the result and will store it soon.
                Waited::Gone if looks < LOOKS => {
                    looks += 1;
                    worker.pass(py, LOOK)?;
                    continue;
                }
                Waited::Gone => Err(raised(py, closed())),
            };
            *lock(&self.over) = Some(over);
            worker.look_for_signals(py)?;
        }
    }

    /// Returns the phase, and the completed and the total amount of the phase.
    fn progress(&self) -> (&'static str, f64, f64) {
        let progress = *lock(&self.progress);
        (progress.phase, progress.done, progress.total)
    }
}
