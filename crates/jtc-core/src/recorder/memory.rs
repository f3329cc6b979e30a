//! Memory of the flight recorder, which is a ring of blocks. The blocks stay readable even if a reset interrupts the recorder while it
//! writes (J-56).
use core::sync::atomic::{Ordering, compiler_fence};

use jtc_wire::LogState;

use super::block::{CLOSED, HEAD, MAGIC, NONE, Whole, commit, doubled, flags, head, in_place, mix};
use super::{BLOCK_WORDS, Block};
use crate::bit_codec::BitSink;

/// Position of a block in the memory.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    piece: usize,
    block: usize,
}

/// Memory that consists of one or more pieces and is used as a single ring.
pub(super) struct Ring<P, const N: usize> {
    pieces: [P; N],
}

impl<P: AsRef<[Block]> + AsMut<[Block]>, const N: usize> Ring<P, N> {
    fn len(&self) -> u32 {
        self.pieces.iter().map(|piece| piece.as_ref().len() as u32).sum()
    }

    /// Returns the block with this number.
    fn block(&self, sequence: u32) -> Option<&Block> {
        let mut at = sequence.checked_rem(self.len())? as usize;
        for piece in &self.pieces {
            match piece.as_ref().get(at) {
                Some(block) => return Some(block),
                None => at -= piece.as_ref().len(),
            }
        }
        None
    }

    /// Returns the place of the block with this number: the piece and the index of the block in that piece.
    fn place(&self, sequence: u32) -> Place {
        let mut at = sequence.checked_rem(self.len()).unwrap_or(0) as usize;
        for (piece, blocks) in self.pieces.iter().enumerate() {
            let len = blocks.as_ref().len();
            if at < len {
                return Place { piece, block: at };
            }
            at -= len;
        }
        Place { piece: N, block: 0 }
    }

    #[inline]
    fn at_mut(&mut self, place: Place) -> Option<&mut Block> {
        self.pieces.get_mut(place.piece)?.as_mut().get_mut(place.block)
    }

    /// Returns the block with this number if it exists and is valid.
    fn whole(&self, sequence: u32) -> Option<Whole<'_>> {
        self.block(sequence).and_then(Whole::parse).filter(|whole| whole.sequence == sequence)
    }

    /// Returns the number of the newest block.
    fn newest(&self) -> Option<u32> {
        // After a reset, the drives wait for the first frame until this loop has ended. The memory is slow, so the
        // loop reads only the heads of the blocks.
        let mut below = None;
        for _ in 0..self.len() {
            let blocks = self.pieces.iter().flat_map(|piece| piece.as_ref());
            let numbers =
                blocks.filter(|block| block[head::MAGIC] == MAGIC).map(|block| block[head::SEQUENCE]);
            let next = numbers.filter(|number| below.is_none_or(|below| *number < below)).max()?;
            // The newest block must be valid, and must be at the place that belongs to its number. Blocks at other
            // places may remain from a log in a memory of another size.
            if self.whole(next).is_some() {
                return Some(next);
            }
            below = Some(next);
        }
        None
    }

    fn wipe(&mut self) {
        for block in self.pieces.iter_mut().flat_map(|piece| piece.as_mut()) {
            block[head::MAGIC] = 0;
        }
    }
}

/// Writer of bits into the ring of blocks.
pub(super) struct Writer<P, const N: usize> {
    ring: Ring<P, N>,
    /// Number of the open block. `None` before the first block is opened.
    open: Option<u32>,
    /// Place of the open block.
    place: Place,
    /// Number of the next block.
    next: u32,
    /// `true` if the head of the open block has been written.
    begun: bool,
    /// Index of the word of the open block that is filled next. `rest` contains the first `fill` bits of this word.
    word: usize,
    rest: u32,
    fill: u32,
    hash: u32,
    /// `true` if a snapshot begins in the open block.
    marked: bool,
    pub state: LogState,
    pub powered: bool,
}

