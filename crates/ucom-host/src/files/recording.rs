//! Recordings of the frames on a bus in the formats `candump -L`, FZI-CAN 1.2 and MCAP.
//!
//! A recording can be interpreted only with the profile that was used during the recording. An MCAP file stores the profile as metadata.
//! The two text formats cannot store the profile in a form that every reader accepts. For example, python-can's candump reader reads each
//! line as a frame. Therefore, the profile of a text recording is stored in a separate file next to the recording, see [`profile_path`].
//! The reader of text recordings also accepts comment lines `# …` with a profile.
mod candump;
mod error;
mod frame;
mod fzi;
mod lines;
mod mcap;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

pub use candump::{CandumpReader, CandumpWriter};
pub use error::{RecordProblem, RecordingError};
pub use frame::{Direction, FrameKind, Record, RecordedFrame};
pub use fzi::{FZI_HEADER, FziReader, FziWriter};
pub use mcap::{McapWriter, read_mcap};

/// Longest line of a text recording in bytes. A file with a longer line is not a recording.
pub const MAX_LINE: usize = 4096;

/// Format of a recording file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RecordingFormat {
    /// Text lines `(sec.frac) interface ID#DATA` of can-utils.
    Candump,
    /// FZI-CAN stream 1.2.
    FziCan,
    /// MCAP with one channel of JSON messages.
    Mcap,
}

impl RecordingFormat {
    /// Returns the format of a recording according to the first bytes of the file.
    pub fn detect(start: &[u8]) -> Self {
        if start.starts_with(b"\x89MCAP0\r\n") {
            Self::Mcap
        } else if start.trim_ascii_start().starts_with(b"# FZI-CAN") {
            Self::FziCan
        } else {
            Self::Candump
        }
    }

    /// Returns the format of a recording according to the file extension: `.mcap`, `.fzi`, or candump for all others.
    pub fn of_path(path: &Path) -> Self {
        match path.extension().and_then(|e| e.to_str()) {
            Some("mcap") => Self::Mcap,
            Some("fzi" | "fzican") => Self::FziCan,
            _ => Self::Candump,
        }
    }
}

/// Returns the path of the profile for a text recording, which is `NAME.profile.toml` in the same directory.
pub fn profile_path(recording: &Path) -> PathBuf {
    let mut name = recording.as_os_str().to_owned();
    name.push(".profile.toml");
    name.into()
}

/// Contents of a recording file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Profile that was used during the recording, as TOML; `None` if the profile is not known.
    pub profile: Option<String>,
    /// Frames in the order of the file.
    pub records: Vec<Record>,
    /// Position and kind of the damage if the file ends in the middle of a record because its writer was killed; `None` if the file is
    /// complete.
    pub broken_off: Option<String>,
}

impl Recording {
    /// Reads a recording file of any format, and the profile file next to it.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let io = |source| RecordingError::Io { path: path.into(), source };
        let mut file = BufReader::new(File::open(path).map_err(io)?);
        let format = RecordingFormat::detect(file.fill_buf().map_err(io)?);
        let mut recording = match format {
            RecordingFormat::Mcap => read_mcap(&std::fs::read(path).map_err(io)?),
            RecordingFormat::FziCan => Self::read_fzi(file),
            RecordingFormat::Candump => Self::read_candump(file),
        }
        .map_err(|e| e.with_path(path))?;
        if recording.profile.is_none()
            && let Ok(text) = std::fs::read_to_string(profile_path(path))
        {
            recording.profile = Some(text);
        }
        Ok(recording)
    }

    /// Returns the CAN interfaces in the recording, each with its number of frames.
    pub fn interfaces(&self) -> BTreeMap<&str, usize> {
        let mut all = BTreeMap::new();
        for record in &self.records {
            *all.entry(record.channel.as_str()).or_default() += 1;
        }
        all
    }

    /// Returns the number of the first frame, from 1, whose time is more than one second before the time of the frame before it, and the
    /// difference. A file with such a frame contains more than one recording. `None` if there is no such frame.
    pub fn second_start(&self) -> Option<(usize, Duration)> {
        let back = |(i, pair): (usize, &[Record])| {
            let [before, next] = pair else { return None };
            let back = Duration::from_nanos(before.time_ns.saturating_sub(next.time_ns));
            (back > Duration::from_secs(1)).then_some((i + 2, back))
        };
        self.records.windows(2).enumerate().find_map(back)
    }

    /// Reads a recording from candump lines.
    pub fn read_candump(input: impl BufRead) -> Result<Self, RecordingError> {
        let mut reader = CandumpReader::new(input);
        let (records, broken_off) = whole(&mut reader)?;
        Ok(Self { profile: reader.into_profile(), records, broken_off })
    }

    /// Reads a recording from an FZI-CAN stream.
    pub fn read_fzi(input: impl BufRead) -> Result<Self, RecordingError> {
        let (records, broken_off) = whole(&mut FziReader::new(input)?)?;
        Ok(Self { profile: None, records, broken_off })
    }
}

