//! Why a command did not do what it was asked for: a kind, a short name, what is wrong, and the next command.

use std::fmt::Display;

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use serde_json::{Value, json};

use crate::exit;

/// The end of a command that failed.
#[derive(Debug)]
pub struct Failure {
    /// What kind of failure it is.
    pub kind: ErrorKind,
    /// Short name for programs.
    pub code: &'static str,
    /// What is wrong, with the facts.
    pub message: String,
    /// The next command or act; empty when there is none.
    pub hint: String,
    /// The result was printed already: only the exit code is left.
    pub printed: bool,
}

impl Failure {
    /// An end of a kind, with a short name.
    pub fn new(kind: ErrorKind, code: &'static str, message: impl Display) -> Self {
        Self { kind, code, message: message.to_string(), hint: String::new(), printed: false }
    }

    /// Wrong usage or unreadable input.
    pub fn usage(message: impl Display) -> Self {
        Self::new(ErrorKind::Usage, "usage", message)
    }

    /// An error of a library.
    pub fn of(error: &impl Diagnose) -> Self {
        let Diagnosis { kind, code, next } = error.diagnosis();
        Self::new(kind, code, error).hint(next)
    }

    /// A verdict that was printed as the command's result.
    pub fn printed(kind: ErrorKind) -> Self {
        Self { printed: true, ..Self::new(kind, "", "") }
    }

    /// With the next command or act.
    pub fn hint(self, hint: impl Display) -> Self {
        Self { hint: hint.to_string(), ..self }
    }

    /// Of a command that has a port or a bus: it was not used.
    pub fn nothing_sent(failure: impl Into<Self>) -> Self {
        let failure = failure.into();
        Self { message: format!("{}; nothing was sent", failure.message), ..failure }
    }

    /// Exit code of the process.
    pub fn exit(&self) -> u8 {
        exit::of(self.kind)
    }

    /// As programs read it.
    pub fn to_json(&self) -> Value {
        let Self { code, message, hint, .. } = self;
        json!({ "code": code, "message": message, "hint": hint, "exit": self.exit() })
    }
}

impl<E: Diagnose> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::of(&error)
    }
}
