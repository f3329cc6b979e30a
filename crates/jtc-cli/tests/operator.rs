//! Tests of a user at a terminal while an arm moves. The tests cover keys, signals, and the restored terminal.
#![cfg(unix)]

use crate::common;

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, ChildStderr, Stdio};

use common::{Sim, jtc, slow_motion};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, tcgetattr};
use test_kit::patience::Patience;

/// Creates a pseudo-terminal. Returns the side of the user and the side of the command.
fn terminal() -> (File, OwnedFd) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).unwrap();
    unlockpt(&master).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    (File::from(master), slave)
}

/// Reads the output of a command until it contains these words.
fn until(err: &mut impl BufRead, words: &str) {
    let (mut line, mut all) = (String::new(), String::new());
    while !line.contains(words) {
        line.clear();
        assert!(err.read_line(&mut line).unwrap() > 0, "it ended before {words:?}: {all}");
        all += &line;
    }
}

/// A `jtc` command that runs with a simulated user at its terminal. The simulated controller runs in real time.
struct Session {
    sim: Sim,
    child: Child,
    person: File,
    slave: OwnedFd,
    err: Option<BufReader<ChildStderr>>,
}

impl Session {
    /// Starts `jtc --json` with these arguments, and waits until the command has printed `ready`.
    fn start(sim: Sim, words: &[&str], ready: &str) -> Self {
        let (person, slave) = terminal();
        let mut child = sim
            .command(&[&["--json"], words].concat())
            .stdin(Stdio::from(slave.try_clone().unwrap()))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let err = child.stderr.take().map(BufReader::new);
        let mut session = Self { sim, child, person, slave, err };
        session.until(ready);
        session
    }

    /// Starts a run, and waits until the motion is about to begin.
    fn run() -> Self {
        let sim = Sim::start(&["--no-throttle"]).with_parameters();
        let (file, record) = (sim.path("motion.csv"), sim.path("run.csv"));
        std::fs::write(&file, slow_motion(200)).unwrap();
        Self::start(sim, &["traj", "run", &file, "--record", &record], "space pauses")
    }

    /// Starts `jtc teach record`, and waits until the arm is in Teaching.
    fn teaching() -> Self {
        let sim = Sim::start(&["--no-throttle"]).held();
        let file = sim.path("taught.csv");
        Self::start(sim, &["teach", "record", &file], "Ctrl-C ends")
    }

    fn signal(&self, signal: &str) {
        cli_kit::testing::signal(&self.child, signal);
    }

    /// Waits until the command has printed `words`.
    fn until(&mut self, words: &str) {
        until(self.err.as_mut().expect("somebody listens"), words);
    }

    /// Waits until the command ends.
    fn end(mut self) -> Ended {
        let code = self.child.wait().unwrap().code().unwrap_or(-1);
        let (mut out, mut err) = (String::new(), String::new());
        self.child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
        if let Some(mut rest) = self.err {
            rest.read_to_string(&mut err).unwrap();
        }
        let modes = tcgetattr(&self.slave).unwrap().local_modes;
        assert!(modes.contains(LocalModes::ICANON | LocalModes::ECHO), "the terminal was left changed");
        Ended { code, value: serde_json::from_str(out.trim()).unwrap_or_default(), err, sim: self.sim }
    }
}

/// Result of a command, with exit code, stdout, remaining stderr, and the simulator.
struct Ended {
    code: i32,
    value: serde_json::Value,
    err: String,
    sim: Sim,
}

/// Waits until the controller is in this state.
fn reaches(sim: &Sim, state: &str) {
    let mut patience = Patience::begin();
    loop {
        let status = sim.json(&["status"], 0);
        if status["state"] == state {
            return;
        }
        patience.pause(format_args!("{state}: {status}"));
    }
}

fn stands(sim: &Sim) {
    let status = sim.json(&["status"], 0);
    assert_eq!(
        (status["state"].as_str(), status["trajectory"].as_str()),
        (Some("HoldPos"), Some("Stop")),
        "{status}"
    );
    for joint in status["joints"].as_array().unwrap() {
        assert!(joint["velocity_rad_s"].as_f64().unwrap().abs() < 0.02, "{joint}");
    }
}

/// J-33: if the user or the operating system ends the command, the command first stops the arm on its path.
#[test]
fn j33_every_signal_stops_on_the_path_and_then_ends() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let mut run = Session::run();
        if signal == "-HUP" {
            // The terminal is closed, so nothing reads the output of the command.
            run.err = None;
        }
        run.signal(signal);
        let Ended { code, value, sim, .. } = run.end();
        assert_eq!((code, value["outcome"].as_str()), (5, Some("stopped")), "{signal}: {value}");
        stands(&sim);
    }
}

