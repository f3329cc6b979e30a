//! Tests of `jtc stop` from a second terminal, while another program has opened the port. The arm stops in every
//! phase of this program, and this program does not move the arm again.
#![cfg(unix)]

use crate::common;

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::FileTypeExt as _;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use cli_kit::testing::{CommandOutput, run, signal};
use common::{Sim, command, jtc, motion, place, slow_motion};
use jtc_host::port::SerialPort;
use jtc_host::session::Flow;
use jtc_host::{CheckOptions, CheckedTrajectory, Error, LinkError, PortError, Session};
use serde_json::Value;

/// Simulated controller, and a user whose commands have a separate folder for sockets.
struct Cell(Sim);

impl Cell {
    fn held() -> Self {
        Self(Sim::start(&["--no-throttle"]).held())
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = self.0.command(words);
        command.env("XDG_RUNTIME_DIR", self.0.dir.path());
        command
    }

    fn jtc(&self, words: &[&str]) -> CommandOutput {
        run(self.command(words), &[], "")
    }

    /// Starts a command, and waits until a line of its stderr matches `fits`.
    fn start(&self, words: &[&str], fits: impl Fn(&str) -> bool) -> Child {
        Self::started(self.command(&[&["--json"], words].concat()), words, fits)
    }

    fn started(mut command: Command, words: &[&str], fits: impl Fn(&str) -> bool) -> Child {
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut err = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        while !fits(&line) {
            line.clear();
            assert!(err.read_line(&mut line).unwrap() > 0, "{words:?} ended early");
        }
        std::thread::spawn(move || err.read_to_string(&mut String::new()));
        child
    }

    /// Like `start`, but waits for a line with this text. After that, waits for an event with a path time of at least
    /// `seconds`.
    fn moving(&self, words: &[&str], text: &str, seconds: f64) -> Child {
        let behind = std::cell::Cell::new(text.is_empty());
        self.start(words, |line| {
            behind.set(behind.get() || line.contains(text));
            let event: Value = serde_json::from_str(line).unwrap_or_default();
            behind.get() && event["path_s"].as_f64().is_some_and(|s| s > seconds)
        })
    }

    /// Runs `jtc stop`. Checks that the Stop went through the program `child`, and that this program ends with exit
    /// code 5. Returns the JSON results of `child` and of `jtc stop`.
    fn stops(&self, child: Child) -> (Value, Value) {
        let stopped = self.jtc(&["--json", "stop"]).ends(0).json();
        let pid = child.id();
        let ended = ends(child, 5);
        assert_eq!(stopped["arms"][0]["holder"]["pid"], pid, "{stopped}");
        self.stands();
        (ended, stopped)
    }

    /// Checks that the arm is at rest, and stays at rest.
    fn stands(&self) {
        let status = self.0.json(&["status"], 0);
        assert_ne!(status["trajectory"], "Execute", "{status}");
        let before = place(&self.0);
        std::thread::sleep(Duration::from_millis(400));
        for (before, now) in before.into_iter().zip(place(&self.0)) {
            assert!((before - now).abs() < 1e-3, "{before} {now}");
        }
    }
}

/// Checks that the command ends with this exit code, and returns its output.
fn ends(child: Child, code: i32) -> Value {
    let Output { status, stdout, .. } = child.wait_with_output().unwrap();
    let text = String::from_utf8(stdout).unwrap();
    assert_eq!(status.code(), Some(code), "{text}");
    text.lines().last().map_or(Value::Null, |line| serde_json::from_str(line).unwrap_or_default())
}

