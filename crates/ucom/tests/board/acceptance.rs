//! The acceptance table of the board side, D-T1 to D-T21, in both byte orders where words are on the wire.

use ucom::profile::Endian;
use ucom::{Frame, Profile, Sequence, Status};

use crate::bus::{Bus, MS, blocks, frames, header, image};

const FIVE: [u16; 5] = [0x21, 0x42, 0x63, 0x04, 0x7F];
const FIVE_REPORTS: &str = "404#04 441#21 482#42 4C3#63 4DF#7F";

fn sorted(mut heard: Vec<Frame>) -> Vec<Frame> {
    heard.sort_by_key(Frame::id);
    heard
}

/// D-T1, D-07: one report from each board within 500 ms.
#[test]
fn d_t1_reset_reports() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    let start = bus.now;
    bus.send("000#");
    bus.run(2000);
    assert!(bus.heard.iter().all(|(at, _)| at - start <= 500 * MS));
    assert_eq!(sorted(bus.take()), frames(FIVE_REPORTS));
}

/// D-T2: PC_REPORT resets nothing.
#[test]
fn d_t2_report_without_reset() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    bus.number(1);
    for _ in 0..2 {
        let heard = bus.ask("240#", 300);
        assert_eq!(sorted(heard), frames(FIVE_REPORTS));
        let info = bus.info(1).unwrap();
        assert_eq!((info.sequence, info.status), (1, Status(0x1B)));
    }
}

/// D-T3, D-06: silence of a board without number.
#[test]
fn d_t3_unnumbered_boards_are_silent() {
    let mut bus = Bus::one();
    for n in [0x000, 0x001, 0x002] {
        for function in [1, 7, 8, 11, 12, 13, 15, 21, 22, 23, 24, 26u16] {
            let id = function << 6 | n;
            for len in [0, 2, 4, 8] {
                bus.send_frame(&Frame::new(id, &[0; 8][..len]).unwrap());
            }
        }
    }
    bus.run(2000);
    assert_eq!(bus.take(), []);
    assert_eq!(bus.boards[0].status(), Status(0x11));
}

/// D-T4: numbers follow the wire.
#[test]
fn d_t4_numbers_follow_the_wire() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    assert_eq!(bus.ask("202#", 200), []);
    assert_eq!(bus.ask("282#", 200), [], "the pin of board 1 is off");
    assert_eq!(bus.ask("1C1#0202", 20), []);
    assert_eq!(bus.ask("282#", 20), frames("0C2#02"));
    let numbers: Vec<_> = bus.boards.iter().map(|board| board.number().map(Sequence::number)).collect();
    assert_eq!(numbers, [Some(1), Some(2), None, None, None]);
}

/// D-T5, D-24: the same request again is acknowledged again, and changes nothing.
#[test]
fn d_t5_init_again() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    bus.number(1);
    assert_eq!(bus.ask("282#", 20), frames("0C2#02"));
    let before: Vec<_> = bus.boards.iter().map(|board| board.status()).collect();
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    assert_eq!(bus.ask("282#", 20), frames("0C2#02"));
    let after: Vec<_> = bus.boards.iter().map(|board| board.status()).collect();
    assert_eq!(after, before);
}

/// D-T6, D-22: the formula, literally.
#[test]
fn d_t6_set_status_is_literal() {
    let mut bus = Bus::initialised();
    assert_eq!(bus.ask("1C1#0040", 20), []);
    assert_eq!(bus.status(1), 0x5B);
    assert!(bus.boards[0].store.autostart);
    bus.send("1C1#4000");
    assert_eq!(bus.status(1), 0x1B);
}

/// D-T7, D-22: bits that mirror reality cannot be written.
#[test]
fn d_t7_mirror_bits_stay() {
    let mut bus = Bus::initialised();
    for text in ["1C1#0100", "1C1#1000", "1C1#2020", "1C1#0020", "1C1#FF1B"] {
        bus.send(text);
        assert_eq!(bus.status(1), 0x1B, "{text}");
    }
    // The same while the loop runs.
    let mut bus = Bus::running();
    for text in ["1C1#2000", "1C1#1010", "1C1#0010"] {
        bus.send(text);
        assert_eq!(bus.status(1), 0xAB, "{text}");
    }
}

