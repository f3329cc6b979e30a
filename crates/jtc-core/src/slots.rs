//! Two flash slots that keep one image safe during any loss of power (J-54).
//!
//! An image, here a stored arm, is a sequence of bytes that this module does not interpret. A new image is written to the slot that does
//! not contain the newest image. The previous image therefore stays complete until the new image is complete. A slot consists of a header
//! of one flash word and the image, which is filled up to whole words:
//!
//! | bytes | content |
//! |---|---|
//! | 0..4 | `JTCA` |
//! | 4..6 | version of this layout, 1 |
//! | 6..8 | 0 |
//! | 8..12 | length of the image, bytes |
//! | 12..16 | sequence number: the newer image has the higher number, modulo 2³² |
//! | 16..28 | 0 |
//! | 28..32 | CRC-32 (ISO-HDLC) of bytes 0..28 and of all words after them |
//! | 32.. | the image; the remaining bytes of its last word are 0xFF |
//!
//! The header is written last, so a slot has no header if the write was interrupted. If the power fails, a word that was being programmed,
//! or a sector that was being erased, may contain any data. The CRC detects such data. All numbers in the header are little-endian.
//!
//! This module does not access hardware. [`Storing`] returns the next action, and the owner of the flash executes this action. A flash word
//! can be programmed only once after each erase. [`Storing`] programs each word once.
use core::cmp::Ordering;

use crc::{CRC_32_ISO_HDLC, Crc, Table};

pub use jtc_wire::IMAGE_MAX;

/// Number of bytes that the flash of the STM32H7 programs at once.
pub const WORD: usize = 32;
/// Number of slots.
pub const SLOTS: usize = 2;

/// Unit in which the flash is programmed.
pub type Word = [u8; WORD];

const MAGIC: [u8; 4] = *b"JTCA";
const VERSION: u16 = 1;
/// Byte value of erased flash. The byte of erased flash also fills the last word of an image.
const ERASED: u8 = 0xFF;

static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

const _: () = assert!(IMAGE_MAX.is_multiple_of(WORD), "a buffer of IMAGE_MAX takes whole words");

/// Header of a slot, which is its first word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    length: u32,
    sequence: u32,
    crc: u32,
}

impl Header {
    /// Creates the header for this image. Returns `None` if the image is longer than [`IMAGE_MAX`].
    pub fn new(image: &[u8], sequence: u32) -> Option<Self> {
        let length = u32::try_from(image.len()).ok().filter(|_| image.len() <= IMAGE_MAX)?;
        let header = Self { length, sequence, crc: 0 };
        let mut digest = CRC.digest();
        digest.update(&header.checked_bytes());
        let words = image.chunks(WORD).map(padded);
        words.for_each(|word| digest.update(&word));
        Some(Self { crc: digest.finalize(), ..header })
    }

    /// Parses a word as a header. [`Header::accepts`] decides whether the slot with this header is complete.
    pub fn parse(word: &Word) -> Option<Self> {
        let field = |at: usize| Some(u32::from_le_bytes(*word.get(at..)?.first_chunk()?));
        let header = Self { length: field(8)?, sequence: field(12)?, crc: field(28)? };
        (header.length as usize <= IMAGE_MAX && header.emit() == *word).then_some(header)
    }

    /// Returns the bytes of the header.
    pub fn emit(&self) -> Word {
        let mut word = [0; WORD];
        let fields = self.checked_bytes().into_iter().chain(self.crc.to_le_bytes());
        word.iter_mut().zip(fields).for_each(|(to, from)| *to = from);
        word
    }

    /// Returns the bytes of the header before the CRC.
    fn checked_bytes(&self) -> [u8; 28] {
        let mut bytes = [0; 28];
        let [version, length, sequence] =
            [u32::from(VERSION), self.length, self.sequence].map(u32::to_le_bytes);
        let fields = [MAGIC, version, length, sequence];
        bytes.iter_mut().zip(fields.iter().flatten()).for_each(|(to, from)| *to = *from);
        bytes
    }

    /// Returns the number of bytes of the image.
    pub fn length(&self) -> usize {
        self.length as usize
    }

    /// Returns the sequence number of the image.
    pub fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Returns the number of words in the slot, including the header.
    pub fn words(&self) -> usize {
        1 + self.length().div_ceil(WORD)
    }

    /// Returns the image if the words in `rest` match the header. `rest` begins with the first word after the header.
    pub fn accepts<'a>(&self, rest: &'a [u8]) -> Option<&'a [u8]> {
        let words = rest.get(..(self.words() - 1) * WORD)?;
        let mut digest = CRC.digest();
        digest.update(&self.checked_bytes());
        digest.update(words);
        words.get(..self.length()).filter(|_| digest.finalize() == self.crc)
    }
}

