//! What becomes of the arm when a program, the agent or the controller is killed, in each phase of a motion.
#![cfg(unix)]

mod common;

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::{Sim, command, slow_motion};
use serde_json::Value;

const WAIT: Duration = Duration::from_secs(40);

/// An agent of a simulated controller behind a serial port, each a process of its own.
struct Cell {
    sim: Option<Sim>,
    agent: Child,
    url: String,
    motion: String,
    dir: tempfile::TempDir,
}

impl Cell {
    /// `tenths`: how long its motion takes, 0.1 s.
    fn new(baud: &str, tenths: i32) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let sim = Sim::start(&["--baud", baud]).with_parameters();
        let (agent, url) = serve(&dir, &sim.port, baud);
        let motion = dir.path().join("motion.csv");
        std::fs::write(&motion, slow_motion(tenths)).expect("a file");
        let cell =
            Self { sim: Some(sim), agent, url, motion: motion.to_str().expect("a name").to_owned(), dir };
        cell.until("HoldPos", |status| {
            status["state"] == "HoldPos" && status["errors"] == Value::Array(vec![])
        });
        cell
    }

    /// A run through the agent, with what is to become of it without its program.
    fn run(&self, policy: &str) -> Child {
        self.jtc(&["--json", "traj", "run", &self.motion, "--when-gone", policy, "--port", &self.url])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts")
    }

    fn jtc(&self, words: &[&str]) -> Command {
        let mut command = here(command(), &self.dir);
        command.args(words);
        command
    }

    /// What the controller reports through the agent.
    fn status(&self) -> Value {
        self.status_at(&self.url)
    }

    fn status_at(&self, port: &str) -> Value {
        let shown = self.jtc(&["--json", "status", "--port", port]).stderr(Stdio::null()).output();
        serde_json::from_slice(&shown.expect("it ran").stdout).unwrap_or(Value::Null)
    }

    fn until(&self, what: &str, reached: impl Fn(&Value) -> bool) -> Value {
        self.until_at(&self.url, what, reached)
    }

    fn until_at(&self, port: &str, what: &str, reached: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + WAIT;
        loop {
            let status = self.status_at(port);
            if reached(&status) {
                return status;
            }
            assert!(Instant::now() < end, "{what} is not reached: {status}");
        }
    }

    /// The agent goes without a word.
    fn kill_agent(&mut self) {
        self.agent.kill().expect("it is there");
        self.agent.wait().expect("it ends");
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        self.agent.kill().ok();
        self.agent.wait().ok();
    }
}

fn here(mut command: Command, dir: &tempfile::TempDir) -> Command {
    command.env("XDG_STATE_HOME", dir.path().join("state")).env("XDG_RUNTIME_DIR", dir.path());
    command
}

fn serve(dir: &tempfile::TempDir, port: &Path, baud: &str) -> (Child, String) {
    let mut agent = here(command(), dir)
        .args(["--json", "serve", "--listen", "127.0.0.1:0", "--baud", baud, "--port"])
        .arg(port)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    let mut line = String::new();
    BufReader::new(agent.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
    let ready: Value = serde_json::from_str(&line).expect("an object");
    (agent, ready["url"].as_str().expect("an address").to_owned())
}

fn trajectory(status: &Value) -> &str {
    status["trajectory"].as_str().unwrap_or_default()
}

fn moves(status: &Value) -> bool {
    status["state"] == "Operate" || trajectory(status) == "Execute"
}

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
        // The next one commands at once.
        let gripper = cell.jtc(&["gripper", "on", "--port", &cell.url]).output().expect("it ran");
        assert!(gripper.status.success(), "{}", String::from_utf8_lossy(&gripper.stderr));
    }
}

#[test]
fn a_program_that_is_killed_in_its_upload_moves_nothing_whatever_its_policy() {
    for policy in ["continue", "stop"] {
        let cell = Cell::new("57600", 150);
        let mut run = cell.run(policy);
        // Its upload takes seconds; the controller forgets what it had, and has not all of it yet.
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
    // The controller has the whole of it, and anyone finds it there.
    let port = cell.sim.as_ref().expect("it is there").port.to_str().expect("a name").to_owned();
    let baud = |words: &[&str]| {
        let mut command = cell.jtc(words);
        command.args(["--port", &port, "--baud", "921600"]);
        command.output().expect("it ran")
    };
    let end = Instant::now() + WAIT;
    loop {
        let shown = baud(&["--json", "status"]);
        let status: Value = serde_json::from_slice(&shown.stdout).unwrap_or_default();
        if trajectory(&status) == "Finish" {
            break;
        }
        assert!(Instant::now() < end && trajectory(&status) == "Execute", "{status}");
    }
    // Another agent takes its place.
    let (agent, url) = serve(&cell.dir, &cell.sim.as_ref().expect("it is there").port, "921600");
    cell.agent.wait().ok();
    (cell.agent, cell.url) = (agent, url);
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
