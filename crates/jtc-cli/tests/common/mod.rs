//! Runs the `jtc` command in the same way as a user, and a simulated controller for this command.

pub(crate) mod agent;

use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use cli_kit::testing::{CommandOutput, program, run};
use serde_json::Value;

/// Returns a `jtc` command without the environment variables of `jtc`.
pub(crate) fn command() -> Command {
    program(env!("CARGO_BIN_EXE_jtc"), "JTC_")
}

/// Runs `jtc` with these arguments.
pub(crate) fn jtc(words: &[&str]) -> CommandOutput {
    jtc_with(words, "")
}

/// Runs `jtc` with these arguments and with this text on its stdin.
pub(crate) fn jtc_with(words: &[&str], stdin: &str) -> CommandOutput {
    run(command(), words, stdin)
}

/// Temporary directory for the files of a test.
pub(crate) struct Dir(tempfile::TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a directory"))
    }

    /// Returns a path in the directory.
    pub(crate) fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    /// Creates a file in the directory.
    pub(crate) fn file(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("a file");
        self.path(name)
    }

    /// Returns `true` if a file of this name exists in the directory.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.path().join(name).exists()
    }
}

/// Simulated controller on a pseudo-terminal. The simulator is stopped at the end of the test.
pub(crate) struct Sim {
    child: Child,
    stderr: BufReader<std::process::ChildStderr>,
    pub port: PathBuf,
    pub dir: tempfile::TempDir,
}

