//! Format of `candump -L` of can-utils: `(sec.frac) interface ID#DATA`, optionally followed by `R` or `T`.

use super::{Direction, FrameKind, Record, RecordProblem, RecordedFrame, RecordingError};
use super::{hex_bytes, lines::Lines, seconds};
use std::io::{BufRead, Write};

/// Beginning of a comment line that carries one line of the profile.
const PROFILE: &str = "# profile: ";

/// Reads the records of a candump file one by one.
pub struct CandumpReader<R> {
    lines: Lines<R>,
    profile: Option<String>,
}

impl<R: BufRead> CandumpReader<R> {
    /// Creates a reader at the start of the candump file.
    pub fn new(input: R) -> Self {
        Self { lines: Lines::new(input), profile: None }
    }

    /// Returns the profile in the comment lines that were read so far.
    pub fn into_profile(self) -> Option<String> {
        self.profile
    }
}

impl<R: BufRead> Iterator for CandumpReader<R> {
    type Item = Result<Record, RecordingError>;

    /// Returns the next record of the file. The sequence of records ends after the first error.
    fn next(&mut self) -> Option<Self::Item> {
        self.lines.record(record, |comment| {
            if let Some(text) = comment.strip_prefix(PROFILE.trim_end()) {
                let profile = self.profile.get_or_insert_default();
                profile.push_str(text.trim());
                profile.push('\n');
            }
        })
    }
}

/// Returns `true` for a line of candump without the option `-L`, for example `can0  240   [2]  11 22`.
fn is_view(line: &str) -> bool {
    let is_length = |column: &str| {
        let digits = column.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
        digits.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
    };
    !line.contains('#') && line.split_whitespace().any(is_length)
}

fn record(line: &str) -> Result<Record, RecordProblem> {
    if is_view(line) {
        return Err(RecordProblem::View);
    }
    let mut columns = line.split_whitespace();
    let (Some(time), Some(channel), Some(frame)) = (columns.next(), columns.next(), columns.next()) else {
        return Err(RecordProblem::Columns);
    };
    let direction = match columns.next() {
        None => None,
        Some("R" | "r") => Some(Direction::Received),
        Some("T" | "t") => Some(Direction::Sent),
        Some(_) => return Err(RecordProblem::Columns),
    };
    if columns.next().is_some() {
        return Err(RecordProblem::Columns);
    }
    let time = time.strip_prefix('(').and_then(|t| t.strip_suffix(')')).ok_or(RecordProblem::Time)?;
    let time_ns = seconds(time).ok_or(RecordProblem::Time)?;
    Ok(Record { time_ns, channel: channel.into(), direction, frame: frame_of(frame)? })
}

fn frame_of(text: &str) -> Result<RecordedFrame, RecordProblem> {
    let (id_text, body) = text.split_once('#').ok_or(RecordProblem::Columns)?;
    let extended = match id_text.len() {
        3 => false,
        8 => true,
        _ => return Err(RecordProblem::Id),
    };
    if !id_text.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(RecordProblem::Id);
    }
    let number = u32::from_str_radix(id_text, 16).map_err(|_| RecordProblem::Id)?;
    let error = extended && number & 0x2000_0000 != 0;
    let id = number & 0x1FFF_FFFF;
    let valid = if error { number & 0xC000_0000 == 0 } else { number == id && (extended || id <= 0x7FF) };
    if !valid {
        return Err(RecordProblem::Id);
    }
    let made = |kind, data, dlc| RecordedFrame { id, extended: extended && !error, kind, data, dlc };
    // The kernel reports errors as classic data frames, so a line with the error flag cannot be a CAN FD frame or a
    // remote frame.
    if error && body.starts_with(['#', 'R', 'r']) {
        return Err(RecordProblem::Data);
    }
    if let Some(fd) = body.strip_prefix('#') {
        let (flags, data) = fd.split_at_checked(1).ok_or(RecordProblem::Data)?;
        let flags = u8::from_str_radix(flags, 16).map_err(|_| RecordProblem::Data)?;
        let data = hex_bytes(data, 64).ok_or(RecordProblem::Data)?;
        return Ok(made(FrameKind::Fd { flags }, data, None));
    }
    let (body, dlc) = match body.split_once('_') {
        None => (body, None),
        Some((body, dlc)) => {
            let dlc = u8::from_str_radix(dlc, 16).map_err(|_| RecordProblem::Length)?;
            if !(9..=15).contains(&dlc) {
                return Err(RecordProblem::Length);
            }
            (body, Some(dlc))
        }
    };
    if let Some(length) = body.strip_prefix(['R', 'r']) {
        let length = match length {
            "" => 0,
            digit => digit.parse::<u8>().ok().filter(|n| *n <= 8).ok_or(RecordProblem::Length)?,
        };
        return Ok(made(FrameKind::Remote { length }, Vec::new(), dlc));
    }
    // Dots may separate the data bytes.
    let data = hex_bytes(&body.replace('.', ""), 8).ok_or(RecordProblem::Data)?;
    Ok(made(if error { FrameKind::Error } else { FrameKind::Data }, data, dlc))
}

/// Writes records as `candump -L` does.
pub struct CandumpWriter<W> {
    out: W,
}

impl<W: Write> CandumpWriter<W> {
    /// Creates a writer for a candump file. Like the output of candump, the file has no header.
    pub fn new(out: W) -> Self {
        Self { out }
    }

    /// Writes the profile as comment lines. can-utils skips comment lines; python-can's reader does not accept them.
    pub fn comment_profile(&mut self, profile: &str) -> Result<(), RecordingError> {
        for line in profile.lines() {
            writeln!(self.out, "{PROFILE}{line}")?;
        }
        Ok(())
    }

    /// Adds a line with a frame to the file. Times have six decimals, because can-utils refuses any other number of decimals.
    pub fn write(&mut self, record: &Record) -> Result<(), RecordingError> {
        let (seconds, ns) = (record.time_ns / 1_000_000_000, record.time_ns % 1_000_000_000);
        write!(self.out, "({seconds:010}.{:06})", ns / 1000)?;
        write!(self.out, " {} {}", record.channel, record.frame)?;
        match record.direction {
            None => writeln!(self.out)?,
            Some(Direction::Received) => writeln!(self.out, " R")?,
            Some(Direction::Sent) => writeln!(self.out, " T")?,
        }
        Ok(())
    }

    /// Writes the buffered data to the output.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        Ok(self.out.flush()?)
    }

    /// Returns the output of the writer.
    pub fn into_inner(self) -> W {
        self.out
    }
}
