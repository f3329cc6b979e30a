//! Program images: Program ID, flash date, blocks (D-40, D-44, D-45).

use crc::{CRC_16_IBM_3740, Crc, Table};

use crate::header::BLOCK_LEN;
use crate::profile::{Endian, words};

words! {
    /// Computation of the Program ID of an image (D-44), key `prog.checksum`.
    pub enum Checksum {
        /// CRC-16/CCITT-FALSE over the bytes in the order in which they are sent: polynomial 0x1021, start value 0xFFFF.
        Crc16 = "crc16",
        /// Sum of the 16-bit words of the image modulo 65 536. This sum does not detect swapped frames.
        Sum16 = "sum16",
        /// Exclusive-or of the 16-bit words of the image.
        Xor16 = "xor16",
        /// No checksum; the board accepts the Program ID in the header without a check.
        None = "none",
    }
}

words! {
    /// Encoding of the flash date in 16 bits (D-45), key `prog.date`.
    pub enum DateForm {
        /// The encoding is `(year − 1980) << 9 | month << 5 | day`, for the years 1980 to 2107.
        Fat = "fat",
        /// The encoding is the number of days since 2000-01-01, up to the year 2179.
        Days2000 = "days2000",
        /// The encoding is four decimal digits YYMM, for the years 2000 to 2099. The day is not stored, so a decoded date is the first day
        /// of the month.
        Bcd = "bcd",
        /// The encoding is a raw number that this tool does not interpret as a date.
        Raw = "raw",
    }
}

const CCITT_FALSE: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);
static CCITT_FALSE_TABLE: Crc<u16> = CCITT_FALSE;

/// Computation of a Program ID that is in progress. The caller can add the image in pieces of any size.
#[derive(Clone)]
pub struct Digest {
    checksum: Checksum,
    endian: Endian,
    crc: crc::Digest<'static, u16, Table<1>>,
    word: u16,
    /// First byte of a word whose second byte has not arrived yet.
    odd: Option<u8>,
}

impl core::fmt::Debug for Digest {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Digest({}, {:04X})", self.checksum, self.finish())
    }
}

impl Digest {
    /// Creates an empty digest. `endian` is the order of the bytes in program words (`prog.endian`).
    pub fn new(checksum: Checksum, endian: Endian) -> Self {
        Self { checksum, endian, crc: CCITT_FALSE_TABLE.digest(), word: 0, odd: None }
    }

    /// Adds the next bytes of the image, in the order in which they are sent.
    pub fn update(&mut self, bytes: &[u8]) {
        match self.checksum {
            Checksum::Crc16 => self.crc.update(bytes),
            Checksum::None => {}
            Checksum::Sum16 | Checksum::Xor16 => {
                for byte in bytes {
                    match self.odd.take() {
                        None => self.odd = Some(*byte),
                        Some(first) => self.word = self.with([first, *byte]),
                    }
                }
            }
        }
    }

    fn with(&self, bytes: [u8; 2]) -> u16 {
        let word = self.endian.word(bytes);
        if self.checksum == Checksum::Xor16 { self.word ^ word } else { self.word.wrapping_add(word) }
    }

    /// Returns the Program ID of the bytes added so far, or 0 for [`Checksum::None`]. If the number of bytes is odd,
    /// the sum and the exclusive-or use 0xFF as the missing byte, like the padding of the last block.
    pub fn finish(&self) -> u16 {
        match self.checksum {
            Checksum::Crc16 => self.crc.clone().finalize(),
            Checksum::None => 0,
            Checksum::Sum16 | Checksum::Xor16 => match self.odd {
                Some(first) => self.with([first, 0xFF]),
                None => self.word,
            },
        }
    }
}

/// Returns the Program ID of a complete image (D-44).
pub fn checksum(checksum: Checksum, endian: Endian, image: &[u8]) -> u16 {
    let mut digest = Digest::new(checksum, endian);
    digest.update(image);
    digest.finish()
}

/// Returns the number of data blocks of an image, without the header block.
pub const fn block_count(len: usize) -> usize {
    len.div_ceil(BLOCK_LEN)
}

/// Returns the `i`-th data block of an image; returns `None` after the last block. The last data block is padded with 0xFF (D-41).
pub fn data_block(image: &[u8], i: usize) -> Option<[u8; BLOCK_LEN]> {
    let rest = image.get(i.checked_mul(BLOCK_LEN)?..)?;
    if rest.is_empty() {
        return None;
    }
    let mut block = [0xFF; BLOCK_LEN];
    for (place, byte) in block.iter_mut().zip(rest) {
        *place = *byte;
    }
    Some(block)
}

const fn leap(year: u16) -> bool {
    year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
}

const fn month_days(year: u16, month: u8) -> u8 {
    match month {
        2 => 28 + leap(year) as u8,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    }
}