/// The space bar pauses and resumes the motion, and `s` stops the motion.
#[test]
fn j33_keys_pause_resume_and_stop() {
    let mut run = Session::run();
    run.until("moving");
    run.person.write_all(b" ").unwrap();
    run.until("paused");
    run.person.write_all(b" ").unwrap();
    run.until("moving");
    run.person.write_all(b"s").unwrap();
    run.until("stopping");
    let Ended { code, value, sim, .. } = run.end();
    assert_eq!((code, value["outcome"].as_str()), (5, Some("stopped")), "{value}");
    let recording = std::fs::read_to_string(sim.path("run.csv")).unwrap();
    let states: Vec<&str> = recording.lines().skip(1).filter_map(|row| row.split(',').nth(2)).collect();
    let first = |state| states.iter().position(|s| *s == state).unwrap_or(usize::MAX);
    let last = |state| states.iter().rposition(|s| *s == state).unwrap_or(0);
    assert!(first("3") < first("2") && last("2") < last("3") && last("3") < last("1"), "{states:?}");
    stands(&sim);
}

/// After a second Ctrl-C, the command reports the possible state of the arm, restores the terminal and ends at once.
#[test]
fn a_second_interrupt_ends_at_once_and_says_that_the_arm_may_be_moving() {
    let mut run = Session::run();
    run.signal("-INT");
    run.until("stopping on the path");
    // Signals within 0.1 s count as one signal, so the test waits 0.15 s before the second signal.
    std::thread::sleep(std::time::Duration::from_millis(150));
    run.signal("-INT");
    let Ended { code, value, err, sim } = run.end();
    // On a slow computer, the command may already have ended after the first signal. Its outcome is then `stopped`,
    // as after a single Ctrl-C.
    let at_once = value["error"]["code"] == "ended-at-once";
    assert!(code == 5 && (at_once || value["outcome"] == "stopped"), "{code} {value}");
    let words = err.contains("MAY BE MOVING") || err.contains("moves nothing more");
    assert!(!at_once || words, "{err}");
    // The recording of the interrupted run is complete enough for `jtc report`.
    jtc(&["report", &sim.path("run.csv")]).ends(0);
    sim.jtc(&["traj", "stop"]);
}

/// If both a terminal and a wrapper program send a signal during Teaching, the two signals count as one signal. A second Ctrl-C ends the
/// command with a message about the controller.
#[test]
fn a_second_interrupt_while_teaching_says_that_the_controller_stays_in_teaching() {
    for close in [true, false] {
        let teaching = Session::teaching();
        teaching.signal("-INT");
        if !close {
            std::thread::sleep(std::time::Duration::from_millis(150));
        }
        teaching.signal("-INT");
        let Ended { code, value, sim, .. } = teaching.end();
        assert!(!std::path::Path::new(&sim.path("taught.csv")).exists(), "an empty file is left");
        let state = sim.json(&["status"], 0)["state"].clone();
        if value["error"]["code"] == "ended-at-once" {
            assert!(!close && code == 5, "{code} {value}");
            assert!(value["error"]["message"].as_str().unwrap().contains("stays in Teaching"), "{value}");
        } else {
            // The first signal ended the command before the second signal arrived. The exit code is 2, because the
            // user has not moved the arm. The controller is in HoldPos again.
            assert_eq!((code, state.as_str()), (2, Some("HoldPos")), "{value}");
        }
    }
}

/// Interrupts a command when its stderr contains the text `at`. Returns the exit code and the JSON result of the command.
fn interrupted(sim: &Sim, words: &[&str], at: &str) -> (i32, serde_json::Value) {
    let mut child = sim
        .command(&[&["--json"], words].concat())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut err = BufReader::new(child.stderr.take().unwrap());
    until(&mut err, at);
    cli_kit::testing::signal(&child, "-INT");
    // The test does not read stderr after this point. Even if the pipe becomes full, the command must not block.
    let mut out = String::new();
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    let code = child.wait().unwrap().code().unwrap_or(-1);
    (code, serde_json::from_str(out.trim()).unwrap_or_else(|e| panic!("{e}: {out:?}")))
}

/// After Ctrl-C in any wait before the motion, the arm does not move. The command reports this result with exit code 5.
#[test]
fn j33_an_interrupt_in_a_wait_of_a_run_starts_no_motion() {
    let sim = Sim::start(&[]);
    let file = sim.file("motion.csv", &slow_motion(200));
    let run = ["traj", "run", &file];
    // The test sets the parameters before the run. The run must then wait some seconds until the drives are enabled.
    sim.jtc(&["params", "use-defaults"]).ends(0);
    let waits = [("waiting until", "wait for the drives"), ("uploading", "upload")];
    for (at, during) in waits {
        let (code, value) = interrupted(&sim, &run, at);
        let message = value["error"]["message"].as_str().unwrap_or_default();
        assert_eq!((code, value["error"]["code"].as_str()), (5, Some("cancelled")), "{value}");
        assert!(
            message.contains(&format!("during the {during}")) && message.contains("not started"),
            "{value}"
        );
        let status = sim.json(&["status"], 0);
        assert_ne!(status["trajectory"], "Execute", "{status}");
        assert_eq!(status["point"], 0, "{status}");
    }
}