/// D-T8, D-20, D-23: the walk of the status byte.
#[test]
fn d_t8_status_walk() {
    let mut bus = Bus::one();
    let mut walk = vec![bus.boards[0].status().0];
    bus.number(1);
    walk.push(bus.status(1));
    for step in ["041#", "301#", "541#", "601#00000000", "1C1#8000"] {
        bus.send(step);
        bus.run(30);
        walk.push(bus.status(1));
    }
    bus.send("1C1#0800");
    assert_eq!(bus.info(1), None);
    walk.push(bus.boards[0].status().0);
    assert_eq!(walk, [0x11, 0x1B, 0x1F, 0x8B, 0xAB, 0x8B, 0x1B, 0x11]);
}

/// D-T9, D-30: start with and without an application.
#[test]
fn d_t9_start() {
    let mut bus = Bus::initialised();
    assert_eq!(bus.ask("301#", 2000)[0], frames("501#")[0]);
    assert!(!Status(bus.status(1)).has(Status::EXLRUN));
    let mut bus = Bus::initialised();
    bus.boards[0].flash = Default::default();
    bus.boards[0].restart(bus.now);
    bus.run(200);
    bus.take();
    bus.number(1);
    assert_eq!(bus.ask("301#", 2000), frames("081#0B"));
    assert_eq!(bus.status(1), 0x1B);
}

/// D-T10, D-36, D-12: dimensions, then one string for each; a request with data is none.
#[test]
fn d_t10_io_description() {
    let mut bus = Bus::started();
    let start = bus.now;
    bus.send("581#");
    bus.run(100);
    assert!(bus.heard[0].0 - start >= 2 * MS, "D-05: not before the request is gone");
    let heard = bus.take();
    assert_eq!(
        heard[..6],
        frames(
            "581#020004000300 581#0200 581#55436F4D32206865 581#61642070616E 581#0100 581#706F735F736F6C6C"
        )
    );
    // Counted independently: headers of 2 bytes announce what follows.
    let mut strings = 0;
    let mut rest = heard[1..].iter();
    while let Some(header) = rest.next() {
        strings += 1;
        assert_eq!(header.dlc(), 2);
        for _ in 0..header.data()[0] {
            assert!(rest.next().is_some_and(|frame| frame.dlc() > 0));
        }
    }
    assert_eq!(strings, 1 + 2 + 4 + 3);
    assert_eq!(bus.ask("581#00", 100), []);
}

/// D-T11, D-15: seven initial inputs in three packages.
#[test]
fn d_t11_initial_inputs() {
    for endian in [Endian::Little, Endian::Big] {
        let mut bus = Bus::new(&[0x21], Profile { endian, ..Profile::default() });
        let names = ["a", "b", "c", "d", "e", "f", "g"];
        bus.boards[0].application = ucom::node::memory::MemoryApplication::new("x", &names, &[], &[]);
        bus.boards[0].application.initial_ci = (1..=7).collect();
        bus.number(1);
        bus.send("301#");
        bus.run(50);
        let expected = match endian {
            Endian::Little => "6C1#0000010002000300 6C1#0300040005000600 6C1#0600070000000000",
            Endian::Big => "6C1#0000000100020003 6C1#0003000400050006 6C1#0006000700000000",
        };
        assert_eq!(bus.ask("5C1#", 20), frames(expected));
    }
}

/// D-T12, D-34: inputs beyond the last one.
#[test]
fn d_t12_inputs_beyond_the_dimension() {
    let mut bus = Bus::started();
    assert_eq!(bus.ask("341#02000700", 20), frames("081#05"));
    assert_eq!(bus.boards[0].application.ci, [0, 0]);
    assert_eq!(bus.ask("341#0100070008000900", 20), []);
    assert_eq!(bus.boards[0].application.latched_ci, [0, 7]);
    assert_eq!(bus.boards[0].application.par, [0, 0, 0]);
    assert_eq!(bus.ask("3C1#FFFF0700", 200), frames("081#05"));
    assert_eq!(bus.ask("3C1#02000700", 20), []);
    assert_eq!(bus.boards[0].application.par, [0, 0, 7]);
}

/// D-T13, D-50: without the PC's life sign the board stops, and only a start starts it again.
#[test]
fn d_t13_pc_lost() {
    let mut bus = Bus::started();
    bus.send("601#01010000");
    let start = bus.now;
    bus.run(5);
    assert!(bus.boards[0].application.active);
    bus.send("341#000001000200");
    bus.run(1600);
    let at = |text: &str| {
        let frame: Frame = text.parse().unwrap();
        bus.heard.iter().filter(|(_, heard)| *heard == frame).map(|(at, _)| at - start).collect::<Vec<_>>()
    };
    let stopped = at("601#00000000");
    assert_eq!(stopped.len(), 1);
    assert!((1500 * MS..1510 * MS).contains(&stopped[0]), "{stopped:?}");
    let last_output =
        bus.heard.iter().filter(|(_, frame)| frame.id() == 0x381).map(|(at, _)| at - start).max();
    assert!(last_output.unwrap() <= 1502 * MS);
    assert!(!bus.boards[0].application.active && !bus.boards[0].application.running);
    assert_eq!(bus.boards[0].application.latched_ci, [0, 0], "inputs are as nobody has set them");
    bus.take();
    for _ in 0..4 {
        bus.send("680#");
        bus.run(500);
    }
    assert!(bus.take().iter().all(|frame| frame.id() == 0x681), "ALIVE alone never resumes motion");
    assert_eq!(bus.ask("541#", 8), frames("601#01000000"));
    bus.run(20);
    assert!(bus.take().iter().any(|frame| frame.id() == 0x381));
}

