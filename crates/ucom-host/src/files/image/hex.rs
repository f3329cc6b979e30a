//! Reads Intel HEX files. A record of Intel HEX consists of `:`, length, address, type, data and checksum.
use super::segments::{Segments, hex_bytes, lines};
use super::{Format, ImageError, LineProblem};

pub(super) fn read(content: &[u8], segments: &mut Segments) -> Result<(), ImageError> {
    let mut base = 0_u64;
    // With 8086 segment addresses, the offset wraps at 64 KiB. With linear addresses, the offset does not wrap.
    let mut wraps = false;
    let mut ended = false;
    let mut last = 0;
    for (number, line) in lines(content) {
        last = number;
        let at = |column: usize, problem| ImageError::line(number, column + 1, problem);
        let [b':', digits @ ..] = line else { return Err(at(0, LineProblem::Start { expected: ':' })) };
        let bytes = hex_bytes(digits).map_err(|(column, problem)| at(column + 1, problem))?;
        let [length, high, low, kind, rest @ ..] = bytes.as_slice() else {
            return Err(at(1, LineProblem::Length { declared: 5, has: bytes.len() }));
        };
        let Some((&checksum, data)) = rest.split_last() else {
            return Err(at(1, LineProblem::Length { declared: 5, has: bytes.len() }));
        };
        if data.len() != usize::from(*length) {
            let (declared, has) = (usize::from(*length), data.len());
            return Err(at(1, LineProblem::Length { declared, has }));
        }
        let sum = bytes.iter().take(bytes.len() - 1).fold(0_u8, |sum, b| sum.wrapping_add(*b));
        let should = sum.wrapping_neg();
        if checksum != should {
            return Err(at(line.len() - 2, LineProblem::Checksum { has: checksum, should }));
        }
        if ended {
            return Err(at(0, LineProblem::AfterEnd));
        }
        let offset = u16::from_be_bytes([*high, *low]);
        match (kind, data) {
            (0, data) => {
                let start = base + u64::from(offset);
                let room = if wraps { (0x1_0000 - usize::from(offset)).min(data.len()) } else { data.len() };
                let (here, wrapped) = data.split_at(room);
                let taken = segments.add(start, here).and_then(|()| segments.add(base, wrapped));
                taken.map_err(|problem| at(0, problem))?;
            }
            (1, []) => ended = true,
            (2, [high, low]) => (base, wraps) = (u64::from(u16::from_be_bytes([*high, *low])) << 4, true),
            (4, [high, low]) => (base, wraps) = (u64::from(u16::from_be_bytes([*high, *low])) << 16, false),
            // The reader ignores start addresses, because the loader uses its own start address.
            (3 | 5, [_, _, _, _]) => {}
            (1..=5, data) => {
                let declared = match kind {
                    1 => 0,
                    2 | 4 => 2,
                    _ => 4,
                };
                return Err(at(1, LineProblem::Length { declared, has: data.len() }));
            }
            _ => return Err(at(7, LineProblem::Type { kind: *kind })),
        }
    }
    if ended { Ok(()) } else { Err(ImageError::NoEnd { format: Format::IntelHex, lines: last }) }
}
