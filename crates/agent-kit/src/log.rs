//! The log of commands: who, what, when, result; appended to and never rewritten.
use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::SystemTime;

use serde_json::{Value, json};

/// Lines that may wait for a slow disk.
const WAITING_MAX: usize = 4096;

/// A file with one JSON object a line, written by a thread of its own: a Stop waits for no disk.
pub struct CommandLog {
    lines: Option<SyncSender<Value>>,
    writer: Option<JoinHandle<()>>,
    /// Lines that wait for the disk.
    waiting: Arc<AtomicUsize>,
    /// Lines that found no place since the last that did.
    lost: u64,
    lost_in_all: u64,
}

/// What is written whatever else is: what moved something, who stopped it. The rest leaves half of the room free.
const NEEDED: [&str; 7] = ["sent", "answered", "command", "halt", "lease", "policy", "not-taken"];

impl CommandLog {
    /// Goes on with this file, or begins it; none: nothing is kept. `failed` is called, on the writer's thread, with the first error of
    /// writing, and again after lines could be written in between.
    ///
    /// # Errors
    ///
    /// It cannot be opened.
    pub fn open(path: Option<&Path>, failed: impl FnMut(&io::Error) + Send + 'static) -> io::Result<Self> {
        let Some(path) = path else {
            return Ok(Self { lines: None, writer: None, waiting: Arc::default(), lost: 0, lost_in_all: 0 });
        };
        let file = OpenOptions::new().append(true).create(true).open(path)?;
        let (lines, incoming) = sync_channel(WAITING_MAX);
        let waiting: Arc<AtomicUsize> = Arc::default();
        let done = waiting.clone();
        let writer = std::thread::spawn(move || write(file, &incoming, &done, failed));
        Ok(Self { lines: Some(lines), writer: Some(writer), waiting, lost: 0, lost_in_all: 0 })
    }

    /// Writes a line: what happened, and what is to be known of it. Never waits.
    pub fn write(&mut self, what: &str, mut facts: Value) {
        let Some(lines) = &self.lines else { return };
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let mut line = json!({ "unix_s": since.as_secs_f64(), "what": what });
        if let (Some(line), Some(facts)) = (line.as_object_mut(), facts.as_object_mut()) {
            line.append(facts);
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
    /// Lines that found no place.
    pub fn lost_in_all(&self) -> u64 {
        self.lost_in_all
    }
}

impl Drop for CommandLog {
    fn drop(&mut self) {
        self.lines = None;
        if let Some(writer) = self.writer.take() {
            // A panic of that thread has been printed.
            drop(writer.join());
        }
    }
}

fn write(mut file: File, lines: &Receiver<Value>, waiting: &AtomicUsize, mut failed: impl FnMut(&io::Error)) {
    let mut fails = false;
    for line in lines {
        waiting.fetch_sub(1, Ordering::Relaxed);
        let written = writeln!(file, "{line}");
        if let Err(error) = &written
            && !fails
        {
            failed(error);
        }
        fails = written.is_err();
    }
}
