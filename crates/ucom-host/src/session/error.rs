//! Errors of a session. Either a procedure failed, or a file, a bus or a value that the procedure needs is not usable.
use can_link::{CanError, InvalidFrame, OpenError};
use host_kit::{Action, Diagnose, Diagnosis, ErrorKind, Facts, Next, next};

use super::bus_off;
use crate::files::InventoryError;
use crate::files::signals::ValueError;
use crate::master::error::of_one;
use crate::master::io::Kind;
use crate::master::{Error, ExchangeError, MasterError, Outcome, SignalError};

/// Reasons why a session did not carry out a request.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SessionError {
    /// A procedure failed.
    #[error(transparent)]
    Procedure(#[from] Error),
    /// The values are not valid for the boards, or the boards may not have received them.
    #[error(transparent)]
    Values(#[from] ValuesError),
    /// The inventory cannot be read.
    #[error(transparent)]
    Inventory(#[from] InventoryError),
    /// The bus cannot be opened.
    #[error("{0}")]
    Open(Box<OpenError>),
    /// The bus failed after it was opened.
    #[error("{0}")]
    Bus(CanError),
    /// The bus cannot carry the frame.
    #[error("{0}")]
    Frame(InvalidFrame),
    /// No answer was received while the controller of this computer was bus-off, so the request may never have been sent.
    #[error("{failure}; the CAN controller of this computer was bus-off meanwhile")]
    BusOff {
        /// Failure of the request.
        failure: Box<SessionError>,
        /// URL of the bus.
        url: String,
    },
    /// A board failed after other boards had been changed.
    #[error("{failure}; already changed: board {}", list(done))]
    Partly {
        /// Failure of the board.
        failure: Box<SessionError>,
        /// Boards that had been changed before the failure.
        done: Vec<u8>,
    },
    /// No board answers.
    #[error("no board answers")]
    NoBoards,
    /// The bus has boards, but no board has a number.
    #[error("{}", if *boards == 1 { "1 board reports, but it has no number".to_owned() } else { format!("{boards} boards report, but none has a number") })]
    NoNumbers {
        /// Number of boards without a number.
        boards: usize,
    },
    /// Boards were lost or have rebooted during the session.
    #[error("{}", losses(*lost, *rebooted))]
    Lost {
        /// Number of times that a board was lost.
        lost: usize,
        /// Number of times that a board rebooted.
        rebooted: usize,
    },
    /// Boards left their control loops without a command of this PC.
    #[error("{}", left(boards))]
    LeftLoop {
        /// Numbers of the boards that left their control loops.
        boards: Vec<u8>,
    },
    /// The names of the boards' inputs, outputs and parameters are not known.
    #[error("{}", unnamed(failed))]
    NoNames {
        /// Boards without known names, each with its error.
        failed: Vec<(u8, SessionError)>,
    },
    /// The type of the outcome does not match the request. An error in this library is the cause.
    #[error("unexpected outcome {0:?}")]
    Unexpected(Box<Outcome>),
}

/// Reasons why values cannot be sent to boards, or why the boards may not have received the values.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ValuesError {
    /// The board has no signal with this index.
    #[error("board {board} has no {} {index}", kind.name())]
    NoSignal {
        /// Board number.
        board: u8,
        /// Kind of the buffer.
        kind: Kind,
        /// Index of the signal in the buffer.
        index: u16,
    },
    /// The value is not valid for the signal.
    #[error("board {board}: {} `{name}`: {error}", kind.name())]
    Value {
        /// Board number.
        board: u8,
        /// Kind of the buffer.
        kind: Kind,
        /// Name of the signal that the user gave.
        name: String,
        /// Program ID of the board.
        program_id: u16,
        /// Reason why the value is not valid.
        error: Box<ValueError>,
    },
    /// The user gave two values for one signal.
    #[error("board {board}: {} `{name}` has two values", kind.name())]
    Twice {
        /// Board number.
        board: u8,
        /// Kind of the buffer.
        kind: Kind,
        /// Name of the signal.
        name: String,
    },
    /// The user gave a value for a board that is not selected.
    #[error("{board}.{name}: board {board} is not one of the boards to {to}")]
    NotMeant {
        /// Board number.
        board: u8,
        /// Name of the signal.
        name: String,
        /// Verb of the action for which the boards were selected.
        to: &'static str,
    },
    /// The PC sent values, but then the application was not running or the board did not answer. The board may not have received the
    /// values.
    #[error("board {board}: values were sent, but {why}: its values are unknown now{}", before(written))]
    Unknown {
        /// Board number.
        board: u8,
        /// Reason why the board may not have received the values.
        why: String,
        /// Boards that were written before this board; `None` if only one board is concerned.
        written: Option<Vec<u8>>,
    },
    /// A parameter file cannot be read, or contains no value.
    #[error("{message}")]
    File {
        /// Error message with the file's name.
        message: String,
        /// Remedy for the error.
        hint: &'static str,
    },
    /// A parameter file does not match the boards. The error contains one line for each difference between the file and the boards.
    #[error("{}", lines.join("\n"))]
    Misfit {
        /// Text lines, each with the file's name and the line number.
        lines: Vec<String>,
    },
}

impl SessionError {
    /// Returns `true` if the operator ended the procedure before it was complete.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Procedure(Error::Master(MasterError::Cancelled)))
    }

    /// Returns `true` if the error concerns only one board, so other boards may still answer.
    pub(crate) fn is_of_one_board(&self) -> bool {
        matches!(self, Self::Procedure(Error::Exchange(_) | Error::Identity(_) | Error::Signal(_)))
    }

    /// Returns `true` if the cause of the error is an application that exists but is not started.
    fn is_not_started(&self) -> bool {
        matches!(self, Self::Procedure(Error::Signal(SignalError::NoApplication { valid: true, .. })))
    }

    /// Returns `true` if a board did not answer.
    pub fn is_no_answer(&self) -> bool {
        match self {
            Self::Procedure(Error::Exchange(ExchangeError::NoAnswer { .. })) => true,
            Self::BusOff { failure, .. } => failure.is_no_answer(),
            _ => false,
        }
    }
}

