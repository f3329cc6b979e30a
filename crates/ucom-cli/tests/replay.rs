//! Tests of recordings that contain more than the data frames of one bus. `replay` and `send` examine all frames before
//! they send the first frame.
#![cfg(unix)]

use crate::common;

use common::{Sim, ucom, ucom_with};
use serde_json::json;

const MIXED: &str = "(1.000000) can0 240#\n(1.001000) can0 123#R\n(1.002000) can0 123##1112233\n(1.003000) can0 000#\n\
                     (1.004000) can0 20000040#0000000000000000\n(1.005000) can0 201#\n";

/// The simulated bus cannot carry remote frames and CAN FD frames, and no program can send an error frame. `replay` sends all other
/// frames, and reports each frame that it does not send.
#[test]
fn replay_counts_the_frames_that_it_cannot_send() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let file = sim.file("mixed.log", MIXED.as_bytes());
    let mut peer = sim.peer();
    let replay = sim.json(&["replay", &file], 0);
    let why = json!({ "error": 1, "fd": 1, "intrusive": 1, "remote": 1 });
    assert_eq!((&replay["sent"], &replay["left_out"], &replay["frames"]), (&json!(2), &json!(4), &json!(6)));
    assert_eq!(replay["left_out_why"], why, "{replay}");
    let sent: Vec<String> = peer.all(200).into_iter().filter(|f| f == "240#" || f == "201#").collect();
    assert_eq!(sent, ["240#", "201#"]);
    let text = sim.ucom(&["replay", &file]).ends(0).out;
    for words in ["2 frames sent", "1 error frame", "1 remote frame", "1 CAN FD frame", "--intrusive"] {
        assert!(text.contains(words), "{text}");
    }
}

/// `send` sends all frames of its command line, or none.
#[test]
fn send_examines_all_frames_before_the_first() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let mut peer = sim.peer();
    for odd in ["123#R", "123##1112233", "20000040#0000000000000000", "000#", "nonsense"] {
        let code = if odd == "000#" { 4 } else { 2 };
        let output = sim.ucom(&["send", "240#", odd]).ends(code);
        assert!(!output.err.contains("doctor"), "{odd}: {}", output.err);
        assert!(odd != "123#R" || output.err.contains("nothing was sent"), "{}", output.err);
        assert_eq!(peer.all(50), [""; 0], "{odd}");
    }
}

/// `decode` names the errors that a CAN controller reported.
#[test]
fn decode_names_error_frames() {
    let text = "(1.0) can0 20000040#0000000000000000\n(1.1) can0 20000024#0028000000000000\n";
    let output = ucom_with(&["decode", "-"], text).ends(0).out;
    let lines: Vec<&str> = output.lines().collect();
    assert!(lines[0].contains("error frame") && lines[0].ends_with("bus-off"), "{output}");
    assert!(lines[1].ends_with("no acknowledge, transmit warning, transmit passive"), "{output}");
}

/// Two CAN interfaces can belong to two chains. `replay` and `decode` name the interfaces, and use only a selected interface.
#[test]
fn a_recording_of_two_buses_needs_a_choice() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let text = "(1.0) can0 240#\n(1.1) can1 201#\n(1.2) can0 202#\n";
    let file = sim.file("two.log", text.as_bytes());
    let mut peer = sim.peer();
    for words in [&["replay", &file][..], &["decode", &file]] {
        let error = sim.ucom(words).ends(2).err;
        assert!(error.contains("can0 (2 frames), can1 (1 frame)"), "{error}");
        assert!(error.contains("--interface NAME"), "{error}");
        let error = sim.ucom(&[words, &["--interface", "can7"]].concat()).ends(2).err;
        assert!(error.contains("can7") && error.contains("can0 (2 frames)"), "{error}");
    }
    let error = ucom_with(&["decode", "-"], text).ends(2);
    assert!(error.err.contains("can0, can1") && error.err.contains("--interface"), "{}", error.err);
    assert_eq!(peer.all(50), [""; 0], "nothing was sent");
    assert_eq!(sim.json(&["replay", &file, "--interface", "can1"], 0)["sent"], 1);
    let lines = |output: String| output.lines().count();
    assert_eq!(lines(sim.ucom(&["decode", &file, "--interface", "can0"]).ends(0).out), 2);
    assert_eq!(lines(ucom_with(&["decode", "-", "--interface", "can1"], text).ends(0).out), 1);
}

/// Two recordings in one file have no common time. `replay` refuses such a file, and `decode` names the place.
#[test]
fn two_recordings_in_one_file_are_not_replayed() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let file = sim.file("joined.log", b"(100.0) can0 240#\n(101.0) can0 201#\n(5.5) can0 240#\n");
    let mut peer = sim.peer();
    let error = sim.ucom(&["replay", &file]).ends(2).err;
    assert!(error.contains("the time of frame 3 is 95.500 s before the time of frame 2"), "{error}");
    assert_eq!(peer.all(50), [""; 0], "nothing was sent");
    let output = ucom(&["decode", &file]).ends(0);
    assert!(output.err.contains("frame 3 is 95.500 s earlier"), "{}", output.err);
    // Interfaces of one computer can report frames a little out of order.
    let file = sim.file("jitter.log", b"(1.0) can0 240#\n(0.9999) can0 201#\n");
    sim.ucom(&["replay", &file]).ends(0);
}

/// The output of candump without `-L` is not a recording, and the message says so.
#[test]
fn the_view_of_candump_is_recognised() {
    let sim = Sim::start(&["--boards", "1"]);
    for text in [
        "  can0  240   [0]\n",
        " (1436509052.249713)  can0  12345678   [8]  11 22 33 44 55 66 77 88\n",
        "  can0  TX - -  123  [8]  remote request\n",
        "  vcan0  123  [08]  11 22 33 44 55 66 77 88   '.\"3DUfw.'\n",
    ] {
        let file = sim.file("terminal.log", text.as_bytes());
        for error in [
            ucom(&["decode", &file]).ends(2).err,
            ucom_with(&["decode", "-"], text).ends(2).err,
            sim.ucom(&["replay", &file]).ends(2).err,
        ] {
            assert!(error.contains("line 1: ") && error.contains("`candump -L`"), "{text}: {error}");
        }
    }
}
