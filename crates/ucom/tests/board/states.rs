//! Tests of the state table of a board; the tests send each event in each state.

use ucom::node::Phase;
use ucom::{Frame, Profile, Sequence, Status};

use super::bus::{Bus, blocks, frames, image};

/// Columns of the state table. S3x (`Aborted`) and S4 (`Starting`) are separate columns here.
const STATES: [Phase; 7] = [
    Phase::Uninitialised,
    Phase::Idle,
    Phase::Programming,
    Phase::Aborted,
    Phase::Starting,
    Phase::Ready,
    Phase::Running,
];

/// Returns board 1 (flash number 0x21) in the given state, with no frame waiting for the bus.
fn in_state(phase: Phase) -> Bus {
    let mut bus = match phase {
        Phase::Uninitialised => Bus::one(),
        Phase::Ready => Bus::started(),
        Phase::Running => Bus::running(),
        _ => Bus::initialised(),
    };
    match phase {
        Phase::Programming => bus.send("041#"),
        Phase::Aborted => {
            bus.send("041#");
            bus.send("2C1#00");
            bus.run(1);
        }
        Phase::Starting => {
            bus.boards[0].application.start_us = 1_000_000;
            bus.send("301#");
        }
        _ => {}
    }
    assert_eq!(bus.boards[0].phase(), phase);
    bus.take();
    bus
}

/// State and frames of a board after an event.
struct Seen {
    phase: Phase,
    /// Frames that the board sent within 9 ms, without the periodic outputs.
    sent: Vec<Frame>,
}

fn event(phase: Phase, text: &str) -> Seen {
    let mut bus = in_state(phase);
    // In S6, the board sends its outputs every 10 ms; output frames are not answers.
    let sent = bus.ask(text, 9).into_iter().filter(|frame| frame.id() != 0x381).collect();
    Seen { phase: bus.boards[0].phase(), sent }
}

