//! Tests of boards that leave their control loop while `ucom run` supervises them (D-37). The command `run` reports
//! each such board at once, as an event of `--json`, and marks its values as outdated. At the end, the exit code is
//! 5.

use crate::common;

use std::io::{BufRead, BufReader, Read};
use std::process::Child;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use cli_kit::testing::signal;
use common::Sim;
use serde_json::Value;
use test_kit::patience::Patience;

/// `ucom --json run` command that is running, and its events.
struct Running {
    child: Child,
    events: Receiver<Value>,
}

impl Running {
    fn start(sim: &Sim, words: &[&str]) -> Self {
        let mut child = sim.spawn(&[&["--json", "run"], words].concat());
        let (sender, events) = channel();
        let stdout = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || {
            for line in stdout.lines().map_while(Result::ok) {
                sender.send(serde_json::from_str(&line).unwrap()).ok();
            }
        });
        let mut running = Self { child, events };
        running.until(|event| event["event"] == "so");
        running
    }

    /// Returns the next event for which `wanted` returns `true`.
    fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> Value {
        let mut patience = Patience::begin();
        loop {
            let event = patience.receive(&self.events).expect("an event");
            if wanted(&event) {
                return event;
            }
        }
    }

    fn end(self) -> (i32, String) {
        signal(&self.child, "-INT");
        self.ended()
    }

    /// Waits until the command ends by itself, without a signal. Returns the exit code and the text on stderr.
    fn ended(mut self) -> (i32, String) {
        let mut err = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        (self.child.wait().unwrap().code().unwrap_or(-1), err)
    }
}

fn of(board: u8, name: &str) -> impl Fn(&Value) -> bool {
    move |event| event["event"] == name && event["board"] == board
}

/// A board receives no heartbeats of the PC (D-50) and leaves its control loop, while the other board continues.
#[test]
fn d37_a_board_that_misses_the_pc_is_named_and_its_values_are_stale() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let mut run = Running::start(&sim, &["1,2", "--active"]);
    sim.fault("deaf board=1 for_s=3");
    let left = run.until(|event| event["event"] == "left-loop");
    assert_eq!(left["board"], 1, "{left}");
    let so = run.until(of(1, "so"));
    assert_eq!(so["stale"], true, "{so}");
    let so = run.until(of(2, "so"));
    assert_eq!(so["stale"], false, "{so}");
    // The age of outdated values increases, and the time of these values does not change.
    let (first, second) = (run.until(of(1, "so")), run.until(of(1, "so")));
    assert_eq!((first["time_s"].clone(), &second["stale"]), (second["time_s"].clone(), &Value::Bool(true)));
    assert!(second["age_s"].as_f64() > first["age_s"].as_f64(), "{first} {second}");
    std::thread::sleep(Duration::from_millis(1_000));
    let (code, err) = run.end();
    assert_eq!(code, 5, "{err}");
    assert!(err.contains("board 1 has left its control loop by itself"), "{err}");
    let status = sim.json(&["status"], 0);
    assert_eq!([0, 1].map(|i| status["boards"][i]["status_byte"].as_u64()), [Some(0x1B); 2], "stopped");
}

/// Another PC stops all boards. The command reports each stop of a board; without `--json`, it prints the report as
/// text.
#[test]
fn d37_boards_that_another_pc_stops_are_named() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let mut run = Running::start(&sim, &["all"]);
    sim.peer().send("600#00000000");
    let both = [run.until(|e| e["event"] == "left-loop"), run.until(|e| e["event"] == "left-loop")];
    let mut boards = both.map(|event| event["board"].as_u64());
    boards.sort_unstable();
    assert_eq!(boards, [Some(1), Some(2)]);
    let (code, err) = run.end();
    assert_eq!(code, 5, "{err}");
    assert!(err.contains("boards 1, 2 left their control loops by themselves"), "{err}");

    let mut child = sim.spawn(&["run", "1,2"]);
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    sim.peer().wait("382#");
    std::thread::sleep(Duration::from_millis(300));
    sim.peer().send("600#00000000");
    // The message is printed at once, while the run continues.
    assert!(lines.any(|line| line.contains("board 2 has left its control loop by itself")));
    assert!(child.try_wait().unwrap().is_none());
    signal(&child, "-INT");
    assert_eq!(child.wait().unwrap().code(), Some(5));
}

/// D-51: the command stops boards that remain silent, as its policy requires. The command then supervises no board,
/// and the run ends.
#[test]
fn d51_a_run_without_boards_ends_by_itself() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let mut run = Running::start(&sim, &["all"]);
    sim.fault("silent board=2 for_s=60");
    sim.fault("silent board=1 for_s=60");
    run.until(of(1, "lost"));
    let (code, err) = run.ended();
    assert_eq!(code, 5, "{err}");
    assert!(err.contains("the run ends, because no board is in its control loop"), "{err}");
}

/// Section 8: each change of the heartbeats of a board (late, lost, back) is an event.
#[test]
fn p15_late_lost_and_back_are_events() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let mut run = Running::start(&sim, &["1,2", "--on-lost", "report"]);
    sim.fault("silent board=2 for_s=4");
    for name in ["late", "lost", "back"] {
        let event = run.until(|event| ["late", "lost", "back"].iter().any(|n| event["event"] == *n));
        assert!(of(2, name)(&event), "{name}: {event}");
        assert!(event["time_s"].as_f64().is_some(), "{event}");
    }
    let (code, err) = run.end();
    assert_eq!(code, 5, "{err}");
    assert!(err.contains("a board was lost once"), "{err}");
}
