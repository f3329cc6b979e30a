//! Recording that is written during the run, so that only the last samples are lost if the program is killed.
//!
//! A separate thread writes the file. Because of this thread, a slow or full disk does not delay the caller.

use std::fs::File;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::{Ending, Recorder, RecordingError, RecordingInfo};
use crate::sample::Sample;

/// Maximum delay until recorded samples are passed to the operating system.
pub const FLUSH: Duration = Duration::from_millis(200);
/// Maximum number of samples that are in memory before they are written to the disk. 16,384 samples correspond to 16
/// s with a simulator, or to many minutes on a serial line.
const WAITING_MAX: usize = 1 << 14;

enum Message {
    Sample(Box<Sample>),
    End(Ending),
    Abandon,
}

/// Receiver for the samples during a run.
#[derive(Clone)]
pub struct SampleSink(SyncSender<Message>);

impl SampleSink {
    /// Passes a sample to the recorder. After a write error, which the recorder has already reported, samples are
    /// ignored.
    pub fn write(&self, sample: &Sample) {
        let _ = self.0.send(Message::Sample(Box::new(*sample)));
    }
}

/// Recording in progress.
pub struct LiveRecorder {
    sink: SampleSink,
    thread: JoinHandle<Result<u64, RecordingError>>,
}

impl LiveRecorder {
    /// Begins the recording in `file` and writes the header to the disk, so a full disk causes an error at once. The
    /// extension of `path` selects the format. If writing fails later, the writing thread calls `on_error` once.
    pub fn begin(
        file: File,
        path: &Path,
        info: &RecordingInfo,
        on_error: impl FnOnce(&RecordingError) + Send + 'static,
    ) -> Result<Self, RecordingError> {
        let mut recorder = Recorder::on(file, path, info)?;
        recorder.flush()?;
        let (send, messages) = sync_channel(WAITING_MAX);
        let thread = std::thread::Builder::new().name("recording".into()).spawn(move || {
            let done = write(recorder, &messages);
            done.inspect_err(on_error)
        });
        let thread = thread.map_err(|e| RecordingError::io(path, e))?;
        Ok(Self { sink: SampleSink(send), thread })
    }

    /// Returns a sink for samples. [`Self::finish`] ends the recording even if sinks still exist.
    pub fn sink(&self) -> SampleSink {
        self.sink.clone()
    }

    /// Writes the ending of the run and completes the file. Returns the number of samples, or an error if the file is incomplete.
    pub fn finish(self, ending: &Ending) -> Result<u64, RecordingError> {
        self.end(Message::End(ending.clone()))
    }

    /// Ends the recording without completing the file. The caller then writes the file again from the start.
    pub fn abandon(self) {
        let _ = self.end(Message::Abandon);
    }

    fn end(self, message: Message) -> Result<u64, RecordingError> {
        let _ = self.sink.0.send(message);
        self.thread.join().unwrap_or_else(|_| Err(std::io::Error::other("the writer ended").into()))
    }
}

/// Writes samples until the end message arrives.
fn write(mut recorder: Recorder, messages: &Receiver<Message>) -> Result<u64, RecordingError> {
    let (mut due, mut fresh) = (Instant::now() + FLUSH, false);
    loop {
        match messages.recv_timeout(due.saturating_duration_since(Instant::now())) {
            Ok(Message::Sample(sample)) => {
                recorder.write(&sample)?;
                fresh = true;
            }
            Ok(Message::End(ending)) => return recorder.finish_as(&ending),
            Ok(Message::Abandon) | Err(RecvTimeoutError::Disconnected) => return Ok(recorder.samples()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        let now = Instant::now();
        if now >= due {
            if fresh {
                recorder.flush()?;
            }
            (due, fresh) = (now + FLUSH, false);
        }
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::{ControllerState, TrajectoryState};

    use super::super::Recording;
    use super::*;

    fn sample(i: u32) -> Sample {
        Sample {
            time_s: f64::from(i) * 1e-3,
            state: ControllerState::Operate.into(),
            trajectory: TrajectoryState::Execute.into(),
            point: i,
            ..Sample::default()
        }
    }

    /// The test reads the file before the recording is completed. As after `kill -9`, the file contains only the data
    /// that were passed to the operating system.
    #[test]
    fn what_was_recorded_is_readable_while_it_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["run.mcap", "run.csv"] {
            let path = dir.path().join(name);
            let info = RecordingInfo::default();
            let live = LiveRecorder::begin(File::create(&path).unwrap(), &path, &info, |_| ()).unwrap();
            let sink = live.sink();
            (0..150).for_each(|i| sink.write(&sample(i)));
            let whole = (0..200).any(|_| {
                std::thread::sleep(Duration::from_millis(20));
                Recording::read(&path).is_ok_and(|r| r.samples.len() == 150)
            });
            assert!(whole, "{name}: {:?}", Recording::read(&path).map(|r| r.samples.len()));
            let read = Recording::read(&path).unwrap();
            assert!(read.cut.unwrap().contains("0.149 s"), "{name}");
            // The recording can be completed even if an observer still has a sink.
            let ending = Ending { outcome: "stopped".into(), reason: "by hand".into(), ..Ending::default() };
            assert_eq!(live.finish(&ending).unwrap(), 150);
            let read = Recording::read(&path).unwrap();
            assert_eq!((read.samples.len(), read.ending, read.cut), (150, ending, None), "{name}");
            sink.write(&sample(150));
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_disk_that_takes_nothing_is_known_before_the_first_sample() {
        for name in ["run.csv", "run.mcap"] {
            let full = File::options().write(true).open("/dev/full").unwrap();
            let begun = LiveRecorder::begin(full, Path::new(name), &RecordingInfo::default(), |_| ());
            let error = begun.err().map(|e| e.to_string()).unwrap_or_default();
            assert!(error.contains("No space left"), "{error}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn an_error_on_the_way_is_reported_at_once_and_again_at_the_end() {
        let (read, write) = std::io::pipe().unwrap();
        let file = File::from(std::os::fd::OwnedFd::from(write));
        let (send, errors) = std::sync::mpsc::channel();
        let on_error = move |e: &RecordingError| send.send(e.to_string()).unwrap();
        let live =
            LiveRecorder::begin(file, Path::new("run.csv"), &RecordingInfo::default(), on_error).unwrap();
        drop(read);
        live.sink().write(&sample(0));
        let error = errors.recv_timeout(Duration::from_secs(20)).unwrap();
        assert!(error.starts_with("run.csv: ") && error.contains("pipe"), "{error}");
        assert!(live.finish(&Ending::default()).is_err());
    }
}
