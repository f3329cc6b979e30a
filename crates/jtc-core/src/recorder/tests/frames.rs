//! Size of the recorded answers, and rare forms of bus frames (J-56).
extern crate std;
use std::vec::Vec;

use jtc_bus::{Frame, id};

use super::bench::Bench;
use super::read_back;
use crate::bit_codec::BitSink;
use crate::io::Inputs;

/// Steps of a 16-bit encoder in the 32 bits of a position.
const STEP: i32 = 1 << 16;

/// Returns answers of 16 bytes from the first `nodes` nodes: each joint at `position`, with velocity and torque `rate`.
fn answers(nodes: u16, position: i32, rate: i16) -> Vec<Frame> {
    (0..nodes)
        .map(|n| {
            let mut bytes = [0; 16];
            if n < 6 {
                bytes[..4].copy_from_slice(&position.to_be_bytes());
                bytes[4..6].copy_from_slice(&rate.to_be_bytes());
                bytes[6..8].copy_from_slice(&rate.to_be_bytes());
            }
            Frame::new(id::MOVE_ANSWER + n, &bytes).expect("a valid length")
        })
        .collect()
}

/// Returns the answers of tick `n` in which all joints move by one step per tick, and accelerate.
fn moving(nodes: u16, n: i16) -> Vec<Frame> {
    answers(nodes, i32::from(n) * STEP, n)
}

/// Returns the number of words that each tick takes in the log.
fn words(ticks: &[&[Frame]]) -> Vec<u32> {
    let ticks: Vec<_> = ticks.iter().map(|bus| (Inputs { bus, ..Inputs::QUIET }, 0)).collect();
    read_back(&ticks).into_iter().map(|(_, words)| words).collect()
}

/// A tick takes eight words: the first word, six words of velocity and torque, and one word of distances. If a joint
/// moves more than 15 steps forward or 16 steps back, six words of positions replace the word of distances.
#[test]
fn j56_a_tick_of_moving_joints_takes_eight_words() {
    let positions = [0, 15, -1, -1, 15, 16];
    let ticks: Vec<_> =
        positions.iter().zip(1..).map(|(steps, rate)| answers(7, steps * STEP, rate)).collect();
    let ticks: Vec<&[Frame]> = ticks.iter().map(Vec::as_slice).collect();
    // The distances are 0, 15, -16, 0, 16 and 1 steps.
    assert_eq!(words(&ticks), [8, 8, 8, 8, 13, 8]);
}

/// A changed word takes 45 bits, which are two words: a flag for each of seven nodes, six flags for the words of this
/// node, and the changed word. Changed velocities are already in the first eight words.
#[test]
fn j56_a_changed_temperature_takes_two_words_more() {
    let first = answers(7, 0, 5);
    let mut second = answers(7, STEP, -5);
    let mut bytes = [0; 16];
    bytes.copy_from_slice(second[2].data());
    bytes[9] = 40;
    second[2] = Frame::new(second[2].id, &bytes).expect("a valid length");
    let mut third = answers(7, 2 * STEP, 6);
    third[2] = Frame::new(second[2].id, &[&third[2].data()[..8], &bytes[8..]].concat()).expect("a frame");
    assert_eq!(words(&[&first, &second, &third]), [8, 10, 8]);
}

/// A tick takes eight words for six nodes (an arm without a gripper) and for seven nodes. Only the first tick after a
/// change of the number of nodes takes more words.
#[test]
fn j56_ticks_are_short_for_six_nodes_and_for_seven_nodes() {
    let ticks: Vec<_> = [6, 6, 7, 7, 6, 6].into_iter().zip(1..).map(|(nodes, n)| moving(nodes, n)).collect();
    let ticks: Vec<&[Frame]> = ticks.iter().map(Vec::as_slice).collect();
    let all = words(&ticks);
    assert!(all[0] > 8 && all[2] > 8 && all[4] > 8, "{all:?}");
    assert_eq!([all[1], all[3], all[5]], [8, 8, 8]);
}

/// A single missing answer is usual. The next complete tick takes eight words again.
#[test]
fn j56_a_missing_answer_does_not_change_the_expected_nodes() {
    let all = words(&[&moving(7, 1), &moving(5, 2), &moving(7, 3)]);
    assert_eq!([all[0], all[2]], [8, 8]);
    assert!(all[1] > 8, "{all:?}");
}

/// The identifiers 0x207 to 0x20F look like answers to a Move from nodes that do not exist. The log must contain such
/// frames unchanged.
#[test]
fn j56_frames_that_look_like_answers_of_missing_nodes_are_recorded() {
    for node in [6, 7, 8, 15] {
        for len in [0, 8, 12, 16, 24] {
            let data = [0x5A; 24];
            let frames = [Frame::new(id::MOVE_ANSWER + node, &data[..len]).expect("a valid length")];
            // `read_back` compares the returned frames with the written frames.
            read_back(&[(Inputs { bus: &frames, ..Inputs::QUIET }, 0), (Inputs::QUIET, 0)]);
        }
    }
}

/// The log contains a bus frame with 9 bytes, which is impossible on the bus. The reader therefore treats the bits as
/// damaged and does not return the tick.
#[test]
fn j56_a_frame_with_an_impossible_length_is_damage() {
    let mut bench = Bench::new();
    bench.record(1 + 3);
    // These bits are a quiet tick without the flag ORDERED, and contain one frame of 9 bytes.
    let writer = &mut bench.recorder.writer;
    writer.append([1 << 2]);
    for (value, bits) in [(1, 6), (0, 1), (0x123, 11), (9, 5)] {
        writer.put(value, bits);
    }
    (0..9).for_each(|byte| writer.put(byte, 8));
    writer.align();
    writer.commit();
    bench.snapshot();
    bench.record(2);
    assert_eq!(bench.ticks_after_snapshots()[0], 3);
}

/// The log ends in the middle of a tick, for example because the next block is missing. The reader does not return a part of a tick, and
/// continues with the next snapshot.
#[test]
fn j56_a_tick_that_is_not_complete_is_not_returned() {
    let mut bench = Bench::new();
    bench.record(1 + 3);
    // The first word announces further inputs, but these inputs do not follow.
    bench.recorder.writer.append([0]);
    bench.recorder.writer.commit();
    assert_eq!(bench.ticks_after_snapshots(), [3]);
    bench.recorder.writer.begin();
    bench.snapshot();
    bench.record(2);
    assert_eq!(bench.ticks_after_snapshots(), [3, 2]);
}
