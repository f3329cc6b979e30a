//! Errors of reading and writing recordings.

use std::path::{Path, PathBuf};
/// Reasons why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file cannot be used.
    #[error("{}{source}", prefix(path))]
    Io {
        /// File; empty if not known.
        path: PathBuf,
        /// System error.
        source: std::io::Error,
    },
    /// A line is not a valid record.
    #[error("line {line}: {problem}")]
    Line {
        /// Line, from 1.
        line: usize,
        /// Error in the line.
        problem: RecordProblem,
    },
    /// The file is not an FZI-CAN stream of version 1.2.
    #[error("the first line is `{first}`, not `{}`", super::FZI_HEADER)]
    FziHeader {
        /// First line in the file.
        first: String,
    },
    /// The format cannot represent this frame.
    #[error("FZI-CAN cannot store {frame}, only classic data frames with 11-bit ids")]
    NotRepresentable {
        /// The frame.
        frame: String,
    },
    /// The MCAP file is damaged.
    #[error("{}{problem}", prefix(path))]
    Mcap {
        /// File; empty if not known.
        path: PathBuf,
        /// Error in the file.
        problem: String,
    },
}

/// Errors in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordProblem {
    /// The line is longer than any record.
    #[error("the line is longer than {} bytes; this may not be a recording", super::MAX_LINE)]
    TooLong,
    /// The line has a wrong number of columns.
    #[error("a line of candump is `(seconds) interface ID#DATA`")]
    Columns,
    /// The text is not a time.
    #[error("not a time in seconds")]
    Time,
    /// The text is not an identifier.
    #[error("not an identifier")]
    Id,
    /// The text is not a length.
    #[error("not a length of 0 to 8")]
    Length,
    /// The text is not data.
    #[error("the data are not pairs of hexadecimal digits, or have more than 8 bytes")]
    Data,
    /// The file ends in the middle of the record. The readable part may be only the beginning of the record.
    #[error("the file is broken off here: the line has no end")]
    Truncated,
    /// The line has a wrong number of columns.
    #[error("a line of FZI-CAN is `sec.usec id dlc` and eight bytes")]
    FziColumns,
}

fn prefix(path: &Path) -> String {
    if path.as_os_str().is_empty() { String::new() } else { format!("{}: ", path.display()) }
}

impl RecordingError {
    pub(super) fn with_path(self, file: &Path) -> Self {
        match self {
            Self::Io { source, path } if path.as_os_str().is_empty() => {
                Self::Io { path: file.into(), source }
            }
            Self::Mcap { problem, .. } => Self::Mcap { path: file.into(), problem },
            other => other,
        }
    }
}

impl From<std::io::Error> for RecordingError {
    fn from(source: std::io::Error) -> Self {
        Self::Io { path: PathBuf::new(), source }
    }
}
