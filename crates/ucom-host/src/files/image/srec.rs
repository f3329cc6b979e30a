//! Reads Motorola S-record files. An S-record consists of `S`, type, length, address, data and checksum.
use super::segments::{Segments, hex_bytes, lines};
use super::{Format, ImageError, ImageNote, LineProblem};

/// Reads the S-records of a file. Some tools do not write an end record. Without an end record, a count record at the end shows that the
/// file is complete.
pub(super) fn read(
    content: &[u8],
    segments: &mut Segments,
    notes: &mut Vec<ImageNote>,
) -> Result<(), ImageError> {
    let mut records = 0_u32;
    let mut ended = false;
    // Number of data records, if the previous line was a count record with exactly this number.
    let mut counted_to = None;
    let mut last = 0;
    for (number, line) in lines(content) {
        last = number;
        let at = |column: usize, problem| ImageError::line(number, column + 1, problem);
        let [b'S', kind, digits @ ..] = line else { return Err(at(0, LineProblem::Start { expected: 'S' })) };
        if !kind.is_ascii_digit() {
            return Err(at(1, LineProblem::Digit));
        }
        let kind = kind - b'0';
        let bytes = hex_bytes(digits).map_err(|(column, problem)| at(column + 2, problem))?;
        // The declared length of a record includes address, data and checksum.
        let (declared, has) = (usize::from(*bytes.first().unwrap_or(&0)), bytes.len().saturating_sub(1));
        if declared != has || has == 0 {
            return Err(at(2, LineProblem::Length { declared, has }));
        }
        let Some((&checksum, counted)) = bytes.split_last() else { continue };
        let should = !counted.iter().fold(0_u8, |sum, b| sum.wrapping_add(*b));
        if checksum != should {
            return Err(at(line.len() - 2, LineProblem::Checksum { has: checksum, should }));
        }
        let body = counted.get(1..).unwrap_or_default();
        let width = match kind {
            0 | 1 | 5 | 9 => 2,
            2 | 6 | 8 => 3,
            3 | 7 => 4,
            _ => return Err(at(1, LineProblem::Type { kind })),
        };
        let Some((address, data)) = body.split_at_checked(width) else {
            return Err(at(2, LineProblem::Length { declared: width + 1, has }));
        };
        let address = address.iter().fold(0_u64, |value, b| value << 8 | u64::from(*b));
        if ended {
            return Err(at(0, LineProblem::AfterEnd));
        }
        let is_count = matches!(kind, 5 | 6);
        counted_to = (is_count && address == u64::from(records) && data.is_empty()).then_some(records);
        match kind {
            1..=3 => {
                records = records.saturating_add(1);
                segments.add(address, data).map_err(|problem| at(0, problem))?;
            }
            5 | 6 => {
                let mask = if kind == 5 { 0xFFFF } else { 0xFF_FFFF };
                if u64::from(records & mask) != address {
                    let problem = LineProblem::Count { declared: address as u32, has: records };
                    return Err(at(4, problem));
                }
            }
            7..=9 => ended = true,
            _ => {}
        }
    }
    match counted_to {
        _ if ended => {}
        Some(records) => notes.push(ImageNote::EndedByCount { records }),
        None => return Err(ImageError::NoEnd { format: Format::SRecord, lines: last }),
    }
    Ok(())
}
