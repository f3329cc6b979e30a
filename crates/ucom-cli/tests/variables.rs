//! Tests of environment variables. A variable never moves, resets, numbers or programs a board, and never overrides a check. If a
//! variable has an effect on a command, the command prints the variable.
#![cfg(unix)]

use crate::common;

use cli_kit::testing::{CommandOutput, run};
use common::{Sim, ucom};

/// Runs `ucom` with one additional environment variable.
fn with(sim: &Sim, (name, value): (&str, &str), words: &[&str]) -> CommandOutput {
    let mut command = sim.command();
    command.env(name, value);
    run(command, words, "")
}

/// Checks that no frame in `frames` resets, numbers, programs, starts or moves a board. `ucom send` accepts such
/// frames only with `--intrusive`, so it must accept all of `frames` without this option.
fn only_questions(frames: &[String]) {
    let words: Vec<&str> = frames.iter().map(String::as_str).collect();
    if !words.is_empty() {
        ucom(&[&["--bus", "virtual:questions", "send"], &words[..]].concat()).ends(0);
    }
}

/// A variable of another command may still be set in the shell. In this case no board is changed, and one line
/// reports that the variable is ignored.
#[test]
fn no_variable_moves_resets_numbers_or_overrules_a_check() {
    let sim = Sim::numbered(&["--boards", "2"]);
    sim.ucom(&["start", "1"]).ends(0);
    // This command stores the signal names, so that the following commands need not request them.
    sim.ucom(&["io", "all"]);
    let file = sim.file("bus.log", b"(1.000000) can0 201#\n(1.010000) can0 000#\n");
    let parameters =
        b"boards:\n  - board: 1\n    flash_number: 0x21\n    program_id: any\n    par:\n      kp: 3\n";
    let parameters = sim.file("kp.yaml", parameters);
    let before = (sim.status_byte("1"), sim.status_byte("2"));
    let mut peer = sim.peer();
    for (variable, value, words, code) in [
        // In earlier versions, this variable moved the board, even if the user had set it only for `ucom record`.
        ("UCOM_FOR", "2", &["ci", "1", "set_position=1500"][..], 0),
        ("UCOM_FORCE", "1", &["ci", "1", "set_position=1500"], 0),
        ("UCOM_SET", "ASTART", &["status", "2"], 0),
        ("UCOM_CLEAR", "ASTART", &["status", "1"], 0),
        ("UCOM_RAW", "00:40", &["status", "all"], 0),
        ("UCOM_INIT", "1", &["probe"], 0),
        ("UCOM_INIT", "yes", &["--json", "probe"], 0),
        ("UCOM_ALIVE", "on", &["probe"], 0),
        ("UCOM_INTRUSIVE", "1", &["send", "000#"], 4),
        ("UCOM_INTRUSIVE", "true", &["replay", &file], 0),
        ("UCOM_APPLY", &parameters, &["par", "1"], 0),
    ] {
        let output = with(&sim, (variable, value), words).ends(code);
        let line = format!("{variable}={value} is ignored: `ucom");
        assert_eq!(output.err.matches(&line).count(), 1, "{variable} {words:?}: {}", output.err);
        // `frames` omits heartbeats and the frames of `ci`. The command `ci` checks whether the control loop runs,
        // and writes its input. Without a running control loop, these frames do not move the board.
        let of_ci = |f: &String| {
            f == "601#00000000" || ["680#", "681#", "341#"].iter().any(|start| f.starts_with(start))
        };
        let frames: Vec<String> = peer.all(100).into_iter().filter(|frame| !of_ci(frame)).collect();
        only_questions(&frames);
        assert_eq!((sim.status_byte("1"), sim.status_byte("2")), before, "{variable} {words:?}");
        peer.all(50);
    }
}

