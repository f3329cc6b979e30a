//! Parser that extracts the flash content from an ELF file. The parser supports only the necessary part of the ELF format.

use super::image::{ERASED, FLASH, STORED_ARM};

/// First bytes of a 32-bit little-endian ELF file.
const MAGIC: [u8; 6] = [0x7F, b'E', b'L', b'F', 1, 1];
/// ELF type of a segment that is loaded into memory.
const PT_LOAD: u32 = 1;
/// Machine number of the Arm architecture in ELF files.
const EM_ARM: u16 = 40;
/// Maximum number of segments in an ELF file. The programs of this project have fewer segments.
const SEGMENTS_MAX: u16 = 64;

/// Returns `true` if the file is an ELF file of any kind.
pub(super) fn is_elf(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC[..4])
}

/// Returns the flash content from an ELF file. The first byte of the result is the first byte of the flash. Gaps are filled with the value
/// of erased flash.
pub(super) fn flat(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let damaged = || "an incomplete or damaged ELF file".to_owned();
    let half =
        |at: usize| bytes.get(at..at + 2).map(|b| u16::from_le_bytes([b[0], b[1]])).ok_or_else(damaged);
    let word = |at: usize| {
        let at = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(*at.first_chunk()?))
    };
    let word = |at: usize| word(at).ok_or_else(damaged);
    if !bytes.starts_with(&MAGIC) || half(18)? != EM_ARM {
        return Err("an ELF file for another processor".into());
    }
    let (table, size, count) = (word(28)? as usize, usize::from(half(42)?), half(44)?);
    if count > SEGMENTS_MAX || size < 32 {
        return Err(damaged());
    }
    let mut flat = Vec::new();
    for n in 0..usize::from(count) {
        let head = table.checked_add(n * size).ok_or_else(damaged)?;
        let field = |n: usize| word(head.saturating_add(4 * n));
        let (kind, address) = (field(0)?, field(3)?);
        let (offset, length) = (field(1)? as usize, field(4)? as usize);
        if kind != PT_LOAD || length == 0 {
            continue;
        }
        let data = offset.checked_add(length).and_then(|end| bytes.get(offset..end)).ok_or_else(damaged)?;
        let at = address.checked_sub(FLASH).map(|at| at as usize);
        let end = at.and_then(|at| at.checked_add(length)).filter(|end| *end <= STORED_ARM);
        let (Some(at), Some(end)) = (at, end) else {
            return Err(format!(
                "{length} bytes at address {address:#010x}, which is outside the flash of a program"
            ));
        };
        if flat.len() < end {
            flat.resize(end, ERASED);
        }
        flat[at..end].copy_from_slice(data);
    }
    Ok(flat)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Builds an ELF file with the segments `segments`. Each segment consists of an address and bytes.
    fn file(segments: &[(u32, &[u8])]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.resize(52, 0);
        bytes[18] = 40;
        bytes[28] = 52;
        bytes[42] = 32;
        bytes[44] = segments.len() as u8;
        let mut offset = 52 + 32 * segments.len() as u32;
        for (address, data) in segments {
            let length = data.len() as u32;
            for word in [1, offset, 0x2000_0000, *address, length, length, 0, 0] {
                bytes.extend(word.to_le_bytes());
            }
            offset += length;
        }
        segments.iter().for_each(|(_, data)| bytes.extend(*data));
        bytes
    }

    #[test]
    fn segments_stand_where_they_are_loaded() {
        let bytes = file(&[(FLASH + 8, &[1, 2]), (FLASH, &[3, 4, 5])]);
        assert_eq!(flat(&bytes).unwrap(), [3, 4, 5, 255, 255, 255, 255, 255, 1, 2]);
        // A segment without bytes in the file, here in RAM, is not part of the flash.
        assert_eq!(flat(&file(&[(0x2000_0000, &[]), (FLASH, &[7])])).unwrap(), [7]);
    }

    #[test]
    fn a_file_that_is_cut_off_or_for_another_place_is_refused() {
        let bytes = file(&[(FLASH, &[1, 2, 3, 4])]);
        for end in 0..bytes.len() {
            assert!(flat(&bytes[..end]).is_err(), "{end}");
        }
        for address in [0x0700_0000, 0x2000_0000, FLASH + 0x1C_0000 - 1, u32::MAX] {
            assert!(
                flat(&file(&[(address, &[1, 2])])).unwrap_err().contains("outside the flash"),
                "{address:#x}"
            );
        }
        let mut other = bytes.clone();
        other[18] = 62;
        assert!(flat(&other).unwrap_err().contains("another processor"));
        // Arbitrary numbers in the file must not cause a panic.
        for at in 28..bytes.len() - 4 {
            let mut wild = bytes.clone();
            wild[at..at + 4].fill(0xFF);
            let _ = flat(&wild);
        }
    }
}
