//! Errors of a port.

use std::io;

use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};

/// Reason why a port cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// The device was not found.
    #[error("{path}: this port does not exist")]
    NotFound {
        /// Name of the port.
        path: String,
    },
    /// The operating system does not allow this user to open the port.
    #[error("{path}: no permission to open this port")]
    Permission {
        /// Name of the port.
        path: String,
    },
    /// Another program has opened the port.
    #[error("{path}: another program has this port open")]
    Busy {
        /// Name of the port.
        path: String,
    },
    /// The device does not support this bit rate.
    #[error("{path}: the port refuses {baud} Bd")]
    Baud {
        /// Name of the port.
        path: String,
        /// Requested bit rate, bits per second.
        baud: u32,
    },
    /// The port disappeared while it was open.
    #[error(
        "{path}: the port has disappeared (the cable was pulled, or the program at its other end has ended)"
    )]
    Gone {
        /// Name of the port.
        path: String,
    },
    /// No agent answers.
    #[error("{url}: no agent answers: {what}")]
    NoAgent {
        /// Address of the agent.
        url: String,
        /// Problem found.
        what: String,
    },
    /// The agent denies this client access.
    #[error("{url}: the agent denies access to this program: {what}")]
    NotLetIn {
        /// Address of the agent.
        url: String,
        /// Message of the agent.
        what: String,
    },
    /// The connection to the agent is lost.
    #[error("{url}: the connection to the agent is lost: {what}")]
    AgentGone {
        /// Address of the agent.
        url: String,
        /// Cause.
        what: String,
    },
    /// The other end of the connection does not accept bytes.
    #[error("{path}: the port accepted no byte for {seconds:.1} s")]
    Stalled {
        /// Name of the port.
        path: String,
        /// Waiting time, s.
        seconds: f64,
    },
    /// The user selected no port, and the computer has no port.
    #[error("no serial port found")]
    NoneFound,
    /// The user selected no port, and the computer has several ports.
    #[error("several serial ports found: {}", paths.join(", "))]
    Several {
        /// Names found.
        paths: Vec<String>,
    },
    /// The path is a file or directory, and not a port.
    #[error("{path} is no serial port")]
    NoPort {
        /// Name of the port.
        path: String,
    },
    /// The port does not send a frame that would move the arm, because the arm was stopped after the motion was requested.
    #[error("not sent: {} after this motion was requested", stopped_by(by.as_deref()))]
    Halted {
        /// Name of the program that stopped the arm. `None` if the name is unknown.
        by: Option<String>,
    },
    /// The program that holds the port does not answer a Stop or Pause.
    #[error("{}: the program that uses this port{} did not answer within {seconds:.0} s", path, process_words(*process))]
    HolderSilent {
        /// Name of the port or of its socket.
        path: String,
        /// Process id of the program.
        process: Option<i32>,
        /// Waiting time, s.
        seconds: f64,
    },
    /// The program that holds the port could not deliver a Stop or Pause to the controller.
    #[error("{path}: the controller did not confirm the request to {holder}, which uses this port{}", what.as_ref().map_or(String::new(), |what| format!(" ({what})")))]
    NotHalted {
        /// Name of the port.
        path: String,
        /// Name of the program that holds the port.
        holder: String,
        /// Cause, if the frame could not be written.
        what: Option<String>,
    },
    /// The operating system reports another error.
    #[error("{path}: {source}")]
    Io {
        /// Name of the port.
        path: String,
        /// Error of the operating system.
        source: io::Error,
    },
}

fn stopped_by(program: Option<&str>) -> String {
    program.map_or("the arm was stopped".to_owned(), |program| format!("{program} stopped the arm"))
}

fn process_words(process: Option<i32>) -> String {
    process.map_or(String::new(), |process| format!(" (process {process})"))
}

impl Diagnose for PortError {
    fn diagnosis(&self) -> Diagnosis {
        let next: Next = match self {
            PortError::NotFound { .. } | PortError::NoPort { .. } => "`jtc ports` lists the ports of this computer".into(),
            PortError::Permission { path } if cfg!(target_os = "linux") => {
                format!("run `sudo usermod -aG dialout $USER`, then log in again (`ls -l {path}` shows owner and group)").into()
            }
            PortError::Permission { .. } => "run with the rights to open this port".into(),
            PortError::Busy { path } if cfg!(target_os = "linux") => {
                format!("`fuser -v {path}` names the program that uses the port; end the program and try again").into()
            }
            PortError::Busy { .. } => "close the program that uses the port and try again".into(),
            PortError::Baud { .. } => "try `--baud 115200`, the rate of the controller after a start".into(),
            PortError::Gone { .. } => "plug the cable in again, then run `jtc ports`".into(),
            PortError::NoAgent { .. } => "`jtc serve` starts an agent and prints its address".into(),
            PortError::NotLetIn { .. } => {
                "give the token with --token-file; `jtc serve` prints the name of the file when it starts".into()
            }
            PortError::AgentGone { url, .. } => format!("`jtc status --port {url}` shows whether the agent is back").into(),
            PortError::Stalled { .. } => {
                "check cable and power; switch flow control off, because the controller does not use it".into()
            }
            PortError::NoneFound => {
                "plug the adapter in, or start a simulated controller with `jtc sim --serial /tmp/jtc` and use `--port /tmp/jtc`"
                    .into()
            }
            PortError::Several { .. } => "select a port with `--port PATH` (or JTC_PORT)".into(),
            PortError::Halted { .. } => next!("{} shows the position of the arm", Status),
            PortError::HolderSilent { .. } | PortError::NotHalted { .. } => {
                "if the arm is moving, press the emergency stop".into()
            }
            PortError::Io { path, .. } => format!("`jtc ports` shows the state of {path}").into(),
        };
        let (kind, code) = match self {
            PortError::NotLetIn { .. } => (ErrorKind::Refused, "not-let-in"),
            PortError::Halted { .. } => (ErrorKind::Fault, "cancelled"),
            PortError::NoAgent { .. } | PortError::AgentGone { .. } => (ErrorKind::NoLink, "no-agent"),
            _ => (ErrorKind::NoLink, "port"),
        };
        Diagnosis::new(kind, code, next)
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
