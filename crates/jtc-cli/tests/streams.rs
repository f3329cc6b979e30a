//! Tests of the events of `--json`. The command writes events to stderr when they occur, and writes only the result to
//! stdout.
#![cfg(unix)]

use crate::common;

use std::io::Write;
use std::process::Stdio;

use cli_kit::testing::CommandOutput;
use common::{Sim, jtc, motion};
use serde_json::Value;
use test_kit::patience::until;

/// Returns the events of a command, and the result of the command.
fn stream(output: &CommandOutput) -> (Vec<Value>, Value) {
    let events = output.events();
    for event in &events {
        assert!(event["time_s"].is_f64() && event["event"].is_string(), "{event}");
    }
    let result = serde_json::from_str(&output.out).unwrap_or_else(|e| panic!("{e}: {:?}", output.out));
    (events, result)
}

fn name(event: &Value) -> &str {
    event["event"].as_str().unwrap_or_else(|| panic!("no event: {event}"))
}

fn first<'a>(events: &'a [Value], wanted: &str) -> (usize, &'a Value) {
    let at =
        events.iter().position(|e| name(e) == wanted).unwrap_or_else(|| panic!("no {wanted}: {events:?}"));
    (at, &events[at])
}

#[test]
fn a_command_reports_what_happens_and_then_its_result() {
    let sim = Sim::start(&["--no-throttle"]);
    let (events, result) = stream(&sim.jtc(&["--json", "params", "push", "../../arms/avena.toml"]).ends(0));
    assert_eq!(first(&events, "connected").1["port"], sim.port.to_str().unwrap());
    assert_eq!(events.iter().filter(|e| name(e) == "parameter").count(), 3);
    assert!(result["pushed"].is_array());

    let (events, result) = stream(&sim.jtc(&["--json", "recover"]).ends(0));
    assert!(first(&events, "step").1["text"].as_str().unwrap().contains("found"));
    assert!(result["steps"].is_array());
    assert_eq!(result["status"]["state"], "HoldPos");

    let file = sim.file("motion.csv", &motion(0.2));
    let output = sim.jtc(&["--json", "traj", "run", &file, "--speed", "50"]).ends(0);
    let (events, report) = stream(&output);
    let order = ["connected", "checked", "uploading", "uploaded", "executing", "sample"];
    let places = order.map(|wanted| first(&events, wanted).0);
    assert!(places.is_sorted(), "{places:?} {}", output.err);
    let full = events.iter().rfind(|e| name(e) == "uploading").unwrap();
    assert_eq!((full["fraction"].as_f64(), &full["phase"]), (Some(1.0), &Value::from("motion")));
    // A motion of 2.4 s causes more than one sample event, but fewer events than statuses.
    let samples: Vec<&Value> = events.iter().filter(|e| name(e) == "sample").collect();
    assert!((3..=20).contains(&samples.len()), "{}", samples.len());
    assert_eq!(samples[0]["position_rad"].as_array().unwrap().len(), 6);
    let states: Vec<&str> =
        events.iter().filter(|e| name(e) == "state").filter_map(|e| e["trajectory"].as_str()).collect();
    assert!(states.contains(&"Execute") && states.last() == Some(&"Finish"), "{states:?}");
    for key in [
        "outcome",
        "phase",
        "recorded_s",
        "executed_s",
        "samples",
        "joints",
        "failure",
        "verdict",
        "upload",
        "link",
        "files",
        "error",
    ] {
        assert!(report.get(key).is_some(), "{key}");
    }

    let (events, result) = stream(&sim.jtc(&["--json", "traj", "pause"]).ends(1));
    assert_eq!(result["error"]["exit"], 1);
    let note = first(&events, "note").1["text"].as_str().unwrap_or_default();
    assert!(note.contains(result["error"]["message"].as_str().unwrap()), "{note}");
    std::fs::write(&file, "no trajectory").unwrap();
    let (_, result) = stream(&sim.jtc(&["--json", "traj", "run", &file]).ends(2));
    assert_eq!(result["error"]["exit"], 2);
    std::fs::write(&file, motion(9.0)).unwrap();
    let (_, result) = stream(&sim.jtc(&["--json", "traj", "run", &file]).ends(4));
    assert_eq!(result["outcome"], "refused");
}

/// A failure during a motion is reported at once. The list of causes begins with the cause that occurred first.
#[test]
fn what_breaks_in_motion_is_reported_at_once() {
    let fault =
        "format = 2\n[[fault]]\nkind = \"node-silent\"\njoint = 3\nin_state = \"operate\"\nafter_s = 0.5\n";
    let sim = Sim::with_faults(&["--no-throttle"], fault).held();
    let file = sim.file("motion.csv", &motion(0.2));
    let (events, result) = stream(&sim.jtc(&["--json", "traj", "run", &file]).ends(5));
    let error = events.iter().find(|e| name(e) == "state" && e["state"] == "Error").expect("the error");
    assert!(error["errors"].to_string().contains("joint 3 does not answer"), "{error}");
    assert_eq!(result["outcome"], "fault");
}

#[test]
fn the_demo_has_events_and_all_events_are_documented() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("demo");
    let output = jtc(&["--json", "demo", "--out", out.to_str().unwrap()]).ends(0);
    let (events, result) = stream(&output);
    for wanted in ["connected", "parameter", "uploading", "uploaded", "executing", "sample"] {
        first(&events, wanted);
    }
    assert!(result["files"].is_array());
    let page = jtc(&["help", "events"]).ends(0).out;
    for event in &events {
        assert!(page.contains(&format!("| `{}` |", name(event))), "{event}");
    }
}

/// If the reader of the events is blocked (`2>&1 >report.json | less`), the run still moves the arm and reacts to
/// Ctrl-C.
#[test]
fn j33_a_reader_that_does_not_read_holds_no_run() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (file, recording) = (sim.path("motion.csv"), sim.path("run.csv"));
    std::fs::write(&file, motion(0.2)).unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    // The test fills the pipe completely, so that the command cannot write any event.
    writer.write_all(&[b'\n'; 65_536]).unwrap();
    let mut run = sim.command(&["--json", "traj", "run", &file, "--speed", "5", "--record", &recording]);
    let mut run = run.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(writer).spawn().unwrap();
    until("25 lines of the recording", || {
        std::fs::read_to_string(&recording).is_ok_and(|text| text.lines().count() > 25)
    });
    cli_kit::testing::signal(&run, "-INT");
    until("its end", || run.try_wait().unwrap().is_some());
    drop(reader);
    let output = run.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(5));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["outcome"], "stopped", "{result}");
    let status = sim.json(&["status"], 0);
    assert_eq!((&status["state"], &status["trajectory"]), (&"HoldPos".into(), &"Stop".into()), "{status}");
}
