//! Writer of recordings, which runs in a separate thread. A slow or full disk therefore does not delay
//! other threads.
#[cfg(test)]
mod tests;

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jtc_host::Sample;
use jtc_host::recording::{Ending, FLUSH, Recorder, RecordingInfo};
use serde_json::{Value, json};

use super::retention::{Begun, Retention};

/// Largest number of samples that are queued for the disk. The queue is long enough for several minutes
/// of statuses.
const WAITING_MAX: usize = 1 << 13;
/// Number of queue entries that are reserved for the start and the end of recordings.
const RESERVED: usize = 64;
/// Time after which the writer repeats a failed write.
const AGAIN: Duration = Duration::from_secs(5);

/// Message to the writer's thread.
enum Message {
    Begin(Box<RecordingInfo>),
    Sample(Box<Sample>),
    /// End of the recording, and the number of samples that did not fit into the queue.
    End(Ending, u64),
}

/// Notice about recordings for the user.
#[derive(Clone, Debug)]
pub struct Notice {
    /// Keyword of the notice for logs.
    pub what: &'static str,
    /// Details of the notice in JSON.
    pub facts: Value,
    /// Warning for the user; `None` without a problem.
    pub warning: Option<String>,
}

/// Callback for a notice, which runs on the writer's thread.
pub type Notify = Box<dyn FnMut(Notice) + Send>;

/// Input of the queue to the writer's thread.
pub(super) struct Disk {
    queue: SyncSender<Message>,
    waiting: Arc<AtomicUsize>,
    /// Number of samples of the current recording that did not fit into the queue.
    lost: u64,
}

impl Disk {
    fn new() -> (Self, Receiver<Message>) {
        let (queue, messages) = sync_channel(WAITING_MAX);
        (Self { queue, waiting: Arc::default(), lost: 0 }, messages)
    }

    /// Starts the thread that writes the recordings into the directory of `retention`.
    pub(super) fn begin(retention: Retention, notify: Notify) -> io::Result<(Self, JoinHandle<()>)> {
        let (disk, messages) = Self::new();
        let taken = disk.waiting.clone();
        let writer = Writer::new(retention, notify, AGAIN);
        let thread = std::thread::Builder::new()
            .name("recordings".into())
            .spawn(move || writer.run(&messages, &taken))?;
        Ok((disk, thread))
    }

    fn send(&mut self, message: Message, reserved: usize) -> bool {
        if self.waiting.load(Ordering::Relaxed) + reserved >= WAITING_MAX {
            return false;
        }
        self.waiting.fetch_add(1, Ordering::Relaxed);
        let sent = self.queue.try_send(message).is_ok();
        if !sent {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
        sent
    }

    /// Begins a recording. Like the other methods of the queue, this method never waits for the disk.
    pub(super) fn open(&mut self, info: RecordingInfo) {
        self.lost = 0;
        self.send(Message::Begin(Box::new(info)), 0);
    }

    /// Queues a sample for the current recording. If the queue is full, the sample counts as lost.
    pub(super) fn write(&mut self, sample: &Sample) {
        if !self.send(Message::Sample(Box::new(*sample)), RESERVED) {
            self.lost += 1;
        }
    }

    /// Adds `samples` to the count of lost samples. These samples were lost before they reached the
    /// queue of the writer.
    pub(super) fn lose(&mut self, samples: u64) {
        self.lost += samples;
    }

    /// Ends the current recording.
    pub(super) fn close(&mut self, ending: Ending) {
        let lost = std::mem::take(&mut self.lost);
        self.send(Message::End(ending, lost), 0);
    }
}

/// Recording file that is being written.
struct Open {
    recorder: Recorder,
    begun: Begun,
}

/// State of the writer's thread.
struct Writer {
    retention: Retention,
    notify: Notify,
    open: Option<Open>,
    /// Current recording. The writer keeps the current recording even while its file cannot be written.
    wanted: Option<Box<RecordingInfo>>,
    failed: Option<Instant>,
    /// Interval until the next attempt to write.
    again: Duration,
    /// Number of samples of the recording that could not be written.
    lost: u64,
}

impl Writer {
    fn new(retention: Retention, notify: Notify, again: Duration) -> Self {
        Self { retention, notify, open: None, wanted: None, failed: None, again, lost: 0 }
    }

