//! Errors of a session with the board, value and limit that they are about.

use host_kit::Diagnose;
use pyo3::prelude::*;
use ucom_host::files::signals::ValueError;
use ucom_host::master::{
    AddressError, Error, ExchangeError, IdentityError, RunningError, SignalError, StatusError,
};
use ucom_host::session::{SessionError, ValuesError};

use crate::error::Failure;

/// An error on its way to Python, and the board that it is about.
#[derive(Clone, Debug)]
pub struct BoardFailure {
    /// What is the same for all errors.
    pub failure: Box<Failure>,
    /// The board; `None`: it is about none, or about several.
    pub board: Option<u8>,
}

impl BoardFailure {
    /// Of an error of the libraries about a board.
    pub fn about(error: &impl Diagnose, board: Option<u8>) -> Self {
        Self { failure: Box::new(plain(Failure::of(error))), board }
    }

    /// An argument that is none.
    pub fn usage(message: impl Into<String>) -> Self {
        Failure::usage(message).into()
    }
}

/// Commands are shown as they are typed.
fn plain(failure: Failure) -> Failure {
    Failure { next: failure.next.replace('`', ""), ..failure }
}

impl From<Failure> for BoardFailure {
    fn from(failure: Failure) -> Self {
        Self { failure: Box::new(failure), board: None }
    }
}

impl From<SessionError> for BoardFailure {
    fn from(error: SessionError) -> Self {
        let mut own = Self::about(&error, board(&error));
        let facts = &mut own.failure.facts;
        (facts.value, facts.limit) = values(&error).unwrap_or_default();
        own
    }
}

impl From<BoardFailure> for PyErr {
    fn from(BoardFailure { failure, board }: BoardFailure) -> Self {
        let error = Self::from(*failure);
        Python::attach(|py| match error.value(py).setattr("board", board) {
            Ok(()) => error,
            Err(other) => other,
        })
    }
}

fn board(error: &SessionError) -> Option<u8> {
    match error {
        SessionError::Procedure(error) => of_procedure(error),
        SessionError::Values(
            ValuesError::NoSignal { board, .. }
            | ValuesError::Value { board, .. }
            | ValuesError::Twice { board, .. }
            | ValuesError::NotMeant { board, .. }
            | ValuesError::Unknown { board, .. },
        ) => Some(*board),
        SessionError::BusOff { failure, .. } | SessionError::Partly { failure, .. } => board(failure),
        SessionError::LeftLoop { boards } => only(boards),
        SessionError::NoNames { failed } => match failed.as_slice() {
            [(board, _)] => Some(*board),
            _ => None,
        },
        _ => None,
    }
}

/// The board that an error of a procedure is about.
pub fn of_procedure(error: &Error) -> Option<u8> {
    match error {
        Error::Exchange(
            ExchangeError::NoBoard { number: board, .. }
            | ExchangeError::NoAnswer { board, .. }
            | ExchangeError::Incomplete { board, .. }
            | ExchangeError::Contradiction { board, .. }
            | ExchangeError::Device { board, .. },
        )
        | Error::Identity(
            IdentityError::WrongSequence { board, .. }
            | IdentityError::WrongBoard { board, .. }
            | IdentityError::NumberShared { board, .. },
        )
        | Error::Address(AddressError::MayTakeNumber { board, .. })
        | Error::Status(
            StatusError::StatusNotTaken { board, .. }
            | StatusError::NotReached { board, .. }
            | StatusError::AdminRefused { board, .. },
        )
        | Error::Running(RunningError::Lost { board })
        | Error::Signal(
            SignalError::NoSignal { board, .. }
            | SignalError::NoApplication { board, .. }
            | SignalError::StaleNames { board },
        ) => Some(*board),
        Error::Running(RunningError::Running { boards } | RunningError::LoopRuns { boards }) => only(boards),
        _ => None,
    }
}

fn only(boards: &[u8]) -> Option<u8> {
    match boards {
        [board] => Some(*board),
        _ => None,
    }
}

/// What was found and what is allowed, in the unit of the message.
fn values(error: &SessionError) -> Option<(Option<f64>, Option<f64>)> {
    match error {
        SessionError::Procedure(Error::Running(RunningError::Load(load))) => {
            Some((Some(load.percent()), Some(f64::from(load.limit))))
        }
        SessionError::Values(ValuesError::Value { error, .. }) => match &**error {
            ValueError::Range { given, min, max, .. } => {
                let number = |text: &String| text.split_whitespace().next()?.parse::<f64>().ok();
                let (given, min, max) = (number(given)?, number(min)?, number(max)?);
                Some((Some(given), Some(if given < min { min } else { max })))
            }
            _ => None,
        },
        SessionError::Partly { failure, .. } | SessionError::BusOff { failure, .. } => values(failure),
        _ => None,
    }
}