/// If the user presses Ctrl-C while a jog waits for the drives, the command reports that it has sent no jog. The
/// command does not report a jog by 0 rad.
#[test]
fn j58_an_interrupt_of_a_jog_that_waits_jogs_nothing() {
    let sim = Sim::start(&[]);
    sim.jtc(&["params", "use-defaults"]).ends(0);
    // The test waits for HoldPos. After that, enabling the drives still takes some seconds.
    loop {
        let status = sim.json(&["status"], 0);
        if status["state"] == "HoldPos" {
            break;
        }
        assert_ne!(status["state"], "Error", "{status}");
    }
    let (code, value) = interrupted(&sim, &["jog", "1", "0.1"], "waiting until");
    assert_eq!((code, value["error"]["code"].as_str()), (5, Some("cancelled")), "{value}");
    let message = value["error"]["message"].as_str().unwrap_or_default();
    assert!(message.contains("during the wait for the drives"), "{value}");
}

/// Ctrl-C during the approach stops the arm on the path of the approach, and the motion does not begin.
#[test]
fn j33_an_interrupt_on_the_approach_stops_on_it() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.path("away.csv");
    let away: String = (0..=10).map(|i| format!("{:.1},0.8,0,0,0,0,0\n", f64::from(i) * 0.1)).collect();
    std::fs::write(&file, format!("t,q1,q2,q3,q4,q5,q6\n{away}")).unwrap();
    let (_person, slave) = terminal();
    let mut child = sim
        .command(&["--json", "traj", "run", &file, "--approach", "--speed", "5"])
        .stdin(Stdio::from(slave.try_clone().unwrap()))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut err = BufReader::new(child.stderr.take().unwrap());
    until(&mut err, "moving");
    cli_kit::testing::signal(&child, "-INT");
    let output = cli_kit::testing::ended(child).ends(5);
    let value = output.json();
    assert_eq!(
        (value["outcome"].as_str(), value["phase"].as_str()),
        (Some("stopped"), Some("approach")),
        "{value}"
    );
    stands(&sim);
    let status = sim.json(&["status"], 0);
    assert!(status["joints"][0]["position_rad"].as_f64().unwrap() < 0.7, "{status}");
}

/// If the user presses Ctrl-C while `recover` waits, the command sends no further request, but it still stops a
/// motion. The test checks the output of the command in each state.
#[test]
fn j33_an_interrupt_of_recover_leaves_a_standing_arm() {
    let cancelled = |sim: &Sim, words: &[&str], at: &str| {
        let (code, value) = interrupted(sim, words, at);
        assert_eq!((code, value["error"]["code"].as_str()), (5, Some("cancelled")), "{at}: {value}");
    };
    // After the start of the controller, `recover` waits for the drives. The drive of joint 1 is never enabled, so
    // `recover` still waits when the user presses Ctrl-C.
    let fault = "format = 2\n[[fault]]\nkind = \"ignores-state\"\njoint = 1\nat_s = 0\n";
    cancelled(
        &Sim::with_faults(&["--no-throttle"], fault),
        &["recover", "--defaults"],
        "waiting for joint 1",
    );
    // Fault for the last case of this test: in Teaching, the user presses the emergency stop. The delay of 5 s lets
    // `teach on` first receive a status with Teaching.
    let fault = "format = 2\n[[fault]]\nkind = \"safety-input\"\nin_state = \"teaching\"\nafter_s = 5\n";
    let sim = Sim::with_faults(&["--no-throttle"], fault).held();
    // The program of a motion is killed, so the arm moves and no program monitors the motion. `recover` stops this
    // motion, and the arm must come to rest even if the user presses Ctrl-C.
    let file = sim.file("motion.csv", &slow_motion(600));
    let (_person, slave) = terminal();
    let mut run = sim
        .command(&["traj", "run", &file])
        .stdin(Stdio::from(slave))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    until(&mut BufReader::new(run.stderr.take().unwrap()), "moving");
    run.kill().unwrap();
    run.wait().unwrap();
    cancelled(&sim, &["recover"], "stopping the motion");
    stands(&sim);
    // In Teaching, the emergency stop is pressed and stays pressed. After Ctrl-C, `recover` no longer waits for its
    // release, and the controller stays in Error.
    sim.jtc(&["teach", "on"]).ends(0);
    reaches(&sim, "Error");
    cancelled(&sim, &["recover"], "release the emergency stop (waiting)");
    let status = sim.json(&["status"], 0);
    assert_eq!(status["state"], "Error", "{status}");
}
