//! State of stdout: blocked, closed, or the reason why a result was lost.

use std::io::{Error, ErrorKind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Reason why the first lost result could not be printed. A command continues without its output, and its exit code
/// reports the loss at the end.
static LOST: OnceLock<String> = OnceLock::new();
/// `true` after a failed write to stdout, for any reason.
static GONE: AtomicBool = AtomicBool::new(false);
/// `true` while a line that the reader does not accept blocks stdout.
static STUCK: AtomicBool = AtomicBool::new(false);

/// Records a failed write. A reader that has disconnected has read enough, so the function does not record this case as
/// a loss.
pub(crate) fn lose(why: &Error) {
    GONE.store(true, Ordering::Relaxed);
    if why.kind() != ErrorKind::BrokenPipe {
        let _ = LOST.set(why.to_string());
    }
}

/// Returns `true` after a failed write to stdout.
pub(crate) fn is_gone() -> bool {
    GONE.load(Ordering::Relaxed)
}

/// Returns the reason why a result was lost, or `None` if no result was lost.
pub(crate) fn lost() -> Option<&'static str> {
    LOST.get().map(String::as_str)
}

/// Marks stdout as blocked. Code that prints after this call would wait for a reader that does not read.
pub(crate) fn set_stuck() {
    STUCK.store(true, Ordering::Relaxed);
}

/// Returns `true` if printing to stdout would now wait without end.
pub fn stdout_is_stuck() -> bool {
    STUCK.load(Ordering::Relaxed)
}
