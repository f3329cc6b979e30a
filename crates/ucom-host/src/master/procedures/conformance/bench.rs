//! Sends and receives the frames of a conformance test, and stores the frames for the report.

use crate::master::engine::{Forget, Link, MS, Session};
use crate::master::error::{Error, ExchangeError, SignalError};
use crate::master::procedures::control::start_application;
use crate::master::reports::{BoardSeen, ConformanceOptions, Verdict};
use ucom::{BoardInfo, Frame, Function, Profile, Sequence, Status};

/// Functions that boards send without a request.
const NOISE: [Function; 3] = [Function::So, Function::Alive, Function::Debug];

/// Largest number of frames that are stored for a test.
const KEPT: usize = 64;

/// State of the boards before the first test.
pub(super) struct Found {
    pub boards: Vec<BoardSeen>,
    /// `true` if a board that is not tested could take a board number.
    pub strangers: bool,
}

/// Exchange of frames with the boards during one test.
pub(super) struct Bench<'a> {
    pub link: &'a Link,
    pub options: &'a ConformanceOptions,
    pub found: &'a Found,
    sent: Vec<String>,
    came: Vec<String>,
}

impl<'a> Bench<'a> {
    pub(super) fn new(link: &'a Link, options: &'a ConformanceOptions, found: &'a Found) -> Self {
        Self { link, options, found, sent: Vec::new(), came: Vec::new() }
    }

    pub(super) fn profile(&self) -> Profile {
        self.link.profile()
    }

    /// Returns the frames that the test sent, and the frames that it received.
    pub(super) fn log(self) -> (Vec<String>, Vec<String>) {
        (self.sent, self.came)
    }

    /// Sends a frame of the test, and discards the frames that were received earlier.
    pub(super) async fn send(&mut self, function: Function, to: u8, data: &[u8]) {
        let number = Sequence::new(to).unwrap_or(Sequence::ZERO);
        let Some(frame) = Frame::new(function.id(number), data) else { return };
        if self.sent.len() < KEPT {
            self.sent.push(frame.to_string());
        }
        let serial = self.link.with(|core| core.queue_frame(Some(self.link.id), frame, Forget::All));
        self.link.left(serial).await;
    }

    /// Returns all frames that boards send within `us` µs, except frames that boards send without a request.
    pub(super) async fn receive(&mut self, us: u64) -> Vec<Frame> {
        let all = self.hear_all(us).await;
        let answer = |f: &Frame| f.address().is_ok_and(|(function, _)| !NOISE.contains(&function));
        all.into_iter().map(|(_, f)| f).filter(answer).collect()
    }

    /// Like `receive`, but returns frames of all functions, with the time of each frame.
    pub(super) async fn hear_all(&mut self, us: u64) -> Vec<(u64, Frame)> {
        let until = self.link.now() + us;
        let mut all = Vec::new();
        while let Some((at, frame)) = self.link.next_raw(until).await {
            self.keep(&frame);
            if frame.address().is_ok_and(|(function, _)| function.from_board()) {
                all.push((at, frame));
            }
            if self.link.now() >= until || all.len() > 20_000 {
                break;
            }
        }
        all
    }

    /// Returns the first frame with this function and number that arrives within `us` µs.
    pub(super) async fn wait(&mut self, function: Function, from: u8, us: u64) -> Option<Frame> {
        let until = self.link.now() + us;
        while let Some((_, frame)) = self.link.next_raw(until).await {
            self.keep(&frame);
            if frame.address().is_ok_and(|(f, n)| f == function && n.number() == from) {
                return Some(frame);
            }
        }
        None
    }

    fn keep(&mut self, frame: &Frame) {
        let noise = frame.address().is_ok_and(|(function, _)| NOISE.contains(&function));
        if self.came.len() < KEPT && !noise {
            self.came.push(frame.to_string());
        }
    }

    /// Returns the values in the answer to PC_INFO; `None` if the board does not answer.
    pub(super) async fn info(&mut self, board: u8) -> Option<BoardInfo> {
        for _ in 0..3 {
            self.send(Function::Info, board, &[]).await;
            let first = self.wait(Function::DspInfo, board, self.link.times().info).await;
            // Waits for the description that follows the first frame, so that the description is not mistaken for the next answer.
            self.receive(self.link.times().gap).await;
            if let Some(frame) = first {
                return BoardInfo::parse(&frame.payload(), self.profile().endian);
            }
        }
        None
    }

    /// Checks that a board has the expected status bits after a step. The check ignores the status bits of the pins and of autostart.
    pub(super) async fn status_is(&mut self, board: u8, bits: u8, step: &str) -> Result<(), Verdict> {
        let mask = !(Status::IPINIT | Status::OPINIT | Status::ASTART);
        match self.info(board).await {
            Some(info) if info.status & mask == Status(bits) & mask => Ok(()),
            Some(info) => Err(Verdict::Fail(format!(
                "after {step} the status is 0x{:02X} {}",
                info.status.0, info.status
            ))),
            None => Err(Verdict::Fail(format!("after {step} the board does not answer PC_INFO"))),
        }
    }

    /// Ends or resumes the heartbeats that this PC sends.
    pub(super) fn heartbeats(&self, on: bool) {
        self.link.with(|core| match on {
            true => core.start_session(),
            false => core.session = Session::Quiet,
        });
    }

    /// Starts the application of a board, but does not start its control loop.
    pub(super) async fn started(&mut self, board: u8) -> Result<Result<(), Verdict>, Error> {
        match start_application(self.link, board).await {
            Ok(_) => {}
            Err(e) => return skipped_or(e),
        }
        self.send(Function::Admin, board, &[0; 4]).await;
        self.receive(20 * MS).await;
        Ok(Ok(()))
    }
}

/// Returns a skipped verdict if the board's application cannot start; returns any other error unchanged.
fn skipped_or(e: Error) -> Result<Result<(), Verdict>, Error> {
    match e {
        Error::Exchange(ExchangeError::Device { .. }) | Error::Signal(SignalError::NoApplication { .. }) => {
            Ok(Err(Verdict::Skipped(format!("the application does not start: {e}"))))
        }
        e => Err(e),
    }
}

/// Returns the given frames as text.
pub(super) fn list(frames: &[Frame]) -> String {
    let texts: Vec<String> = frames.iter().take(8).map(ToString::to_string).collect();
    match frames.len() {
        0 => "silence".into(),
        n if n > 8 => format!("{} … ({n} frames)", texts.join(" ")),
        _ => texts.join(" "),
    }
}

/// Returns a passed verdict, or a failed verdict that lists the received frames.
pub(super) fn verdict(pass: bool, came: &[Frame]) -> Verdict {
    if pass { Verdict::Pass } else { Verdict::Fail(list(came)) }
}
