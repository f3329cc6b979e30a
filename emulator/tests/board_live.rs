//! Real-time tests of the command `jtc`, which is connected to the firmware of the board through a pseudo-terminal.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Output of a command and its exit code.
struct Finished {
    code: i32,
    out: String,
    err: String,
}

impl Finished {
    #[track_caller]
    fn ends(self, code: i32) -> Self {
        assert_eq!(self.code, code, "stdout: {}\nstderr: {}", self.out, self.err);
        self
    }

    /// Checks that the printed JSON contains this value.
    fn shows(&self, name: &str, value: &str) -> bool {
        self.out.contains(&format!("\"{name}\":\"{value}\""))
    }
}

/// An emulated board on a pseudo-terminal, and the program `jtc` that communicates with the board.
struct Live {
    jtc: PathBuf,
    directory: PathBuf,
    board: Child,
}

impl Live {
    fn start(jtc: PathBuf, elf: &Path) -> Self {
        let directory = std::env::temp_dir().join(format!("openjtc-live-{}", std::process::id()));
        std::fs::create_dir_all(&directory).expect("a directory");
        let port = directory.join("port");
        let mut board = Command::new(env!("CARGO_BIN_EXE_openjtc-emulate"))
            .arg(elf)
            .arg("--serial")
            .arg(&port)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("openjtc-emulate starts");
        let mut line = String::new();
        BufReader::new(board.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
        assert_eq!(line, format!("ready: {}\n", port.display()));
        Self { jtc, directory, board }
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(&self.jtc);
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("JTC_")) {
            command.env_remove(name);
        }
        command.arg("--json").args(words).env("JTC_PORT", self.directory.join("port"));
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn jtc(&self, words: &[&str]) -> Finished {
        finished(self.command(words).spawn().expect("jtc starts"))
    }

    /// Waits until a status contains this value of a field.
    #[track_caller]
    fn wait_for(&self, name: &str, value: &str) {
        let begin = Instant::now();
        loop {
            let status = self.jtc(&["status"]).ends(0);
            if status.shows(name, value) {
                return;
            }
            assert!(
                begin.elapsed() < Duration::from_secs(20),
                "{name} {value} does not come: {}",
                status.out
            );
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.board.kill().ok();
        self.board.wait().ok();
        std::fs::remove_dir_all(&self.directory).ok();
    }
}

fn finished(child: Child) -> Finished {
    let output = child.wait_with_output().expect("jtc ends");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    Finished { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
}

fn interrupt(child: &Child) {
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(status.is_ok_and(|status| status.success()), "kill");
}

/// Returns a trajectory of 5 s, which starts slightly off the zero pose, moves the arm away and returns it to the
/// start.
fn motion() -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=250 {
        let q = 0.4 * (std::f64::consts::PI * f64::from(i) / 250.0).sin().powi(4);
        text += &format!("{:.3},{},{},{q},{q},{},{q}\n", f64::from(i) * 0.02, 0.1 + q, -0.5 * q, -q);
    }
    text
}

#[test]
fn a_session_at_the_command_line() {
    let (Some(jtc), Some(firmware)) = (std::env::var_os("OPENJTC_JTC"), std::env::var_os("OPENJTC_FIRMWARE"))
    else {
        println!("skipped: OPENJTC_JTC and OPENJTC_FIRMWARE name the program jtc and the boards' programs");
        return;
    };
    let mut live = Live::start(jtc.into(), &Path::new(&firmware).join("nucleo-h745zi-q.elf"));
    let status = live.jtc(&["status"]).ends(0);
    assert!(status.out.contains(r#""missing_parameters":["friction"#), "{}", status.out);
    // `jtc firmware verify` confirms that the board executes this firmware file, and refuses the file of another
    // board.
    let image =
        |board: &str| Path::new(&firmware).join(format!("{board}.elf")).to_string_lossy().into_owned();
    let verified = live.jtc(&["firmware", "verify", "--image", &image("nucleo-h745zi-q")]).ends(0);
    assert!(verified.out.contains(r#""proved":true"#), "{}", verified.out);
    let other = live.jtc(&["firmware", "verify", "--image", &image("nucleo-h745zi-q-ldo")]).ends(5);
    assert!(other.out.contains(r#""code":"other-program""#), "{}", other.out);
    live.jtc(&["params", "use-defaults"]).ends(0);
    live.wait_for("state", "HoldPos");

    // The complete sequence consists of upload, approach and execution of a trajectory.
    let file = live.directory.join("motion.csv");
    std::fs::write(&file, motion()).expect("a file");
    let file = file.to_str().expect("UTF-8");
    live.jtc(&["traj", "run", file]).ends(4); // the arm is not at the first point
    let run = live.jtc(&["traj", "run", file, "--approach"]).ends(0);
    assert!(run.shows("outcome", "finished"), "{}", run.out);
    live.wait_for("trajectory", "Finish");

    // A finished execution cannot be resumed.
    live.jtc(&["traj", "resume"]).ends(4);
    live.jtc(&["traj", "stop"]).ends(0);
    live.wait_for("trajectory", "Stop");
    live.jtc(&["traj", "pause"]).ends(1);

    // Ctrl-C stops the arm.
    let run =
        live.command(&["traj", "run", file, "--approach", "--speed", "25"]).spawn().expect("jtc starts");
    std::thread::sleep(Duration::from_secs(4));
    interrupt(&run);
    finished(run).ends(5);
    live.wait_for("state", "HoldPos");

    live.jtc(&["teach", "on"]).ends(0);
    live.wait_for("state", "Teaching");
    live.jtc(&["teach", "off"]).ends(0);
    live.wait_for("state", "HoldPos");
    let doctor = live.jtc(&["doctor"]).ends(0);
    assert!(doctor.out.contains(r#""healthy":true"#), "{}", doctor.out);

    // The emulator ends with exit code 0 when it receives a signal. Its standard error is empty, so the board was
    // never reset.
    interrupt(&live.board);
    assert_eq!(live.board.wait().expect("it ends").code(), Some(0));
    let mut errors = String::new();
    live.board.stderr.take().expect("stderr").read_to_string(&mut errors).expect("text");
    assert_eq!(errors, "");
}
