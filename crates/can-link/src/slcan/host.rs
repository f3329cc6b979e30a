//! Host side of the SLCAN protocol: makes an adapter on a serial port available as a bus.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use super::line::{Lines, Piece, parse_flags, parse_frame, parse_state, push_frame};
use super::options::{BIT_RATES, DATA_RATES, SlcanOptions};
use super::port::Port;

use crate::{AnswerError, AttachError, CanBus, CanError, CanFrame, CanUrl, ControllerState, OpenError};

/// Longest wait for the answer to the first version request. The wait is long, because the adapter is perhaps still
/// starting.
const VERSION_TIMEOUT: Duration = Duration::from_secs(1);
/// Number of version requests before the host assumes that no adapter answers.
const VERSION_QUESTIONS: u32 = 3;
/// Longest wait for the answers of an adapter to other commands.
const ANSWER: Duration = Duration::from_millis(500);
/// Waiting time after which all bytes that the adapter sent to a previous program have arrived.
const QUIET: Duration = Duration::from_millis(30);
/// Longest time to repeat a frame that the adapter refuses because of a full queue, and longest wait for the
/// adapter's answer.
const SEND_TIMEOUT: Duration = Duration::from_secs(2);
/// Pause before a refused frame is sent again.
const RETRY: Duration = Duration::from_millis(1);
/// Duration of one step of a wait. In each step, the host both reads and writes.
const SLICE: Duration = Duration::from_millis(20);
/// Largest number of received frames that are stored while the host waits for an answer.
const RECEIVE_QUEUE: usize = 100_000;

/// An adapter's answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Yes,
    No,
}

/// A frame that the adapter has not confirmed yet.
struct Outstanding {
    line: String,
    since: Instant,
    /// Time at which the frame was last written.
    written: Instant,
    /// `true` if the adapter has refused the frame since it was last written.
    refused: bool,
}

/// Bus of an SLCAN adapter.
///
/// If the adapter confirms frames, each frame is sent after the confirmation of the previous frame. A refused frame is
/// sent again, because the adapter's queue was full. If the adapter never answers, frames are written as fast as the
/// line accepts them.
pub struct SlcanBus {
    url: String,
    port: Port,
    lines: Lines,
    receive_queue: VecDeque<CanFrame>,
    /// `true` if the adapter answers commands.
    answers: bool,
    /// `true` if the adapter has confirmed a frame.
    confirms: bool,
    last_answer: Option<Answer>,
    outstanding: Option<Outstanding>,
    state: ControllerState,
    /// `true` if the adapter supports the command `F`; `None` before the host has sent this command.
    has_flags: Option<bool>,
    got_flags: bool,
    /// `true` if the adapter has sent a line of an unknown kind, for example its version.
    got_text: bool,
    closed: bool,
}

