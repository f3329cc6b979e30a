//! Events that a user types, or a script writes, on the standard input of the simulator.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use jtc_host::trajectory::Loaded;
use jtc_sim::{HandPath, TypedEvent, World};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// Interval at which the program checks if it is the foreground program of its terminal.
const LOOK: Duration = Duration::from_millis(200);
/// Largest length of a line, bytes.
const LINE_MAX: usize = 4096;

/// Reader of the lines on the standard input.
pub(crate) struct Typed {
    lines: Receiver<String>,
}

impl Typed {
    /// Starts to read the standard input, in a separate thread.
    pub(crate) fn listen() -> Self {
        let (send, lines) = channel();
        std::thread::spawn(move || read(|line| send.send(line).is_ok()));
        Self { lines }
    }

    /// Applies the lines that the user typed since the last call to `world`. The function reports invalid lines on stderr; these lines
    /// have no effect on the arm.
    pub(crate) fn act(&self, world: &mut World) {
        while let Ok(line) = self.lines.try_recv() {
            match TypedEvent::parse(&line).map_err(|e| e.to_string()) {
                Ok(None) => {}
                Ok(Some(event)) => match happen(&event, world) {
                    Ok(()) => eprintln!("{event}"),
                    Err(text) => eprintln!("jtc: {text}"),
                },
                Err(text) => eprintln!("jtc: {text}"),
            }
        }
    }
}

fn happen(event: &TypedEvent, world: &mut World) -> Result<(), String> {
    match event {
        TypedEvent::Push { joint, torque, seconds } => {
            world.push(*joint, *torque, (seconds * 1e3).round() as u64);
        }
        TypedEvent::Hand { file } => world.lead(hand(&PathBuf::from(file))?),
    }
    Ok(())
}

/// Returns the joint positions of a trajectory file as the path of a hand that guides the arm.
pub(crate) fn hand(path: &Path) -> Result<HandPath, String> {
    let trajectory = Loaded::load(path, None).map_err(|e| format!("hand: {e}"))?.trajectory;
    let points = trajectory.points.iter().map(|point| point.position).collect();
    let step_s = f64::from(trajectory.step_ms) * 1e-3;
    HandPath::new(points, step_s).ok_or_else(|| format!("hand: {}: the file has no points", path.display()))
}

/// Passes the lines of the standard input to `take` until `take` returns `false` or the input ends.
///
/// The operating system stops a program in the background that reads from its terminal (SIGTTIN). Therefore the thread reads only
/// when input is available and no other program is in the foreground.
fn read(mut take: impl FnMut(String) -> bool) {
    let stdin = rustix::stdio::stdin();
    let (mut line, mut buffer) = (Vec::new(), [0; 512]);
    loop {
        let timeout = Timespec { tv_sec: 0, tv_nsec: LOOK.subsec_nanos() as _ };
        let mut fds = [PollFd::new(&stdin, PollFlags::IN)];
        match poll(&mut fds, Some(&timeout)) {
            Ok(0) | Err(rustix::io::Errno::INTR) => continue,
            Ok(_) => {}
            Err(_) => return,
        }
        if in_background() {
            std::thread::sleep(LOOK);
            continue;
        }
        let count = match rustix::io::read(stdin, &mut buffer) {
            Ok(0) | Err(_) => break,
            Ok(count) => count,
        };
        for &byte in &buffer[..count] {
            if byte != b'\n' {
                line.push(byte);
            }
            if (byte == b'\n' || line.len() == LINE_MAX) && !take(text(&mut line)) {
                return;
            }
        }
    }
    // The last line of the input may end without a line feed, so the remaining bytes are also a line.
    take(text(&mut line));
}

fn text(line: &mut Vec<u8>) -> String {
    String::from_utf8_lossy(&std::mem::take(line)).into_owned()
}

/// Returns `true` if the standard input is a terminal and another program is in the foreground.
fn in_background() -> bool {
    let stdin = rustix::stdio::stdin();
    rustix::termios::isatty(stdin)
        && rustix::termios::tcgetpgrp(stdin).is_ok_and(|group| group != rustix::process::getpgrp())
}
