//! What can go wrong, with the facts in it, the kind of failure and the command that helps: an enum for each operation, and one
//! type for all of them.

mod check;
mod extension;
pub(crate) mod facts;
mod link;
mod motion;
mod parameters;
mod state;
mod upload;

pub use host_kit::{Diagnose, Diagnosis, Facts};
use host_kit::{ErrorKind, next};

pub use check::CheckError;
pub use extension::ExtensionError;
pub use facts::of_status as facts_of_status;
pub use link::LinkError;
pub(crate) use link::accepted;
pub use motion::MotionError;
pub use parameters::ParametersError;
pub use state::StateError;
pub use upload::UploadError;

use crate::arm::ParameterError;
use crate::file::FileError;
use crate::port::PortError;

/// Any failure of this library, where an operation can fail in ways of several.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Of an exchange with the controller.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Of waiting for a state.
    #[error(transparent)]
    State(#[from] StateError),
    /// Of an upload.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// Of an execution.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// Of giving parameters.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
    /// Of a check for a run.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// Of an arm as one thing.
    #[error(transparent)]
    Extension(#[from] ExtensionError),
    /// A file cannot be read or understood.
    #[error(transparent)]
    File(#[from] FileError),
    /// A number or a count that no frame carries.
    #[error(transparent)]
    Frame(#[from] jtc_wire::EncodeError),
    /// The caller's callback asked to end.
    #[error("cancelled")]
    Cancelled,
}

impl From<PortError> for Error {
    fn from(e: PortError) -> Self {
        LinkError::from(e).into()
    }
}

impl From<ParameterError> for Error {
    fn from(e: ParameterError) -> Self {
        ParametersError::from(e).into()
    }
}

impl Diagnose for Error {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Link(e) => e.diagnosis(),
            Self::State(e) => e.diagnosis(),
            Self::Upload(e) => e.diagnosis(),
            Self::Motion(e) => e.diagnosis(),
            Self::Parameters(e) => e.diagnosis(),
            Self::Check(e) => e.diagnosis(),
            Self::Extension(e) => e.diagnosis(),
            Self::File(e) => e.diagnosis(),
            Self::Frame(_) => Diagnosis::new(
                ErrorKind::Usage,
                "frame",
                next!("{} and `jtc params show` show what the file holds", TrajCheck),
            ),
            Self::Cancelled => {
                Diagnosis::new(ErrorKind::Fault, "cancelled", next!("{} shows where the arm is", Status))
            }
        }
    }

    fn facts(&self) -> Facts {
        match self {
            Self::State(e) => e.facts(),
            Self::Motion(e) => e.facts(),
            Self::Check(e) => e.facts(),
            Self::Extension(e) => e.facts(),
            Self::Link(e) => e.facts(),
            Self::Upload(e) => e.facts(),
            Self::Parameters(e) => e.facts(),
            Self::File(e) => e.facts(),
            Self::Frame(_) | Self::Cancelled => Facts::default(),
        }
    }
}
