//! Tests of updates with profiles in which the board interprets the protocol description differently, for each update
//! plan.

use ucom::node::{Area, Node, NodeConfig};
use ucom::profile::{HeaderForm, Plan};
use ucom::{Checksum, Memory, Profile, checksum, data_block};
use ucom_sim::memory::MemoryFlash;

use super::bus::{Board, Bus, blocks, frames, header, image};
use super::update::{data as data_blocks, small, update};

/// Returns a board with number 1 for images without header blocks that are as long as `small`.
fn headerless(plan: Plan) -> Bus {
    headerless_in(MemoryFlash::default(), plan, 100)
}

fn headerless_in(flash: MemoryFlash, plan: Plan, headerless_words: u32) -> Bus {
    let profile = Profile { prog_header: HeaderForm::None, prog_plan: plan, ..Profile::default() };
    let mut bus = Bus::new(&[0x21], profile);
    let Board { pins, store, application, .. } = bus.boards.pop().unwrap();
    let config = NodeConfig { profile, headerless_words, ..NodeConfig::new(0x21) };
    bus.boards.push(Node::new(config, flash, pins, store, application, bus.now));
    bus.run(50);
    bus.number(1);
    bus
}

/// D-40, D-41: without header blocks, the plan determines the memory of each cycle. The plan also determines the
/// image whose Program ID is in the record.
#[test]
fn d41_no_header_in_every_plan() {
    let (one, two) = ([0x5A; 200].to_vec(), small());
    for (plan, memories, counts) in [
        (Plan::Raw, [None, Some(Memory::Program)], &two),
        (Plan::ExloaderApp, [Some(Memory::Ram), Some(Memory::Program)], &two),
        (Plan::PmemXmem, [Some(Memory::Program), Some(Memory::Data)], &one),
    ] {
        let mut bus = headerless(plan);
        bus.send("041#");
        let received: Vec<_> = [data_blocks(&one), data_blocks(&two)]
            .concat()
            .iter()
            .flat_map(|block| bus.block(block, 200))
            .collect();
        assert_eq!(received, frames("181# 181# 181# 181# 181# 181# 181# 101#"), "{plan}");
        for (memory, image) in memories.into_iter().zip([&one, &two]) {
            let Some(memory) = memory else { continue };
            assert_eq!(bus.boards[0].flash.bytes(memory)[..200], image[..], "{plan} {memory:?}");
        }
        let profile = Profile::default();
        let id = checksum(profile.prog_checksum, profile.prog_endian, counts);
        assert_eq!(bus.boards[0].record().map(|record| record.program_id), Some(id), "{plan}");
    }
}

/// D-41: an image without a header has the configured length, limited to the length of the application area. The address of such an image
/// is the start of the application area.
#[test]
fn d41_no_header_fills_the_area() {
    let image: Vec<u8> = (0..128).collect();
    for (headerless_words, words) in [(0, 64), (63, 63), (64, 64), (65, 64)] {
        let area = Area { start: 0x1000, words: 64 };
        let mut bus = headerless_in(MemoryFlash::new(area, area, area), Plan::VerifyWrite, headerless_words);
        bus.send("041#");
        let cycle = data_blocks(&image);
        let received: Vec<_> =
            [cycle.clone(), cycle].concat().iter().flat_map(|b| bus.block(b, 200)).collect();
        assert_eq!(received, frames("181# 181# 181# 101#"), "{headerless_words}");
        let record = bus.boards[0].record().unwrap();
        assert_eq!((record.address, record.words), (0x1000, words), "{headerless_words}");
        let bytes = 2 * words as usize;
        assert_eq!(bus.boards[0].flash.bytes(Memory::Program)[..bytes], image[..bytes], "{headerless_words}");
    }
}

/// D-44: with the checksum `none`, the board stores and reports the Program ID in the header unchanged.
#[test]
fn d44_program_id_as_the_header_says() {
    let profile = Profile { prog_checksum: Checksum::None, ..Profile::default() };
    let image = image();
    let mut all = Vec::new();
    for cycle in 1..=2 {
        let mut header = header(&image, cycle, &profile);
        header.program_id = 0xC0DE;
        all.push(header.build(profile.prog_endian));
        all.extend((0..).map_while(|i| data_block(&image, i)));
    }
    let mut bus = Bus::new(&[0x21], profile);
    bus.number(1);
    assert!(update(&mut bus, &all));
    assert_eq!(bus.errors, []);
    assert_eq!(bus.info(1).map(|info| info.program_id), Some(0xC0DE));
}

