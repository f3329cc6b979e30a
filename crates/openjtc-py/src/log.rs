//! The flight recorder: every tick of the last seconds before the first error, run again.

use std::path::PathBuf;

use jtc_host::log::Account;
use pyo3::prelude::*;

use crate::error::Failure;
use crate::run::Samples;

/// A log that was read from a controller.
#[pyclass(frozen, module = "openjtc._native")]
pub struct FlightLog {
    account: Account,
}

impl FlightLog {
    /// As Python has it.
    pub fn of(account: Account) -> Self {
        Self { account }
    }
}

#[pymethods]
impl FlightLog {
    /// What happened, what broke first in front.
    #[getter]
    fn story(&self) -> Vec<String> {
        self.account.story.lines()
    }

    /// Ticks, and how many of them a replay of the same program gave the same bits for.
    #[getter]
    fn replayed(&self) -> (usize, usize) {
        (self.account.replayed.ticks.len(), self.account.replayed.same)
    }

    /// What the recorder does: recording, or why it stopped.
    #[getter]
    fn state(&self) -> &'static str {
        self.account.log.state.name()
    }

    /// Each tick.
    fn samples(&self) -> Samples {
        crate::robot::samples_of(&self.account)
    }

    /// A recording as MCAP, with the log in it: `jtc log replay` reads it.
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
                .next("name another file, or pass overwrite=True")
        })?;
        py.detach(|| self.account.write(file, &path)).map_err(|error| Failure::of(&error))
    }
}

/// The class.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<FlightLog>()
}
