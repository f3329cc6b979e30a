//! Tests of how commands end: with blocked readers, after a second Ctrl-C, with lost boards, and after a failed start.
#![cfg(unix)]

use crate::common;

use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

use cli_kit::testing::{ended, signal};
use common::{Sim, ended_by};
use serde_json::json;
use test_kit::patience::until;

/// D-50: the reader of stdout does not read, and the pipe is full from the start. The PC still sends heartbeats, the
/// boards run until they are stopped at the end, and the command reports the lost output.
#[test]
fn d50_a_blocked_stdout_does_not_stop_heartbeats() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let (reader, mut writer) = std::io::pipe().unwrap();
    // A pipe has a capacity of 65,536 bytes, so this write fills the pipe completely.
    writer.write_all(&[b'\n'; 65_536]).unwrap();
    let mut peer = sim.peer();
    let mut command = sim.command();
    command.args(["--json", "run", "1", "--active", "--for", "4"]);
    let child = command.stdin(Stdio::piped()).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
    peer.wait("601#01010000");
    let (since, mut last, mut longest, mut outputs) = (Instant::now(), Instant::now(), Duration::ZERO, 0);
    while since.elapsed() < Duration::from_millis(3_500) {
        match peer.receive(50).as_deref() {
            Some("680#") => {
                longest = longest.max(last.elapsed());
                last = Instant::now();
            }
            Some("601#00000000") => panic!("the board went safe after {:?}", since.elapsed()),
            Some(frame) if frame.starts_with("381#") => outputs += 1,
            _ => {}
        }
    }
    assert!(longest < Duration::from_millis(1_400) && outputs > 200, "{longest:?}, {outputs} outputs");
    let output = ended(child).ends(0);
    assert!(output.err.contains("lines were dropped"), "{}", output.err);
    drop(reader);
    assert_eq!(sim.status_byte("1"), 0x1B);
}

/// If the reader of the `so` output does not read, Ctrl-C still works. If the reader has disconnected, the command
/// ends.
#[test]
fn outputs_that_nobody_reads() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let run = sim.spawn(&["run", "1"]);
    sim.peer().wait("381#");
    for reads in [false, true] {
        let (reader, mut writer) = std::io::pipe().unwrap();
        writer.write_all(&[b'\n'; 65_536]).unwrap();
        let mut command = sim.command();
        command.args(["so", "1", "--csv"]);
        let mut child = command.stdin(Stdio::null()).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
        drop(command);
        std::thread::sleep(Duration::from_millis(1_500));
        match reads {
            false => signal(&child, "-INT"),
            true => drop(reader),
        }
        until(format_args!("its end, reads {reads}"), || child.try_wait().unwrap().is_some());
        ended(child).ends(0);
    }
    ended_by(run, "-INT").ends(0);
}

/// The first Ctrl-C cancels the command. The second Ctrl-C ends the process at once with exit code 5, and prints the
/// remaining steps.
#[test]
fn a_second_ctrl_c_ends_at_once_and_prints_what_is_left() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let image = sim.file("image.bin", &vec![7; 60_000]);
    for (words, wait_for, what, next) in [
        (&["update", "1", &image, "--force"][..], "2C1#", "board 1 may be", "ucom update"),
        (&["run", "1,2", "--active"][..], "602#01010000", "boards 1, 2 may run", "ucom stop 1,2"),
    ] {
        let mut peer = sim.peer();
        let child = sim.spawn(words);
        peer.wait(wait_for);
        std::thread::sleep(Duration::from_millis(100));
        // The boards no longer answer, so the command needs a long time for its remaining steps.
        sim.signal("-STOP");
        signal(&child, "-INT");
        std::thread::sleep(Duration::from_millis(300));
        signal(&child, "-INT");
        let since = Instant::now();
        let output = ended(child);
        sim.signal("-CONT");
        assert!(since.elapsed() < Duration::from_millis(700), "{:?}", since.elapsed());
        let output = output.ends(5);
        assert!(output.err.contains(what) && output.err.contains(next), "{}", output.err);
        sim.ucom(&["init", "--renew", "--force"]).ends(0);
    }
}

