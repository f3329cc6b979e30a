//! Tests of identifiers that the PC and a board share (D-05), and of answers whose text changes during the transmission.

use proptest::prelude::*;
use ucom::Profile;

use super::bus::{Bus, MS, frames};

/// Action of the test: a wait in µs, or a frame that makes a board send its flags or descriptions.
#[derive(Clone, Copy, Debug)]
enum Act {
    Wait(u64),
    Send(&'static str),
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let send = prop::sample::select(vec![
        "601#01000000",
        "601#00000000",
        "601#01010100",
        "541#",
        "581#",
        "680#",
        "301#",
        "1C1#8000",
    ]);
    let short = (0_u64..3_000).prop_map(Act::Wait);
    // Long waits are near 1.5 s, the time limit for the PC's heartbeat. If the limit passes while the control loop
    // runs, the board sends its flags without a request.
    let long = (1_490_000_u64..1_512_000).prop_map(Act::Wait);
    let act = prop_oneof![3 => send.prop_map(Act::Send), 4 => short, 1 => long];
    prop::collection::vec(act, 1..40)
}

proptest! {
    /// D-05: on a shared identifier a board begins to send no earlier than 2 ms after the PC's last frame with this
    /// identifier.
    #[test]
    fn d05_never_within_2_ms_of_a_request(acts in acts()) {
        let mut bus = Bus::started();
        bus.boards[0].application.texts.application = b"a".to_vec();
        let mut asked: Vec<(u64, u16)> = Vec::new();
        for act in acts {
            match act {
                Act::Wait(us) => bus.run_us(us),
                Act::Send(text) => {
                    bus.send(text);
                    let id = u16::from_str_radix(&text[..3], 16).unwrap();
                    // The test also sends MCA_PC_START, because the board answers it with MCA_ADMIN_DATA. Recording
                    // this frame has no effect on the check, because boards never send this identifier.
                    asked.push((bus.now, id));
                }
            }
        }
        bus.run(50);
        for (at, frame) in &bus.received {
            // The minimum delay applies to the flags, and to the first frame of an IO description, which contains the
            // dimensions. The other frames of an IO description follow without this delay (D-14).
            let begins = frame.id() == 0x601 || (frame.id() == 0x581 && frame.dlc() == 6);
            let start = at - super::bus::duration(frame);
            let last = asked.iter().rfind(|(t, id)| *t <= start && *id == frame.id());
            if let (true, Some((request, _))) = (begins, last) {
                prop_assert!(start - request >= 2 * MS, "{frame} at {start}, asked at {request}");
            }
        }
    }
}

/// D-14: if the text of an answer becomes shorter during the transmission, the answer ends. After such an answer, the board answers later
/// requests.
#[test]
fn d14_an_answer_ends_when_its_text_changes() {
    let long = "a description of more than one package, so that it can end early".to_owned();
    for request in ["201#", "581#"] {
        let id = if request == "201#" { 0x141 } else { 0x581 };
        let begins = if request == "201#" { 8 } else { 6 };
        for asked_again in [false, true] {
            for after in 1..9 {
                let mut bus = Bus::started();
                bus.boards[0].store.description = long.clone().into_bytes();
                bus.boards[0].application.texts.application = long.clone().into_bytes();
                bus.send(request);
                // The test changes the text of the board after the board has sent `after` frames of the answer.
                while bus.received.iter().filter(|(_, f)| f.id() == id).count() < after {
                    bus.run_us(50);
                }
                bus.boards[0].store.description = b"x".to_vec();
                bus.boards[0].application.texts.application = b"x".to_vec();
                if asked_again {
                    bus.send(request);
                }
                bus.run(60);
                bus.take();
                assert!(
                    bus.ask("5C1#", 20).iter().any(|f| f.id() == 0x6C1),
                    "{request} after {after} frames"
                );
                let received = bus.ask(request, 20);
                let answer: Vec<_> = received.into_iter().filter(|f| f.id() == id).collect();
                assert_eq!(answer.iter().filter(|f| f.dlc() == begins).count(), 1, "{request}: {answer:?}");
                let end = answer[1..3] == frames(&format!("{id:03X}#0100 {id:03X}#78"));
                assert!(end, "{request} after {after} frames: {answer:?}");
            }
        }
    }
}

/// D-06, D-12: a board without a number does not report wrong lengths, even with `dlc.strict`, and does not answer. Otherwise, all boards
/// without a number would report a wrong length at the same time with the same identifier.
#[test]
fn d06_d12_no_error_without_a_number() {
    let profile = Profile { dlc_strict: true, ..Profile::default() };
    let all =
        ["000#00", "240#00", "280#00", "281#00", "282#0000", "200#00", "680#00", "000#0000000000000000"];
    for text in all {
        let mut bus = Bus::new(&[0x21, 0x22], profile);
        assert_eq!(bus.ask(text, 300), [], "{text}");
        bus.number(1);
        let expected = match text {
            // A board that has a number reports the wrong length.
            "000#00" | "240#00" | "281#00" | "200#00" | "000#0000000000000000" => "081#07",
            _ => "",
        };
        assert_eq!(bus.ask(text, 300), frames(expected), "{text} with one numbered board");
    }
}
