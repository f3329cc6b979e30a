//! Door of an open port: a local socket through which other programs of the same user can stop the arm.

use std::fs;
use std::io;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::halt::{Answer, End, REQUEST_MAX, Request, may_ask, peer, read_line, socket_name, write_line};
use super::line::{Counted, Line};
use super::runtime;

/// Maximum number of client programs that a door (control socket) serves at the same time.
const ASKERS: usize = 8;
/// Interval at which the door's thread checks if the door was closed. A new connection wakes the thread before the
/// interval ends.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };
/// Pause after an attempt to accept a connection has failed.
const RETRY: Duration = Duration::from_millis(20);
/// Timeout for receiving a request and for writing an answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// Door (control socket) of an open port. The door must be closed before the port, because the next program that
/// opens the port creates a door at the same path.
pub(super) struct Door {
    path: PathBuf,
    /// Device and inode of the socket. Another socket at the same path has different numbers.
    file: (u64, u64),
    line: Arc<Line>,
    thread: Option<JoinHandle<()>>,
}

impl Door {
    /// Opens the door (control socket) of this program's port. Returns `None` if no socket can be created. The port
    /// also works without a door.
    pub(super) fn open(line: &Arc<Line>) -> Option<Self> {
        let name = socket_name(&line.path)?;
        let (path, listener, file) = runtime::candidates().into_iter().find_map(|folder| {
            let path = runtime::create_at(folder).ok()??.join(&name);
            let listener = listen(&path).ok()?;
            let file = file_of(&path)?;
            Some((path, listener, file))
        })?;
        let own = Arc::clone(line);
        let thread = std::thread::Builder::new().name("stop".into()).spawn(move || serve(&listener, &own));
        match thread {
            Ok(thread) => Some(Self { path, file, line: Arc::clone(line), thread: Some(thread) }),
            Err(_) => {
                let _ = fs::remove_file(path);
                None
            }
        }
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        self.line.close();
        // The connection wakes the door's thread immediately. Without the connection, the thread would detect the closed door only after up
        // to 200 ms.
        let _ = UnixStream::connect(&self.path);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if file_of(&self.path) == Some(self.file) {
            // Another program may have already deleted the file.
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn file_of(path: &Path) -> Option<(u64, u64)> {
    fs::symlink_metadata(path).ok().map(|found| (found.dev(), found.ino()))
}

/// Creates the socket at `path`. Replaces a socket file that a killed program has left. Returns an error if another
/// running program serves the socket. This is possible only for the superuser, who can open a port that is already
/// open.
fn listen(path: &Path) -> io::Result<UnixListener> {
    if UnixStream::connect(path).is_ok() {
        return Err(io::ErrorKind::AddrInUse.into());
    }
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let listener = UnixListener::bind(path)?;
    fs::set_permissions(path, fs::Permissions::from_mode(0o600))?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

fn serve(listener: &UnixListener, line: &Line) {
    let busy = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        while !line.is_closing() {
            let _ = poll(&mut [PollFd::new(listener, PollFlags::IN)], Some(&LOOK));
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => continue,
                Err(_) => {
                    // A failed accept may be caused by too many open files. Without a pause, the next attempts would
                    // fail at once with the same error.
                    std::thread::sleep(RETRY);
                    continue;
                }
            };
            if line.is_closing()
                || busy.load(Ordering::SeqCst) >= ASKERS
                || !peer(&stream).is_some_and(may_ask)
            {
                continue;
            }
            let counted = Counted::new(&busy);
            // If no thread can be started, the door disconnects the client, and the client repeats its request.
            let _ = std::thread::Builder::new().spawn_scoped(scope, move || {
                let _counted = counted;
                // An error is ignored here, because a client that has disconnected does not need the answer.
                let _ = answer(&stream, line);
            });
        }
    });
}

/// Reader with one deadline for a whole request. The deadline also limits a client that sends its bytes slowly.
struct Within<'a> {
    stream: &'a UnixStream,
    end: Instant,
}

impl io::Read for Within<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        io::Read::read(&mut self.stream, buffer)
    }
}

/// Executes the request of a client program and answers it.
fn answer(stream: &UnixStream, line: &Line) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request: Request = read_line(Within { stream, end: Instant::now() + PATIENCE }, REQUEST_MAX)?;
    let by: String = request.by.chars().filter(|c| !host_kit::is_hidden(*c)).take(100).collect();
    let done = line.halt(request.halt, &by);
    let answer = Answer::of(line.path.clone(), line.baud, done);
    write_line(stream, &answer)?;
    if !answer.confirmed {
        // The answer already reports that the controller did not confirm the frame, so no final message follows.
        return Ok(());
    }
    let Some((status, standstill)) = line.wait_for_rest(request.halt) else { return Ok(()) };
    write_line(stream, &End::of(&status, &standstill))
}
