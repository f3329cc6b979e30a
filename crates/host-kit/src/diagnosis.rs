//! Errors with a kind, a short name, a next step for the user, and details for programs.

use std::error::Error;
use std::io;

use crate::{ErrorKind, Facts, Next};

/// Description of an error that a caller can use without a `match` on the variants of the error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// Kind of the error.
    pub kind: ErrorKind,
    /// Short name of the error, for programs.
    pub code: &'static str,
    /// Next step for the user; empty if no step helps.
    pub next: Next,
}

impl Diagnosis {
    /// Creates a diagnosis from the kind, the short name and the next step of an error.
    pub fn new(kind: ErrorKind, code: &'static str, next: impl Into<Next>) -> Self {
        Self { kind, code, next: next.into() }
    }
}

/// Error with the information that users and programs need to act.
pub trait Diagnose: Error {
    /// Returns the kind, the short name and the next step of this error.
    fn diagnosis(&self) -> Diagnosis;

    /// Returns the board or joint of the error, the value and its limit.
    fn facts(&self) -> Facts {
        Facts::default()
    }

    /// Returns the kind of this error.
    fn kind(&self) -> ErrorKind {
        self.diagnosis().kind
    }

    /// Returns the short name of this error, for programs.
    fn code(&self) -> &'static str {
        self.diagnosis().code
    }

    /// Returns the next step, with the commands of the command line; empty if no step helps.
    fn hint(&self) -> String {
        self.diagnosis().next.to_string()
    }
}

/// Error of the operating system about a file or a thread.
impl Diagnose for io::Error {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "io", "")
    }
}
