//! Tests of environment variables. A variable cannot cause a motion, a reset or flashing, confirm an action, or override a check. The
//! command reports the variables that have an effect.
#![cfg(target_os = "linux")]

use crate::common;

use cli_kit::testing::{CommandOutput, run};
use common::{Dir, Sim, command, jtc};

/// Runs `jtc` with one additional environment variable.
fn with((name, value): (&str, &str), words: &[&str]) -> CommandOutput {
    let mut command = command();
    command.env(name, value);
    run(command, words, "")
}

/// In older versions, some variables changed a motion or a result. If such a variable were ignored, the motion could
/// be different, faster or longer than the user expects. Therefore the command is rejected before it opens a port (an
/// unknown port would cause exit code 3).
#[test]
fn a_variable_that_shaped_a_motion_refuses_the_command() {
    let dir = Dir::new();
    let file = dir.file("waypoints.csv", "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.1,0,0,0,0,0\n");
    let out = dir.path("out.csv");
    let port = ["--port", "/nowhere/tty"];
    for (variable, value, words) in [
        ("JTC_DEG", "1", &["move", "--to", "0,1,0,0,0,0"][..]),
        ("JTC_DEG", "yes", &["jog", "3", "1"]),
        ("JTC_SPEED_PERCENT", "5", &["move", "--to", "0,1,0,0,0,0"]),
        ("JTC_SPEED_PERCENT", "5", &["traj", "run", &file]),
        ("JTC_LINE", "on", &["move", "--to", "0,1,0,0,0,0"]),
        ("JTC_WHEN_GONE", "stop", &["traj", "run", &file]),
        ("JTC_DURATION", "0.5", &["jog", "3", "0.1"]),
        ("JTC_REPEAT", "2", &["traj", "continue", &file]),
        ("JTC_MEASURED", "1", &["traj", "replay", &file]),
        ("JTC_INERTIA", "1,1,1", &["payload", "set", "--mass", "1", "--com", "0,0,0"]),
        ("JTC_FRICTION", "table", &["params", "push", &file]),
        ("JTC_IMAGE", "other.elf", &["firmware", "flash"]),
        ("JTC_COUNT", "1", &["monitor"]),
    ] {
        let output = with((variable, value), &[&["--json"], words, &port[..]].concat()).ends(2);
        let error = &output.json()["error"];
        let message = error["message"].as_str().unwrap();
        assert!(message.starts_with(&format!("{variable}={value} is set")), "{words:?}: {error}");
        assert!(error["hint"].as_str().unwrap().starts_with("use --"), "{words:?}: {error}");
    }
    for (variable, value) in
        [("JTC_DEG", "1"), ("JTC_PAYLOAD", "2"), ("JTC_BLEND", "0.1"), ("JTC_TEMPERATURE", "5")]
    {
        with((variable, value), &["plan", &file, "-o", &out]).ends(2);
        assert!(!dir.has("out.csv"), "{variable}");
    }
    // The command continues if the variable is off or empty, or if the user types the option. No variable can prevent a
    // Stop.
    let plan = ["plan", &file, "-o", &out, "--overwrite", "--speed", "50"];
    for (variable, value) in [("JTC_DEG", "off"), ("JTC_LINE", ""), ("JTC_SPEED_PERCENT", "5")] {
        with((variable, value), &plan).ends(0);
    }
    for variable in ["JTC_DEG", "JTC_SPEED_PERCENT", "JTC_YES", "JTC_FORCE", "JTC_WHEN_GONE"] {
        with((variable, "1"), &["traj", "stop", "--port", "/nowhere/tty"]).ends(3);
    }
}

