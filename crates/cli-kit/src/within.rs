//! Output with a timeout, for text that may never be read.

use std::time::Duration;

/// Prints in a separate thread, and waits at most `timeout`. The process can then end even if the reader of a pipe does
/// not read (`2>&1 | less`).
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

    /// A reader that does not read the output does not prevent the end of the process.
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
