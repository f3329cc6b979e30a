//! Ring of blocks: oldest and newest block, bits in the open block, and reading of consecutive blocks (J-56).
extern crate std;
use std::vec;
use std::vec::Vec;

use jtc_wire::LogState;

use crate::bit_codec::{BitSink, BitSource};
use crate::recorder::block::{BITS, Whole, sealed_block};
use crate::recorder::memory::Writer;
use crate::recorder::reader::Reader;
use crate::recorder::{BLOCK_WORDS, Block};

const EMPTY: Block = [0; BLOCK_WORDS];

fn sealed(sequence: u32) -> Block {
    sealed_block(sequence, 0, &[sequence])
}

/// Returns a writer with an open block in an empty memory of four blocks.
fn writer() -> Writer<Vec<Block>, 1> {
    let mut writer = Writer::new([vec![EMPTY; 4]]);
    writer.begin();
    writer
}

fn parsed(writer: &Writer<Vec<Block>, 1>, block: usize) -> Option<Whole<'_>> {
    Whole::parse(&writer.memory()[0][block])
}

/// A block that is not valid, or not at the place of its number, is not the newest block.
#[test]
fn j56_the_newest_block_is_the_valid_block_with_the_highest_number() {
    let mut damaged = sealed(6);
    damaged[5] ^= 1;
    for (memory, newest) in [
        ([sealed(4), sealed(5), EMPTY, EMPTY], Some(5)),
        ([sealed(4), sealed(5), damaged, EMPTY], Some(5)),
        ([sealed(8), sealed(5), damaged, sealed(7)], Some(8)),
        ([sealed(4), sealed(9), damaged, sealed(8)], Some(9)),
        ([sealed(4), sealed(10), damaged, sealed(8)], Some(4)),
        ([EMPTY, EMPTY, damaged, EMPTY], None),
        ([EMPTY; 4], None),
    ] {
        let writer = Writer::new([memory.to_vec()]);
        assert_eq!(writer.is_empty(), newest.is_none());
        assert_eq!(writer.range().1, newest.map_or(0, |newest| newest + 1));
        let state = if newest.is_some() { LogState::Error } else { LogState::Recording };
        assert_eq!((writer.state, writer.powered), (state, newest.is_some()));
    }
}

#[test]
fn j56_the_oldest_block_is_the_first_without_a_gap() {
    let mut unreadable = sealed(u32::MAX);
    unreadable[5] ^= 1;
    for (memory, range) in [
        ([EMPTY, sealed(5), sealed(6), EMPTY], (5, 7)),
        ([sealed(4), EMPTY, sealed(6), sealed(7)], (6, 8)),
        ([sealed(8), sealed(5), sealed(6), sealed(7)], (5, 9)),
        ([sealed(0), sealed(1), EMPTY, EMPTY], (0, 2)),
        // No block precedes block 0, even if the memory contains a damaged block with the highest block number.
        ([sealed(0), EMPTY, EMPTY, unreadable], (0, 1)),
    ] {
        assert_eq!(Writer::new([memory.to_vec()]).range(), range);
    }
}

#[test]
fn j56_a_discarded_log_stays_discarded_after_a_reset() {
    let mut writer = Writer::new([vec![sealed(0), sealed(1), EMPTY]]);
    assert!(!writer.is_empty());
    writer.clear();
    let writer = Writer::new(writer.into_memory());
    assert!(writer.is_empty());
    assert_eq!(writer.state, LogState::Recording);
}

#[test]
fn j56_a_block_refers_to_its_first_snapshot() {
    let mut writer = writer();
    for (bits, first) in [(7, None), (3, Some(7)), (40, Some(7))] {
        if first.is_some() {
            writer.mark_snapshot();
        }
        writer.put(1, bits.min(32));
        writer.put(0, bits - bits.min(32));
        writer.commit();
        assert_eq!(parsed(&writer, 0).expect("a valid block").snapshot, first);
    }
}

#[test]
fn j56_the_commit_counts_every_bit() {
    let mut writer = writer();
    let mut expected = 0;
    for bits in [5, 1, 26, 32, 31, 2] {
        writer.put(1, bits);
        writer.commit();
        expected += bits;
        assert_eq!(parsed(&writer, 0).expect("a valid block").bits, expected);
    }
}

