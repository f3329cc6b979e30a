//! Tests of updates with faults: power loss during each flash operation, loss of each single frame, and flash errors.
//! Some tests use an update plan that is not the default.

use ucom::node::Phase;
use ucom::profile::{Endian, HeaderForm, Plan};
use ucom::{Checksum, Memory, Profile, Status};

use super::bus::{Bus, GOLDEN, blocks, frames, header, image};

/// Returns an image of 200 bytes, which fills three data blocks and a part of the fourth.
pub(super) fn small() -> Vec<u8> {
    (0..200u32).map(|i| (i * i % 251) as u8).collect()
}

/// Sends all blocks of an update, and waits up to 100 ms for an answer after each block. Returns `true` if the board
/// has sent DSP_PROGFINISHED.
pub(super) fn update(bus: &mut Bus, all: &[[u8; 64]]) -> bool {
    bus.send("041#");
    bus.run(1);
    let mut finished = false;
    for block in all {
        let received = bus.block(block, 100);
        finished |= received.contains(&frames("101#")[0]);
        if received.is_empty() && bus.boards[0].flash.is_dark() {
            return false;
        }
    }
    finished
}

/// Checks that no half-written image is valid: a valid record belongs to the complete old image or to the complete
/// new image.
pub(super) fn assert_no_half_image(bus: &Bus, new: &[u8], context: &str) {
    let board = &bus.boards[0];
    let stored = board.flash.bytes(Memory::Program);
    match board.record() {
        None => {}
        Some(record) if record == GOLDEN => assert_eq!(stored[..8], [0x11; 8], "{context}"),
        Some(_) => assert_eq!(stored[..new.len()], *new, "{context}"),
    }
}

/// D-45, D-46: after a power loss at any flash operation of an update, no half-written image is valid, and the board
/// can be programmed again.
#[test]
fn d45_power_loss_at_every_flash_operation() {
    let image = small();
    let all = blocks(&image, &Profile::default());
    let mut whole = Bus::initialised();
    assert!(update(&mut whole, &all));
    let operations = whole.boards[0].flash.operations;
    // The seven flash operations are: clear the record, erase the area, write four blocks, write the record.
    assert_eq!(operations, 7);
    for cut in 0..operations {
        let mut bus = Bus::initialised();
        bus.boards[0].flash.cut_after = Some(cut);
        assert!(!update(&mut bus, &all), "cut {cut}");
        assert!(bus.boards[0].flash.is_dark());
        bus.boards[0].flash.power_up();
        let now = bus.now;
        bus.boards[0].power_up(now);
        bus.run(100);
        assert_eq!(bus.boards[0].status(), Status(0x11), "cut {cut}: S1");
        assert_no_half_image(&bus, &image, &format!("cut {cut}"));
        assert!(!bus.boards[0].has_application(), "cut {cut}");
        // After the power loss, the board can be programmed again.
        bus.take();
        bus.number(1);
        assert!(update(&mut bus, &all), "again after cut {cut}");
        assert_no_half_image(&bus, &image, "again");
        assert_ne!(bus.boards[0].record(), Some(GOLDEN));
    }
}

/// D-46: a power loss in cycle 1 does not change the flash.
#[test]
fn d46_power_loss_in_the_first_cycle() {
    let all = blocks(&small(), &Profile::default());
    for count in 0..=5 {
        let mut bus = Bus::initialised();
        bus.send("041#");
        for block in &all[..count] {
            bus.block(block, 5);
        }
        let now = bus.now;
        bus.boards[0].power_up(now);
        bus.run(100);
        assert_eq!(bus.boards[0].record(), Some(GOLDEN));
        assert_eq!(bus.boards[0].flash.operations, 0);
    }
}

/// D-43, D-44: if any single frame of an update is lost, no half-written image becomes valid. If a frame of the PC is
/// lost, the board reports one error, and the next update succeeds.
#[test]
fn d43_every_frame_lost_once() {
    let image = small();
    let all = blocks(&image, &Profile::default());
    let mut whole = Bus::initialised();
    let first = whole.frames_to_boards;
    let first_answer = whole.frames_from_boards;
    assert!(update(&mut whole, &all));
    assert_eq!(whole.frames_to_boards - first, 1 + 8 * 10);
    for lost in first..whole.frames_to_boards {
        let mut bus = Bus::initialised();
        bus.lose_to_boards = Some(lost);
        // If PC_XRESET is lost, the board does not accept a block. If a data frame is lost, the checks of the board fail.
        assert!(!update(&mut bus, &all), "lost {}", lost - first);
        bus.run(1000);
        assert_no_half_image(&bus, &image, &format!("lost {}", lost - first));
        let errors: Vec<_> = bus.errors.iter().map(|frame| frame.data()[0]).collect();
        assert_eq!(errors.len(), 1, "lost {}: {errors:?}", lost - first);
        // The next attempt to update the board succeeds.
        assert!(update(&mut bus, &all), "again after {}", lost - first);
    }
    // If an answer of the board is lost, the board still processes all blocks. No half-written image is valid
    // afterwards.
    for lost in first_answer..whole.frames_from_boards {
        let mut bus = Bus::initialised();
        bus.lose_from_boards = Some(lost);
        update(&mut bus, &all);
        assert_no_half_image(&bus, &image, "lost answer");
        assert_ne!(bus.boards[0].record(), Some(GOLDEN));
    }
}

