//! Simulated controller on a serial port, and its agent, each in a separate process.
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use test_kit::http::Http;
use test_kit::patience::Patience;

use crate::common::agent::{self, command_in};
use crate::common::{Sim, slow_motion};

/// Agent and simulated controller of a test.
pub(super) struct Cell {
    pub sim: Option<Sim>,
    pub agent: Child,
    pub url: String,
    pub motion: String,
    pub dir: tempfile::TempDir,
    baud: String,
}

impl Cell {
    /// Starts a simulated controller and an agent. `tenths` is the duration of the motion in tenths of a second.
    pub(super) fn new(baud: &str, tenths: i32) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let sim = Sim::start(&["--baud", baud]).with_parameters();
        let (agent, url) = serve(&dir, &sim.port, baud);
        let motion = dir.path().join("motion.csv");
        std::fs::write(&motion, slow_motion(tenths)).expect("a file");
        let cell = Self {
            sim: Some(sim),
            agent,
            url,
            motion: motion.to_str().expect("a name").to_owned(),
            dir,
            baud: baud.into(),
        };
        cell.until("HoldPos", |status| {
            status["state"] == "HoldPos" && status["errors"] == Value::Array(vec![])
        });
        cell
    }

    /// Starts a run through the agent. The policy applies if the program of the run disconnects.
    pub(super) fn run(&self, policy: &str) -> Child {
        self.jtc(&["--json", "traj", "run", &self.motion, "--when-gone", policy, "--port", &self.url])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts")
    }

    pub(super) fn jtc(&self, words: &[&str]) -> Command {
        let mut command = command_in(&self.dir);
        command.args(words);
        command
    }

    /// Returns the status of the controller, which the function requests through the agent.
    pub(super) fn status(&self) -> Value {
        self.status_at(&self.url)
    }

    pub(super) fn status_at(&self, port: &str) -> Value {
        let shown = self.jtc(&["--json", "status", "--port", port]).stderr(Stdio::null()).output();
        serde_json::from_slice(&shown.expect("it ran").stdout).unwrap_or(Value::Null)
    }

    pub(super) fn until(&self, what: &str, reached: impl Fn(&Value) -> bool) -> Value {
        self.until_at(&self.url, what, reached)
    }

    pub(super) fn until_at(&self, port: &str, what: &str, reached: impl Fn(&Value) -> bool) -> Value {
        let mut patience = Patience::begin();
        loop {
            let status = self.status_at(port);
            if is_status(&status) && reached(&status) {
                return status;
            }
            patience.pause(format_args!("{what}: {status}"));
        }
    }

    /// Kills the agent.
    pub(super) fn kill_agent(&mut self) {
        self.agent.kill().expect("it is there");
        self.agent.wait().expect("it ends");
    }

    /// Starts another agent at the same port as the previous agent.
    pub(super) fn next_agent(&mut self) {
        let port = &self.sim.as_ref().expect("it is there").port;
        (self.agent, self.url) = serve(&self.dir, port, &self.baud);
    }

    /// Starts `jtc --json` through the agent with these arguments, and waits until the command prints this event.
    pub(super) fn at(&self, words: &[&str], event: &str) -> Program {
        let words = [&["--json"], words, &["--port", &self.url]].concat();
        let mut jtc = self.jtc(&words);
        let mut child = jtc.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let mut program = Program { err: BufReader::new(child.stderr.take().expect("stderr")), child };
        program.until(event);
        program
    }

    /// Runs a command like [`Self::jtc`], waits for its end, and checks that it succeeds.
    pub(super) fn done(&self, words: &[&str]) {
        let ended = self.jtc(&[words, &["--port", &self.url]].concat()).output().expect("it ran");
        assert!(ended.status.success(), "{words:?}: {}", String::from_utf8_lossy(&ended.stderr));
    }

    /// Returns an HTTP client with the token of the operator.
    pub(super) fn http(&self) -> Http {
        let file = self.dir.path().join("state/openjtc/tokens.toml");
        let text = std::fs::read_to_string(file).expect("a token file");
        let token = text.lines().find_map(|line| line.strip_prefix("operator = \"")?.strip_suffix('"'));
        let address = self.url.strip_prefix("http://").expect("an address").parse().expect("an address");
        Http { address, operator: token.expect("the operator's").to_owned() }
    }

    /// Returns the log lines of agents about the policy of a killed agent.
    pub(super) fn found(&self) -> Vec<Value> {
        let text = std::fs::read_to_string(self.dir.path().join("commands.jsonl")).expect("a log");
        // The last line of the log may be incomplete, so the function skips invalid lines.
        let lines = text.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        lines.filter(|line| line["what"].as_str().is_some_and(|what| what.starts_with("policy-"))).collect()
    }

    /// Returns the path of the file with the policy for a motion, if the file exists.
    pub(super) fn left(&self) -> Option<PathBuf> {
        let files = std::fs::read_dir(self.dir.path().join("state/openjtc")).expect("it is there");
        let mut paths = files.map(|file| file.expect("a file").path());
        paths.find(|path| path.extension().is_some_and(|kind| kind == "json"))
    }

    /// Checks that the arm stays at rest for this time, and that no motion begins. Returns the last status.
    pub(super) fn rests(&self, time: Duration) -> Value {
        let (seen, mut patience) = (Instant::now(), Patience::begin());
        loop {
            let status = self.status();
            assert!(!moves(&status), "{status}");
            if seen.elapsed() >= time && is_status(&status) {
                return status;
            }
            patience.pause(format_args!("an arm at rest: {status}"));
        }
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        self.agent.kill().ok();
        self.agent.wait().ok();
    }
}

