//! Why a port cannot be used.

use std::io;

use host_kit::{Diagnose, Diagnosis, ErrorKind};

/// Why a port cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// No such device.
    #[error("{path}: there is no such port")]
    NotFound {
        /// Name given.
        path: String,
    },
    /// The operating system does not let this user open it.
    #[error("{path}: no permission to open this port")]
    Permission {
        /// Name given.
        path: String,
    },
    /// Another program has it.
    #[error("{path}: another program has this port open")]
    Busy {
        /// Name given.
        path: String,
    },
    /// The device cannot run at this rate.
    #[error("{path}: the port refuses {baud} Bd")]
    Baud {
        /// Name given.
        path: String,
        /// Bits per second asked for.
        baud: u32,
    },
    /// It was there, and is no more.
    #[error("{path}: the port has gone (cable pulled, or the program at its other end has ended)")]
    Gone {
        /// Name given.
        path: String,
    },
    /// The other end takes no bytes.
    #[error("{path}: no byte could be written for {seconds:.1} s")]
    Stalled {
        /// Name given.
        path: String,
        /// How long was waited, s.
        seconds: f64,
    },
    /// No port was named, and none is there.
    #[error("no serial port found")]
    NoneFound,
    /// No port was named, and several are there.
    #[error("several serial ports found: {}", paths.join(", "))]
    Several {
        /// Names found.
        paths: Vec<String>,
    },
    /// The path is that of a file or a directory.
    #[error("{path} is no serial port")]
    NoPort {
        /// Name given.
        path: String,
    },
    /// Anything else that the operating system reports.
    #[error("{path}: {source}")]
    Io {
        /// Name given.
        path: String,
        /// Its words.
        source: io::Error,
    },
}

impl Diagnose for PortError {
    fn diagnosis(&self) -> Diagnosis {
        let next = match self {
            PortError::NotFound { .. } | PortError::NoPort { .. } => "`jtc ports` lists the ports that are there".into(),
            PortError::Permission { path } if cfg!(target_os = "linux") => {
                format!("`sudo usermod -aG dialout $USER`, then log in again (owner and group: `ls -l {path}`)")
            }
            PortError::Permission { .. } => "run with the rights to open this port".into(),
            PortError::Busy { path } if cfg!(target_os = "linux") => {
                format!("`fuser -v {path}` names the program that has it; end it and try again")
            }
            PortError::Busy { .. } => "close the program that has it and try again".into(),
            PortError::Baud { .. } => "try `--baud 115200`, the rate the controller starts with".into(),
            PortError::Gone { .. } => "plug it in again, then `jtc ports`".into(),
            PortError::Stalled { .. } => {
                "check cable and power; a device with flow control holds the line: the controller uses none".into()
            }
            PortError::NoneFound => {
                "plug the adapter in, or start a simulated controller: `jtc sim --serial /tmp/jtc` and then `--port \
                 /tmp/jtc`"
                    .into()
            }
            PortError::Several { .. } => "name one with `--port PATH` (or JTC_PORT)".into(),
            PortError::Io { path, .. } => format!("`jtc ports` shows how {path} is"),
        };
        Diagnosis::new(ErrorKind::NoLink, "port", next)
    }
}

impl PortError {
    pub(crate) fn io(path: &str, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            io::ErrorKind::NotFound => PortError::NotFound { path },
            io::ErrorKind::PermissionDenied => PortError::Permission { path },
            io::ErrorKind::BrokenPipe | io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset => {
                PortError::Gone { path }
            }
            _ => PortError::Io { path, source },
        }
    }
}
