//! Format FZI-CAN 1.2 of a recording: `sec.usec id dlc b0 … b7`. The id of the frame is decimal. Each line always contains eight data
//! bytes, in hexadecimal.

use super::{Record, RecordProblem, RecordedFrame, RecordingError, lines::Lines, seconds};
use std::io::{BufRead, Write};

/// First line of an FZI-CAN stream.
pub const FZI_HEADER: &str = "# FZI-CAN Stream version 1.2";

/// Interface name of all records in this format. The name is fixed, because the format has no interface names.
const CHANNEL: &str = "can0";

/// Reads the records of an FZI-CAN stream one by one.
pub struct FziReader<R> {
    lines: Lines<R>,
}

impl<R: BufRead> FziReader<R> {
    /// Creates a reader and checks the first line of the stream.
    pub fn new(input: R) -> Result<Self, RecordingError> {
        let mut lines = Lines::new(input);
        let first = lines.line()?.unwrap_or_default();
        if first != FZI_HEADER {
            return Err(RecordingError::FziHeader { first });
        }
        Ok(Self { lines })
    }
}

impl<R: BufRead> Iterator for FziReader<R> {
    type Item = Result<Record, RecordingError>;

    /// Returns the next record of the stream. The sequence of records ends after the first error.
    fn next(&mut self) -> Option<Self::Item> {
        self.lines.record(record, |_| ())
    }
}

fn record(line: &str) -> Result<Record, RecordProblem> {
    let columns: Vec<&str> = line.split_whitespace().collect();
    let [time, id, dlc, bytes @ ..] = columns.as_slice() else { return Err(RecordProblem::FziColumns) };
    if bytes.len() != 8 {
        return Err(RecordProblem::FziColumns);
    }
    let time_ns = seconds(time).ok_or(RecordProblem::Time)?;
    let id = id.parse::<u16>().ok().filter(|id| *id <= 0x7FF).ok_or(RecordProblem::Id)?;
    let length = dlc.parse::<usize>().ok().filter(|n| *n <= 8).ok_or(RecordProblem::Length)?;
    let mut data = Vec::with_capacity(8);
    for byte in bytes {
        if byte.len() > 2 || byte.starts_with('+') {
            return Err(RecordProblem::Data);
        }
        data.push(u8::from_str_radix(byte, 16).map_err(|_| RecordProblem::Data)?);
    }
    data.truncate(length);
    let frame = RecordedFrame::classic(id, &data);
    Ok(Record { time_ns, channel: CHANNEL.into(), direction: None, frame })
}

/// Writes records to an FZI-CAN stream.
pub struct FziWriter<W> {
    out: W,
}

impl<W: Write> FziWriter<W> {
    /// Creates a writer and writes the first line of the stream.
    pub fn new(mut out: W) -> Result<Self, RecordingError> {
        writeln!(out, "{FZI_HEADER}")?;
        Ok(Self { out })
    }

    /// Adds a line with a frame to the stream. The format can represent only classic data frames with 11-bit identifiers.
    pub fn write(&mut self, record: &Record) -> Result<(), RecordingError> {
        let Some((id, data)) = record.frame.as_classic() else {
            return Err(RecordingError::NotRepresentable { frame: record.frame.to_string() });
        };
        let us = record.time_ns / 1000;
        write!(self.out, "{}.{:06} {id} {}", us / 1_000_000, us % 1_000_000, data.len())?;
        for i in 0..8 {
            write!(self.out, " {:02X}", data.get(i).unwrap_or(&0))?;
        }
        writeln!(self.out)?;
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