/// Checks one row of the state table. For each state, `expected` returns the state after the event and the frames that the board sends.
fn row(text: &str, expected: impl Fn(Phase) -> (Phase, &'static str)) {
    for phase in STATES {
        let seen = event(phase, text);
        let (after, sent) = expected(phase);
        assert_eq!(seen.phase, after, "{text} in {phase:?}");
        assert_eq!(seen.sent, frames(sent), "{text} in {phase:?}");
    }
}

use Phase::*;

#[test]
fn d23_pc_reset_in_every_state() {
    for phase in STATES {
        for text in ["000#", "001#"] {
            let mut bus = in_state(phase);
            bus.boards[0].application.active = phase == Running;
            let received = bus.ask(text, 500);
            if text == "001#" && phase == Uninitialised {
                assert_eq!(received, [], "nobody has this number");
                continue;
            }
            let expected = frames("441#21");
            let reports: Vec<_> = received.into_iter().filter(|frame| frame.id() != 0x381).collect();
            assert_eq!(reports, expected, "{text} in {phase:?}");
            assert_eq!(bus.boards[0].status(), Status(0x11));
            assert_eq!(bus.boards[0].phase(), Uninitialised);
            let application = &bus.boards[0].application;
            assert!(!application.active && !application.running && application.started_us.is_none());
        }
    }
}

#[test]
fn d07_pc_report_in_every_state() {
    for phase in STATES {
        let mut bus = in_state(phase);
        let status = bus.boards[0].status();
        let received = bus.ask("240#", 40);
        assert_eq!(received.iter().filter(|frame| **frame == frames("441#21")[0]).count(), 1, "{phase:?}");
        assert_eq!(bus.boards[0].status(), status, "{phase:?}");
    }
}

#[test]
fn d24_pc_init_in_every_state() {
    row("281#", |phase| (if phase == Uninitialised { Idle } else { phase }, "0C1#01"));
    row("282#", |phase| if phase == Uninitialised { (Idle, "0C2#02") } else { (phase, "") });
    // Number 0 is the broadcast number and never belongs to a board.
    row("280#", |phase| (phase, ""));
    let mut bus = Bus::one();
    bus.boards[0].pins.input.store(false, std::sync::atomic::Ordering::SeqCst);
    assert_eq!(bus.ask("281#", 100), [], "the incoming pin is off");
    assert_eq!(bus.boards[0].status(), Status(0x10));
}

#[test]
fn d04_pc_info_in_every_state() {
    for phase in STATES {
        for text in ["201#", "200#"] {
            let mut bus = in_state(phase);
            let received: Vec<_> = bus.ask(text, 9).into_iter().filter(|frame| frame.id() == 0x141).collect();
            assert_eq!(received.len(), if phase == Uninitialised { 0 } else { 4 }, "{text} in {phase:?}");
        }
    }
}

#[test]
fn d23_xreset_in_every_state() {
    let after = |phase| if phase == Uninitialised { phase } else { Programming };
    row("041#", |phase| (after(phase), ""));
    row("040#", |phase| (after(phase), ""));
    for phase in STATES {
        let mut bus = in_state(phase);
        bus.send("041#");
        let expected = if phase == Uninitialised { 0x11 } else { 0x1F };
        assert_eq!(bus.boards[0].status(), Status(expected), "number and pin survive, {phase:?}");
        assert!(!bus.boards[0].application.active);
    }
}

#[test]
fn d22_set_status_prog_in_every_state() {
    row("1C1#0404", |phase| (if phase == Idle { Programming } else { phase }, ""));
    row("1C1#0400", |phase| match phase {
        Programming | Aborted => (Idle, ""),
        other => (other, ""),
    });
    // After an aborted transfer, the board ignores program data until PROG changes from 0 to 1.
    let mut bus = in_state(Aborted);
    bus.send("1C1#0400");
    bus.send("1C1#0404");
    assert_eq!(bus.boards[0].phase(), Programming);
}

#[test]
fn d22_set_status_mstart_in_every_state() {
    row("1C1#8080", |phase| match phase {
        Idle | Programming | Aborted => (Starting, ""),
        other => (other, ""),
    });
    row("1C1#8000", |phase| match phase {
        Starting | Ready | Running => (Idle, ""),
        other => (other, ""),
    });
}

#[test]
fn d22_set_status_init_in_every_state() {
    row("1C1#0800", |_| (Uninitialised, ""));
    for phase in STATES {
        let mut bus = in_state(phase);
        bus.send("1C1#0800");
        assert_eq!(bus.boards[0].status(), Status(0x11), "{phase:?}");
        assert!(!bus.boards[0].application.active);
    }
    // The change 0→1 of the bit INIT does not give the board a number.
    row("1C1#0808", |phase| (phase, ""));
}

#[test]
fn d43_pc_prog_in_every_state() {
    row("2C1#4355010001000000", |phase| match phase {
        Idle | Starting | Ready | Running => (phase, "081#02"),
        other => (other, ""),
    });
    row("2C0#4355010001000000", |phase| (phase, ""));
    row("2C0#43550100010000", |phase| if phase == Programming { (Aborted, "081#07") } else { (phase, "") });
}

/// D-12, D-06: a board reports a frame that is too short, unless the board would also ignore the frame with the
/// correct length.
#[test]
fn d12_short_frames_in_every_state() {
    row("1C1#02", |phase| (phase, if phase == Uninitialised { "" } else { "081#07" }));
    row("2C1#00", |phase| match phase {
        Programming => (Aborted, "081#07"),
        Idle | Starting | Ready | Running => (phase, "081#07"),
        other => (other, ""),
    });
    for text in ["341#0000", "3C1#0000", "601#010000"] {
        row(text, |phase| (phase, if matches!(phase, Ready | Running) { "081#07" } else { "" }));
    }
}

/// D-12: with `dlc.strict`, the board also reports surplus data bytes.
#[test]
fn d12_long_frames_when_lengths_are_strict() {
    for (text, idle, ready) in [
        ("281#00", "081#07", "081#07"),
        ("282#00", "", ""),
        ("301#00", "081#07", "081#07"),
        ("541#00", "", "081#07"),
        ("5C1#00", "", "081#07"),
        ("680#00", "", "081#07"),
    ] {
        let mut bus = Bus::new(&[0x21], Profile { dlc_strict: true, ..Profile::default() });
        assert_eq!(bus.ask(text, 9), [], "without a number");
        bus.number(1);
        assert_eq!(bus.ask(text, 9), frames(idle), "{text}");
        bus.ask("301#", 50);
        assert_eq!(bus.ask(text, 9), frames(ready), "{text}");
    }
}

#[test]
fn d30_pc_start_in_every_state() {
    for text in ["301#", "300#"] {
        row(text, |phase| match phase {
            Idle | Programming | Aborted => (Starting, ""),
            Ready | Running => (phase, "501#"),
            other => (other, ""),
        });
    }
}

#[test]
fn d30_mca_pc_start_in_every_state() {
    for text in ["541#", "540#"] {
        row(text, |phase| match phase {
            Ready | Running => (Running, "601#01000000"),
            other => (other, ""),
        });
    }
}

#[test]
fn d37_admin_in_every_state() {
    row("601#00000000", |phase| match phase {
        Ready | Running => (Ready, "601#00000000"),
        other => (other, ""),
    });
    row("601#01010000", |phase| match phase {
        Ready | Running => (Running, "601#01010000"),
        other => (other, ""),
    });
    // The flag `active` can be set only with `run`; the other flags do not need `run`.
    row("600#00010101", |phase| match phase {
        Ready | Running => (Ready, "601#00000101"),
        other => (other, ""),
    });
}

#[test]
fn d34_d35_inputs_and_parameters_in_every_state() {
    for phase in STATES {
        for text in ["341#010007000000", "3C1#010007000000"] {
            let mut bus = in_state(phase);
            let received: Vec<_> = bus.ask(text, 9).into_iter().filter(|frame| frame.id() != 0x381).collect();
            assert_eq!(received, [], "{text} in {phase:?}");
            let application = &bus.boards[0].application;
            let taken = application.latched_ci[1] == 7 || application.par[1] == 7;
            assert_eq!(taken, matches!(phase, Ready | Running), "{text} in {phase:?}");
        }
        // Inputs and parameters that the PC sends by broadcast have no effect.
        let mut bus = in_state(phase);
        bus.send("340#010007000000");
        bus.send("3C0#010007000000");
        assert_eq!(bus.boards[0].application.latched_ci[1] + bus.boards[0].application.par[1], 0);
    }
}

/// D-36: a board sends dumps only while its application is running, and never after a broadcast request.
#[test]
fn d36_dumps_in_every_state() {
    for phase in STATES {
        for (text, id) in [("581#", 0x581), ("5C1#", 0x6C1)] {
            let mut bus = in_state(phase);
            let some = bus.ask(text, 9).iter().any(|frame| frame.id() == id);
            assert_eq!(some, matches!(phase, Ready | Running), "{text} in {phase:?}");
        }
        let mut bus = in_state(phase);
        bus.send("580#");
        let received = bus.ask("5C0#", 9);
        assert!(received.iter().all(|frame| frame.id() == 0x381), "{phase:?}");
    }
}

/// D-26: a board that reboots without a command sends one report about the reboot.
#[test]
fn d26_spontaneous_report() {
    for phase in STATES {
        let mut bus = in_state(phase);
        let now = bus.now;
        bus.boards[0].restart(now);
        bus.run(1000);
        assert_eq!(bus.take(), frames("441#21"), "{phase:?}");
        assert_eq!(bus.boards[0].status(), Status(0x11));
    }
}

/// D-21: only PC_SETSTATUS and the loss of the board's number change the level of the outgoing pin. After the loss, the pin is inactive.
#[test]
fn d21_pin_of_the_next_board() {
    let mut bus = Bus::new(&[0x21, 0x42], Profile::default());
    bus.ask("281#", 10);
    let out = |bus: &Bus| bus.boards[1].status().has(Status::IPINIT);
    assert!(!out(&bus));
    bus.send("1C1#0202");
    assert!(out(&bus));
    bus.send("041#");
    assert!(out(&bus), "PC_XRESET keeps it");
    bus.send("001#");
    assert!(!out(&bus));
}

/// D-42, D-43: a cancelled transfer leaves no trace: the board is idle and sends nothing, and a new transfer
/// succeeds.
#[test]
fn d43_cancel_and_again() {
    let mut bus = in_state(Programming);
    let all = blocks(&image(), &Profile::default());
    for block in &all[..9] {
        assert_eq!(bus.block(block, 5), frames("181#"));
    }
    bus.send("2C1#0011223344556677");
    bus.send("1C1#0400");
    assert_eq!(bus.boards[0].phase(), Idle);
    bus.run(300);
    assert_eq!(bus.take(), [], "the frame of the cancelled block is forgotten");
    bus.send("041#");
    for (i, block) in all.iter().enumerate() {
        assert_eq!(bus.block(block, 200).len(), 1, "block {i}");
    }
    assert_eq!(bus.boards[0].record().unwrap().program_id, 0x4B3F);
}

/// D-24: the board loses its number while its acknowledgement is in the CAN controller, and the controller fails to
/// send it. The board does not send the acknowledgement again, and has nothing else to do.
#[test]
fn d24_no_acknowledge_without_a_number() {
    let mut bus = in_state(Idle);
    let board = &mut bus.boards[0];
    let (now, ack) = (bus.now, "0C1#01".parse::<Frame>().unwrap());
    board.receive(now, &"281#".parse().unwrap());
    assert_eq!(board.poll(now), Some(ack));
    board.receive(now, &"1C1#0800".parse().unwrap());
    board.not_sent(now, &ack);
    assert_eq!(board.number(), None);
    assert_eq!(board.poll(now), None);
    assert!(board.next_deadline() > now, "nothing to do");
}

/// D-24: the board loses its number while its acknowledgement is in the CAN controller, and the PC assigns another number. When the old
/// acknowledgement is sent, the board does not accept the new number yet.
#[test]
fn d24_acknowledge_of_a_forgotten_number() {
    let mut bus = in_state(Idle);
    let (now, board) = (bus.now, &mut bus.boards[0]);
    let [first, second] = ["0C1#01", "0C2#02"].map(|text| text.parse::<Frame>().unwrap());
    board.receive(now, &"281#".parse().unwrap());
    assert_eq!(board.poll(now), Some(first));
    board.receive(now, &"1C1#0800".parse().unwrap());
    board.receive(now, &"282#".parse().unwrap());
    board.sent(now, &first);
    assert_eq!(board.number(), None);
    assert_eq!(board.poll(now), Some(second));
    board.sent(now, &second);
    assert_eq!(board.number(), Sequence::new(2));
}
