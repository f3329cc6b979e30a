//! Tests of commands without a bus: exit codes, JSON output and help pages.

use crate::common;

use cli_kit::testing::program;
use common::{ucom, ucom_with};

#[test]
fn wrong_usage_and_unreadable_input_end_with_2() {
    ucom(&["scann"]).ends(2);
    ucom(&["info", "32", "--bus", "virtual:x"]).ends(2);
    let output = ucom(&["--json", "scan"]).ends(2);
    assert!(output.json()["error"]["message"].as_str().unwrap().contains("UCOM_BUS"), "{}", output.out);
    ucom(&["scan", "--bus", "can0"]).ends(2);
    ucom(&["sim", "--profile", "/nowhere.toml"]).ends(2);
    ucom(&["sim", "--chain", "/nowhere.toml"]).ends(2);
    let output = ucom(&["sim", "--boards", "1", "--flash-ids", "1,2"]).ends(2);
    assert!(output.err.contains("2 entries"), "{}", output.err);
    ucom(&["update", "1", "/nowhere.hex", "--bus", "virtual:x"]).ends(2);
    ucom(&["status", "1", "--set", "MCARUN", "--bus", "virtual:x"]).ends(2);
    ucom(&["status", "1", "--set", "PROG", "--clear", "PROG", "--bus", "virtual:x"]).ends(2);
    ucom(&["decode", "/nowhere.log"]).ends(2);
}

#[test]
fn a_bus_that_is_not_there_ends_with_3() {
    let output = ucom(&["--json", "scan", "--bus", "socketcand:127.0.0.1:1/can0"]).ends(3);
    let error = &output.json()["error"];
    assert_eq!((error["code"].as_str(), error["exit"].as_u64()), (Some("bus"), Some(3)));
}

#[test]
fn nobody_on_the_bus_ends_with_3_and_says_what_to_do() {
    let output = ucom(&["--json", "scan", "--bus", "virtual:empty"]).ends(3);
    assert!(output.json()["error"]["hint"].as_str().unwrap().contains("ucom doctor"), "{}", output.out);
    let output = ucom(&["--json", "info", "all", "--bus", "virtual:empty"]).ends(3);
    assert_eq!(output.json()["error"]["code"], "no-boards");
    let output = ucom(&["--json", "doctor", "--bus", "virtual:empty"]).ends(3);
    assert_eq!(output.json()["healthy"], false);
}

/// C-3: the command `decode` prints the names of frames. The frame `000#`, which has no data, is valid.
#[test]
fn decode_prints_names_of_frames() {
    let output = ucom_with(&["decode"], "000#\n141#2100011934126E38\n2A1#\n").ends(0);
    let lines: Vec<&str> = output.out.lines().collect();
    assert!(lines[0].contains("PC_RESET") && lines[0].contains("all"), "{}", output.out);
    assert!(
        lines[1].contains("DSP_INFO")
            && lines[1].contains("0x1234")
            && lines[1].contains("EXLRUN INIT IPINIT")
    );
    assert!(lines[2].contains("foreign") && lines[2].contains("bit 5"), "{}", output.out);
    let output = ucom_with(&["--json", "decode", "-"], "(1.5) can0 1C1#0202\n").ends(0);
    let value = output.json();
    assert_eq!((value["function"].as_str(), value["mask"].as_u64()), (Some("PC_SETSTATUS"), Some(2)));
    // The command decodes a string that spans several frames.
    let text = "141#2100011934126E38\n141#0200\n141#55436F4D32206865\n141#61642070616E\n";
    let output = ucom_with(&["decode"], text).ends(0);
    assert!(output.out.lines().last().unwrap().contains("\"UCoM2 head pan\""), "{}", output.out);
    let output = ucom_with(&["decode"], "hello\n").ends(2);
    assert!(output.err.contains("line 1"), "{}", output.err);
    ucom_with(&["decode"], "").ends(2);
}

#[test]
fn pages_completions_and_manual_are_made() {
    assert!(ucom(&["help", "profile"]).ends(0).out.contains("chain.auto_opinit"));
    assert!(ucom(&["help", "sim"]).ends(0).out.contains("neck yaw"));
    assert!(ucom(&["help", "faults"]).ends(0).out.contains("power-loss"));
    assert!(ucom(&["help"]).ends(0).out.contains("Exit codes"));
    for shell in ["bash", "zsh", "fish", "powershell"] {
        assert!(ucom(&["completions", shell]).ends(0).out.contains("ucom"));
    }
    let dir = tempfile::tempdir().unwrap();
    ucom(&["man", "--out", dir.path().to_str().unwrap()]).ends(0);
    assert!(std::fs::read_dir(dir.path()).unwrap().count() > 20);
}

