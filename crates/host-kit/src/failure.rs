//! Common failure type of all front ends. Commands, agents and the Python package show failures of this type.

use crate::{Diagnose, Diagnosis, ErrorKind, Facts, Next};

/// Reason why a request was not carried out.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Kind of the failure. The kind determines the exit code of a command, the HTTP status of an agent and the
    /// exception in Python.
    pub kind: ErrorKind,
    /// Short name of the failure, for programs.
    pub code: &'static str,
    /// Sentence for the user. The sentence names the request, the board or joint, the value and the limit.
    pub message: String,
    /// Next step for the user; empty if no step helps.
    pub next: Next,
    /// Board or joint of the failure, with the value and its limit.
    pub facts: Box<Facts>,
}

impl Failure {
    /// Creates a failure without a next step and without details.
    pub fn new(kind: ErrorKind, code: &'static str, message: impl ToString) -> Self {
        Self { kind, code, message: message.to_string(), next: Next::default(), facts: Box::default() }
    }

    /// Creates a failure with the kind, short name, message, next step and facts of a library's error.
    pub fn of(error: &impl Diagnose) -> Self {
        let Diagnosis { kind, code, next } = error.diagnosis();
        Self::new(kind, code, error).next(next).with(error.facts())
    }

    /// Creates a failure for wrong usage or unreadable input.
    pub fn usage(message: impl ToString) -> Self {
        Self::new(ErrorKind::Usage, "usage", message)
    }

    /// Sets the next step for the user.
    pub fn next(self, next: impl Into<Next>) -> Self {
        Self { next: next.into(), ..self }
    }

    /// Sets the facts of the failure.
    pub fn with(self, facts: Facts) -> Self {
        Self { facts: Box::new(facts), ..self }
    }

    /// Creates a failure whose reason is already in the printed result. The failure has a kind but no code.
    pub fn shown(kind: ErrorKind) -> Self {
        Self::new(kind, "", "")
    }

    /// Returns `true` if the printed result already contains the reason.
    pub fn is_shown(&self) -> bool {
        self.code.is_empty()
    }

    /// Adds to the message that nothing was sent on the port or the bus. A failure whose reason is already printed
    /// stays unchanged.
    pub fn nothing_sent(failure: impl Into<Self>) -> Self {
        let failure = failure.into();
        if failure.is_shown() {
            return failure;
        }
        Self { message: format!("{}; nothing was sent", failure.message), ..failure }
    }
}

impl<E: Diagnose> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::of(&error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shown_failure_gets_no_message() {
        let shown = Failure::nothing_sent(Failure::shown(ErrorKind::Refused));
        assert!(shown.is_shown() && shown.message.is_empty(), "{shown:?}");
        let told = Failure::nothing_sent(Failure::usage("no such file"));
        assert_eq!((told.is_shown(), &*told.message), (false, "no such file; nothing was sent"));
    }
}
