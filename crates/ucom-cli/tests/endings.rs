//! How commands end: readers that do not read, a second Ctrl-C, losses, and what is left of a start that failed.
#![cfg(unix)]

mod common;

use std::io::Write;
use std::process::Stdio;
use std::time::{Duration, Instant};

use cli_kit::trial::{ended, signal};
use common::Sim;
use serde_json::json;

/// D-50: nobody reads stdout, whose pipe is full from the start: life signs go out, boards keep running and are stopped at
/// the end, and what was not printed is told.
#[test]
fn d50_a_blocked_stdout_does_not_stop_life_signs() {
    let sim = Sim::start(&["--boards", "1"]);
    sim.ucom(&["init"]).ends(0);
    let (reader, mut writer) = std::io::pipe().unwrap();
    // What a pipe holds.
    writer.write_all(&[b'\n'; 65_536]).unwrap();
    let mut peer = sim.peer();
    let mut command = sim.command();
    command.args(["--json", "run", "1", "--active", "--for", "4"]);
    let child = command.stdin(Stdio::piped()).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
    peer.wait("601#01010000");
    let (since, mut last, mut longest, mut outputs) = (Instant::now(), Instant::now(), Duration::ZERO, 0);
    while since.elapsed() < Duration::from_millis(3_500) {
        match peer.hear(50).as_deref() {
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
    let said = ended(child).ends(0);
    assert!(said.err.contains("lines were dropped"), "{}", said.err);
    drop(reader);
    let status = sim.ucom(&["--json", "status", "1"]).ends(0).json();
    assert_eq!(status["boards"][0]["status_byte"], 0x1B);
}

/// A reader that takes nothing does not keep `so` from hearing Ctrl-C; one that has gone ends it.
#[test]
fn outputs_that_nobody_reads() {
    let sim = Sim::start(&["--boards", "1"]);
    sim.ucom(&["init"]).ends(0);
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
        let since = Instant::now();
        while child.try_wait().unwrap().is_none() {
            assert!(since.elapsed() < Duration::from_secs(8), "it does not end, reads {reads}");
            std::thread::sleep(Duration::from_millis(20));
        }
        ended(child).ends(0);
    }
    signal(&run, "-INT");
    ended(run).ends(0);
}

/// The first Ctrl-C cancels; the second one ends at once with 5 and says what is left undone and what to do.
#[test]
fn a_second_ctrl_c_ends_at_once_and_says_what_is_left() {
    let sim = Sim::start(&["--boards", "2"]);
    sim.ucom(&["init"]).ends(0);
    let image = sim.file("image.bin", &vec![7; 60_000]);
    for (words, wait_for, what, next) in [
        (&["update", "1", &image, "--force"][..], "2C1#", "boards 1 may be", "ucom update"),
        (&["run", "1,2", "--active"][..], "602#01010000", "boards 1, 2 may run", "ucom stop 1,2"),
    ] {
        let mut peer = sim.peer();
        let child = sim.spawn(words);
        peer.wait(wait_for);
        std::thread::sleep(Duration::from_millis(100));
        // Nothing answers any more: what is to be undone takes its time.
        sim.signal("-STOP");
        signal(&child, "-INT");
        std::thread::sleep(Duration::from_millis(300));
        signal(&child, "-INT");
        let since = Instant::now();
        let said = ended(child);
        sim.signal("-CONT");
        assert!(since.elapsed() < Duration::from_millis(700), "{:?}", since.elapsed());
        let said = said.ends(5);
        assert!(said.err.contains(what) && said.err.contains(next), "{}", said.err);
        sim.ucom(&["init", "--renew", "--force"]).ends(0);
    }
}

/// Signals that come almost together are one, and one cancels in order.
#[test]
fn ctrl_c_and_a_wrapper_s_signal_are_one() {
    let sim = Sim::start(&["--boards", "1"]);
    sim.ucom(&["init"]).ends(0);
    let child = sim.spawn(&["run", "1", "--active"]);
    sim.peer().wait("601#01010000");
    signal(&child, "-INT");
    signal(&child, "-TERM");
    ended(child).ends(0);
    let status = sim.ucom(&["--json", "status", "1"]).ends(0).json();
    assert_eq!(status["boards"][0]["status_byte"], 0x1B);
}

/// D-51: a board that is lost while others are still being started is one that was lost.
#[test]
fn d51_losses_during_the_start_count() {
    let sim = Sim::start(&["--boards", "3"]);
    sim.ucom(&["init"]).ends(0);
    // Boards send a life sign a second; this PC is less patient.
    let profile = sim.file("p.toml", b"alive.dsp_period = 20\nalive.dsp_lost = 40\n");
    let words = ["--json", "--profile", &profile, "run", "all", "--on-lost", "report", "--for", "0.01"];
    let said = sim.ucom(&words).ends(5);
    assert!(said.out.contains("\"stopped\"") && said.err.contains("a board was lost"), "{}", said.err);
}

/// P-19: a refusal or a failure leaves applications as they were found.
#[test]
fn p19_a_refused_run_leaves_nothing_started() {
    let sim = Sim::start(&["--boards", "3"]);
    sim.ucom(&["init"]).ends(0);
    sim.ucom(&["start", "2"]).ends(0);
    let bytes = || {
        let status = sim.ucom(&["--json", "status"]).ends(0).json();
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

/// The reset of one board asks first whether it is there.
#[test]
fn a_reset_of_nobody_is_refused() {
    let sim = Sim::start(&["--boards", "2"]);
    sim.ucom(&["init"]).ends(0);
    let mut peer = sim.peer();
    let said = sim.ucom(&["--json", "reset", "5"]).ends(3);
    assert!(said.json()["error"]["hint"].as_str().unwrap().contains("ucom scan"), "{}", said.out);
    assert!(peer.all(100).iter().all(|f| f != "005#"));
    assert_eq!(sim.ucom(&["--json", "reset", "2"]).ends(0).json()["reports"], json!([0x22]));
    sim.ucom(&["info", "2"]).ends(3);
    sim.ucom(&["info", "1"]).ends(0);
}
