//! Tests of the flight recorder. The tests in this file check that the reader returns all bus frames unchanged.
extern crate std;
use std::vec;
use std::vec::Vec;

use jtc_bus::{Frame, id};
use proptest::prelude::*;

use super::block::Whole;
use super::inputs::Reference;
use super::memory::Writer;
use super::reader::Reader;
use super::{BLOCK_WORDS, Block, RecordedInputs};
use crate::NODES;
use crate::bit_codec::BitSource;
use crate::io::Inputs;

pub(super) mod bench;
mod blocks;
mod events;
mod frames;
mod recording;
mod ring;

/// Change of the answers from one tick to the next.
#[derive(Clone, Debug)]
enum Change {
    /// Each joint moves a little.
    Motion(Vec<(i32, i16, i16)>),
    /// A byte of an answer changes.
    Byte { node: usize, at: usize, to: u8 },
    /// A node answers with `len` bytes, or does not answer.
    Length { node: usize, len: usize },
    /// Two answers are swapped.
    Swap { first: usize, second: usize },
    /// A frame that is not an answer to a Move arrives first.
    Other { id: u16, len: usize },
}

fn change() -> impl Strategy<Value = Change> {
    let way = prop_oneof![
        8 => (-16..16i32).prop_map(|steps| steps << 16),
        1 => (-17..=17i32).prop_map(|steps| steps << 16),
        1 => any::<i32>(),
    ];
    let joint = (way, any::<i16>(), any::<i16>());
    let len = prop::sample::select(vec![0usize, 8, 12, 16, 20, 24]);
    prop_oneof![
        6 => prop::collection::vec(joint, 6).prop_map(Change::Motion),
        3 => (0..NODES, 0..24usize, any::<u8>()).prop_map(|(node, at, to)| Change::Byte { node, at, to }),
        1 => (0..NODES, len.clone()).prop_map(|(node, len)| Change::Length { node, len }),
        1 => (0..NODES, 0..NODES).prop_map(|(first, second)| Change::Swap { first, second }),
        1 => (0..0x7FFu16, len).prop_map(|(id, len)| Change::Other { id, len }),
    ]
}

/// Returns the bus frames of each tick.
fn ticks(changes: &[Change]) -> Vec<Vec<Frame>> {
    let mut answers = [[0u8; 24]; NODES];
    let mut lengths = [16; NODES];
    let mut ticks = Vec::new();
    for change in changes {
        let mut order: Vec<usize> = (0..NODES).collect();
        let mut frames = Vec::new();
        match change {
            Change::Motion(joints) => {
                for (answer, (way, velocity, torque)) in answers.iter_mut().zip(joints) {
                    let position = i32::from_be_bytes(*answer.first_chunk().unwrap()).wrapping_add(*way);
                    answer[..4].copy_from_slice(&position.to_be_bytes());
                    answer[4..6].copy_from_slice(&velocity.to_be_bytes());
                    answer[6..8].copy_from_slice(&torque.to_be_bytes());
                }
            }
            Change::Byte { node, at, to } => answers[*node][*at] = *to,
            Change::Length { node, len } => lengths[*node] = *len,
            Change::Swap { first, second } => order.swap(*first, *second),
            Change::Other { id, len } => frames.extend(Frame::new(*id, &[0x5A; 24][..*len])),
        }
        let answer = |n: usize| Frame::new(id::MOVE_ANSWER + n as u16, &answers[n][..lengths[n]]);
        frames.extend(order.into_iter().filter(|n| lengths[*n] > 0).filter_map(answer));
        ticks.push(frames);
    }
    ticks
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn j56_every_frame_of_the_bus_is_recorded(changes in prop::collection::vec(change(), 1..60)) {
        let ticks = ticks(&changes);
        let memory: [Vec<Block>; 1] = [vec![[0; BLOCK_WORDS]; 40]];
        let mut writer = Writer::new(memory);
        writer.begin();
        let mut reference = Reference::default();
        for (n, frames) in ticks.iter().enumerate() {
            let inputs = Inputs { bus: frames, ..Inputs::QUIET };
            prop_assert!(reference.write(&inputs, 0, n as u16, &mut writer));
            writer.commit();
        }
        let blocks = &writer.memory()[0];
        let (mut reader, mut reference) = (Reader::new(blocks, 0), Reference::default());
        for (n, frames) in ticks.iter().enumerate() {
            prop_assert!(!reader.at_end() && !reader.peek());
            let (inputs, check) = RecordedInputs::read(&mut reference, &mut reader);
            prop_assert_eq!(check, n as u16);
            prop_assert_eq!(&inputs.bus().collect::<Vec<_>>(), frames, "tick {}", n);
        }
        prop_assert!(reader.at_end());
    }
}

/// Writes the inputs of ticks and reads them back. The second element of each tick is the number of completed host
/// events. The index of a tick is its check value. Returns the inputs of each tick, and the number of words that the
/// tick takes in the log.
fn read_back(ticks: &[(Inputs<'_>, usize)]) -> Vec<(RecordedInputs, u32)> {
    let mut writer = Writer::new([vec![[0; BLOCK_WORDS]; 8]]);
    writer.begin();
    let mut reference = Reference::default();
    let (mut whole, mut words) = (Vec::new(), Vec::new());
    let mut before = 0;
    for (n, (inputs, done)) in ticks.iter().enumerate() {
        whole.push(reference.write(inputs, *done, n as u16, &mut writer));
        writer.commit();
        let bits: u32 = writer.memory()[0].iter().filter_map(Whole::parse).map(|whole| whole.bits).sum();
        words.push((bits - before) / 32);
        before = bits;
    }
    let blocks = &writer.memory()[0];
    let (mut reader, mut reference) = (Reader::new(blocks, 0), Reference::default());
    let mut all = Vec::new();
    for (n, words) in words.into_iter().enumerate() {
        let (inputs, check) = RecordedInputs::read(&mut reference, &mut reader);
        assert_eq!((usize::from(check), inputs.is_whole(), reader.is_damaged()), (n, whole[n], false));
        assert!(inputs.bus().eq(ticks[n].0.bus.iter().copied()), "frames of tick {n}");
        all.push((inputs, words));
    }
    assert!(reader.at_end());
    all
}
