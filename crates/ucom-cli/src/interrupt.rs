//! Ctrl-C: the first one cancels, and what is begun is brought to an end; the second one ends the process at once, and prints
//! what is left undone and the command that does it.

use std::io::Write;
use std::time::Duration;

use cli_kit::Stop;
use cli_kit::exit::FAULT;
use ucom_host::session::CleanupList;

/// A reader that does not take what is printed is not waited for longer.
const PRINT_TIMEOUT: Duration = Duration::from_millis(300);

/// Handles Ctrl-C from now on.
pub fn listen(cleanup: &CleanupList) -> std::io::Result<Stop> {
    let cleanup = cleanup.clone();
    Stop::listen_with(move || {
        let words = cleanup.words();
        // Files that were made and not written.
        cli_kit::output_file::abandon();
        print_within(PRINT_TIMEOUT, move || {
            let _ = std::io::stderr().write_all(words.as_bytes());
        });
        FAULT
    })
}

/// Prints in a thread of its own, and waits for that no longer than `timeout`: a pipe that nobody reads (`2>&1 | less`)
/// does not keep the process from ending.
pub fn print_within(timeout: Duration, print: impl FnOnce() + Send + 'static) {
    let (done, printed) = std::sync::mpsc::channel();
    let spawned = std::thread::Builder::new().name("last words".into()).spawn(move || {
        print();
        let _ = done.send(());
    });
    if spawned.is_ok() {
        let _ = printed.recv_timeout(timeout);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words without a reader do not keep the process.
    #[test]
    fn words_without_a_reader_are_not_waited_for() {
        let (never, reader) = std::sync::mpsc::channel::<()>();
        let since = std::time::Instant::now();
        print_within(Duration::from_millis(20), move || {
            let _ = reader.recv();
        });
        assert!(since.elapsed() < Duration::from_secs(5));
        drop(never);
    }
}