/// Returns the records of a text recording. If the last line is cut off, the function also returns the error of this line.
fn whole(
    lines: &mut dyn Iterator<Item = Result<Record, RecordingError>>,
) -> Result<(Vec<Record>, Option<String>), RecordingError> {
    let mut records = Vec::new();
    for record in lines {
        match record {
            Ok(record) => records.push(record),
            Err(e @ RecordingError::Line { problem: RecordProblem::Truncated, .. }) => {
                return Ok((records, Some(e.to_string())));
            }
            Err(e) => return Err(e),
        }
    }
    Ok((records, None))
}

/// Writer for a recording of any format.
pub enum RecordingWriter {
    /// Writer for the format of candump.
    Candump(CandumpWriter<BufWriter<File>>),
    /// Writer for the format FZI-CAN.
    FziCan(FziWriter<BufWriter<File>>),
    /// Writer for the format MCAP.
    Mcap(Box<McapWriter<BufWriter<File>>>),
}

impl RecordingWriter {
    /// Creates the recording file. For text formats, the function also creates the profile file next to the recording.
    pub fn create(path: &Path, format: RecordingFormat, profile: &str) -> Result<Self, RecordingError> {
        let io = |source| RecordingError::Io { path: path.into(), source };
        let out = BufWriter::new(File::create(path).map_err(io)?);
        if format != RecordingFormat::Mcap {
            let beside = profile_path(path);
            std::fs::write(&beside, profile).map_err(|source| RecordingError::Io { path: beside, source })?;
        }
        match format {
            RecordingFormat::Candump => Ok(Self::Candump(CandumpWriter::new(out))),
            RecordingFormat::FziCan => FziWriter::new(out).map(Self::FziCan),
            RecordingFormat::Mcap => McapWriter::new(out, profile).map(|w| Self::Mcap(Box::new(w))),
        }
        .map_err(|e| e.with_path(path))
    }

    /// Adds a frame to the recording. FZI-CAN can represent only classic data frames with 11-bit identifiers. For other frames, the
    /// function returns an error and does not write the frame.
    pub fn write(&mut self, record: &Record, name: Option<&str>) -> Result<(), RecordingError> {
        match self {
            Self::Candump(w) => w.write(record),
            Self::FziCan(w) => w.write(record),
            Self::Mcap(w) => w.write(record, name),
        }
    }

    /// Writes all data of the recording to the file. If the writer is killed later, only records that were added after this call are lost.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        match self {
            Self::Candump(w) => w.flush(),
            Self::FziCan(w) => w.flush(),
            Self::Mcap(w) => w.flush(),
        }
    }

    /// Writes the remaining data of the recording and ends the file. Without this call, an MCAP file has no index,
    /// and a text file can lack its last lines.
    pub fn finish(self) -> Result<(), RecordingError> {
        match self {
            Self::Candump(w) => Ok(w.into_inner().flush()?),
            Self::FziCan(w) => Ok(w.into_inner().flush()?),
            Self::Mcap(w) => w.finish().and_then(|mut out| Ok(out.flush()?)),
        }
    }
}

/// Converts a time in the form `sec.fraction` to nanoseconds. Digits after the ninth decimal are discarded.
fn seconds(text: &str) -> Option<u64> {
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !digits(whole) || !digits(fraction) {
        return None;
    }
    let mut ns = 0_u64;
    for i in 0..9 {
        ns = ns * 10 + u64::from(fraction.as_bytes().get(i).map_or(0, |b| b - b'0'));
    }
    whole.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(ns)
}

/// Reads at most `most` bytes from pairs of hexadecimal digits.
fn hex_bytes(text: &str, most: usize) -> Option<Vec<u8>> {
    let digits = text.as_bytes();
    if digits.len() % 2 == 1 || digits.len() > most * 2 || !digits.iter().all(u8::is_ascii_hexdigit) {
        return None;
    }
    let value = |d: u8| (d as char).to_digit(16).unwrap_or(0) as u8;
    Some(digits.as_chunks::<2>().0.iter().map(|[high, low]| value(*high) << 4 | value(*low)).collect())
}
