//! Errors that occur when a board does not reach a state.
use host_kit::{Diagnose, Diagnosis, ErrorKind, next};
use ucom::Status;

/// Reasons why a board is not in the requested state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StatusError {
    /// The status that the PC read back differs from the requested status.
    #[error(
        "board {board}: status is {} after {tries} tries, expected {} in the bits {}",
        status,
        wanted,
        mask
    )]
    StatusNotTaken {
        /// Board number.
        board: u8,
        /// Status bits that the command should have changed.
        mask: Status,
        /// Requested values of these status bits.
        wanted: Status,
        /// Status that the PC read back.
        status: Status,
        /// Number of times that the command was sent.
        tries: u32,
    },
    /// The board did not reach the expected state within the time limit.
    #[error("board {board}: {what} within {waited_ms} ms; status {status}")]
    NotReached {
        /// Board number.
        board: u8,
        /// Step that did not happen, in words, such as `the exloader did not start`.
        what: &'static str,
        /// Time that the PC waited, ms.
        waited_ms: u64,
        /// Last status of the board.
        status: Status,
    },
    /// The flags that the board confirmed differ from the flags that were sent.
    #[error("board {board} answers MCA_ADMIN_DATA with `{is}` instead of `{wanted}`")]
    AdminRefused {
        /// Number of the board.
        board: u8,
        /// Flags that the PC sent.
        wanted: ucom::Admin,
        /// Flags in the board's answer.
        is: ucom::Admin,
    },
}

impl Diagnose for StatusError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::StatusNotTaken { .. } => Diagnosis::new(
                ErrorKind::Device,
                "status-not-taken",
                "bits that mirror the real state cannot be set; PROG can be set only in the exloader: `ucom \
                 help status`",
            ),
            Self::NotReached { board, .. } => Diagnosis::new(
                ErrorKind::NoLink,
                "not-reached",
                next!("{}, then {} and {}", BoardInfo, BoardReset, ChainInit).of_board(*board),
            ),
            Self::AdminRefused { board, .. } => Diagnosis::new(
                ErrorKind::Device,
                "admin-refused",
                next!("outputs need a running control loop: {}", BoardRun).of_board(*board),
            ),
        }
    }
}