/// D-45: if a flash operation fails, the board sends error 3 and has no valid application. The next update succeeds.
#[test]
fn d45_failing_flash() {
    let all = blocks(&small(), &Profile::default());
    for failing in 0..7 {
        let mut bus = Bus::initialised();
        bus.boards[0].flash.fail_after = Some(failing);
        assert!(!update(&mut bus, &all));
        assert_eq!(bus.errors, frames("081#03"), "operation {failing}");
        assert!(!bus.boards[0].has_application());
        assert_eq!(bus.boards[0].phase(), Phase::Aborted);
        bus.boards[0].flash.fail_after = None;
        assert!(update(&mut bus, &all));
    }
}

/// D-43: the block buffer is in use until the CAN controller has sent DSP_READY. If program data arrive earlier, the
/// board sends error 4.
#[test]
fn d43_frame_before_ready_has_left() {
    let mut bus = Bus::initialised();
    bus.send("041#");
    bus.hold = |frame| frame.id() == 0x181;
    bus.block(&blocks(&small(), &Profile::default())[0], 10);
    bus.send("2C1#0011223344556677");
    bus.release();
    bus.run(5);
    assert_eq!(bus.take(), frames("181# 081#04"));
}

/// D-44: the board computes the Program ID from the received data and also from the data in flash.
#[test]
fn d44_flash_is_read_back() {
    let image = small();
    for byte in [0, 63, 64, 127, 150, 199] {
        let mut bus = Bus::initialised();
        bus.boards[0].flash.stuck_byte = Some(byte);
        assert!(image[byte] != 0xFF && !update(&mut bus, &blocks(&image, &Profile::default())));
        assert_eq!(bus.errors, frames("081#01"), "byte {byte}");
        assert!(!bus.boards[0].has_application());
    }
}

/// D-42: after the header of cycle 2, the board sends DSP_READY when the erase is complete. During the erase, the board answers other
/// requests.
#[test]
fn d42_long_erase_blocks_nothing() {
    let all = blocks(&small(), &Profile::default());
    let mut bus = Bus::initialised();
    bus.boards[0].flash.erase_us = 8_000_000;
    bus.send("041#");
    for block in &all[..5] {
        assert_eq!(bus.block(block, 5), frames("181#"));
    }
    assert_eq!(bus.block(&all[5], 100), []);
    for _ in 0..7 {
        assert_eq!(bus.status(1), 0x1F);
        bus.run(1000);
        assert_eq!(bus.take(), []);
    }
    bus.run(1000);
    assert_eq!(bus.take(), frames("181#"));
    // The test resets the board during an erase. After this reset, the board accepts frames only when the erase is complete.
    let mut bus = Bus::initialised();
    bus.boards[0].flash.erase_us = 8_000_000;
    bus.send("041#");
    for block in &all[..6] {
        bus.block(block, 5);
    }
    assert_eq!(bus.ask("000#", 1000), []);
    bus.run(8000);
    assert_eq!(bus.take(), frames("441#21"));
    assert!(!bus.boards[0].has_application());
}

/// D-40: with the plan `exloader-app`, the board first writes the exloader to RAM. The flash of the board does not change until cycle 2.
#[test]
fn d40_exloader_then_application() {
    let profile = Profile { prog_plan: Plan::ExloaderApp, ..Profile::default() };
    let (exloader, image) = (vec![0x5A; 120], small());
    let mut bus = Bus::new(&[0x21], profile);
    bus.number(1);
    let mut first = header(&exloader, 1, &profile);
    first.memory = Memory::Ram.number();
    let second = header(&image, 2, &profile);
    bus.send("041#");
    let one = [vec![first.build(Endian::Little)], data(&exloader)].concat();
    for block in &one {
        assert_eq!(bus.block(block, 5), frames("181#"));
        assert_eq!(bus.boards[0].record(), Some(GOLDEN));
    }
    let two = [vec![second.build(Endian::Little)], data(&image)].concat();
    let received: Vec<_> = two.iter().flat_map(|block| bus.block(block, 100)).collect();
    assert_eq!(received, frames("181# 181# 181# 181# 101#"));
    assert_eq!(bus.boards[0].flash.bytes(Memory::Ram)[..120], exloader);
    assert_no_half_image(&bus, &image, "");
    assert_eq!(bus.boards[0].record().unwrap().program_id, second.program_id);
    // The board does not write an exloader to flash.
    bus.send("041#");
    assert_eq!(bus.block(&header(&image, 1, &profile).build(Endian::Little), 5), frames("081#02"));
}

pub(super) fn data(image: &[u8]) -> Vec<[u8; 64]> {
    (0..).map_while(|i| ucom::data_block(image, i)).collect()
}

