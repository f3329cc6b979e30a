//! Log of the flight recorder: every tick of the last seconds before the first error. The log can be replayed.

use std::path::PathBuf;

use jtc_host::log::Account;
use pyo3::prelude::*;

use crate::error::Failure;
use crate::run::Samples;

/// Flight recorder log that was read from a controller.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct FlightLog {
    account: Account,
}

impl FlightLog {
    /// Wraps a log for Python.
    pub(crate) fn of(account: Account) -> Self {
        Self { account }
    }
}

#[pymethods]
impl FlightLog {
    /// Timeline as text, beginning with the first failure.
    #[getter]
    fn story(&self) -> Vec<String> {
        self.account.story.lines()
    }

    /// Number of ticks in the log, and number of ticks that the replay with the same program reproduced bit for bit.
    #[getter]
    fn replayed(&self) -> (usize, usize) {
        (self.account.replayed.ticks.len(), self.account.replayed.same)
    }

    /// State of the recorder: recording, or the reason why the recorder has stopped.
    #[getter]
    fn state(&self) -> &'static str {
        self.account.log.state.name()
    }

    /// Returns one sample for each tick.
    fn samples(&self) -> Samples {
        crate::robot::samples_of(&self.account)
    }

    /// Saves an MCAP recording that contains the log; `jtc log replay` reads it.
    #[pyo3(signature = (path, overwrite=false))]
    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> Result<(), Failure> {
        let mut options = std::fs::OpenOptions::new();
        options.write(true);
        if overwrite {
            options.create(true).truncate(true)
        } else {
            options.create_new(true)
        };
        let file = options.open(&path).map_err(|error| {
            Failure::usage(format!("{}: {error}", path.display()))
                .next("choose another file, or pass overwrite=True")
        })?;
        py.detach(|| self.account.write(file, &path)).map_err(|error| Failure::of(&error))
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<FlightLog>()
}
