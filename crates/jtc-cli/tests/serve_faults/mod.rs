//! Tests that kill a program, the agent or the controller in each phase of a job. The tests check how the arm then
//! behaves.
#![cfg(unix)]

mod cell;
mod phases;
mod restarted;

use std::time::{Duration, Instant};

use cell::{Cell, moves, trajectory};
use serde_json::Value;
use test_kit::patience::Patience;

#[test]
fn a_program_that_is_killed_leaves_its_motion_to_its_policy() {
    for (policy, left) in [("continue", "Finish"), ("pause", "Pause"), ("stop", "Stop")] {
        let cell = Cell::new("921600", 60);
        let mut run = cell.run(policy);
        cell.until("Execute", |status| trajectory(status) == "Execute");
        run.kill().expect("it runs");
        run.wait().expect("it ends");
        let status = cell.until(left, |status| !moves(status));
        assert_eq!(trajectory(&status), left, "{policy}: {status}");
        // After the program has ended, the next client gets the lease at once.
        let gripper = cell.jtc(&["gripper", "on", "--port", &cell.url]).output().expect("it ran");
        assert!(gripper.status.success(), "{}", String::from_utf8_lossy(&gripper.stderr));
    }
}

#[test]
fn a_program_that_is_killed_in_its_upload_moves_nothing_whatever_its_policy() {
    for policy in ["continue", "stop"] {
        let cell = Cell::new("57600", 150);
        let mut run = cell.run(policy);
        // The upload takes several seconds. After 2 s, the controller has discarded the old motion, and has received
        // only a part of the new motion.
        std::thread::sleep(Duration::from_secs(2));
        assert!(run.try_wait().expect("a child").is_none() && !moves(&cell.status()), "it uploads");
        run.kill().expect("it runs");
        run.wait().expect("it ends");
        let seen = Instant::now();
        while seen.elapsed() < Duration::from_secs(3) {
            assert!(!moves(&cell.status()), "{policy}");
        }
    }
}

#[test]
fn an_agent_that_is_killed_leaves_the_motion_to_the_controller_and_says_so_to_its_programs() {
    let mut cell = Cell::new("921600", 50);
    let run = cell.run("stop");
    cell.until("Execute", |status| trajectory(status) == "Execute");
    cell.kill_agent();
    let ended = run.wait_with_output().expect("it ends");
    assert_eq!(ended.status.code(), Some(3), "no link");
    let report: Value = serde_json::from_slice(&ended.stdout).expect("an object");
    let message = report["error"]["message"].as_str().unwrap_or_default().to_owned();
    assert!(message.contains("MAY BE MOVING"), "{report}");
    // The controller has received the complete motion and executes it to the end. The status shows the motion to every
    // client.
    let port = cell.sim.as_ref().expect("it is there").port.to_str().expect("a name").to_owned();
    let baud = |words: &[&str]| {
        let mut command = cell.jtc(words);
        command.args(["--port", &port, "--baud", "921600"]);
        command.output().expect("it ran")
    };
    let mut patience = Patience::begin();
    loop {
        let shown = baud(&["--json", "status"]);
        let status: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
        if trajectory(&status) == "Finish" {
            break;
        }
        assert_eq!(trajectory(&status), "Execute", "{status}");
        patience.pause(format_args!("the end of the motion: {status}"));
    }
    cell.next_agent();
    cell.until("HoldPos", |status| status["state"] == "HoldPos");
}

#[test]
fn a_controller_that_is_gone_ends_agent_and_programs_with_words() {
    let mut cell = Cell::new("921600", 60);
    let run = cell.run("continue");
    cell.until("Execute", |status| trajectory(status) == "Execute");
    drop(cell.sim.take());
    let ended = run.wait_with_output().expect("it ends");
    let report: Value = serde_json::from_slice(&ended.stdout).expect("an object");
    assert_eq!(ended.status.code(), Some(3), "{report}");
    assert!(report["error"]["message"].as_str().is_some_and(|m| m.contains("MAY BE MOVING")), "{report}");
    assert_eq!(cell.agent.wait().expect("it ends").code(), Some(3));
}
