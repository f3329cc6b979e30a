//! Errors of signals that cannot be read or written.
use core::fmt;

use host_kit::{Action, Diagnose, Diagnosis, ErrorKind, Next, next};

/// Reasons why a signal cannot be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// No signal of the board has the requested name.
    #[error("board {board} has no {kind} `{name}`{}", Near(near))]
    NoSignal {
        /// Board number.
        board: u8,
        /// Kind of the signal: `CI`, `SO` or `PAR`.
        kind: &'static str,
        /// Requested name.
        name: String,
        /// Names of similar signals.
        near: Vec<String>,
    },
    /// The board has no application, or its application is not started.
    #[error("board {board}: {}", if *valid { "its application is not started" } else { "it has no valid application" })]
    NoApplication {
        /// Board number.
        board: u8,
        /// `true` if the board has an application that is not running.
        valid: bool,
    },
    /// The board's description has changed since the user selected the values (D-36).
    #[error(
        "board {board}: its inputs, outputs and parameters differ from those that were read before from its \
         program"
    )]
    StaleNames {
        /// Board number.
        board: u8,
    },
}

impl Diagnose for SignalError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::NoSignal { board, .. } => Diagnosis::new(
                ErrorKind::Usage,
                "no-edge",
                next!("{} lists the names", BoardValues).of_board(*board),
            ),
            Self::NoApplication { board, valid: true } => Diagnosis::new(
                ErrorKind::Refused,
                "no-application",
                Next::from(Action::BoardStart).of_board(*board),
            ),
            Self::NoApplication { board, valid: false } => Diagnosis::new(
                ErrorKind::Refused,
                "no-application",
                Next::from(Action::BoardUpdate).of_board(*board),
            ),
            Self::StaleNames { board } => Diagnosis::new(
                ErrorKind::Refused,
                "stale-names",
                format!("`ucom io {board} --fresh` reads them again"),
            ),
        }
    }
}

struct Near<'a>(&'a [String]);

impl fmt::Display for Near<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() { Ok(()) } else { write!(f, "; similar: `{}`", self.0.join("`, `")) }
    }
}
