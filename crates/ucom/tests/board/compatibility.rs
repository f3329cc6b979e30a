//! Tests of boards that use another interpretation of the protocol description, selected by the keys of their
//! profile.

use ucom::profile::{AliveMode, Broadcast, Endian, ReportMode};
use ucom::{Profile, Sequence, Status};

use super::bus::{Bus, frames};

fn with(change: impl FnOnce(&mut Profile)) -> Profile {
    let mut profile = Profile::default();
    change(&mut profile);
    profile
}

/// D-07: boards send reports in the modes that are not the default.
#[test]
fn d07_report_modes() {
    let mut bus = Bus::new(&[0x21], with(|p| p.report_mode = ReportMode::All4));
    assert_eq!(bus.ask("240#", 100), frames("401#21 441#21 481#21 4C1#21"));
    let mut bus = Bus::new(&[0x21, 0x42], with(|p| p.report_mode = ReportMode::Seq));
    bus.number(1);
    assert_eq!(bus.ask("240#", 100), frames("401#21 400#42"));
}

/// Section 5.3: two boards get the same number only if two conditions are true. Each board activates its outgoing pin
/// without a command, and the PC repeats PC_INIT without a check.
#[test]
fn d21_auto_pin_and_a_blind_repeat_make_duplicates() {
    let numbers = |auto: bool, blind: bool| {
        let mut bus = Bus::new(&[0x21, 0x42, 0x63], with(|p| p.chain_auto_opinit = auto));
        bus.number(1);
        // In this test, the PC behaves as if INITACK(2) was lost.
        bus.ask("282#", 20);
        if blind {
            bus.ask("282#", 20);
        }
        bus.ask("1C2#0202", 5);
        bus.ask("283#", 20);
        bus.boards.iter().map(|board| board.number().map_or(0, Sequence::number)).collect::<Vec<_>>()
    };
    assert_eq!(numbers(false, false), [1, 2, 3]);
    assert_eq!(numbers(false, true), [1, 2, 3]);
    assert_eq!(numbers(true, false), [1, 2, 3]);
    assert_eq!(numbers(true, true), [1, 2, 2]);
}

/// D-23: if the profile requires it, PC_XRESET deletes the number of the board. The PC can then assign the same
/// number again.
#[test]
fn d23_xreset_forgets_the_number() {
    let mut bus = Bus::new(&[0x21], with(|p| p.xreset_keeps_init = false));
    bus.number(1);
    bus.send("041#");
    assert_eq!(bus.boards[0].status(), Status(0x15));
    assert_eq!(bus.info(1), None);
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    assert_eq!(bus.status(1), 0x1D);
    // D-25: with ASTART set, a new number normally starts the application, but not during an update.
    bus.boards[0].store.autostart = true;
    bus.send("041#");
    bus.ask("281#", 2000);
    assert_eq!(bus.status(1), 0x5D);
}

/// D-10, D-13: a board sends words in big-endian order, and includes the header in the package count of a string, if
/// its profile requires this.
#[test]
fn d10_d13_words_and_counts() {
    let profile = with(|p| {
        p.endian = Endian::Big;
        p.string_count_includes_header = true;
    });
    let mut bus = Bus::new(&[0x21], profile);
    bus.number(1);
    let expected = "141#0021011B1234386E 141#0003 141#55436F4D32206865 141#61642070616E";
    assert_eq!(bus.ask("201#", 20), frames(expected));
}

/// D-15: with `pd_short_last`, the last package of a buffer contains no unused words.
#[test]
fn d15_short_last_package() {
    let mut bus = Bus::new(&[0x21], with(|p| p.pd_short_last = true));
    bus.number(1);
    bus.send("301#");
    bus.run(50);
    assert_eq!(bus.ask("5C1#", 20), frames("6C1#000000000000"));
}

