//! Simulated terminal with a user, and a command that runs on this terminal.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::{FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, Winsize, tcgetattr, tcsetwinsize};
use test_kit::patience::Patience;

use super::Picture;

/// Reads the output of the command until the terminal is closed.
fn read(mut from: File, closed: &AtomicBool, to: &Sender<Vec<u8>>) {
    let mut bytes = [0; 4096];
    let wait = Timespec { tv_sec: 0, tv_nsec: 20_000_000 };
    while !closed.load(Ordering::Relaxed) {
        let ready = poll(&mut [PollFd::new(&from, PollFlags::IN)], Some(&wait));
        if matches!(ready, Ok(1..)) {
            let Ok(n @ 1..) = from.read(&mut bytes) else { return };
            if to.send(bytes[..n].to_vec()).is_err() {
                return;
            }
        }
    }
}

/// A pseudo-terminal of the test.
pub struct Terminal {
    /// The user's side of the terminal. When this handle is closed, the terminal hangs up.
    person: Option<File>,
    slave: Option<OwnedFd>,
    closed: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
    sent: Receiver<Vec<u8>>,
    /// Visible content of the terminal.
    pub picture: Picture,
    /// All bytes that the terminal received.
    pub bytes: Vec<u8>,
}

impl Terminal {
    /// Creates a terminal of this size.
    pub fn new(columns: u16, rows: u16) -> Self {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&master).and_then(|()| unlockpt(&master)).expect("it is ours");
        let name = ptsname(&master, Vec::new()).expect("it has a name");
        let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).expect("it opens");
        tcsetwinsize(&slave, Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 })
            .expect("its size");
        // The command must not inherit the user's side of the terminal. Otherwise, the terminal could not hang up
        // while the command runs.
        for end in [&master, &slave] {
            fcntl_setfd(end, FdFlags::CLOEXEC).expect("its flags");
        }
        let person = File::from(master);
        let (sender, sent) = channel();
        let (closed, of_reader) =
            (Arc::new(AtomicBool::new(false)), person.try_clone().expect("a second handle"));
        let its_closed = Arc::clone(&closed);
        let reader = std::thread::spawn(move || read(of_reader, &its_closed, &sender));
        let picture = Picture::new(columns, rows);
        Self {
            person: Some(person),
            slave: Some(slave),
            closed,
            reader: Some(reader),
            sent,
            picture,
            bytes: Vec::new(),
        }
    }

    fn end(&self) -> OwnedFd {
        self.slave.as_ref().expect("it has not hung up").try_clone().expect("a handle")
    }

    /// Starts a command in the same way as a shell, with this terminal as controlling terminal, stdin and output.
    pub fn start(&self, command: &Command) -> Child {
        let mut own = Command::new("setsid");
        own.arg("--ctty").arg(command.get_program()).args(command.get_args());
        for (name, value) in command.get_envs() {
            match value {
                Some(value) => own.env(name, value),
                None => own.env_remove(name),
            };
        }
        if let Some(folder) = command.get_current_dir() {
            own.current_dir(folder);
        }
        own.env("TERM", "xterm");
        own.stdin(Stdio::from(self.end())).stdout(self.end()).stderr(self.end());
        own.spawn().expect("it starts")
    }

    /// Types these keys on the terminal.
    pub fn press(&mut self, keys: &str) {
        self.person.as_mut().expect("it has not hung up").write_all(keys.as_bytes()).expect("it takes keys");
    }

    /// Processes the output of the command until the screen fulfils the condition. Panics with the contents of the
    /// screen if the condition is not met in time.
    pub fn until(&mut self, what: &str, reached: impl Fn(&Picture) -> bool) {
        let mut patience = Patience::begin();
        while !reached(&self.picture) {
            match patience.receive(&self.sent) {
                Some(bytes) => self.take(&bytes),
                None => panic!("{what} does not come:\n{}", self.picture.text()),
            }
        }
    }

    /// Like [`Self::until`], with the condition that these words appear on the screen.
    pub fn until_it_shows(&mut self, words: &str) {
        self.until(words, |picture| picture.text().contains(words));
    }

    fn take(&mut self, bytes: &[u8]) {
        self.picture.take(bytes);
        self.bytes.extend_from_slice(bytes);
    }

    /// Closes the terminal, as when a user closes the window. After the call, no process has the user's side of the
    /// terminal open.
    pub fn hang_up(&mut self) {
        (self.person, self.slave) = (None, None);
        // The reading thread ends when `closed` is set. This thread owns the last handle of the user's side, so the
        // terminal then hangs up.
        self.closed.store(true, Ordering::Relaxed);
        self.reader.take().map(JoinHandle::join);
    }

    /// Waits for the end of the command and returns its exit code. After the call, the screen contains the last output
    /// of the command.
    pub fn ends(&mut self, child: &mut Child) -> i32 {
        let mut patience = Patience::begin();
        let code = loop {
            if let Some(status) = child.try_wait().expect("its end") {
                break status.code().unwrap_or(-1);
            }
            patience.pause(format_args!("its end:\n{}", self.picture.text()));
            let bytes: Vec<u8> = self.sent.try_iter().take(1_000).flatten().collect();
            self.take(&bytes);
        };
        while let Ok(bytes) = self.sent.recv_timeout(Duration::from_millis(100)) {
            self.take(&bytes);
        }
        code
    }

    /// Returns `true` if the terminal again reads whole lines and shows typed keys.
    pub fn is_as_before(&self) -> bool {
        let modes = tcgetattr(self.end()).expect("its modes").local_modes;
        modes.contains(LocalModes::ICANON | LocalModes::ECHO)
    }
}
