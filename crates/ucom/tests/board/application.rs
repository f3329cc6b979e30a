//! Tests of times and rates of a running board. The acceptance table does not contain these times and rates.

use ucom::profile::CiLatch;
use ucom::{Frame, FromBoard, Profile, Status, StringAssembler};

use super::bus::{Bus, MS, frames};

/// Returns the debug texts in the received frames.
fn texts(received: &[Frame]) -> Vec<String> {
    let profile = Profile::default();
    let mut assembler = StringAssembler::<512>::new();
    let mut texts = Vec::new();
    for frame in received {
        if let Ok((_, FromBoard::Debug(payload))) = FromBoard::decode(frame, &profile)
            && let ucom::Assembled::Complete(text) = assembler.push(0, &payload, &profile)
        {
            texts.push(text.to_string());
        }
    }
    texts
}

/// D-05: on an identifier that the PC and the boards share, a board sends an answer 2 ms after the request. The board
/// sends a message without a request after a random time of 1 to 8 ms, which differs between boards.
#[test]
fn d05_shared_identifiers() {
    let mut delays = std::collections::BTreeSet::new();
    for flash_number in 1..40 {
        let mut bus = Bus::new(&[flash_number], Profile::default());
        bus.number(1);
        bus.send("301#");
        bus.run(50);
        let at = |id: u16, bus: &Bus| bus.received.iter().find(|(_, frame)| frame.id() == id).unwrap().0;
        let delay = at(0x601, &bus) - at(0x501, &bus);
        assert!((MS..=9 * MS).contains(&(delay + 200)), "{delay} µs");
        delays.insert(delay / MS);
        bus.take();
        bus.send("601#00000100");
        let asked = bus.now;
        bus.run(10);
        assert!((2 * MS..3 * MS).contains(&(at(0x601, &bus) - asked)));
    }
    assert!(delays.len() >= 6, "{delays:?}");
}

/// D-33: a board sends one snapshot of all sensor outputs every 10 ms, with ascending offsets.
#[test]
fn d33_outputs() {
    let mut bus = Bus::running();
    bus.received.clear();
    let start = bus.now;
    for i in 0..50u16 {
        bus.boards[0].application.so = vec![i; 4];
        bus.run(10);
    }
    let outputs: Vec<_> = bus.received.iter().filter(|(_, frame)| frame.id() == 0x381).collect();
    assert_eq!(outputs.len(), 100);
    for (i, pair) in outputs.chunks(2).enumerate() {
        assert_eq!((pair[0].1.data()[0], pair[1].1.data()[0]), (0, 3));
        assert_eq!(pair[0].1.data()[2], pair[1].1.data()[2], "one snapshot");
        let late = (pair[0].0 - start) as i64 - 10 * MS as i64 * i as i64;
        assert!((0..=10 * MS as i64).contains(&late), "{late}");
    }
}

/// D-33: if the bus is too busy for the sensor outputs, the board skips them. The length of the board's queue remains limited.
#[test]
fn d33_outputs_on_a_blocked_bus() {
    let mut bus = Bus::running();
    bus.hold = |_| true;
    bus.run(1000);
    assert!(bus.boards[0].counters().so_skipped > 50);
    bus.received.clear();
    bus.release();
    bus.run(9);
    assert!(bus.take().len() <= 6);
}

/// D-34, D-50: each start of the application sets the inputs to their initial values, even if the PC has changed the
/// inputs before.
#[test]
fn d34_initial_inputs_at_the_start() {
    let mut bus = Bus::initialised();
    bus.boards[0].application.initial_ci = vec![11, 22];
    for _ in 0..2 {
        bus.send("301#");
        bus.run(50);
        assert_eq!(bus.boards[0].application.latched_ci, [11, 22]);
        bus.send("341#0000050006000000");
        assert_eq!(bus.boards[0].application.latched_ci, [5, 6]);
        bus.send("1C1#8000");
    }
}

/// D-34: with `ci.latch = last`, all inputs take effect together.
#[test]
fn d34_latch_last() {
    let profile = Profile { ci_latch: CiLatch::Last, ..Profile::default() };
    let mut bus = Bus::new(&[0x21], profile);
    bus.boards[0].application =
        ucom_sim::memory::MemoryApplication::new("x", &["a", "b", "c", "d"], &[], &[]);
    bus.number(1);
    bus.send("301#");
    bus.run(50);
    bus.send("341#0000010002000300");
    assert_eq!(bus.boards[0].application.latched_ci, [0; 4]);
    bus.send("341#0300040000000000");
    assert_eq!(bus.boards[0].application.latched_ci, [1, 2, 3, 4]);
}