/// A block has 251 words after its head. The test fills these words exactly, with 31 times eight words and then three
/// words.
#[test]
fn j56_words_that_fit_exactly_end_a_block() {
    let mut writer = writer();
    for n in 0..31 {
        writer.append([n; 8]);
    }
    writer.append([31; 3]);
    writer.append([32; 8]);
    writer.commit();
    let (first, second) = (parsed(&writer, 0).unwrap(), parsed(&writer, 1).unwrap());
    assert_eq!((first.bits, first.closed, first.words[250]), (BITS, true, 31));
    assert_eq!((second.bits, second.closed, second.words[7]), (256, false, 32));
    // If words do not fit into the block, they begin the next block, and the first block ends earlier.
    let mut writer = self::writer();
    for n in 0..32 {
        writer.append([n; 8]);
    }
    writer.commit();
    let (first, second) = (parsed(&writer, 0).unwrap(), parsed(&writer, 1).unwrap());
    assert_eq!((first.bits, first.closed), (31 * 256, true));
    assert_eq!((second.bits, second.words[0]), (256, 31));
}

/// A joint at rest has many values that are zero, and each of these values takes one bit.
#[test]
fn j56_a_value_of_zero_takes_one_bit_and_other_values_take_65_bits() {
    let mut writer = writer();
    let mut expected = 0;
    for (value, bits) in [(0, 1), (1 << 63 | 5, 65), (0, 1), (0x1234_5678_9ABC_DEF0, 65)] {
        writer.put_double(value);
        writer.commit();
        expected += bits;
        assert_eq!(parsed(&writer, 0).unwrap().bits, expected);
    }
    let mut reader = Reader::new(&writer.memory()[0], 0);
    assert_eq!((reader.take(1), reader.take(1)), (0, 1));
    assert_eq!((reader.take(32), reader.take(32)), (5, 1 << 31));
    assert_eq!((reader.take(1), reader.take(1)), (0, 1));
    assert_eq!((reader.take(32), reader.take(32)), (0x9ABC_DEF0, 0x1234_5678));
}

/// A 64-bit value that begins near the end of a block continues in the next block. In this test, the value begins at
/// every bit of the last four words of a block.
#[test]
fn j56_a_value_at_the_end_of_a_block_continues_in_the_next_block() {
    const VALUE: u64 = 0x8765_4321_0FED_CBA9;
    for words in 247..=250 {
        for bits in 0..32 {
            let mut writer = writer();
            for n in 0..words {
                writer.append([n]);
            }
            writer.put(0, bits);
            writer.put_double(VALUE);
            writer.put(0x5A, 8);
            writer.align();
            writer.commit();
            let mut reader = Reader::new(&writer.memory()[0], 32 * words + bits);
            let read = (reader.take(1), reader.take(32), reader.take(32), reader.take(8));
            assert_eq!(read, (1, 0x0FED_CBA9, 0x8765_4321, 0x5A), "{words} words and {bits} bits");
            assert!(!reader.is_damaged());
            let first = parsed(&writer, 0).unwrap();
            assert!(!first.closed || first.bits == BITS);
        }
    }
}

/// After a pause, recording continues in a new block, and the reader must not join the bits of both blocks.
#[test]
fn j56_a_reader_continues_only_in_a_block_that_continues() {
    let mut writer = writer();
    writer.put(0xA5, 8);
    writer.commit();
    writer.begin();
    writer.put(0x5A, 8);
    writer.commit();
    let mut reader = Reader::new(&writer.memory()[0], 0);
    assert!(!reader.at_end());
    assert_eq!(reader.take(8), 0xA5);
    assert!(reader.at_end());
    assert_eq!(reader.block(), 0);
}

#[test]
fn j56_a_reader_does_not_return_bits_that_are_not_committed() {
    let mut writer = writer();
    writer.put(0b1_1010, 5);
    writer.commit();
    let mut memory = writer.into_memory();
    memory[0][0][5] |= 0xFFE0;
    assert!(Whole::parse(&memory[0][0]).is_some());
    let mut reader = Reader::new(&memory[0], 0);
    assert_eq!(reader.take(2), 0b10);
    assert!(!reader.is_damaged());
    assert_eq!(reader.take(6), 0);
    assert!(reader.is_damaged());
}

#[test]
fn j56_a_reader_reports_damage_that_was_found_in_a_value() {
    let block = [sealed(0)];
    let mut reader = Reader::new(&block, 0);
    assert!(!reader.is_damaged());
    reader.damage();
    assert!(reader.is_damaged());
}
