//! Errors of this library. Each error contains facts, a kind of failure and the next command for the user. Each
//! operation has its own error enum, and [`Error`] combines these enums.

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

/// Any error of this library. Operations that can return errors of several enums use this type.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Error in the communication with the controller.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Error while the library waited for a state of the controller.
    #[error(transparent)]
    State(#[from] StateError),
    /// Error during the upload of a trajectory.
    #[error(transparent)]
    Upload(#[from] UploadError),
    /// Error before or during the execution of a motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// Error while parameters were sent to the controller.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
    /// Error from the check of a trajectory.
    #[error(transparent)]
    Check(#[from] CheckError),
    /// Error while all values of an arm were read, sent or stored.
    #[error(transparent)]
    Extension(#[from] ExtensionError),
    /// A file cannot be read or its content is not valid.
    #[error(transparent)]
    File(#[from] FileError),
    /// A number or a count is out of range for its serial frame.
    #[error(transparent)]
    Frame(#[from] jtc_wire::EncodeError),
    /// The callback function of the caller cancelled the operation.
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
                next!("{} and `jtc params show` show the contents of the file", TrajCheck),
            ),
            Self::Cancelled => Diagnosis::new(
                ErrorKind::Fault,
                "cancelled",
                next!("{} shows the position of the arm", Status),
            ),
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