/// D-38: a board sends debug texts only if the PC requests them, at most 20 texts in any second.
#[test]
fn d38_debug_texts() {
    let mut bus = Bus::started();
    let text = |i: u32| format!("text {i}").into_bytes();
    bus.boards[0].application.debug = (0..5).map(text).collect();
    bus.run(100);
    assert!(texts(&bus.take()).is_empty());
    assert!(bus.boards[0].application.debug.is_empty(), "what nobody wants is dropped");
    for flags in ["601#00000100", "601#00000001"] {
        bus.send(flags);
        bus.run(5);
        bus.take();
        let start = bus.now;
        for i in 0..200 {
            bus.boards[0].application.debug.push(text(i));
            bus.run(10);
        }
        let received = texts(&bus.take());
        let seconds = (bus.now - start).div_ceil(1000 * MS) as usize;
        assert!((20..=20 * (seconds + 1)).contains(&received.len()), "{}", received.len());
        assert_eq!(received[0], "text 0");
        bus.run(1500);
        bus.take();
    }
    assert!(bus.boards[0].counters().texts_dropped > 300);
}

/// D-50: a board reports the loss of the PC as a debug text if the PC requested texts. The debug flags of the board do not change.
#[test]
fn d50_text_when_the_pc_is_lost() {
    let mut bus = Bus::started();
    bus.send("601#01010100");
    bus.run(1600);
    let received = bus.take();
    assert_eq!(texts(&received), ["PC alive lost"]);
    assert!(received.contains(&frames("601#00000100")[0]));
}

/// A board sends its heartbeat every second while the application is running. D-51 defines the reaction of the PC.
#[test]
fn d51_heartbeat_of_the_board() {
    let mut bus = Bus::started();
    bus.run(10_000);
    assert_eq!(bus.take(), vec![frames("681#")[0]; 10]);
    bus.send("1C1#8000");
    bus.run(3000);
    assert_eq!(bus.take(), []);
}

/// Section 9: a board sends an error code at most ten times per second. This limit does not delay other error codes.
#[test]
fn d34_error_rate() {
    let mut bus = Bus::started();
    for i in 0..100 {
        bus.send("341#FFFF0000");
        if i == 50 {
            bus.send("1C1#00");
        }
        bus.run(5);
    }
    let received = bus.take();
    assert_eq!(received.iter().filter(|frame| frame.data() == [5]).count(), 10);
    assert_eq!(received.iter().filter(|frame| frame.data() == [7]).count(), 1);
    assert_eq!(bus.boards[0].counters().errors_dropped, 90);
}

/// D-14: if the PC repeats a request while the board answers it, the second answer follows after the first answer. The board does not mix
/// packages of different strings.
#[test]
fn d14_requests_during_their_answers() {
    let mut bus = Bus::started();
    let one = bus.ask("581#", 50);
    bus.send("581#");
    bus.run(3);
    bus.send("581#");
    bus.run(50);
    assert_eq!(bus.take(), [one.clone(), one].concat());
    let one = bus.ask("201#", 50);
    bus.send("201#");
    bus.send("201#");
    bus.run(50);
    assert_eq!(bus.take(), [one.clone(), one].concat());
}

/// D-34, D-35: the node calls the control cycle periodically while the loop runs, and does not call it at other times.
#[test]
fn d35_control_cycles() {
    let mut bus = Bus::started();
    bus.run(100);
    assert_eq!(bus.boards[0].application.steps, 0);
    bus.send("541#");
    bus.run(100);
    let steps = bus.boards[0].application.steps;
    assert!((99..=101).contains(&steps), "{steps}");
    bus.send("601#00000000");
    bus.run(100);
    assert_eq!(bus.boards[0].application.steps, steps);
}

/// The board reports a receive overrun of the CAN controller as error 8, and a frame that was not sent as error 6.
#[test]
fn controller_troubles_are_reported() {
    let mut bus = Bus::initialised();
    let now = bus.now;
    bus.boards[0].overrun(now);
    bus.run(1);
    assert_eq!(bus.take(), frames("081#08"));
    bus.send("281#");
    let frame = bus.boards[0].poll(bus.now).unwrap();
    bus.boards[0].not_sent(bus.now, &frame);
    bus.run(5);
    assert_eq!(bus.take(), frames("0C1#01 081#06"), "INITACK is sent again");
}

/// The board ignores `sent` and `not_sent` for every frame except the frame that is in the CAN controller.
#[test]
fn other_frames_than_the_one_on_its_way_are_ignored() {
    let mut bus = Bus::initialised();
    let now = bus.now;
    let [acknowledge, other] = ["0C1#01", "181#"].map(|text| text.parse::<Frame>().unwrap());
    let board = &mut bus.boards[0];
    board.receive(now, &"281#".parse().unwrap());
    assert_eq!(board.poll(now), Some(acknowledge));
    board.sent(now, &other);
    board.not_sent(now, &other);
    board.receive(now, &"1C1#00".parse().unwrap());
    assert_eq!(board.poll(now), None, "the acknowledge is still on its way");
    board.sent(now, &acknowledge);
    assert_eq!(board.poll(now), Some("081#07".parse().unwrap()), "and no DSP_ERROR 6 before it");
    assert_eq!(board.counters().not_sent, 0);
    // The CAN controller has sent the frame. A later `not_sent` for the same frame must not make the board send it
    // again.
    board.sent(now, &acknowledge);
    board.not_sent(now, &acknowledge);
    assert_eq!((board.poll(now), board.counters().not_sent), (None, 0));
}

