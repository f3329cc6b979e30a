//! Why a command did not do what it was asked for: words, the next command, and the exit code.

use std::fmt::Display;

use can_link::CanError;
use cli_kit::output_file::OutputError;

pub use cli_kit::exit::{DEVICE, FAULT, NO_LINK, REFUSED, USAGE, of as exit};

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
    /// The result was printed already: only the exit code is left.
    pub printed: bool,
}

impl Failure {
    /// An end with an exit code and a short name.
    pub fn new(exit: u8, code: &str, message: impl Display) -> Self {
        Self { exit, code: code.into(), message: message.to_string(), hint: String::new(), printed: false }
    }

    /// Wrong usage or unreadable input.
    pub fn usage(message: impl Display) -> Self {
        Self::new(USAGE, "usage", message)
    }

    /// With the next command or act.
    pub fn hint(self, hint: impl Display) -> Self {
        Self { hint: hint.to_string(), ..self }
    }

    /// Of a command that has a bus: it was not used.
    pub fn nothing_sent(failure: impl Into<Self>) -> Self {
        let failure = failure.into();
        Self { message: format!("{}; nothing was sent", failure.message), ..failure }
    }

    /// A verdict that was printed as the command's result.
    pub fn printed(exit: u8) -> Self {
        Self { printed: true, ..Self::new(exit, "", "") }
    }
}

impl From<CanError> for Failure {
    fn from(e: CanError) -> Self {
        match e {
            CanError::Url(e) => Self::usage(e).hint("ucom --help shows the forms of --bus"),
            e => Self::new(NO_LINK, "bus", e).hint("is the bus there and up? ucom sim makes a simulated one"),
        }
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