fn serve(dir: &tempfile::TempDir, port: &Path, baud: &str) -> (Child, String) {
    let name = |path: &Path| path.to_str().expect("a name").to_owned();
    let (port, log) = (name(port), name(&dir.path().join("commands.jsonl")));
    let (child, ready) = agent::serve(dir, &["--baud", baud, "--port", &port, "--command-log", &log]);
    (child, ready["url"].as_str().expect("an address").to_owned())
}

/// A `jtc` command that the test has started.
pub(super) struct Program {
    child: Child,
    err: BufReader<ChildStderr>,
}

impl Program {
    /// Waits until the command prints this event.
    pub(super) fn until(&mut self, event: &str) {
        let (mut line, mut all) = (String::new(), String::new());
        while !line.contains(&format!("\"event\":\"{event}\"")) {
            line.clear();
            assert!(self.err.read_line(&mut line).expect("text") > 0, "it ended before {event}: {all}");
            all += &line;
        }
    }

    /// Kills the command.
    pub(super) fn kill(mut self) {
        assert!(self.child.try_wait().expect("a child").is_none(), "it is at work");
        self.child.kill().expect("it runs");
        self.child.wait().expect("it ends");
    }

    /// Waits until the command ends, checks that it reports the lost link, and returns its error message.
    pub(super) fn ends_without_link(self) -> String {
        let Self { child, err } = self;
        let ended = child.wait_with_output().expect("it ends");
        drop(err);
        let report: Value = serde_json::from_slice(&ended.stdout).expect("an object");
        assert_eq!(ended.status.code(), Some(3), "{report}");
        report["error"]["message"].as_str().unwrap_or_default().to_owned()
    }
}

/// Returns `true` if the answer contains a status. On a very busy computer, the answer may be an error, because no
/// status arrives in time.
fn is_status(value: &Value) -> bool {
    value["state"].is_string()
}

pub(super) fn trajectory(status: &Value) -> &str {
    status["trajectory"].as_str().unwrap_or_default()
}

pub(super) fn moves(status: &Value) -> bool {
    status["state"] == "Operate" || trajectory(status) == "Execute"
}