#[test]
fn a_run_is_stopped_from_a_second_terminal() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(100));
    let (ended, stopped) = cell.stops(cell.moving(&["traj", "run", &file], "", 1.0));
    assert_eq!(ended["outcome"], "stopped", "{ended}");
    assert_eq!(
        (&stopped["accepted"], &stopped["arms"][0]["moved"]),
        (&true.into(), &true.into()),
        "{stopped}"
    );
    let holder = &stopped["arms"][0]["holder"]["program"];
    assert_eq!(holder, "jtc traj run", "{stopped}");
    // Same test with text output, with the real path of the port, and with `jtc run` and `jtc traj stop` instead
    // of `jtc traj run` and `jtc stop`.
    let child = cell.moving(&["run", &file, "--approach"], "\"phase\":\"motion\"", 0.5);
    let real = std::fs::canonicalize(&cell.0.port).unwrap();
    let mut other = command();
    other.env("XDG_RUNTIME_DIR", cell.0.dir.path()).args(["traj", "stop", "--port", real.to_str().unwrap()]);
    let stopped = run(other, &[], "").ends(0);
    let words = format!("stopped: the arm is at rest; jtc run {file}, process {}, has ", child.id());
    assert!(stopped.out.starts_with(&words), "{}", stopped.out);
    // The message says when the stopped program can request a motion again.
    assert!(stopped.out.contains("it may request a new motion after 3 s"), "{}", stopped.out);
    assert_eq!(ends(child, 5)["outcome"], "stopped");
}

#[test]
fn runs_that_are_repeated_end_with_the_first_stop() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &motion(0.2));
    let child = cell.moving(&["traj", "run", &file, "--repeat", "50"], "run 2 of 50 finished", 0.1);
    let ended = cell.stops(child).0;
    assert!(ended["runs_finished"].as_u64().is_none_or(|runs| runs < 10), "{ended}");
}

#[test]
fn an_approach_that_is_stopped_leads_to_no_run() {
    let cell = Cell::held();
    cell.0.jtc(&["move", "--to", "0.6,0,0,0,0,0"]).ends(0);
    let file = cell.0.file("motion.csv", &slow_motion(50));
    let words = ["traj", "run", &file, "--approach", "--speed", "20"];
    let ended = cell.stops(cell.moving(&words, "", 0.3)).0;
    assert_eq!((&ended["outcome"], &ended["phase"]), (&"stopped".into(), &"approach".into()), "{ended}");
}

#[test]
fn a_move_is_stopped() {
    let cell = Cell::held();
    let ended = cell.stops(cell.moving(&["move", "--to", "1.5,0,0,0,0,0", "--speed", "10"], "", 0.5)).0;
    assert_eq!(ended["outcome"], "stopped", "{ended}");
}

/// On a simulated line with the speed of a real serial line, the upload takes many seconds. After the Stop, this upload has no
/// effect.
#[test]
fn an_upload_does_not_go_on_after_a_stop() {
    let cell = Cell(Sim::start(&[]).held());
    let file = cell.0.file("motion.csv", &slow_motion(300));
    for options in [&[][..], &["--points-per-segment", "1000"]] {
        let words = [&["traj", "run", &file], options].concat();
        let child = cell.start(&words, |line| line.contains("uploading"));
        std::thread::sleep(Duration::from_millis(500));
        let stopped = cell.jtc(&["--json", "stop"]).ends(0).json();
        assert_eq!(stopped["arms"][0]["moved"], false, "{stopped}");
        assert_eq!(stopped["arms"][0]["holder"]["pid"], child.id(), "{stopped}");
        let ended = ends(child, 5);
        let message = ended["error"]["message"].as_str().unwrap_or_default();
        assert!(
            message.contains("stopped") && message.contains("after this motion was requested"),
            "{ended}"
        );
        cell.stands();
    }
    // A new command of the user is allowed to move the arm again.
    let short = cell.0.file("short.csv", &motion(0.1));
    cell.jtc(&["traj", "run", &short]).ends(0);
}

#[test]
fn a_jog_is_stopped_and_does_not_start_again() {
    let cell = Cell::held();
    let before = place(&cell.0)[0];
    // The command does not report when the jog begins, so the test tries several times.
    let (child, stopped) = (1..6)
        .map(|seconds| {
            let mut jog = cell.command(&["jog", "1", "0.2"]);
            let child = jog.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
            std::thread::sleep(Duration::from_secs(seconds));
            (child, cell.jtc(&["--json", "stop"]).ends(0).json())
        })
        .find(|(_, stopped)| stopped["arms"][0]["moved"] == true)
        .expect("it jogs");
    assert_eq!(stopped["arms"][0]["holder"]["pid"], child.id(), "{stopped}");
    let Output { status, stderr, .. } = child.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&stderr);
    assert_eq!(status.code(), Some(5), "{words}");
    assert!(words.contains("jtc stop stopped the arm"), "{words}");
    assert!(place(&cell.0)[0] > before + 0.02);
    cell.stands();
}

