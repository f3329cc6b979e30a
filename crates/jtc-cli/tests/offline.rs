//! Tests of commands that need no controller, with their exit codes, JSON output and filters.

use crate::common;

use common::{jtc, jtc_with, motion};

#[test]
fn wrong_usage_and_unreadable_input_end_with_2() {
    jtc(&["traj", "rum", "x"]).ends(2);
    // The user must specify the nodes, and the command rejects a bit mask. The command does not open the port.
    jtc(&["reset", "--port", "/nowhere/tty"]).ends(2);
    let output = jtc(&["reset", "3", "--port", "/nowhere/tty"]).ends(2);
    assert!(output.err.contains("--joints 3") && output.err.contains("--joints 1,2"), "{}", output.err);
    jtc(&["reset", "--joints", "0", "--port", "/nowhere/tty"]).ends(2);
    jtc(&["reset", "--joints", "1,7", "--port", "/nowhere/tty"]).ends(2);
    let output = jtc(&["traj", "check", "/nowhere/motion.csv"]).ends(2);
    assert!(output.err.contains("/nowhere/motion.csv"), "{}", output.err);
    let output = jtc(&["--json", "traj", "check", "/nowhere/motion.csv"]).ends(2);
    assert_eq!(output.json()["error"]["exit"], 2);
    jtc(&["dynamics", "inverse", "--arm", "/nowhere.toml"]).ends(2);
}

/// The command also reports wrong usage as JSON if JSON was requested before the command, after the command, or by the environment
/// variable.
#[test]
fn wrong_usage_is_a_json_object_where_json_is_asked_for() {
    for words in
        [&["--json", "traj", "rum"][..], &["traj", "run", "--json"], &["reset", "--json", "--joints", "9"]]
    {
        let error = jtc(words).ends(2).json()["error"].clone();
        assert_eq!((error["code"].as_str(), error["exit"].as_u64()), (Some("usage"), Some(2)), "{error}");
        assert!(!error["message"].as_str().unwrap().is_empty(), "{error}");
    }
    let by_variable = common::command().env("JTC_JSON", "1").args(["traj", "rum"]).output().unwrap();
    assert!(String::from_utf8_lossy(&by_variable.stdout).contains("unrecognized subcommand 'rum'"));
    assert_eq!(jtc(&["traj", "rum"]).ends(2).out, "");
}

/// An option that every command has can be typed before or after the command.
#[test]
fn the_port_may_stand_before_the_command() {
    for words in [
        &["--port", "/nowhere/tty", "status"][..],
        &["traj", "--port", "/nowhere/tty", "stop"],
        &["--baud", "9600", "--port", "/nowhere/tty", "params", "use-defaults"],
    ] {
        let output = jtc(words).ends(3);
        assert!(output.err.contains("/nowhere/tty"), "{}", output.err);
    }
    // If the option is typed before and after the command, the option after the command applies.
    let output = jtc(&["--port", "/far/tty", "status", "--port", "/near/tty"]).ends(3);
    assert!(output.err.contains("/near/tty"), "{}", output.err);
}

/// The joint bus is CAN FD. The command rejects a transport without CAN FD, and the error suggests a suitable
/// transport.
#[cfg(unix)]
#[test]
fn a_bus_that_cannot_carry_the_joints_is_refused() {
    let output = jtc(&["sim", "--bus", "socketcand:localhost/can0"]).ends(2);
    assert!(
        output.err.contains("CAN FD") && output.err.contains("multicast:239.74.163.2:43113"),
        "{}",
        output.err
    );
    let output = jtc(&["sim", "--bus", "can0"]).ends(2);
    assert!(output.err.contains("is not a valid CAN URL"), "{}", output.err);
}

#[test]
fn a_port_that_is_not_there_ends_with_3() {
    let output = jtc(&["--json", "status", "--port", "/nowhere/tty"]).ends(3);
    let error = &output.json()["error"];
    assert_eq!(error["code"], "port");
    assert!(error["hint"].as_str().unwrap().contains("jtc ports"));
}

