//! Command log: lines with client, command, time and result. The agent only appends lines to the log and never
//! rewrites them.
mod repeats;
mod rotate;

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::cut::cut_texts;
use repeats::Repeats;
use rotate::{Rotated, Target};

/// Default limit of the total size of the current and the previous log file, bytes.
pub const LIMIT: u64 = 100_000_000;

/// Largest number of log lines that wait for a slow disk.
const WAITING_MAX: usize = 4096;
/// Longest wait for the last log lines when a program ends. A disk that does not respond must not prevent the end of
/// the program.
const LAST_LINES: Duration = Duration::from_secs(3);

/// Log file with one JSON object per line. A separate thread writes the file, so that a Stop never waits for the disk.
pub struct CommandLog {
    lines: Option<SyncSender<Value>>,
    /// Channel that closes when all log lines are written.
    written: Receiver<()>,
    /// Number of log lines that wait for the disk.
    waiting: Arc<AtomicUsize>,
    /// Number of log lines that were dropped since the last line was queued.
    lost: u64,
    lost_in_all: u64,
    /// Number of log lines that could not be written to the disk.
    unwritten: Arc<AtomicU64>,
    repeats: Repeats,
}

/// Kinds of log lines about motions, Stops and leases. Lines of all other kinds use at most half of the queue. Lines
/// of the kinds in this list are therefore written even when other lines are dropped.
const NEEDED: [&str; 10] =
    ["sent", "answered", "command", "halt", "stop", "stopped", "ended", "lease", "policy", "not-taken"];

impl CommandLog {
    /// Opens or creates the log file `path`; with `None`, no line is stored. When the file reaches half of `limit`
    /// bytes, it is renamed to `FILE.1` and replaces the previous `FILE.1`. The writer's thread calls `failed` with
    /// the first write error, and again with the first error after each successful write.
    ///
    /// # Errors
    ///
    /// The log file cannot be opened.
    pub fn open(
        path: Option<&Path>,
        limit: u64,
        failed: impl FnMut(&io::Error) + Send + 'static,
    ) -> io::Result<Self> {
        let Some(path) = path else {
            return Ok(Self {
                lines: None,
                written: sync_channel(0).1,
                waiting: Arc::default(),
                lost: 0,
                lost_in_all: 0,
                unwritten: Arc::default(),
                repeats: Repeats::default(),
            });
        };
        Ok(Self::on(Rotated::open(path, limit)?, failed))
    }

    fn on(file: impl Target + Send + 'static, failed: impl FnMut(&io::Error) + Send + 'static) -> Self {
        let (lines, incoming) = sync_channel(WAITING_MAX);
        let (waiting, unwritten) = (Arc::<AtomicUsize>::default(), Arc::<AtomicU64>::default());
        let (done, missing) = (waiting.clone(), unwritten.clone());
        let (writes, written) = sync_channel(0);
        std::thread::spawn(move || {
            write(file, &incoming, &done, &missing, failed);
            drop::<SyncSender<()>>(writes);
        });
        let repeats = Repeats::default();
        Self { lines: Some(lines), written, waiting, lost: 0, lost_in_all: 0, unwritten, repeats }
    }

    /// Writes a log line with the name of the event and its data. Never waits for the disk.
    pub fn write(&mut self, what: &str, facts: Value) {
        for (what, facts) in self.repeats.due(Instant::now()) {
            self.line(what, facts);
        }
        self.line(what, facts);
    }

    /// Writes a log line about a `sender` that can cause many lines without a token. The first ten lines about a sender
    /// are written in full. Later, the log contains one line per minute with the number of repetitions (`times`) and
    /// the data of the last repetition.
    pub fn write_repeated(&mut self, what: &'static str, sender: &str, facts: Value) {
        if self.lines.is_none() {
            return;
        }
        let now = Instant::now();
        let mut lines = self.repeats.due(now);
        lines.extend(self.repeats.admit(what, sender, facts, now).map(|facts| (what, facts)));
        for (what, facts) in lines {
            self.line(what, facts);
        }
    }

    fn line(&mut self, what: &str, mut facts: Value) {
        let Some(lines) = &self.lines else { return };
        let since = host_kit::unix_time();
        let mut line = json!({ "unix_s": since.as_secs_f64(), "what": what });
        if let (Some(line), Some(facts)) = (line.as_object_mut(), facts.as_object_mut()) {
            line.append(facts);
            line.values_mut().for_each(cut_texts);
            if self.lost > 0 {
                line.insert("lines_lost_before".into(), self.lost.into());
            }
        }
        let room = NEEDED.contains(&what) || self.waiting.load(Ordering::Relaxed) < WAITING_MAX / 2;
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if room && lines.try_send(line).is_ok() {
            self.lost = 0;
        } else {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            self.lost += 1;
            self.lost_in_all += 1;
        }
    }
}

impl CommandLog {
    /// Returns the number of log lines that were dropped or could not be written to the disk.
    pub fn lost_in_all(&self) -> u64 {
        self.lost_in_all + self.unwritten.load(Ordering::Relaxed)
    }
}