impl Diagnose for SessionError {
    fn diagnosis(&self) -> Diagnosis {
        use ErrorKind::{Fault, NoLink, Usage};
        let (kind, code, next) = match self {
            Self::Procedure(e) => return e.diagnosis(),
            Self::Values(e) => return e.diagnosis(),
            Self::BusOff { failure, url } => {
                return Diagnosis { next: bus_off::next(url), ..failure.diagnosis() };
            }
            Self::Inventory(_) => (Usage, "usage", Next::default()),
            Self::Open(e) if matches!(**e, OpenError::Url(_)) => {
                (Usage, "usage", "ucom --help shows the forms of --bus".into())
            }
            Self::Open(_) => {
                (NoLink, "bus", "check that the bus exists and is up; ucom sim makes a simulated bus".into())
            }
            Self::Partly { failure, .. } => return failure.diagnosis(),
            Self::Bus(CanError::NotCarried { .. }) => (Usage, "usage", Next::default()),
            Self::Bus(_) => (NoLink, "bus", next!("check the bus with {}", ChainDoctor)),
            Self::Frame(_) => (Fault, "frame", Next::default()),
            Self::NoBoards => (NoLink, "no-boards", next!("find the cause with {}", ChainDoctor)),
            Self::NoNumbers { .. } => (NoLink, "no-numbers", next!("number the boards with {}", ChainInit)),
            Self::Lost { .. } => (Fault, "lost", next!("check bus and boards with {}", ChainDoctor)),
            Self::LeftLoop { .. } => (
                Fault,
                "left-loop",
                next!(
                    "find the cause with {}: another PC on the bus, lost heartbeats, or an application that \
                     stops",
                    ChainDoctor
                ),
            ),
            Self::NoNames { failed } => {
                let started = failed.iter().all(|(_, e)| e.is_not_started());
                let first = failed.first().map(|(_, e)| e.diagnosis());
                let mut diagnosis = first.unwrap_or(Diagnosis::new(NoLink, "no-boards", ""));
                if started {
                    let boards: Vec<u8> = failed.iter().map(|(board, _)| *board).collect();
                    diagnosis.next = Next::from(Action::BoardStart).of_boards(&boards);
                }
                return diagnosis;
            }
            Self::Unexpected(_) => (Fault, "internal", "this is an error in ucom; please report it".into()),
        };
        Diagnosis::new(kind, code, next)
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Procedure(e) => e.facts(),
            Self::Values(e) => e.facts(),
            Self::BusOff { failure, .. } | Self::Partly { failure, .. } => failure.facts(),
            Self::LeftLoop { boards } => of_one(boards),
            Self::NoNames { failed } => {
                let boards: Vec<u8> = failed.iter().map(|(board, _)| *board).collect();
                of_one(&boards)
            }
            _ => Facts::default(),
        }
    }
}

