//! Tests of the format of a block: its head, its check value, and its committed bits (J-56).
use crate::recorder::block::{
    BITS, HEAD, MAGIC, NONE, Whole, commit, doubled, flags, head, in_place, mix, sealed_block,
};
use crate::recorder::{BLOCK_WORDS, Block};
use jtc_wire::LogState;

/// Number of words in a block after its head.
const WORDS: usize = BLOCK_WORDS - HEAD;

/// Returns a block that is not closed, with these words after the head. The first `bits` bits of the words are committed.
fn block(words: &[u32; WORDS], bits: u32, snapshot: u16, flags: u16) -> Block {
    let mut block = [0; BLOCK_WORDS];
    block[HEAD..].copy_from_slice(words);
    let full = bits as usize / 32;
    let hash = words[..full.min(WORDS)].iter().fold(mix(MAGIC, 3), |hash, word| mix(hash, *word));
    let rest = if bits.is_multiple_of(32) { 0 } else { words[full] & (u32::MAX >> (32 - bits % 32)) };
    block[head::MAGIC] = MAGIC;
    block[head::SEQUENCE] = 3;
    block[head::COMMIT] = commit(hash, rest, bits);
    block[head::SNAPSHOT] = doubled(snapshot);
    block[head::FLAGS] = doubled(flags);
    block
}

/// Returns the words 1, 3, 5, and so on, with all bits of the high half set.
fn words() -> [u32; WORDS] {
    core::array::from_fn(|n| 0xFFFF_0001 | (n as u32) << 1)
}

/// The check value is FNV-1a with whole words and a rotation: (hash XOR word) times 0x0100_0193, rotated left by 7 bits.
#[test]
fn j56_the_hash_of_the_bits_is_that_of_the_layout() {
    // 0x0100_0193, rotated left by 7 bits, is 0x8000_C980. For the word 2, the product is twice as large, so bit 31
    // of this value moves to bit 0: 0x0001_9301.
    for (hash, word, expected) in [
        (0, 0, 0),
        (5, 5, 0),
        (0, 1, 0x8000_C980),
        (1, 0, 0x8000_C980),
        (3, 2, 0x8000_C980),
        (0, 2, 0x0001_9301),
    ] {
        assert_eq!(mix(hash, word), expected, "{hash} {word}");
    }
}

/// The commit word contains the number of bits in its low half. Its high half combines both halves of the hash.
#[test]
fn j56_the_commit_word_contains_the_number_of_bits_and_both_halves_of_the_hash() {
    // The hash of (0, 1) is 0x8000_C980, and the hash of (0, 2) is 0x0001_9301.
    assert_eq!(commit(0, 1, 40), (0x8000 ^ 0xC980) << 16 | 40);
    assert_eq!(commit(0, 2, 8_032), (0x0001 ^ 0x9301) << 16 | 8_032);
}

#[test]
fn j56_a_block_with_any_wrong_bit_is_not_valid() {
    let words = words();
    let whole = block(&words, BITS, 0, flags(LogState::Recording, false));
    assert_eq!(Whole::parse(&whole).map(|whole| (whole.sequence, whole.bits)), Some((3, BITS)));
    for n in 0..BLOCK_WORDS {
        for bit in [n % 32, (n + 13) % 32] {
            let mut damaged = whole;
            damaged[n] ^= 1 << bit;
            assert!(Whole::parse(&damaged).is_none(), "bit {bit} of word {n}");
        }
    }
}

#[test]
fn j56_a_block_cannot_have_more_bits_than_fit() {
    let most = block(&words(), BITS, 0, flags(LogState::Recording, false));
    assert_eq!(Whole::parse(&most).map(|whole| whole.bits), Some(251 * 32));
    // The block claims one bit more than it can contain, and the check value matches this number of bits.
    let mut more = most;
    let hash = words().iter().fold(mix(MAGIC, 3), |hash, word| mix(hash, *word));
    more[head::COMMIT] = commit(hash, 0, BITS + 1);
    assert!(Whole::parse(&more).is_none());
}

/// An interrupted tick may have written bits after the committed bits. The reader must ignore these bits.
#[test]
fn j56_bits_after_the_committed_bits_are_ignored() {
    for bits in [1, 31, 32, 40, 63] {
        let mut words = [0xA5C3_96F1; WORDS];
        let whole = block(&words, bits, 0, flags(LogState::Recording, false));
        assert_eq!(Whole::parse(&whole).map(|whole| whole.bits), Some(bits));
        for word in &mut words[bits as usize / 32 + 1..] {
            *word = !*word;
        }
        words[bits as usize / 32] ^= u32::MAX << (bits % 32);
        let mut other = whole;
        other[HEAD..].copy_from_slice(&words);
        assert_eq!(Whole::parse(&other).map(|whole| whole.bits), Some(bits), "{bits} bits");
    }
}

/// A snapshot that begins at or after the end of the committed bits is not complete.
#[test]
fn j56_a_snapshot_counts_if_it_begins_in_the_committed_bits() {
    for (at, expected) in
        [(0, Some(0)), (63, Some(63)), (64, None), (65, None), (100, None), (8_031, None), (NONE, None)]
    {
        let block = block(&words(), 64, at, flags(LogState::Recording, false));
        assert_eq!(Whole::parse(&block).expect("a valid block").snapshot, expected, "{at}");
    }
}

#[test]
fn j56_the_flags_of_a_block_are_independent() {
    for state in [LogState::Absent, LogState::Recording, LogState::Error, LogState::Reset] {
        for (powered, closed) in [(false, false), (false, true), (true, false), (true, true)] {
            let word = state as u16 + if powered { 0x100 } else { 0 } + if closed { 0x200 } else { 0 };
            let block = block(&words(), 64, 0, word);
            let whole = Whole::parse(&block).expect("a valid block");
            assert_eq!((whole.state, whole.powered, whole.closed), (state, powered, closed));
        }
        assert_eq!(flags(state, true), state as u16 + 0x100);
        assert_eq!(flags(state, false), state as u16);
    }
}

#[test]
fn j56_a_sealed_block_contains_the_words_that_fit() {
    let bits = [0x1234_5678; 300];
    for (given, count) in [(2, 2), (9, 9), (251, 251), (300, 251)] {
        let block = sealed_block(7, 32, &bits[..given]);
        let whole = Whole::parse(&block).expect("a valid block");
        assert_eq!((whole.sequence, whole.bits, whole.snapshot), (7, 32 * count, Some(32)), "{given} words");
        assert_eq!((whole.state, whole.powered, whole.closed), (LogState::Error, true, true));
        assert_eq!(&whole.words[..count as usize], &bits[..count as usize]);
    }
}

#[test]
fn j56_a_block_is_in_place_if_it_is_marked_and_has_its_number() {
    let mut block = sealed_block(7, 0, &[1]);
    assert!(in_place(&block, 7));
    assert!(!in_place(&block, 8));
    // The recorder clears the magic number before it overwrites a block, and when it discards the log.
    block[head::MAGIC] = 0;
    assert!(!in_place(&block, 7));
}