impl Sim {
    /// Starts a simulator and waits until the simulator is ready.
    pub(crate) fn start(options: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().expect("a directory"), options)
    }

    /// Like `start`, in a directory that may already contain files.
    pub(crate) fn start_in(dir: tempfile::TempDir, options: &[&str]) -> Self {
        let port = dir.path().join("jtc");
        let mut child = command()
            .args(["sim", "--serial", port.to_str().unwrap()])
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("jtc sim starts");
        let mut stderr = BufReader::new(child.stderr.take().expect("stderr"));
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
        if line != format!("ready: {}\n", port.display()) {
            let mut err = String::new();
            stderr.read_to_string(&mut err).ok();
            panic!("jtc sim prints {line:?}, {err}");
        }
        Self { child, stderr, port, dir }
    }

    /// Like `start`, with a fault file.
    pub(crate) fn with_faults(options: &[&str], faults: &str) -> Self {
        let dir = tempfile::tempdir().expect("a directory");
        let file = dir.path().join("faults.toml");
        std::fs::write(&file, faults).expect("a file");
        Self::start_in(dir, &[options, &["--faults", file.to_str().unwrap()]].concat())
    }

    /// Sets the default parameters of the controller.
    pub(crate) fn with_parameters(self) -> Self {
        self.jtc(&["params", "use-defaults"]).ends(0);
        self
    }

    /// Recovers the controller with its default parameters, and waits until it holds the arm.
    pub(crate) fn held(self) -> Self {
        self.jtc(&["recover", "--defaults"]).ends(0);
        self
    }

    /// Returns a `jtc` command for the port of the simulator.
    pub(crate) fn command(&self, words: &[&str]) -> Command {
        let mut command = command();
        command.args(words).args(["--port", self.port.to_str().unwrap()]);
        command
    }

    /// Runs `jtc` with these arguments at the port of the simulator.
    pub(crate) fn jtc(&self, words: &[&str]) -> CommandOutput {
        run(self.command(words), &[], "")
    }

    /// Returns the JSON output of `jtc --json` with these arguments. Panics if the exit code is not `code`.
    pub(crate) fn json(&self, words: &[&str], code: i32) -> Value {
        self.jtc(&[&["--json"], words].concat()).ends(code).json()
    }

    /// Creates a file in the directory of the simulator.
    pub(crate) fn file(&self, name: &str, text: &str) -> String {
        std::fs::write(self.path(name), text).expect("a file");
        self.path(name)
    }

    /// Writes a line to the standard input of the simulator.
    pub(crate) fn write_line(&mut self, line: &str) {
        writeln!(self.child.stdin.as_mut().expect("stdin"), "{line}").expect("it reads");
    }

    /// Waits for the next line on the stderr of the simulator, and returns the line.
    pub(crate) fn error_line(&mut self) -> String {
        let mut line = String::new();
        self.stderr.read_line(&mut line).expect("a line");
        line
    }

    /// Returns the process id of the simulator.
    pub(crate) fn pid(&self) -> String {
        self.child.id().to_string()
    }

    /// Returns a path in the directory of the simulator.
    pub(crate) fn path(&self, name: &str) -> String {
        self.dir.path().join(name).to_str().unwrap().to_owned()
    }

    /// Sends a signal to the simulator, and waits for its end. Returns the exit code, and `true` if the link of the
    /// port still exists.
    pub(crate) fn end(mut self, signal: &str) -> (i32, bool) {
        let pid = self.child.id().to_string();
        Command::new("kill").args([signal, &pid]).status().expect("kill");
        let code = self.child.wait().expect("it ends").code().unwrap_or(-1);
        (code, Path::new(&self.port).symlink_metadata().is_ok())
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Returns the joint positions of the simulated arm, rad.
pub(crate) fn place(sim: &Sim) -> Vec<f64> {
    let status = sim.json(&["status"], 0);
    status["joints"].as_array().unwrap().iter().map(|joint| joint["position_rad"].as_f64().unwrap()).collect()
}

/// Checks that the arm is at these joint positions.
pub(crate) fn at(sim: &Sim, q: [f64; 6]) {
    for (joint, (is, should)) in place(sim).into_iter().zip(q).enumerate() {
        assert!((is - should).abs() < 3e-3, "joint {}: {is} instead of {should}", joint + 1);
    }
}

/// Starts a command that moves the arm, and waits until the arm has moved for `seconds`.
pub(crate) fn moving_while(sim: &Sim, words: &[&str], seconds: f64) -> std::process::Child {
    moving_after(sim, words, "", seconds)
}

/// Like [`moving_while`], for the motion that begins after the command has printed a line with this text.
pub(crate) fn moving_after(sim: &Sim, words: &[&str], text: &str, seconds: f64) -> std::process::Child {
    let mut child = sim
        .command(&[&["--json"], words].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut err = BufReader::new(child.stderr.take().unwrap());
    let (mut line, mut behind) = (String::new(), false);
    loop {
        line.clear();
        assert!(err.read_line(&mut line).unwrap() > 0, "it ended early");
        behind |= line.contains(text);
        if !behind {
            continue;
        }
        let event: Value = serde_json::from_str(&line).unwrap_or_default();
        if event["path_s"].as_f64().is_some_and(|s| s > seconds) {
            break;
        }
    }
    std::thread::spawn(move || err.read_to_string(&mut String::new()));
    child
}

/// Returns a smooth trajectory file. The motion moves all joints by at most `amplitude` rad from the zero pose and
/// back, in 1.2 s.
pub(crate) fn motion(amplitude: f64) -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=120 {
        let s = f64::from(i) / 120.0;
        let q = amplitude * (std::f64::consts::PI * s).sin().powi(4);
        text += &format!("{:.3},{q},{},{q},{q},{},{q}\n", f64::from(i) * 0.01, -0.5 * q, -q);
    }
    text
}

/// Returns a slow motion of all joints, up to 0.2 rad and back. The motion takes `tenths` tenths of a second.
pub(crate) fn slow_motion(tenths: i32) -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=tenths {
        let q = 0.2 * (std::f64::consts::PI * f64::from(i) / f64::from(tenths)).sin().powi(4);
        text += &format!("{:.1},{q},{q},{q},{q},{q},{q}\n", f64::from(i) * 0.1);
    }
    text
}