impl<P: AsRef<[Block]> + AsMut<[Block]>, const N: usize> Writer<P, N> {
    /// Creates a writer, for any content of the memory.
    pub(super) fn new(pieces: [P; N]) -> Self {
        let ring = Ring { pieces };
        let newest = ring.newest();
        let (state, powered) = newest
            .and_then(|sequence| ring.whole(sequence))
            .map_or((LogState::Recording, false), |whole| (whole.state, whole.powered));
        let mut writer = Self {
            ring,
            open: newest,
            place: Place::default(),
            next: newest.map_or(0, |newest| newest.wrapping_add(1)),
            begun: true,
            word: HEAD,
            rest: 0,
            fill: 0,
            hash: 0,
            marked: false,
            state,
            powered,
        };
        writer.place = writer.ring.place(newest.unwrap_or(0));
        writer
    }

    pub(super) fn into_memory(self) -> [P; N] {
        self.ring.pieces
    }

    pub(super) fn memory(&self) -> &[P; N] {
        &self.ring.pieces
    }

    /// Returns the block with this number.
    pub(super) fn block(&self, sequence: u32) -> Option<&Block> {
        self.ring.block(sequence)
    }

    /// Returns `true` if the memory does not contain a log.
    pub(super) fn is_empty(&self) -> bool {
        self.open.is_none()
    }

    /// Discards all blocks of the log.
    pub(super) fn clear(&mut self) {
        self.ring.wipe();
        (self.open, self.state, self.powered) = (None, LogState::Recording, false);
    }

    /// Begins a new block, which starts with a snapshot.
    pub(super) fn begin(&mut self) {
        self.open_block();
    }

    /// Records that a snapshot starts at the present bit. Until the snapshot is committed, this record points after the committed bits and
    /// is ignored.
    pub(super) fn mark_snapshot(&mut self) {
        if !self.marked {
            self.marked = true;
            let at = self.bits() as u16;
            self.set_head(head::SNAPSHOT, doubled(at));
        }
    }

    /// Records that the controller has torque.
    pub(super) fn set_powered(&mut self) {
        self.powered = true;
        self.set_head(head::FLAGS, doubled(flags(self.state, true)));
    }

    fn set_head(&mut self, at: usize, word: u32) {
        let open = self.open.is_some();
        if let Some(block) = self.ring.at_mut(self.place).filter(|_| open) {
            block[at] = word;
        }
    }

    /// Returns the number of bits in the open block.
    fn bits(&self) -> u32 {
        ((self.word - HEAD) * 32) as u32 + self.fill
    }

    fn open_block(&mut self) {
        let sequence = self.next;
        self.next = sequence.wrapping_add(1);
        self.open = Some(sequence);
        self.place = self.ring.place(sequence);
        let flags = flags(self.state, self.powered);
        if let Some(block) = self.ring.at_mut(self.place) {
            block[head::MAGIC] = 0;
            compiler_fence(Ordering::SeqCst);
            block[head::SEQUENCE] = sequence;
            block[head::SNAPSHOT] = doubled(NONE);
            block[head::FLAGS] = doubled(flags);
        }
        (self.begun, self.word, self.rest, self.fill, self.marked) = (false, HEAD, 0, 0, false);
        self.hash = mix(MAGIC, sequence);
    }

    /// Commits all bits that have been written.
    #[inline]
    pub(super) fn commit(&mut self) {
        let (rest, bits, hash, word) = (self.rest, self.bits(), self.hash, self.word);
        let (open, begun) = (self.open.is_some(), self.begun);
        let Some(block) = self.ring.at_mut(self.place).filter(|_| open) else { return };
        if let Some(place) = block.get_mut(word) {
            *place = rest;
        }
        compiler_fence(Ordering::SeqCst);
        block[head::COMMIT] = commit(hash, rest, bits);
        if !begun {
            compiler_fence(Ordering::SeqCst);
            block[head::MAGIC] = MAGIC;
            self.begun = true;
        }
    }

    /// Ends the log with this `state` as the reason.
    pub(super) fn freeze(&mut self, state: LogState) {
        self.state = state;
        self.set_head(head::FLAGS, doubled(flags(state, self.powered)));
    }

    /// Returns the number of the oldest block, and the number of the block after the newest block.
    pub(super) fn range(&self) -> (u32, u32) {
        let Some(newest) = self.open else { return (self.next, self.next) };
        let mut oldest = newest;
        for _ in 1..self.ring.len() {
            let before = oldest.wrapping_sub(1);
            if oldest == 0 || self.ring.block(before).is_none_or(|block| !in_place(block, before)) {
                break;
            }
            oldest = before;
        }
        (oldest, newest.wrapping_add(1))
    }