/// Signals that arrive almost at the same time count as one signal. The command is then cancelled, and does not end
/// at once as after a second Ctrl-C.
#[test]
fn ctrl_c_and_a_wrapper_s_signal_are_one() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let child = sim.spawn(&["run", "1", "--active"]);
    sim.peer().wait("601#01010000");
    signal(&child, "-INT");
    ended_by(child, "-TERM").ends(0);
    assert_eq!(sim.status_byte("1"), 0x1B);
}

/// D-51: if a board is lost while other boards are being started, the command reports it as lost.
#[test]
fn d51_losses_during_the_start_count() {
    let sim = Sim::numbered(&["--boards", "3"]);
    // Boards send one heartbeat per second. The timeout of the PC in this test is shorter, so the boards count as
    // lost.
    let profile = sim.file("p.toml", b"alive.dsp_period = 20\nalive.dsp_lost = 40\n");
    let words = ["--json", "--profile", &profile, "run", "all", "--on-lost", "report", "--for", "0.01"];
    let output = sim.ucom(&words).ends(5);
    assert!(output.out.contains("\"stopped\"") && output.err.contains("a board was lost"), "{}", output.err);
}

/// D-37: the command makes the outputs of each board safe, even if another board fails.
#[test]
fn d37_outputs_are_made_safe_although_a_board_is_silent() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let profile = sim.file("p.toml", b"alive.dsp_lost = 20000\n");
    let mut peer = sim.peer();
    let mut child = sim.spawn(&["--profile", &profile, "run", "1,2", "--active"]);
    peer.wait("602#01010000");
    sim.fault("silent board=1 for_s=2.5");
    writeln!(child.stdin.as_mut().unwrap(), "active off").unwrap();
    peer.wait("601#01000000");
    peer.wait("602#01000000");
    std::thread::sleep(Duration::from_millis(2_500));
    let output = ended_by(child, "-INT").ends(0);
    assert!(output.err.contains("board 1: "), "{}", output.err);
}

/// P-19: after a refused or failed run, each application is in its earlier state again.
#[test]
fn p19_a_refused_run_leaves_nothing_started() {
    let sim = Sim::numbered(&["--boards", "3"]);
    sim.ucom(&["start", "2"]).ends(0);
    let bytes = || {
        let status = sim.json(&["status"], 0);
        [0, 1, 2].map(|i| status["boards"][i]["status_byte"].as_u64().unwrap())
    };
    let before = bytes();
    assert_eq!(before, [0x1B, 0x8B, 0x1B]);
    let profile = sim.file("slow.toml", b"load.limit = 1\n");
    sim.ucom(&["run", "all", "--profile", &profile]).ends(4);
    assert_eq!(bytes(), before);
    sim.ucom(&["run", "all", "--ci", "3.nonsense=1"]).ends(2);
    assert_eq!(bytes(), before);
    let missing = sim.ucom(&["run", "1,2,3,9"]).ends(3);
    assert!(missing.err.contains("board 9"), "{}", missing.err);
    assert_eq!(bytes(), before);
}

/// Before the command resets a single board, it checks that the board answers.
#[test]
fn a_reset_of_nobody_is_refused() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let mut peer = sim.peer();
    let output = sim.ucom(&["--json", "reset", "5"]).ends(3);
    assert!(output.json()["error"]["hint"].as_str().unwrap().contains("ucom scan"), "{}", output.out);
    assert!(peer.all(100).iter().all(|f| f != "005#"));
    assert_eq!(sim.json(&["reset", "2"], 0)["reports"], json!([0x22]));
    sim.ucom(&["info", "2"]).ends(3);
    sim.ucom(&["info", "1"]).ends(0);
}

/// D-26, D-51: the command reports a board that rebooted during the run as lost, not as stopped. The exit code is 5, and
/// the message contains the number of the board that has rebooted.
#[test]
fn d26_a_board_that_reboots_under_way_fails_the_run() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let child = sim.spawn(&["--json", "run", "1,2", "--active", "--on-lost", "report"]);
    sim.peer().wait("602#01010000");
    // The wait is long enough for the start of all boards.
    std::thread::sleep(Duration::from_millis(700));
    sim.fault("crash board=2");
    std::thread::sleep(Duration::from_millis(500));
    let output = ended_by(child, "-INT").ends(5);
    let events: Vec<serde_json::Value> =
        output.out.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let stopped = events.iter().find(|e| e["event"] == "stopped").unwrap();
    assert_eq!(stopped["not_stopped"], json!([2]), "{}", output.out);
    assert!(output.err.contains("has rebooted"), "{}", output.err);
    assert_eq!(sim.status_byte("1"), 0x1B);
}

