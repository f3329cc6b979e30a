//! Failures for commands whose recording is lost or interrupted.

use cli_kit::{ErrorKind, Failure};

/// Hint if the command cannot write a complete file.
const MAKE_ROOM: &str = "free disk space or choose another place, then run again";

/// Returns the failure if the command cannot write measured data, so that the result of the command is lost.
pub(crate) fn output_lost(failure: impl Into<Failure>) -> Failure {
    let message = format!("{}; the recorded data are lost", failure.into().message);
    Failure::new(ErrorKind::Fault, "output-lost", message).next(MAKE_ROOM)
}

/// Returns the failure of an interrupted recording. The file keeps the data that the command has already written.
pub(crate) fn recording_interrupted(failure: impl Into<Failure>) -> Failure {
    let message = format!("{}; the recording ends at this point", failure.into().message);
    Failure::new(ErrorKind::Fault, "output-lost", message).next(MAKE_ROOM)
}