/// If a variable limited a command in earlier versions, or determined what the command sent, the command is refused. Without
/// the variable, the command would do something else.
#[test]
fn a_variable_that_shaped_a_command_refuses_it_before_anything_is_sent() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let image = sim.file("image.bin", &common::golden());
    let inputs = b"boards:\n  - board: 1\n    flash_number: 0x21\n    program_id: any\n    ci:\n      set_position: 1500\n";
    let parameters = sim.file("inputs.yaml", inputs);
    let mut peer = sim.peer();
    for (variable, value, words) in [
        ("UCOM_FOR", "2", &["run", "1", "--active"][..]),
        ("UCOM_CI", "1.set_position=0", &["run", "1"]),
        ("UCOM_PAR", "1.kp=3", &["run", "1"]),
        ("UCOM_PARAMS", &parameters, &["run", "1", "--active"]),
        ("UCOM_ON_LOST", "stop-all", &["run", "1"]),
        ("UCOM_COUNT", "3", &["monitor"]),
        ("UCOM_COUNT", "3", &["so", "1"]),
        ("UCOM_SPEED", "0.1", &["replay", &image]),
        ("UCOM_FLASH_ID", "0x22", &["update", "1", &image]),
        ("UCOM_DATE", "2026-01-01", &["update", "1", &image]),
        ("UCOM_EXPECT_PROGRAM_ID", "0x4B3F", &["update", "1", &image]),
        ("UCOM_FLASH_ID", "0x22", &["repair", "1"]),
    ] {
        let output = with(&sim, (variable, value), &[&["--json"], words].concat()).ends(2);
        let error = &output.json()["error"];
        let message = error["message"].as_str().unwrap();
        assert!(message.starts_with(&format!("{variable}={value} is set")), "{words:?}: {error}");
        assert!(error["hint"].as_str().unwrap().starts_with("use --"), "{error}");
        assert_eq!(peer.all(50), [""; 0], "{words:?}");
    }
    // If the user types an option, the variable of this option has no effect. The command `stop` is never refused.
    with(&sim, ("UCOM_COUNT", "x"), &["monitor", "--count", "1"]).ends(0);
    with(&sim, ("UCOM_CONTROL_ONLY", "1"), &["stop", "all"]).ends(0);
}

/// Eight words, in upper or lower case, mean on or off. Any other value of an on/off variable does not enable anything.
#[test]
fn on_off_variables_take_eight_words_and_nothing_else() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let mut peer = sim.peer();
    for (variable, words) in [
        ("UCOM_JSON", &["scan"][..]),
        ("UCOM_FRESH", &["io", "1"]),
        ("UCOM_DRY_RUN", &["par", "1"]),
        ("UCOM_LISTEN_ONLY", &["monitor", "--count", "1"]),
        ("UCOM_CSV", &["so", "1", "--count", "1"]),
        ("UCOM_SIM", &["serve"]),
    ] {
        for wrong in ["x", "2", "y", "enable"] {
            let output = with(&sim, (variable, wrong), words).ends(2);
            assert!(output.err.contains("1, true, yes or on, or 0, false, no or off"), "{}", output.err);
            assert!(output.err.contains(&format!("by the variable {variable}={wrong}")), "{}", output.err);
        }
    }
    assert_eq!(peer.all(100), [""; 0]);
    for on in ["1", "TRUE", "Yes", "on"] {
        let output = with(&sim, ("UCOM_JSON", on), &["scan"]).ends(0);
        assert!(output.json()["boards"].is_array(), "{on}");
    }
    for off in ["0", "False", "no", "OFF", ""] {
        let output = with(&sim, ("UCOM_JSON", off), &["scan"]).ends(0);
        assert!(output.out.contains("1 board is connected"), "{off}: {}", output.out);
        assert!(!output.err.contains("UCOM_JSON"), "{off}: {}", output.err);
    }
}

/// If the user did not type an option and the command uses its variable, one line on stderr shows the variable.
#[test]
fn a_variable_in_effect_is_shown() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let shown = format!("ucom: from the environment: UCOM_BUS={}\n", sim.url);
    assert_eq!(sim.ucom(&["scan"]).ends(0).err, shown);
    let both = sim.ucom(&["update", "1", "nothing.hex"]).ends(2).err;
    let line = format!("ucom: from the environment: UCOM_BUS={}, UCOM_INVENTORY=", sim.url);
    assert!(both.starts_with(&line), "{both}");
    assert_eq!(sim.ucom(&["--bus", &sim.url, "scan"]).ends(0).err, "");
    assert_eq!(sim.ucom(&["explain", "OPINIT"]).ends(0).err, "");
    let programs = sim.ucom(&["--json", "scan"]).ends(0);
    assert!(programs.json()["boards"].is_array());
    assert_eq!(programs.events()[0]["text"], shown.trim_end(), "{}", programs.err);
    // Control codes in the value of a variable are not sent to the terminal.
    let odd = with(&sim, ("UCOM_EDGES", "a\u{1b}[2J\n.toml"), &["io", "1"]).err;
    assert!(odd.lines().next().unwrap().contains(r"UCOM_EDGES=a\u{1b}[2J\n.toml"), "{odd}");
}
