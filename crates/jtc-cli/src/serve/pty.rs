//! Pseudo-terminal that behaves like a serial port, with a name that the user chooses.

use std::fmt;
use std::fs;
use std::io;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::OpenptFlags;
use rustix::termios::{LocalModes, OptionalActions, OutputModes, QueueSelector};

/// Reason why the simulator cannot use the pseudo-terminal.
#[derive(Debug)]
pub(crate) enum PtyError {
    /// A file exists at the path, and the simulator must not replace this file.
    Taken {
        /// Path that the user requested.
        path: PathBuf,
        /// Kind of the existing file.
        what: &'static str,
    },
    /// The operating system rejected an operation.
    Io {
        /// Operation that failed.
        what: &'static str,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl fmt::Display for PtyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PtyError::Taken { path, what } => {
                write!(f, "{}: the path is in use: {what}; choose another path", path.display())
            }
            PtyError::Io { what, source } => write!(f, "{what}: {source}"),
        }
    }
}

impl std::error::Error for PtyError {}

fn fails(what: &'static str) -> impl Fn(Errno) -> PtyError {
    move |e| PtyError::Io { what, source: e.into() }
}

/// Controller side of a pseudo-terminal, and the symbolic link to its host side.
pub(crate) struct Pty {
    master: OwnedFd,
    slave: PathBuf,
    link: Option<PathBuf>,
}

impl Pty {
    /// Creates a pseudo-terminal in raw mode, with `link` as a symbolic link to the terminal. Replaces a link that an earlier simulator
    /// has created, but does not replace other files.
    pub(crate) fn open(link: Option<&Path>) -> Result<Self, PtyError> {
        if let Some(link) = link {
            check_free(link)?;
        }
        let (master, slave) = pair()?;
        let pty = Self { master, slave, link: link.map(Path::to_owned) };
        pty.put_link()?;
        Ok(pty)
    }

    /// Returns the path of the pseudo-terminal that a host opens.
    pub(crate) fn name(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.slave)
    }

    fn put_link(&self) -> Result<(), PtyError> {
        let Some(link) = &self.link else { return Ok(()) };
        // Renaming the new link replaces the old link in one step, so that a link always exists.
        let name = link.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let new = link.with_file_name(format!(".{name}.{}", std::process::id()));
        let _ = fs::remove_file(&new);
        std::os::unix::fs::symlink(&self.slave, &new)
            .and_then(|()| fs::rename(&new, link))
            .map_err(|source| PtyError::Io { what: "symbolic link", source })
    }

    /// Reads the available bytes of the host. Returns 0 if no bytes are available, or if no host has opened the port.
    pub(crate) fn read(&self, buffer: &mut [u8]) -> Result<usize, PtyError> {
        match rustix::io::read(&self.master, buffer) {
            Ok(n) => Ok(n),
            // The error EIO means that no host has opened the port, so no bytes are available.
            Err(Errno::AGAIN | Errno::IO | Errno::INTR) => Ok(0),
            Err(e) => Err(fails("read")(e)),
        }
    }

    /// Writes as many bytes as the terminal accepts.
    pub(crate) fn write(&self, bytes: &[u8]) -> Result<usize, PtyError> {
        match rustix::io::write(&self.master, bytes) {
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::IO | Errno::INTR) => Ok(0),
            Err(e) => Err(fails("write")(e)),
        }
    }

    /// Returns `true` if a host has opened the pseudo-terminal.
    pub(crate) fn host_is_there(&self) -> Result<bool, PtyError> {
        Ok(!self.poll(PollFlags::IN, Duration::ZERO)?.contains(PollFlags::HUP))
    }

    /// Waits until the host has sent bytes, or until the timeout.
    pub(crate) fn wait_input(&self, timeout: Duration) -> Result<(), PtyError> {
        self.wait(PollFlags::IN, timeout)
    }

    /// Waits until the terminal accepts bytes for the host, or until the timeout.
    pub(crate) fn wait_room(&self, timeout: Duration) -> Result<(), PtyError> {
        self.wait(PollFlags::OUT, timeout)
    }

    fn wait(&self, flags: PollFlags, timeout: Duration) -> Result<(), PtyError> {
        let found = self.poll(flags, timeout)?;
        if found.contains(PollFlags::HUP) && !found.contains(PollFlags::IN) {
            // Without a host, `poll` returns at once, so the thread sleeps instead.
            std::thread::sleep(timeout);
        }
        Ok(())
    }

    fn poll(&self, flags: PollFlags, timeout: Duration) -> Result<PollFlags, PtyError> {
        let mut fds = [PollFd::new(&self.master, flags)];
        let timeout = Timespec { tv_sec: timeout.as_secs() as _, tv_nsec: timeout.subsec_nanos() as _ };
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) => Ok(fds[0].revents()),
            Err(Errno::INTR) => Ok(PollFlags::empty()),
            Err(e) => Err(fails("poll")(e)),
        }
    }

    /// Discards the bytes that a disconnected host did not read. If a killed host has left the pseudo-terminal locked, a new
    /// pseudo-terminal replaces the old one under the same link.
    pub(crate) fn renew(&mut self) -> Result<(), PtyError> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC | OFlags::NONBLOCK;
        match rustix::fs::open(&self.slave, flags, Mode::empty()) {
            Ok(slave) => rustix::termios::tcflush(&slave, QueueSelector::IOFlush)
                .and_then(|()| raw(&slave))
                .map_err(fails("reset of the pseudo-terminal")),
            Err(_) if self.link.is_some() => {
                (self.master, self.slave) = pair()?;
                self.put_link()
            }
            Err(_) => Ok(()),
        }
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link
            && fs::read_link(link).is_ok_and(|to| to == self.slave)
        {
            let _ = fs::remove_file(link);
        }
    }
}