/// D-38: while an application is starting, the board neither reads nor drops the debug texts of the application.
#[test]
fn d38_texts_of_a_program_that_is_not_up() {
    let mut bus = Bus::initialised();
    bus.boards[0].application.start_us = 1000 * MS;
    for text in ["680#", "301#"] {
        bus.boards[0].application.debug = vec![b"early".to_vec()];
        bus.ask(text, 100);
        assert_eq!(bus.boards[0].application.debug.len(), 1, "{text}");
        assert_eq!(bus.boards[0].counters().texts_dropped, 0, "{text}");
    }
    bus.run(1000);
    assert_eq!(bus.boards[0].counters().texts_dropped, 1, "up, and nobody wants it");
}

/// D-37: only a change of the flag `active` from 0 to 1 enables the outputs. If the application has made its outputs
/// safe, they stay safe when the PC repeats its flags.
#[test]
fn d37_repeated_flags_enable_nothing() {
    let mut bus = Bus::started();
    assert_eq!(bus.ask("601#01010000", 5), frames("601#01010000"));
    assert!(bus.boards[0].application.active);
    bus.boards[0].application.active = false;
    assert_eq!(bus.ask("601#01010000", 3), frames("601#01010000"));
    assert!(!bus.boards[0].application.active);
    bus.send("601#01000000");
    bus.send("601#01010000");
    assert!(bus.boards[0].application.active, "0 and 1 again");
}

/// Contract of [`ucom::node::Application`]: the node calls `stop` only for an application that runs.
#[test]
fn a_program_is_stopped_once() {
    for text in ["000#", "041#", "1C1#0800", "1C1#0404"] {
        let mut bus = Bus::initialised();
        // The application is not running, but the test sets the field `running`. If the node wrongly called `stop`,
        // this field would become `false`.
        bus.boards[0].application.running = true;
        bus.send(text);
        assert!(bus.boards[0].application.running, "{text}");
    }
    let mut bus = Bus::running();
    bus.send("1C1#8000");
    assert!(!bus.boards[0].application.running);
    assert_eq!(bus.boards[0].application.started_us, None);
}

/// D-50: a start command while the control loop runs does not count as a heartbeat of the PC.
#[test]
fn d50_a_repeated_start_is_no_heartbeat() {
    let mut bus = Bus::running();
    for _ in 0..3 {
        bus.run(400);
        bus.send("541#");
    }
    assert_eq!(bus.boards[0].status(), Status(0xAB));
    bus.run(400);
    assert_eq!(bus.boards[0].status(), Status(0x8B));
}

/// D-14, D-36: when the application ends, the board stops sending the dumps of the application, but still completes
/// its own description (DSP_INFO).
#[test]
fn d14_info_survives_the_application() {
    let mut bus = Bus::started();
    let (now, board) = (bus.now, &mut bus.boards[0]);
    for text in ["201#", "5C1#", "581#"] {
        board.receive(now, &text.parse().unwrap());
    }
    let first = board.poll(now).unwrap();
    for text in ["201#", "1C1#8000"] {
        board.receive(now, &text.parse().unwrap());
    }
    board.sent(now, &first);
    bus.run(50);
    let received = bus.take();
    assert_eq!(received.len(), 3 + 4, "the rest, and the second answer");
    assert!(received.iter().all(|frame| frame.id() == first.id()));
}

/// D-14, D-36: if the PC requests a dump of the inputs while the board sends one, the board sends one more dump
/// afterwards. If the application has no inputs, the board sends no dump.
#[test]
fn d14_dump_of_inputs_twice() {
    for (dimension, packages) in [(0, 0), (3, 1), (7, 3)] {
        let mut bus = Bus::initialised();
        let names = vec!["x"; dimension];
        bus.boards[0].application = ucom_sim::memory::MemoryApplication::new("x", &names, &[], &[]);
        bus.ask("301#", 50);
        let (now, board) = (bus.now, &mut bus.boards[0]);
        board.receive(now, &"5C1#".parse().unwrap());
        board.receive(now, &"5C1#".parse().unwrap());
        let mut offsets = Vec::new();
        while let Some(package) = board.poll(now) {
            offsets.push(package.data()[0]);
            board.sent(now, &package);
            assert!(offsets.len() < 100, "packages without end");
        }
        let once: Vec<u8> = (0..packages).map(|i| 3 * i).collect();
        assert_eq!(offsets, [once.clone(), once].concat(), "{dimension}");
        assert!(board.next_deadline() > now, "{dimension}");
    }
}
