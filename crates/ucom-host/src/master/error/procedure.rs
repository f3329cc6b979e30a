//! Errors of a procedure, with the facts, the kind of failure and the next command.
use crate::master::error::address::AddressError;
use crate::master::error::exchange::ExchangeError;
use crate::master::error::identity::IdentityError;
use crate::master::error::master::MasterError;
use crate::master::error::plan::{PlanError, TargetError};
use crate::master::error::running::RunningError;
use crate::master::error::signal::SignalError;
use crate::master::error::status::StatusError;
use host_kit::{Diagnose, Diagnosis, Facts};

/// Reasons why a procedure failed. A failed update returns a report instead; the kind of failure is in
/// [`UpdateReport::failure`](crate::master::update::UpdateReport::failure).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A board did not answer, or its answer was not valid.
    Exchange(#[from] ExchangeError),
    /// A board is not the intended one.
    Identity(#[from] IdentityError),
    /// Boards did not get their board numbers.
    Address(#[from] AddressError),
    /// A board did not reach the requested state.
    Status(#[from] StatusError),
    /// Control loops are running although the procedure does not allow this, or control loops cannot run.
    Running(#[from] RunningError),
    /// A signal cannot be read or written.
    Signal(#[from] SignalError),
    /// No board is selected for an update, or a board is selected twice.
    Target(#[from] TargetError),
    /// The PC cannot create a plan for an update.
    Plan(#[from] PlanError),
    /// This PC did not begin the procedure, or ended it early.
    Master(#[from] MasterError),
}

impl Diagnose for Error {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Exchange(e) => e.diagnosis(),
            Self::Identity(e) => e.diagnosis(),
            Self::Address(e) => e.diagnosis(),
            Self::Status(e) => e.diagnosis(),
            Self::Running(e) => e.diagnosis(),
            Self::Signal(e) => e.diagnosis(),
            Self::Target(e) => e.diagnosis(),
            Self::Plan(e) => e.diagnosis(),
            Self::Master(e) => e.diagnosis(),
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Exchange(
                ExchangeError::NoBoard { number: board, .. }
                | ExchangeError::NoAnswer { board, .. }
                | ExchangeError::Incomplete { board, .. }
                | ExchangeError::Contradiction { board, .. }
                | ExchangeError::Device { board, .. },
            )
            | Self::Identity(
                IdentityError::WrongSequence { board, .. }
                | IdentityError::WrongBoard { board, .. }
                | IdentityError::NumberShared { board, .. },
            )
            | Self::Address(AddressError::MayTakeNumber { board, .. })
            | Self::Status(
                StatusError::StatusNotTaken { board, .. }
                | StatusError::NotReached { board, .. }
                | StatusError::AdminRefused { board, .. },
            )
            | Self::Running(RunningError::Lost { board })
            | Self::Signal(
                SignalError::NoSignal { board, .. }
                | SignalError::NoApplication { board, .. }
                | SignalError::StaleNames { board },
            ) => Facts::default().at_board(*board),
            Self::Running(RunningError::Running { boards } | RunningError::LoopRuns { boards }) => {
                of_one(boards)
            }
            Self::Running(RunningError::Load(load)) => Facts::beyond(load.percent(), f64::from(load.limit)),
            _ => Facts::default(),
        }
    }
}

/// Returns the facts for a diagnosis. The facts contain the board number if `boards` contains exactly one board.
pub(crate) fn of_one(boards: &[u8]) -> Facts {
    match boards {
        [board] => Facts::default().at_board(*board),
        _ => Facts::default(),
    }
}
