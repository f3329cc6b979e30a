//! Errors of an address assignment that the PC refused.
use crate::master::error::identity::other_protocol;
use host_kit::{Action, Diagnose, Diagnosis, ErrorKind, Next, next};

/// Reasons why boards did not get numbers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AddressError {
    /// DSP_INITACK has different numbers in identifier and data (D-24).
    #[error(
        "DSP_INITACK with number {id} in its identifier contains number {data} in its data: the board was \
         rejected"
    )]
    AckMismatch {
        /// Board number in the identifier.
        id: u8,
        /// Board number in the data.
        data: u8,
    },
    /// The first board of the chain does not answer. If it has no number, it would take the number that the PC
    /// assigns to another board.
    #[error("board {other} does not answer; if it has no number, it would take number {board}")]
    MayTakeNumber {
        /// Number that the PC wanted to assign.
        board: u8,
        /// Number of the first board of the chain.
        other: u8,
    },
    /// The reports do not match the boards that have a number. Therefore a new address assignment could give boards
    /// other numbers than before.
    #[error(
        "boards that report: {reports}, boards with a number: {boards}; these counts must be equal, and \
         each flash id must be unique"
    )]
    NotNumbered {
        /// Number of different reports.
        reports: u32,
        /// Number of boards with a number.
        boards: u32,
    },
}

impl Diagnose for AddressError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::AckMismatch { .. } => Diagnosis::new(ErrorKind::Refused, "ack-mismatch", other_protocol()),
            Self::MayTakeNumber { other, .. } => Diagnosis::new(
                ErrorKind::Refused,
                "may-take-number",
                Next::from(format!("`ucom repair {other}` first, or number all boards again: "))
                    .then(Action::ChainInit),
            ),
            Self::NotNumbered { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "not-numbered",
                next!("{}, then repeat the command", ChainInit),
            ),
        }
    }
}
