//! What can go wrong in a procedure, with the facts in it, the kind of failure and the command that helps.
use crate::master::error::address::AddressError;
use crate::master::error::exchange::ExchangeError;
use crate::master::error::facts::Facts;
use crate::master::error::identity::IdentityError;
use crate::master::error::master::MasterError;
use crate::master::error::plan::PlanError;
use crate::master::error::running::RunningError;
use crate::master::error::signal::SignalError;
use crate::master::error::status::StatusError;
use host_kit::ErrorKind;

/// Why a procedure did not do what was asked.
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
    /// The board's image or plan cannot be sent.
    Plan(#[from] PlanError),
    /// This PC did not begin the procedure, or ended it.
    Master(#[from] MasterError),
}

impl Error {
    fn facts(&self) -> Facts {
        match self {
            Self::Exchange(e) => e.facts(),
            Self::Identity(e) => e.facts(),
            Self::Address(e) => e.facts(),
            Self::Status(e) => e.facts(),
            Self::Running(e) => e.facts(),
            Self::Signal(e) => e.facts(),
            Self::Plan(e) => e.facts(),
            Self::Master(e) => e.facts(),
        }
    }

    /// What kind of failure it is. An update has its own, see
    /// [`UpdateReport::failure`](crate::master::update::UpdateReport::failure).
    pub fn kind(&self) -> ErrorKind {
        self.facts().0
    }

    /// A short name for programs.
    pub fn code(&self) -> &'static str {
        self.facts().1
    }

    /// The likely cause and the next command or act that helps.
    pub fn hint(&self) -> String {
        self.facts().2
    }
}