/// In older versions, some variables caused a motion or a reset, confirmed an action or overrode a check. Such a variable has no effect
/// now, and one output line reports this.
#[test]
fn no_variable_acts() {
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]);
    let port = sim.port.to_str().unwrap().to_owned();
    let existing = sim.file("motion.csv", "mine");
    let dir = sim.dir.path().to_str().unwrap().to_owned();
    let arm = sim.path("no-such-arm.toml");
    let ignored = |variable: &str, value: &str, words: &[&str], code: i32| {
        let output = with((variable, value), words).ends(code);
        let line = format!("{variable}={value} is ignored: `jtc");
        assert_eq!(output.err.matches(&line).count(), 1, "{variable} {words:?}: {}", output.err);
        output
    };
    // The controller lacks parameters. Only an option on the command line can supply these parameters.
    ignored("JTC_DEFAULTS", "1", &["recover", "--port", &port], 4);
    ignored("JTC_ARM", &arm, &["recover", "--port", &port], 4);
    assert_eq!(sim.json(&["status"], 0)["state"], "Init");
    let sim = sim.held();
    ignored("JTC_YES", "1", &["disable", "--port", &port], 4);
    ignored("JTC_YES", "true", &["reset", "--all", "--port", &port], 4);
    ignored("JTC_ALL", "1", &["reset", "--port", &port], 2);
    ignored("JTC_GRIPPER", "1", &["reset", "--port", &port], 2);
    ignored("JTC_JOINTS", "1", &["reset", "--port", &port], 2);
    ignored("JTC_TO", "0,1,0,0,0,0", &["move", "--port", &port], 2);
    ignored("JTC_TO_FLANGE", "0.6,0,0.4,0,0,0", &["move", "--port", &port], 2);
    ignored("JTC_FORCE", "1", &["example", "motion", "-o", &dir], 4);
    ignored("JTC_OCCURRED", "1", &["clear", "--port", &port], 0);
    // The variable was renamed, and the message contains the new name.
    let output = ignored("JTC_OUT", &dir, &["example", "no-such-example"], 2);
    assert!(output.err.contains("use --out or JTC_EXAMPLE_DIR"), "{}", output.err);
    assert_eq!(std::fs::read_to_string(existing).unwrap(), "mine");
    assert_eq!(sim.json(&["status"], 0)["state"], "HoldPos");
}

/// The on/off variables accept eight words, in upper or lower case.
#[test]
fn on_off_variables_take_eight_words_and_nothing_else() {
    for (variable, words) in [
        ("JTC_JSON", &["explain"][..]),
        ("JTC_NO_THROTTLE", &["sim"]),
        ("JTC_SIM", &["serve", "--listen", "127.0.0.1:0"]),
    ] {
        for wrong in ["x", "2", "y", "enable"] {
            let output = with((variable, wrong), words).ends(2);
            assert!(output.err.contains("1, true, yes or on, or 0, false, no or off"), "{}", output.err);
            assert!(output.err.contains(&format!("by the variable {variable}={wrong}")), "{}", output.err);
        }
    }
    for on in ["1", "TRUE", "Yes", "on"] {
        assert!(with(("JTC_JSON", on), &["explain"]).ends(0).json()["pages"].is_array(), "{on}");
    }
    for off in ["0", "False", "no", "OFF", ""] {
        let output = with(("JTC_JSON", off), &["explain"]).ends(0);
        assert!(!output.out.starts_with('{') && output.err.is_empty(), "{off}: {}", output.err);
    }
}

/// The command reports a variable that has an effect in one line on stderr. The command does not report the variable if the user types the
/// option before or after the command.
#[test]
fn a_variable_in_effect_is_shown() {
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]);
    let port = sim.port.to_str().unwrap().to_owned();
    let line = format!("jtc: from the environment: JTC_PORT={port}\n");
    assert!(with(("JTC_PORT", &port), &["status"]).ends(0).err.starts_with(&line));
    for words in [["--port", &port, "status"], ["status", "--port", &port]] {
        assert!(!with(("JTC_PORT", "/nowhere"), &words).ends(0).err.contains("JTC_PORT"), "{words:?}");
    }
    assert_eq!(with(("JTC_PORT", &port), &["explain", "HoldPos"]).ends(0).err, "");
    let programs = with(("JTC_PORT", &port), &["--json", "status"]).ends(0);
    assert_eq!(programs.events()[0]["text"], line.trim_end(), "{}", programs.err);
    assert!(programs.json()["state"].is_string());
    // If the value of a variable is invalid, the error contains the name of the variable.
    let wrong = with(("JTC_BAUD", "fast"), &["status"]).ends(2);
    assert!(wrong.err.contains("--baud is set by the variable JTC_BAUD=fast"), "{}", wrong.err);
}

/// The command accepts `--force` of older scripts as `--overwrite`. The help text does not contain `--force`.
#[test]
fn force_is_taken_for_overwrite() {
    let dir = Dir::new();
    let folder = dir.path("");
    for word in ["--overwrite", "--force"] {
        let file = dir.file("motion.csv", "mine");
        let refused = jtc(&["example", "motion", "-o", &folder]).ends(4).err;
        assert!(refused.contains("--overwrite writes over it") && !refused.contains("--force"), "{refused}");
        jtc(&["example", "motion", "-o", &folder, word]).ends(0);
        assert_ne!(std::fs::read_to_string(file).unwrap(), "mine", "{word}");
    }
    let help = jtc(&["help", "example"]).ends(0).out;
    assert!(help.contains("--overwrite") && !help.contains("--force"), "{help}");
}
