//! Ends of commands whose recording is lost or cut off.

use cli_kit::{ErrorKind, Failure};

/// What helps when a file cannot be written to its end.
const MAKE_ROOM: &str = "make room or name another place, and run again";

/// What was measured cannot be written, after it was measured: what the command was run for is lost.
pub fn output_lost(failure: impl Into<Failure>) -> Failure {
    let message = format!("{}; what was recorded is lost", failure.into().message);
    Failure::new(ErrorKind::Fault, "output-lost", message).next(MAKE_ROOM)
}

/// Of a recording that broke off: what was written before is in it.
pub fn recording_broken_off(failure: impl Into<Failure>) -> Failure {
    let message = format!("{}; the recording ends where that happened", failure.into().message);
    Failure::new(ErrorKind::Fault, "output-lost", message).next(MAKE_ROOM)
}
