//! The contents of flash bank 2, and how a power loss during an operation changes these contents.
use std::fmt;

use super::OperationKind;

/// First address of flash bank 2.
pub const BANK2: u32 = 0x0810_0000;
/// Size of flash bank 2 in bytes.
pub const BANK2_SIZE: u32 = 0x10_0000;
/// Number of bytes that the flash programs together.
pub const WORD: usize = 32;
const WORDS: usize = BANK2_SIZE as usize / WORD;
/// Number of words per sector.
const SECTOR_WORDS: usize = 128 * 1024 / WORD;
/// State of a flash word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    /// All bits of the word are 1, and the program can program the word.
    Erased,
    /// The word contains data and cannot be programmed again.
    Programmed,
    /// A read of the word causes an error.
    Unreadable,
}

/// Contents of flash bank 2, which survive a loss of power.
#[derive(Clone, PartialEq, Eq)]
pub struct Bank2 {
    pub(super) bytes: Vec<[u8; WORD]>,
    pub(super) cells: Vec<Cell>,
}

impl Default for Bank2 {
    fn default() -> Self {
        Self { bytes: vec![[0xFF; WORD]; WORDS], cells: vec![Cell::Erased; WORDS] }
    }
}

impl fmt::Debug for Bank2 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |cell| self.cells.iter().filter(|c| **c == cell).count();
        write!(f, "{} words programmed, {} unreadable", count(Cell::Programmed), count(Cell::Unreadable))
    }
}

impl Bank2 {
    /// Creates a bank that begins with these bytes, as returned by [`Self::bytes`]. If all bits of a word are 1, the
    /// word is erased. No word is unreadable. Bytes beyond the bank are ignored.
    pub fn from_bytes(bytes: &[u8]) -> Self {
        let mut bank = Self::default();
        for (n, word) in bytes
            .chunks(WORD)
            .take(WORDS)
            .enumerate()
            .filter(|(_, word)| word.iter().any(|byte| *byte != 0xFF))
        {
            bank.put(BANK2 + (n * WORD) as u32, word);
        }
        bank
    }

    /// Returns the bytes at an address, ignoring read errors.
    pub fn bytes(&self, address: u32, length: usize) -> Vec<u8> {
        let at = (address - BANK2) as usize;
        self.bytes.as_flattened()[at..at + length].to_vec()
    }

    /// Overwrites the bytes at an address, regardless of the old contents. After this call, the state of the words is
    /// "programmed".
    pub fn put(&mut self, address: u32, bytes: &[u8]) {
        let at = (address - BANK2) as usize;
        self.bytes.as_flattened_mut()[at..at + bytes.len()].copy_from_slice(bytes);
        self.cells[at / WORD..(at + bytes.len()).div_ceil(WORD)].fill(Cell::Programmed);
    }

    /// Makes the word at an address unreadable.
    pub fn damage(&mut self, address: u32) {
        self.cells[(address - BANK2) as usize / WORD] = Cell::Unreadable;
    }

    /// Simulates a loss of power during a flash operation. Afterwards, the affected words may have any value or may
    /// be unreadable.
    pub fn tear(&mut self, kind: OperationKind, word: &[u8; WORD], rng: &mut fastrand::Rng) {
        match kind {
            OperationKind::Erase { sector } => {
                for n in sector * SECTOR_WORDS..(sector + 1) * SECTOR_WORDS {
                    match rng.u8(..4) {
                        0 => self.erase(n),
                        1 => {}
                        2 => self.cells[n] = Cell::Unreadable,
                        _ => self.bytes[n].iter_mut().for_each(|byte| *byte |= rng.u8(..)),
                    }
                }
            }
            OperationKind::Program { address } => {
                let n = (address - BANK2) as usize / WORD;
                self.cells[n] = Cell::Programmed;
                match rng.u8(..5) {
                    0 => self.erase(n),
                    1 => self.cells[n] = Cell::Unreadable,
                    2 => self.bytes[n] = *word,
                    3 => self.bytes[n] = word.map(|byte| byte | rng.u8(..)),
                    _ => rng.fill(&mut self.bytes[n]),
                }
            }
        }
    }

    /// Erases a complete sector.
    pub fn erase_sector(&mut self, sector: usize) {
        (sector * SECTOR_WORDS..(sector + 1) * SECTOR_WORDS).for_each(|n| self.erase(n));
    }

    /// Programs a word. If the word was not erased before, the word becomes unreadable and the function returns
    /// `false`.
    pub fn program(&mut self, n: usize, bytes: &[u8; WORD]) -> bool {
        let erased = self.cells[n] == Cell::Erased;
        self.bytes[n].iter_mut().zip(bytes).for_each(|(old, new)| *old &= new);
        self.cells[n] = if erased { Cell::Programmed } else { Cell::Unreadable };
        erased
    }

    fn erase(&mut self, n: usize) {
        self.bytes[n] = [0xFF; WORD];
        self.cells[n] = Cell::Erased;
    }
}
