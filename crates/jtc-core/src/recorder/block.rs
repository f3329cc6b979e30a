//! Format of a block in the flight recorder's memory (J-56).
//!
//! A block has a head of [`HEAD`] words, followed by bits. The *commit* word of a block contains the number of bits and the check value of
//! the bits. The commit word is written last, once per tick. Bits after the committed bits are ignored, because an interrupted tick may
//! have written them. If the memory was never written or is damaged, the check value is wrong, and the memory does not count as a block.
use jtc_wire::LogState;

use super::{BLOCK_WORDS, Block};

/// "JF" in ASCII, and the version of the layout. Increase this version with each change of the recorded data,
/// including each change of a list in `bit_codec!`.
pub(super) const MAGIC: u32 = 0x4A46_000A;
/// Number of words in the head of a block.
pub(super) const HEAD: usize = 5;
/// Number of bits that a block can contain after its head.
pub(super) const BITS: u32 = ((BLOCK_WORDS - HEAD) * 32) as u32;

/// Indices of the words in the head of a block.
pub(super) mod head {
    pub(crate) const MAGIC: usize = 0;
    /// Number of the block.
    pub(crate) const SEQUENCE: usize = 1;
    /// Number of bits (low half) and check value of the bits.
    pub(crate) const COMMIT: usize = 2;
    /// Bit at which the first snapshot of the block starts (low half), and the complement of this number. The bit number is [`super::NONE`]
    /// if no snapshot starts in the block.
    pub(crate) const SNAPSHOT: usize = 3;
    /// State of the log (low half), and the complement of this number.
    pub(crate) const FLAGS: usize = 4;
}

/// Value for a block in which no snapshot begins.
pub(super) const NONE: u16 = 0xFFFF;

/// Flag: the controller has had torque since the log began.
pub(super) const POWERED: u16 = 0x100;
/// Flag: the next block continues this block.
pub(super) const CLOSED: u16 = 0x200;

/// Returns a word with the number in the low half and its complement in the high half.
pub(super) const fn doubled(value: u16) -> u32 {
    value as u32 | (!value as u32) << 16
}

/// Returns the number in the low half if the high half is its complement.
fn halved(word: u32) -> Option<u16> {
    let value = word as u16;
    (doubled(value) == word).then_some(value)
}

pub(super) fn mix(hash: u32, word: u32) -> u32 {
    (hash ^ word).wrapping_mul(0x0100_0193).rotate_left(7)
}

/// Returns the commit word for this number of `bits`. `rest` contains the bits of the last, incomplete word.
pub(super) fn commit(hash: u32, rest: u32, bits: u32) -> u32 {
    let hash = mix(hash, rest);
    bits | (hash ^ hash << 16) & 0xFFFF_0000
}

/// Block in the memory with a valid head and valid bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Whole<'a> {
    pub sequence: u32,
    /// Number of committed bits.
    pub bits: u32,
    /// `true` if the next block continues the bits of this block.
    pub closed: bool,
    /// Bit at which the first snapshot of the block starts.
    pub snapshot: Option<u32>,
    pub state: LogState,
    pub powered: bool,
    pub words: &'a [u32],
}

impl<'a> Whole<'a> {
    /// Parses a block. Returns `None` if the memory does not contain a valid block.
    pub(super) fn parse(block: &'a Block) -> Option<Self> {
        let (head, words) = block.split_first_chunk::<HEAD>()?;
        let bits = head[head::COMMIT] & 0xFFFF;
        if head[head::MAGIC] != MAGIC || bits > BITS {
            return None;
        }
        let (snapshot, flags) = (halved(head[head::SNAPSHOT])?, halved(head[head::FLAGS])?);
        let state = LogState::from_byte(flags as u8)?;
        let (full, rest) = (bits as usize / 32, bits % 32);
        let begin = mix(MAGIC, head[head::SEQUENCE]);
        let hash = words.iter().take(full).fold(begin, |hash, word| mix(hash, *word));
        let last = words.get(full).map_or(0, |word| word & ((1 << rest) - 1));
        if commit(hash, last, bits) != head[head::COMMIT] {
            return None;
        }
        let snapshot = (snapshot != NONE && u32::from(snapshot) < bits).then_some(snapshot.into());
        let (sequence, closed, powered) = (head[head::SEQUENCE], flags & CLOSED != 0, flags & POWERED != 0);
        Some(Self { sequence, bits, closed, snapshot, state, powered, words })
    }
}

/// Creates a block with these bits in the recorder's format, for tests of programs that read a log.
#[doc(hidden)]
pub fn sealed_block(sequence: u32, snapshot: u16, bits: &[u32]) -> Block {
    let mut block = [0; BLOCK_WORDS];
    let count = bits.len().min(BLOCK_WORDS - HEAD);
    for (to, word) in block.iter_mut().skip(HEAD).zip(bits) {
        *to = *word;
    }
    let hash = bits.iter().take(count).fold(mix(MAGIC, sequence), |hash, word| mix(hash, *word));
    block[head::MAGIC] = MAGIC;
    block[head::SEQUENCE] = sequence;
    block[head::COMMIT] = commit(hash, 0, 32 * count as u32);
    block[head::SNAPSHOT] = doubled(snapshot);
    block[head::FLAGS] = doubled(flags(LogState::Error, true) | CLOSED);
    block
}

pub(super) fn flags(state: LogState, powered: bool) -> u16 {
    state as u16 | if powered { POWERED } else { 0 }
}

/// Returns `true` if the head of the block contains this number. The function does not check the content of the block.
pub(super) fn in_place(block: &Block, sequence: u32) -> bool {
    block[head::MAGIC] == MAGIC && block[head::SEQUENCE] == sequence
}
