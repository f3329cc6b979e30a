//! Parameter files: parameters and initial inputs of boards, in YAML that users edit.
//!
//! The protocol has no function that reads parameters back (D-35). A parameter file therefore contains requested values, never the present
//! values of a board. A parameter file identifies boards by flash number or name. The names of signals in the file apply to one Program ID.

mod check;
mod read;
mod write;

pub use check::{ParamsProblem, ParamsProblemKind, ParamsTarget, ParamsWord, check_board, check_identity};
pub use write::{SavedBoard, SavedSignal, params_text};

use super::signals::SignalValue;
use super::text::{TextError, read_text};
use std::path::{Path, PathBuf};

/// Help page about parameter files.
pub const PARAMS_HELP: &str = include_str!("params/help.txt");

/// Contents of a parameter file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParamsFile {
    /// Boards in the order of the parameter file. Each board number occurs only once.
    pub boards: Vec<ParamsBoard>,
}

/// Entry for a board in a parameter file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsBoard {
    /// Position of the board in the chain.
    pub number: u8,
    /// Position of the entry in the file.
    pub place: Place,
    /// Flash number that the board at this position must have.
    pub flash_number: Option<u16>,
    /// Name in the inventory that the board at this position must have. Each board in the file has a flash number, a name, or both.
    pub name: Option<String>,
    /// Program ID to which the names of the signals apply; `None` if the file contains `any`.
    pub program_id: Option<u16>,
    /// Parameters of the board.
    pub par: Vec<ParamsEntry>,
    /// Initial inputs of the board, which are sent at a start.
    pub ci: Vec<ParamsEntry>,
}

/// Value in a parameter file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsEntry {
    /// Name or index of the signal.
    pub name: String,
    /// Value that the user gave.
    pub given: SignalValue,
    /// Position of the value in the file.
    pub place: Place,
}

/// Position in the text of a file, counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Number of the line.
    pub line: u32,
    /// Number of the column.
    pub column: u32,
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Reasons why a text is not a valid parameter file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// The parameter file cannot be read.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The text is not YAML in the form of a parameter file.
    #[error("{place}: {what}")]
    Form {
        /// Position of the error in the file.
        place: Place,
        /// Text of the error.
        what: String,
    },
    /// The text is not YAML in the form of a parameter file, and the position of the error is not known.
    #[error("{0}")]
    Nowhere(String),
    /// A parameter file contains an error.
    #[error("{}: {source}", path.display())]
    In {
        /// Path of the parameter file.
        path: PathBuf,
        /// Error in the parameter file.
        source: Box<ParamsError>,
    },
}

impl ParamsFile {
    /// Reads a parameter file.
    pub fn read(path: &Path) -> Result<Self, ParamsError> {
        let text = read_text(path)?;
        Self::parse(&text).map_err(|e| ParamsError::In { path: path.into(), source: Box::new(e) })
    }

    /// Returns the entries of a board in the parameter file.
    pub fn board(&self, number: u8) -> Option<&ParamsBoard> {
        self.boards.iter().find(|b| b.number == number)
    }
}

#[cfg(test)]
mod tests;
