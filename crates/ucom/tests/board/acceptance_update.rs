//! Tests of the acceptance table for boards, D-T17 to D-T19: updates of a board with raw frames.

use ucom::{Frame, Profile, Status};

use super::bus::{Bus, blocks, frames, header, image, sorted};

/// D-T17, D-40, D-42: a board accepts a complete update that consists of raw frames with the header of the protocol
/// page.
#[test]
fn d_t17_update() {
    let mut bus = Bus::initialised();
    bus.send("041#");
    assert_eq!(bus.status(1), 0x1F);
    let blocks = blocks(&image(), &Profile::default());
    assert_eq!(blocks.len(), 34);
    assert_eq!(
        blocks[0][..24],
        [0x43, 0x55, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0xF4, 1, 0, 0, 0x3F, 0x4B, 0xC1, 0x3A, 255, 255, 255, 255]
    );
    for (i, block) in blocks.iter().enumerate() {
        let answer = if i == 33 { "101#" } else { "181#" };
        assert_eq!(bus.block(block, 200), frames(answer), "block {i}");
        assert_eq!(bus.boards[0].has_application(), i < 17 || i == 33, "block {i}");
    }
    assert_eq!(bus.ask("201#", 20)[0], frames("141#2100011B3F4BC13A")[0]);
    assert_eq!(bus.boards[0].flash.bytes(ucom::Memory::Program)[..1000], image());
    assert_eq!(bus.ask("301#", 50)[0], frames("501#")[0]);
}

/// D-T18, D-43, D-41: the board reports each error of the PC once and then ignores program data.
#[test]
fn d_t18_mistakes_in_a_transfer() {
    let image = image();
    let profile = Profile::default();
    let good = blocks(&image, &profile);
    let head = header(&image, 1, &profile);
    type Mistake<'a> = (&'a str, Box<dyn Fn(&mut Bus) + 'a>, u8, bool);
    let cases: Vec<Mistake> = vec![
        (
            "ninth frame before READY",
            Box::new(|bus| {
                for data in good[0].chunks_exact(8).chain([&[0; 8][..]]) {
                    bus.send_frame(&Frame::new(0x2C1, data).unwrap());
                }
            }),
            4,
            true,
        ),
        ("DLC 7", Box::new(|bus| bus.send("2C1#00112233445566")), 7, true),
        (
            "pause in a block",
            Box::new(|bus| {
                bus.send("2C1#4355010001000000");
                bus.run(300);
                bus.send("2C1#00000000F4010000");
            }),
            10,
            true,
        ),
        (
            "bad sum",
            Box::new(|bus| {
                let mut block = good[0];
                block[30] ^= 1;
                bus.block(&block, 1);
            }),
            5,
            true,
        ),
        (
            "wrong target",
            Box::new(|bus| {
                bus.block(&ucom::Header { target: 0x42, ..head }.build(profile.prog_endian), 1);
            }),
            2,
            true,
        ),
        (
            "out of range",
            Box::new(|bus| {
                bus.block(&ucom::Header { address: 0x8000 - 499, ..head }.build(profile.prog_endian), 1);
            }),
            2,
            true,
        ),
        (
            "second cycle of another image",
            Box::new(|bus| {
                for block in &good[..17] {
                    bus.block(block, 5);
                }
                let other = ucom::Header { cycle: 2, length: 499, ..head };
                bus.block(&other.build(profile.prog_endian), 1);
            }),
            10,
            true,
        ),
        (
            "second cycle first",
            Box::new(|bus| {
                bus.block(&good[17], 1);
            }),
            10,
            true,
        ),
        (
            "bit flip in the first cycle",
            Box::new(|bus| {
                let mut blocks = good.clone();
                blocks[5][7] ^= 0x10;
                for block in &blocks[..17] {
                    bus.block(block, 5);
                }
            }),
            1,
            true,
        ),
        (
            "bit flip in the second cycle",
            Box::new(|bus| {
                let mut blocks = good.clone();
                blocks[25][7] ^= 0x10;
                for block in &blocks {
                    bus.block(block, 200);
                }
            }),
            1,
            false,
        ),
    ];
    for (name, mistake, code, still_valid) in cases {
        let mut bus = Bus::initialised();
        bus.send("041#");
        bus.run(1);
        let before = bus.errors.len();
        mistake(&mut bus);
        bus.run(5);
        // These forty frames simulate program data that the PC sends before it receives the error. The board ignores
        // these frames.
        for _ in 0..40 {
            bus.send("2C1#FFFFFFFFFFFFFFFF");
        }
        bus.run(500);
        assert_eq!(bus.errors[before..], frames(&format!("081#{code:02X}")), "{name}");
        assert_eq!(bus.boards[0].has_application(), still_valid, "{name}");
        assert_eq!(bus.boards[0].status(), Status(0x1F), "{name}: stays in the exloader");
    }
}

/// D-T19, D-46: a group update does not change boards that are not in the group.
#[test]
fn d_t19_group_update() {
    let mut bus = Bus::new(&[0x21, 0x42, 0x63], Profile::default());
    for n in 1..=3 {
        bus.number(n);
    }
    bus.send("041#");
    bus.send("043#");
    let image: Vec<u8> = (0..100u8).collect();
    let mut received = Vec::new();
    for block in blocks(&image, &Profile::default()) {
        for data in block.chunks_exact(8) {
            bus.send_frame(&Frame::new(0x2C0, data).unwrap());
        }
        bus.run(60);
        received.push(sorted(bus.take()));
    }
    assert_eq!(received.pop().unwrap(), frames("101# 103#"));
    assert!(received.iter().all(|answers| *answers == frames("181# 183#")));
    let ids: Vec<_> = bus.boards.iter().map(|board| board.record().unwrap().program_id).collect();
    assert_eq!((ids[0], ids[1]), (ids[2], 0x1234));
    assert_ne!(ids[0], 0x1234);
}