    /// Reads bytes of a block, starting at byte `offset`, as little-endian words. Returns the number of bytes that were read.
    pub(super) fn read(&self, sequence: u32, offset: usize, out: &mut [u8]) -> usize {
        let Some(block) = self.ring.block(sequence).filter(|block| in_place(block, sequence)) else {
            return 0;
        };
        let words = block.get(offset / 4..).unwrap_or(&[]);
        let mut read = 0;
        for (to, word) in out.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *to = word.to_le_bytes();
            read += 4;
        }
        read
    }

    /// Fills the present word up, so that the next data begins with a whole word.
    pub(super) fn align(&mut self) {
        if self.fill != 0 {
            let word = core::mem::take(&mut self.rest);
            self.fill = 0;
            self.full(word);
        }
    }

    /// Appends whole words, all in the same block. The preceding data must end with a whole word.
    #[inline]
    pub(super) fn append<const K: usize>(&mut self, words: [u32; K]) {
        if self.word + K > BLOCK_WORDS {
            self.next_block();
        }
        let Some(place) = self.ring.at_mut(self.place).and_then(|block| block.get_mut(self.word..)) else {
            return;
        };
        let Some(place) = place.first_chunk_mut() else { return };
        *place = words;
        self.hash = words.iter().fold(self.hash, |hash, word| mix(hash, *word));
        self.word += K;
        if self.word == BLOCK_WORDS {
            self.next_block();
        }
    }

    /// Writes a full word. The bits in `rest` and `fill` follow this word.
    #[inline]
    fn full(&mut self, word: u32) {
        if let Some(place) = self.ring.at_mut(self.place).and_then(|block| block.get_mut(self.word)) {
            *place = word;
        }
        self.hash = mix(self.hash, word);
        self.word += 1;
        if self.word == BLOCK_WORDS {
            let (rest, fill) = (self.rest, self.fill);
            (self.rest, self.fill) = (0, 0);
            self.next_block();
            (self.rest, self.fill) = (rest, fill);
        }
    }

    #[cold]
    #[inline(never)]
    fn next_block(&mut self) {
        // The bits that the block contains are committed, even if they end in the middle of a tick. The remaining bits of the tick follow
        // in the next block.
        self.commit();
        self.set_head(head::FLAGS, doubled(flags(self.state, self.powered) | CLOSED));
        self.open_block();
    }
}

impl<P: AsRef<[Block]> + AsMut<[Block]>, const N: usize> BitSink for Writer<P, N> {
    #[inline]
    fn put(&mut self, value: u32, bits: u32) {
        self.rest |= value << self.fill;
        let fill = self.fill + bits;
        if fill < 32 {
            self.fill = fill;
            return;
        }
        let word = self.rest;
        // `rest` now contains the bits that did not fit into the word.
        let used = 32 - self.fill;
        (self.rest, self.fill) = (value.checked_shr(used).unwrap_or(0), fill - 32);
        self.full(word);
    }

    #[inline(never)]
    fn put_double(&mut self, value: u64) {
        let fill = self.fill;
        if value != 0 {
            let (low, high) = (value as u32, (value >> 32) as u32);
            // The value is written as a set bit, followed by its 64 bits, which is 65 bits in all.
            let (a, b, c) = (low << 1 | 1, low >> 31 | high << 1, high >> 31);
            let over = |word: u32| (word >> 1) >> (31 - fill);
            let words = [self.rest | a << fill, over(a) | b << fill];
            self.rest = over(b) | c << fill;
            // Two words are written at once, except at the end of the block.
            let place =
                self.ring.at_mut(self.place).and_then(|block| block.get_mut(self.word..BLOCK_WORDS - 1));
            match place.and_then(|place| place.first_chunk_mut()) {
                Some(place) => {
                    *place = words;
                    self.hash = mix(mix(self.hash, words[0]), words[1]);
                    self.word += 2;
                }
                None => words.into_iter().for_each(|word| self.full(word)),
            }
        }
        self.fill = fill + 1;
        if self.fill == 32 {
            let word = core::mem::take(&mut self.rest);
            self.fill = 0;
            self.full(word);
        }
    }
}
