//! Reads the lines of text recordings. Each record is one line; blank lines and comment lines may be between records.

use super::{MAX_LINE, Record, RecordProblem, RecordingError};
use std::io::{BufRead, Read};

/// Reads the records of a text recording line by line.
pub(super) struct Lines<R> {
    input: R,
    number: usize,
    /// `true` if the last line of the file had no line end.
    endless: bool,
    failed: bool,
}

impl<R: BufRead> Lines<R> {
    /// Creates a reader at the start of the text recording.
    pub(super) fn new(input: R) -> Self {
        Self { input, number: 0, endless: false, failed: false }
    }

    /// Returns the next line without surrounding blanks; returns `None` at the end of the file. The function limits the memory that a line
    /// uses.
    pub(super) fn line(&mut self) -> Result<Option<String>, RecordingError> {
        let mut line = Vec::new();
        self.input.by_ref().take(MAX_LINE as u64 + 1).read_until(b'\n', &mut line)?;
        if line.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        if line.len() > MAX_LINE {
            return Err(self.error(RecordProblem::TooLong));
        }
        self.endless = line.last() != Some(&b'\n');
        Ok(Some(String::from_utf8_lossy(&line).trim().to_owned()))
    }

    /// Returns the next record of the recording. `parse` creates the record from its line; `comment` receives the comment lines before the
    /// record. The sequence of records ends after the first error.
    pub(super) fn record(
        &mut self,
        parse: fn(&str) -> Result<Record, RecordProblem>,
        comment: impl FnMut(&str),
    ) -> Option<Result<Record, RecordingError>> {
        if self.failed {
            return None;
        }
        let next = self.try_record(parse, comment);
        self.failed = next.is_err();
        next.transpose()
    }

    fn try_record(
        &mut self,
        parse: fn(&str) -> Result<Record, RecordProblem>,
        mut comment: impl FnMut(&str),
    ) -> Result<Option<Record>, RecordingError> {
        while let Some(line) = self.line()? {
            if line.starts_with('#') {
                comment(&line);
            } else if self.endless && !line.is_empty() {
                return Err(self.error(RecordProblem::Truncated));
            } else if !line.is_empty() {
                return parse(&line).map(Some).map_err(|problem| self.error(problem));
            }
        }
        Ok(None)
    }

    fn error(&self, problem: RecordProblem) -> RecordingError {
        RecordingError::Line { line: self.number, problem }
    }
}
