//! Errors of waiting for a state.

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_wire::Status;

use crate::words;

/// Why the controller did not come to the state that was waited for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The controller reports errors.
    #[error("the controller reports an error: {}", words::errors_line(status))]
    Device {
        /// The status with the errors.
        status: Box<Status>,
    },
    /// A state was not reached.
    #[error("{what} not reached within {waited_s:.1} s: {}", words::waiting_for(status))]
    Timeout {
        /// What was waited for.
        what: &'static str,
        /// How long, s.
        waited_s: f64,
        /// The last status.
        status: Box<Status>,
    },
}

impl Diagnose for StateError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Device { .. } => Diagnosis::new(
                ErrorKind::Device,
                "device-error",
                "`jtc recover` leads back to HoldPos, `jtc explain CODE` explains each error",
            ),
            Self::Timeout { status, .. } => {
                Diagnosis::new(ErrorKind::Device, "state-timeout", words::next_step(status))
            }
        }
    }
}