/// A report that no PC has requested shows that a board has rebooted. The run fails, although every board answers at
/// the end.
#[test]
fn d26_a_reboot_counts_even_if_the_board_answers() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let child = sim.spawn(&["--json", "run", "1,2", "--on-lost", "report"]);
    let mut peer = sim.peer();
    peer.wait("382#");
    // This frame is an unrequested DSP_REPORT1 of board 2, as after a reboot.
    peer.send("442#22");
    std::thread::sleep(Duration::from_millis(300));
    let output = ended_by(child, "-INT").ends(5);
    assert!(output.err.contains("a board has rebooted"), "{}", output.err);
}

/// A silent board does not delay the stop of other boards, because the stop frames are sent before any request.
#[test]
fn a_stop_of_all_does_not_hang_on_one_board() {
    let mut sim = Sim::numbered(&["--boards", "3"]);
    let run = sim.spawn(&["run", "1,2,3", "--active", "--on-lost", "report"]);
    sim.peer().wait("603#01010000");
    let mut peer = sim.peer();
    sim.fault("silent board=1");
    let output = sim.ucom(&["--json", "stop", "1,2,3"]).ends(3);
    let value = output.json();
    assert_eq!(value["failed"][0]["board"], 1, "{}", output.out);
    let stopped: Vec<_> = value["boards"].as_array().unwrap().iter().map(|b| b["number"].clone()).collect();
    assert_eq!(stopped, [2, 3]);
    let received = peer.all(50);
    let first = received.iter().position(|f| f == "603#00000000").unwrap();
    assert!(
        received.iter().position(|f| f == "201#").unwrap() > first,
        "board 3 gets its stop before board 1 is asked"
    );

    let mut peer = sim.peer();
    sim.ucom(&["stop", "all"]).ends(0);
    let received = peer.all(50);
    assert_eq!(received.iter().filter(|f| *f == "600#00000000").count(), 3);
    let stopped = received.iter().position(|f| f == "600#00000000").unwrap();
    assert!(received.iter().position(|f| f == "240#").unwrap() > stopped, "before it asks who is there");
    ended_by(run, "-INT").ends(5);
}

/// The user presses Ctrl-C while the command starts a board only to read its signal names. The application of the
/// board is then stopped again.
#[test]
fn a_start_for_names_that_is_cancelled_is_undone() {
    let sim = Sim::numbered(&["--boards", "2"]);
    for words in [&["run", "1,2"][..], &["ci", "1", "--for", "1"]] {
        let mut peer = sim.peer();
        let child = sim.spawn(words);
        peer.wait("301#");
        let output = ended_by(child, "-INT");
        assert_ne!(output.code, 0);
        let status = sim.json(&["status", "1,2"], 0);
        let bytes = [0, 1].map(|i| status["boards"][i]["status_byte"].as_u64());
        assert_eq!(bytes, [Some(0x1B); 2], "{words:?}: {}", output.err);
    }
}

/// If the reader of stderr does not read and the pipe is full, the second Ctrl-C still ends the process. A failure of
/// the command also ends the process.
#[test]
fn a_blocked_stderr_does_not_keep_the_process() {
    let sim = Sim::numbered(&["--boards", "1"]);
    for (words, signals) in [(&["run", "1"][..], 2), (&["--json", "info", "9"], 0)] {
        let (_reader, mut writer) = std::io::pipe().unwrap();
        writer.write_all(&[b'\n'; 65_536]).unwrap();
        let mut peer = sim.peer();
        let mut command = sim.command();
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(writer);
        let mut child = command.spawn().unwrap();
        drop(command);
        peer.wait(if signals == 0 { "209#" } else { "381#" });
        if signals > 0 {
            sim.signal("-STOP");
        }
        for _ in 0..signals {
            signal(&child, "-INT");
            std::thread::sleep(Duration::from_millis(300));
        }
        until(format_args!("the end of {words:?}"), || child.try_wait().unwrap().is_some());
        sim.signal("-CONT");
        ended(child).ends(if signals > 0 { 5 } else { 3 });
    }
}

