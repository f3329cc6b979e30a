//! Recordings of a run: written as MCAP or CSV by the ending of the file name, and read back for reports.
//!
//! An MCAP file holds `sensor_msgs/msg/JointState` on `/joint_states` (measured) and `/joint_commands` (commanded), so that
//! Foxglove, PlotJuggler and Rerun plot it at once, the torque split on `/jtc/control` and states on `/jtc/state`. Where the arm is known,
//! the file stands alone: its description (URDF) is on `/robot_description`, where each link is on `/tf`, and its limits, its gains, its hash and
//! the controller's firmware are in the metadata. A CSV file
//! has one row a sample and a header that names the units; lines that begin with `#` at its end hold how a run ended that was not
//! finished.
//!
//! A file that breaks off (a program that was killed, a full disk) is read as far as it is whole, and [`Recording::cut`] gives what
//! is missing.

mod broken_off;
#[cfg(feature = "mcap")]
mod cdr;
mod csv;
mod error;
#[cfg(feature = "mcap")]
mod frames;
#[cfg(feature = "mcap")]
mod gather;
mod info;
mod live;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod messages;
#[cfg(feature = "mcap")]
mod metadata;
#[cfg(feature = "mcap")]
mod schema;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

pub use broken_off::{BrokenOff, NothingLeft, Resumption};
pub use error::RecordingError;
pub use info::{DeviceIdentity, Ending, JointInfo, RecordingInfo};
pub use live::{FLUSH, LiveRecorder, SampleSink};
#[cfg(feature = "mcap")]
pub use messages::{MessageWriter, Topic};

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
    /// Another ending, or one whose format this program was built without.
    pub fn of(path: &Path) -> Result<Self, RecordingError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("mcap") if cfg!(feature = "mcap") => Ok(Format::Mcap),
            Some("mcap") => Err(RecordingError::BuiltWithout { path: path.to_owned() }),
            Some("csv") => Ok(Format::Csv),
            _ => Err(RecordingError::UnknownFormat { path: path.to_owned() }),
        }
    }
}

/// Writes samples in one format.
trait Writer: Send {
    fn write(&mut self, sample: &Sample) -> Result<(), RecordingError>;
    fn flush(&mut self) -> Result<(), RecordingError>;
    /// How the run ended, known at its end only.
    fn end(&mut self, ending: &Ending) -> Result<(), RecordingError>;
    fn finish(self: Box<Self>) -> Result<(), RecordingError>;
}

/// Writes samples into a file as they come.
pub struct Recorder {
    writer: Box<dyn Writer>,
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
    /// The file cannot be written, on a full disk for example.
    pub fn write(&mut self, sample: &Sample) -> Result<(), RecordingError> {
        self.samples += 1;
        self.writer.write(sample).map_err(|e| e.at(&self.path))
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
        self.writer.flush().map_err(|e| e.at(&self.path))
    }

    /// Completes the file as [`Self::finish`], with how the run ended, which nobody knew when it was begun.
    pub fn finish_as(mut self, ending: &Ending) -> Result<u64, RecordingError> {
        self.writer.end(ending).map_err(|e| e.at(&self.path))?;
        self.finish()
    }

    /// Completes the file (index and summary of an MCAP file) and returns how many samples it holds.
    ///
    /// # Errors
    ///
    /// The file cannot be written, on a full disk for example.
    pub fn finish(self) -> Result<u64, RecordingError> {
        self.writer.finish().map(|()| self.samples).map_err(|e| e.at(&self.path))
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

/// Writes a whole recording and the log of a flight recorder that it was made of, as MCAP, into what is open already; `path` is what errors
/// call it.
///
/// # Errors
///
/// A file that cannot be written, or a program that was built without MCAP.
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

/// The log of a flight recorder in an MCAP file; none in a recording of something else.
///
/// # Errors
///
/// A file that cannot be read.
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
    /// Reads a file that [`Recorder`] wrote, with all of its samples.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or is no recording of ours.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut samples = Vec::new();
        let Scanned { info, ending, cut, .. } = scan_with(path, usize::MAX, |sample| samples.push(*sample))?;
        Ok(Self { info, ending, samples, cut })
    }
}

/// What a recording holds beside its samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Scanned {
    /// Arm, limits and origin; none for a CSV file, which does not carry them.
    pub info: Option<RecordingInfo>,
    /// How the run ended.
    pub ending: Ending,
    /// How many samples there were.
    pub samples: u64,
    /// What is missing of a file that breaks off, in words; none where it was completed.
    pub cut: Option<String>,
}

/// Samples that wait for messages of theirs which stand later in the file: several chunks of ours.
const ROOM: usize = 4096;

/// Shows the samples of a file that [`Recorder`] wrote, oldest first; no more of it is in memory than a piece, however long it is.
///
/// # Errors
///
/// A file that cannot be read, is no recording of ours, or whose messages are far from the order of their times. Samples before that
/// were shown.
pub fn scan(path: &Path, see: impl FnMut(&Sample)) -> Result<Scanned, RecordingError> {
    scan_with(path, ROOM, see)
}

/// What a file holds beside its samples, and why it is not whole.
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
        0 => format!("{why}; it holds no sample"),
        n => format!("{why}; {n} samples up to {last_s:.3} s are whole"),
    });
    Ok(Scanned { info, ending, samples, cut })
}
