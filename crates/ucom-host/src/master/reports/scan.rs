//! Results of a scan: boards that report, boards with a number, and findings about them.
use std::collections::{BTreeMap, BTreeSet};

use crate::master::error::{Error, IdentityError, MEASURE_ORDER, other_order};
use crate::master::reports::seen::BoardSeen;
use ucom::Report;
use ucom::profile::Endian;

/// Reports that boards sent after PC_RESET or PC_REPORT.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reports {
    /// Low bytes of the flash numbers in the reports. The PC distinguishes the boards by these low bytes.
    pub ids: BTreeSet<u8>,
    /// Number of report frames from each board.
    pub frames: BTreeMap<u8, u32>,
    /// Boards whose report has different ids in identifier and data, with `report.mode = flash7`.
    pub disagree: BTreeSet<u8>,
}

impl Reports {
    pub(crate) fn add(&mut self, report: &Report) {
        self.ids.insert(report.ucom_id);
        *self.frames.entry(report.ucom_id).or_default() += 1;
        if !report.agrees() {
            self.disagree.insert(report.ucom_id);
        }
    }

    /// Returns pairs of flash ids that differ only in bit 7. Two boards of such a pair use the same identifier (D-07).
    pub fn ambiguous(&self) -> Vec<(u8, u8)> {
        self.ids
            .iter()
            .filter(|id| **id < 128 && self.ids.contains(&(**id | 128)))
            .map(|id| (*id, id | 128))
            .collect()
    }
}

/// Result of a scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScanReport {
    /// Reports that boards sent.
    pub reports: Reports,
    /// Boards that have a number.
    pub boards: Vec<BoardSeen>,
    /// Findings about the chain.
    pub findings: Vec<ScanFinding>,
}

/// Property of the chain that the user should know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScanFinding {
    /// A board has no number.
    #[error("board with UCoM id 0x{ucom_id:02X} has no number: `ucom init`")]
    Unnumbered {
        /// Low byte of the board's flash number.
        ucom_id: u8,
    },
    /// A board has a number but did not report.
    #[error("board {board} has a number but did not report")]
    NotReported {
        /// Board number.
        board: u8,
    },
    /// Two boards with numbers have the same flash number.
    #[error("boards {first} and {second} have the same flash number 0x{flash_number:04X}")]
    SameFlash {
        /// Number of the first board.
        first: u8,
        /// Number of the second board.
        second: u8,
        /// Flash number that both boards have.
        flash_number: u16,
    },
    /// Two boards have UCoM ids that use the same identifier.
    #[error("UCoM ids 0x{low:02X} and 0x{high:02X} differ in bit 7 only and share an identifier")]
    Ambiguous {
        /// The lower UCoM id.
        low: u8,
        /// The higher UCoM id.
        high: u8,
    },
    /// A report has different UCoM ids in identifier and data.
    #[error(
        "the report of UCoM id 0x{ucom_id:02X} has another id in its identifier: `ucom probe` may show the \
         cause"
    )]
    Disagrees {
        /// UCoM id in the data of the report.
        ucom_id: u8,
    },
    /// The flash numbers of boards match the boards' reports only after their bytes are swapped (D-10).
    #[error("{}: {MEASURE_ORDER}", other_order(*endian))]
    ByteOrder {
        /// Byte order that the profile defines.
        endian: Endian,
    },
    /// The answers of a board contradict each other.
    #[error("the answers of board {board} contradict each other: two boards may have this number")]
    Contradicts {
        /// Board number.
        board: u8,
    },
    /// Two boards have the same number (D-24).
    #[error("{}", shared(*board, [*first, *second]))]
    NumberShared {
        /// Number that the boards share.
        board: u8,
        /// Flash number of the first board.
        first: u16,
        /// Flash number of the second board. This number is equal to `first` if the boards cannot be distinguished.
        second: u16,
    },
    /// A board reports an impossible status.
    #[error("board {board}: {problem}")]
    Status {
        /// Board number.
        board: u8,
        /// Explanation why the status is impossible.
        problem: &'static str,
    },
    /// The PC did not receive any description of the board completely.
    #[error("the description of board {board} was not received completely")]
    NoDescription {
        /// Board number.
        board: u8,
    },
}

fn shared(board: u8, found: [u16; 2]) -> Error {
    Error::Identity(IdentityError::NumberShared { board, found: found.to_vec(), given_back: false })
}

impl ScanFinding {
    /// Returns the error that other commands report if they refuse such a chain; returns `None` if they accept the chain.
    pub fn error(&self) -> Option<Error> {
        match self {
            Self::NumberShared { board, first, second } => Some(shared(*board, [*first, *second])),
            _ => None,
        }
    }
}
