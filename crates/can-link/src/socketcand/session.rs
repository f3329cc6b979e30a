//! Session of a client of the server. The first thread reads the client's requests. A second thread writes frames to
//! the client after raw mode begins.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::shared::{ClientAction, ClientId, Inner, Route};
use super::splitter::Splitter;
use super::text::{Request, has_form, push_frame, push_state};
use crate::virtual_bus::Received;
use crate::{CanBus, VirtualBus};

/// Time after the answer to `rawmode` in which the server sends no frame. python-can compares all bytes of one read
/// with the answer, so the read must not contain a frame.
const HELD_BACK: Duration = Duration::from_millis(20);
/// Largest number of frames that are queued for a client: some seconds of a fully loaded bus.
const WAITING: usize = 65_536;
/// Largest number of bytes that the operating system buffers for a client. A larger buffer would only delay the
/// client's frames.
const SEND_BUFFER: usize = 128 * 1024;
/// Largest number of frames in one write.
const BATCH: usize = 64;
/// Time after which a client that accepts no data is considered disconnected.
const WRITE_TIMEOUT: Duration = Duration::from_secs(30);
/// Time after which a client without requests and without an open bus is disconnected.
const OPEN_TIMEOUT: Duration = Duration::from_secs(30);

/// Socket to which both threads write.
struct Out {
    stream: Mutex<Output>,
}

struct Output {
    stream: TcpStream,
    /// Earliest time at which the server may send frames to the client.
    frames_from: Instant,
}

impl Out {
    fn lock(&self) -> MutexGuard<'_, Output> {
        self.stream.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Serves a client until it disconnects.
pub(super) fn serve(inner: &Arc<Inner>, client: ClientId, stream: TcpStream) {
    let mut session = Session { inner, client, opened: None, writer: None };
    // An error of a client's connection ends only the session of this client.
    let _ = session.run(stream);
    session.end();
}

struct Session<'a> {
    inner: &'a Arc<Inner>,
    client: ClientId,
    /// Channel of the client, and its membership of the bus.
    opened: Option<(usize, VirtualBus)>,
    writer: Option<std::thread::JoinHandle<()>>,
}

impl Session<'_> {
    fn run(&mut self, mut stream: TcpStream) -> io::Result<()> {
        // TCP must send each answer at once, in its own segment.
        stream.set_nodelay(true)?;
        // Keep-alive detects that a client's computer was switched off.
        socket2::SockRef::from(&stream).set_keepalive(true)?;
        // The operating system limits the size to its own range.
        let _ = socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
        stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
        stream.set_read_timeout(Some(OPEN_TIMEOUT))?;
        let output = Output { stream: stream.try_clone()?, frames_from: Instant::now() };
        let out = Arc::new(Out { stream: Mutex::new(output) });
        reply(&out, "< hi >")?;
        let mut splitter = Splitter::new();
        let mut buffer = [0; 4096];
        loop {
            let count = match stream.read(&mut buffer) {
                Ok(0) => return Ok(()),
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            let mut bytes = &buffer[..count];
            let noise = splitter.noise();
            while let Some(message) = splitter.next(&mut bytes) {
                if !self.execute(Request::parse(message), &out)? {
                    return Ok(());
                }
            }
            self.not_understood(splitter.noise() - noise);
            if self.opened.is_some() {
                stream.set_read_timeout(None)?;
            }
        }
    }

    fn not_understood(&self, count: u64) {
        self.inner.not_understood.fetch_add(count, Ordering::Relaxed);
    }

    /// Executes a request of the client. Returns `false` if the connection must end.
    fn execute(&mut self, request: Request, out: &Arc<Out>) -> io::Result<bool> {
        match (request, &mut self.opened) {
            (Request::Echo, _) => reply(out, "< echo >")?,
            (Request::Open(name), None) => return self.open(name, out),
            (Request::RawMode, Some((_, member))) => {
                // From this point the client receives the frames of the bus. The queue of the client stores these
                // frames.
                let member = member.second_handle();
                let mut output = out.lock();
                member.set_deaf(false);
                output.stream.write_all(b"< ok >")?;
                output.frames_from = Instant::now() + HELD_BACK;
                drop(output);
                if self.writer.is_none() {
                    self.writer = Some(write_frames(self.inner, member, out)?);
                }
            }
            (Request::BcmMode, Some((_, member))) => {
                let mut output = out.lock();
                member.set_deaf(true);
                output.stream.write_all(b"< ok >")?;
            }
            (Request::Send(frame), Some((channel, member))) => {
                self.inner.received.fetch_add(1, Ordering::Relaxed);
                match &self.inner.channels[*channel].route {
                    Route::Hub => drop(member.send(&frame)),
                    Route::Host(report) => return Ok(report(self.client, ClientAction::Sent(frame))),
                }
            }
            // In raw mode the server sends no error text, because python-can would parse the first word of the text
            // as a number, and fail.
            _ => {
                self.not_understood(1);
                if self.writer.is_none() {
                    reply(out, "< error unknown command >")?;
                }
            }
        }
        Ok(true)
    }

    fn open(&mut self, name: &str, out: &Arc<Out>) -> io::Result<bool> {
        let channels = &self.inner.channels;
        let Some(number) = channels.iter().position(|channel| channel.name == name) else {
            let names: Vec<_> = channels.iter().map(|channel| channel.name.as_str()).collect();
            let mut names = names.join(", ");
            names.truncate(names.floor_char_boundary(150));
            reply(out, &format!("< error no such bus; there is {names} >"))?;
            return Ok(false);
        };
        let member = channels[number].hub.join_as_guest(WAITING);
        self.inner.set_opened(self.client, number, &member);
        self.opened = Some((number, member));
        if let Route::Host(report) = &channels[number].route
            && !report(self.client, ClientAction::Joined)
        {
            return Ok(false);
        }
        reply(out, "< ok >")?;
        Ok(true)
    }

    fn end(mut self) {
        if let Some((channel, member)) = self.opened.take() {
            if let Route::Host(report) = &self.inner.channels[channel].route {
                report(self.client, ClientAction::Left);
            }
            member.set_deaf(true);
            member.leave();
        }
        if let Some(writer) = self.writer.take() {
            let _ = writer.join();
        }
    }
}

