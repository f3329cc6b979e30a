//! Simulated workplace of a user who types commands. The workplace has a directory, a port and a controller.
#![cfg(target_os = "linux")]

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use test_kit::page::{Printed, blurred};

use crate::common::{Sim, command};

/// Name of the port in the documentation.
const PORT: &str = "/tmp/jtc";

/// Output of a command that the user typed.
pub(crate) struct Seen(pub Printed);

impl std::ops::Deref for Seen {
    type Target = Printed;
    fn deref(&self) -> &Printed {
        &self.0
    }
}

impl Seen {
    /// Replaces values that differ between runs by placeholders.
    pub(crate) fn blurred(self) -> Printed {
        Printed { code: self.code, text: blurred(&self.text) }
    }
}

/// Creates a pseudo-terminal. Returns the side of the test, and the path that a command opens.
fn terminal() -> (File, String, OwnedFd) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    (File::from(master), name.to_string_lossy().into_owned(), slave)
}

/// Serial line with a connected device that is not a controller.
pub(crate) struct Line {
    port: String,
    ended: Arc<AtomicBool>,
    _slave: OwnedFd,
}

impl Line {
    /// Creates a device that repeatedly sends this text, and ignores the bytes that it receives.
    pub(crate) fn new(text: &'static str) -> Self {
        let (mut end, port, slave) = terminal();
        let mut raw = rustix::termios::tcgetattr(&slave).unwrap();
        raw.make_raw();
        rustix::termios::tcsetattr(&slave, rustix::termios::OptionalActions::Now, &raw).unwrap();
        let ended = Arc::new(AtomicBool::new(false));
        let over = Arc::clone(&ended);
        std::thread::spawn(move || {
            while !over.load(Ordering::Relaxed) {
                end.write_all(text.as_bytes()).ok();
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        Self { port, ended, _slave: slave }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
    }
}

/// Directory and port of a simulated workplace.
pub(crate) struct Desk {
    dir: tempfile::TempDir,
    sim: Option<Sim>,
    line: Option<Line>,
}

impl Desk {
    /// Creates a workplace without a device at the port.
    pub(crate) fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap(), sim: None, line: None }
    }

    /// Creates a workplace with this serial line at the port.
    pub(crate) fn at(line: Line) -> Self {
        Self { line: Some(line), ..Self::new() }
    }

    /// Creates a workplace with a simulated controller at the port.
    pub(crate) fn simulated(options: &[&str]) -> Self {
        Self { sim: Some(Sim::start(options)), ..Self::new() }
    }

    /// Returns the directory with the files of the workplace.
    pub(crate) fn dir(&self) -> &Path {
        self.dir.path()
    }

    fn port(&self) -> String {
        match (&self.sim, &self.line) {
            (Some(sim), _) => sim.port.to_str().unwrap().to_owned(),
            (None, Some(line)) => line.port.clone(),
            (None, None) => self.dir().join("jtc").to_str().unwrap().to_owned(),
        }
    }

    /// Returns a shell that writes stdout and stderr of its commands into one stream, like a terminal.
    fn shell(&self, shown: &str) -> Command {
        let jtc = command();
        let mut shell = Command::new("sh");
        for (name, value) in jtc.get_envs().filter(|(_, value)| value.is_none()) {
            debug_assert!(value.is_none());
            shell.env_remove(name);
        }
        let programs = Path::new(env!("CARGO_BIN_EXE_jtc")).parent().unwrap();
        let path = std::env::var("PATH").unwrap_or_default();
        let real = shown.replace(PORT, &self.port());
        // If the shell runs a single command, it uses `exec`, so that a signal reaches the command.
        let alone = !real.contains([';', '|']);
        shell
            .args(["-c", &format!("exec 2>&1\n{}{real}", if alone { "exec " } else { "" })])
            .current_dir(self.dir())
            .env("PATH", format!("{}:{path}", programs.display()))
            .env("JTC_PORT", self.port())
            .env("COLUMNS", "100")
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        shell
    }

    fn seen(&self, code: Option<i32>, text: &str) -> Seen {
        let text = text.replace(&self.port(), PORT).replace(&format!("{}/", self.dir().display()), "");
        Seen(Printed { code: code.unwrap_or(-1), text })
    }

    /// Runs a command and returns its output.
    pub(crate) fn run(&self, shown: &str) -> Seen {
        let output = self.shell(shown).stdin(Stdio::null()).output().unwrap();
        self.seen(output.status.code(), &String::from_utf8_lossy(&output.stdout))
    }

    /// Like [`Self::run`], for a command that moves the arm. The function calls `happens` when the arm moves.
    pub(crate) fn moving(&self, shown: &str, happens: impl FnOnce(&Child, &Sim)) -> Seen {
        let (_person, _, slave) = terminal();
        let mut child = self.shell(shown).stdin(Stdio::from(slave)).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut text = String::new();
        while !text.ends_with("moving\n") && out.read_line(&mut text).unwrap() > 0 {}
        happens(&child, self.sim.as_ref().unwrap());
        out.read_to_string(&mut text).unwrap();
        self.seen(child.wait().unwrap().code(), &text)
    }

    /// Writes a line to the standard input of the simulator.
    pub(crate) fn write_line(&mut self, line: &str) {
        if let Some(sim) = &mut self.sim {
            sim.write_line(line);
        }
    }

    /// Opens the port of the workplace as another program does.
    pub(crate) fn hold_port(&self) -> jtc_host::port::SerialPort {
        jtc_host::port::SerialPort::open(&self.port(), 115_200).unwrap()
    }
}
