//! Stop or Pause by another program of the same user: messages through the [door](super) of the program that holds the port.
//!
//! The client sends one line with a request as JSON. The program that holds the port writes the frame to the line and answers with an
//! [`Answer`]. When the arm is at rest, the program that holds the port also sends an [`End`].

use std::io;
use std::time::Duration;
#[cfg(unix)]
use std::{
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
};

use host_kit::{Next, next};
use jtc_wire::{ControllerState, ExecCommand, Status};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::PortError;
use super::line::HaltOutcome;
#[cfg(unix)]
use super::runtime;
use super::standstill::{Standstill, has_torque, is_paused};
use crate::labels;

/// Maximum size of a request, bytes.
pub(super) const REQUEST_MAX: usize = 1024;
/// Maximum size of an answer, bytes.
const ANSWER_MAX: usize = 4096;
/// Maximum size of a final message, bytes.
pub(super) const END_MAX: usize = 1024;
/// Timeout for the answer of the program that holds the port. This program may write a Stop up to eight times before
/// it answers, so the timeout is longer than eight writes.
const PATIENCE: Duration = Duration::from_secs(3);
/// Timeout for the final message. The timeout is longer than the time in which an arm comes to rest after a Stop.
const REST: Duration = Duration::from_secs(6);

/// Command that a program requests from the holder of the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Halt {
    /// The arm stops on the path, and the execution ends.
    Stop,
    /// The arm pauses on the path.
    Pause,
}

impl Halt {
    /// Returns the command that is sent to the controller.
    pub fn command(self) -> ExecCommand {
        match self {
            Self::Stop => ExecCommand::Stop,
            Self::Pause => ExecCommand::Pause,
        }
    }
}

/// Request with the command and the name of the program that sends it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Request {
    pub halt: Halt,
    pub by: String,
}

/// Answer with the result of writing the frame.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Name of the program that holds the port.
    pub program: String,
    /// Process id of that program.
    pub pid: u32,
    /// Absolute path of the port.
    pub port: String,
    /// Bit rate of the port, Bd.
    pub baud: u32,
    /// `true` if the controller has received the frame.
    pub confirmed: bool,
    /// `true` if the controller accepted the frame, because there was a motion to stop or pause.
    pub accepted: bool,
    /// `true` if the arm moved when the frame arrived.
    pub moved: bool,
    /// State of the controller.
    pub state: String,
    /// Trajectory execution state.
    pub trajectory: String,
    /// Reason why the frame could not be written.
    pub error: Option<String>,
}

/// Final message with the state of the arm after the command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct End {
    /// `true` if the arm is at rest.
    pub stands: bool,
    /// `true` if the arm moved before the command.
    pub moved: bool,
    /// Description of the motion that has not ended, for example a moving joint or a paused trajectory; `None` if the
    /// arm is at rest.
    pub moving: Option<String>,
    /// State of the controller.
    #[serde(default)]
    pub state: String,
    /// Trajectory execution state.
    #[serde(default)]
    pub trajectory: String,
    /// `true` if the arm is in a held stop. If a joint still moves during a held stop, it yields to a push or lowers
    /// a load that it cannot hold.
    #[serde(default)]
    pub held_stop: bool,
}

impl Answer {
    pub(super) fn of(port: String, baud: u32, done: Result<Option<HaltOutcome>, PortError>) -> Self {
        // The path is made absolute, because the client may have another working directory.
        let port = std::path::absolute(&port).map_or(port, |absolute| absolute.display().to_string());
        let own = Self { program: this_program(), pid: std::process::id(), port, baud, ..Self::default() };
        match done {
            Ok(Some(HaltOutcome { accepted, moved, status })) => Self {
                confirmed: true,
                accepted,
                moved,
                state: status.state.to_string(),
                trajectory: status.trajectory.to_string(),
                ..own
            },
            Ok(None) => own,
            Err(error) => Self { error: Some(error.to_string()), ..own },
        }
    }
}

/// Returns the next step if an arm still moves after a Stop.
pub fn still_moving_help() -> Next {
    next!("press the emergency stop; {} shows the joints", Status)
}

impl End {
    /// Creates the final message from the last status.
    pub fn of(status: &Status, standstill: &Standstill) -> Self {
        let stands = standstill.is_reached();
        let moving = match labels::moving_joint(status) {
            _ if stands => None,
            Some((joint, speed)) if !has_torque(status) => {
                Some(format!("{joint} moves without torque at {speed:.2} rad/s, and a Stop cannot end this"))
            }
            Some((joint, speed)) => Some(format!("{joint} moves at {speed:.2} rad/s")),
            None if status.is_executing() => Some("the arm is on the path of a trajectory".to_owned()),
            None if status.state == ControllerState::Teaching => {
                Some("teaching does not end: the arm can be led by hand".to_owned())
            }
            None if is_paused(status) => {
                Some("the trajectory is paused and not stopped: it can be resumed".to_owned())
            }
            None => Some("the arm was not at rest for long enough".to_owned()),
        };
        let (state, trajectory) = (status.state.to_string(), status.trajectory.to_string());
        let held_stop = status.is_held_stop();
        Self { stands, moved: standstill.moved(), moving, state, trajectory, held_stop }
    }

