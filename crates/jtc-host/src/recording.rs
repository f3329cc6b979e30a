//! Recordings of the execution of a motion. Recordings are written as MCAP or CSV, depending on the extension of the file name, and are
//! read again for reports.
//!
//! An MCAP file contains `sensor_msgs/msg/JointState` on `/joint_states` (measured) and `/joint_commands` (commanded), which Foxglove,
//! PlotJuggler and Rerun can plot directly. The topic `/jtc/control` contains the parts of the torque, and `/jtc/state` contains the
//! states. If the arm is known, the topic `/robot_description` contains its robot description (URDF), and `/tf` contains the pose of each
//! link. The metadata contain the limits, gains and hash of the arm, and the identity of the controller's firmware. A CSV file has one row
//! per sample, and a header with the units. If a run did not finish, lines that begin with `#` at the end of the file report how the run
//! ended.
//!
//! A truncated file (after the program was killed, or if the disk was full) is read up to the damage. For a truncated file,
//! [`Recording::cut`] describes the missing part.

#[cfg(feature = "mcap")]
mod cdr;
#[cfg(all(test, feature = "mcap"))]
mod channel_tests;
mod csv;
mod error;
#[cfg(feature = "mcap")]
mod frames;
mod info;
mod live;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod messages;
#[cfg(feature = "mcap")]
mod metadata;
#[cfg(feature = "mcap")]
mod reassemble;
mod resume_point;
#[cfg(feature = "mcap")]
mod schema;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

pub use error::RecordingError;
pub use info::{DeviceIdentity, Ending, JointInfo, RecordingInfo};
pub use live::{FLUSH, LiveRecorder, SampleSink};
#[cfg(feature = "mcap")]
pub use messages::{MessageWriter, Topic};
pub use resume_point::{NothingLeft, ResumePoint, Resumption};

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
    /// Returns the format for the extension of the file name: `.mcap` or `.csv`.
    ///
    /// # Errors
    ///
    /// Returns an error for another extension, or if this program was built without support for the format.
    pub fn of(path: &Path) -> Result<Self, RecordingError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("mcap") if cfg!(feature = "mcap") => Ok(Format::Mcap),
            Some("mcap") => Err(RecordingError::BuiltWithout { path: path.to_owned() }),
            Some("csv") => Ok(Format::Csv),
            _ => Err(RecordingError::UnknownFormat { path: path.to_owned() }),
        }
    }
}

/// Writer of samples in one format.
trait Writer: Send {
    fn write(&mut self, sample: &Sample) -> Result<(), RecordingError>;
    fn flush(&mut self) -> Result<(), RecordingError>;
    /// Writes the reason for the end of the run.
    fn end(&mut self, ending: &Ending) -> Result<(), RecordingError>;
    fn finish(self: Box<Self>) -> Result<(), RecordingError>;
}

/// Writer of samples to a file during the run.
pub struct Recorder {
    writer: Box<dyn Writer>,
    path: PathBuf,
    samples: u64,
}

impl Recorder {
    /// Creates or replaces the file. The extension of the file name selects the format.
    ///
    /// # Errors
    ///
    /// Returns an error for another extension or if the file cannot be created.
    pub fn create(path: &Path, info: &RecordingInfo) -> Result<Self, RecordingError> {
        Format::of(path)?;
        Self::on(File::create(path).map_err(|e| RecordingError::io(path, e))?, path, info)
    }

    /// Creates a recorder that writes to an open file. The extension of `path` selects the format.
    ///
    /// # Errors
    ///
    /// Returns an error for another extension or if the file cannot be written.
    pub fn on(file: File, path: &Path, info: &RecordingInfo) -> Result<Self, RecordingError> {
        let format = Format::of(path)?;
        let file = BufWriter::with_capacity(1 << 16, file);
        let writer: Result<Box<dyn Writer>, _> = match format {
            #[cfg(feature = "mcap")]
            Format::Mcap => mcap::McapWriter::new(file, info).map(|w| Box::new(w) as _),
            #[cfg(not(feature = "mcap"))]
            Format::Mcap => Err(RecordingError::BuiltWithout { path: path.to_owned() }),
            Format::Csv => csv::CsvWriter::new(file, info.ending.clone()).map(|w| Box::new(w) as _),
        };
        Ok(Self { writer: writer.map_err(|e| e.at(path))?, path: path.to_owned(), samples: 0 })
    }

    /// Appends one sample.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be written, for example on a full disk.
    pub fn write(&mut self, sample: &Sample) -> Result<(), RecordingError> {
        self.samples += 1;
        self.writer.write(sample).map_err(|e| e.at(&self.path))
    }

    /// Returns the number of samples written so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    fn finish_with(mut self, samples: &[Sample]) -> Result<u64, RecordingError> {
        samples.iter().try_for_each(|sample| self.write(sample))?;
        self.finish()
    }

    /// Passes all samples written so far to the operating system. These samples are not lost if this program ends.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.writer.flush().map_err(|e| e.at(&self.path))
    }

    /// Completes the file like [`Self::finish`], and also writes the reason for the end of the run.
    pub fn finish_as(mut self, ending: &Ending) -> Result<u64, RecordingError> {
        self.writer.end(ending).map_err(|e| e.at(&self.path))?;
        self.finish()
    }

    /// Completes the file and returns the number of samples. For MCAP, the function also writes the index and the summary.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be written, for example on a full disk.
    pub fn finish(self) -> Result<u64, RecordingError> {
        self.writer.finish().map(|()| self.samples).map_err(|e| e.at(&self.path))
    }
}

