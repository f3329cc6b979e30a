//! Reads back the bits of consecutive blocks.
use super::Block;
use super::block::Whole;
use crate::bit_codec::BitSource;

/// Reader of the bits of consecutive blocks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reader<'a> {
    blocks: &'a [Block],
    /// Index of the present block in the list. `bit` is the index of the next bit in this block.
    block: usize,
    bit: u32,
    current: Option<Whole<'a>>,
    damaged: bool,
}

impl<'a> Reader<'a> {
    /// Creates a reader that begins at bit `bit` of the first block in `blocks`.
    pub(super) fn new(blocks: &'a [Block], bit: u32) -> Self {
        let current = blocks.first().and_then(Whole::parse);
        Self { blocks, block: 0, bit, current, damaged: false }
    }

    /// Moves the reader to the next whole word.
    pub(super) fn align(&mut self) {
        self.bit = self.bit.next_multiple_of(32);
    }

    /// Returns the next bit without consuming it.
    pub(super) fn peek(&self) -> bool {
        self.clone().take(1) != 0
    }

    /// Returns the index of the present block in the list.
    pub(super) fn block(&self) -> usize {
        self.block
    }

    /// Returns `true` if no bits remain, or if the next block does not continue the present block.
    pub(super) fn at_end(&mut self) -> bool {
        self.advance();
        self.current.is_none_or(|whole| self.bit >= whole.bits)
    }

    /// Moves to the next block if all bits of the present block were read and the next block continues the present block.
    fn advance(&mut self) {
        let Some(whole) = self.current else { return };
        if self.bit < whole.bits || !whole.closed {
            return;
        }
        let next = self.blocks.get(self.block + 1).and_then(Whole::parse);
        if let Some(next) = next.filter(|next| next.sequence == whole.sequence.wrapping_add(1)) {
            (self.current, self.block, self.bit) = (Some(next), self.block + 1, 0);
        }
    }
}

impl BitSource for Reader<'_> {
    fn take(&mut self, bits: u32) -> u32 {
        let (mut value, mut got) = (0u64, 0);
        while got < bits {
            if self.at_end() {
                self.damaged = true;
                return 0;
            }
            let Some(whole) = self.current else { return 0 };
            let (word, at) = ((self.bit / 32) as usize, self.bit % 32);
            let here = (bits - got).min(32 - at).min(whole.bits - self.bit);
            let word = u64::from(whole.words.get(word).copied().unwrap_or(0));
            value |= ((word >> at) & ((1 << here) - 1)) << got;
            (self.bit, got) = (self.bit + here, got + here);
        }
        value as u32
    }

    fn damage(&mut self) {
        self.damaged = true;
    }

    fn is_damaged(&self) -> bool {
        self.damaged
    }
}