/// Returns a word of an image. The last word is filled up with erased bytes.
fn padded(bytes: &[u8]) -> Word {
    let mut word = [ERASED; WORD];
    word.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
    word
}

/// Returns `true` if image `a` is newer than image `b` by their sequence numbers, which wrap around after 2³² − 1.
pub fn newer(a: u32, b: u32) -> bool {
    (a.wrapping_sub(b).cast_signed()).cmp(&0) == Ordering::Greater
}

/// State of the slots: the sequence number of each complete slot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slots([Option<u32>; SLOTS]);

impl Slots {
    /// Creates the state of the slots from the sequence numbers in the flash.
    pub const fn new(found: [Option<u32>; SLOTS]) -> Self {
        Self(found)
    }

    /// Returns the slot and the sequence number of the newest image. Returns `None` if no slot is complete.
    pub fn current(&self) -> Option<(usize, u32)> {
        match self.0 {
            [Some(a), Some(b)] if newer(b, a) => Some((1, b)),
            [Some(a), _] => Some((0, a)),
            [None, Some(b)] => Some((1, b)),
            [None, None] => None,
        }
    }

    /// Returns the slot and the sequence number for the next image. The slot for the next image never contains the newest image.
    pub fn next(&self) -> (usize, u32) {
        self.current().map_or((0, 1), |(slot, sequence)| (1 - slot, sequence.wrapping_add(1)))
    }

    fn set(&mut self, slot: usize, sequence: Option<u32>) {
        if let Some(known) = self.0.get_mut(slot) {
            *known = sequence;
        }
    }
}

/// Next action on the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Erase the slot.
    Erase {
        /// Number of the slot to erase.
        slot: usize,
    },
    /// Program a word, read the word back and compare it.
    Program {
        /// Number of the slot to program.
        slot: usize,
        /// Index of the word in the slot. The header has the index 0.
        word: usize,
        /// Content of the word to program.
        bytes: Word,
    },
    /// No further action is needed, because the image is stored and can be found.
    Stored,
}

/// State of an image that is being written into its slot.
///
/// ```
/// use jtc_core::slots::{Action, Header, Slots, Storing, WORD};
/// let image = b"an arm";
/// let mut slots = Slots::default();
/// let mut flash = [[0xFF; WORD]; 2];
/// let mut storing = Storing::begin(&mut slots, image).unwrap();
/// loop {
///     match storing.action(image) {
///         Action::Erase { .. } => flash.fill([0xFF; WORD]),
///         Action::Program { word, bytes, .. } => flash[word] = bytes,
///         Action::Stored => break,
///     }
///     storing.done();
/// }
/// storing.finish(&mut slots);
/// assert_eq!(slots.current(), Some((0, 1)));
/// let header = Header::parse(&flash[0]).unwrap();
/// assert_eq!(header.accepts(&flash[1]), Some(&image[..]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Storing {
    slot: usize,
    header: Header,
    /// Number of completed actions. The first action erases the slot, and each further action programs one word.
    done: usize,
}

impl Storing {
    /// Begins to store an image. Returns `None` if the image is longer than [`IMAGE_MAX`]. After this call, the old content of the slot is
    /// considered lost.
    pub fn begin(slots: &mut Slots, image: &[u8]) -> Option<Self> {
        let (slot, sequence) = slots.next();
        let header = Header::new(image, sequence)?;
        slots.set(slot, None);
        Some(Self { slot, header, done: 0 })
    }

    /// Returns the next action on the flash. `image` must be the image that was passed to [`begin`](Self::begin).
    pub fn action(&self, image: &[u8]) -> Action {
        let slot = self.slot;
        let Some(before) = self.done.checked_sub(1) else { return Action::Erase { slot } };
        let words = self.header.words();
        // The words of the image are programmed first, followed by the header.
        match before + 1 {
            word if word < words => {
                let at = before * WORD;
                Action::Program { slot, word, bytes: padded(image.get(at..).unwrap_or(&[])) }
            }
            word if word == words => Action::Program { slot, word: 0, bytes: self.header.emit() },
            _ => Action::Stored,
        }
    }

    /// Marks the present action as completed. The caller must have read a programmed word back and compared it before this call.
    pub fn done(&mut self) {
        self.done = self.done.saturating_add(1).min(self.header.words() + 1);
    }

    /// Returns the slot, and the sequence number of the image that is written into the slot.
    pub fn target(&self) -> (usize, u32) {
        (self.slot, self.header.sequence)
    }

    /// Records the new image in `slots` if every action is completed. If an action is missing, the call has no effect.
    pub fn finish(&self, slots: &mut Slots) {
        if self.done > self.header.words() {
            slots.set(self.slot, Some(self.header.sequence));
        }
    }
}

#[cfg(test)]
mod tests;
