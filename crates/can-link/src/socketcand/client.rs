//! Client of the socketcand protocol.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use super::splitter::Splitter;
use super::text::{CLASS_BUS_OFF, CLASS_RESTARTED, Reply, has_form, push_send};
use crate::{
    AnswerError, AttachError, CanBus, CanError, CanFrame, CanUrl, ControllerState, ErrorState, OpenError,
};

/// Longest wait for the connection. While the bus is opened, also the longest wait for each answer.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Longest time for which a send waits for a server that accepts no data.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);
/// Time for which a send waits for space before it reads received bytes. Some servers accept no data until the client
/// reads.
const SEND_SLICE: Duration = Duration::from_millis(20);
/// Longest time for which a closing bus waits until the server accepts the last frames.
const END_TIMEOUT: Duration = Duration::from_millis(250);
/// Largest number of bytes per read.
const READ: usize = 16 * 1024;
/// Largest number of received frames that are stored while a send waits.
const RECEIVE_QUEUE: usize = 100_000;

/// Bus of a socketcand server, for classic data frames only.
///
/// When the connection ends, [`CanBus::send`] and [`CanBus::receive`] return [`CanError::Closed`]; the bus does not reconnect.
pub struct SocketcandBus {
    url: String,
    stream: TcpStream,
    splitter: Splitter,
    /// Bytes that were received together with an answer while the bus was opened, and that are not processed yet.
    glued: Vec<u8>,
    receive_queue: VecDeque<CanFrame>,
    /// Timeout of the socket; with `None`, the socket does not wait.
    timeout: Option<Duration>,
    closed: bool,
    errors: ErrorState,
    times_bus_off: u64,
    ignored: u64,
}

impl SocketcandBus {
    /// Connects to a server and opens one of its buses. An IPv6 address is written without brackets.
    pub fn connect(host: &str, port: u16, channel: &str) -> Result<Self, OpenError> {
        let url = CanUrl::Socketcand { host: host.to_owned(), port, channel: channel.to_owned() }.to_string();
        let stream = match connect(host, port) {
            Ok(stream) => stream,
            Err(source) => return Err(AttachError::Connect { url, source }.into()),
        };
        let mut bus = Self {
            url,
            stream,
            splitter: Splitter::new(),
            glued: Vec::new(),
            receive_queue: VecDeque::new(),
            timeout: Some(TIMEOUT),
            closed: false,
            errors: ErrorState::Unknown,
            times_bus_off: 0,
            ignored: 0,
        };
        bus.set_up().map_err(bus.failed("setting the socket"))?;
        bus.expect("connecting", &Reply::Hi)?;
        bus.ask("opening the bus", &format!("< open {channel} >"))?;
        bus.ask("setting raw mode", "< rawmode >")?;
        Ok(bus)
    }

    /// Returns the number of messages received so far that do not belong to the protocol's raw mode.
    pub fn ignored(&self) -> u64 {
        self.ignored + self.splitter.noise()
    }

    fn set_up(&mut self) -> io::Result<()> {
        // Frames are small, and the operating system must send each frame without waiting for further frames.
        self.stream.set_nodelay(true)?;
        self.stream.set_read_timeout(self.timeout)?;
        self.stream.set_write_timeout(Some(SEND_SLICE))
    }

    fn failed(&self, step: &'static str) -> impl FnOnce(io::Error) -> CanError + use<> {
        let url = self.url.clone();
        move |source| CanError::Io { url, step, source }
    }

    fn ask(&mut self, step: &'static str, request: &str) -> Result<(), CanError> {
        self.write(request.as_bytes())?;
        self.expect(step, &Reply::Ok)
    }

