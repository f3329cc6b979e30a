//! Collects the data of records, sorted by address.

use super::{AddressUnit, Gaps, ImageError, ImageNote, LineProblem};
use std::collections::BTreeMap;

/// Segments of bytes, sorted by byte address. If bytes are added directly after a segment, they extend this segment.
pub(super) struct Segments {
    unit: AddressUnit,
    limit: usize,
    runs: BTreeMap<u64, Vec<u8>>,
    records: usize,
}

impl Segments {
    pub(super) fn new(unit: AddressUnit, limit: usize) -> Self {
        Self { unit, limit, runs: BTreeMap::new(), records: 0 }
    }

    /// Adds the data of one record; `address` is in the unit of the file's addresses.
    pub(super) fn add(&mut self, address: u64, data: &[u8]) -> Result<(), LineProblem> {
        if data.is_empty() {
            return Ok(());
        }
        self.records += 1;
        let start = match self.unit {
            AddressUnit::Byte => address,
            AddressUnit::Word if data.len().is_multiple_of(2) => address * 2,
            AddressUnit::Word => return Err(LineProblem::HalfWord { address, bytes: data.len() }),
        };
        let end = start + data.len() as u64;
        let from = self.runs.first_key_value().map_or(start, |(a, _)| start.min(*a));
        let to = self.runs.last_key_value().map_or(end, |(a, run)| end.max(a + run.len() as u64));
        if to - from > self.limit as u64 {
            return Err(LineProblem::TooLarge { limit: self.limit, from, to });
        }
        let mut rest = data;
        let mut at = start;
        // Data that overlap earlier data must have the same values as the earlier data.
        let covering: Vec<u64> = self.covering(start, end);
        for run_start in covering {
            let Some(run) = self.runs.get(&run_start) else { continue };
            let run_end = run_start + run.len() as u64;
            if run_start > at {
                let (before, after) = rest.split_at(((run_start - at) as usize).min(rest.len()));
                self.put(at, before);
                rest = after;
                at = run_start;
            }
            let Some(run) = self.runs.get(&run_start) else { continue };
            let shared = (run_end.min(end).saturating_sub(at)) as usize;
            let (over, after) = rest.split_at(shared.min(rest.len()));
            let old = run.get((at - run_start) as usize..).unwrap_or_default();
            if let Some(i) = over.iter().zip(old).position(|(new, old)| new != old) {
                return Err(LineProblem::Overlap { address: at + i as u64 });
            }
            at += over.len() as u64;
            rest = after;
        }
        self.put(at, rest);
        Ok(())
    }

    /// Returns the number of records with data that were added so far.
    pub(super) fn records(&self) -> usize {
        self.records
    }

    /// Returns the start addresses of the segments that overlap `start..end`.
    fn covering(&self, start: u64, end: u64) -> Vec<u64> {
        let before = self.runs.range(..start).next_back();
        let before = before.filter(|(a, run)| *a + run.len() as u64 > start).map(|(a, _)| *a);
        before.into_iter().chain(self.runs.range(start..end).map(|(a, _)| *a)).collect()
    }

    /// Adds bytes at addresses that have no data yet.
    fn put(&mut self, at: u64, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        if let Some((start, run)) = self.runs.range_mut(..at).next_back()
            && start + run.len() as u64 == at
        {
            run.extend_from_slice(bytes);
            return;
        }
        self.runs.insert(at, bytes.to_vec());
    }

    /// Joins all segments to one image. The function returns the load address and the bytes of the image.
    pub(super) fn join(self, gaps: Gaps, notes: &mut Vec<ImageNote>) -> Result<(u32, Vec<u8>), ImageError> {
        let Some((&first, _)) = self.runs.first_key_value() else { return Err(ImageError::Empty) };
        let words = |byte: u64| u32::try_from(byte / 2);
        let beyond = ImageError::AddressRange { address_words: u32::MAX, words: 0 };
        let Ok(address_words) = words(first) else { return Err(beyond) };
        let mut bytes: Vec<u8> = Vec::new();
        // If the first record begins in the middle of a word, no record contains the first half of this word.
        let first = first - first % 2;
        for (start, run) in self.runs {
            let missing = (start - first) as usize - bytes.len();
            if missing > 0 {
                let at = words(first + bytes.len() as u64).unwrap_or(u32::MAX);
                let Gaps::Fill(with) = gaps else {
                    return Err(ImageError::Gap { address_words: at, bytes: missing });
                };
                notes.push(ImageNote::GapFilled { address_words: at, bytes: missing, with });
                bytes.resize(bytes.len() + missing, with);
            }
            bytes.extend_from_slice(&run);
        }
        Ok((address_words, bytes))
    }
}

/// Converts pairs of hexadecimal digits to bytes. The error contains the column of the invalid or missing digit, counted from 0.
pub(super) fn hex_bytes(digits: &[u8]) -> Result<Vec<u8>, (usize, LineProblem)> {
    if let Some(i) = digits.iter().position(|d| !d.is_ascii_hexdigit()) {
        return Err((i, LineProblem::Digit));
    }
    if digits.len() % 2 == 1 {
        return Err((digits.len(), LineProblem::Digit));
    }
    let value = |d: u8| (d as char).to_digit(16).unwrap_or(0) as u8;
    Ok(digits.as_chunks::<2>().0.iter().map(|[high, low]| value(*high) << 4 | value(*low)).collect())
}

/// Returns a text without the characters that some tools write after the last line: ^Z (end of file in DOS), NUL, and white space.
pub(super) fn without_padding(content: &[u8]) -> &[u8] {
    let is_text = |b: &u8| !b.is_ascii_whitespace() && !matches!(b, 0 | 0x1A);
    content.iter().rposition(is_text).and_then(|last| content.get(..=last)).unwrap_or_default()
}

/// Returns the lines of a text with their numbers from 1, without line ends (CR LF, LF or CR) and surrounding blanks. The result does not
/// contain empty lines.
pub(super) fn lines(content: &[u8]) -> impl Iterator<Item = (usize, &[u8])> + Clone {
    let (mut rest, mut number) = (content, 0);
    let next = move || {
        let end = rest.iter().position(|b| matches!(b, b'\r' | b'\n')).unwrap_or(rest.len());
        let (line, after) = rest.split_at_checked(end).filter(|_| !rest.is_empty())?;
        rest = after.strip_prefix(b"\r\n").or_else(|| after.get(1..)).unwrap_or_default();
        number += 1;
        Some((number, line.trim_ascii()))
    };
    core::iter::from_fn(next).filter(|(_, line)| !line.is_empty())
}
