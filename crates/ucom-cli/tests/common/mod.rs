//! Runs the `ucom` command as a user does, with a simulated chain.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use can_link::{CanBus, CanFrame, Id};
use cli_kit::testing::{CommandOutput, ended, program, run, signal};
use serde_json::Value;
use test_kit::patience::Patience;

fn command() -> Command {
    program(env!("CARGO_BIN_EXE_ucom"), "UCOM_")
}

/// Runs `ucom` with the arguments `words`.
pub(crate) fn ucom(words: &[&str]) -> CommandOutput {
    ucom_with(words, "")
}

/// Runs `ucom` with the text `stdin` on its standard input.
pub(crate) fn ucom_with(words: &[&str], stdin: &str) -> CommandOutput {
    run(command(), words, stdin)
}

/// Simulated chain that ends when the test ends.
pub(crate) struct Sim {
    child: Child,
    pub url: String,
    pub dir: tempfile::TempDir,
}

impl Sim {
    /// Starts a simulator on a free port and waits until it is ready.
    pub(crate) fn start(options: &[&str]) -> Self {
        let mut child = command()
            .args(["sim", "--listen", "127.0.0.1:0"])
            .args(options)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("ucom sim starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
        let Some(url) = line.trim().strip_prefix("ready: ") else {
            let mut err = String::new();
            child.stderr.take().expect("stderr").read_to_string(&mut err).ok();
            panic!("ucom sim prints {line:?}, {err}");
        };
        Self { child, url: url.to_owned(), dir: tempfile::tempdir().expect("a directory") }
    }

    /// Like `start`, but all boards have numbers.
    pub(crate) fn numbered(options: &[&str]) -> Self {
        let sim = Self::start(options);
        sim.ucom(&["init"]).ends(0);
        sim
    }

    /// Returns a `ucom` command that uses the bus of the chain.
    pub(crate) fn command(&self) -> Command {
        let mut command = command();
        command.env("UCOM_BUS", &self.url).env("UCOM_INVENTORY", self.path("inventory.toml"));
        command.env("UCOM_CACHE", self.path("cache"));
        command
    }

    /// Runs `ucom` on the bus of the chain, with an inventory and a cache that belong to this test.
    pub(crate) fn ucom(&self, words: &[&str]) -> CommandOutput {
        run(self.command(), words, "")
    }

    /// Returns the output of `ucom --json` with these arguments; panics if the exit code differs from `code`.
    pub(crate) fn json(&self, words: &[&str], code: i32) -> Value {
        self.ucom(&[&["--json"], words].concat()).ends(code).json()
    }

    /// Returns the status byte of a board.
    pub(crate) fn status_byte(&self, board: &str) -> Value {
        self.json(&["status", board], 0)["boards"][0]["status_byte"].clone()
    }

    /// Starts `ucom` on the bus of the chain; the command runs in parallel with the test.
    pub(crate) fn spawn(&self, words: &[&str]) -> Child {
        let mut command = self.command();
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("ucom starts")
    }

    /// Returns a path in the directory of the chain.
    pub(crate) fn path(&self, name: &str) -> String {
        self.dir.path().join(name).to_str().unwrap().to_owned()
    }

    /// Creates a file in the directory of the chain.
    pub(crate) fn file(&self, name: &str, bytes: &[u8]) -> String {
        std::fs::write(self.path(name), bytes).expect("a file");
        self.path(name)
    }

    /// Starts a fault in the simulated chain.
    pub(crate) fn fault(&mut self, line: &str) {
        let stdin = self.child.stdin.as_mut().expect("stdin");
        writeln!(stdin, "{line}").expect("the simulator reads");
        // The simulator reads its stdin every 50 ms, so the fault has begun after 150 ms.
        std::thread::sleep(Duration::from_millis(150));
    }

    /// Opens the bus of the chain as a device that sends and receives plain frames.
    pub(crate) fn peer(&self) -> Peer {
        Peer { bus: can_link::open(&self.url).expect("the bus opens") }
    }

    /// Kills the simulator. For other devices on the bus, a killed simulator is like a power cut. The
    /// directory of the simulator is not removed.
    pub(crate) fn kill(mut self) -> tempfile::TempDir {
        self.child.kill().expect("kill");
        self.child.wait().expect("it ends");
        std::mem::replace(&mut self.dir, tempfile::tempdir().expect("a directory"))
    }

    /// Sends a signal to the simulator.
    pub(crate) fn signal(&self, name: &str) {
        signal(&self.child, name);
    }

    /// Sends a signal, waits until the simulator has ended, and returns its exit code.
    pub(crate) fn end(mut self, name: &str) -> i32 {
        signal(&self.child, name);
        self.child.wait().expect("it ends").code().unwrap_or(-1)
    }
}

impl Drop for Sim {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Sends a signal to a command and waits until the command has ended.
pub(crate) fn ended_by(child: Child, name: &str) -> CommandOutput {
    signal(&child, name);
    ended(child)
}

/// Returns the update outcome of each board.
pub(crate) fn outcomes(report: &Value) -> Vec<&str> {
    report["boards"].as_array().unwrap().iter().map(|b| b["outcome"].as_str().unwrap()).collect()
}

/// Device on the bus that sends and receives raw frames.
pub(crate) struct Peer {
    bus: Box<dyn CanBus + Send>,
}

impl Peer {
    /// Sends a frame in candump notation, for example `1C1#0202`.
    pub(crate) fn send(&mut self, text: &str) {
        let (id, data) = text.split_once('#').expect("ID#DATA");
        let id = Id::standard(u32::from_str_radix(id, 16).expect("hex")).expect("11 bits");
        let data: Vec<u8> = (0..data.len() / 2)
            .map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).expect("hex"))
            .collect();
        self.bus.send(&CanFrame::classic(id, &data).expect("8 bytes")).expect("sent");
    }