#[test]
fn a_dbc_without_boards_needs_no_bus() {
    let output = ucom(&["dbc", "none"]).ends(0);
    assert!(output.out.starts_with("VERSION") && output.out.contains("BO_ "), "{}", output.out);
}

/// If a result cannot be printed, this is a failure; a reader that has disconnected is not a failure.
#[cfg(target_os = "linux")]
#[test]
fn a_result_that_cannot_be_printed_is_an_error() {
    for words in [&["help", "profile"][..], &["dbc", "none"], &["completions", "bash"], &["man"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut command = program(env!("CARGO_BIN_EXE_ucom"), "UCOM_");
        let done = command.args(words).stdout(full).output().unwrap();
        let err = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{words:?}: {err}");
        assert!(err.contains("No space left"), "{words:?}: {err}");
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let mut command = program(env!("CARGO_BIN_EXE_ucom"), "UCOM_");
        let done = command.args(words).stdout(writer).output().unwrap();
        assert_eq!(done.status.code(), Some(0), "{words:?}: {}", String::from_utf8_lossy(&done.stderr));
    }
}

/// The command does not overwrite an existing file unless the user requests it, and writes no profile without
/// measurements.
#[test]
fn files_are_kept_and_nothing_is_made_up() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let kept = ["kept.toml", "kept.dbc", "kept.log", "kept.mcap", "new.log.profile.toml"];
    kept.iter().for_each(|name| std::fs::write(file(name), "mine").unwrap());
    let bus = ["--bus", "virtual:empty"];
    let (toml, dbc, log, mcap, new) =
        (file("kept.toml"), file("kept.dbc"), file("kept.log"), file("kept.mcap"), file("new.log"));
    for words in [
        &["--json", "probe", "--out", &toml][..],
        &["--json", "dbc", "none", "--out", &dbc],
        &["--json", "record", &log, "--for", "0.1"],
        &["--json", "record", &mcap, "--for", "0.1"],
        // The command `record` also writes a profile file. In this case, the profile file already exists, and the
        // recording does not.
        &["--json", "record", &new, "--for", "0.1"],
    ] {
        let output = ucom(&[words, &bus].concat()).ends(4);
        let error = &output.json()["error"];
        assert_eq!(error["code"], "exists", "{words:?}: {}", output.out);
        assert!(error["hint"].as_str().unwrap().contains("--overwrite"), "{words:?}: {}", output.out);
    }
    // In this test no board answers, so no file is written, even with --overwrite.
    for words in [&["--json", "probe", "--out", &toml, "--overwrite"][..], &["--json", "probe"]] {
        let output = ucom(&[words, &bus].concat()).ends(3);
        assert_eq!(output.json()["error"]["code"], "no-boards", "{}", output.out);
    }
    kept.iter().for_each(|name| assert_eq!(std::fs::read_to_string(file(name)).unwrap(), "mine", "{name}"));
    ucom(&[&["dbc", "none", "--out", &dbc, "--overwrite"][..], &bus].concat()).ends(0);
    ucom(&[&["record", &log, "--for", "0.1", "--overwrite"][..], &bus].concat()).ends(0);
    assert_ne!(std::fs::read_to_string(dbc).unwrap(), "mine");
}

/// If JSON is requested, wrong usage is also reported as JSON.
#[test]
fn wrong_usage_is_json_where_that_is_asked_for() {
    for words in [&["--json", "scann"][..], &["ci", "2,3", "x=1", "--json"], &["info", "--json", "99"]] {
        let error = ucom(words).ends(2).json()["error"].clone();
        assert_eq!((error["code"].as_str(), error["exit"].as_u64()), (Some("usage"), Some(2)), "{words:?}");
        assert!(!error["message"].as_str().unwrap().is_empty(), "{words:?}");
    }
    let output = ucom(&["ci", "2,3", "x=1"]).ends(2);
    assert!(output.err.contains("one board at a time"), "{}", output.err);
    assert!(ucom(&["--json", "--help"]).ends(0).out.contains("Usage"));
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("x.asc");
    let output = ucom(&["record", file.to_str().unwrap(), "--bus", "virtual:x"]).ends(2);
    assert!(output.err.contains(".asc") && !file.exists(), "{}", output.err);
}

/// The process that wrote this recording was killed. The command decodes the complete part of the recording, and
/// reports that the recording is incomplete.
#[test]
fn a_recording_that_is_cut_off_is_decoded_up_to_there() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("cut.log");
    std::fs::write(&file, "(1.000000) can0 240#\n(2.000000) can0 441#21\n(3.000000) can0 141#2100").unwrap();
    let output = ucom(&["--json", "decode", file.to_str().unwrap()]).ends(0);
    assert_eq!(output.out.lines().count(), 2, "{}", output.out);
    assert!(
        output.err.contains("line 3") && output.err.contains("the 2 frames before this point are complete"),
        "{}",
        output.err
    );
}
