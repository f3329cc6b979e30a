//! What there is to know of an error beside its words: its kind, a short name, and what helps.

use std::error::Error;
use std::io;

use crate::ErrorKind;

/// What a caller can act on without knowing each error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// What kind of failure it is.
    pub kind: ErrorKind,
    /// A short name for programs.
    pub code: &'static str,
    /// The next command or act that helps; empty when there is none.
    pub next: String,
}

impl Diagnosis {
    /// A kind, a short name, and what helps.
    pub fn new(kind: ErrorKind, code: &'static str, next: impl Into<String>) -> Self {
        Self { kind, code, next: next.into() }
    }
}

/// An error that people and programs can act on.
pub trait Diagnose: Error {
    /// Kind, name and what helps.
    fn diagnosis(&self) -> Diagnosis;

    /// What kind of failure it is.
    fn kind(&self) -> ErrorKind {
        self.diagnosis().kind
    }

    /// A short name for programs.
    fn code(&self) -> &'static str {
        self.diagnosis().code
    }

    /// The next command or act that helps; empty when there is none.
    fn hint(&self) -> String {
        self.diagnosis().next
    }
}

/// What the system did not give: a file or a thread that a caller asked for.
impl Diagnose for io::Error {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "io", "")
    }
}
