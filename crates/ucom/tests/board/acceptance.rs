//! Tests of the acceptance table for boards: D-T1 to D-T16, D-T20 and D-T21. Rows that transmit 16-bit words are
//! tested with both byte orders.

use ucom::profile::Endian;
use ucom::{Frame, Profile, Sequence, Status};

use super::bus::{Bus, MS, frames, sorted};

const FIVE: [u16; 5] = [0x21, 0x42, 0x63, 0x04, 0x7F];
const FIVE_REPORTS: &str = "404#04 441#21 482#42 4C3#63 4DF#7F";

/// D-T1, D-07: each board sends one report within 500 ms after the reset.
#[test]
fn d_t1_reset_reports() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    let start = bus.now;
    bus.send("000#");
    bus.run(2000);
    assert!(bus.received.iter().all(|(at, _)| at - start <= 500 * MS));
    assert_eq!(sorted(bus.take()), frames(FIVE_REPORTS));
}

/// D-T2: PC_REPORT requests reports without a reset of the boards.
#[test]
fn d_t2_report_without_reset() {
    let mut bus = Bus::new(&FIVE, Profile::default());
    bus.number(1);
    for _ in 0..2 {
        let received = bus.ask("240#", 300);
        assert_eq!(sorted(received), frames(FIVE_REPORTS));
        let info = bus.info(1).unwrap();
        assert_eq!((info.sequence, info.status), (1, Status(0x1B)));
    }
}

/// D-T3, D-06: a board without a number does not answer.
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

/// D-T4: boards get their numbers in the order of the chain.
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

/// D-T5, D-24: a board acknowledges a repeated PC_INIT again, and the repetition has no other effect.
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

/// D-T6, D-22: PC_SETSTATUS applies the published formula `(old & ~mask) | value` literally.
#[test]
fn d_t6_set_status_is_literal() {
    let mut bus = Bus::initialised();
    assert_eq!(bus.ask("1C1#0040", 20), []);
    assert_eq!(bus.status(1), 0x5B);
    assert!(bus.boards[0].store.autostart);
    bus.send("1C1#4000");
    assert_eq!(bus.status(1), 0x1B);
}

/// D-T7, D-22: PC_SETSTATUS cannot write bits that show the state of the board.
#[test]
fn d_t7_mirror_bits_stay() {
    let mut bus = Bus::initialised();
    for text in ["1C1#0100", "1C1#1000", "1C1#2020", "1C1#0020", "1C1#FF1B"] {
        bus.send(text);
        assert_eq!(bus.status(1), 0x1B, "{text}");
    }
    // PC_SETSTATUS also cannot write the state bits while the control loop runs.
    let mut bus = Bus::running();
    for text in ["1C1#2000", "1C1#1010", "1C1#0010"] {
        bus.send(text);
        assert_eq!(bus.status(1), 0xAB, "{text}");
    }
}

/// D-T8, D-20, D-23: the status byte of a board is correct in every state.
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

/// D-T9, D-30: a board starts its application, or reports an error if it has no application.
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

/// D-T10, D-36, D-12: the board sends the dimensions of its buffers, and then one string for each signal. The board does not treat a frame
/// with data as a request.
#[test]
fn d_t10_io_description() {
    let mut bus = Bus::started();
    let start = bus.now;
    bus.send("581#");
    bus.run(100);
    assert!(bus.received[0].0 - start >= 2 * MS, "D-05: not before the request is gone");
    let received = bus.take();
    assert_eq!(
        received[..6],
        frames(
            "581#020004000300 581#0200 581#55436F4D32206865 581#61642070616E 581#0100 581#706F735F736F6C6C"
        )
    );
    // The test counts the packages itself, without code of the board. Each string begins with a header package of 2
    // bytes.
    let mut strings = 0;
    let mut rest = received[1..].iter();
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

/// D-T11, D-15: a board sends seven initial inputs in three packages.
#[test]
fn d_t11_initial_inputs() {
    for endian in [Endian::Little, Endian::Big] {
        let mut bus = Bus::new(&[0x21], Profile { endian, ..Profile::default() });
        let names = ["a", "b", "c", "d", "e", "f", "g"];
        bus.boards[0].application = ucom_sim::memory::MemoryApplication::new("x", &names, &[], &[]);
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

/// D-T12, D-34: a board ignores inputs with numbers beyond the last input.
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

/// D-T13, D-50: without the PC's heartbeat, the board ends its control loop, and only a start command starts the loop again.
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
        bus.received
            .iter()
            .filter(|(_, received)| *received == frame)
            .map(|(at, _)| at - start)
            .collect::<Vec<_>>()
    };
    let stopped = at("601#00000000");
    assert_eq!(stopped.len(), 1);
    assert!((1500 * MS..1510 * MS).contains(&stopped[0]), "{stopped:?}");
    let last_output =
        bus.received.iter().filter(|(_, frame)| frame.id() == 0x381).map(|(at, _)| at - start).max();
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

/// D-T14, D-50: one missing heartbeat of the PC has no effect, and three missing heartbeats end the control loop.
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

/// D-T15, D-37, D-12: a board ignores flags other than 0 and 1, and reports an MCA_ADMIN_DATA frame that is too short.
#[test]
fn d_t15_bad_flags() {
    let mut bus = Bus::started();
    assert_eq!(bus.ask("601#02000000", 100), []);
    assert_eq!(bus.ask("601#010000", 100), frames("081#07"));
    assert_eq!(bus.boards[0].status(), Status(0x8B));
}

/// D-T16, D-25: the application starts automatically only after the hold-off time.
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
    let (status, received) = chain(&[]);
    assert_eq!(status, 0xC9, "S5, never S6");
    assert_eq!(received[..2], frames("0C1#01 501#"));
    assert_eq!(chain(&[("680#", 290), ("041#", 1)]), (0x5D, frames("0C1#01")));
    assert_eq!(chain(&[("680#", 290), ("1C1#4000", 1)]), (0x19, frames("0C1#01")));
    assert_eq!(chain(&[("680#", 290), ("1C1#0404", 1)]), (0x5D, frames("0C1#01")));
    // The application starts only once after the board has got a number, even if the PC assigns the same number
    // again.
    assert_eq!(chain(&[("680#", 600), ("1C1#8000", 10), ("281#", 10)]).0, 0x59);
    // The application does not start before the hold-off time of 500 ms has passed. A board without an application
    // sends error 11.
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

/// D-T20, D-24, D-06: a second PC_INIT arrives before the acknowledgement of the first PC_INIT has been sent. The
/// board reports an error and keeps the first number.
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

/// D-T21, D-07: two boards with the same flash id send the same identifier with the same data, so they look like one
/// board.
#[test]
fn d_t21_equal_flash_ids_look_like_one_board() {
    let mut bus = Bus::new(&[0x21, 0x121], Profile::default());
    let mut received = bus.ask("000#", 500);
    received.dedup();
    assert_eq!(received, frames("441#21"));
}
