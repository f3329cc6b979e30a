//! What can go wrong in a procedure, with the facts in it, the kind of failure and the command that helps.
use crate::master::error::address::AddressError;
use crate::master::error::exchange::ExchangeError;
use crate::master::error::identity::IdentityError;
use crate::master::error::master::MasterError;
use crate::master::error::plan::{PlanError, TargetError};
use crate::master::error::running::RunningError;
use crate::master::error::signal::SignalError;
use crate::master::error::status::StatusError;
use host_kit::{Diagnose, Diagnosis};

/// Why a procedure did not do what was asked. The kind of an update that failed is that of its report, see
/// [`UpdateReport::failure`](crate::master::update::UpdateReport::failure).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A board did not answer as it must.
    Exchange(#[from] ExchangeError),
    /// A board is not the one that is meant.
    Identity(#[from] IdentityError),
    /// Boards did not get their numbers.
    Address(#[from] AddressError),
    /// A board did not reach a state.
    Status(#[from] StatusError),
    /// Control loops run, or cannot.
    Running(#[from] RunningError),
    /// A signal cannot be read or written.
    Signal(#[from] SignalError),
    /// Nobody knows which boards an update is for.
    Target(#[from] TargetError),
    /// An update cannot be planned.
    Plan(#[from] PlanError),
    /// This PC did not begin the procedure, or ended it.
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
}
