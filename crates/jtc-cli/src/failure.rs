//! Why a command did not do what it was asked for: words, the next command, and the exit code.

use std::fmt::Display;

use cli_kit::output_file::OutputError;
use jtc_host::file::FileError;
use jtc_host::port::PortError;
use jtc_host::recording::RecordingError;
use jtc_host::{CheckError, LinkError, ParametersError, StateError};
use serde_json::json;

pub use cli_kit::exit::{FAULT, NO_LINK, REFUSED, USAGE};

/// The end of a command that failed.
#[derive(Debug)]
pub struct Failure {
    /// Exit code of the process.
    pub exit: u8,
    /// Short name for programs.
    pub code: String,
    /// What is wrong, with the facts.
    pub message: String,
    /// The next command or act; empty when there is none.
    pub hint: String,
    /// The result was printed already: only the exit code is left to return.
    pub printed: bool,
}

impl Failure {
    /// Wrong usage or unreadable input.
    pub fn usage(message: impl Display) -> Self {
        Self {
            exit: USAGE,
            code: "usage".into(),
            message: message.to_string(),
            hint: String::new(),
            printed: false,
        }
    }

    /// An error of the library.
    pub fn of(e: &jtc_host::Error) -> Self {
        Self {
            exit: cli_kit::exit::of(e.kind()),
            code: e.code().into(),
            message: e.to_string(),
            hint: e.hint(),
            printed: false,
        }
    }

    /// With the next command or act.
    pub fn hint(self, hint: impl Display) -> Self {
        Self { hint: hint.to_string(), ..self }
    }

    /// Of a command that has a port: it was not used.
    pub fn nothing_sent(failure: impl Into<Self>) -> Self {
        let failure = failure.into();
        Self { message: format!("{}; nothing was sent", failure.message), ..failure }
    }

    /// What was measured cannot be written, after it was measured: what the command was run for is lost.
    pub fn output_lost(failure: impl Into<Self>) -> Self {
        let failure = failure.into();
        let message = format!("{}; what was recorded is lost", failure.message);
        Self { exit: FAULT, code: "output-lost".into(), message, ..failure }
            .hint("make room or name another place, and run again")
    }

    /// Of a recording that broke off: what was written before is in it.
    pub fn recording_broken_off(self) -> Self {
        let message = format!("{}; the recording ends where that happened", self.message);
        Self { exit: FAULT, code: "output-lost".into(), message, ..self }
            .hint("make room or name another place, and run again")
    }

    /// As programs read it.
    pub fn to_json(&self) -> serde_json::Value {
        let Self { exit, code, message, hint, .. } = self;
        json!({ "code": code, "message": message, "hint": hint, "exit": exit })
    }

    /// A verdict that was printed as the command's result.
    pub fn printed(exit: u8) -> Self {
        Self { exit, code: String::new(), message: String::new(), hint: String::new(), printed: true }
    }
}

impl From<jtc_host::Error> for Failure {
    fn from(e: jtc_host::Error) -> Self {
        Self::of(&e)
    }
}

/// The library's errors of single operations.
macro_rules! from_library {
    ($($error:ty),*) => {$(
        impl From<$error> for Failure {
            fn from(e: $error) -> Self {
                jtc_host::Error::from(e).into()
            }
        }
    )*};
}

from_library!(PortError, FileError, LinkError, StateError, ParametersError, CheckError);

impl From<RecordingError> for Failure {
    fn from(e: RecordingError) -> Self {
        Self { code: "recording".into(), ..Self::usage(e) }
    }
}

impl From<OutputError> for Failure {
    fn from(e: OutputError) -> Self {
        Self { exit: e.exit, code: e.code.into(), hint: e.hint.into(), ..Self::usage(e.message) }
    }
}

impl From<std::io::Error> for Failure {
    fn from(e: std::io::Error) -> Self {
        Self { code: "io".into(), ..Self::usage(e) }
    }
}
