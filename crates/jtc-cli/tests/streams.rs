//! Streams of `--json`: what happens is told as it happens, and the result is the last line.
#![cfg(unix)]

mod common;

use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::time::{Duration, Instant};

use cli_kit::trial::Said;
use common::{Sim, command, jtc, motion};
use serde_json::Value;

/// The events of a command, whose last one is its result.
fn stream(said: &Said, last: &str) -> Vec<Value> {
    let events = said.events();
    assert_eq!(events.last().expect("a line")["event"], last, "{}", said.out);
    for event in &events[..events.len() - 1] {
        assert!(event["time_s"].is_f64() && !["report", "error"].contains(&name(event)), "{event}");
    }
    events
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
fn a_command_tells_what_happens_and_then_its_result() {
    let sim = Sim::start(&["--no-throttle"]);
    let events = stream(&sim.jtc(&["--json", "params", "push", "../../arms/avena.toml"]).ends(0), "report");
    assert_eq!(name(&events[0]), "connected");
    assert_eq!(events[0]["port"], sim.port.to_str().unwrap());
    assert_eq!(events.iter().filter(|e| name(e) == "parameter").count(), 3);
    assert!(events.last().unwrap()["pushed"].is_array());

    let events = stream(&sim.jtc(&["--json", "recover"]).ends(0), "report");
    assert!(first(&events, "step").1["text"].as_str().unwrap().contains("found"));
    assert!(events.last().unwrap()["steps"].is_array());
    assert_eq!(events.last().unwrap()["status"]["state"], "HoldPos");

    let file = sim.path("motion.csv");
    std::fs::write(&file, motion(0.2)).unwrap();
    let said = sim.jtc(&["--json", "traj", "run", &file, "--speed", "50"]).ends(0);
    let events = stream(&said, "report");
    let order = ["connected", "checked", "uploading", "uploaded", "executing", "sample", "report"];
    let places = order.map(|wanted| first(&events, wanted).0);
    assert!(places.is_sorted(), "{places:?} {}", said.out);
    let full = events.iter().rfind(|e| name(e) == "uploading").unwrap();
    assert_eq!((full["fraction"].as_f64(), &full["phase"]), (Some(1.0), &Value::from("motion")));
    // 2.4 s of motion: more than one sample, and not one a status.
    let samples: Vec<&Value> = events.iter().filter(|e| name(e) == "sample").collect();
    assert!((3..=20).contains(&samples.len()), "{}", samples.len());
    assert_eq!(samples[0]["position_rad"].as_array().unwrap().len(), 6);
    let states: Vec<&str> =
        events.iter().filter(|e| name(e) == "state").filter_map(|e| e["trajectory"].as_str()).collect();
    assert!(states.contains(&"Execute") && states.last() == Some(&"Finish"), "{states:?}");
    let report = events.last().unwrap();
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

    let said = sim.jtc(&["--json", "traj", "pause"]).ends(1);
    assert_eq!(stream(&said, "error").last().unwrap()["error"]["exit"], 1);
    std::fs::write(&file, "no trajectory").unwrap();
    let said = sim.jtc(&["--json", "traj", "run", &file]).ends(2);
    assert_eq!(stream(&said, "error").len(), 1);
    std::fs::write(&file, motion(9.0)).unwrap();
    let said = sim.jtc(&["--json", "traj", "run", &file]).ends(4);
    assert_eq!(stream(&said, "report").last().unwrap()["outcome"], "refused");
}

/// What breaks in motion is told at once, the first cause first.
#[test]
fn what_breaks_in_motion_is_told_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let faults = dir.path().join("faults.toml");
    let fault =
        "format = 2\n[[fault]]\nkind = \"node-silent\"\njoint = 3\nin_state = \"operate\"\nafter_s = 0.5\n";
    std::fs::write(&faults, fault).unwrap();
    let sim = Sim::start(&["--no-throttle", "--faults", faults.to_str().unwrap()]);
    sim.jtc(&["recover", "--defaults"]).ends(0);
    let file = sim.path("motion.csv");
    std::fs::write(&file, motion(0.2)).unwrap();
    let events = stream(&sim.jtc(&["--json", "traj", "run", &file]).ends(5), "report");
    let error = events.iter().find(|e| name(e) == "state" && e["state"] == "Error").expect("the error");
    assert!(error["errors"].to_string().contains("joint 3 does not answer"), "{error}");
    assert_eq!(events.last().unwrap()["outcome"], "fault");
}

#[test]
fn the_demo_is_a_stream_and_its_events_are_documented() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("demo");
    let said = jtc(&["--json", "demo", "--out", out.to_str().unwrap()]).ends(0);
    let events = stream(&said, "report");
    for wanted in ["connected", "parameter", "uploading", "uploaded", "executing", "sample"] {
        first(&events, wanted);
    }
    assert!(events.last().unwrap()["files"].is_array());
    let page = jtc(&["help", "events"]).ends(0).out;
    for event in &events {
        assert!(page.contains(&format!("| `{}` |", name(event))), "{event}");
    }
}

/// A reader that takes nothing (`… | less`) does not keep a run from hearing Ctrl-C.
#[test]
fn j33_a_reader_that_does_not_read_holds_no_run() {
    let sim = Sim::start(&["--no-throttle"]);
    sim.jtc(&["recover", "--defaults"]).ends(0);
    let file = sim.path("motion.csv");
    std::fs::write(&file, motion(0.2)).unwrap();
    let (reader, mut writer) = std::io::pipe().unwrap();
    // What a pipe holds.
    writer.write_all(&[b'\n'; 65_536]).unwrap();
    let mut run = command();
    run.args(["--json", "traj", "run", &file, "--speed", "5", "--port", sim.port.to_str().unwrap()]);
    let mut run = run.stdin(Stdio::null()).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(run.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("uploading")));
    std::thread::sleep(Duration::from_secs(1));
    cli_kit::trial::signal(&run, "-INT");
    let begin = Instant::now();
    while run.try_wait().unwrap().is_none() {
        assert!(begin.elapsed() < Duration::from_secs(20), "it does not end");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(run.wait().unwrap().code(), Some(5));
    drop(reader);
    let status = sim.jtc(&["--json", "status"]).ends(0).json();
    assert_eq!((&status["state"], &status["trajectory"]), (&"HoldPos".into(), &"Stop".into()), "{status}");
}