impl DateForm {
    /// Returns a date as 16 bits; returns `None` if the day does not exist or if this form cannot encode the date. The form `raw` cannot
    /// encode a date.
    pub fn encode(self, year: u16, month: u8, day: u8) -> Option<u16> {
        if day == 0 || day > month_days(year, month) {
            return None;
        }
        let date = match self {
            Self::Fat => {
                let years = year.checked_sub(1980).filter(|years| *years < 128)?;
                years << 9 | u16::from(month) << 5 | u16::from(day)
            }
            Self::Days2000 => {
                let years = 2000..year.max(2000);
                let before: u32 = years.take(200).map(|y| 365 + u32::from(leap(y))).sum();
                let months: u32 = (1..month).map(|m| u32::from(month_days(year, m))).sum();
                let days = before + months + u32::from(day) - 1;
                u16::try_from(days).ok().filter(|_| (2000..2180).contains(&year))?
            }
            Self::Bcd => {
                let years = year.checked_sub(2000).filter(|years| *years < 100)? as u8;
                let digits = |n: u8| u16::from(n / 10) << 4 | u16::from(n % 10);
                digits(years) << 8 | digits(month)
            }
            Self::Raw => return None,
        };
        // 0xFFFF is the date of a board without an application, so it is not a valid date.
        (date != 0xFFFF).then_some(date)
    }