/// D-T14, D-50: one missing life sign is nothing, three are the end.
#[test]
fn d_t14_alive_for_a_minute() {
    let mut bus = Bus::started();
    bus.send("680#");
    bus.send("541#");
    for i in 0..120 {
        if i != 60 {
            bus.send("680#");
        }
        bus.run(500);
        assert_eq!(bus.boards[0].status(), Status(0xAB), "half second {i}");
    }
    bus.run(1100);
    assert_eq!(bus.boards[0].status(), Status(0x8B));
}

/// D-T15, D-37, D-12: flags that are no flags; a frame that is too short.
#[test]
fn d_t15_bad_flags() {
    let mut bus = Bus::started();
    assert_eq!(bus.ask("601#02000000", 100), []);
    assert_eq!(bus.ask("601#010000", 100), frames("081#07"));
    assert_eq!(bus.boards[0].status(), Status(0x8B));
}

/// D-T16, D-25: the hold-off of the autostart.
#[test]
fn d_t16_autostart_can_be_held_off() {
    let chain = |steps: &[(&str, u64)]| {
        let mut bus = Bus::one();
        bus.boards[0].store.autostart = true;
        bus.send("281#");
        for (text, ms) in steps {
            bus.send(text);
            bus.run(*ms);
        }
        bus.run(1000);
        (bus.boards[0].status().0, bus.take())
    };
    let (status, heard) = chain(&[]);
    assert_eq!(status, 0xC9, "S5, never S6");
    assert_eq!(heard[..2], frames("0C1#01 501#"));
    assert_eq!(chain(&[("680#", 290), ("041#", 1)]), (0x5D, frames("0C1#01")));
    assert_eq!(chain(&[("680#", 290), ("1C1#4000", 1)]), (0x19, frames("0C1#01")));
    assert_eq!(chain(&[("680#", 290), ("1C1#0404", 1)]), (0x5D, frames("0C1#01")));
    // Once for each number: the same number again starts nothing.
    assert_eq!(chain(&[("680#", 600), ("1C1#8000", 10), ("281#", 10)]).0, 0x59);
    // Not before its time, and with error 11 when there is nothing to start.
    let mut bus = Bus::one();
    bus.boards[0].store.autostart = true;
    bus.send("281#");
    bus.run(490);
    assert_eq!(bus.boards[0].status(), Status(0x59));
    let mut bus = Bus::one();
    bus.boards[0].store.autostart = true;
    bus.boards[0].flash = Default::default();
    bus.boards[0].power_up(bus.now);
    bus.run(50);
    assert_eq!(bus.ask("281#", 1000), frames("0C1#01 081#0B"));
    assert_eq!(bus.boards[0].status(), Status(0x59));
}

/// D-T17, D-40, D-42: a whole update by raw frames, with the golden header.
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

/// D-T18, D-43, D-41: each mistake once, and silence after it.
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
        // Forty frames that were still under way.
        for _ in 0..40 {
            bus.send("2C1#FFFFFFFFFFFFFFFF");
        }
        bus.run(500);
        assert_eq!(bus.errors[before..], frames(&format!("081#{code:02X}")), "{name}");
        assert_eq!(bus.boards[0].has_application(), still_valid, "{name}");
        assert_eq!(bus.boards[0].status(), Status(0x1F), "{name}: stays in the exloader");
    }
}

