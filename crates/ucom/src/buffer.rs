//! Buffers of words (CI, SO, PAR), which are sent in packages of three words (D-15).

use crate::frame::Payload;
use crate::profile::Endian;

/// Package of up to three words of a buffer, beginning at an offset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct BufferPackage {
    /// Index of the first word in the buffer.
    pub offset: u16,
    /// Number of valid words in `words`, 1..3.
    pub count: u8,
    /// Words of the package. Only the first `count` words are valid; the other words are 0.
    pub words: [u16; 3],
}

/// Package that starts at or beyond the end of its buffer (DSP_ERROR 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BeyondBuffer {
    /// Index of the first word of the package.
    pub offset: u16,
    /// Number of words in the buffer.
    pub dimension: usize,
}

impl core::fmt::Display for BeyondBuffer {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "offset {} in a buffer of {} words", self.offset, self.dimension)
    }
}

impl core::error::Error for BeyondBuffer {}

/// Returns the number of packages that transfer a complete buffer: `ceil(dimension / 3)`.
pub const fn package_count(dimension: u16) -> u16 {
    dimension.div_ceil(3)
}

impl BufferPackage {
    /// Returns the package that begins at word `offset` of a buffer; `None` if the buffer has no such word.
    pub fn at(buffer: &[u16], offset: u16) -> Option<Self> {
        let rest = buffer.get(usize::from(offset)..)?;
        let mut package = Self { offset, count: rest.len().min(3) as u8, words: [0; 3] };
        for (place, word) in package.words.iter_mut().zip(rest) {
            *place = *word;
        }
        (package.count > 0).then_some(package)
    }

    /// Returns the payload of the frame that carries the package. Unused words are sent as 0. With `short_last` (key `pd.short_last`), only
    /// the valid words are sent.
    pub fn payload(&self, endian: Endian, short_last: bool) -> Payload {
        let mut data = [0; 8];
        let words = self.words.iter().take(usize::from(self.count));
        for (place, word) in data.chunks_exact_mut(2).zip(core::iter::once(&self.offset).chain(words)) {
            place.copy_from_slice(&endian.bytes(*word));
        }
        let len = if short_last { 2 + 2 * usize::from(self.count.clamp(1, 3)) } else { 8 };
        Payload::of(data, len)
    }

    /// Reads a package from the payload of a frame. Returns `None` unless the payload has 4, 6 or 8 bytes.
    pub fn parse(payload: &Payload, endian: Endian) -> Option<Self> {
        let len = payload.len();
        if !matches!(len, 4 | 6 | 8) {
            return None;
        }
        let [o0, o1, a0, a1, b0, b1, c0, c1] = payload.padded();
        let words = [endian.word([a0, a1]), endian.word([b0, b1]), endian.word([c0, c1])];
        Some(Self { offset: endian.word([o0, o1]), count: (len - 2) / 2, words })
    }

    /// Copies the words of the package into a buffer and returns the number of copied words. Words at or beyond the
    /// end of the buffer are ignored. Returns an error if the package starts at or beyond the end of the buffer.
    pub fn apply(&self, buffer: &mut [u16]) -> Result<usize, BeyondBuffer> {
        let dimension = buffer.len();
        let beyond = BeyondBuffer { offset: self.offset, dimension };
        let places = buffer.get_mut(usize::from(self.offset)..).ok_or(beyond)?;
        if places.is_empty() {
            return Err(beyond);
        }
        let words = self.words.iter().take(usize::from(self.count));
        Ok(places.iter_mut().zip(words).map(|(place, word)| *place = *word).count())
    }

    /// Returns `true` if the package reaches the last word of a buffer.
    pub const fn covers_last(&self, dimension: usize) -> bool {
        let end = self.offset as usize + self.count as usize;
        (self.offset as usize) < dimension && end >= dimension
    }
}

/// Packages of a complete buffer, with offsets 0, 3, 6 and so on.
#[derive(Clone, Debug)]
pub struct Packages<'a> {
    buffer: &'a [u16],
    next: Option<u16>,
}

impl<'a> Packages<'a> {
    /// Creates the packages of a buffer. Words of the buffer after the 65 536th word have no offset and are omitted.
    pub const fn new(buffer: &'a [u16]) -> Self {
        Self { buffer, next: Some(0) }
    }
}