/// D-43: a transfer ends when the bit PROG changes from 1 to 0. After an error, the board accepts program data again only when PROG changes
/// from 0 to 1.
#[test]
fn d43_silence_lasts_until_programming_is_enabled_again() {
    let mut bus = Bus::initialised();
    bus.send("041#");
    // The block in this test is not a valid header.
    assert_eq!(bus.block(&[0; 64], 5), frames("081#05"));
    bus.send("1C1#0400");
    assert_eq!(bus.ask("2C1#0011223344556677", 5), [], "silent although PROG is 0");
    bus.send("1C1#0404");
    let all = blocks(&small(), &Profile::default());
    assert_eq!(bus.block(&all[0], 5), frames("181#"));
}

/// D-40, D-41: headers of the first cycle. For each plan, the board either accepts the header (`181#`) or answers
/// with an error code (`081#`).
#[test]
fn d41_headers_of_the_first_cycle() {
    let (program, data, ram) = (0, 1, 0x10);
    for (plan, memory, address, length, target, answer) in [
        (Plan::VerifyWrite, program, 0, 4, 0xFFFF, "181#"),
        (Plan::VerifyWrite, program, 0, 4, 0x21, "181#"),
        (Plan::VerifyWrite, program, 0, 4, 0x42, "081#02"),
        (Plan::VerifyWrite, program, 0, 0, 0xFFFF, "081#05"),
        (Plan::VerifyWrite, data, 0, 4, 0xFFFF, "181#"),
        (Plan::VerifyWrite, ram, 0, 4, 0xFFFF, "081#02"),
        (Plan::VerifyWrite, 2, 0, 4, 0xFFFF, "081#02"),
        (Plan::VerifyWrite, program, 0, 0x8000, 0xFFFF, "181#"),
        (Plan::VerifyWrite, program, 1, 0x7FFF, 0xFFFF, "181#"),
        (Plan::VerifyWrite, program, 1, 0x8000, 0xFFFF, "081#02"),
        (Plan::VerifyWrite, program, 0x8000, 1, 0xFFFF, "081#02"),
        (Plan::Raw, data, 0, 4, 0xFFFF, "181#"),
        (Plan::Raw, ram, 0, 4, 0xFFFF, "081#02"),
        (Plan::ExloaderApp, ram, 0, 4, 0xFFFF, "181#"),
        (Plan::ExloaderApp, program, 0, 4, 0xFFFF, "081#02"),
        (Plan::PmemXmem, program, 0, 4, 0xFFFF, "181#"),
        (Plan::PmemXmem, data, 0, 4, 0xFFFF, "081#02"),
    ] {
        let profile = Profile { prog_plan: plan, ..Profile::default() };
        let mut bus = Bus::new(&[0x21], profile);
        bus.number(1);
        bus.send("041#");
        let header = ucom::Header { memory, address, length, target, ..header(&[], 1, &profile) };
        let received = bus.block(&header.build(profile.prog_endian), 200);
        assert_eq!(received, frames(answer), "{plan}, {header:?}");
    }
}