/// D-T19, D-46: a group update goes past boards that are not in it.
#[test]
fn d_t19_group_update() {
    let mut bus = Bus::new(&[0x21, 0x42, 0x63], Profile::default());
    for n in 1..=3 {
        bus.number(n);
    }
    bus.send("041#");
    bus.send("043#");
    let image: Vec<u8> = (0..100u8).collect();
    let mut heard = Vec::new();
    for block in blocks(&image, &Profile::default()) {
        for data in block.chunks_exact(8) {
            bus.send_frame(&Frame::new(0x2C0, data).unwrap());
        }
        bus.run(60);
        heard.push(sorted(bus.take()));
    }
    assert_eq!(heard.pop().unwrap(), frames("101# 103#"));
    assert!(heard.iter().all(|answers| *answers == frames("181# 183#")));
    let ids: Vec<_> = bus.boards.iter().map(|board| board.record().unwrap().program_id).collect();
    assert_eq!((ids[0], ids[1]), (ids[2], 0x1234));
    assert_ne!(ids[0], 0x1234);
}

/// D-T20, D-24, D-06: a second request while the acknowledgement is still waiting.
#[test]
fn d_t20_init_while_the_acknowledgement_waits() {
    let mut bus = Bus::new(&[0x21, 0x42], Profile::default());
    bus.hold = |frame| frame.id() == 0x0C1;
    bus.send("281#");
    bus.run(10);
    assert_eq!(bus.boards[0].number(), None, "INIT only when the frame has left");
    bus.send("281#");
    bus.send("282#");
    bus.run(10);
    bus.release();
    bus.run(10);
    assert_eq!(bus.take(), frames("0C1#01 080#09 080#09"));
    assert_eq!(bus.boards[0].number(), Sequence::new(1));
    assert_eq!(bus.boards[1].number(), None);
}

/// D-T21, D-07: two boards with one flash id send one identifier with the same data.
#[test]
fn d_t21_equal_flash_ids_look_like_one_board() {
    let mut bus = Bus::new(&[0x21, 0x121], Profile::default());
    let mut heard = bus.ask("000#", 500);
    heard.dedup();
    assert_eq!(heard, frames("441#21"));
}

/// Golden vector 13.1: reset and a chain of three.
#[test]
fn golden_chain_of_three() {
    let mut bus = Bus::new(&[0x21, 0x42, 0x63], Profile::default());
    assert_eq!(bus.ask("000#", 500), frames("441#21 482#42 4C3#63"));
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    let description = "141#0200 141#55436F4D32206865 141#61642070616E";
    assert_eq!(bus.ask("201#", 20), frames(&format!("141#2100011934126E38 {description}")));
    bus.send("1C1#0202");
    assert_eq!(bus.ask("201#", 20), frames(&format!("141#2100011B34126E38 {description}")));
    assert_eq!(bus.ask("282#", 20), frames("0C2#02"));
    assert_eq!(bus.ask("202#", 20)[0], frames("142#4200021934126E38")[0]);
    bus.send("1C2#0202");
    assert_eq!(bus.ask("202#", 20)[0], frames("142#4200021B34126E38")[0]);
    assert_eq!(bus.ask("283#", 20), frames("0C3#03"));
    assert_eq!(bus.ask("203#", 20)[0], frames("143#6300031934126E38")[0]);
    bus.send("1C3#0202");
    for _ in 0..3 {
        assert_eq!(bus.ask("284#", 100), []);
        assert_eq!(bus.ask("204#", 100), []);
    }
}

/// Golden vector 13.2: start and run.
#[test]
fn golden_start_and_run() {
    let mut bus = Bus::initialised();
    bus.send("680#");
    assert_eq!(bus.ask("301#", 50), frames("501# 681# 601#00000000"));
    assert_eq!(bus.ask("5C1#", 20), frames("6C1#0000000000000000"));
    bus.send("3C1#0000780005000100");
    bus.send("341#0000000000000000");
    bus.boards[0].application.so = vec![100, 101, 102, 103];
    bus.send("680#");
    bus.heard.clear();
    bus.send("541#");
    let start = bus.now;
    bus.run(25);
    let heard: Vec<_> = bus.heard.iter().map(|(at, frame)| ((at - start) / (10 * MS), *frame)).collect();
    let outputs = frames("381#0000640065006600 381#0300670000000000");
    let expected =
        [(0, frames("601#01000000")[0]), (1, outputs[0]), (1, outputs[1]), (2, outputs[0]), (2, outputs[1])];
    assert_eq!(heard, expected);
    bus.take();
    bus.send("601#01010000");
    bus.send("341#0000DC05ECFF0000");
    bus.run(4);
    assert!(bus.take().contains(&frames("601#01010000")[0]));
    assert_eq!(bus.boards[0].application.par, [120, 5, 1]);
    assert_eq!(bus.boards[0].application.latched_ci, [1500, 0xFFEC]);
    bus.run(1600);
    assert_eq!(bus.take().iter().filter(|frame| **frame == frames("601#00000000")[0]).count(), 1);
}