impl Iterator for Packages<'_> {
    type Item = BufferPackage;

    fn next(&mut self) -> Option<BufferPackage> {
        let package = BufferPackage::at(self.buffer, self.next?)?;
        self.next = package.offset.checked_add(3);
        Some(package)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    /// C-5: splits buffers of 0 to 7 words and a buffer of 65 535 words into packages. Applying all packages to an
    /// empty buffer gives the original contents.
    #[test]
    fn d15_c5_packages_of_a_buffer() {
        for dimension in [0u16, 1, 2, 3, 4, 6, 7, 65535] {
            let buffer: Vec<u16> = (0..dimension).map(|i| i.wrapping_mul(40503)).collect();
            let packages: Vec<_> = Packages::new(&buffer).collect();
            assert_eq!(packages.len(), usize::from(package_count(dimension)));
            let mut copy = vec![0; buffer.len()];
            for (i, package) in packages.iter().enumerate() {
                assert_eq!(usize::from(package.offset), 3 * i);
                for endian in [Endian::Little, Endian::Big] {
                    let wire = package.payload(endian, false);
                    assert_eq!(wire.len(), 8);
                    let back = BufferPackage::parse(&wire, endian).unwrap();
                    back.apply(&mut copy).unwrap();
                }
            }
            assert_eq!(copy, buffer);
            if let Some(last) = packages.last() {
                assert!(last.covers_last(buffer.len()));
            }
        }
        let last = BufferPackage { offset: 65535, count: 3, words: [1, 2, 3] };
        let mut full = vec![0; 65536];
        assert_eq!(last.apply(&mut full), Ok(1));
        assert_eq!((full[65534], full[65535]), (0, 1));
        let beyond = BeyondBuffer { offset: 65535, dimension: 65535 };
        assert_eq!(last.apply(&mut full[..65535]), Err(beyond));
        assert_eq!(std::format!("{beyond}"), "offset 65535 in a buffer of 65535 words");
    }

    #[test]
    fn d15_surplus_words_are_ignored_and_neighbours_stay() {
        let package = BufferPackage { offset: 1, count: 3, words: [7, 8, 9] };
        let mut buffer = [1, 2, 3];
        assert_eq!(package.apply(&mut buffer), Ok(2));
        assert_eq!(buffer, [1, 7, 8]);
        assert!(package.apply(&mut [5]).is_err());
        assert!(BufferPackage { offset: 0, count: 1, words: [0; 3] }.apply(&mut []).is_err());
    }

    #[test]
    fn d15_wire_form() {
        let package = BufferPackage { offset: 3, count: 1, words: [0x0067, 0, 0] };
        assert_eq!(package.payload(Endian::Little, false).bytes(), [3, 0, 0x67, 0, 0, 0, 0, 0]);
        assert_eq!(package.payload(Endian::Little, true).bytes(), [3, 0, 0x67, 0]);
        assert_eq!(package.payload(Endian::Big, true).bytes(), [0, 3, 0, 0x67]);
        for len in [0, 1, 2, 3, 5, 7] {
            let payload = Payload::new(&[0; 8][..len]).unwrap();
            assert_eq!(BufferPackage::parse(&payload, Endian::Little), None);
        }
    }

    proptest! {
        /// D-15: decoding an encoded package returns the original package. Applying a package never changes a word
        /// outside the buffer.
        #[test]
        fn d15_round_trip(offset: u16, count in 1..=3u8, mut words: [u16; 3], big: bool, size in 0..9usize) {
            words[usize::from(count)..].fill(0);
            let package = BufferPackage { offset, count, words };
            let endian = if big { Endian::Big } else { Endian::Little };
            let short = BufferPackage::parse(&package.payload(endian, true), endian);
            prop_assert_eq!(short, Some(package));
            let long = BufferPackage::parse(&package.payload(endian, false), endian).unwrap();
            prop_assert_eq!((long.offset, long.words), (offset, words));
            let package = BufferPackage { offset: offset % 12, ..package };
            let mut buffer = vec![0xAAAA; size];
            if let Ok(taken) = package.apply(&mut buffer) {
                prop_assert!(taken >= 1 && usize::from(package.offset) + taken <= size);
            } else {
                prop_assert!(usize::from(package.offset) >= size);
            }
        }
    }
}