#[test]
fn teaching_is_ended_and_the_arm_is_held() {
    let cell = Cell::held();
    let file = cell.0.path("taught.csv");
    let child = cell.start(&["teach", "record", &file], |line| line.contains("\"teaching\""));
    let stopped = cell.jtc(&["stop"]).ends(0);
    assert!(stopped.out.contains("stopped: the arm is at rest; jtc teach record"), "{}", stopped.out);
    ends(child, 5);
    assert_eq!(cell.0.json(&["status"], 0)["state"], "HoldPos");
    // Without another program at the port, the Stop goes directly to the controller, and also ends teaching.
    cell.jtc(&["teach", "on"]).ends(0);
    cell.jtc(&["stop"]).ends(0);
    assert_eq!(cell.0.json(&["status"], 0)["state"], "HoldPos");
}

#[test]
fn a_pause_reaches_the_program_too() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(100));
    let child = cell.moving(&["traj", "run", &file], "", 1.0);
    let paused = cell.jtc(&["traj", "pause"]).ends(0);
    assert!(paused.out.contains("pausing on the path; jtc traj run"), "{}", paused.out);
    // After the arm has come to rest, no motion is in progress, so the controller rejects a further Pause.
    let mut tries = (0..100).map(|_| cell.jtc(&["traj", "pause"]));
    let refused = tries.find(|again| again.code != 0).expect("the arm comes to rest").ends(1);
    assert!(refused.err.contains("trajectory Pause"), "{}", refused.err);
    // A paused motion does not continue after a Stop, and the program of the motion ends.
    cell.jtc(&["stop"]).ends(0);
    assert_eq!(ends(child, 5)["outcome"], "stopped");
}

