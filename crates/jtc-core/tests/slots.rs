//! Tests of the two flash slots with a simulated flash (J-54). The power can fail before, during and after the programming of any word.
use jtc_core::slots::{Action, Header, IMAGE_MAX, SLOTS, Slots, Storing, WORD, Word, newer};
use proptest::prelude::*;

const WORDS: usize = 1 + IMAGE_MAX / WORD;
const ERASED: Word = [0xFF; WORD];

/// State of a flash word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    /// The word is erased and can be programmed.
    Erased,
    /// The word was programmed, completely or in part.
    Holds(Word),
    /// The word has more wrong bits than the flash can correct, so that a read is an error.
    Unreadable,
}

/// Simulated flash memory with the two slots.
#[derive(Clone)]
struct Flash([Vec<Cell>; SLOTS]);

impl Flash {
    fn new() -> Self {
        Self([const { Vec::new() }; SLOTS].map(|_: Vec<Cell>| vec![Cell::Erased; WORDS]))
    }

    fn read(&self, slot: usize, word: usize) -> Option<Word> {
        match self.0[slot][word] {
            Cell::Erased => Some(ERASED),
            Cell::Holds(bytes) => Some(bytes),
            Cell::Unreadable => None,
        }
    }

    /// Returns the image and the sequence number in a slot, if the slot is complete.
    fn load(&self, slot: usize) -> Option<(Vec<u8>, u32)> {
        let header = Header::parse(&self.read(slot, 0)?)?;
        let words: Option<Vec<Word>> = (1..header.words()).map(|word| self.read(slot, word)).collect();
        let image = header.accepts(words?.as_flattened())?.to_vec();
        Some((image, header.sequence()))
    }

    /// Reads the state of the slots, as the board does when it starts.
    fn slots(&self) -> Slots {
        Slots::new([0, 1].map(|slot| self.load(slot).map(|(_, sequence)| sequence)))
    }

    /// Returns the image that the board would use.
    fn current(&self) -> Option<Vec<u8>> {
        self.slots().current().and_then(|(slot, _)| self.load(slot)).map(|(image, _)| image)
    }

    fn perform(&mut self, action: &Action) {
        match *action {
            Action::Erase { slot } => self.0[slot].fill(Cell::Erased),
            Action::Program { slot, word, bytes } => {
                assert_eq!(self.0[slot][word], Cell::Erased, "a word is programmed once after it was erased");
                self.0[slot][word] = Cell::Holds(bytes);
                assert_eq!(self.read(slot, word), Some(bytes));
            }
            Action::Stored => {}
        }
    }

    /// Simulates a loss of power in the middle of an action on the flash.
    fn torn(&mut self, action: &Action, rng: &mut Chance) {
        match *action {
            // After the loss of power, some words are erased, some are not erased, and some are erased in part.
            Action::Erase { slot } => {
                for cell in &mut self.0[slot] {
                    let before = match cell {
                        Cell::Holds(bytes) => *bytes,
                        _ => ERASED,
                    };
                    *cell = match rng.below(4) {
                        0 => Cell::Erased,
                        1 => *cell,
                        2 => Cell::Unreadable,
                        _ => Cell::Holds(before.map(|byte| byte | rng.byte())),
                    };
                }
            }
            Action::Program { slot, word, bytes } => {
                self.0[slot][word] = match rng.below(5) {
                    0 => Cell::Erased,
                    1 => Cell::Unreadable,
                    2 => Cell::Holds(bytes.map(|byte| byte | rng.byte())),
                    3 => Cell::Holds(bytes),
                    _ => Cell::Holds(ERASED.map(|_| rng.byte())),
                }
            }
            Action::Stored => {}
        }
    }

    fn store(&mut self, image: &[u8]) {
        let mut slots = self.slots();
        let mut storing = Storing::begin(&mut slots, image).expect("not too long");
        while storing.action(image) != Action::Stored {
            self.perform(&storing.action(image));
            storing.done();
        }
        storing.finish(&mut slots);
        assert_eq!(slots, self.slots(), "what is remembered is what a start would find");
        assert_eq!(slots.current(), Some(storing.target()));
    }
}

/// Generator of small pseudo-random numbers from a seed (xorshift).
struct Chance(u64);

impl Chance {
    fn byte(&mut self) -> u8 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 32) as u8
    }

    fn below(&mut self, n: u8) -> u8 {
        self.byte() % n
    }
}

