//! Parameter files: parameters and initial inputs for boards, in YAML that users edit.
//!
//! The protocol does not allow parameters to be read back (D-35). A file therefore contains requested values, never the present values of a
//! board. A file identifies boards by flash number or name. The names of signals apply to one Program ID.

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

/// A parameter file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParamsFile {
    /// Boards in the order of the file. Each board number occurs once.
    pub boards: Vec<ParamsBoard>,
}

/// Board of a parameter file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsBoard {
    /// Position in the chain.
    pub number: u8,
    /// Position of the entry in the file.
    pub place: Place,
    /// Flash number that the board at this position must have.
    pub flash_number: Option<u16>,
    /// Name in the inventory that the board at this position must have. Each board in the file has a flash number or a name, or both.
    pub name: Option<String>,
    /// Program to which the names apply; `None` for `any` in the file.
    pub program_id: Option<u16>,
    /// Parameters.
    pub par: Vec<ParamsEntry>,
    /// Initial inputs, which are sent at a start.
    pub ci: Vec<ParamsEntry>,
}

/// A value of a parameter file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsEntry {
    /// Name or index of the signal.
    pub name: String,
    /// The value.
    pub given: SignalValue,
    /// Position of the value in the file.
    pub place: Place,
}

/// Position in a text, counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: u32,
    /// Column.
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
    /// The file cannot be read.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The text is not YAML in the form of a parameter file.
    #[error("{place}: {what}")]
    Form {
        /// Place.
        place: Place,
        /// Error text.
        what: String,
    },
    /// The text is not YAML in the form of a parameter file, and the place of the error is not known.
    #[error("{0}")]
    Nowhere(String),
    /// Error in a file.
    #[error("{}: {source}", path.display())]
    In {
        /// The file.
        path: PathBuf,
        /// Error in the file.
        source: Box<ParamsError>,
    },
}

impl ParamsFile {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Self, ParamsError> {
        let text = read_text(path)?;
        Self::parse(&text).map_err(|e| ParamsError::In { path: path.into(), source: Box::new(e) })
    }

    /// Returns the entries for a board.
    pub fn board(&self, number: u8) -> Option<&ParamsBoard> {
        self.boards.iter().find(|b| b.number == number)
    }
}

#[cfg(test)]
mod tests;