/// Like a Python program, this program keeps the port open for longer than one motion. The program may be busy with other work while the
/// arm moves.
#[test]
fn a_program_that_uses_the_library_is_stopped_while_it_is_busy_otherwise() {
    let cell = Cell::held();
    let port = cell.0.port.to_str().unwrap().to_owned();
    let mut session = Session::new(SerialPort::open(&port, 115_200).unwrap());
    let status = session.wait_ready(Duration::from_secs(10)).unwrap();
    let loaded = jtc_host::trajectory::Loaded::parse(&slow_motion(100), None).unwrap();
    let arm = session.device_arm().unwrap();
    let options = CheckOptions { device: session.device_config().unwrap(), ..CheckOptions::default() };
    let checked = CheckedTrajectory::check(&loaded.trajectory, &arm, &status.positions(), &options).unwrap();
    session.upload(&checked, |_| Flow::Continue).unwrap();
    session.execute(&checked).unwrap();
    // The program does not read from the port during this time, as if it were busy.
    std::thread::sleep(Duration::from_millis(1500));
    let stopped = cell.jtc(&["--json", "stop"]).ends(0).json();
    assert_eq!(stopped["arms"][0]["moved"], true, "{stopped}");
    assert_eq!(stopped["arms"][0]["holder"]["pid"], std::process::id(), "{stopped}");
    let status = session.fresh_status().unwrap();
    assert!(!status.is_executing());
    let halted =
        |error: Error| matches!(error, Error::Link(LinkError::Port(PortError::Halted { by: Some(_) })));
    // The library rejects the next requests of the same program, because the program sent them before the Stop or too soon
    // after the Stop.
    assert!(session.execute(&checked).is_err_and(halted));
    assert!(session.upload(&checked, |_| Flow::Continue).is_err_and(halted));
    session.ask_to_move().unwrap();
    assert!(session.jog(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).is_err_and(halted));
    assert!(session.teach(true).is_err_and(halted));
    session.jog(&[0.0; 6]).unwrap();
    // After more than three seconds, the library accepts a motion again if the program first calls `ask_to_move`.
    std::thread::sleep(Duration::from_millis(3100));
    assert!(session.jog(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).is_err_and(halted));
    session.ask_to_move().unwrap();
    session.jog(&[0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
}

#[test]
fn nothing_to_stop_is_a_success_in_every_state() {
    let cell = Cell(Sim::start(&["--no-throttle"]));
    let file = cell.0.file("motion.csv", &motion(0.2));
    let nothing = |state: &str, trajectory: &str| {
        let words = format!("nothing was moving: state {state}, trajectory {trajectory}");
        let direct = cell.jtc(&["stop"]).ends(0);
        assert_eq!(direct.out.trim_end(), words);
        let value = cell.jtc(&["--json", "traj", "stop"]).ends(0).json();
        assert_eq!((&value["command"], &value["arms"][0]["moved"]), (&"stop".into(), &false.into()));
        // The Stop also works through a program that only shows the status.
        let mut monitor = cell.command(&["--json", "monitor"]).stdout(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        let mut out = BufReader::new(monitor.stdout.take().unwrap());
        out.read_line(&mut line).unwrap();
        std::thread::spawn(move || out.read_to_string(&mut String::new()));
        let through = cell.jtc(&["stop"]).ends(0);
        monitor.kill().unwrap();
        monitor.wait().unwrap();
        assert!(through.out.starts_with(&format!("{words}; jtc monitor, process ")), "{}", through.out);
    };
    nothing("Init", "Null");
    cell.jtc(&["recover", "--defaults"]).ends(0);
    nothing("HoldPos", "Null");
    cell.jtc(&["traj", "run", &file]).ends(0);
    // The first Stop changes the trajectory state of the finished trajectory from Finish to Stop.
    let direct = cell.jtc(&["stop"]).ends(0);
    assert_eq!(direct.out.trim_end(), "nothing was moving: state HoldPos, trajectory Stop");
    nothing("HoldPos", "Stop");
    let mut child = cell.moving(&["traj", "run", &file, "--speed", "20"], "", 1.0);
    child.kill().unwrap();
    child.wait().unwrap();
    cell.jtc(&["traj", "pause"]).ends(0);
    std::thread::sleep(Duration::from_secs(1));
    let direct = cell.jtc(&["stop"]).ends(0);
    assert_eq!(direct.out.trim_end(), "nothing was moving: state HoldPos, trajectory Stop");
}

/// A Stop cannot hold an arm that has neither brakes nor torque. While the arm falls, the Stop command reports a failure.
#[test]
fn an_arm_that_falls_without_torque_does_not_stand() {
    let stops = |cell: &Cell, state: &str| {
        let stopped = cell.jtc(&["stop"]);
        if stopped.code == 0 {
            assert!(
                stopped.out.starts_with(&format!("nothing was moving: state {state}")),
                "{}",
                stopped.out
            );
        } else {
            let stopped = stopped.ends(5);
            let words = format!("(state {state})");
            assert!(
                stopped.err.contains("moves without torque") && stopped.err.contains(&words),
                "{}",
                stopped.err
            );
            assert!(stopped.err.contains("emergency stop"), "{}", stopped.err);
        }
    };
    let fault = "format = 2\n[[fault]]\nkind = \"motor-fault\"\njoint = 3\nbits = 2\nat_point = 500\n";
    let cell = Cell(Sim::with_faults(&["--no-throttle"], fault).held());
    let file = cell.0.file("motion.csv", &slow_motion(50));
    cell.jtc(&["traj", "run", &file]).ends(5);
    stops(&cell, "Error");
    // `jtc disable` has switched off the torque, so the controller is in Init and cannot hold the arm.
    let cell = Cell(Sim::start(&["--no-throttle"]).held());
    cell.jtc(&["disable", "--yes"]).ends(0);
    stops(&cell, "Init");
}

#[test]
fn the_socket_of_a_program_that_was_killed_is_passed_over() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(100));
    let mut child = cell.moving(&["traj", "run", &file], "", 1.0);
    child.kill().unwrap();
    child.wait().unwrap();
    let sockets: Vec<_> = std::fs::read_dir(cell.0.path("openjtc")).unwrap().flatten().collect();
    assert!(sockets.len() == 1 && sockets[0].file_type().unwrap().is_socket(), "{sockets:?}");
    let stopped = cell.jtc(&["--json", "stop"]).ends(0).json();
    assert_eq!((&stopped["arms"][0]["moved"], &stopped["arms"][0]["holder"]), (&true.into(), &Value::Null));
    cell.stands();
    // The socket of the killed program does not disturb the next program, which is stopped as usual.
    let child = cell.moving(&["traj", "run", &file, "--approach"], "\"phase\":\"motion\"", 0.5);
    cell.stops(child);
}

/// The program that has opened the port is suspended (SIGSTOP). Therefore no frame can be sent, and the message
/// mentions the emergency stop.
#[test]
fn a_program_that_does_not_answer_is_named() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(200));
    let mut child = cell.moving(&["traj", "run", &file], "", 1.0);
    signal(&child, "-STOP");
    let silent = cell.jtc(&["stop"]).ends(3);
    let words = format!("the program that uses this port (process {}) did not answer within 3 s", child.id());
    assert!(silent.err.contains(&words) && silent.err.contains("emergency stop"), "{}", silent.err);
    assert!(silent.err.contains("the Stop was sent, but is not confirmed"), "{}", silent.err);
    assert!(!silent.err.contains("nothing was sent"), "{}", silent.err);
    signal(&child, "-CONT");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn several_ask_at_once_and_one_that_leaves_takes_nothing_back() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(100));
    let child = cell.moving(&["traj", "run", &file], "", 1.0);
    let socket = std::fs::read_dir(cell.0.path("openjtc")).unwrap().flatten().next().unwrap().path();
    // The first client of the socket connects and sends nothing. The next two clients send an invalid line and an
    // unknown request, and get no answer. The Stops of further clients must still work.
    let silent = std::os::unix::net::UnixStream::connect(&socket).unwrap();
    for words in [vec![b'x'; 10_000], b"{\"halt\":\"execute\",\"by\":\"x\"}\n".to_vec()] {
        let mut stream = std::os::unix::net::UnixStream::connect(&socket).unwrap();
        let _ = std::io::Write::write_all(&mut stream, &words);
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        assert_eq!(answer, "");
    }
    let askers: Vec<Child> =
        (0..3).map(|_| cell.command(&["--json", "stop"]).stdout(Stdio::piped()).spawn().unwrap()).collect();
    for asker in askers {
        let stopped = ends(asker, 0);
        assert_eq!(stopped["command"], "stop", "{stopped}");
    }
    drop(silent);
    assert_eq!(ends(child, 5)["outcome"], "stopped");
    cell.stands();
    let child = cell.moving(&["traj", "run", &file, "--approach"], "\"phase\":\"motion\"", 0.5);
    let mut leaves = std::os::unix::net::UnixStream::connect(&socket).unwrap();
    std::io::Write::write_all(&mut leaves, b"{\"halt\":\"stop\",\"by\":\"test\"}\n").unwrap();
    drop(leaves);
    assert_eq!(ends(child, 5)["outcome"], "stopped");
    cell.stands();
}