/// Writes a complete recording in one call.
///
/// # Errors
///
/// Returns an error for another extension or if the file cannot be created or written.
pub fn write_all(path: &Path, info: &RecordingInfo, samples: &[Sample]) -> Result<u64, RecordingError> {
    Recorder::create(path, info)?.finish_with(samples)
}

/// Writes a complete recording to an open file in one call. The extension of `path` selects the format.
///
/// # Errors
///
/// Returns an error for another extension or if the file cannot be written.
pub fn write_into(
    file: File,
    path: &Path,
    info: &RecordingInfo,
    samples: &[Sample],
) -> Result<u64, RecordingError> {
    Recorder::on(file, path, info)?.finish_with(samples)
}

/// Writes a complete recording as MCAP to an open file, together with the flight recorder log from which the recording was made. Error
/// messages use `path` as the name of the file.
///
/// # Errors
///
/// Returns an error if the file cannot be written, or if this program was built without MCAP.
pub fn write_with_log(
    file: impl Write + Seek + Send,
    path: &Path,
    info: &RecordingInfo,
    samples: &[Sample],
    log: &[u8],
) -> Result<(), RecordingError> {
    #[cfg(feature = "mcap")]
    {
        let write = || {
            let mut writer = Box::new(mcap::McapWriter::new(BufWriter::new(file), info)?);
            samples.iter().try_for_each(|sample| writer.write(sample))?;
            writer.write_log(log)?;
            writer.finish()
        };
        write().map_err(|e| e.at(path))
    }
    #[cfg(not(feature = "mcap"))]
    {
        let _ = (file, info, samples, log);
        Err(RecordingError::BuiltWithout { path: path.to_owned() })
    }
}

/// Returns the flight recorder log in an MCAP file. Returns `None` if the recording does not contain a log.
///
/// # Errors
///
/// Returns an error if the file cannot be read.
pub fn read_log(path: &Path) -> Result<Option<Vec<u8>>, RecordingError> {
    if Format::of(path)? != Format::Mcap {
        return Ok(None);
    }
    let file = open(path)?;
    #[cfg(feature = "mcap")]
    {
        mcap::read_log(file).map_err(|e| e.at(path))
    }
    #[cfg(not(feature = "mcap"))]
    {
        drop(file);
        Ok(None)
    }
}

/// A recording that was read from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Arm, limits and source of the samples; `None` for a CSV file, which does not contain these data.
    pub info: Option<RecordingInfo>,
    /// Reason for the end of the run.
    pub ending: Ending,
    /// Samples, oldest first.
    pub samples: Vec<Sample>,
    /// Description of the missing part of a truncated file. `None` for a complete file.
    pub cut: Option<String>,
}

impl Recording {
    /// Reads a file that [`Recorder`] wrote, with all samples.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read or is not a recording of this project.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut samples = Vec::new();
        let Scanned { info, ending, cut, .. } = scan_with(path, usize::MAX, |sample| samples.push(*sample))?;
        Ok(Self { info, ending, samples, cut })
    }
}

/// Content of a recording without the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Scanned {
    /// Arm, limits and source of the samples; `None` for a CSV file, which does not contain these data.
    pub info: Option<RecordingInfo>,
    /// Reason for the end of the run.
    pub ending: Ending,
    /// Number of samples.
    pub samples: u64,
    /// Description of the missing part of a truncated file. `None` for a complete file.
    pub cut: Option<String>,
}

/// Maximum number of incomplete samples in memory, whose missing messages may follow later in the file. 4096 samples
/// fill several chunks of an MCAP file.
const ROOM: usize = 4096;

/// Calls `see` with each sample of a file that [`Recorder`] wrote, oldest first. The function keeps only a part of the file in memory, also
/// for large files.
///
/// # Errors
///
/// Returns an error if the file cannot be read, is not a recording of this project, or contains messages that are far out of time order.
/// The function has already passed the samples before the error to `see`.
pub fn scan(path: &Path, see: impl FnMut(&Sample)) -> Result<Scanned, RecordingError> {
    scan_with(path, ROOM, see)
}

/// Content of a file without the samples. For an incomplete file, `cut` describes the missing part.
struct Found {
    info: Option<RecordingInfo>,
    ending: Ending,
    cut: Option<String>,
}

fn open(path: &Path) -> Result<BufReader<File>, RecordingError> {
    let file = File::open(path).map_err(|e| RecordingError::io(path, e))?;
    Ok(BufReader::with_capacity(1 << 18, file))
}

fn scan_with(path: &Path, room: usize, mut see: impl FnMut(&Sample)) -> Result<Scanned, RecordingError> {
    let format = Format::of(path)?;
    let mut file = open(path)?;
    if file.fill_buf().map_err(|e| RecordingError::io(path, e))?.is_empty() {
        return Err(RecordingError::Empty { path: path.to_owned() });
    }
    let (mut samples, mut last_s) = (0_u64, 0.0);
    let mut count = |sample: &Sample| {
        (samples, last_s) = (samples + 1, sample.time_s);
        see(sample);
    };
    let found = match format {
        #[cfg(feature = "mcap")]
        Format::Mcap => mcap::scan(file, mcap::read_info(open(path)?), room, &mut count),
        #[cfg(not(feature = "mcap"))]
        Format::Mcap => Err(RecordingError::BuiltWithout { path: path.to_owned() }),
        Format::Csv => csv::scan(file, &mut count),
    };
    #[cfg(not(feature = "mcap"))]
    let _ = room;
    let Found { info, ending, cut } = found.map_err(|e| e.at(path))?;
    let cut = cut.map(|why| match samples {
        0 => format!("{why}; the file contains no sample"),
        n => format!("{why}; {n} samples up to {last_s:.3} s are complete"),
    });
    Ok(Scanned { info, ending, samples, cut })
}