#[test]
fn the_check_refuses_with_4_and_names_joint_and_point() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("motion.csv");
    let file = path.to_str().unwrap();
    std::fs::write(&path, motion(0.3)).unwrap();
    let output = jtc(&["--json", "traj", "check", file]).ends(0);
    assert_eq!(output.json()["ok"], true);
    assert_eq!(output.json()["verdict"]["points"], 121);
    std::fs::write(&path, motion(1.4)).unwrap();
    let output = jtc(&["--json", "traj", "check", file]).ends(4);
    let problems = output.json()["verdict"]["problems"].clone();
    assert!(problems[0]["joint"].is_u64() && problems[0]["limit"].is_f64(), "{problems}");
    // The suggested command contains the quotation marks that the shell needs, so the user can type it unchanged.
    let spaced = dir.path().join("my motion.csv");
    std::fs::write(&spaced, motion(0.3)).unwrap();
    let spaced = spaced.to_str().unwrap();
    let output = jtc(&["traj", "check", spaced, "--speed", "50"]).ends(0);
    assert!(output.out.contains(&format!("next: jtc traj run '{spaced}' --speed 50")), "{}", output.out);
    let output = jtc(&["traj", "check", file]).ends(4);
    assert!(output.out.contains(&format!("jtc traj check {file} --speed ")), "{}", output.out);
    // The command rejects the run before it opens any file or port. The port of this test does not exist.
    let output = jtc(&["--json", "traj", "run", file, "--port", "/nowhere/tty"]).ends(4);
    assert_eq!(output.json()["outcome"], "refused");
    let output = jtc(&["--json", "traj", "info", file]).ends(0);
    assert_eq!(output.json()["duration_s"], 1.2);
}

#[test]
fn dynamics_gives_back_what_it_was_given() {
    let q = "0.3 -0.4 0.5 0.1 -0.2 0.7";
    let qd = "0.5 0.2 -0.3 0.4 0.1 -0.6";
    let qdd = "1 -2 0.5 0.25 -0.125 3";
    let output = jtc_with(&["dynamics", "inverse"], &format!("{q} {qd} {qdd}\n")).ends(0);
    let torque = output.out.trim().to_owned();
    assert_eq!(torque.split(' ').count(), 6);
    for word in torque.split(' ') {
        let mantissa = word.trim_start_matches('-').split('e').next().unwrap();
        assert_eq!(mantissa.len(), 18, "17 significant digits and a point: {word}");
    }
    let output = jtc_with(&["dynamics", "forward"], &format!("{q} {qd} {torque}\n")).ends(0);
    for (got, want) in output.out.split_whitespace().zip(qdd.split(' ')) {
        let (got, want): (f64, f64) = (got.parse().unwrap(), want.parse().unwrap());
        assert!((got - want).abs() < 1e-9, "{got} is not {want}");
    }
    let output = jtc_with(&["dynamics", "mass"], &format!("{q}\n")).ends(0);
    let mass: Vec<f64> = output.out.split_whitespace().map(|w| w.parse().unwrap()).collect();
    assert_eq!(mass.len(), 36);
    for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
        assert!((mass[6 * i + j] - mass[6 * j + i]).abs() < 1e-12, "not symmetric at {i}, {j}");
    }
    let weightless =
        jtc_with(&["dynamics", "inverse", "--gravity", "0,0,0"], &format!("{q} 0 0 0 0 0 0 0 0 0 0 0 0\n"));
    assert!(weightless.ends(0).out.split_whitespace().all(|w| w.parse::<f64>().unwrap() == 0.0));
    let output = jtc_with(&["dynamics", "inverse"], "1 2 3\n").ends(2);
    assert!(output.err.contains("line 1") && output.err.contains("3 numbers"), "{}", output.err);
}

#[test]
fn decode_knows_frames_of_both_directions() {
    let output = jtc_with(&["decode"], "9B 0E 00 06 A3 47\n").ends(0);
    assert!(output.out.contains("FrictionPolynomial"), "{}", output.out);
    let output = jtc_with(&["--json", "decode"], "9B0B0007 03 7D9E").ends(0);
    assert_eq!(output.json()["frame"], "TrajSetExecStatus");
    assert_eq!(output.json()["type"], 0x0B);
    // The decoder does not lose a frame because of noise before and after the frame.
    let output = jtc_with(&["--json", "decode"], "00 9B 9B 9B 0B 00 07 03 7D 9E 11").ends(0);
    assert!(output.out.lines().any(|l| l.contains("TrajSetExecStatus")), "{}", output.out);
    // Bit 2 of the mask is joint 3, because bits are counted from 0 and joints from 1.
    let output = jtc_with(&["decode"], "9B 10 00 0A 04 00 00 00 AD BE").ends(0);
    assert!(output.out.contains("ResetCanDevices: node 2 (joint 3)"), "{}", output.out);
    jtc_with(&["decode"], "hello").ends(2);
    jtc_with(&["decode"], "").ends(2);
    let capture = "0.001250 > 9B 0B 00 07\n0.001300 > 03 7D 9E\n0.016400 < 9B 03\n";
    let output = jtc_with(&["decode"], capture).ends(0);
    assert!(output.out.contains("to device") && output.out.contains("execute"), "{}", output.out);
}

