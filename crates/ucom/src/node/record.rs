//! Validity record of an application. The board writes it last and clears it first (D-45).

use super::hardware::RECORD_LEN;
use crate::profile::Endian;
use crate::program::{Checksum, checksum};

/// Validity record of the application in flash. Without a complete validity record, the board has no application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Program ID of the application (D-44).
    pub program_id: u16,
    /// Flash date of the application (D-45).
    pub date: u16,
    /// Address of the image in words.
    pub address: u32,
    /// Length of the image in words.
    pub words: u32,
}

const MAGIC: [u8; 2] = *b"UR";

impl Record {
    /// Returns the bytes of the record for the flash, including a checksum. The checksum makes a record invalid if it was not completely
    /// written before a power loss.
    pub fn build(&self) -> [u8; RECORD_LEN] {
        let [p0, p1] = self.program_id.to_le_bytes();
        let [d0, d1] = self.date.to_le_bytes();
        let [a0, a1, a2, a3] = self.address.to_le_bytes();
        let [w0, w1, w2, w3] = self.words.to_le_bytes();
        let body = [MAGIC[0], MAGIC[1], p0, p1, d0, d1, a0, a1, a2, a3, w0, w1, w2, w3];
        let mut bytes = [0; RECORD_LEN];
        let check = checksum(Checksum::Crc16, Endian::Little, &body).to_le_bytes();
        for (place, byte) in bytes.iter_mut().zip(body.into_iter().chain(check)) {
            *place = byte;
        }
        bytes
    }

    /// Parses a validity record. Returns `None` if any byte is invalid.
    pub fn parse(bytes: &[u8; RECORD_LEN]) -> Option<Self> {
        let [_, _, p0, p1, d0, d1, a0, a1, a2, a3, w0, w1, w2, w3, ..] = *bytes;
        let record = Self {
            program_id: u16::from_le_bytes([p0, p1]),
            date: u16::from_le_bytes([d0, d1]),
            address: u32::from_le_bytes([a0, a1, a2, a3]),
            words: u32::from_le_bytes([w0, w1, w2, w3]),
        };
        (record.build() == *bytes).then_some(record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D-45: erased flash does not contain a valid record. A record that was only partly written is also invalid.
    #[test]
    fn d45_half_a_record_is_none() {
        let record = Record { program_id: 0x4B3F, date: 0x3AC1, address: 0x1000, words: 500 };
        let whole = record.build();
        assert_eq!(Record::parse(&whole), Some(record));
        for written in 0..RECORD_LEN {
            let mut torn = [0xFF; RECORD_LEN];
            torn[..written].copy_from_slice(&whole[..written]);
            assert_eq!(Record::parse(&torn), None, "{written} bytes");
        }
        assert_eq!(Record::parse(&[0; RECORD_LEN]), None);
    }
}