impl SlcanBus {
    /// Opens the port, sets the rates and opens the adapter's channel.
    pub fn open(options: &SlcanOptions) -> Result<Self, OpenError> {
        let SlcanOptions { device, rate, data_rate, baud } = options.clone();
        let url = CanUrl::Slcan { device, rate, data_rate, baud }.to_string();
        let wrong_rate = |what: &'static str, rate: u32, possible: String| OpenError::Rate {
            url: url.clone(),
            what,
            rate,
            possible,
        };
        let rate_code = match options.rate {
            None => None,
            Some(rate) => {
                let list = BIT_RATES.map(|rate| rate.to_string()).join(", ");
                let code = BIT_RATES.iter().position(|known| *known == rate);
                Some(code.ok_or_else(|| wrong_rate("bit rate", rate, list))?)
            }
        };
        let data_code = match options.data_rate {
            None => None,
            Some(rate) => {
                let list = DATA_RATES.map(|(rate, _)| rate.to_string()).join(", ");
                let code = DATA_RATES.iter().find(|(known, _)| *known == rate).map(|(_, code)| *code);
                Some(code.ok_or_else(|| wrong_rate("data bit rate", rate, list))?)
            }
        };
        let port = match Port::open(&options.device, options.baud) {
            Ok(port) => port,
            Err(source) => return Err(AttachError::Port { url, source }.into()),
        };
        let mut bus = Self {
            url,
            port,
            lines: Lines::new(),
            receive_queue: VecDeque::new(),
            answers: true,
            confirms: false,
            last_answer: None,
            outstanding: None,
            state: ControllerState::default(),
            has_flags: None,
            got_flags: false,
            got_text: false,
            closed: false,
        };
        bus.check_presence()?;
        if let Some(code) = rate_code {
            bus.set("setting the bit rate", &format!("S{code}\r"))?;
        }
        if let Some(code) = data_code {
            bus.set("setting the data bit rate", &format!("Y{code}\r"))?;
        }
        bus.set("opening the channel", "O\r")?;
        bus.receive_queue.clear();
        Ok(bus)
    }

    /// Closes a channel that a previous program has left open, and checks that an adapter answers.
    fn check_presence(&mut self) -> Result<(), CanError> {
        // The first carriage return ends a line that a previous program has left incomplete.
        self.write(b"\rC\r")?;
        let end = Instant::now() + ANSWER;
        while self.take_in(QUIET)? && Instant::now() < end {}
        let mut somebody = false;
        for _ in 0..VERSION_QUESTIONS {
            self.got_text = false;
            self.write(b"V\r")?;
            let end = Instant::now() + VERSION_TIMEOUT;
            while Instant::now() < end {
                somebody |= self.take_in(SLICE)?;
                // Only the answer to the version request is a text. The text is therefore not a late answer to an
                // earlier command.
                if self.got_text {
                    return Ok(());
                }
            }
            // The adapter does not support the version request. The received bytes prove that an adapter is
            // connected.
            if somebody {
                return Ok(());
            }
        }
        let hint =
            "check that the device is an SLCAN adapter, its firmware, and the rate of the line (?baud=N)";
        let seconds = VERSION_TIMEOUT.as_secs() * u64::from(VERSION_QUESTIONS);
        Err(AnswerError::NoAnswer { url: self.url.clone(), step: "the version request", seconds, hint }
            .into())
    }

    /// Sends a command. If the adapter never answers, the command is assumed to be executed.
    fn set(&mut self, step: &'static str, line: &str) -> Result<(), CanError> {
        self.last_answer = None;
        self.write(line.as_bytes())?;
        let end = Instant::now() + ANSWER;
        while self.answers && self.last_answer.is_none() {
            if Instant::now() >= end {
                self.answers = false;
            }
            self.take_in(SLICE)?;
        }
        if self.last_answer == Some(Answer::No) {
            let answer =
                "the adapter answered with a bell: it does not know this command, or cannot carry it out now"
                    .to_owned();
            return Err(AnswerError::Refused { url: self.url.clone(), step, answer }.into());
        }
        Ok(())
    }

    fn broken(&mut self, step: &'static str, source: io::Error) -> CanError {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
        self.closed = true;
        match source.kind() {
            BrokenPipe | ConnectionAborted | ConnectionReset | UnexpectedEof => {
                CanError::Closed { url: self.url.clone() }
            }
            _ => CanError::Io { url: self.url.clone(), step, source },
        }
    }

    /// Reads bytes that arrive within `timeout`; returns `true` if any bytes arrived.
    fn take_in(&mut self, timeout: Duration) -> Result<bool, CanError> {
        if self.closed {
            return Err(CanError::Closed { url: self.url.clone() });
        }
        let mut buffer = [0; 4096];
        let count = match self.port.read(&mut buffer, timeout) {
            Ok(Some(count)) => count,
            Ok(None) => return Ok(false),
            Err(error) => return Err(self.broken("receiving", error)),
        };
        let mut bytes = &buffer[..count];
        let mut answers = Vec::new();
        while let Some(piece) = self.lines.next(&mut bytes) {
            match piece {
                Piece::Bell => answers.push(Answer::No),
                Piece::Line("" | "z" | "Z") => answers.push(Answer::Yes),
                Piece::Line(line) => {
                    if let Some(frame) = parse_frame(line) {
                        self.receive_queue.push_back(frame);
                    } else if let Some(state) = parse_state(line) {
                        self.state = state;
                    } else if let Some(state) = parse_flags(line) {
                        self.got_flags = true;
                        // This line contains no error counters. If the error state is unchanged, the counters that
                        // were reported earlier stay valid.
                        if self.state.errors != state.errors {
                            self.state = state;
                        }
                    } else {
                        self.got_text = true;
                    }
                }
            }
        }
        for answer in answers {
            self.answered(answer);
        }
        Ok(true)
    }

    fn answered(&mut self, answer: Answer) {
        self.last_answer = Some(answer);
        match (&mut self.outstanding, answer) {
            (Some(_), Answer::Yes) => {
                self.outstanding = None;
                self.confirms = true;
            }
            (Some(frame), Answer::No) => frame.refused = true,
            (None, _) => {}
        }
    }

    fn write(&mut self, mut bytes: &[u8]) -> Result<(), CanError> {
        let mut give_up = Instant::now() + SEND_TIMEOUT;
        while !bytes.is_empty() {
            match self.port.write(bytes, SLICE) {
                Ok(0) if Instant::now() >= give_up => {
                    return Err(self.broken("sending", io::ErrorKind::TimedOut.into()));
                }
                // The adapter accepts no bytes, perhaps because it waits until this host reads received frames. The
                // host therefore reads before it writes again.
                Ok(0) if self.receive_queue.len() < RECEIVE_QUEUE => {
                    self.take_in(SLICE)?;
                }
                Ok(0) => {}
                Ok(count) => {
                    bytes = &bytes[count..];
                    give_up = Instant::now() + SEND_TIMEOUT;
                }
                Err(error) => return Err(self.broken("sending", error)),
            }
        }
        Ok(())
    }

    /// Handles the unconfirmed frame, and writes this frame again if the adapter has refused it. Returns `true` if no
    /// frame is unconfirmed.
    fn settle(&mut self, now: Instant) -> Result<bool, CanError> {
        let Some(frame) = &mut self.outstanding else { return Ok(true) };
        let late = now.saturating_duration_since(frame.since) >= SEND_TIMEOUT;
        if frame.refused {
            if late {
                self.outstanding = None;
                let answer = "the adapter refused the frame for 2 s because its transmit queue is full; \
                              check that a node acknowledges, and the bit rate";
                let (url, answer) = (self.url.clone(), answer.to_owned());
                return Err(AnswerError::Refused { url, step: "sending", answer }.into());
            }
            if now.saturating_duration_since(frame.written) >= RETRY {
                frame.refused = false;
                frame.written = now;
                let line = frame.line.clone();
                self.write(line.as_bytes())?;
            }
        } else if !self.confirms && now.saturating_duration_since(frame.since) >= ANSWER {
            // The adapter answered during set-up, but does not confirm frames. From this point, the host does not
            // wait for confirmations.
            self.answers = false;
            self.outstanding = None;
            return Ok(true);
        } else if late {
            self.outstanding = None;
            let hint = "check that a node on the bus acknowledges; unplug the adapter and try again";
            let seconds = SEND_TIMEOUT.as_secs();
            let url = self.url.clone();
            return Err(AnswerError::NoAnswer { url, step: "sending a frame", seconds, hint }.into());
        }
        Ok(self.outstanding.is_none())
    }

    /// Waits until the adapter has confirmed the last frame.
    fn wait_for_confirmation(&mut self) -> Result<(), CanError> {
        while !self.settle(Instant::now())? {
            if self.receive_queue.len() < RECEIVE_QUEUE {
                let refused = self.outstanding.as_ref().is_some_and(|frame| frame.refused);
                self.take_in(if refused { RETRY } else { SLICE })?;
            }
        }
        Ok(())
    }
}

