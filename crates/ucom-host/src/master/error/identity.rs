//! Errors that occur when a board is not the intended one.
use core::fmt;

use crate::master::error::words::{MEASURE_ORDER, other_order};
use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};
use ucom::profile::Endian;

/// Reasons why a board is not the intended one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentityError {
    /// DSP_INFO has different numbers in identifier and data.
    #[error("the answer from board {board} contains number {reported} and was rejected")]
    WrongSequence {
        /// Board number in the identifier.
        board: u8,
        /// Board number in the data.
        reported: u8,
    },
    /// The board has another flash number than expected.
    #[error("board {board} has flash number 0x{found:04X}, not 0x{wanted:04X}")]
    WrongBoard {
        /// Board number.
        board: u8,
        /// Flash number that the procedure expected.
        wanted: u16,
        /// Flash number that the board has.
        found: u16,
    },
    /// The flash numbers of boards match the boards' reports only after their bytes are swapped (D-10).
    #[error("{}", other_order(*endian))]
    ByteOrder {
        /// Byte order that the profile defines.
        endian: Endian,
    },
    /// Two boards have the same number, so both boards carry out every command to this number.
    #[error(
        "two boards answer to number {board}: {}{}",
        Sharing(found),
        if *given_back { "; the number was withdrawn from both boards" } else { "" }
    )]
    NumberShared {
        /// Number that the boards share.
        board: u8,
        /// Flash numbers of the boards that answered to this number. The list contains the same flash number twice if
        /// the boards cannot be distinguished.
        found: Vec<u16>,
        /// `true` if the PC has withdrawn the number and no board answers to it.
        given_back: bool,
    },
}

impl Diagnose for IdentityError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::WrongSequence { .. } => {
                Diagnosis::new(ErrorKind::Refused, "wrong-sequence", other_protocol())
            }
            Self::WrongBoard { wanted, found, .. } if *wanted == found.swap_bytes() => Diagnosis::new(
                ErrorKind::Refused,
                "wrong-board",
                "only the two bytes are swapped: check the byte order (`endian` in the profile); `ucom \
                 probe` measures it",
            ),
            Self::WrongBoard { board, .. } => Diagnosis::new(
                ErrorKind::Refused,
                "wrong-board",
                next!(
                    "{} shows the board with this number; if boards were swapped: {}",
                    BoardInfo,
                    ChainInit
                )
                .of_board(*board),
            ),
            Self::ByteOrder { .. } => Diagnosis::new(ErrorKind::Refused, "byte-order", MEASURE_ORDER),
            Self::NumberShared { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "number-shared",
                Next::from(format!("{SHARED_CAUSE}; ")).then(shared_remedy()),
            ),
        }
    }
}

/// Prints `flash numbers 0x0021 and 0x0042`, or `both with flash number 0x0021`.
struct Sharing<'a>(&'a [u16]);

impl fmt::Display for Sharing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [first, rest @ ..] if rest.iter().all(|other| other == first) => {
                write!(f, "both with flash number 0x{first:04X}")
            }
            all => {
                let list: Vec<String> = all.iter().map(|n| format!("0x{n:04X}")).collect();
                write!(f, "flash numbers {}", list.join(" and "))
            }
        }
    }
}

/// Cause of a number that two boards share.
pub(crate) const SHARED_CAUSE: &str = "both boards took the number from one PC_INIT: an init pin is strapped or shorted, or a PC repeated \
     PC_INIT without a check";

/// Returns the remedy for a number that two boards share.
pub(crate) fn shared_remedy() -> Next {
    next!(
        "{} if a board runs, then {} numbers all boards again; if the error returns, power one of the two boards \
         down and check the init wires",
        ChainStop,
        ChainInit
    )
}

/// Returns the remedy if the identifier and the data of a frame contain different board numbers.
pub(crate) fn other_protocol() -> Next {
    next!(
        "two boards may share a number, or the board interprets the protocol differently: {}, then `ucom probe`",
        BoardReset
    )
}
