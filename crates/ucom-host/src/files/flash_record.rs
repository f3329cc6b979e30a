//! Flash records of an inventory. A flash record describes the image that this tool wrote to a board and read back.
//!
//! A board itself reports only its Program ID and flash date. The flash record adds the hash of the image and its load address.

use core::fmt::Write as _;
use serde::{Deserialize, Deserializer, de};
use sha2::{Digest, Sha256};
use ucom::BoardInfo;

/// Record of an image that was written to program memory and read back.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlashRecord {
    /// Flash number of the board that received the image. A record that was copied to another board is not valid.
    pub flash_number: u16,
    /// SHA-256 of the image bytes in the order in which they were sent.
    #[serde(deserialize_with = "hash")]
    pub sha256: [u8; 32],
    /// Load address of the image in words.
    pub address: u32,
    /// Program ID that the board reported after the write.
    pub program_id: u16,
    /// Flash date that the board reported after the write, as 16 bits in the format that the profile defines.
    pub date: u16,
}

impl FlashRecord {
    /// Creates the record of an image; `shown` is the answer of the board after the write.
    pub fn new(bytes: &[u8], address_words: u32, shown: &BoardInfo) -> Self {
        let BoardInfo { flash_number, program_id, date, .. } = *shown;
        Self { flash_number, sha256: hash_of(bytes), address: address_words, program_id, date }
    }

    /// Returns `true` if the image has the recorded hash and load address.
    pub fn is_of(&self, bytes: &[u8], address_words: u32) -> bool {
        self.sha256 == hash_of(bytes) && self.address == address_words
    }

    /// Returns the flash record as an inline TOML table.
    pub(super) fn to_toml(self) -> String {
        let hash = self.sha256.iter().fold(String::new(), |mut text, byte| {
            // Writing to a string never fails.
            let _ = write!(text, "{byte:02x}");
            text
        });
        let Self { flash_number, address, program_id, date, .. } = self;
        format!(
            "{{ flash_number = 0x{flash_number:04X}, sha256 = \"{hash}\", address = 0x{address:X}, \
             program_id = 0x{program_id:04X}, date = 0x{date:04X} }}"
        )
    }
}

/// Returns the hash that identifies an image in flash records.
fn hash_of(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// Reads a hash of 64 hexadecimal digits.
fn hash<'de, D: Deserializer<'de>>(input: D) -> Result<[u8; 32], D::Error> {
    let text = String::deserialize(input)?;
    let wrong =
        || de::Error::custom(format!("\"{text}\" is not a valid SHA-256, expected 64 hexadecimal digits"));
    let mut out = [0; 32];
    let (pairs, []) = text.as_bytes().as_chunks::<2>() else { return Err(wrong()) };
    if pairs.len() != out.len() {
        return Err(wrong());
    }
    for (byte, [high, low]) in out.iter_mut().zip(pairs) {
        let digit = |digit: &u8| char::from(*digit).to_digit(16);
        let (Some(high), Some(low)) = (digit(high), digit(low)) else { return Err(wrong()) };
        *byte = (high << 4 | low) as u8;
    }
    Ok(out)
}