/// If the user specifies no port, the command sends a Stop to all arms whose ports are open in programs of this user.
#[test]
fn a_stop_without_a_port_finds_the_program_that_moves_an_arm() {
    let cell = Cell::held();
    let file = cell.0.file("motion.csv", &slow_motion(100));
    let child = cell.moving(&["traj", "run", &file], "", 1.0);
    let mut stop = command();
    stop.env("XDG_RUNTIME_DIR", cell.0.dir.path()).env("TMPDIR", cell.0.dir.path()).args(["halt"]);
    let stopped = run(stop, &[], "").ends(0);
    assert!(stopped.out.starts_with("stopped: the arm is at rest; jtc traj run"), "{}", stopped.out);
    assert_eq!(ends(child, 5)["outcome"], "stopped");
}

/// Two moving arms whose programs share a folder for sockets.
struct Two(Cell, Child, Cell, Child);

impl Two {
    fn moving() -> Self {
        let (one, other) = (Cell::held(), Cell::held());
        let file = one.0.file("motion.csv", &slow_motion(200));
        let first = one.moving(&["traj", "run", &file], "", 1.0);
        let words = ["--json", "traj", "run", &file];
        let mut second = other.0.command(&words);
        second.env("XDG_RUNTIME_DIR", one.0.dir.path());
        let second = Cell::started(second, &words, |line| {
            let event: Value = serde_json::from_str(line).unwrap_or_default();
            event["path_s"].as_f64().is_some_and(|s| s > 1.0)
        });
        Self(one, first, other, second)
    }

