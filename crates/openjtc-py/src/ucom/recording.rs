//! Recording of the bus to a file. The bus of the session passes its frames to a separate thread, because writing to
//! a disk can take long.

use std::path::Path;
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use can_link::{CanBus, CanError, CanFrame, ControllerState};
use pyo3::prelude::*;
use ucom::Profile;
use ucom_host::files::recording::{RecordingError, RecordingFormat};
use ucom_host::session::{Prompt, Recorder};

use crate::error::Failure;
use crate::threads::{Process, lock};

/// Interval at which the thread writes the recorded frames to the file.
const FLUSH: Duration = Duration::from_secs(1);

/// Session time in µs, time since 1970 in ns, and the frame.
struct Taken(u64, u64, CanFrame);

/// Channel to the current recording, if a recording is in progress.
#[derive(Clone, Default)]
pub(super) struct Sink(Arc<Mutex<Option<Sender<Taken>>>>);

impl Sink {
    fn is_taken(&self) -> bool {
        lock(&self.0).is_some()
    }

    fn set(&self, sender: Option<Sender<Taken>>) {
        *lock(&self.0) = sender;
    }
}

/// Wrapper of a bus that copies frames to a recording. The wrapper never waits long.
pub(super) struct Tap {
    bus: Prompt,
    sink: Sink,
    start: Instant,
    /// Wall-clock time of the start. Later times are computed from this time. The times in a file therefore never decrease
    /// when the clock is changed.
    began_at: Duration,
}

impl Tap {
    /// Wraps an open bus.
    pub(super) fn new(bus: Box<dyn CanBus + Send>, sink: Sink) -> Self {
        Self { bus: Prompt(bus), sink, start: Instant::now(), began_at: host_kit::unix_time() }
    }

    fn take(&self, frame: &CanFrame) {
        if let Some(sender) = &*lock(&self.sink.0) {
            let passed = self.start.elapsed();
            let time_ns = (self.began_at + passed).as_nanos() as u64;
            // An error is ignored. The error means that the writer has ended, for example because the disk is full. The
            // writer itself reports the cause.
            let _ = sender.send(Taken(passed.as_micros() as u64, time_ns, *frame));
        }
    }
}

impl CanBus for Tap {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        self.bus.send(frame)?;
        self.take(frame);
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let received = self.bus.receive(timeout)?;
        if let Some(frame) = &received {
            self.take(frame);
        }
        Ok(received)
    }

    fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
        self.bus.carries(frame)
    }

    fn state(&mut self) -> ControllerState {
        self.bus.state()
    }

    fn times_bus_off(&self) -> u64 {
        self.bus.times_bus_off()
    }
}

/// Result of a recording: number of written frames, and number of omitted frames. A frame is omitted if the file format
/// cannot store its protocol.
type Written = Result<(u64, u64), RecordingError>;

/// A recording that is being written.
#[pyclass(frozen, module = "openjtc._native")]
pub(super) struct ChainRecording {
    sink: Sink,
    writer: Mutex<Option<JoinHandle<Written>>>,
    process: Process,
}

impl ChainRecording {
    /// Begins a recording. The file extension selects the file format.
    pub(super) fn begin(sink: Sink, path: &Path, profile: Profile, channel: &str) -> Result<Self, Failure> {
        let ending = path.extension().map(|e| e.to_string_lossy().into_owned());
        let known = ["log", "candump", "fzi", "fzican", "mcap"];
        if let Some(other) = ending.filter(|e| !known.contains(&e.as_str())) {
            return Err(Failure::usage(format!(
                "{}: recordings with the ending .{other} are not supported",
                path.display()
            ))
            .next("use the ending .log (candump), .fzi (FZI-CAN) or .mcap (MCAP)"));
        }
        if sink.is_taken() {
            let busy = Failure::usage("the chain is already being recorded");
            return Err(busy.next("end that recording first"));
        }
        let (ready, opened) = mpsc::channel();
        let (sender, taken) = mpsc::channel();
        let (file, channel) = (path.to_owned(), channel.to_owned());
        let writer = std::thread::spawn(move || {
            let format = RecordingFormat::of_path(&file);
            match Recorder::file(&file, format, profile, &channel) {
                Ok(recorder) => {
                    let _ = ready.send(None);
                    write(recorder, &taken)
                }
                Err(error) => {
                    let _ = ready.send(Some(error.to_string()));
                    Err(error)
                }
            }
        });
        match opened.recv() {
            Ok(None) => {}
            Ok(Some(error)) => return Err(Failure::usage(error)),
            Err(_) => return Err(failed("internal error of the writer")),
        }
        sink.set(Some(sender));
        Ok(Self { sink, writer: Mutex::new(Some(writer)), process: Process::this() })
    }

    fn finish(&self) -> Result<Option<(u64, u64)>, Failure> {
        let writer = lock(&self.writer).take();
        let Some(writer) = writer.filter(|_| self.process.is_this()) else { return Ok(None) };
        self.sink.set(None);
        let written = writer.join().map_err(|_| failed("internal error of the writer"))?;
        written.map(Some).map_err(|e| failed(&e.to_string()))
    }
}

impl Drop for ChainRecording {
    fn drop(&mut self) {
        // An error is ignored, because no caller can receive it here.
        let _ = self.finish();
    }
}

fn failed(why: &str) -> Failure {
    Failure::fault("recording", format!("the recording failed: {why}"), "check if the disk is full")
}

fn write(mut recorder: Recorder, taken: &Receiver<Taken>) -> Written {
    let mut flushed = Instant::now();
    loop {
        match taken.recv_timeout(FLUSH) {
            Ok(Taken(now_us, time_ns, frame)) => recorder.take(now_us, time_ns, &frame)?,
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            Err(mpsc::RecvTimeoutError::Disconnected) => break,
        }
        if flushed.elapsed() >= FLUSH {
            flushed = Instant::now();
            recorder.flush()?;
        }
    }
    let counts = (recorder.frames(), recorder.left_out());
    recorder.finish()?;
    Ok(counts)
}

#[pymethods]
impl ChainRecording {
    /// Ends the recording. Returns the numbers of written and omitted frames; None if the recording has already ended.
    fn end(&self, py: Python<'_>) -> Result<Option<(u64, u64)>, Failure> {
        py.detach(|| self.finish())
    }
}
