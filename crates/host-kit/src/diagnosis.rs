//! Errors with a kind, a short name, a next step and details for programs.

use std::error::Error;
use std::io;

use crate::{ErrorKind, Facts, Next};

/// Parts of an error that a caller can use without a `match` of its variants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// Kind of failure.
    pub kind: ErrorKind,
    /// A short name for programs.
    pub code: &'static str,
    /// Next step for the user; empty if no step helps.
    pub next: Next,
}

impl Diagnosis {
    /// Creates a diagnosis from kind, short name and next step.
    pub fn new(kind: ErrorKind, code: &'static str, next: impl Into<Next>) -> Self {
        Self { kind, code, next: next.into() }
    }
}

/// Error with the information that users and programs need to act.
pub trait Diagnose: Error {
    /// Returns kind, name and next step.
    fn diagnosis(&self) -> Diagnosis;

    /// Returns the board or joint of the error, the value and the limit.
    fn facts(&self) -> Facts {
        Facts::default()
    }

    /// Returns the kind of failure.
    fn kind(&self) -> ErrorKind {
        self.diagnosis().kind
    }

    /// Returns a short name for programs.
    fn code(&self) -> &'static str {
        self.diagnosis().code
    }

    /// Returns the next step in the words of the command line; empty if no step helps.
    fn hint(&self) -> String {
        self.diagnosis().next.to_string()
    }
}

/// An error of the operating system about a file or a thread.
impl Diagnose for io::Error {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "io", "")
    }
}