    /// Returns how often the controller of the device went bus-off, as reported by the server.
    pub(crate) fn times_bus_off(&self) -> u64 {
        self.bus.times_bus_off()
    }

    /// Returns the next frame that arrives within `within_ms`.
    pub(crate) fn receive(&mut self, within_ms: u64) -> Option<String> {
        self.receive_for(Duration::from_millis(within_ms))
    }

    fn receive_for(&mut self, time: Duration) -> Option<String> {
        let frame = self.bus.receive(time).expect("the bus works")?;
        let data: String = frame.data().iter().map(|b| format!("{b:02X}")).collect();
        Some(format!("{}#{data}", frame.id()))
    }

    /// Returns all frames that arrive within `within_ms`.
    pub(crate) fn all(&mut self, within_ms: u64) -> Vec<String> {
        let end = Instant::now() + Duration::from_millis(within_ms);
        let mut received = Vec::new();
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            received.extend(self.receive(left.as_millis() as u64));
        }
        received
    }

    /// Waits for a frame that begins with `start`, and skips other frames.
    pub(crate) fn wait(&mut self, start: &str) -> String {
        let mut patience = Patience::begin();
        let mut next = || patience.wait(format_args!("a frame {start}"), |time| self.receive_for(time));
        loop {
            if let Some(frame) = next().filter(|frame| frame.starts_with(start)) {
                return frame;
            }
        }
    }

    /// Waits for `count` frames that begin with `start`.
    pub(crate) fn wait_for(&mut self, count: usize, start: &str) {
        (0..count).for_each(|_| drop(self.wait(start)));
    }
}

/// Returns an image of `bytes` bytes; each seed gives another image.
pub(crate) fn image(bytes: usize, seed: u8) -> Vec<u8> {
    (0..bytes).map(|i| (i * 37 + 11) as u8 ^ seed).collect()
}

/// Returns the example image in the protocol document. The Program ID of the example image is 0x4B3F.
pub(crate) fn golden() -> Vec<u8> {
    (0..1000_usize).map(|i| (37 * i + 11) as u8).collect()
}
