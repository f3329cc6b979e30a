//! Errors of recordings.

use std::fmt;
use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis, ErrorKind};

/// Reason why a recording could not be written or read.
#[derive(Debug)]
pub enum RecordingError {
    /// The file name has neither the extension `.mcap` nor the extension `.csv`.
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file is an MCAP file, but this program was built without the feature `mcap`.
    BuiltWithout {
        /// The file.
        path: PathBuf,
    },
    /// The file is empty.
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The operating system reported an error.
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A CSV line cannot be parsed.
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, counted from 1.
        line: usize,
        /// Column name, if the error is in a column.
        column: Option<String>,
        /// Problem found.
        problem: &'static str,
    },
    /// The file is not a valid MCAP file.
    Mcap {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        problem: String,
    },
    /// The messages of an MCAP file are far out of time order.
    Disorder {
        /// The file.
        path: PathBuf,
        /// Log time of the first message that is out of order, s.
        time_s: f64,
    },
    /// A message of a known topic is shorter than its schema requires.
    Message {
        /// The file.
        path: PathBuf,
        /// Topic of the message.
        topic: String,
        /// Log time of the message, s.
        time_s: f64,
    },
}

impl RecordingError {
    pub(super) fn io(path: &Path, source: std::io::Error) -> Self {
        RecordingError::Io { path: path.to_owned(), source }
    }

    /// Adds the path of the file to the error.
    pub(super) fn at(mut self, file: &Path) -> Self {
        let (RecordingError::UnknownFormat { path }
        | RecordingError::BuiltWithout { path }
        | RecordingError::Empty { path }
        | RecordingError::Io { path, .. }
        | RecordingError::Line { path, .. }
        | RecordingError::Mcap { path, .. }
        | RecordingError::Disorder { path, .. }
        | RecordingError::Message { path, .. }) = &mut self;
        *path = file.to_owned();
        self
    }
}

impl fmt::Display for RecordingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RecordingError::UnknownFormat { path } => {
                write!(
                    f,
                    "{}: recordings are .mcap or .csv files; choose one of these endings",
                    path.display()
                )
            }
            RecordingError::BuiltWithout { path } => {
                write!(
                    f,
                    "{}: built without MCAP (feature `mcap` of jtc-host); name a .csv file",
                    path.display()
                )
            }
            RecordingError::Empty { path } => {
                write!(f, "{}: the file is empty: the program ended before it recorded data", path.display())
            }
            RecordingError::Io { path, source } => write!(f, "{}: {source}", path.display()),
            RecordingError::Line { path, line, column, problem } => {
                write!(f, "{}: line {line}", path.display())?;
                if let Some(column) = column {
                    write!(f, ", column {column}")?;
                }
                write!(f, ": {problem}")
            }
            RecordingError::Mcap { path, problem } => write!(f, "{}: {problem}", path.display()),
            RecordingError::Disorder { path, time_s } => write!(
                f,
                "{}: the messages are not in the order of time: the message of {time_s:.3} s is far after later messages",
                path.display()
            ),
            RecordingError::Message { path, topic, time_s } => {
                write!(
                    f,
                    "{}: the message on {topic} at {time_s:.3} s is shorter than its schema",
                    path.display()
                )
            }
        }
    }
}

impl std::error::Error for RecordingError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            RecordingError::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl Diagnose for RecordingError {
    fn diagnosis(&self) -> Diagnosis {
        let next = match self {
            Self::UnknownFormat { .. } | Self::BuiltWithout { .. } => "",
            Self::Io { .. } => "check the name and the rights of the file",
            Self::Disorder { .. } => {
                "`mcap sort FILE -o SORTED.mcap` (a command of the MCAP project) sorts the file"
            }
            Self::Empty { .. } | Self::Line { .. } | Self::Mcap { .. } | Self::Message { .. } => {
                "`jtc traj run FILE --record run.mcap`, `jtc move --record` and `jtc sim --record` write recordings"
            }
        };
        Diagnosis::new(ErrorKind::Usage, "recording", next)
    }
}

impl From<std::io::Error> for RecordingError {
    fn from(source: std::io::Error) -> Self {
        RecordingError::Io { path: PathBuf::new(), source }
    }
}