impl From<Outcome> for SessionError {
    fn from(outcome: Outcome) -> Self {
        Self::Unexpected(Box::new(outcome))
    }
}

impl Diagnose for ValuesError {
    fn diagnosis(&self) -> Diagnosis {
        use ErrorKind::{Fault, Refused, Usage};
        match self {
            Self::NoSignal { .. } | Self::NotMeant { .. } => Diagnosis::new(Usage, "usage", ""),
            Self::Twice { .. } => Diagnosis::new(Usage, "usage", "give each name once; nothing was sent"),
            Self::Value { error, program_id, .. } if matches!(**error, ValueError::Meaning { .. }) => {
                let next = format!(
                    "add program 0x{program_id:04X} to the signal table (ucom help edges), or give the word as 0x0000"
                );
                Diagnosis::new(Refused, "value", next)
            }
            Self::Value { board, .. } => Diagnosis::new(
                Refused,
                "value",
                next!("{} shows types, scales and units; a word as 0x05DC is sent as it is", BoardValues)
                    .of_board(*board),
            ),
            Self::Unknown { board, .. } => Diagnosis::new(
                Fault,
                "unknown",
                next!(
                    "{} shows the state of the board; {}, then write the values again",
                    BoardStatus,
                    BoardStart
                )
                .of_board(*board),
            ),
            Self::File { hint, .. } => Diagnosis::new(Usage, "usage", *hint),
            Self::Misfit { .. } => Diagnosis::new(
                Refused,
                "params",
                next!(
                    "nothing was written; {} shows names and ranges, {} the boards",
                    BoardValues,
                    BoardInfo
                ),
            ),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Value { board, error, .. } => match **error {
                ValueError::Range { value, limit, .. } => Facts::beyond(value, limit).at_board(*board),
                _ => Facts::default().at_board(*board),
            },
            Self::NoSignal { board, .. }
            | Self::Twice { board, .. }
            | Self::NotMeant { board, .. }
            | Self::Unknown { board, .. } => Facts::default().at_board(*board),
            Self::File { .. } | Self::Misfit { .. } => Facts::default(),
        }
    }
}

/// Returns the cause of the failure for each board. For several boards, the text also contains the next command for each board.
fn unnamed(failed: &[(u8, SessionError)]) -> String {
    let asked = "the names of inputs, outputs and parameters are not known";
    match failed {
        [(_, error)] => format!("{asked}: {error}"),
        _ => {
            let line = |(_, error): &(u8, SessionError)| format!("\n  {error}; next: {}", error.hint());
            format!("{asked}:{}", failed.iter().map(line).collect::<String>())
        }
    }
}

fn losses(lost: usize, rebooted: usize) -> String {
    let times = |n: usize, what: &str| match n {
        0 => None,
        1 => Some(format!("a board {what} once")),
        n => Some(format!("a board {what} {n} times")),
    };
    let what = [times(lost, "was lost"), times(rebooted, "has rebooted")];
    what.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn list(boards: &[u8]) -> String {
    boards.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
}

fn left(boards: &[u8]) -> String {
    match boards {
        [one] => format!("board {one} left its control loop by itself"),
        many => format!("boards {} left their control loops by themselves", list(many)),
    }
}

fn before(written: &Option<Vec<u8>>) -> String {
    match written.as_deref() {
        None => String::new(),
        Some([]) => "; no other board was written".into(),
        Some(boards) => format!("; already written: board {}", list(boards)),
    }
}