    /// Returns the next step if the arm still moves.
    pub fn next_step(&self) -> Next {
        if self.held_stop {
            next!(
                "keep clear and wait: the controller yields to a push or lowers a load, then holds the arm at rest; {} shows the cause. The \
                 emergency stop removes the torque: an arm without brakes falls",
                Status
            )
        } else {
            still_moving_help()
        }
    }
}

/// Returns the name of this program and the first words of its command line.
pub fn this_program() -> String {
    let mut words = std::env::args();
    let name = words.next().unwrap_or_default();
    let name = std::path::Path::new(&name).file_name().map(|n| n.to_string_lossy().into_owned());
    let option = |word: &String| word.starts_with('-');
    let words = words.skip_while(option).take_while(|word| !option(word)).take(2);
    let all: Vec<String> = name.into_iter().chain(words).collect();
    all.join(" ").chars().filter(|c| !host_kit::is_hidden(*c)).take(80).collect()
}

/// Returns `true` if `user` may stop the arm. Only the user who runs this program may stop the arm.
#[cfg(unix)]
pub(super) fn may_ask(user: u32) -> bool {
    user == rustix::process::geteuid().as_raw()
}

/// Returns the user at the other end of a socket. If the operating system does not report the user, the permissions of the folder and the
/// socket exclude other users.
#[cfg(target_os = "linux")]
pub(super) fn peer(stream: &UnixStream) -> Option<u32> {
    rustix::net::sockopt::socket_peercred(stream).ok().map(|peer| peer.uid.as_raw())
}

/// Returns the user of this program, because this operating system does not report the user at the other end.
#[cfg(all(unix, not(target_os = "linux")))]
pub(super) fn peer(_: &UnixStream) -> Option<u32> {
    Some(rustix::process::geteuid().as_raw())
}

/// Returns the id of the process at the other end of a socket, if the operating system reports the id.
#[cfg(unix)]
fn process(stream: &UnixStream) -> Option<i32> {
    #[cfg(target_os = "linux")]
    return rustix::net::sockopt::socket_peercred(stream).ok().map(|peer| peer.pid.as_raw_nonzero().get());
    #[cfg(not(target_os = "linux"))]
    return None.filter(|_: &i32| stream.peer_addr().is_ok());
}

/// Returns the socket name of a port. The name contains the device number, which is the same for all names of the port.
#[cfg(unix)]
pub(super) fn socket_name(port: &str) -> Option<String> {
    use std::os::unix::fs::MetadataExt as _;
    Some(format!("line-{:x}.sock", std::fs::metadata(port).ok()?.rdev()))
}

/// Returns the sockets at which a program that holds the port may listen.
#[cfg(unix)]
pub fn sockets_of(port: &str) -> Vec<PathBuf> {
    let Some(name) = socket_name(port) else { return Vec::new() };
    runtime::folders().into_iter().map(|folder| folder.join(&name)).filter(|path| path.exists()).collect()
}

/// Returns the sockets of all ports that programs of this user hold, including sockets that were left by killed programs.
#[cfg(unix)]
pub fn sockets() -> Vec<PathBuf> {
    let files = runtime::folders().into_iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let named = |path: &PathBuf| {
        path.file_name()
            .and_then(|name| name.to_str())
            .is_some_and(|name| name.starts_with("line-") && name.ends_with(".sock"))
    };
    files.flatten().map(|file| file.path()).filter(named).collect()
}

/// Returns the port of a socket. Returns `None` if the socket was created for another device with the same number. A device that was
/// plugged in later, or a pseudo-terminal that was opened later, may have this number.
#[cfg(unix)]
pub fn port_of(socket: &Path) -> Option<String> {
    use std::os::unix::fs::{FileTypeExt as _, MetadataExt as _};
    let name = socket.file_name()?.to_str()?;
    let number = u64::from_str_radix(name.strip_prefix("line-")?.strip_suffix(".sock")?, 16).ok()?;
    let found = std::fs::symlink_metadata(socket).ok()?;
    let listened = (found.mtime(), found.mtime_nsec());
    let files =
        ["/dev", "/dev/pts"].into_iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let port = files.flatten().map(|file| file.path()).find(|path| {
        std::fs::symlink_metadata(path).is_ok_and(|node| {
            node.file_type().is_char_device()
                && node.rdev() == number
                && (node.ctime(), node.ctime_nsec()) <= listened
        })
    })?;
    Some(port.display().to_string())
}

