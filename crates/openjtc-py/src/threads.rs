//! Functions for threads that own a device, used by both kinds of connection: locks, the end of a thread, and forked
//! processes.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use pyo3::prelude::*;

/// Interval of the checks whether a thread has ended.
const LOOK: Duration = Duration::from_millis(2);

/// Locks a mutex, even after a panic of a thread, because the protected data is consistent after each statement.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits without the GIL until the thread has ended. A signal ends the wait. Several callers can wait for the same
/// thread.
pub(crate) fn join(py: Python<'_>, thread: &Mutex<Option<JoinHandle<()>>>) -> PyResult<()> {
    while !lock(thread).as_ref().is_none_or(JoinHandle::is_finished) {
        py.detach(|| std::thread::sleep(LOOK));
        py.check_signals()?;
    }
    if let Some(thread) = lock(thread).take() {
        // The thread itself has already reported its panic.
        drop(thread.join());
    }
    Ok(())
}

/// Process that created an object. A forked child process has the memory of its parent process, but none of its
/// threads.
pub(crate) struct Process(u32);

impl Process {
    /// Returns the current process.
    pub(crate) fn this() -> Self {
        Self(std::process::id())
    }

    /// Returns `true` in the process that created the object.
    pub(crate) fn is_this(&self) -> bool {
        self.0 == std::process::id()
    }
}
