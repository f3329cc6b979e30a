//! A person at a terminal while an arm moves: keys, signals, and a terminal that is as it was afterwards.
#![cfg(unix)]

mod common;

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, Stdio};

use common::{Sim, command};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, tcgetattr};

/// A terminal: the person's end, and the command's.
fn terminal() -> (File, OwnedFd) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    (File::from(master), slave)
}

/// 20 s of a slow motion of all joints.
fn slow_motion() -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=200 {
        let q = 0.2 * (std::f64::consts::PI * f64::from(i) / 200.0).sin().powi(4);
        text += &format!("{:.1},{q},{q},{q},{q},{q},{q}\n", f64::from(i) * 0.1);
    }
    text
}

/// A run that is just about to move, in real time, with a person at its terminal.
struct Run {
    sim: Sim,
    child: Child,
    person: File,
    slave: OwnedFd,
    err: Option<BufReader<std::process::ChildStderr>>,
}

impl Run {
    fn start() -> Self {
        let sim = Sim::start(&["--no-throttle"]);
        sim.jtc(&["params", "use-defaults"]).ends(0);
        let file = sim.path("motion.csv");
        std::fs::write(&file, slow_motion()).unwrap();
        let (person, slave) = terminal();
        let mut child = command()
            .args(["--json", "traj", "run", &file, "--record", &sim.path("run.csv")])
            .args(["--port", sim.port.to_str().unwrap()])
            .stdin(Stdio::from(slave.try_clone().unwrap()))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut err = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("space pauses") {
            line.clear();
            assert!(err.read_line(&mut line).unwrap() > 0, "it ended before it moved");
        }
        Self { sim, child, person, slave, err: Some(err) }
    }

    /// Waits for the end: exit code and what was printed.
    fn end(mut self) -> (i32, serde_json::Value, Sim) {
        let code = self.child.wait().unwrap().code().unwrap_or(-1);
        let mut out = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        let modes = tcgetattr(&self.slave).unwrap().local_modes;
        assert!(modes.contains(LocalModes::ICANON | LocalModes::ECHO), "the terminal was left changed");
        (code, serde_json::from_str(out.trim()).unwrap_or_default(), self.sim)
    }
}

fn stands(sim: &Sim) {
    let status = sim.jtc(&["--json", "status"]).ends(0).json();
    assert_eq!(
        (status["state"].as_str(), status["trajectory"].as_str()),
        (Some("HoldPos"), Some("Stop")),
        "{status}"
    );
    for joint in status["joints"].as_array().unwrap() {
        assert!(joint["velocity_rad_s"].as_f64().unwrap().abs() < 0.02, "{joint}");
    }
}

/// J-33: however a person or a system ends the command, the arm is stopped on its path first.
#[test]
fn j33_every_signal_stops_on_the_path_and_then_ends() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let mut run = Run::start();
        if signal == "-HUP" {
            // The terminal has gone: nothing that is said reaches anybody.
            run.err = None;
        }
        cli_kit::trial::signal(&run.child, signal);
        let (code, value, sim) = run.end();
        assert_eq!((code, value["outcome"].as_str()), (5, Some("stopped")), "{signal}: {value}");
        stands(&sim);
    }
}

/// Space pauses, space goes on, `s` stops.
#[test]
fn j33_keys_pause_resume_and_stop() {
    let mut run = Run::start();
    let mut err = run.err.take().unwrap();
    let mut until = |words: &str| {
        let mut line = String::new();
        while !line.contains(words) {
            line.clear();
            assert!(err.read_line(&mut line).unwrap() > 0, "it ended before: {words}");
        }
    };
    until("moving");
    run.person.write_all(b" ").unwrap();
    until("paused");
    run.person.write_all(b" ").unwrap();
    until("moving");
    run.person.write_all(b"s").unwrap();
    until("stopping");
    let (code, value, sim) = run.end();
    assert_eq!((code, value["outcome"].as_str()), (5, Some("stopped")), "{value}");
    let recording = std::fs::read_to_string(sim.path("run.csv")).unwrap();
    let states: Vec<&str> = recording.lines().skip(1).filter_map(|row| row.split(',').nth(2)).collect();
    let first = |state| states.iter().position(|s| *s == state).unwrap_or(usize::MAX);
    let last = |state| states.iter().rposition(|s| *s == state).unwrap_or(0);
    assert!(first("3") < first("2") && last("2") < last("3") && last("3") < last("1"), "{states:?}");
    stands(&sim);
}

/// A second Ctrl-C ends the command at once, says what may be, and leaves the terminal as it was.
#[test]
fn a_second_interrupt_ends_at_once_and_says_that_the_arm_may_be_moving() {
    let mut run = Run::start();
    let mut err = run.err.take().unwrap();
    cli_kit::trial::signal(&run.child, "-INT");
    let mut line = String::new();
    while !line.contains("stopping on the path") {
        line.clear();
        assert!(err.read_line(&mut line).unwrap() > 0);
    }
    // Signals within 0.1 s are one.
    std::thread::sleep(std::time::Duration::from_millis(150));
    cli_kit::trial::signal(&run.child, "-INT");
    let (code, value, sim) = run.end();
    let mut rest = String::new();
    err.read_to_string(&mut rest).unwrap();
    // On a slow computer the first one may have come to its end already.
    let at_once = value["error"]["code"] == "ended-at-once";
    assert!(code == 5 && (at_once || value["outcome"] == "stopped"), "{code} {value}");
    let words = rest.contains("MAY BE MOVING") || rest.contains("moves nothing any more");
    assert!(!at_once || words, "{rest}");
    // No file that was never written is left.
    assert_eq!(std::path::Path::new(&sim.path("run.csv")).exists(), !at_once);
    sim.jtc(&["traj", "stop"]);
}

/// Teaching: a terminal and a wrapper may both send a signal, which is one; a second press ends it with words about the controller.
#[test]
fn a_second_interrupt_while_teaching_says_that_the_controller_stays_in_teaching() {
    for close in [true, false] {
        let sim = Sim::start(&["--no-throttle"]);
        sim.jtc(&["recover", "--defaults"]).ends(0);
        let file = sim.path("taught.csv");
        let mut child = command()
            .args(["--json", "teach", "record", &file, "--port", sim.port.to_str().unwrap()])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut err = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !line.contains("Ctrl-C ends") {
            line.clear();
            assert!(err.read_line(&mut line).unwrap() > 0, "it ended before it recorded");
        }
        cli_kit::trial::signal(&child, "-INT");
        if !close {
            std::thread::sleep(std::time::Duration::from_millis(150));
        }
        cli_kit::trial::signal(&child, "-INT");
        let code = child.wait().unwrap().code();
        let mut out = String::new();
        child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        let value: serde_json::Value = serde_json::from_str(out.trim()).unwrap_or_default();
        assert!(!std::path::Path::new(&file).exists(), "an empty file is left");
        let state = sim.jtc(&["--json", "status"]).ends(0).json()["state"].clone();
        if value["error"]["code"] == "ended-at-once" {
            assert!(!close && code == Some(5), "{code:?} {value}");
            assert!(value["error"]["message"].as_str().unwrap().contains("stays in Teaching"), "{value}");
        } else {
            // The first one did its work before the second came: the arm was not moved, and is held again.
            assert_eq!((code, state.as_str()), (Some(2), Some("HoldPos")), "{value}");
        }
    }
}
