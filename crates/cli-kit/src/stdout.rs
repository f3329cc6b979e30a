//! What has become of stdout: held by a reader that does not read, gone, or the reason why a result was lost.

use std::io::{Error, ErrorKind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why the first result that was lost could not be printed. A command goes on without its output; its exit code shows it in the end.
static LOST: OnceLock<String> = OnceLock::new();
/// A write to stdout has failed, for whatever reason.
static GONE: AtomicBool = AtomicBool::new(false);
/// Stdout is held by a line that nobody reads.
static STUCK: AtomicBool = AtomicBool::new(false);

/// A write has failed. A reader that has gone has seen what it wanted: that is no loss.
pub(crate) fn lose(why: &Error) {
    GONE.store(true, Ordering::Relaxed);
    if why.kind() != ErrorKind::BrokenPipe {
        let _ = LOST.set(why.to_string());
    }
}

/// A write has failed before.
pub(crate) fn is_gone() -> bool {
    GONE.load(Ordering::Relaxed)
}

/// Why a result was lost, where one was.
pub(crate) fn lost() -> Option<&'static str> {
    LOST.get().map(String::as_str)
}

/// From now on whoever prints waits for a reader that does not read.
pub(crate) fn set_stuck() {
    STUCK.store(true, Ordering::Relaxed);
}

/// Whether whoever prints to stdout now would wait for ever.
pub fn stdout_is_stuck() -> bool {
    STUCK.load(Ordering::Relaxed)
}
