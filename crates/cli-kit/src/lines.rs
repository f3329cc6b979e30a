//! Output lines that a separate thread prints, so that a blocked reader (`ucom run --json | less`) does not block the
//! control loop.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::io::Write;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crate::bar::Stderr;
use crate::stdout;

/// Largest number of lines that wait in the queue.
const WAITING: usize = 1000;
/// Longest wait for a blocked reader when the command ends.
const PATIENCE: Duration = Duration::from_secs(1);

/// A queue of output lines and the thread that prints the lines.
pub struct Lines {
    shared: Arc<Shared>,
    is_stdout: bool,
    finished: bool,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    waiting: VecDeque<String>,
    /// `true` while the thread has taken a line from the queue but not written it yet.
    writing: bool,
    written: u64,
    dropped: u64,
    /// `true` if the reader of the output has disconnected.
    gone: bool,
    closed: bool,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Lines {
    /// Creates a queue whose lines are printed to stdout.
    pub fn stdout() -> std::io::Result<Self> {
        Self::to(std::io::stdout(), true)
    }

    /// Creates a queue whose lines are printed to stderr, above the progress bar if there is a progress bar.
    pub fn stderr() -> std::io::Result<Self> {
        Self::to(Stderr, false)
    }

    fn to(writer: impl Write + Send + 'static, is_stdout: bool) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let of_thread = Arc::clone(&shared);
        std::thread::Builder::new()
            .name("lines".into())
            .spawn(move || print(&of_thread, writer, is_stdout))?;
        Ok(Self { shared, is_stdout, finished: false })
    }

    /// Adds a line to the queue. The thread prints the lines in order. Drops the line if too many lines wait.
    pub fn push(&self, line: String) {
        self.add(line, WAITING);
    }

    /// Like [`Self::push`], for a rare line that must never be dropped.
    pub fn push_always(&self, line: String) {
        self.add(line, usize::MAX);
    }

    fn add(&self, line: String, most: usize) {
        let line = match host_kit::visible(&line) {
            Cow::Borrowed(_) => line,
            Cow::Owned(shown) => shown,
        };
        let mut state = self.shared.lock();
        if state.gone {
            return;
        }
        if state.waiting.len() < most {
            state.waiting.push_back(line);
        } else {
            state.dropped += 1;
        }
        drop(state);
        self.shared.changed.notify_all();
    }

    /// Returns `true` if the reader has disconnected (`ucom so | head`), or if the output no longer accepts data.
    pub fn gone(&self) -> bool {
        self.shared.lock().gone
    }

    /// Prints the waiting lines as long as the reader accepts them. Returns the number of lines that stay unread.
    pub fn finish(&mut self) -> u64 {
        self.finished = true;
        let mut state = self.shared.lock();
        state.closed = true;
        self.shared.changed.notify_all();
        let (mut written, mut since) = (state.written, Instant::now());
        while !state.gone && (state.writing || !state.waiting.is_empty()) {
            let left = PATIENCE.saturating_sub(since.elapsed());
            if left.is_zero() {
                if self.is_stdout {
                    stdout::set_stuck();
                }
                return state.dropped + state.waiting.len() as u64 + u64::from(state.writing);
            }
            let waited = self.shared.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
            if state.written != written {
                (written, since) = (state.written, Instant::now());
            }
        }
        state.dropped
    }
}

impl Drop for Lines {
    fn drop(&mut self) {
        if !self.finished {
            self.finish();
        }
    }
}

fn print(shared: &Shared, mut writer: impl Write, is_stdout: bool) {
    let mut state = shared.lock();
    loop {
        if let Some(mut line) = state.waiting.pop_front() {
            state.writing = true;
            drop(state);
            line.truncate(line.trim_end().len());
            line.push('\n');
            let result = writer.write_all(line.as_bytes()).and_then(|()| writer.flush());
            state = shared.lock();
            state.writing = false;
            state.written += 1;
            if let Err(e) = &result {
                state.gone = true;
                if is_stdout {
                    stdout::lose(e);
                }
            }
            shared.changed.notify_all();
        } else if state.closed {
            return;
        } else {
            state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

    use super::*;

    /// Output for the tests. Each write waits until the test receives the line. A write fails after the test has
    /// disconnected.
    struct Slow(SyncSender<Vec<u8>>);

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let gone = |_| std::io::Error::from(std::io::ErrorKind::BrokenPipe);
            self.0.send(bytes.to_vec()).map_err(gone).map(|()| bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    fn slow() -> (Lines, Receiver<Vec<u8>>) {
        let (sender, receiver) = sync_channel(0);
        (Lines::to(Slow(sender), false).unwrap(), receiver)
    }

    /// If the reader does not read, the command can still add lines, and the queue counts the lines that nobody has
    /// read. The wait at the end of the command is limited.
    #[test]
    fn a_reader_that_does_not_read_stops_nothing() {
        let (mut lines, _reader) = slow();
        (0..3 * WAITING).for_each(|i| lines.push(i.to_string()));
        lines.push_always("end".into());
        // The count includes a line that the printing thread has already taken but cannot print.
        let unseen = lines.finish();
        assert_eq!(unseen, 3 * WAITING as u64 + 1);
    }

    /// A slow reader receives every accepted line, in order.
    #[test]
    fn lines_come_whole_and_in_order() {
        let (mut lines, reader) = slow();
        let read = std::thread::spawn(move || {
            reader.iter().map(|l| String::from_utf8(l).unwrap()).collect::<String>()
        });
        (0..500).for_each(|i| lines.push(format!("{i}\n")));
        assert_eq!(lines.finish(), 0);
        drop(lines);
        let expected: String = (0..500).map(|i| format!("{i}\n")).collect();
        assert_eq!(read.join().unwrap(), expected);
    }

    #[test]
    fn a_reader_that_has_gone_is_noticed() {
        let (mut lines, reader) = slow();
        drop(reader);
        lines.push("one".into());
        lines.finish();
        assert!(lines.gone());
    }
}
