//! Options and results of an init. An init assigns numbers to the boards of a chain.
use crate::master::counted::counted;
use crate::master::error::{Error, MEASURE_ORDER, other_order};
use crate::master::reports::scan::Reports;
use crate::master::reports::seen::BoardSeen;
use host_kit::ErrorKind;
use ucom::profile::Endian;

/// Options for an init.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InitOptions {
    /// Expected board numbers and flash numbers, from an inventory. A difference from the inventory is reported as a finding.
    pub expected: Vec<(u8, u16)>,
    /// Permission to assign numbers while another PC is on the bus.
    pub force: bool,
}

/// Result of an init.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InitReport {
    /// Reports that boards sent after the reset.
    pub reports: Reports,
    /// Boards that got a number, in the order of the chain.
    pub boards: Vec<BoardSeen>,
    /// Problems that the init found; empty if the init succeeded.
    pub findings: Vec<InitFinding>,
}

impl InitReport {
    /// Returns `true` if every board on the bus has a number and the report has no finding.
    pub fn is_ok(&self) -> bool {
        self.findings.is_empty()
    }

    /// Returns the kind of failure of the init; returns `None` if the init succeeded.
    pub fn failure(&self) -> Option<ErrorKind> {
        match self.findings.as_slice() {
            [] => None,
            [InitFinding::NoBoards] => Some(ErrorKind::NoLink),
            _ => Some(ErrorKind::Device),
        }
    }
}

/// Problem that an init found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InitFinding {
    /// No board reported or took number 1.
    #[error(
        "no board reported and none took a number: check connection, power and bit rate of the bus, `ucom \
         doctor`"
    )]
    NoBoards,
    /// Boards have reported but got no number.
    #[error(
        "board reported but got no number: UCoM id {} after position {after}; the init wire after this \
         position may be broken",
        hex(ids)
    )]
    NotReached {
        /// Number of the last board that got a number.
        after: u8,
        /// Low bytes of the flash numbers of boards that have reported but got no number.
        ids: Vec<u8>,
    },
    /// The flash numbers of boards match the boards' reports only after their bytes are swapped (D-10).
    #[error("{}: {MEASURE_ORDER}", other_order(*endian))]
    ByteOrder {
        /// Byte order that the profile defines.
        endian: Endian,
    },
    /// The number of boards is higher than the number of reports, so boards have the same low byte in their flash numbers.
    #[error(
        "more boards than reports: {}, {}; flash ids must be unique in their low byte",
        counted(*boards as usize, "board"),
        counted(*reports as usize, "report")
    )]
    MoreBoardsThanReports {
        /// Number of boards with a number.
        boards: u32,
        /// Number of different reports.
        reports: u32,
    },
    /// A board has a number but did not report.
    #[error("board {board} took a number but did not report")]
    NotReported {
        /// Board number.
        board: u8,
    },
    /// A board did not receive the reset and continued to run its application.
    #[error("board {board} did not receive PC_RESET and continued to run: {}", if *stopped { "it was stopped" } else { "it may still run" })]
    NotReset {
        /// Board number.
        board: u8,
        /// `true` if the board has later confirmed that its application is stopped.
        stopped: bool,
    },
    /// Two boards have the same flash number.
    #[error("duplicate flash number 0x{flash_number:04X}: boards {first} and {second}")]
    DuplicateFlash {
        /// Flash number that both boards have.
        flash_number: u16,
        /// Number of the first board.
        first: u8,
        /// Number of the second board.
        second: u8,
    },
    /// The board at a position of the chain differs from the inventory.
    #[error(
        "unexpected board order: position {board} has flash number 0x{found:04X}, the inventory has 0x{expected:04X}"
    )]
    UnexpectedOrder {
        /// Number of the position.
        board: u8,
        /// Flash number that the inventory contains for this position.
        expected: u16,
        /// Flash number of the board at this position.
        found: u16,
    },
    /// The inventory contains a board beyond the end of the chain.
    #[error("board {board} (flash number 0x{expected:04X}) of the inventory is missing")]
    Missing {
        /// Number of the missing board.
        board: u8,
        /// Flash number of the board in the inventory.
        expected: u16,
    },
    /// A board was refused, so only the boards before it in the chain got numbers.
    #[error("position {board}: {error}")]
    Refused {
        /// Number of the position of the refused board.
        board: u8,
        /// Reason why the board was refused.
        error: Error,
    },
    /// Two boards have UCoM ids that use the same identifier.
    #[error("UCoM ids 0x{low:02X} and 0x{high:02X} differ in bit 7 only and share an identifier")]
    Ambiguous {
        /// The lower UCoM id.
        low: u8,
        /// The higher UCoM id.
        high: u8,
    },
}

fn hex(ids: &[u8]) -> String {
    ids.iter().map(|id| format!("0x{id:02X}")).collect::<Vec<_>>().join(", ")
}
