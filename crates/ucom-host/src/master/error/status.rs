//! A state that a board did not reach.
use host_kit::{Diagnose, Diagnosis, ErrorKind};
use ucom::Status;

/// Why a board is not in the state that was asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StatusError {
    /// A status was set and is not what was set.
    #[error(
        "board {board}: status is {} after {tries} tries, wanted {} of the bits {}",
        status,
        wanted,
        mask
    )]
    StatusNotTaken {
        /// Its number.
        board: u8,
        /// Bits that were to change.
        mask: Status,
        /// What they were to be.
        wanted: Status,
        /// The status that was read.
        status: Status,
        /// How often it was set.
        tries: u32,
    },
    /// A state was not reached.
    #[error("board {board}: {what} not within {waited_ms} ms; status {status}")]
    NotReached {
        /// Its number.
        board: u8,
        /// What was waited for.
        what: &'static str,
        /// How long, ms.
        waited_ms: u64,
        /// The last status.
        status: Status,
    },
    /// Flags were sent and others came back.
    #[error("board {board} answers MCA_ADMIN_DATA with `{is}` instead of `{wanted}`")]
    AdminRefused {
        /// Its number.
        board: u8,
        /// What was sent.
        wanted: ucom::Admin,
        /// Its text.
        is: ucom::Admin,
    },
}

impl Diagnose for StatusError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::StatusNotTaken { .. } => Diagnosis::new(
                ErrorKind::Device,
                "status-not-taken",
                "bits that mirror reality cannot be set, PROG only in the exloader: `ucom help status`",
            ),
            Self::NotReached { board, .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "not-reached",
                format!("`ucom info {board}`, then `ucom reset` and `ucom init`"),
            ),
            Self::AdminRefused { .. } => Diagnosis::new(
                ErrorKind::Device,
                "admin-refused",
                "outputs need a running control loop: `ucom start`",
            ),
        }
    }
}
