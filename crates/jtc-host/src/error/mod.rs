//! What can go wrong, with the facts in it, the kind of failure and the command that helps: an enum for each operation, and one
//! type for all of them.

mod check;
mod link;
mod motion;
mod parameters;
mod state;
mod upload;

use host_kit::ErrorKind;

pub use check::CheckError;
pub use link::LinkError;
pub(crate) use link::accepted;
pub use motion::MotionError;
pub use parameters::ParametersError;
pub use state::StateError;
pub use upload::UploadError;

use crate::arm::ParameterError;
use crate::file::FileError;
use crate::port::PortError;

/// What a caller can act on without knowing each error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnosis {
    /// What kind of failure it is.
    pub kind: ErrorKind,
    /// A short name for programs.
    pub code: &'static str,
    /// The next command or act that helps.
    pub next: String,
}

impl Diagnosis {
    fn new(kind: ErrorKind, code: &'static str, next: impl Into<String>) -> Self {
        Self { kind, code, next: next.into() }
    }
}

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

impl Error {
    /// Kind, name and what helps.
    pub fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Link(e) => e.diagnosis(),
            Self::State(e) => e.diagnosis(),
            Self::Upload(e) => e.diagnosis(),
            Self::Motion(e) => e.diagnosis(),
            Self::Parameters(e) => e.diagnosis(),
            Self::Check(e) => e.diagnosis(),
            Self::File(e) => Diagnosis::new(ErrorKind::Usage, "file", e.hint()),
            Self::Frame(_) => Diagnosis::new(
                ErrorKind::Usage,
                "frame",
                "`jtc traj check` and `jtc params show` show what the file holds",
            ),
            Self::Cancelled => {
                Diagnosis::new(ErrorKind::Fault, "cancelled", "`jtc status` shows where the arm is")
            }
        }
    }

    /// What kind of failure it is.
    pub fn kind(&self) -> ErrorKind {
        self.diagnosis().kind
    }

    /// A short name for programs.
    pub fn code(&self) -> &'static str {
        self.diagnosis().code
    }

    /// The next command or act that helps.
    pub fn hint(&self) -> String {
        self.diagnosis().next
    }
}
