//! Tests that a closed terminal (SIGHUP) and `kill` (SIGTERM) end commands in the same way as Ctrl-C.
#![cfg(unix)]

use crate::common;

use std::time::Duration;

use cli_kit::testing::{ended, signal};
use common::{Sim, ended_by};

/// A closed terminal ends running control loops and the programming of boards in the same way as Ctrl-C.
#[test]
fn a_hangup_stops_in_order() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let child = sim.spawn(&["run", "1,2", "--active"]);
    sim.peer().wait("602#01010000");
    std::thread::sleep(Duration::from_millis(300));
    ended_by(child, "-HUP").ends(0);
    let image = sim.file("image.bin", &vec![7; 60_000]);
    let child = sim.spawn(&["update", "1", &image]);
    sim.peer().wait("2C1#");
    let output = ended_by(child, "-HUP");
    assert!([4, 5].contains(&output.code), "{}: {}", output.code, output.err);
    let status = sim.json(&["status"], 0);
    assert_eq!([0, 1].map(|i| status["boards"][i]["status_byte"].as_u64()), [Some(0x1B); 2]);
}

/// After SIGHUP or SIGTERM, `ci --for` stops the board, `monitor` ends, and a recording is complete.
#[test]
fn a_hangup_and_a_kill_end_what_moves_and_what_records() {
    let sim = Sim::numbered(&["--boards", "1"]);
    for name in ["-HUP", "-TERM"] {
        let mut peer = sim.peer();
        let child = sim.spawn(&["ci", "1", "set_position=1500", "--for", "60"]);
        peer.wait("601#01010000");
        // Fifty output frames contain a complete snapshot of the outputs, even on a loaded computer. Without a
        // snapshot, the command has no outputs to show.
        peer.wait_for(50, "381#");
        signal(&child, name);
        peer.wait("601#00000000");
        ended(child).ends(0);
        let status = sim.json(&["status", "1"], 0);
        assert_eq!(status["boards"][0]["state"], "started", "{name}: the loop was stopped");

        let view = sim.spawn(&["--json", "monitor"]);
        for ending in ["log", "fzi", "mcap"] {
            let file = sim.path(&format!("{}.{ending}", &name[1..]));
            let child = sim.spawn(&["--json", "record", &file]);
            std::thread::sleep(Duration::from_millis(500));
            (0..5).for_each(|_| peer.send("240#"));
            std::thread::sleep(Duration::from_millis(200));
            signal(&child, name);
            let recorded = ended(child).ends(0).json();
            assert!(recorded["frames"].as_u64().unwrap() >= 5, "{name} {ending}: {recorded}");
            let output = sim.ucom(&["decode", &file]).ends(0);
            assert_eq!(
                output.out.lines().count() as u64,
                recorded["frames"].as_u64().unwrap(),
                "{name} {ending}"
            );
            assert_eq!(output.err.lines().count(), 1, "only the variable: {name} {ending}: {}", output.err);
        }
        ended_by(view, name).ends(0);
    }
}

/// If a recorder is killed, it loses at most the frames of one second, in each file format. If the file format shows that the end of a
/// recording is missing, the command reports the missing end.
#[test]
fn a_killed_recorder_leaves_what_was_recorded() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let run = sim.spawn(&["run", "1"]);
    sim.peer().wait("381#");
    for ending in ["log", "fzi", "mcap"] {
        let file = sim.path(&format!("killed.{ending}"));
        let child = sim.spawn(&["record", &file]);
        std::thread::sleep(Duration::from_millis(3_300));
        ended_by(child, "-KILL");
        let output = sim.ucom(&["decode", &file]).ends(0);
        // The output contains at least two frames every 10 ms, for more than a second. Therefore it contains more
        // than 200 frames.
        let frames = output.out.lines().count();
        assert!(frames > 200, "{ending}: {frames} frames; {}", output.err);
        assert!(ending != "mcap" || output.err.contains("the file ends after"), "{ending}: {}", output.err);
    }
    ended_by(run, "-INT").ends(0);
}
