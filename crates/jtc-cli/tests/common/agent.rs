//! Agent (`jtc serve`) of a test, with separate directories for tokens and other files.
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use cli_kit::testing::{CommandOutput, run};
use serde_json::Value;

use super::{command, slow_motion};

/// Returns a `jtc` command that stores its state and sockets in this directory.
pub(crate) fn command_in(dir: &tempfile::TempDir) -> Command {
    let mut command = command();
    command.env("XDG_STATE_HOME", dir.path().join("state")).env("XDG_RUNTIME_DIR", dir.path());
    command
}

/// Starts an agent with these options at a free port of this computer. Returns the process and its output when the agent is ready.
pub(crate) fn serve<S: AsRef<OsStr>>(dir: &tempfile::TempDir, options: &[S]) -> (Child, Value) {
    let mut child = command_in(dir)
        .args(["--json", "serve", "--listen", "127.0.0.1:0"])
        .args(options)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("jtc serve starts");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
    let ready: Value = serde_json::from_str(&line).expect("an object");
    assert!(ready["token_file"].is_string() && ready["simulated"].is_boolean(), "{line}");
    (child, ready)
}

/// Agent that runs during a test, and is stopped at the end of the test.
pub(crate) struct Agent {
    pub child: Child,
    pub url: String,
    pub dir: tempfile::TempDir,
}

impl Agent {
    /// Starts an agent, and waits until the agent is ready.
    pub(crate) fn start(options: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().expect("a directory"), options)
    }

    /// Like `start`, in a directory that may contain files of an earlier agent.
    pub(crate) fn start_in(dir: tempfile::TempDir, options: &[&str]) -> Self {
        let (child, ready) = serve(&dir, options);
        Self { child, url: ready["url"].as_str().expect("its address").to_owned(), dir }
    }

    /// Returns a `jtc` command for this port, or for the address of the agent.
    pub(crate) fn command(&self, words: &[&str], port: &str) -> Command {
        let mut command = command_in(&self.dir);
        command.args(words).args(["--port", port]);
        command
    }

    /// Runs `jtc` with these arguments through the agent.
    pub(crate) fn jtc(&self, words: &[&str]) -> CommandOutput {
        run(self.command(words, &self.url), &[], "")
    }

    /// Creates a trajectory file whose motion takes `tenths` tenths of a second.
    pub(crate) fn motion(&self, tenths: i32) -> String {
        let file = self.dir.path().join("motion.csv");
        std::fs::write(&file, slow_motion(tenths)).expect("a file");
        file.to_str().expect("a name").to_owned()
    }

    /// Stops the agent with this signal. Returns the exit code and the directory of the agent.
    pub(crate) fn end(mut self, signal: &str) -> (Option<i32>, tempfile::TempDir) {
        Command::new("kill").args([signal, &self.child.id().to_string()]).status().expect("kill");
        let code = self.child.wait().expect("it ends").code();
        (code, std::mem::replace(&mut self.dir, tempfile::tempdir().expect("a directory")))
    }
}

impl Drop for Agent {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}