/// D-04: boards use the addresses of their profile. The test covers a profile with the first number 0 and the
/// broadcast number 31, and a profile without a broadcast number.
#[test]
fn d04_other_addresses() {
    let profile = with(|p| {
        p.addr_first = 0;
        p.addr_broadcast = Broadcast::ThirtyOne;
    });
    let mut bus = Bus::new(&[0x21, 0x42], profile);
    assert_eq!(bus.ask("01F#", 300), frames("441#21 482#42"));
    assert_eq!(bus.ask("280#", 20), frames("0C0#00"));
    assert_eq!(bus.ask("29F#", 20), [], "31 is not a board");
    bus.send("1C0#0202");
    assert_eq!(bus.ask("281#", 20), frames("0C1#01"));
    assert_eq!(bus.ask("21F#", 20).iter().filter(|frame| frame.dlc() == 8).count(), 4, "both boards");
    let mut bus = Bus::new(&[0x21], with(|p| p.addr_broadcast = Broadcast::None));
    assert_eq!(bus.ask("000#", 300), frames("441#21"), "boards without a number receive 0");
    bus.number(1);
    assert_eq!(bus.ask("000#", 300), []);
    assert_eq!(bus.ask("200#", 300), []);
    assert_eq!(bus.ask("241#", 300), frames("441#21"));
}

/// D-04, D-50: the key `alive.mode` determines which heartbeats keep the control loop running: broadcast heartbeats,
/// heartbeats to the single board, or both.
#[test]
fn d50_unicast_heartbeat() {
    let runs = |mode, text: &str| {
        let mut bus = Bus::new(&[0x21], with(|p| p.alive_mode = mode));
        bus.number(1);
        bus.send("301#");
        bus.run(50);
        bus.send("541#");
        for _ in 0..6 {
            bus.send(text);
            bus.run(500);
        }
        bus.boards[0].status().has(Status::MCARUN)
    };
    assert!(runs(AliveMode::Broadcast, "680#"));
    assert!(runs(AliveMode::Broadcast, "681#"));
    assert!(runs(AliveMode::Both, "680#"));
    assert!(runs(AliveMode::Unicast, "681#"));
    assert!(!runs(AliveMode::Unicast, "680#"));
    assert!(!runs(AliveMode::Broadcast, "682#"));
}

/// D-12: with `dlc.strict`, a board requires exact lengths.
#[test]
fn d12_strict_lengths() {
    let mut bus = Bus::new(&[0x21], with(|p| p.dlc_strict = true));
    bus.number(1);
    assert_eq!(bus.ask("201#0000000000000000", 20), frames("081#07"));
    let mut bus = Bus::initialised();
    assert_eq!(bus.ask("201#0000000000000000", 20).len(), 4);
}

/// D-02: a board counts frames of other protocols and ignores them.
#[test]
fn d02_foreign_frames() {
    let mut bus = Bus::initialised();
    let now = bus.now;
    let board = &mut bus.boards[0];
    let bus_format = ucom::Format::BUS;
    for (id, format) in [
        (0x000, ucom::Format { extended: true, ..bus_format }),
        (0x000, ucom::Format { remote: true, ..bus_format }),
        (0x000, ucom::Format { fd: true, ..bus_format }),
        (0x020, bus_format),
        (0x700, bus_format),
        (0x7C1, bus_format),
    ] {
        assert!(board.receive_any(now, id, format, &[]).is_err());
    }
    for text in ["020#", "701#"] {
        board.receive(now, &text.parse().unwrap());
    }
    assert_eq!(board.counters().foreign, 8);
    assert_eq!(board.status(), Status(0x1B));
    bus.run(1000);
    assert_eq!(bus.take(), []);
}

/// D-04: a board ignores the frames of other boards, even frames with its own number, and does not count them.
#[test]
fn d04_boards_do_not_listen_to_boards() {
    let mut bus = Bus::initialised();
    let now = bus.now;
    let board = &mut bus.boards[0];
    let one = Sequence::new(1).unwrap();
    for function in ucom::Function::ALL.into_iter().filter(|function| !function.from_pc()) {
        for len in [0, 8] {
            board.receive(now, &ucom::Frame::new(function.id(one), &[0; 8][..len]).unwrap());
        }
    }
    assert_eq!(*board.counters(), ucom::node::Counters::default());
    assert_eq!((board.status(), board.poll(now)), (Status(0x1B), None));
}

/// A board counts each message that its state does not allow, and does not answer the message.
#[test]
fn ignored_messages_are_counted() {
    let mut bus = Bus::initialised();
    for (i, text) in ["541#", "341#00000100", "601#02000000", "581#00"].into_iter().enumerate() {
        assert_eq!(bus.ask(text, 5), [], "{text}");
        assert_eq!(bus.boards[0].counters().ignored, i as u32 + 1, "{text}");
    }
}
