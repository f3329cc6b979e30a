//! Tests that `--overwrite` overwrites a file but does not skip a check of the bus. `--force` skips a check of the bus but does not
//! overwrite a file.
#![cfg(unix)]

use crate::common;

use common::{Sim, ended_by, ucom};

/// The hint of the file check suggests `--overwrite`. If a user follows this hint while boards run, the command
/// resets no board.
#[test]
fn writing_over_a_file_never_resets_a_running_chain() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let runner = sim.spawn(&["run", "1,2", "--active"]);
    let mut peer = sim.peer();
    peer.wait("381#");
    peer.wait("382#");
    let file = sim.file("boards.toml", b"mine");
    for option in ["--init", "--alive"] {
        let probe =
            |more: &[&str]| sim.ucom(&[&["probe", option, "--out", &file], more].concat()).ends(4).err;
        let there = probe(&[]);
        assert!(there.contains("already exists") && there.contains("--overwrite"), "{option}: {there}");
        assert!(!there.contains("--force"), "{option}: {there}");
        let runs = probe(&["--overwrite"]);
        assert!(runs.contains("running its control loop"), "{option}: {runs}");
        assert!(!runs.contains("--overwrite"), "{option}: {runs}");
        let forced = probe(&["--force"]);
        assert!(forced.contains("already exists") && !forced.contains("--force"), "{option}: {forced}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    peer.wait("381#");
    peer.wait("382#");
    let output = ended_by(runner, "-INT").ends(0);
    assert!(!output.err.contains("rebooted"), "{}", output.err);
}

/// The test runs each command that writes a file: `--force` alone overwrites no file, and `--overwrite` does.
#[test]
fn force_writes_over_no_file() {
    let sim = Sim::numbered(&["--boards", "1"]);
    sim.ucom(&["start", "all"]).ends(0);
    let file = sim.file("mine", b"mine");
    for words in [
        &["par", "1", "--save", &file][..],
        &["par", "1", "kp=3", "--save", &file],
        &["io", "1", "--template", &file],
        &["dbc", "1", "--out", &file],
        &["dbc", "none", "--out", &file],
        &["probe", "--out", &file],
    ] {
        for more in [&[][..], &["--force"]] {
            let refused = sim.ucom(&[words, more].concat()).ends(4).err;
            assert!(refused.contains("already exists; nothing was sent"), "{words:?}: {refused}");
            let hint = refused.lines().last().unwrap();
            assert!(hint.contains("--overwrite writes over it"), "{words:?}: {refused}");
            assert!(!hint.contains("--force"), "{words:?}: {refused}");
            assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine", "{words:?}");
        }
        sim.ucom(&[words, &["--overwrite"]].concat()).ends(0);
        assert_ne!(std::fs::read_to_string(&file).unwrap(), "mine", "{words:?}");
        sim.file("mine", b"mine");
    }
}

/// The command `record` does not check the bus. For older scripts, the option `--force` of `record` means `--overwrite`; the help does
/// not list the option `--force` of `record`.
#[test]
fn record_takes_force_for_overwrite() {
    let sim = Sim::numbered(&["--boards", "1"]);
    for word in ["--overwrite", "--force"] {
        let file = sim.file("mine.log", b"mine");
        sim.ucom(&["record", &file, "--for", "0.1"]).ends(4);
        sim.ucom(&["record", &file, "--for", "0.1", word]).ends(0);
        assert_ne!(std::fs::read_to_string(&file).unwrap(), "mine", "{word}");
    }
    let help = ucom(&["record", "--help"]).ends(0).out;
    assert!(help.contains("--overwrite") && !help.contains("--force"), "{help}");
}
