//! Tests of a new agent after the previous agent was killed. If the arm still moves, the new agent first applies the policy of the
//! lease holder.
use std::time::Duration;

use serde_json::{Value, json};
use test_kit::patience::{Patience, until};

use super::cell::{Cell, moves, trajectory};
use super::phases::{IN_UPLOAD, REST, Silent, is_held, is_taught, long_motion, pause, state};

/// Checks that the stored file contains this policy, and what the controller was doing (`what`): upload, motion or
/// teaching. The test must wait for the file before it kills the agent, because a separate thread of the agent writes
/// the file.
fn is_left(cell: &Cell, policy: &str, what: &str) {
    let mut patience = Patience::begin();
    loop {
        let text = cell.left().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
        let left: Value = serde_json::from_str(&text).unwrap_or_default();
        if left["policy"] == policy && left["what"] == what {
            return;
        }
        patience.pause(format_args!("{policy} of {what}: {text}"));
    }
}

fn is_gone(cell: &Cell) {
    until("the end of the file: nothing moves", || cell.left().is_none());
}

/// Kills the agent, starts another agent, and returns the report of the new agent about the policy.
fn next(cell: &mut Cell) -> Value {
    cell.kill_agent();
    follow(cell)
}

/// Like [`next`], after the test has killed the previous agent.
fn follow(cell: &mut Cell) -> Value {
    let before = cell.found().len();
    cell.next_agent();
    // A separate thread of the agent writes the log, so the test waits for the new line.
    until("what the next agent finds", || cell.found().len() > before);
    let found = cell.found();
    assert_eq!(found.len(), before + 1, "{found:?}");
    found.last().expect("it is there").clone()
}

fn done(found: &Value) -> &str {
    found["done"].as_str().unwrap_or_default()
}

fn each<const N: usize>(cases: [&str; N], act: impl Fn(&str) + Sync) {
    let act = &act;
    std::thread::scope(|scope| cases.iter().for_each(|case| drop(scope.spawn(move || act(case)))));
}

#[test]
fn a_motion_follows_the_policy_of_its_client_when_the_agent_is_killed_and_another_comes() {
    each(["continue", "pause", "stop"], |policy| {
        let mut cell = Cell::new("921600", 80);
        let mut run = cell.run(policy);
        cell.until("Execute", |status| trajectory(status) == "Execute");
        is_left(&cell, policy, "motion");
        let found = next(&mut cell);
        run.wait().expect("it ends");
        assert_eq!(
            (&found["policy"], &found["of"], &found["moves"]),
            (&json!(policy), &json!("motion"), &json!(true))
        );
        assert!(found["by"].as_str().is_some_and(|by| by.contains("jtc traj")), "{found}");
        // The agent has applied the policy before it served any client. Its report says which request it has sent for
        // each policy.
        let taken = [
            ("continue", "the motion continues"),
            ("pause", "a Pause was sent"),
            ("stop", "a Stop was sent"),
        ];
        let taken = taken.iter().find(|taken| taken.0 == policy).expect("a policy").1;
        assert!(done(&found).starts_with(taken), "{found}");
        let left = match policy {
            "continue" => "Finish",
            "pause" => "Pause",
            _ => "Stop",
        };
        let status = cell.until(left, |status| !moves(status));
        assert_eq!(trajectory(&status), left, "{policy}: {status}");
        if policy == "pause" {
            // The motion can be resumed, so the agent also stores the policy for the next agent.
            is_left(&cell, policy, "motion");
            let found = next(&mut cell);
            assert_eq!(done(&found), "the motion stays paused");
            assert_eq!(trajectory(&cell.rests(REST)), "Pause");
            cell.done(&["traj", "resume"]);
            cell.until("Finish", |status| trajectory(status) == "Finish");
        }
        is_gone(&cell);
        // If no motion is in progress, a new agent writes no line about a policy.
        let before = cell.found().len();
        cell.kill_agent();
        cell.next_agent();
        assert_eq!(cell.found().len(), before);
        assert_eq!(trajectory(&cell.rests(REST)), if policy == "stop" { "Stop" } else { "Finish" });
    });
}

#[test]
fn each_other_phase_follows_the_policy_when_the_agent_is_killed_and_another_comes() {
    each(["upload", "pause", "teaching, stop", "teaching, continue"], |phase| {
        let mut cell = Cell::new("115200", 50);
        cell.until("a held arm", is_held);
        match phase {
            "upload" => {
                let words = ["traj", "run", &long_motion(&cell), "--when-gone", "stop"];
                let run = cell.at(&words, "checked");
                std::thread::sleep(IN_UPLOAD);
                is_left(&cell, "stop", "upload");
                let found = next(&mut cell);
                run.ends_without_link();
                assert_eq!((&found["of"], done(&found)), (&json!("upload"), "the arm no longer moves"));
                assert!(is_held(&cell.rests(REST)));
            }
            "pause" => {
                let words = ["traj", "run", &cell.motion.clone(), "--when-gone", "stop"];
                let run = cell.at(&words, "executing");
                pause(&cell);
                is_left(&cell, "stop", "motion");
                let found = next(&mut cell);
                run.ends_without_link();
                assert!(done(&found).starts_with("a Stop was sent"), "{found}");
                cell.until("Stop", |status| trajectory(status) == "Stop");
            }
            _ => {
                let policy = phase.split(", ").last().expect("a policy");
                let silent = Silent::come_for(&cell, policy, Duration::from_secs(40));
                silent.ask("POST /api/teach", json!({ "on": true }));
                cell.until("Teaching", is_taught);
                is_left(&cell, policy, "teaching");
                let found = next(&mut cell);
                assert_eq!((&found["of"], &found["by"]), (&json!("teaching"), &json!("cell 3")));
                if policy == "continue" {
                    assert_eq!(state(&cell.rests(REST)), "Teaching");
                    cell.done(&["teach", "off"]);
                }
                cell.until("HoldPos", |status| state(status) == "HoldPos");
            }
        }
        is_gone(&cell);
    });
}

#[test]
fn a_file_in_doubt_stops_what_moves_and_nothing_else() {
    let mut cell = Cell::new("921600", 80);
    let mut run = cell.run("continue");
    cell.until("Execute", |status| trajectory(status) == "Execute");
    is_left(&cell, "continue", "motion");
    let path = cell.left().expect("it is there");
    cell.kill_agent();
    run.wait().expect("it ends");
    std::fs::write(&path, "{\"version\": 1, \"pol").expect("a file");
    let found = follow(&mut cell);
    assert_eq!((&found["what"], &found["moves"]), (&json!("policy-in-doubt"), &json!(true)));
    let status = cell.until("Stop", |status| !moves(status));
    assert_eq!(trajectory(&status), "Stop", "{status}");
    is_gone(&cell);
    cell.kill_agent();
    std::fs::write(&path, "").expect("a file");
    let found = follow(&mut cell);
    assert_eq!((&found["what"], &found["moves"]), (&json!("policy-in-doubt"), &json!(false)));
    is_gone(&cell);
    assert_eq!(trajectory(&cell.rests(REST)), "Stop");
}
