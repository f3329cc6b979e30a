//! Tests with two boards that have the same number. Every command reports the shared number and changes no board, and `stop` stops
//! both boards.
#![cfg(unix)]

use crate::common;

use common::{Sim, image};

/// Starts a chain of three boards in which the first and the second board both have the number 1.
fn sharing() -> Sim {
    let mut sim = Sim::numbered(&["--boards", "3", "--flash-ids", "0x21,0x42,0x63"]);
    sim.fault("same-number board=2");
    sim
}

/// D-24: the exit code is 4, and the message contains the flash numbers of both boards and the next command. While two boards
/// share a number, the command sends only requests and heartbeats.
#[test]
fn d24_every_command_names_it_and_changes_nothing() {
    let sim = sharing();
    let file = sim.file("image.bin", &image(1000, 0));
    let commands: [&[&str]; 18] = [
        &["scan"],
        &["info", "1"],
        &["status", "1"],
        &["status", "1", "--set", "ASTART"],
        &["status", "all", "--raw", "40:40"],
        &["reset", "1"],
        &["reset", "all"],
        &["xreset", "1"],
        &["start", "1"],
        &["start", "all"],
        &["run", "1", "--for", "1"],
        &["io", "1"],
        &["ci", "1"],
        &["par", "1"],
        &["so", "1", "--count", "1"],
        &["update", "1", &file, "--flash-id", "0x21"],
        &["repair", "1", "--flash-id", "0x21"],
        &["monitor", "--count", "1"],
    ];
    for words in commands {
        let mut peer = sim.peer();
        let output = sim.ucom(&[&["--json"], words].concat()).ends(4);
        let (out, err) = (output.out.clone(), output.err.clone());
        let both = out.contains("flash numbers 0x0021 and 0x0042") && out.contains("number-shared");
        assert!(both && out.contains("ucom init"), "{words:?}: {out} {err}");
        let changes = |f: &String| {
            let id = u16::from_str_radix(&f[..3], 16).unwrap();
            matches!(id >> 6, 0 | 1 | 7 | 10..=13 | 15 | 21)
        };
        let sent: Vec<String> = peer.all(50).into_iter().filter(changes).collect();
        assert!(sent.is_empty(), "{words:?}: {sent:?}");
    }
    let doctor = sim.ucom(&["doctor"]).ends(1).out;
    assert!(
        doctor.contains("✗ two boards answer to number 1") && !doctor.contains("init wire after"),
        "{doctor}"
    );
    // After `init` has assigned a separate number to each board, the same commands succeed.
    sim.ucom(&["init"]).ends(0);
    sim.ucom(&["info", "all"]).ends(0);
}

/// D-24: a stop is never refused. At its end, the command `stop` reports that it has stopped two boards.
#[test]
fn d24_stop_stops_both_and_says_so() {
    let sim = sharing();
    for words in [["--json", "stop", "1"], ["--json", "stop", "all"]] {
        let mut peer = sim.peer();
        let output = sim.ucom(&words).ends(0);
        assert_eq!(output.json()["shared_numbers"][0]["board"], 1, "{words:?}");
        assert_eq!(output.json()["shared_numbers"][0]["flash_numbers"], serde_json::json!([0x21, 0x42]));
        assert!(output.err.contains("both boards received the Stop"), "{}", output.err);
        let all = peer.all(50);
        let first = all.iter().find(|f| !f.starts_with("680"));
        assert!(first.is_some_and(|f| f.starts_with("60") && f.ends_with("#00000000")), "{all:?}");
    }
}
