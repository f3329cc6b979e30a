//! Recordings of a run: written as MCAP or CSV by the ending of the file name, and read back for reports.
//!
//! An MCAP file holds `sensor_msgs/msg/JointState` on `/joint_states` (measured) and `/joint_commands` (commanded), so that
//! Foxglove, PlotJuggler and Rerun plot it at once, the torque split on `/jtc/control` and states on `/jtc/state`. A CSV file
//! has one row a sample and a header that names the units; lines that begin with `#` at its end hold how a run ended that was not
//! finished.
//!
//! A file that breaks off (a program that was killed, a full disk) is read as far as it is whole, and [`Recording::cut`] gives what
//! is missing.

mod cdr;
mod csv;
mod error;
mod info;
mod live;
mod mcap;
mod schema;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

pub use error::RecordingError;
pub use info::{Ending, JointInfo, RecordingInfo};
pub use live::{FLUSH, LiveRecorder, SampleSink};

use crate::sample::Sample;

/// File formats of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Chunked, lz4-compressed MCAP with ROS 2 schemas.
    Mcap,
    /// Comma-separated values with a header line.
    Csv,
}

impl Format {
    /// By the ending of the file name: `.mcap` or `.csv`.
    ///
    /// # Errors
    ///
    /// Another ending.
    pub fn of(path: &Path) -> Result<Self, RecordingError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("mcap") => Ok(Format::Mcap),
            Some("csv") => Ok(Format::Csv),
            _ => Err(RecordingError::UnknownFormat { path: path.to_owned() }),
        }
    }
}

enum Writer {
    Mcap(Box<mcap::McapWriter<BufWriter<File>>>),
    Csv(csv::CsvWriter<BufWriter<File>>),
}

/// Writes samples into a file as they come.
pub struct Recorder {
    writer: Writer,
    path: PathBuf,
    samples: u64,
}

impl Recorder {
    /// Makes (or replaces) the file; its ending chooses the format.
    ///
    /// # Errors
    ///
    /// Another ending, or a file that cannot be made.
    pub fn create(path: &Path, info: &RecordingInfo) -> Result<Self, RecordingError> {
        Format::of(path)?;
        Self::on(File::create(path).map_err(|e| RecordingError::io(path, e))?, path, info)
    }

    /// Writes into a file that is open already; the ending of `path` chooses the format.
    ///
    /// # Errors
    ///
    /// Another ending, or a file that cannot be written.
    pub fn on(file: File, path: &Path, info: &RecordingInfo) -> Result<Self, RecordingError> {
        let format = Format::of(path)?;
        let file = BufWriter::with_capacity(1 << 16, file);
        let writer = match format {
            Format::Mcap => mcap::McapWriter::new(file, info).map(|w| Writer::Mcap(Box::new(w))),
            Format::Csv => csv::CsvWriter::new(file, info.ending.clone()).map(Writer::Csv),
        };
        Ok(Self { writer: writer.map_err(|e| e.at(path))?, path: path.to_owned(), samples: 0 })
    }

    /// Appends one sample.
    ///
    /// # Errors
    ///
    /// The file cannot be written, on a full disk for example.
    pub fn write(&mut self, sample: &Sample) -> Result<(), RecordingError> {
        let done = match &mut self.writer {
            Writer::Mcap(w) => w.write(sample),
            Writer::Csv(w) => w.write(sample),
        };
        self.samples += 1;
        done.map_err(|e| e.at(&self.path))
    }

    /// Samples written so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    fn finish_with(mut self, samples: &[Sample]) -> Result<u64, RecordingError> {
        samples.iter().try_for_each(|sample| self.write(sample))?;
        self.finish()
    }

    /// Hands all samples so far to the operating system: they are in the file whatever becomes of this program.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        let done = match &mut self.writer {
            Writer::Mcap(w) => w.flush(),
            Writer::Csv(w) => w.flush(),
        };
        done.map_err(|e| e.at(&self.path))
    }

    /// Completes the file as [`Self::finish`], with how the run ended, which nobody knew when it was begun.
    pub fn finish_as(mut self, ending: &Ending) -> Result<u64, RecordingError> {
        let done = match &mut self.writer {
            Writer::Mcap(w) => w.end(ending),
            Writer::Csv(w) => {
                w.end(ending);
                Ok(())
            }
        };
        done.map_err(|e| e.at(&self.path))?;
        self.finish()
    }

    /// Completes the file (index and summary of an MCAP file) and returns how many samples it holds.
    ///
    /// # Errors
    ///
    /// The file cannot be written, on a full disk for example.
    pub fn finish(self) -> Result<u64, RecordingError> {
        let done = match self.writer {
            Writer::Mcap(w) => w.finish(),
            Writer::Csv(w) => w.finish(),
        };
        done.map(|()| self.samples).map_err(|e| e.at(&self.path))
    }
}

/// Writes a whole recording at once.
///
/// # Errors
///
/// Another ending, or a file that cannot be made or written.
pub fn write_all(path: &Path, info: &RecordingInfo, samples: &[Sample]) -> Result<u64, RecordingError> {
    Recorder::create(path, info)?.finish_with(samples)
}

/// Writes a whole recording at once into a file that is open already; the ending of `path` chooses the format.
///
/// # Errors
///
/// Another ending, or a file that cannot be written.
pub fn write_into(
    file: File,
    path: &Path,
    info: &RecordingInfo,
    samples: &[Sample],
) -> Result<u64, RecordingError> {
    Recorder::on(file, path, info)?.finish_with(samples)
}

/// A recording that was read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Arm, limits and origin; none for a CSV file, which does not carry them.
    pub info: Option<RecordingInfo>,
    /// How the run ended.
    pub ending: Ending,
    /// Oldest first.
    pub samples: Vec<Sample>,
    /// What is missing of a file that breaks off, in words; none where it was completed.
    pub cut: Option<String>,
}

impl Recording {
    /// Reads a file that [`Recorder`] wrote.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or is no recording of ours.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let format = Format::of(path)?;
        let bytes = std::fs::read(path).map_err(|e| RecordingError::io(path, e))?;
        if bytes.is_empty() {
            return Err(RecordingError::Empty { path: path.to_owned() });
        }
        match format {
            Format::Mcap => mcap::read(&bytes),
            Format::Csv => csv::read(&bytes),
        }
        .map_err(|e| e.at(path))
    }

    /// The samples of a file, and where it is not whole why.
    fn new(info: Option<RecordingInfo>, ending: Ending, samples: Vec<Sample>, why: Option<String>) -> Self {
        let cut = why.map(|why| {
            let upto = samples.last().map_or("it holds no sample".to_owned(), |last| {
                format!("{} samples up to {:.3} s are whole", samples.len(), last.time_s)
            });
            format!("{why}; {upto}")
        });
        Self { info, ending, samples, cut }
    }
}