impl CanBus for SlcanBus {
    fn send(&mut self, frame: &CanFrame) -> Result<(), CanError> {
        if self.closed {
            return Err(CanError::Closed { url: self.url.clone() });
        }
        self.wait_for_confirmation()?;
        let mut line = String::with_capacity(160);
        push_frame(&mut line, frame);
        self.write(line.as_bytes())?;
        if self.answers {
            let now = Instant::now();
            self.outstanding = Some(Outstanding { line, since: now, written: now, refused: false });
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Duration) -> Result<Option<CanFrame>, CanError> {
        let deadline = Instant::now().checked_add(timeout);
        // Bytes that have already arrived are read even with a timeout of zero.
        let mut wait = Duration::ZERO;
        loop {
            if let Some(frame) = self.receive_queue.pop_front() {
                return Ok(Some(frame));
            }
            let waiting = !self.settle(Instant::now())?;
            let came = self.take_in(if waiting { wait.min(SLICE) } else { wait })?;
            if came && !self.receive_queue.is_empty() {
                continue;
            }
            let left = deadline.map_or(timeout, |end| end.saturating_duration_since(Instant::now()));
            if left.is_zero() {
                return Ok(None);
            }
            wait = left;
        }
    }

    /// Requests the state of the adapter with the command `F`, if the adapter supports it.
    fn state(&mut self) -> ControllerState {
        if self.has_flags == Some(false) || !self.answers || self.wait_for_confirmation().is_err() {
            return self.state;
        }
        self.got_flags = false;
        if self.write(b"F\r").is_ok() {
            let end = Instant::now() + ANSWER;
            self.last_answer = None;
            // The loop also ends when the adapter refuses the command with a bell character.
            while !self.got_flags && self.last_answer.is_none() && Instant::now() < end {
                if self.take_in(SLICE).is_err() {
                    break;
                }
            }
            self.has_flags = Some(self.got_flags);
        }
        self.state
    }
}

impl Drop for SlcanBus {
    fn drop(&mut self) {
        if !self.closed {
            // The adapter must send the last frame before its channel is closed.
            let _ = self.wait_for_confirmation();
            let _ = self.write(b"C\r");
        }
    }
}
