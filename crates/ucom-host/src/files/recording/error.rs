//! Errors that occur while recordings are read or written.

use std::path::{Path, PathBuf};
/// Reasons why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The recording file cannot be used.
    #[error("{}{source}", prefix(path))]
    Io {
        /// Path of the file; empty if the path is not known.
        path: PathBuf,
        /// Error that the system reported.
        source: std::io::Error,
    },
    /// A line is not a valid record.
    #[error("line {line}: {problem}")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Error in this line.
        problem: RecordProblem,
    },
    /// The file is not an FZI-CAN stream of version 1.2.
    #[error("the first line is `{first}`, not `{}`", super::FZI_HEADER)]
    FziHeader {
        /// First line in the file.
        first: String,
    },
    /// The file format cannot represent this frame.
    #[error("FZI-CAN cannot store {frame}, only classic data frames with 11-bit ids")]
    NotRepresentable {
        /// Frame that the format cannot represent, as text.
        frame: String,
    },
    /// The MCAP file is damaged.
    #[error("{}{problem}", prefix(path))]
    Mcap {
        /// Path of the file; empty if the path is not known.
        path: PathBuf,
        /// Error in the MCAP file.
        problem: String,
    },
}

/// Errors in a line of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecordProblem {
    /// The line is longer than any record.
    #[error("the line is longer than {} bytes; this may not be a recording", super::MAX_LINE)]
    TooLong,
    /// The line of the candump file has a wrong number of columns.
    #[error("a line of candump is `(seconds) interface ID#DATA`")]
    Columns,
    /// The time in the line is not valid.
    #[error("not a time in seconds")]
    Time,
    /// The line has the format that candump shows in a terminal, without the option `-L`.
    #[error("this is the view of candump for a terminal, expected the format of `candump -L`")]
    View,
    /// The identifier in the line is not valid.
    #[error("not an identifier")]
    Id,
    /// The length in the line is not valid.
    #[error("not a length of 0 to 8")]
    Length,
    /// The data in the line are not valid.
    #[error("the data are not pairs of hexadecimal digits, or have more than 8 bytes")]
    Data,
    /// The file ends in the middle of the record in this line. The readable part of the line may be only the beginning of the record.
    #[error("the file ends in the middle of this line")]
    Truncated,
    /// The line of the FZI-CAN file has a wrong number of columns.
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
