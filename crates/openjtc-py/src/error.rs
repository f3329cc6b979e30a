//! Converts library errors to Python exceptions with all their details.

use std::ops::{Deref, DerefMut};

use host_kit::{Diagnose, ErrorKind, Facts, FrontEnd, Next};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Failure that is raised as an exception in Python.
#[derive(Clone, Debug)]
pub struct Failure(host_kit::Failure);

impl Failure {
    /// Makes a failure from an error of the libraries.
    pub fn of(error: &impl Diagnose) -> Self {
        Self(host_kit::Failure::of(error))
    }

    /// Makes a failure of the given kind.
    pub fn new(kind: ErrorKind, code: &'static str, message: impl ToString) -> Self {
        Self(host_kit::Failure::new(kind, code, message))
    }

    /// Makes a failure for an invalid argument.
    pub fn usage(message: impl ToString) -> Self {
        Self(host_kit::Failure::usage(message))
    }

    /// Makes a failure for a request that a check refused before any action was started.
    pub fn refused(code: &'static str, message: impl ToString, next: impl Into<Next>) -> Self {
        Self::new(ErrorKind::Refused, code, message).next(next)
    }

    /// Makes a failure for an action that failed while it ran.
    pub fn fault(code: &'static str, message: impl ToString, next: impl Into<Next>) -> Self {
        Self::new(ErrorKind::Fault, code, message).next(next)
    }

    /// Sets the next step that is proposed to the user.
    pub fn next(self, next: impl Into<Next>) -> Self {
        Self(self.0.next(next))
    }

    /// Sets the facts of the failure, such as joint, value and limit.
    pub fn with(self, facts: Facts) -> Self {
        Self(self.0.with(facts))
    }

    /// Replaces the message of the failure.
    pub fn message(mut self, message: impl ToString) -> Self {
        self.message = message.to_string();
        self
    }
}

impl Deref for Failure {
    type Target = host_kit::Failure;

    fn deref(&self) -> &host_kit::Failure {
        &self.0
    }
}

impl DerefMut for Failure {
    fn deref_mut(&mut self) -> &mut host_kit::Failure {
        &mut self.0
    }
}

impl<E: Diagnose> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::of(&error)
    }
}

/// Returns a next step in which commands of `jtc` are replaced by Python calls. Commands of `ucom` are not
/// replaced.
pub(crate) fn in_python(next: &Next) -> String {
    let text = next.sentence(FrontEnd::Python);
    if text.contains("`ucom ") { text.replace('`', "") } else { text }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| to_python(py, &failure).unwrap_or_else(|error| error))
    }
}

/// Returns the exception of `openjtc.errors` for this failure.
fn to_python(py: Python<'_>, failure: &Failure) -> PyResult<PyErr> {
    let host_kit::Failure { kind, code, message, next, facts } = &failure.0;
    let kind = match kind {
        ErrorKind::Fault if *code == "stopped" => "StoppedError",
        ErrorKind::Fault if *code == "held-stop" => "HeldStopError",
        ErrorKind::Usage => "UsageError",
        ErrorKind::NoLink => "NoLinkError",
        ErrorKind::Refused => "RefusedError",
        ErrorKind::Device => "DeviceError",
        ErrorKind::Fault => "FaultError",
    };
    let class = py.import("openjtc.errors")?.getattr(kind)?;
    let Facts { board, joint, point, value, limit, cause, held_stop } = &**facts;
    let next = in_python(next);
    let arguments = (message, code, joint, point, value, limit, cause, next, board);
    let instance = match held_stop {
        Some(stop) if kind == "HeldStopError" => {
            let more = PyDict::new(py);
            more.set_item("kind", &stop.kind)?;
            more.set_item("unit", stop.unit)?;
            more.set_item("text", &stop.text)?;
            class.call(arguments, Some(&more))?
        }
        _ => class.call1(arguments)?,
    };
    if !instance.is_instance_of::<pyo3::exceptions::PyException>() {
        return Err(PyRuntimeError::new_err(message.clone()));
    }
    Ok(PyErr::from_value(instance))
}
