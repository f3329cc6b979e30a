//! Adapter side of the SLCAN protocol, for tests and simulators.

use std::io::{self, Read, Write};

use super::line::{BELL, Lines, Piece, flags, parse_frame, push_frame};
use super::options::{BIT_RATES, DATA_RATES};
use crate::{CanBus, CanError, CanFrame, ControllerState};

/// Largest number of output bytes that the adapter stores for a host that does not read. Further frames are lost, as
/// in a real adapter with little memory.
const OUTPUT: usize = 256 * 1024;
/// Largest number of frames that one call of `turn` takes from the bus.
const MOST: usize = 64;

/// A simulated SLCAN adapter without a port and without a thread. The adapter accepts bytes from the host and returns
/// bytes for the host.
///
/// ```
/// use can_link::SlcanAdapter;
/// let mut adapter = SlcanAdapter::new();
/// let mut sent = Vec::new();
/// adapter.input(b"S8\rO\rt28121122\r", |frame| { sent.push(*frame); true });
/// assert_eq!(sent[0].to_string(), "281 # 11 22");
/// adapter.received(&sent[0]);
/// assert_eq!(adapter.take_output(), b"\r\rz\rt28121122\r");
/// ```
#[derive(Default)]
pub struct SlcanAdapter {
    lines: Option<Lines>,
    output: Vec<u8>,
    rate: Option<u32>,
    data_rate: Option<u32>,
    open: bool,
    listen_only: bool,
    time_stamps: bool,
    state: ControllerState,
    lost: u64,
}

impl SlcanAdapter {
    /// Creates a closed adapter whose bit rate is not set.
    pub fn new() -> Self {
        Self::default()
    }

    /// Processes bytes from the host. Calls `send` with each frame of the host. `send` must return `true` if the bus
    /// has accepted the frame. Otherwise the adapter refuses the frame with a bell character, like an adapter with a
    /// full queue.
    pub fn input(&mut self, mut bytes: &[u8], mut send: impl FnMut(&CanFrame) -> bool) {
        let mut lines = self.lines.take().unwrap_or_else(Lines::new);
        while let Some(piece) = lines.next(&mut bytes) {
            // Only an adapter sends bell characters, so a bell from the host is ignored.
            if let Piece::Line(line) = piece {
                self.execute(line, &mut send);
            }
        }
        self.lines = Some(lines);
    }

    /// Sends a frame from the bus to the host.
    pub fn received(&mut self, frame: &CanFrame) {
        if !self.open {
            return;
        }
        if self.output.len() >= OUTPUT {
            self.lost += 1;
            return;
        }
        let mut line = String::new();
        push_frame(&mut line, frame);
        if self.time_stamps {
            line.insert_str(line.len() - 1, "0000");
        }
        self.output.extend_from_slice(line.as_bytes());
    }

    /// Sets the state that the adapter reports in its status flags.
    pub fn set_state(&mut self, state: ControllerState) {
        self.state = state;
    }

    /// Returns the bytes for the host and removes these bytes from the adapter.
    pub fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    /// Returns `true` if the host has opened the adapter's channel.
    pub fn is_open(&self) -> bool {
        self.open
    }

    /// Returns the bit rate and data bit rate that the host has set, bit/s.
    pub fn rates(&self) -> (Option<u32>, Option<u32>) {
        (self.rate, self.data_rate)
    }

    /// Returns the number of frames from the bus that were lost because the host did not read.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Exchanges data once between a host and a bus: executes the host's commands and forwards the frames of the bus.
    /// Reads and writes of the port must not wait for long.
    pub fn turn(
        &mut self,
        port: &mut (impl Read + Write),
        bus: &mut impl CanBus,
    ) -> Result<(), AdapterError> {
        let mut buffer = [0; 1024];
        let count = waited(port.read(&mut buffer))?;
        let mut failed = None;
        self.input(&buffer[..count], |frame| match bus.send(frame) {
            Ok(()) => true,
            Err(error) => {
                failed = Some(error);
                false
            }
        });
        if let Some(error) = failed {
            return Err(AdapterError::Bus(error));
        }
        for _ in 0..MOST {
            match bus.receive(std::time::Duration::ZERO).map_err(AdapterError::Bus)? {
                Some(frame) => self.received(&frame),
                None => break,
            }
        }
        if !self.output.is_empty() {
            let count = waited(port.write(&self.output))?;
            self.output.drain(..count);
        }
        Ok(())
    }

    fn execute(&mut self, line: &str, send: &mut impl FnMut(&CanFrame) -> bool) {
        let Some((command, rest)) = line.split_at_checked(1) else {
            // An empty line is accepted, because hosts send empty lines to clear earlier input.
            return self.reply("\r");
        };
        let digit = rest.parse::<usize>().ok().filter(|_| rest.len() == 1);
        match command {
            "S" if !self.open => {
                let rate = digit.and_then(|code| BIT_RATES.get(code)).copied();
                self.yes_if(rate.is_some());
                self.rate = rate.or(self.rate);
            }
            "Y" if !self.open => {
                let rate =
                    digit.and_then(|digit| DATA_RATES.iter().find(|(_, code)| usize::from(*code) == digit));
                self.yes_if(rate.is_some());
                self.data_rate = rate.map(|(rate, _)| *rate).or(self.data_rate);
            }
            "O" | "L" if !self.open && rest.is_empty() && self.rate.is_some() => {
                self.open = true;
                self.listen_only = command == "L";
                self.reply("\r");
            }
            "C" if rest.is_empty() => {
                self.yes_if(self.open);
                self.open = false;
            }
            "Z" if !self.open => {
                self.yes_if(matches!(rest, "0" | "1"));
                self.time_stamps = rest == "1";
            }
            "V" => self.reply("V1013\r"),
            "N" => self.reply("NSIM0\r"),
            "F" if self.open => {
                let flags = flags(self.state);
                self.reply(&format!("F{flags:02X}\r"));
            }
            _ => match parse_frame(line) {
                Some(frame) if self.open && !self.listen_only && send(&frame) => {
                    self.reply(if frame.is_extended() { "Z\r" } else { "z\r" });
                }
                _ => self.output.push(BELL),
            },
        }
    }

    fn yes_if(&mut self, yes: bool) {
        self.output.push(if yes { b'\r' } else { BELL });
    }

    fn reply(&mut self, text: &str) {
        self.output.extend_from_slice(text.as_bytes());
    }
}

/// Reasons why an exchange of an adapter failed.
#[derive(Debug, thiserror::Error)]
pub enum AdapterError {
    /// Reading from or writing to the host failed.
    #[error("the serial line failed: {0}")]
    Port(#[from] io::Error),
    /// The bus failed.
    #[error(transparent)]
    Bus(CanError),
}

/// Returns 0 for a read without data and for a write without space, which are not errors.
fn waited(result: io::Result<usize>) -> io::Result<usize> {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    result.or_else(|error| match error.kind() {
        WouldBlock | TimedOut | Interrupted => Ok(0),
        _ => Err(error),
    })
}
