//! Errors of reading, giving and keeping an arm as one thing.

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_wire::StoreState;

/// Why an arm could not be read from a device or kept by it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExtensionError {
    /// What was read is not one arm.
    #[error("the arm of the device changed while it was read")]
    Changed,
    /// The memory of the device does not have it.
    #[error("the arm was not stored: {state}")]
    NotStored {
        /// What the device reports of its memory.
        state: StoreState,
    },
}

impl Diagnose for ExtensionError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Changed => Diagnosis::new(
                ErrorKind::Device,
                "arm-changed",
                "is another host giving it an arm? Try again",
            ),
            Self::NotStored { .. } => Diagnosis::new(
                ErrorKind::Device,
                "not-stored",
                "the arm is in use until the device is switched off; `jtc info` shows its memory, `jtc arm push --store` tries again",
            ),
        }
    }
}