    /// Waits for an answer of the server, and stores the bytes that follow the answer.
    fn expect(&mut self, step: &'static str, answer: &Reply) -> Result<(), CanError> {
        let end = Instant::now() + TIMEOUT;
        let mut buffer = [0; READ];
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let count = match left.is_zero() {
                true => None,
                false => self.read(&mut buffer, Some(left))?,
            };
            let Some(count) = count else {
                let hint = "check that a socketcand server runs there and accepts more clients";
                let (url, seconds) = (self.url.clone(), TIMEOUT.as_secs());
                return Err(AnswerError::NoAnswer { url, step, seconds, hint }.into());
            };
            let mut bytes = &buffer[..count];
            while let Some(message) = self.splitter.next(&mut bytes) {
                match Reply::parse(message) {
                    reply if reply == *answer => {
                        self.glued = bytes.to_vec();
                        return Ok(());
                    }
                    Reply::Refused(text) => {
                        let (url, answer) = (self.url.clone(), text.to_owned());
                        return Err(AnswerError::Refused { url, step, answer }.into());
                    }
                    _ => {}
                }
            }
        }
    }

    /// Waits up to `wait` for bytes (`None`: does not wait). Returns `None` if no byte arrived. At the end of the stream, the
    /// function returns an error.
    fn read(&mut self, buffer: &mut [u8; READ], wait: Option<Duration>) -> Result<Option<usize>, CanError> {
        if self.closed {
            return Err(CanError::Closed { url: self.url.clone() });
        }
        if !self.glued.is_empty() {
            // The stored bytes were received by a single read, so they fit into the buffer.
            let count = self.glued.len();
            buffer[..count].copy_from_slice(&self.glued);
            self.glued.clear();
            return Ok(Some(count));
        }
        self.set_timeout(wait).map_err(self.failed("setting the timeout"))?;
        match self.stream.read(buffer) {
            Ok(0) => {
                self.closed = true;
                Err(CanError::Closed { url: self.url.clone() })
            }
            Ok(count) => Ok(Some(count)),
            Err(error) if is_no_data(&error) => Ok(None),
            Err(error) => Err(self.broken("receiving", error)),
        }
    }

    fn set_timeout(&mut self, timeout: Option<Duration>) -> io::Result<()> {
        if timeout == self.timeout {
            return Ok(());
        }
        if timeout.is_none() || self.timeout.is_none() {
            self.stream.set_nonblocking(timeout.is_none())?;
        }
        if timeout.is_some() {
            self.stream.set_read_timeout(timeout)?;
        }
        self.timeout = timeout;
        Ok(())
    }

    /// Converts an I/O error to a bus error. A broken connection becomes [`CanError::Closed`].
    fn broken(&mut self, step: &'static str, source: io::Error) -> CanError {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset};
        self.closed = true;
        match source.kind() {
            BrokenPipe | ConnectionAborted | ConnectionReset => CanError::Closed { url: self.url.clone() },
            _ => CanError::Io { url: self.url.clone(), step, source },
        }
    }

    /// Reads the available bytes; returns `true` if any bytes were available.
    fn take_in(&mut self, wait: Option<Duration>) -> Result<bool, CanError> {
        let mut buffer = [0; READ];
        let Some(count) = self.read(&mut buffer, wait)? else { return Ok(false) };
        let mut bytes = &buffer[..count];
        while let Some(message) = self.splitter.next(&mut bytes) {
            match Reply::parse(message) {
                Reply::Frame(frame) => self.receive_queue.push_back(frame),
                Reply::ErrorFrame(class) if class & CLASS_BUS_OFF != 0 => {
                    self.errors = ErrorState::BusOff;
                    self.times_bus_off += 1;
                }
                Reply::ErrorFrame(class) if class & CLASS_RESTARTED != 0 => self.errors = ErrorState::Active,
                Reply::ErrorFrame(_) => {}
                _ => self.ignored += 1,
            }
        }
        Ok(true)
    }

    /// Writes all bytes. While the server accepts no data, reads the bytes that the server has sent.
    fn write(&mut self, mut bytes: &[u8]) -> Result<(), CanError> {
        if self.closed {
            return Err(CanError::Closed { url: self.url.clone() });
        }
        let mut give_up = Instant::now() + SEND_TIMEOUT;
        while !bytes.is_empty() {
            match self.stream.write(bytes) {
                Ok(count) => {
                    bytes = &bytes[count..];
                    give_up = Instant::now() + SEND_TIMEOUT;
                }
                Err(error) if is_no_data(&error) && Instant::now() < give_up => {
                    // In non-blocking mode the socket calls return at once. The pause prevents a busy loop.
                    if self.receive_queue.len() >= RECEIVE_QUEUE || !self.take_in(Some(SEND_SLICE))? {
                        std::thread::sleep(Duration::from_micros(200));
                    }
                }
                Err(error) => return Err(self.broken("sending", error)),
            }
        }
        Ok(())
    }
}

fn connect(host: &str, port: u16) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, TIMEOUT) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn is_no_data(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), WouldBlock | TimedOut | Interrupted)
}

impl CanBus for SocketcandBus {
    fn carries(&self, frame: &CanFrame) -> Result<(), CanError> {
        if has_form(frame) {
            return Ok(());
        }
        let why = "the socketcand protocol has classic data frames only; for CAN FD use multicast:ADDR:PORT";
        Err(CanError::NotCarried { url: self.url.clone(), frame: *frame, why })
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        self.carries(frame)?;
        let mut text = String::with_capacity(64);
        push_send(&mut text, frame);
        self.write(text.as_bytes())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let deadline = Instant::now().checked_add(timeout);
        let mut wait = None;
        loop {
            if let Some(frame) = self.receive_queue.pop_front() {
                return Ok(Some(frame));
            }
            if self.take_in(wait)? {
                continue;
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Ok(None);
            }
            wait = Some(left);
        }
    }

    /// Returns the state of the controller. The protocol reports only bus-off and the recovery from bus-off.
    fn state(&mut self) -> ControllerState {
        ControllerState::without_counters(self.errors)
    }

    fn times_bus_off(&self) -> u64 {
        self.times_bus_off
    }
}

impl Drop for SocketcandBus {
    fn drop(&mut self) {
        // If the socket were closed with unread bytes, the connection would be reset. The server would then lose frames that
        // it has not read yet.
        let _ = self.stream.shutdown(Shutdown::Write);
        let end = Instant::now() + END_TIMEOUT;
        let mut buffer = [0; READ];
        while !self.closed {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() || self.read(&mut buffer, Some(left)).is_err() {
                break;
            }
        }
    }
}