    fn run(mut self, messages: &Receiver<Message>, waiting: &AtomicUsize) {
        let (mut due, mut fresh) = (Instant::now() + FLUSH, false);
        loop {
            match messages.recv_timeout(due.saturating_duration_since(Instant::now())) {
                Ok(message) => {
                    waiting.fetch_sub(1, Ordering::Relaxed);
                    fresh = true;
                    self.take(message);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    // The queue closed before the end of the recording.
                    self.end(&Ending::default());
                    return;
                }
            }
            if Instant::now() >= due {
                if std::mem::take(&mut fresh) {
                    self.flush();
                }
                due = Instant::now() + FLUSH;
            }
        }
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Begin(info) => {
                self.end(&Ending::default());
                self.lost = 0;
                self.wanted = Some(info);
                self.begin();
            }
            Message::Sample(sample) => {
                if self.open.is_none() && self.failed.is_some_and(|at| at.elapsed() >= self.again) {
                    self.begin();
                }
                match self.open.as_mut().map(|open| open.recorder.write(&sample)) {
                    Some(Ok(())) => {}
                    None => self.lost += 1,
                    Some(Err(error)) => {
                        self.lost += 1;
                        self.fail(&error.to_string());
                    }
                }
            }
            Message::End(ending, lost) => {
                self.lost += lost;
                self.end(&ending);
            }
        }
    }

    fn notice(&mut self, what: &'static str, facts: Value, warning: Option<String>) {
        (self.notify)(Notice { what, facts, warning });
    }

    /// Removes the oldest recordings until `bytes` more bytes fit within the limit.
    fn make_room(&mut self, bytes: u64) {
        for path in self.retention.make_room(bytes) {
            self.notice("recording-removed", json!({ "file": path }), None);
        }
    }

    /// Creates the file of the current recording.
    fn begin(&mut self) {
        let Some(info) = &self.wanted else { return };
        let made = self.retention.begin(host_kit::unix_time()).map_err(|e| e.to_string());
        let begun = made.and_then(|(file, begun)| {
            // The writer writes the file header now, so that it finds a disk error before the first
            // sample.
            let recorder = Recorder::on(file, &begun.path, info)
                .and_then(|mut recorder| recorder.flush().map(|()| recorder));
            match recorder {
                Ok(recorder) => Ok(Open { recorder, begun }),
                Err(error) => {
                    self.retention.break_off(begun, 0);
                    Err(error.to_string())
                }
            }
        });
        match begun {
            Err(error) => self.fail(&error),
            Ok(open) => {
                if self.failed.take().is_some() {
                    let file = open.begun.path.clone();
                    let words = format!("the agent records again, to {}", file.display());
                    self.notice("recording-again", json!({ "file": file }), Some(words));
                }
                self.open = Some(open);
                self.make_room(0);
            }
        }
    }

    /// Processes a write error. Reports only the first of several consecutive write errors.
    fn fail(&mut self, error: &str) {
        let file = self.break_off();
        if self.failed.replace(Instant::now()).is_none() {
            let words = format!(
                "{error}; the agent records nothing until the disk accepts data again; commands still work"
            );
            self.notice("recording-stopped", json!({ "file": file, "why": error }), Some(words));
        }
    }

    /// Closes the recording file without completing it.
    fn break_off(&mut self) -> Option<PathBuf> {
        let Open { recorder, begun } = self.open.take()?;
        let (path, samples) = (begun.path.clone(), recorder.samples());
        // When the recorder is dropped, it tries to complete the file. A failure is ignored.
        drop(recorder);
        self.retention.break_off(begun, samples);
        Some(path)
    }

    /// Passes all samples to the operating system. Begins a new recording file if the present file is
    /// too long.
    fn flush(&mut self) {
        let Some(open) = &mut self.open else { return };
        if let Err(error) = open.recorder.flush() {
            return self.fail(&error.to_string());
        }
        let bytes = open.begun.path.metadata().map_or(0, |found| found.len());
        self.make_room(bytes);
        if bytes > self.retention.longest() {
            let ending = Ending {
                outcome: "continued".into(),
                reason: "the next recording continues this motion".into(),
                ..Ending::default()
            };
            self.complete(&ending);
            self.begin();
        }
    }

    /// Ends the current recording.
    fn end(&mut self, ending: &Ending) {
        self.complete(ending);
        self.wanted = None;
    }

    /// Completes the recording file.
    fn complete(&mut self, ending: &Ending) {
        let ending = Ending { lost_samples: std::mem::take(&mut self.lost), ..ending.clone() };
        let Some(Open { recorder, begun }) = self.open.take() else { return };
        let samples = recorder.samples();
        let done = recorder.finish_as(&ending).map_err(|e| e.to_string());
        let kept = match &done {
            Ok(_) => self.retention.end(begun).map_err(|e| e.to_string()),
            Err(error) => {
                self.retention.break_off(begun, samples);
                Err(error.clone())
            }
        };
        match kept {
            Ok(file) => {
                let facts = json!({
                    "file": file, "samples": samples, "outcome": ending.outcome,
                    "reason": ending.reason, "lost_samples": ending.lost_samples,
                });
                let words = format!(
                    "{}: {} samples are missing, because the disk was too slow",
                    file.display(),
                    ending.lost_samples
                );
                self.notice("recorded", facts, (ending.lost_samples > 0).then_some(words));
                self.make_room(0);
            }
            Err(error) => self.fail(&error),
        }
    }
}