/// Returns `true` if a program listens at the socket.
#[cfg(unix)]
pub fn is_alive(socket: &Path) -> bool {
    UnixStream::connect(socket).is_ok()
}

/// Sends a request to the program that listens at `socket`. Returns `None` if no program listens, or if the program ended before it
/// answered.
///
/// # Errors
///
/// Returns [`PortError::HolderSilent`] if the program does not answer. Returns [`PortError::NotHalted`] if the frame did not reach the
/// controller.
#[cfg(unix)]
pub fn ask(socket: &Path, halt: Halt, by: &str) -> Result<Option<(Answer, Option<End>)>, PortError> {
    let Ok(stream) = UnixStream::connect(socket) else { return Ok(None) };
    if !peer(&stream).is_some_and(may_ask) {
        return Ok(None);
    }
    let process = process(&stream);
    let said = |error: io::Error| match error.kind() {
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => Err(PortError::HolderSilent {
            path: socket.display().to_string(),
            process,
            seconds: PATIENCE.as_secs_f64(),
        }),
        _ => Ok(None),
    };
    let request = Request { halt, by: by.to_owned() };
    let set = stream.set_read_timeout(Some(PATIENCE)).and_then(|()| stream.set_write_timeout(Some(PATIENCE)));
    let answered =
        set.and_then(|()| write_line(&stream, &request)).and_then(|()| read_line(&stream, ANSWER_MAX));
    let answer: Answer = match answered {
        Ok(answer) => answer,
        Err(error) => return said(error),
    };
    if !answer.confirmed {
        let holder = format!("{} (process {})", answer.program, answer.pid);
        return Err(PortError::NotHalted { path: answer.port, holder, what: answer.error });
    }
    // A missing final message is not an error: the other program may exit because of the Stop, before the arm is at
    // rest.
    let end = stream.set_read_timeout(Some(REST)).and_then(|()| read_line(&stream, END_MAX)).ok();
    Ok(Some((answer, end)))
}

/// Reads one line of at most `most` bytes.
pub(super) fn read_line<T: DeserializeOwned>(mut stream: impl io::Read, most: usize) -> io::Result<T> {
    let (mut line, mut byte) = (Vec::new(), [0]);
    while line.last() != Some(&b'\n') {
        if line.len() >= most {
            return Err(io::ErrorKind::InvalidData.into());
        }
        match stream.read(&mut byte)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            _ => line.push(byte[0]),
        }
    }
    Ok(serde_json::from_slice(&line)?)
}

/// Writes one line.
pub(super) fn write_line<T: Serialize>(mut stream: impl io::Write, what: &T) -> io::Result<()> {
    let mut line = serde_json::to_vec(what)?;
    line.push(b'\n');
    stream.write_all(&line)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// A request from another user is always rejected.
    #[test]
    fn the_request_of_another_user_is_refused() {
        let own = rustix::process::geteuid().as_raw();
        assert!(may_ask(own));
        for other in [own + 1, own.wrapping_sub(1), own + 1000, 65_534, u32::MAX]
            .into_iter()
            .filter(|user| *user != own)
        {
            assert!(!may_ask(other), "{other}");
        }
        let (one, other) = UnixStream::pair().unwrap();
        assert_eq!((peer(&one), peer(&other)), (Some(own), Some(own)));
    }

    /// If the arm still moves in a held stop, the message tells the user to wait. An emergency stop would drop an arm
    /// that is lowering its load.
    #[test]
    fn j70_an_arm_that_still_moves_in_a_held_stop_is_waited_for() {
        let standstill = Standstill::after(Halt::Stop);
        let mut status = Status { state: ControllerState::HoldPos.into(), ..Status::default() };
        status.joints[1].velocity = 0.3;
        assert_eq!(End::of(&status, &standstill).next_step(), still_moving_help());
        (status.errors, status.joints[1].internal) =
            (jtc_wire::error::INTERNAL_JOINTS, jtc_wire::joint_error::TORQUE);
        let next = End::of(&status, &standstill).next_step();
        assert!(
            next.to_string().starts_with("keep clear and wait") && next.to_string().contains("falls"),
            "{next}"
        );
    }

    #[test]
    fn a_line_is_bounded_and_whole() {
        let request = |text: &str| read_line::<Request>(text.as_bytes(), 64);
        let good = request("{\"halt\":\"stop\",\"by\":\"x\"}\nmore").unwrap();
        assert_eq!(good, Request { halt: Halt::Stop, by: "x".into() });
        let long = format!("{{\"halt\":\"stop\",\"by\":\"{}\"}}\n", "x".repeat(64));
        for bad in [
            &long[..],
            "",
            "\n",
            "{}\n",
            "{\"halt\":\"stop\",\"by\":\"x\"}",
            "{\"halt\":\"execute\",\"by\":\"\"}\n",
            "\u{7f}\n",
        ] {
            assert!(request(bad).is_err(), "{bad}");
        }
    }
}