fn image(n: usize, seed: u64) -> Vec<u8> {
    let mut rng = Chance(seed * 2 + 1);
    (0..n).map(|_| rng.byte()).collect()
}

/// The test stores many images. After each store, the board must find this image, and the previous image must stay in
/// the other slot.
#[test]
fn j54_the_newest_image_is_found() {
    let mut flash = Flash::new();
    assert_eq!(flash.current(), None, "new flash holds none");
    let lengths = [1, 0, 31, 32, 33, 5000, IMAGE_MAX, 64];
    for (n, length) in lengths.into_iter().enumerate() {
        let new = image(length, n as u64);
        let before = flash.current();
        flash.store(&new);
        assert_eq!(flash.current().as_deref(), Some(&new[..]), "{length} bytes");
        let (slot, sequence) = flash.slots().current().expect("stored");
        assert_eq!((slot, sequence), (n % 2, n as u32 + 1), "the slots take turns");
        assert_eq!(flash.load(1 - slot).map(|(image, _)| image), before);
    }
}

#[test]
fn an_image_that_is_too_long_changes_nothing() {
    let mut slots = Slots::new([Some(3), Some(2)]);
    assert!(Storing::begin(&mut slots, &vec![0; IMAGE_MAX + 1]).is_none());
    assert_eq!(slots, Slots::new([Some(3), Some(2)]));
}

/// J-54: the CRC covers every bit of a slot. If one bit is wrong, the slot is not complete, and the board uses the other slot.
#[test]
fn j54_no_wrong_bit_is_accepted() {
    for length in [0, 1, 40, 300] {
        let (old, new) = (image(77, 1), image(length, 2));
        let mut flash = Flash::new();
        flash.store(&old);
        flash.store(&new);
        for word in 0..1 + length.div_ceil(WORD) {
            for bit in 0..8 * WORD {
                let mut bytes = flash.read(1, word).expect("readable");
                bytes[bit / 8] ^= 1 << (bit % 8);
                let mut flash = flash.clone();
                flash.0[1][word] = Cell::Holds(bytes);
                assert_eq!(flash.load(1), None, "bit {bit} of word {word}");
                assert_eq!(flash.current().as_deref(), Some(&old[..]), "bit {bit} of word {word}");
            }
        }
    }
}

/// J-54: the power fails before, during and after every action on the flash, both during the first stores and during later stores. After
/// the loss of power, the old or the new image is complete, and the next store works normally.
#[test]
fn j54_a_power_cut_leaves_one_whole_image() {
    for (stores, length) in [(0, 200), (1, 200), (2, 200), (3, 333), (4, 0), (5, 2000), (1, IMAGE_MAX)] {
        let mut start = Flash::new();
        (0..stores).for_each(|n| start.store(&image(100 + 50 * n as usize, n)));
        let (old, new, third) = (start.current(), image(length, 99), image(500, 98));
        assert_eq!(old.is_none(), stores == 0);
        let mut flash = start.clone();
        let mut slots = flash.slots();
        let mut storing = Storing::begin(&mut slots, &new).expect("not too long");
        let cut = |mut flash: Flash, what: &str, n: usize| {
            let found = flash.current();
            let expected = [old.clone(), Some(new.clone())];
            assert!(expected.contains(&found), "{what} action {n} of store {stores} with {length} bytes");
            flash.store(&third);
            assert_eq!(flash.current().as_deref(), Some(&third[..]), "after {what} action {n}");
            found.as_ref() == Some(&new)
        };
        for n in 0.. {
            let action = storing.action(&new);
            assert_eq!(
                cut(flash.clone(), "before", n),
                action == Action::Stored,
                "new only when all is there"
            );
            if action == Action::Stored {
                break;
            }
            for seed in 0..if length > 1000 { 4 } else { 40 } {
                let mut torn = flash.clone();
                torn.torn(&action, &mut Chance(1 + seed * 7919 + n as u64));
                cut(torn, "in", n);
            }
            flash.perform(&action);
            storing.done();
        }
    }
}

