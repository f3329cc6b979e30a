//! What can go wrong with a recording.

use std::fmt;
use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis, ErrorKind};

/// Why a recording could not be written or read.
#[derive(Debug)]
pub enum RecordingError {
    /// The ending of the file name is neither `.mcap` nor `.csv`.
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// An MCAP file, and this program was built without the feature `mcap`.
    BuiltWithout {
        /// The file.
        path: PathBuf,
    },
    /// Nothing is in the file.
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The operating system refused.
    Io {
        /// The file.
        path: PathBuf,
        /// Its error.
        source: std::io::Error,
    },
    /// A CSV line that cannot be understood.
    Line {
        /// The file.
        path: PathBuf,
        /// Line number from 1.
        line: usize,
        /// Column name, where one is to blame.
        column: Option<String>,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Not a sound MCAP file.
    Mcap {
        /// The file.
        path: PathBuf,
        /// What the reader found.
        problem: String,
    },
    /// Messages of an MCAP file stand far from the order of their times.
    Disorder {
        /// The file.
        path: PathBuf,
        /// Log time of the first that comes too late, s.
        time_s: f64,
    },
    /// A message of a known topic that is shorter than its schema.
    Message {
        /// The file.
        path: PathBuf,
        /// Its topic.
        topic: String,
        /// Its log time, s.
        time_s: f64,
    },
}

impl RecordingError {
    pub(super) fn io(path: &Path, source: std::io::Error) -> Self {
        RecordingError::Io { path: path.to_owned(), source }
    }

    /// The same error with the file it is about.
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
                write!(f, "{}: an empty file: the program ended before anything was recorded", path.display())
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
                "{}: the message of {time_s:.3} s stands far behind later ones: the file is not in the order of time",
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
                "`mcap sort FILE -o SORTED.mcap` (the MCAP project's command) puts it in order"
            }
            Self::Empty { .. } | Self::Line { .. } | Self::Mcap { .. } | Self::Message { .. } => {
                "recordings are written by `jtc traj run FILE --record run.mcap`, `jtc move --record` and `jtc sim --record`"
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