#[test]
fn an_output_that_is_there_or_cannot_be_is_refused_before_a_port_is_opened() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let (file, old) = (path("motion.csv"), path("old.mcap"));
    std::fs::write(&file, motion(0.3)).unwrap();
    std::fs::write(&old, "precious").unwrap();
    let run = |more: &[&str]| jtc(&[&["traj", "run", &file, "--port", "/nowhere/tty"], more].concat());
    let output = run(&["--record", &old]).ends(4);
    assert!(output.err.contains("already exists") && output.err.contains("--overwrite"), "{}", output.err);
    let output = run(&["--record", &file, "--overwrite"]).ends(4);
    assert!(output.err.contains("already uses"), "{}", output.err);
    run(&["--record", &path("no/where.mcap")]).ends(2);
    run(&["--record", &path("a.csv"), "--report", &path("./a.csv"), "--overwrite"]).ends(4);
    // Overwriting is allowed, but the port does not exist. The command has not changed the old file, and has not
    // created an empty file.
    run(&["--record", &old, "--report", &path("new.html"), "--overwrite"]).ends(3);
    assert_eq!(std::fs::read_to_string(&old).unwrap(), "precious");
    assert!(!std::path::Path::new(&path("new.html")).exists());
    jtc(&["teach", "record", &old, "--port", "/nowhere/tty"]).ends(4);
}

#[test]
fn explain_has_a_page_for_codes_and_refuses_others() {
    let output = jtc(&["--json", "explain"]).ends(0);
    let pages = output.json()["pages"].clone();
    assert!(pages.as_array().unwrap().len() > 40);
    for page in pages.as_array().unwrap() {
        let output = jtc(&["explain", page["name"].as_str().unwrap()]).ends(0);
        assert!(output.out.contains("meaning:") && output.out.contains("next:"));
    }
    assert!(jtc(&["explain", "data:8"]).ends(0).out.contains("start"));
    jtc(&["explain", "no-such-code"]).ends(2);
}

#[test]
fn completions_and_manual_pages_are_made() {
    for shell in ["bash", "zsh", "fish", "powershell"] {
        assert!(jtc(&["completions", shell]).ends(0).out.contains("jtc"));
    }
    let dir = tempfile::tempdir().unwrap();
    jtc(&["man", "--out", dir.path().to_str().unwrap()]).ends(0);
    assert!(std::fs::read_dir(dir.path()).unwrap().count() > 20);
}

#[test]
fn the_demo_leaves_its_files_and_follows_within_2_mrad() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("demo");
    let output = jtc(&["--json", "demo", "--out", out.to_str().unwrap()]).ends(0);
    let value = output.json();
    for joint in value["joints"].as_array().unwrap() {
        assert!(joint["rms_error_mrad"].as_f64().unwrap() < 2.0, "{joint}");
        assert!(joint["torque_share"].as_f64().unwrap() < 1.0, "{joint}");
    }
    for name in ["report.html", "recording.mcap", "recording.csv", "picture.svg"] {
        assert!(out.join(name).metadata().unwrap().len() > 10_000, "{name}");
    }
    // A second demo and a second report do not overwrite existing files without the option. If the command rejects the request,
    // it does not run a simulation.
    std::fs::write(out.join("picture.svg"), "precious").unwrap();
    let output = jtc(&["demo", "--out", out.to_str().unwrap()]).ends(4);
    assert!(
        output.err.contains("report.html already exists") && output.err.contains("--overwrite"),
        "{}",
        output.err
    );
    assert!(!output.err.contains("parameters:"), "{}", output.err);
    assert_eq!(std::fs::read_to_string(out.join("picture.svg")).unwrap(), "precious");
    jtc(&["demo", "--overwrite", "--out", out.to_str().unwrap()]).ends(0);
    assert!(out.join("picture.svg").metadata().unwrap().len() > 10_000);
    let file = out.join("recording.mcap");
    let page = out.join("report.html");
    jtc(&["report", file.to_str().unwrap(), "--out", page.to_str().unwrap()]).ends(4);
    // A new report from the recording contains the same values as the report of the demo.
    let again = jtc(&["--json", "report", file.to_str().unwrap()]).ends(0).json();
    for (a, b) in again["joints"].as_array().unwrap().iter().zip(value["joints"].as_array().unwrap()) {
        let rms = |v: &serde_json::Value| v["rms_error_mrad"].as_f64().unwrap();
        assert!((rms(a) - rms(b)).abs() < 1e-6);
    }
}

