//! Raw capture of the bytes that a port sends and receives. Each text line contains the time in seconds, the direction, and the bytes in
//! hexadecimal.
//!
//! ```text
//! 0.001250 > 9B 06 00 06 0A E6
//! 0.016400 < 9B 03 00 AF 06 01
//! ```

use std::io::{self, BufRead, Write};
use std::time::Duration;

use super::{Halts, Port, PortError};

/// Direction of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Bytes from the host to the controller, written as `>`.
    ToDevice,
    /// Bytes from the controller to the host, written as `<`.
    ToHost,
}

/// Port that also writes all bytes of both directions to a capture.
pub struct Capture<P, W: Write> {
    port: P,
    out: W,
    failed: Option<io::Error>,
}

impl<P: Port, W: Write> Capture<P, W> {
    /// Creates a capture of `port` that is written to `out`.
    pub fn new(port: P, out: W) -> Self {
        Self { port, out, failed: None }
    }

    /// Returns the port, the writer, and the error if writing failed.
    pub fn finish(mut self) -> (P, W, Option<io::Error>) {
        if self.failed.is_none() {
            self.failed = self.out.flush().err();
        }
        (self.port, self.out, self.failed)
    }

    fn note(&mut self, direction: Direction, bytes: &[u8]) {
        use std::fmt::Write as _;
        if bytes.is_empty() || self.failed.is_some() {
            return;
        }
        let mark = if direction == Direction::ToDevice { '>' } else { '<' };
        let mut line = format!("{:.6} {mark}", self.port.now().as_secs_f64());
        for b in bytes {
            let _ = write!(line, " {b:02X}");
        }
        // A motion must continue even if the disk is full. Therefore the capture stores the write error, and `finish` returns this error.
        self.failed = writeln!(self.out, "{line}").err();
    }
}

impl<P: Port, W: Write> Port for Capture<P, W> {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let n = self.port.read(buffer, timeout)?;
        self.note(Direction::ToHost, &buffer[..n]);
        Ok(n)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.note(Direction::ToDevice, bytes);
        self.port.write_all(bytes)
    }
    fn now(&self) -> Duration {
        self.port.now()
    }
    fn baud(&self) -> Option<u32> {
        self.port.baud()
    }
    fn name(&self) -> String {
        self.port.name()
    }
    fn take_denial(&mut self) -> Option<String> {
        self.port.take_denial()
    }
    fn ask_to_move(&mut self) -> Result<(), PortError> {
        self.port.ask_to_move()
    }
    fn halts(&self) -> Halts {
        self.port.halts()
    }
    fn ask_to_move_after(&mut self, halts: u64) -> Result<(), PortError> {
        self.port.ask_to_move_after(halts)
    }
    fn ask_to_resume(&mut self) -> Result<(), PortError> {
        self.port.ask_to_resume()
    }
}

/// Text line of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Captured {
    /// Time, s.
    pub time_s: f64,
    /// Direction of the bytes.
    pub direction: Direction,
    /// Bytes that were sent or received.
    pub bytes: Vec<u8>,
}

/// Reads a capture. If a line is invalid, the error contains the line number.
///
/// # Errors
///
/// Returns an error if the input cannot be read or if a line is not a valid capture line.
pub fn read_capture(input: impl BufRead) -> io::Result<Vec<Captured>> {
    let mut all = Vec::new();
    for (i, line) in input.lines().enumerate() {
        let line = line?;
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong =
            |what: &str| io::Error::new(io::ErrorKind::InvalidData, format!("line {}: {what}", i + 1));
        let mut words = line.split_whitespace();
        let time_s = words.next().and_then(|w| w.parse().ok()).ok_or_else(|| wrong("the time is missing"))?;
        let direction = match words.next() {
            Some(">") => Direction::ToDevice,
            Some("<") => Direction::ToHost,
            _ => return Err(wrong("the direction is neither > nor <")),
        };
        let bytes = words
            .map(|w| u8::from_str_radix(w, 16).map_err(|_| wrong("a byte is not hexadecimal")))
            .collect::<io::Result<_>>()?;
        all.push(Captured { time_s, direction, bytes });
    }
    Ok(all)
}
