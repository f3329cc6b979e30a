//! The door of an open port: a socket through which other programs of the same user stop the arm.

use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::halt::{Answer, End, REQUEST_MAX, Request, may_ask, peer, read_line, socket_name, write_line};
use super::line::Line;
use super::runtime;

/// Programs that are answered at the same time.
const ASKERS: usize = 8;
/// How often the door looks whether it is closed, without anything else to wake it.
const LOOK: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };
/// Time for a request and for taking an answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// An open door. It is closed before the port is: who opens the port next has a door at the same place.
pub struct Door {
    path: PathBuf,
    line: Arc<Line>,
    thread: Option<JoinHandle<()>>,
}

impl Door {
    /// Opens the door of a port that this program has. `None`: there is no place for it; the port works without.
    pub fn open(line: &Arc<Line>) -> Option<Self> {
        let name = socket_name(&line.path)?;
        let (path, listener) = runtime::candidates().into_iter().find_map(|folder| {
            let path = runtime::create_at(folder).ok()??.join(&name);
            Some((path.clone(), listen(&path).ok()?))
        })?;
        let own = Arc::clone(line);
        let thread = std::thread::Builder::new().name("stop".into()).spawn(move || serve(&listener, &own));
        match thread {
            Ok(thread) => Some(Self { path, line: Arc::clone(line), thread: Some(thread) }),
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
        // Wakes the thread at once; without it the thread looks soon.
        let _ = UnixStream::connect(&self.path);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        // It may be gone already.
        let _ = fs::remove_file(&self.path);
    }
}

/// The port is this program's alone, so a socket that is there belongs to a program that was killed.
fn listen(path: &std::path::Path) -> io::Result<UnixListener> {
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
            let Ok((stream, _)) = listener.accept() else { continue };
            if line.is_closing()
                || busy.load(Ordering::SeqCst) >= ASKERS
                || !peer(&stream).is_some_and(may_ask)
            {
                continue;
            }
            busy.fetch_add(1, Ordering::SeqCst);
            let busy = &busy;
            scope.spawn(move || {
                // An asker that has disconnected has no use for an answer.
                let _ = answer(&stream, line);
                busy.fetch_sub(1, Ordering::SeqCst);
            });
        }
    });
}

/// Does what one program asks for.
fn answer(stream: &UnixStream, line: &Line) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request: Request = read_line(stream, REQUEST_MAX)?;
    let by: String = request.by.chars().filter(|c| !c.is_control()).take(100).collect();
    let done = line.halt(request.halt, &by);
    write_line(stream, &Answer::of(line.path.clone(), line.baud, done))?;
    let Some((status, standstill)) = line.wait_for_rest(request.halt) else { return Ok(()) };
    write_line(stream, &End::of(&status, &standstill))
}