impl Drop for CommandLog {
    fn drop(&mut self) {
        for (what, facts) in self.repeats.rest() {
            self.line(what, facts);
        }
        self.lines = None;
        // The channel transmits no messages. The channel closes when the writer's thread ends, even after a panic. The
        // wait for the writer's thread is limited.
        let _ = self.written.recv_timeout(LAST_LINES);
    }
}

fn write(
    mut file: impl Target,
    lines: &Receiver<Value>,
    waiting: &AtomicUsize,
    unwritten: &AtomicU64,
    mut failed: impl FnMut(&io::Error),
) {
    let (mut fails, mut cut, mut lost) = (false, false, 0);
    for mut line in lines {
        waiting.fetch_sub(1, Ordering::Relaxed);
        if lost > 0
            && let Some(line) = line.as_object_mut()
        {
            let before = line.get("lines_lost_before").and_then(Value::as_u64).unwrap_or(0);
            line.insert("lines_lost_before".into(), (before + lost).into());
        }
        // An incomplete log line is first completed with a line end, so that the next line is not damaged.
        let line = line.to_string();
        let mut text = format!("{}{}\n", if cut { "\n" } else { "" }, host_kit::visible(&line));
        let room = file.make_room(text.len());
        if cut && matches!(room, Ok(true)) {
            text.remove(0);
        }
        let (taken, written) = match room {
            Ok(_) => write_whole(&mut file, text.as_bytes()),
            Err(error) => (0, Err(error)),
        };
        if let Some(last) = taken.checked_sub(1).and_then(|last| text.as_bytes().get(last)) {
            cut = *last != b'\n';
        }
        match &written {
            Ok(()) => lost = 0,
            Err(error) => {
                lost += 1;
                unwritten.fetch_add(1, Ordering::Relaxed);
                if !fails {
                    failed(error);
                }
            }
        }
        fails = written.is_err();
    }
}