/// If both slots are damaged, no image exists, and the next store creates an image.
#[test]
fn j54_two_damaged_slots_are_no_image() {
    let mut flash = Flash::new();
    flash.store(&image(100, 1));
    flash.store(&image(200, 2));
    flash.0[0][2] = Cell::Unreadable;
    flash.0[1][0] = Cell::Unreadable;
    assert_eq!((flash.current(), flash.slots()), (None, Slots::default()));
    flash.store(&image(300, 3));
    assert_eq!(flash.current(), Some(image(300, 3)));
    assert_eq!(flash.slots().current(), Some((0, 1)));
}

/// The header is programmed last. The CRC alone would also detect an incomplete slot, but the board does not need to
/// compute the CRC of a slot without a header.
#[test]
fn the_header_is_programmed_last() {
    let image = image(100, 1);
    let mut storing = Storing::begin(&mut Slots::default(), &image).expect("short");
    let mut actions = Vec::new();
    while actions.last() != Some(&None) {
        actions.push(match storing.action(&image) {
            Action::Erase { .. } => Some(usize::MAX),
            Action::Program { word, .. } => Some(word),
            Action::Stored => None,
        });
        storing.done();
    }
    assert_eq!(actions, [Some(usize::MAX), Some(1), Some(2), Some(3), Some(4), Some(0), None]);
}

#[test]
fn sequence_numbers_begin_again() {
    for (a, b) in [(1, 0), (0, u32::MAX), (5, u32::MAX - 5), (0x8000_0000, 1), (0x7FFF_FFFF, 0)] {
        assert!(newer(a, b) && !newer(b, a), "{a:#x} is newer than {b:#x}");
    }
    assert!(!newer(7, 7));
    let slots = Slots::new([Some(u32::MAX), Some(u32::MAX - 1)]);
    assert_eq!((slots.current(), slots.next()), (Some((0, u32::MAX)), (1, 0)));
    let slots = Slots::new([Some(u32::MAX), Some(0)]);
    assert_eq!((slots.current(), slots.next()), (Some((1, 0)), (0, 1)));
    assert_eq!((Slots::default().current(), Slots::default().next()), (None, (0, 1)));
    assert_eq!(Slots::new([None, Some(9)]).next(), (0, 10));
    assert_eq!(Slots::new([Some(9), None]).next(), (1, 10));
}

/// The test compares the header with bytes of the documented layout. The CRC of these bytes was computed independently (Python's
/// `zlib.crc32`).
#[test]
fn the_header_is_the_documented_one() {
    let header = Header::new(b"arm", 0x0102_0304).expect("short").emit();
    assert_eq!(&header[..8], b"JTCA\x01\0\0\0");
    assert_eq!(header[8..16], [3, 0, 0, 0, 4, 3, 2, 1]);
    assert_eq!(header[16..28], [0; 12]);
    assert_eq!(u32::from_le_bytes(header[28..].try_into().expect("four")), CRC_OF_PYTHON);
}

const CRC_OF_PYTHON: u32 = 0x26B4_110F;

proptest! {
    /// Loading does not panic for any content of the flash, and does not accept an image that was not stored.
    #[test]
    fn garbage_is_no_image(words in prop::collection::vec(any::<[u8; WORD]>(), 1..20), length in 0..700u32) {
        let mut flash = Flash::new();
        for (cell, word) in flash.0[0].iter_mut().zip(&words) {
            *cell = Cell::Holds(*word);
        }
        prop_assert_eq!(flash.current(), None);
        // The header in this flash is valid except for its CRC.
        let mut header = Header::new(&[], 5).expect("short").emit();
        header[8..12].copy_from_slice(&length.to_le_bytes());
        header[28..].copy_from_slice(&words[0][..4]);
        flash.0[0][0] = Cell::Holds(header);
        prop_assert_eq!(flash.current(), None);
    }

    /// The sequence number of the next image must be newer than the number of the present image. The present image
    /// stays in use until every action of the next image is completed.
    #[test]
    fn the_next_sequence_number_is_the_newest(found in any::<[Option<u32>; SLOTS]>()) {
        let mut slots = Slots::new(found);
        let before = slots.current();
        let storing = Storing::begin(&mut slots, b"x").expect("short");
        let (slot, sequence) = storing.target();
        prop_assert_eq!(slots.current(), before, "what is in use stays in use");
        if let Some((old, number)) = before {
            prop_assert_ne!(slot, old);
            prop_assert!(newer(sequence, number));
        }
        storing.finish(&mut slots);
        prop_assert_eq!(slots.current(), before, "not before it is done");
    }
}