    fn stop(&self) -> CommandOutput {
        let mut stop = command();
        let folder = self.0.0.dir.path();
        stop.env("XDG_RUNTIME_DIR", folder).env("TMPDIR", folder).args(["--json", "stop"]);
        run(stop, &[], "")
    }
}

/// The controller continues the motion of a killed program. The socket of the killed program still exists, so the command can find the arm.
#[test]
fn the_arm_of_a_program_that_was_killed_is_stopped_beside_another_one() {
    let mut two = Two::moving();
    two.1.kill().unwrap();
    two.1.wait().unwrap();
    let stopped = two.stop().ends(0).json();
    let arms = stopped["arms"].as_array().unwrap();
    assert_eq!(arms.len(), 2, "{stopped}");
    assert!(arms.iter().all(|arm| arm["moved"] == true), "{stopped}");
    let Two(one, _, other, second) = two;
    assert_eq!(ends(second, 5)["outcome"], "stopped");
    one.stands();
    other.stands();
}

/// A program that hangs does not delay the Stop of another arm. A single JSON object reports the results for all arms.
#[test]
fn a_program_that_hangs_delays_no_other_stop() {
    let two = Two::moving();
    signal(&two.1, "-STOP");
    let stopped = two.stop();
    assert_eq!(stopped.code, 3, "{}", stopped.err);
    let lines: Vec<&str> = stopped.out.lines().collect();
    assert_eq!(lines.len(), 1, "{lines:?}");
    let value: Value = serde_json::from_str(lines[0]).unwrap();
    let arms = value["arms"].as_array().unwrap();
    let of = |key: &str| arms.iter().filter(|arm| !arm[key].is_null()).count();
    assert_eq!((arms.len(), of("moved"), of("error")), (2, 1, 1), "{value}");
    assert!(value["error"]["hint"].as_str().unwrap().contains("emergency stop"), "{value}");
    let Two(_, mut first, other, second) = two;
    assert_eq!(ends(second, 5)["outcome"], "stopped");
    other.stands();
    signal(&first, "-CONT");
    first.kill().unwrap();
    first.wait().unwrap();
}

#[test]
fn a_port_of_a_foreign_program_is_named_as_before() {
    let cell = Cell::held();
    let _foreign = SerialPort::open_without_door(cell.0.port.to_str().unwrap(), 115_200).unwrap();
    let refused = cell.jtc(&["stop"]).ends(3);
    assert!(refused.err.contains("another program has this port open"), "{}", refused.err);
    assert!(refused.err.contains("nothing was sent: if the arm is moving, press the emergency stop"));
}

#[test]
fn the_short_words_are_the_long_ones_and_wrong_words_get_the_right_command() {
    for (short, long) in [("stop", &["traj", "stop"][..]), ("run", &["traj", "run"])] {
        let help = |words: &[&str]| {
            let text = jtc(&[words, &["--help"]].concat()).ends(0).out;
            text.replace("jtc traj ", "jtc ")
        };
        assert_eq!(help(&[short]), help(long));
    }
    for word in ["halt", "estop", "e-stop", "abort"] {
        assert!(jtc(&[word, "--help"]).ends(0).out.contains("Stop on the path"), "{word}");
    }
    for (word, command) in [
        ("pause", "`jtc traj pause`"),
        ("resume", "`jtc traj resume`"),
        ("Home", "`jtc move --to home"),
        ("version", "`jtc --version`"),
        ("start", "`jtc run FILE`"),
        ("kill", "`jtc stop`"),
    ] {
        let refused = jtc(&[word]).ends(2);
        assert!(refused.err.contains(&format!("use {command}")), "{word}: {}", refused.err);
        let refused = jtc(&["--json", word]).ends(2).json();
        assert!(refused["error"]["hint"].as_str().unwrap().contains(command), "{refused}");
    }
    let refused = jtc(&["stpo"]).ends(2);
    assert!(refused.err.contains("stop"), "{}", refused.err);
}