/// If the command cannot print its result, the command fails. If the reader has closed the pipe, the command does not
/// fail.
#[cfg(target_os = "linux")]
#[test]
fn a_result_that_cannot_be_printed_is_an_error() {
    for words in [&["--json", "ports"][..], &["--help"], &["dynamics", "mass"], &["man"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut child = common::command();
        child
            .args(words)
            .stdin(std::process::Stdio::piped())
            .stdout(full)
            .stderr(std::process::Stdio::piped());
        let mut child = child.spawn().unwrap();
        std::io::Write::write_all(&mut child.stdin.take().unwrap(), b"0 0 0 0 0 0\n").ok();
        let output = cli_kit::testing::ended(child);
        assert_eq!(output.code, 2, "{words:?}");
        assert!(output.err.contains("No space left"), "{words:?}: {}", output.err);
    }
}

/// Each example suggests a command, and this command accepts the example file.
#[test]
fn examples_are_files_that_the_named_commands_take() {
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().to_str().unwrap();
    let list = jtc(&["--json", "example"]).ends(0).json();
    let names: Vec<&str> =
        list["examples"].as_array().unwrap().iter().map(|e| e["name"].as_str().unwrap()).collect();
    for name in ["motion", "waypoints", "arm", "faults"] {
        assert!(names.contains(&name), "{names:?}");
    }
    for name in names {
        let output = jtc(&["--json", "example", name, "-o", to]).ends(0).json();
        let file = output["file"].as_str().unwrap();
        match file.rsplit_once('.').unwrap().1 {
            "toml" if name == "arm" => drop(jtc(&["params", "show", file]).ends(0)),
            "toml" => {}
            _ if file.ends_with("-waypoints.csv") => {
                // A file of waypoints is not a trajectory, so the error suggests `jtc plan`.
                let refused = jtc(&["traj", "check", file]).ends(2);
                assert!(refused.err.contains("`jtc plan`"), "{}", refused.err);
                let planned = dir.path().join(format!("{name}-planned.csv"));
                jtc(&["plan", file, "-o", planned.to_str().unwrap()]).ends(0);
            }
            _ => drop(jtc(&["traj", "check", file]).ends(0)),
        }
        // The command does not overwrite the file, because the user may have changed it.
        jtc(&["example", name, "-o", to]).ends(4);
        jtc(&["example", name, "-o", to, "--overwrite"]).ends(0);
    }
    let output = jtc(&["example", "nothing"]).ends(2);
    assert!(output.err.contains("motion, waypoints"), "{}", output.err);
}

#[test]
fn help_knows_pages_and_commands() {
    assert!(jtc(&["help", "files"]).ends(0).out.contains("q1_deg"));
    assert!(jtc(&["help", "faults"]).ends(0).out.contains("node-silent"));
    let output = jtc(&["help", "traj", "run"]).ends(0);
    assert!(
        output.out.contains("--approach") && output.out.contains("Usage: jtc traj run"),
        "{}",
        output.out
    );
    assert!(jtc(&["help"]).ends(0).out.contains("Commands:"));
    let output = jtc(&["help", "trajectory"]).ends(2);
    assert!(output.err.contains("traj") && output.err.contains("files"), "{}", output.err);
}

/// The command reports decimal commas of a German spreadsheet as an error, and can read a file in degrees.
#[test]
fn decimal_commas_are_named_and_degrees_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("motion.csv");
    let file = path.to_str().unwrap();
    std::fs::write(&path, "t;q1;q2;q3;q4;q5;q6\n0;0;0;0;0;0;0\n1;0,1;0;0;0;0;0\n").unwrap();
    let output = jtc(&["traj", "info", file]).ends(2);
    assert!(output.err.contains("line 3, column 2, q1: \"0,1\" has a decimal comma"), "{}", output.err);
    std::fs::write(&path, "t;q1_deg;q2;q3;q4;q5;q6\n0;0;0;0;0;0;0\n1;18;0;0;0;0;0\n").unwrap();
    let output = jtc(&["--json", "traj", "info", file]).ends(0).json().to_string();
    assert!(output.contains("0.3141592"), "{output}");
}
