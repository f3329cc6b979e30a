//! Header block, which is the first block of each of the two cycles of an update (D-41).

use core::fmt;

use crate::profile::Endian;

/// Number of bytes of a block, which consists of 8 frames of 8 bytes, or 32 words (D-40).
pub const BLOCK_LEN: usize = 64;

const MAGIC: u16 = 0x5543;
const VERSION: u16 = 1;

/// Memory of the board to which an image is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Memory {
    /// Program flash of the board.
    Program,
    /// Data flash of the board.
    Data,
    /// RAM of the board, into which an exloader is loaded.
    Ram,
}

impl Memory {
    /// Returns the number of the memory in the header.
    pub const fn number(self) -> u16 {
        match self {
            Self::Program => 0,
            Self::Data => 1,
            Self::Ram => 0x10,
        }
    }

    /// Returns the memory with this number; returns `None` if the number is not defined.
    pub const fn from_number(number: u16) -> Option<Self> {
        match number {
            0 => Some(Self::Program),
            1 => Some(Self::Data),
            0x10 => Some(Self::Ram),
            _ => None,
        }
    }
}

/// The contents of the header block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Number of the update cycle, 1 or 2. Boards refuse a header with another cycle number.
    pub cycle: u16,
    /// Number of the target memory, see [`Memory::from_number`].
    pub memory: u16,
    /// Load address of the image in words.
    pub address: u32,
    /// Length of the image in words.
    pub length: u32,
    /// Program ID of the image (D-44).
    pub program_id: u16,
    /// Flash date of the image (D-45).
    pub date: u16,
    /// Flash number of the board for which the image is intended; [`Header::ANY_BOARD`] for an image for every board.
    pub target: u16,
}

/// Reasons why a block is not a valid header (DSP_ERROR 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderError {
    /// Word 0 of the block has this value instead of 0x5543.
    Magic(u16),
    /// Word 1 of the block has this value instead of 1.
    Version(u16),
    /// The sum of the 32 words of the header has this value instead of 0.
    Sum(u16),
}

impl fmt::Display for HeaderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Magic(word) => write!(f, "header starts with {word:04X}, not 5543"),
            Self::Version(word) => write!(f, "header version {word} is unknown, expected 1"),
            Self::Sum(word) => write!(f, "the sum of the header's words is {word:04X}, expected 0"),
        }
    }
}

impl core::error::Error for HeaderError {}

impl Header {
    /// Value of the field `target` for an image that any board accepts.
    pub const ANY_BOARD: u16 = 0xFFFF;

    /// Returns the header block; `endian` is the byte order of its words.
    pub fn build(&self, endian: Endian) -> [u8; BLOCK_LEN] {
        let mut words = [0xFFFFu16; 32];
        let fields = [
            MAGIC,
            VERSION,
            self.cycle,
            self.memory,
            self.address as u16,
            (self.address >> 16) as u16,
            self.length as u16,
            (self.length >> 16) as u16,
            self.program_id,
            self.date,
            self.target,
        ];
        for (word, field) in words.iter_mut().zip(fields) {
            *word = field;
        }
        let sum = words.iter().take(31).fold(0u16, |sum, word| sum.wrapping_add(*word));
        if let Some(last) = words.last_mut() {
            *last = sum.wrapping_neg();
        }
        let mut block = [0; BLOCK_LEN];
        for (place, word) in block.chunks_exact_mut(2).zip(words) {
            place.copy_from_slice(&endian.bytes(word));
        }
        block
    }

    /// Parses a header block.
    pub fn parse(block: &[u8; BLOCK_LEN], endian: Endian) -> Result<Self, HeaderError> {
        let mut words = [0u16; 32];
        for (word, bytes) in words.iter_mut().zip(block.chunks_exact(2)) {
            if let &[a, b] = bytes {
                *word = endian.word([a, b]);
            }
        }
        let [magic, version, cycle, memory, a0, a1, l0, l1, program_id, date, target, ..] = words;
        if magic != MAGIC {
            return Err(HeaderError::Magic(magic));
        }
        if version != VERSION {
            return Err(HeaderError::Version(version));
        }
        let sum = words.iter().fold(0u16, |sum, word| sum.wrapping_add(*word));
        if sum != 0 {
            return Err(HeaderError::Sum(sum));
        }
        let long = |low: u16, high: u16| u32::from(high) << 16 | u32::from(low);
        Ok(Self { cycle, memory, address: long(a0, a1), length: long(l0, l1), program_id, date, target })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// D-41: the code builds and parses exactly the header block that the protocol page shows.
    #[test]
    fn d41_header_golden() {
        let mut header = Header {
            cycle: 1,
            memory: 0,
            address: 0,
            length: 500,
            program_id: 0x4B3F,
            date: 0x3AC1,
            target: Header::ANY_BOARD,
        };
        let mut block = [0xFF; 64];
        block[..20].copy_from_slice(&[
            0x43, 0x55, 0x01, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xF4, 0x01, 0x00, 0x00,
            0x3F, 0x4B, 0xC1, 0x3A,
        ]);
        block[62..].copy_from_slice(&[0xDC, 0x22]);
        assert_eq!(header.build(Endian::Little), block);
        assert_eq!(Header::parse(&block, Endian::Little), Ok(header));
        // The header of cycle 2 differs from the header of cycle 1 only in the cycle number and the sum.
        header.cycle = 2;
        (block[4], block[62]) = (0x02, 0xDB);
        assert_eq!(header.build(Endian::Little), block);
        assert_eq!(Header::parse(&block, Endian::Big), Err(HeaderError::Magic(0x4355)));
    }

    #[test]
    fn d41_another_version_is_refused() {
        let header = Header { cycle: 1, memory: 0, address: 0, length: 1, program_id: 0, date: 0, target: 0 };
        let mut block = header.build(Endian::Little);
        // A header with version 2 is invalid even if its sum is correct.
        (block[2], block[62]) = (2, block[62].wrapping_sub(1));
        assert_ne!(block[62], 0xFF, "no borrow");
        assert_eq!(Header::parse(&block, Endian::Little), Err(HeaderError::Version(2)));
    }

    #[test]
    fn errors_in_words() {
        for (error, text) in [
            (HeaderError::Magic(0x4355), "header starts with 4355, not 5543"),
            (HeaderError::Version(2), "header version 2 is unknown, expected 1"),
            (HeaderError::Sum(0x10), "the sum of the header's words is 0010, expected 0"),
        ] {
            assert_eq!(std::format!("{error}"), text);
        }
    }

    proptest! {
        #[test]
        fn d41_round_trip(words: [u16; 5], address: u32, length: u32, big: bool, at in 0..64usize, flip in 1..=255u8) {
            let [cycle, memory, program_id, date, target] = words;
            let header = Header { cycle, memory, address, length, program_id, date, target };
            let endian = if big { Endian::Big } else { Endian::Little };
            let mut block = header.build(endian);
            prop_assert_eq!(Header::parse(&block, endian), Ok(header));
            // The sum of the words always detects a change of a single byte.
            block[at] ^= flip;
            prop_assert!(Header::parse(&block, endian).is_err());
        }
    }
}