/// Writes the bytes to the file. Returns the number of bytes that were written, and an error if some bytes were not
/// written.
fn write_whole(file: &mut impl io::Write, bytes: &[u8]) -> (usize, io::Result<()>) {
    let mut taken = 0;
    while let Some(rest @ [_, ..]) = bytes.get(taken..) {
        match file.write(rest) {
            Ok(0) => return (taken, Err(io::ErrorKind::WriteZero.into())),
            Ok(n) => taken += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return (taken, Err(error)),
        }
    }
    (taken, Ok(()))
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, PoisonError};

    use super::*;

    /// Simulated disk with space for a number of bytes, and the bytes that were written to it.
    #[derive(Clone, Default)]
    struct Disk(Arc<Mutex<(usize, Vec<u8>)>>);

    impl Disk {
        fn with<T>(&self, act: impl FnOnce(&mut (usize, Vec<u8>)) -> T) -> T {
            act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
        }
    }

    impl io::Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.with(|(room, taken)| {
                let n = bytes.len().min(*room);
                *room -= n;
                taken.extend(&bytes[..n]);
                if n > 0 { Ok(n) } else { Err(io::ErrorKind::StorageFull.into()) }
            })
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Target for Disk {}

    /// A disk that does not respond delays the end of a program only briefly.
    #[test]
    fn a_disk_that_hangs_keeps_nobody() {
        struct Hung(Receiver<()>);
        impl io::Write for Hung {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                // The write blocks until the test ends.
                self.0.recv().unwrap_or_default();
                Ok(bytes.len())
            }

            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        impl Target for Hung {}
        let (hangs, until) = sync_channel(0);
        let mut log = CommandLog::on(Hung(until), |_| {});
        log.write("sent", json!({}));
        // The test succeeds if the call of `drop` returns.
        drop(log);
        drop::<SyncSender<()>>(hangs);
    }

    /// The disk can become full at any byte. Each write error is reported once, and all log lines except the
    /// interrupted line are complete. The next log line states the number of missing lines.
    #[test]
    fn a_full_disk_costs_the_lines_that_it_does_not_take_and_they_are_counted() {
        for room in 0..120 {
            let (disk, failures) = (Disk::default(), Arc::<AtomicUsize>::default());
            disk.with(|(left, _)| *left = room);
            let failed = failures.clone();
            let mut log = CommandLog::on(disk.clone(), move |_| {
                failed.fetch_add(1, Ordering::Relaxed);
            });
            let done = |log: &CommandLog| {
                while log.waiting.load(Ordering::Relaxed) > 0 {
                    std::thread::yield_now();
                }
            };
            (0..5).for_each(|n| log.write("sent", json!({ "n": n })));
            done(&log);
            // The writer's thread may still process the last of the first five lines when the disk gets space again.
            // The three lines that follow are written after that line.
            disk.with(|(left, _)| *left = usize::MAX);
            (5..8).for_each(|n| log.write("sent", json!({ "n": n })));
            log.lines = None;
            log.written.recv().unwrap_or_default();
            let text = disk.with(|(_, taken)| String::from_utf8(taken.clone()).expect("text"));
            let whole: Vec<Value> = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
            let lost = log.lost_in_all();
            // A log line without its line end is counted as lost, although its text is in the file.
            assert!((8..=9).contains(&(whole.len() as u64 + lost)), "{room}: {text}");
            assert!(text.lines().count() <= whole.len() + 1, "{room}: one line breaks off: {text}");
            assert_eq!(whole.last().map(|line| line["n"].clone()), Some(7.into()));
            let named: u64 = whole.iter().filter_map(|line| line["lines_lost_before"].as_u64()).sum();
            assert_eq!(named, lost, "{room}: {text}");
            assert_eq!(failures.load(Ordering::Relaxed), usize::from(lost > 0), "{room}");
        }
    }

    /// For any limit and any number of restarts, the current and the previous log file together stay within the limit.
    /// Each log line is complete and appears once. No line is missing between the first and the last line in the files.
    #[test]
    fn the_log_keeps_its_limit_and_its_last_lines() {
        let dir = tempfile::tempdir().expect("a directory");
        for (case, limit) in [1_000, 2_000, 5_000, 20_000, 1_000_000].into_iter().enumerate() {
            let path = dir.path().join(format!("{case}.jsonl"));
            let aside = dir.path().join(format!("{case}.jsonl.1"));
            for begun in 0..3 {
                let mut log =
                    CommandLog::open(Some(&path), limit, |error| panic!("{error}")).expect("a file");
                (0..100).for_each(|n| log.write("sent", json!({ "n": 100 * begun + n })));
                drop(log);
                let (now, before) = (std::fs::read(&path).expect("it is there"), std::fs::read(&aside));
                let before = before.unwrap_or_default();
                assert!(
                    (now.len() + before.len()) as u64 <= limit,
                    "{limit}: {} {}",
                    before.len(),
                    now.len()
                );
                let text = String::from_utf8([before, now].concat()).expect("text");
                let lines: Vec<Value> =
                    text.lines().map(|line| serde_json::from_str(line).expect("a whole line")).collect();
                let numbers: Vec<u64> = lines.iter().filter_map(|line| line["n"].as_u64()).collect();
                let last = 100 * begun + 99;
                assert_eq!(numbers, (last + 1 - numbers.len() as u64..=last).collect::<Vec<_>>(), "{limit}");
                assert!(text.len() as u64 * 3 > limit || numbers.len() as u64 == last + 1, "{limit}");
            }
        }
    }

    /// If the log file cannot be renamed, the error is reported and the lines are counted as lost. The log file stays
    /// within its limit.
    #[test]
    fn a_log_that_cannot_be_put_aside_stays_within_its_limit() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("log.jsonl");
        std::fs::create_dir_all(dir.path().join("log.jsonl.1/x")).expect("a directory in its place");
        let (failures, failed) = sync_channel(100);
        let mut log = CommandLog::open(Some(&path), 1_000, move |error| {
            failures.try_send(error.to_string()).expect("it is reported once");
        })
        .expect("a file");
        (0..100).for_each(|n| log.write("sent", json!({ "n": n })));
        let lost = log.unwritten.clone();
        drop(log);
        let text = std::fs::read_to_string(&path).expect("it is there");
        assert!(text.len() <= 500, "{text}");
        assert_eq!(text.lines().count() as u64 + lost.load(Ordering::Relaxed), 100);
        let errors: Vec<String> = failed.iter().collect();
        assert!(errors.len() == 1 && errors[0].contains("cannot be renamed"), "{errors:?}");
    }

    #[test]
    fn what_is_no_ordinary_file_is_never_put_aside() {
        let mut log =
            CommandLog::open(Some(Path::new("/dev/null")), 10, |error| panic!("{error}")).expect("it opens");
        (0..100).for_each(|n| log.write("sent", json!({ "n": n })));
        drop(log);
        assert!(!Path::new("/dev/null.1").exists());
    }

    /// Each of the first refused requests causes a log line of limited length. Later refused requests cause no line
    /// of their own. The log counts every refused request.
    #[test]
    fn lines_of_those_who_are_not_let_in_are_short_and_few() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("log.jsonl");
        let mut log = CommandLog::open(Some(&path), LIMIT, |error| panic!("{error}")).expect("a file");
        let long = "B".repeat(65_000);
        for n in 0..5_000 {
            let from = format!("10.0.{}.{}", n % 3, n % 2);
            log.write_repeated("refused", &from, json!({ "from": from, "path": long, "why": long }));
        }
        drop(log);
        let text = std::fs::read_to_string(&path).expect("it is there");
        let lines: Vec<Value> =
            text.lines().map(|line| serde_json::from_str(line).expect("a whole line")).collect();
        let times: u64 = lines.iter().map(|line| line["times"].as_u64().unwrap_or(1)).sum();
        assert_eq!(times, 5_000);
        assert!(lines.len() == 6 * 11 && text.len() < 200_000, "{} lines, {} bytes", lines.len(), text.len());
    }
}