fn raw(terminal: &OwnedFd) -> rustix::io::Result<()> {
    let mut settings = rustix::termios::tcgetattr(terminal)?;
    settings.make_raw();
    rustix::termios::tcsetattr(terminal, OptionalActions::Now, &settings)
}

fn pair() -> Result<(OwnedFd, PathBuf), PtyError> {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
    let master = rustix::pty::openpt(flags).map_err(fails("open a pseudo-terminal"))?;
    rustix::pty::grantpt(&master).map_err(fails("grant the pseudo-terminal"))?;
    rustix::pty::unlockpt(&master).map_err(fails("unlock the pseudo-terminal"))?;
    let name = rustix::pty::ptsname(&master, Vec::new()).map_err(fails("name of the pseudo-terminal"))?;
    let slave = PathBuf::from(name.to_string_lossy().into_owned());
    // The code opens the host side once and sets raw mode before a host connects. After this first open, the system
    // reports a missing host as a hang-up.
    let open = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let first = rustix::fs::open(&slave, open, Mode::empty()).map_err(fails("open the host's end"))?;
    raw(&first).map_err(fails("raw mode"))?;
    let now = rustix::fs::fcntl_getfl(&master).map_err(fails("flags"))?;
    rustix::fs::fcntl_setfl(&master, now | OFlags::NONBLOCK).map_err(fails("flags"))?;
    Ok((master, slave))
}

/// Checks that a path is free, or is a link of an earlier simulator. The target of such a link is missing, or is a
/// pseudo-terminal that no simulator serves now, such as the terminal of a shell.
fn check_free(path: &Path) -> Result<(), PtyError> {
    let taken = |what| Err(PtyError::Taken { path: path.to_owned(), what });
    match fs::symlink_metadata(path) {
        Err(_) => Ok(()),
        Ok(meta) if meta.is_dir() => taken("a directory"),
        Ok(meta) if !meta.is_symlink() => taken("a file"),
        Ok(_) => match fs::read_link(path) {
            Ok(to) if !to.starts_with("/dev/pts") && path.exists() => taken("a link to something else"),
            Ok(to) if serves(&to) => taken("the port of another running simulator"),
            _ => Ok(()),
        },
    }
}

/// Returns `true` if a simulator serves this pseudo-terminal as a serial port. The pseudo-terminal is then open and
/// in raw mode, unlike the terminal of a shell. Also returns `true` if a host has locked the pseudo-terminal.
fn serves(terminal: &Path) -> bool {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC | OFlags::NONBLOCK;
    match rustix::fs::open(terminal, flags, Mode::empty()) {
        Ok(slave) => rustix::termios::tcgetattr(&slave).is_ok_and(|settings| {
            !settings.local_modes.intersects(LocalModes::ICANON | LocalModes::ECHO)
                && !settings.output_modes.contains(OutputModes::OPOST)
        }),
        Err(e) => e == Errno::BUSY,
    }
}