    /// Returns year, month and day; returns `None` if the 16 bits are not a date of this form.
    pub fn decode(self, date: u16) -> Option<(u16, u8, u8)> {
        let (year, month, day) = match self {
            Self::Fat => (1980 + (date >> 9), (date >> 5 & 15) as u8, (date & 31) as u8),
            Self::Days2000 => {
                let (mut year, mut days) = (2000, date);
                while days >= 365 + u16::from(leap(year)) {
                    days -= 365 + u16::from(leap(year));
                    year += 1;
                }
                let mut month = 1;
                while days >= u16::from(month_days(year, month)) && month < 12 {
                    days -= u16::from(month_days(year, month));
                    month += 1;
                }
                (year, month, days as u8 + 1)
            }
            Self::Bcd => {
                // If a digit is above 9, the date is refused below, because encoding the decoded date does not return
                // the original 16 bits.
                let number = |byte: u16| 10 * (byte >> 4) + (byte & 15);
                (2000 + number(date >> 8), number(date & 0xFF) as u8, 1)
            }
            Self::Raw => return None,
        };
        (self.encode(year, month, day) == Some(date)).then_some((year, month, day))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn image() -> Vec<u8> {
        (0..1000).map(|i| (37 * i + 11) as u8).collect()
    }

    /// The test checks the Program IDs and the block count on the protocol page.
    #[test]
    fn d44_program_id_golden() {
        assert_eq!(checksum(Checksum::Crc16, Endian::Little, b"123456789"), 0x29B1);
        assert_eq!(checksum(Checksum::Crc16, Endian::Little, &image()), 0x4B3F);
        assert_eq!(block_count(1000), 16);
    }

    /// The checksums `sum16` and `xor16` do not detect two swapped frames of a block, but `crc16` does. Therefore
    /// `crc16` is the default of `prog.checksum`.
    #[test]
    fn d44_sum_is_blind_to_swapped_frames() {
        let image = image();
        let mut swapped = image.clone();
        swapped.copy_within(8..16, 0);
        swapped[8..16].copy_from_slice(&image[..8]);
        for (kind, blind) in [(Checksum::Crc16, false), (Checksum::Sum16, true), (Checksum::Xor16, true)] {
            let [a, b] = [&image, &swapped].map(|bytes| checksum(kind, Endian::Little, bytes));
            assert_eq!(a == b, blind, "{kind}");
        }
    }

    #[test]
    fn d44_words_are_summed_in_program_order() {
        let bytes = [0x01, 0x02, 0x03, 0x04, 0x05];
        assert_eq!(checksum(Checksum::Sum16, Endian::Little, &bytes), 0x0201 + 0x0403 - 0xFB);
        assert_eq!(checksum(Checksum::Sum16, Endian::Big, &bytes), 0x0102 + 0x0304 + 0x05FF);
        assert_eq!(checksum(Checksum::Xor16, Endian::Big, &bytes), 0x0102 ^ 0x0304 ^ 0x05FF);
        assert_eq!(checksum(Checksum::None, Endian::Big, &bytes), 0);
    }

    #[test]
    fn a_digest_shows_what_it_has() {
        let mut digest = Digest::new(Checksum::Sum16, Endian::Big);
        digest.update(&[0x01, 0x02]);
        assert_eq!(std::format!("{digest:?}"), "Digest(sum16, 0102)");
    }

    #[test]
    fn d45_dates_golden() {
        assert_eq!(DateForm::Fat.encode(2009, 6, 1), Some(0x3AC1));
        assert_eq!(DateForm::Fat.encode(2008, 3, 14), Some(0x386E));
        assert_eq!(DateForm::Days2000.encode(2000, 3, 1), Some(60));
        assert_eq!(DateForm::Days2000.encode(2026, 1, 1), Some(9497));
        assert_eq!(DateForm::Bcd.encode(2026, 11, 30), Some(0x2611));
        assert_eq!(DateForm::Bcd.decode(0x1A11), None);
        assert_eq!(DateForm::Fat.encode(2009, 2, 29), None);
        assert_eq!(DateForm::Fat.encode(2107, 12, 31), Some(0xFF9F));
        assert_eq!(DateForm::Days2000.decode(0xFFFF), None);
        assert_eq!(DateForm::Raw.encode(2009, 6, 1), None);
        assert_eq!(DateForm::Fat.decode(0x3AC1), Some((2009, 6, 1)));
        assert_eq!(DateForm::Days2000.decode(9497), Some((2026, 1, 1)));
        assert_eq!(DateForm::Bcd.decode(0x2611), Some((2026, 11, 1)));
    }

    #[test]
    fn d45_days_beyond_a_form_are_none() {
        for form in [DateForm::Fat, DateForm::Days2000, DateForm::Bcd] {
            assert_eq!((form.encode(2026, 1, 0), form.encode(2026, 13, 1)), (None, None), "{form}");
        }
        assert_eq!((DateForm::Fat.encode(1979, 12, 31), DateForm::Fat.encode(2108, 1, 1)), (None, None));
        assert_eq!((DateForm::Bcd.encode(1999, 12, 31), DateForm::Bcd.encode(2100, 1, 1)), (None, None));
        assert_eq!(DateForm::Days2000.encode(1999, 12, 31), None);
    }

    /// D-45: a date in the form `Bcd` is valid only if all four digits are decimal and the last two digits are a
    /// month.
    #[test]
    fn d45_bcd_takes_decimal_digits_only() {
        for date in 0..=u16::MAX {
            let text = std::format!("{date:04X}");
            let number = |digits: &str| digits.parse::<u16>().ok();
            let expected =
                number(&text[..2]).zip(number(&text[2..])).filter(|(_, month)| (1..=12).contains(month));
            let expected = expected.map(|(years, month)| (2000 + years, month as u8, 1));
            assert_eq!(DateForm::Bcd.decode(date), expected, "{text}");
        }
    }

    /// D-45: the encoded dates equal the dates of a calendar that counts day by day from 2000-01-01. The last value,
    /// 0xFFFE, means 2179-06-05.
    #[test]
    fn d45_days_in_a_row() {
        let (mut year, mut month, mut day) = (2000, 1, 1);
        for date in 0..0xFFFF {
            assert_eq!(DateForm::Days2000.decode(date), Some((year, month, day)), "{date}");
            day += 1;
            if day > month_days(year, month) {
                (month, day) = (month + 1, 1);
            }
            if month > 12 {
                (year, month) = (year + 1, 1);
            }
        }
        assert_eq!((year, month, day), (2179, 6, 6));
    }

    proptest! {
        #[test]
        fn d45_dates_round_trip(date: u16) {
            for form in [DateForm::Fat, DateForm::Days2000, DateForm::Bcd] {
                if let Some((year, month, day)) = form.decode(date) {
                    prop_assert_eq!(form.encode(year, month, day), Some(date));
                }
            }
        }

        #[test]
        fn d45_days_round_trip(year in 2000..2100u16, month in 1..=12u8, day in 1..=28u8) {
            for form in [DateForm::Fat, DateForm::Days2000] {
                prop_assert_eq!(form.encode(year, month, day).and_then(|date| form.decode(date)), Some((year, month, day)));
            }
            // The form `Bcd` does not store the day.
            let date = DateForm::Bcd.encode(year, month, day);
            prop_assert_eq!(date.and_then(|date| DateForm::Bcd.decode(date)), Some((year, month, 1)));
        }

        /// D-44: the Program ID is the same for any division of the image into pieces.
        #[test]
        fn d44_pieces(bytes in proptest::collection::vec(any::<u8>(), 0..200), at in 0..200usize, i in 0..3usize) {
            let kind = [Checksum::Crc16, Checksum::Sum16, Checksum::Xor16][i];
            let (head, tail) = bytes.split_at(at.min(bytes.len()));
            let mut digest = Digest::new(kind, Endian::Big);
            digest.update(head);
            digest.update(tail);
            prop_assert_eq!(digest.finish(), checksum(kind, Endian::Big, &bytes));
        }

        #[test]
        fn d41_blocks_hold_the_image(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let all: Vec<u8> = (0..).map_while(|i| data_block(&bytes, i)).flatten().collect();
            prop_assert_eq!(all.len(), 64 * block_count(bytes.len()));
            prop_assert_eq!(&all[..bytes.len()], &bytes[..]);
            prop_assert!(all[bytes.len()..].iter().all(|byte| *byte == 0xFF));
        }
    }
}