/// D-40, D-41: headers of the second cycle, after a valid first cycle. The board either accepts or refuses each
/// header.
#[test]
fn d41_headers_of_the_second_cycle() {
    let (program, data, ram) = (0, 1, 0x10);
    let image = small();
    for (plan, first, memory, address, length, program_id, answer) in [
        (Plan::VerifyWrite, program, program, 0, 100, 0, "181#"),
        (Plan::VerifyWrite, program, data, 0, 100, 0, "081#0A"),
        (Plan::VerifyWrite, program, program, 1, 100, 0, "081#0A"),
        (Plan::VerifyWrite, program, program, 0, 99, 0, "081#0A"),
        (Plan::VerifyWrite, program, program, 0, 100, 1, "081#0A"),
        (Plan::Raw, program, data, 1, 99, 1, "181#"),
        (Plan::ExloaderApp, ram, program, 1, 99, 1, "181#"),
        (Plan::ExloaderApp, ram, ram, 0, 100, 0, "081#02"),
        (Plan::PmemXmem, program, data, 1, 99, 1, "181#"),
        (Plan::PmemXmem, program, program, 0, 100, 0, "081#02"),
    ] {
        let profile = Profile { prog_plan: plan, ..Profile::default() };
        let mut bus = Bus::new(&[0x21], profile);
        bus.number(1);
        bus.send("041#");
        let one = ucom::Header { memory: first, ..header(&image, 1, &profile) };
        for block in [vec![one.build(profile.prog_endian)], data_blocks(&image)].concat() {
            assert_eq!(bus.block(&block, 200), frames("181#"), "{plan}");
        }
        let program_id = one.program_id ^ program_id;
        let two = ucom::Header { cycle: 2, memory, address, length, program_id, ..one };
        assert_eq!(bus.block(&two.build(profile.prog_endian), 200), frames(answer), "{plan}, {two:?}");
    }
}

/// Returns a board that has accepted the first block but has not sent DSP_READY yet, and the blocks of the update.
fn ready_held() -> (Bus, Vec<[u8; 64]>) {
    let all = blocks(&small(), &Profile::default());
    let mut bus = Bus::initialised();
    bus.send("041#");
    bus.hold = |frame| frame.id() == 0x181;
    bus.block(&all[0], 10);
    (bus, all)
}

/// Delivers all frames of a block to the board without a pause between the frames.
fn receive_at_once(bus: &mut Bus, block: &[u8; 64]) {
    for data in block.chunks_exact(8) {
        bus.boards[0].receive(bus.now, &ucom::Frame::new(0x2C1, data).unwrap());
    }
}

/// D-43: if the CAN controller fails to send DSP_READY, the block buffer becomes free, and the board accepts the next
/// block.
#[test]
fn d43_ready_that_was_given_up() {
    let (mut bus, all) = ready_held();
    let (_, ready) = bus.held.pop().unwrap();
    bus.hold = |_| false;
    let now = bus.now;
    bus.boards[0].not_sent(now, &ready);
    assert_eq!(bus.boards[0].counters().not_sent, 1);
    // The board sends DSP_ERROR 6 after its next frame.
    assert_eq!(bus.block(&all[1], 10), frames("181# 081#06"));
    assert_eq!(bus.block(&all[2], 10), frames("181#"));
}

/// D-43: the DSP_READY of a cancelled transfer is sent while the board processes the first block of the next
/// transfer. The board still accepts that block.
#[test]
fn d43_ready_of_the_transfer_before() {
    let (mut bus, all) = ready_held();
    bus.send("041#");
    let (now, ready) = (bus.now, bus.held.pop().unwrap().1);
    receive_at_once(&mut bus, &all[0]);
    let board = &mut bus.boards[0];
    board.sent(now, &ready);
    assert_eq!(board.poll(now + board.config().block_us), Some(ready), "the block is taken");
}

/// D-42: the board accepts a block of an image without a header as soon as the block's processing time has passed.
#[test]
fn d42_block_time_without_header() {
    let mut bus = headerless(Plan::VerifyWrite);
    bus.send("041#");
    receive_at_once(&mut bus, &data_blocks(&small())[0]);
    let (now, board) = (bus.now, &mut bus.boards[0]);
    assert_eq!(board.poll(now + board.config().block_us), "181#".parse().ok());
}

/// D-23, D-42: if a transfer is cancelled, the board drops a waiting DSP_READY. Otherwise, the PC would take this
/// frame for an answer of the next transfer.
#[test]
fn d42_no_ready_of_a_transfer_that_is_no_more() {
    let all = blocks(&small(), &Profile::default());
    for (text, received) in
        [("041#", "0C1#01"), ("1C1#0400", "0C1#01"), ("301#", "0C1#01 501# 681# 601#00000000")]
    {
        let mut bus = Bus::initialised();
        bus.send("041#");
        bus.hold = |_| true;
        bus.send("281#");
        bus.block(&all[0], 10);
        bus.send(text);
        bus.release();
        bus.run(50);
        assert_eq!(bus.take(), frames(received), "{text}");
    }
}