fn reply(out: &Out, text: &str) -> io::Result<()> {
    out.lock().stream.write_all(text.as_bytes())
}

/// Writes frames to the client until the member leaves the bus or the client no longer accepts data. Runs in its own
/// thread.
fn write_frames(
    inner: &Arc<Inner>,
    member: VirtualBus,
    out: &Arc<Out>,
) -> io::Result<std::thread::JoinHandle<()>> {
    let (inner, out) = (Arc::clone(inner), Arc::clone(out));
    std::thread::Builder::new().name("socketcand frames".into()).spawn(move || {
        let mut received = Vec::with_capacity(BATCH);
        let mut text = String::new();
        while member.take_some(BATCH, Duration::from_secs(1), &mut received) {
            let (carried, not_carried) = write_batch(&received, &mut text);
            count(&inner.not_carried, not_carried);
            if write_text(&out, &text).is_err() {
                // Closing the socket ends the reading thread.
                let _ = out.lock().stream.shutdown(Shutdown::Both);
                return;
            }
            count(&inner.sent, carried);
            received.clear();
        }
    })
}

fn count(counter: &AtomicU64, number: usize) {
    counter.fetch_add(number as u64, Ordering::Relaxed);
}

/// Writes lines for the frames and states that the protocol supports; returns the numbers of written and omitted
/// frames.
fn write_batch(received: &[Received], text: &mut String) -> (usize, usize) {
    text.clear();
    #[expect(clippy::disallowed_methods, reason = "the form has the time of day")]
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let (mut carried, mut not_carried) = (0, 0);
    for received in received {
        match received {
            Received::Frame(frame) if has_form(frame) => {
                push_frame(text, frame, now);
                carried += 1;
            }
            Received::Frame(_) => not_carried += 1,
            Received::State(state) => push_state(text, *state, now),
        }
    }
    (carried, not_carried)
}

fn write_text(out: &Out, text: &str) -> io::Result<()> {
    if text.is_empty() {
        return Ok(());
    }
    loop {
        let mut output = out.lock();
        let early = output.frames_from.saturating_duration_since(Instant::now());
        if early.is_zero() {
            return output.stream.write_all(text.as_bytes());
        }
        drop(output);
        std::thread::sleep(early);
    }
}