/// If the result cannot be printed, a command that changes boards still completes, and ends with exit code 5. A
/// command that only prints ends at once.
#[cfg(target_os = "linux")]
#[test]
fn a_lost_result_of_what_acts_is_a_fault() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let mut peer = sim.peer();
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for (words, code) in [
        (&["start", "1"][..], 5),
        (&["--json", "run", "1", "--for", "0.3"], 5),
        (&["info", "1"], 2),
        (&["--json", "monitor"], 2),
        (&["decode", "--live"], 2),
        (&["record", "-"], 2),
    ] {
        let mut command = sim.command();
        let child = command.args(words).stdin(Stdio::piped()).stdout(full()).stderr(Stdio::piped()).spawn();
        let child = child.unwrap();
        // After the start of the command, the test sends a frame that the command cannot print.
        std::thread::sleep(Duration::from_millis(300));
        peer.send("641#0000");
        let output = ended(child).ends(code);
        assert!(output.err.contains("No space left"), "{words:?}: {}", output.err);
    }
    assert_eq!(sim.status_byte("1"), 0x1B, "stopped all the same");
    // If the reader of stdout has disconnected, the command ends without an error.
    for words in [&["decode", "--live"][..], &["record", "-"], &["--json", "monitor"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = sim.command();
        let child = command.args(words).stdin(Stdio::piped()).stdout(writer).stderr(Stdio::piped()).spawn();
        let child = child.unwrap();
        drop(command);
        std::thread::sleep(Duration::from_millis(300));
        peer.send("641#0000");
        ended(child).ends(0);
    }
}

/// If the output of a command is blocked, the second Ctrl-C still ends the command. The exit code is 5, and the
/// message says that nothing was changed.
#[test]
fn a_second_ctrl_c_is_the_same_everywhere() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let log = sim.file("bus.log", b"(0.0) can0 240#\n(90.0) can0 240#\n");
    let big = sim.file("big.log", "(0.0) can0 240#\n".repeat(10_000).as_bytes());
    for words in [
        &["record", "-"][..],
        &["decode", "--live"],
        &["decode", &big],
        &["replay", &log],
        &["sim", "--listen", "127.0.0.1:0"],
    ] {
        // The reader of the output does not read, and the pipe is full. The command is blocked, so the first signal
        // has no visible effect.
        let (_reader, mut writer) = std::io::pipe().unwrap();
        writer.write_all(&[b'\n'; 65_536]).unwrap();
        let mut command = sim.command();
        command.args(words).stdin(Stdio::piped()).stdout(writer).stderr(Stdio::piped());
        let child = command.spawn().unwrap();
        drop(command);
        std::thread::sleep(Duration::from_millis(400));
        sim.peer().send("641#0000");
        std::thread::sleep(Duration::from_millis(200));
        signal(&child, "-INT");
        std::thread::sleep(Duration::from_millis(300));
        let output = ended_by(child, "-INT");
        // The command `replay` waits between two frames, so it can react to the first signal and may already have
        // ended.
        let alike = output.code == 5 && output.err.contains("ended at once; nothing was changed");
        assert!(
            alike || (words[0] == "replay" && output.code == 0),
            "{words:?}: {} {}",
            output.code,
            output.err
        );
    }
}

/// If the command `decode` waits for stdin, it still reacts to Ctrl-C, and decodes the input that arrived before.
#[test]
fn a_decoder_of_stdin_hears_ctrl_c() {
    let sim = Sim::start(&["--boards", "0"]);
    let mut child = sim.spawn(&["decode", "-"]);
    child.stdin.as_mut().unwrap().write_all(b"240#\n").unwrap();
    std::thread::sleep(Duration::from_millis(500));
    signal(&child, "-INT");
    let kept_open = child.stdin.take();
    let output = ended(child).ends(0);
    assert!(output.out.contains("PC_REPORT"), "{}", output.out);
    drop(kept_open);
}