/// D-40: with the plan `pmem-xmem`, the board writes two memories for one application. The application is valid only when both memories are
/// written.
#[test]
fn d40_program_then_data_memory() {
    let profile = Profile { prog_plan: Plan::PmemXmem, ..Profile::default() };
    let (program, constants) = (small(), vec![0xA5; 60]);
    let mut bus = Bus::new(&[0x21], profile);
    bus.number(1);
    let first = header(&program, 1, &profile);
    let mut second = header(&constants, 2, &profile);
    second.memory = Memory::Data.number();
    let all = [
        vec![first.build(Endian::Little)],
        data(&program),
        vec![second.build(Endian::Little)],
        data(&constants),
    ]
    .concat();
    bus.send("041#");
    for (i, block) in all.iter().enumerate() {
        let last = i + 1 == all.len();
        assert_eq!(bus.block(block, 100), frames(if last { "101#" } else { "181#" }), "block {i}");
        assert_eq!(bus.boards[0].has_application(), last, "block {i}");
    }
    assert_eq!(bus.boards[0].flash.bytes(Memory::Data)[..60], constants);
    assert_no_half_image(&bus, &program, "");
    assert_eq!(bus.boards[0].record().unwrap().program_id, first.program_id);
}

/// D-41: without header blocks, the board uses its configured length and computes the Program ID itself.
#[test]
fn d41_no_header() {
    let profile = Profile { prog_header: HeaderForm::None, ..Profile::default() };
    let image = small();
    let mut bus = Bus::new(&[0x21], profile);
    let config = ucom::node::NodeConfig { headerless_words: 100, ..*bus.boards[0].config() };
    let board = bus.boards.pop().unwrap();
    bus.boards.push(ucom::node::Node::new(
        config,
        board.flash,
        board.pins,
        board.store,
        board.application,
        bus.now,
    ));
    bus.run(50);
    bus.number(1);
    bus.send("041#");
    let mut received = Vec::new();
    for block in [data(&image), data(&image)].concat() {
        received.extend(bus.block(&block, 200));
    }
    assert_eq!(received, frames("181# 181# 181# 181# 181# 181# 181# 101#"));
    assert_no_half_image(&bus, &image, "");
    let id = ucom::checksum(Checksum::Crc16, Endian::Little, &image);
    assert_eq!(bus.boards[0].record().unwrap().program_id, id);
    // The two cycles transfer different images. The board detects the difference and sends error 1.
    bus.send("041#");
    let mut other = image.clone();
    other[3] ^= 1;
    for block in [data(&image), data(&other)].concat() {
        bus.block(&block, 200);
    }
    assert_eq!(bus.errors, frames("081#01"));
}

/// D-44, D-10: a complete update succeeds with each checksum and each byte order that is not the default.
#[test]
fn d44_update_in_other_profiles() {
    for (checksum, endian) in [
        (Checksum::Sum16, Endian::Little),
        (Checksum::Xor16, Endian::Big),
        (Checksum::None, Endian::Big),
        (Checksum::Crc16, Endian::Big),
    ] {
        let profile = Profile { prog_checksum: checksum, prog_endian: endian, endian, ..Profile::default() };
        let mut bus = Bus::new(&[0x21], profile);
        bus.number(1);
        let image = image();
        assert!(update(&mut bus, &blocks(&image, &profile)), "{checksum} {endian}");
        assert_no_half_image(&bus, &image, "");
        let info = bus.info(1).unwrap();
        let expected = ucom::checksum(checksum, endian, &image);
        assert_eq!((info.program_id, info.date, info.flash_number), (expected, 0x3AC1, 0x21));
    }
}

/// D-40: with the plan `raw`, the board accepts two different files, as their headers require. The board only checks the first file.
#[test]
fn d40_raw_takes_two_files() {
    let profile = Profile { prog_plan: Plan::Raw, ..Profile::default() };
    let (one, two) = (vec![1; 64], small());
    let mut bus = Bus::new(&[0x21], profile);
    bus.number(1);
    let all = [
        vec![header(&one, 1, &profile).build(Endian::Little)],
        data(&one),
        vec![header(&two, 2, &profile).build(Endian::Little)],
        data(&two),
    ]
    .concat();
    assert!(update(&mut bus, &all));
    assert_no_half_image(&bus, &two, "");
}

/// D-43: the checksum detects frames of a block that arrive in another order. CAN adapters with several mailboxes may change the order of
/// frames.
#[test]
fn d43_reordered_frames_are_refused() {
    let image = small();
    let mut all = blocks(&image, &Profile::default());
    let (a, b): ([u8; 8], [u8; 8]) = (all[2][..8].try_into().unwrap(), all[2][8..16].try_into().unwrap());
    all[2][..8].copy_from_slice(&b);
    all[2][8..16].copy_from_slice(&a);
    let mut bus = Bus::initialised();
    assert!(!update(&mut bus, &all));
    assert_eq!(bus.errors, frames("081#01"));
    assert_eq!(bus.boards[0].record(), Some(GOLDEN));
}
