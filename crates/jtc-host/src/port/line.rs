//! Serial line to the controller, for sending and receiving. The *port owner* is the code of this program that opened
//! the port. The thread of the [door](super::door), through which other programs stop the arm, also uses the line.
//!
//! The thread of the door writes the Stop of another program even while the port owner is busy. This Stop is written
//! between two frames of the port owner. If a long frame is only partly written, the remainder of the frame is not
//! sent. A gap on the line then causes the controller to discard the incomplete frame (J-03). After the Stop, the
//! line does not write frames of a motion that was requested before the Stop.

use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use jtc_wire::{
    ControllerState, DataStatus, FrameRef, FrameStatus, FrameType, FromDevice, Response, STATUS_LEN, Status,
    StatusReceiver, fixed,
};

use super::halt::Halt;
use super::standstill::{Standstill, is_moving, is_paused};
use super::{Halts, PortError, line_time};

/// Timeout for a write if the line accepts no byte.
const STALL: Duration = Duration::from_secs(5);
/// Maximum number of bytes per write. Small writes shorten two delays: until a stalled line is detected, and until a
/// Stop can be written.
const CHUNK: usize = 256;
/// Gap on the line after a frame that was not completed. The controller needs a gap of 5 ms (J-03). The rest is a
/// reserve, because some adapters shorten gaps.
const GAP: Duration = Duration::from_millis(8);
/// Maximum time between two pieces of one frame. If more time has passed, the next bytes count as a new frame.
const PIECE: Duration = Duration::from_millis(50);
/// Timeout for the response record of a Stop, in addition to the transmission time of three status frames.
const AWAITED: Duration = Duration::from_millis(150);
/// Maximum number of times that a Stop is written. If the controller confirms none of them, the Stop has failed.
const TRIES: u32 = 8;
/// Timeout for the response record of a frame.
const RECORD_TIME: Duration = Duration::from_secs(1);
/// After a Stop of another program, motion requests are rejected for this time. An agent rejects motion requests for
/// the same time.
const CALM: Duration = Duration::from_secs(3);
/// Maximum age of a status or a jog. Older ones do not describe the current state of the arm.
const RECENT: Duration = Duration::from_millis(300);
/// Interval at which a frame is repeated until the status frames show its effect. The repeated frames are Stops and
/// the frames that end teaching.
const AGAIN: Duration = Duration::from_millis(200);
/// Maximum time in which an arm comes to rest after a Stop.
const REST: Duration = Duration::from_secs(5);
/// Maximum number of received bytes that are stored while the port owner does not read.
const KEPT: usize = 1 << 16;

/// Result of a Stop or Pause from another program.
#[derive(Clone, Copy, Debug)]
pub(super) struct HaltOutcome {
    /// `true` if the controller accepted the command.
    pub accepted: bool,
    /// `true` if the arm moved when the command arrived.
    pub moved: bool,
    /// Last status.
    pub status: Status,
}

/// Serial line of one port.
pub(super) struct Line {
    pub path: String,
    pub baud: u32,
    pub start: Instant,
    output: Mutex<Output>,
    /// Number of Stops that wait for access to the output. These Stops are written before the next piece of the port
    /// owner's frame.
    urgent: AtomicUsize,
    /// Number of Stops and Pauses of other programs. `stops` counts only the Stops. Both numbers change together with
    /// `Output::halted`.
    halts: AtomicU64,
    stops: AtomicU64,
    /// Lock that is held until a Stop is written and confirmed, so that only one Stop is executed at a time.
    turn: Mutex<()>,
    input: Mutex<Input>,
    seen: Mutex<Seen>,
    news: Condvar,
    closing: AtomicBool,
}

struct Output {
    port: Box<dyn serialport::SerialPort>,
    timeout: Option<Duration>,
    /// Remaining bytes of the frame that is being written.
    rest: usize,
    /// Time at which the line will have transmitted all written bytes.
    free_at: Instant,
    /// `true` if the current frame was aborted because of a Stop.
    given_up: bool,
    /// Last Stop or Pause from another program. This Stop or Pause blocks motion frames until the next motion request
    /// of the port owner.
    halted: Option<Halted>,
    /// Time of the last jog that the port owner sent.
    jogged: Option<Instant>,
}

struct Halted {
    halt: Halt,
    by: String,
    at: Instant,
}

struct Input {
    port: Box<dyn serialport::SerialPort>,
    timeout: Option<Duration>,
    receiver: StatusReceiver,
    /// Received bytes that the port owner has not read yet.
    pending: VecDeque<u8>,
}

/// Data from all received status frames. The frames are read by the thread of the port owner, or by the thread of the
/// door.
#[derive(Default)]
struct Seen {
    status: Option<(Instant, Status)>,
    /// Time at which the last status that showed a moving arm was read.
    moved_at: Option<Instant>,
    statuses: u64,
    damaged: u64,
    /// `true` if the port owner has switched on teaching, and no response record has confirmed since then that
    /// teaching is off.
    teaching: bool,
    /// Execute, Pause and Stop frames that have no response record yet, oldest first. A frame that the door wrote has
    /// a number.
    written: VecDeque<(Instant, Option<u64>)>,
    numbers: u64,
    answered: VecDeque<(u64, Response)>,
}

/// Guard that increments a counter until it is dropped, even if the thread panics.
pub(super) struct Counted<'a>(&'a AtomicUsize);

impl<'a> Counted<'a> {
    pub(super) fn new(counter: &'a AtomicUsize) -> Self {
        counter.fetch_add(1, Ordering::SeqCst);
        Self(counter)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn nothing_yet(e: &io::Error) -> bool {
    matches!(e.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl Line {
    /// Creates the line of an open port.
    pub(super) fn new(
        path: &str,
        baud: u32,
        port: Box<dyn serialport::SerialPort>,
    ) -> Result<Self, PortError> {
        let start = Instant::now();
        let reading = port.try_clone().map_err(|e| PortError::io(path, e.into()))?;
        Ok(Self {
            path: path.to_owned(),
            baud,
            start,
            output: Mutex::new(Output {
                port,
                timeout: None,
                rest: 0,
                free_at: start,
                given_up: false,
                halted: None,
                jogged: None,
            }),
            urgent: AtomicUsize::new(0),
            halts: AtomicU64::new(0),
            stops: AtomicU64::new(0),
            turn: Mutex::new(()),
            input: Mutex::new(Input {
                port: reading,
                timeout: None,
                receiver: StatusReceiver::new(),
                pending: VecDeque::new(),
            }),
            seen: Mutex::default(),
            news: Condvar::new(),
            closing: AtomicBool::new(false),
        })
    }

    /// Reads bytes from the line for the owner of the port.
    pub(super) fn read(&self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let mut input = lock(&self.input);
        if input.pending.is_empty() {
            self.receive(&mut input, timeout)?;
        }
        let n = buffer.len().min(input.pending.len());
        for (slot, byte) in buffer.iter_mut().zip(input.pending.drain(..n)) {
            *slot = byte;
        }
        Ok(n)
    }

    /// Writes a frame, or a piece of a frame, for the owner of the port.
    pub(super) fn write_all(&self, bytes: &[u8]) -> Result<(), PortError> {
        for (i, piece) in bytes.chunks(CHUNK).enumerate() {
            self.let_urgent_pass();
            let mut output = lock(&self.output);
            if i == 0 {
                self.begin(&mut output, bytes)?;
            } else if output.given_up {
                return Err(output.refusal());
            }
            self.put(&mut output, piece)?;
        }
        Ok(())
    }

    /// Returns the number of Stops and Pauses of other programs so far, without waiting.
    pub(super) fn halts(&self) -> Halts {
        // `halts` is incremented before `stops`, so every Stop counted here is also included in `halts`.
        let stops = self.stops.load(Ordering::SeqCst);
        Halts { all: self.halts.load(Ordering::SeqCst), stops }
    }

    /// Permits the frames of a motion. `after` is the number of Stops and Pauses at the time of the motion request.
    /// The frames stay blocked in two cases: another Stop or Pause has arrived since the request, or the last one is
    /// less than 3 s old.
    pub(super) fn ask_to_move(&self, after: u64) {
        self.open_gate(after, |_| true);
    }

    /// Like `ask_to_move`, for resuming a paused motion. A motion cannot be resumed after a Stop.
    pub(super) fn ask_to_resume(&self, after: u64) {
        self.open_gate(after, |halt| halt == Halt::Pause);
    }

    fn open_gate(&self, after: u64, opens: impl Fn(Halt) -> bool) {
        let mut output = lock(&self.output);
        let over = |halted: &mut Halted| opens(halted.halt) && halted.at.elapsed() >= CALM;
        if after == self.halts.load(Ordering::SeqCst) && output.halted.take_if(over).is_some() {
            output.given_up = false;
        }
    }

    /// Marks the port as closing and ends all waiting calls.
    pub(super) fn close(&self) {
        self.closing.store(true, Ordering::SeqCst);
        self.news.notify_all();
    }

    /// Returns `true` if the port is being closed.
    pub(super) fn is_closing(&self) -> bool {
        self.closing.load(Ordering::SeqCst)
    }

    /// Writes the Stop or Pause of another program, and repeats the frame until the controller has received it.
    /// Returns `None` if the controller does not confirm the command. A program that closes the port waits for this
    /// function, because the Stop may be the reason why the program ends.
    pub(super) fn halt(&self, halt: Halt, by: &str) -> Result<Option<HaltOutcome>, PortError> {
        match self.write_halt(halt, by) {
            // No Pause is written after a Stop, because a stopped motion cannot be paused.
            Err(PortError::Halted { .. }) => {
                let status = lock(&self.seen).status.map(|(_, status)| status);
                Ok(status.map(|status| HaltOutcome { accepted: false, moved: false, status }))
            }
            done => done,
        }
    }

    fn write_halt(&self, halt: Halt, by: &str) -> Result<Option<HaltOutcome>, PortError> {
        let (begin, mut jogged) = (Instant::now(), false);
        // The frames of the port owner that move the arm are blocked first.
        self.urgently(|output| {
            if halt == Halt::Pause && output.is_stopped() {
                return Err(output.refusal());
            }
            output.halted = Some(Halted { halt, by: by.to_owned(), at: Instant::now() });
            self.halts.fetch_add(1, Ordering::SeqCst);
            if halt == Halt::Stop {
                self.stops.fetch_add(1, Ordering::SeqCst);
            }
            jogged = output.jogged.is_some_and(|at| at.elapsed() < RECENT);
            Ok(())
        })?;
        let _turn = lock(&self.turn);
        let moved = jogged || self.moved_since(begin.checked_sub(RECENT).unwrap_or(begin));
        let first = lock(&self.seen).numbers;
        let mut record = None;
        for _ in 0..TRIES {
            self.write_urgent(&fixed::exec(halt.command()), true)?;
            record = self.record_since(first);
            if record.is_some() {
                break;
            }
        }
        let status = lock(&self.seen).status.map(|(_, status)| status);
        // In teaching the arm is compliant. After a Stop, the arm must hold its position.
        let taught = status.is_some_and(|status| status.state == ControllerState::Teaching);
        if halt == Halt::Stop && (taught || lock(&self.seen).teaching) {
            self.write_urgent(&fixed::TEACHING_MODE_DISABLE, false)?;
        }
        Ok(record.zip(status).map(|(record, status)| HaltOutcome {
            accepted: record.data == DataStatus::NoError,
            // After a time in which the port owner did not read, the first status frames are old and may not show the
            // motion. Therefore the motion that earlier status frames showed also counts.
            moved: moved || taught || self.moved_since(begin),
            status,
        }))
    }

    /// Waits until the arm is at rest, but at most 5 s. Returns the last status and the evaluation of the standstill.
    pub(super) fn wait_for_rest(&self, halt: Halt) -> Option<(Status, Standstill)> {
        let (end, mut standstill, mut count) = (Instant::now() + REST, Standstill::after(halt), None);
        let mut written_at = Instant::now();
        while Instant::now() < end && !self.is_closing() {
            let (statuses, status) = {
                let seen = lock(&self.seen);
                (seen.statuses, seen.status)
            };
            if let Some((at, status)) = status
                && count.replace(statuses) != Some(statuses)
            {
                if halt == Halt::Stop && written_at.elapsed() >= AGAIN {
                    written_at = Instant::now();
                    // A write error is ignored here: if the frame does not arrive, the status frames show that the
                    // arm is not at rest.
                    let _ = self.insist(&status);
                }
                standstill.see(at.duration_since(self.start), &status);
                // Teaching that was requested before the Stop may begin as soon as the arm is at rest. The arm does
                // not count as at rest until the end of this teaching is confirmed.
                if lock(&self.seen).teaching && halt == Halt::Stop {
                    standstill.begin_again();
                }
                if standstill.is_reached() {
                    return Some((status, standstill));
                }
            }
            self.look();
        }
        let status = lock(&self.seen).status.filter(|_| !self.is_closing());
        status.map(|(_, status)| (status, standstill))
    }

    /// Repeats the frames of a Stop that has not yet taken full effect according to the status frames. If teaching is
    /// on or may still begin, the function ends teaching again. If another sender's Pause arrived after the Stop, the
    /// function sends the Stop again.
    fn insist(&self, status: &Status) -> Result<(), PortError> {
        if status.state == ControllerState::Teaching || lock(&self.seen).teaching {
            self.write_urgent(&fixed::TEACHING_MODE_DISABLE, false)?;
        }
        if is_paused(status) {
            self.write_urgent(&fixed::STOP, true)?;
        }
        Ok(())
    }

    /// Returns `true` if a status of a moving arm was read since `time`.
    fn moved_since(&self, time: Instant) -> bool {
        lock(&self.seen).moved_at.is_some_and(|at| at >= time)
    }

    /// Waits for the response record of a Stop whose number is at least `first`. Returns `None` if the response
    /// record does not arrive in time.
    fn record_since(&self, first: u64) -> Option<Response> {
        let queued = lock(&self.output).free_at.saturating_duration_since(Instant::now());
        let end = Instant::now() + queued + AWAITED + line_time(3 * STATUS_LEN, Some(self.baud));
        let damaged = lock(&self.seen).damaged;
        loop {
            {
                let mut seen = lock(&self.seen);
                while let Some((number, record)) = seen.answered.pop_front() {
                    if number >= first {
                        return Some(record);
                    }
                }
                if seen.damaged != damaged || Instant::now() >= end {
                    return None;
                }
            }
            self.look();
        }
    }

    /// Waits for the next status frame. If the port owner does not read from the line, this function reads.
    fn look(&self) {
        let seen = lock(&self.seen);
        let before = seen.statuses;
        let wait = Duration::from_millis(100);
        let nothing_new = |seen: &mut Seen| seen.statuses == before;
        let waited = self.news.wait_timeout_while(seen, wait, nothing_new);
        if !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out() {
            return;
        }
        if let Ok(mut input) = self.input.try_lock() {
            // An error is ignored here, because the port owner receives the error at its next read.
            let _ = self.receive(&mut input, Duration::from_millis(20));
        }
    }

    fn receive(&self, input: &mut Input, timeout: Duration) -> Result<(), PortError> {
        let failed = |e: io::Error| PortError::io(&self.path, e);
        if input.timeout != Some(timeout) {
            input.port.set_timeout(timeout).map_err(|e| failed(e.into()))?;
            input.timeout = Some(timeout);
        }
        let mut buffer = [0; 4096];
        let n = match io::Read::read(&mut input.port, &mut buffer) {
            Ok(n) => n,
            Err(e) if nothing_yet(&e) => return Ok(()),
            Err(e) => return Err(failed(e)),
        };
        let (mut rest, mut seen) = (&buffer[..n], lock(&self.seen));
        input.pending.extend(rest);
        let excess = input.pending.len().saturating_sub(KEPT);
        input.pending.drain(..excess);
        while let Some(frame) = input.receiver.next_frame(&mut rest) {
            if let FromDevice::Status(status) = frame {
                seen.take(status);
                self.news.notify_all();
            }
        }
        Ok(())
    }

    /// Checks a new frame, or the next piece of a frame, before the port owner writes it. Returns an error if the
    /// frame is blocked because of a Stop or Pause.
    fn begin(&self, output: &mut Output, bytes: &[u8]) -> Result<(), PortError> {
        let whole = FrameRef::new_checked(bytes).is_some();
        if !whole && output.given_up {
            return Err(output.refusal());
        }
        if !whole && output.rest > 0 && Instant::now() < output.free_at + PIECE {
            return Ok(());
        }
        output.given_up = false;
        let (kind, length) = match bytes {
            [jtc_wire::HEADER, kind, high, low, ..] => {
                (*kind, usize::from(u16::from_be_bytes([*high, *low])))
            }
            _ => (0, 0),
        };
        let is = |frame_type: FrameType| kind == frame_type as u8;
        let jogs = is(FrameType::Jog)
            && FrameRef::new_checked(bytes).is_some_and(|f| f.body().iter().any(|b| *b != 0));
        let moves = jogs
            || bytes == fixed::EXECUTE
            || is(FrameType::TeachingModeEnable)
            // An upload prepares a motion, so upload frames are checked like frames that move the arm.
            || is(FrameType::Trajectory);
        // While an older controller decelerates after a Stop, it still accepts a Pause. The motion could then be
        // resumed, although it was stopped. Therefore a Pause is rejected after a Stop.
        let weakens = bytes == fixed::PAUSE && output.is_stopped();
        if (moves && output.halted.is_some()) || weakens {
            return Err(output.refusal());
        }
        if jogs {
            output.jogged = Some(Instant::now());
        }
        if is(FrameType::TeachingModeEnable) {
            lock(&self.seen).teaching = true;
        }
        if is(FrameType::TrajSetExecStatus) {
            lock(&self.seen).write(None);
        }
        output.rest = length;
        Ok(())
    }

    /// Writes a frame before the next bytes of the port owner.
    fn write_urgent(&self, frame: &[u8], has_number: bool) -> Result<(), PortError> {
        self.urgently(|output| {
            if frame == fixed::PAUSE && output.is_stopped() {
                return Err(output.refusal());
            }
            if output.rest > 0 {
                (output.rest, output.given_up) = (0, true);
                std::thread::sleep((output.free_at + GAP).saturating_duration_since(Instant::now()));
            }
            if has_number {
                let mut seen = lock(&self.seen);
                let number = seen.numbers;
                seen.numbers += 1;
                seen.write(Some(number));
            }
            self.put(output, frame)
        })
    }

    /// Calls `work` with the output before the port owner writes its next piece of a frame.
    fn urgently(&self, work: impl FnOnce(&mut Output) -> Result<(), PortError>) -> Result<(), PortError> {
        let _counted = Counted::new(&self.urgent);
        work(&mut lock(&self.output))
    }

    /// Waits until all pending Stops are written. A mutex alone does not guarantee that a Stop gets access before the
    /// next piece of a frame. The transmission of a Stop takes only a short time.
    fn let_urgent_pass(&self) {
        let end = Instant::now() + STALL;
        while self.urgent.load(Ordering::SeqCst) > 0 && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn put(&self, output: &mut Output, bytes: &[u8]) -> Result<(), PortError> {
        if output.timeout != Some(STALL) {
            output.port.set_timeout(STALL).map_err(|e| PortError::io(&self.path, e.into()))?;
            output.timeout = Some(STALL);
        }
        let mut rest = bytes;
        while !rest.is_empty() {
            match io::Write::write(&mut output.port, rest) {
                Ok(0) => return Err(PortError::Gone { path: self.path.clone() }),
                Ok(n) => rest = &rest[n..],
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) if nothing_yet(&e) => {
                    return Err(PortError::Stalled { path: self.path.clone(), seconds: STALL.as_secs_f64() });
                }
                Err(e) => return Err(PortError::io(&self.path, e)),
            }
        }
        output.rest = output.rest.saturating_sub(bytes.len());
        output.free_at = output.free_at.max(Instant::now()) + line_time(bytes.len(), Some(self.baud));
        Ok(())
    }
}

impl Output {
    /// Returns `true` if the arm may still be decelerating after a Stop.
    fn is_stopped(&self) -> bool {
        self.halted.as_ref().is_some_and(|halted| halted.halt == Halt::Stop && halted.at.elapsed() < REST)
    }

    fn refusal(&self) -> PortError {
        PortError::Halted { by: self.halted.as_ref().map(|halted| halted.by.clone()) }
    }
}

impl Seen {
    /// Adds an Execute, Pause or Stop frame to the list of frames that wait for a response record.
    fn write(&mut self, number: Option<u64>) {
        self.forget();
        self.written.push_back((Instant::now(), number));
    }

    fn take(&mut self, status: Status) {
        self.forget();
        let response = status.response;
        self.statuses += 1;
        self.status = Some((Instant::now(), status));
        if is_moving(&status) {
            self.moved_at = Some(Instant::now());
        }
        match response.status {
            FrameStatus::Idle => {}
            FrameStatus::NoError if response.frame_type == FrameType::TrajSetExecStatus as u8 => {
                if let Some((_, Some(number))) = self.written.pop_front() {
                    self.answered.push_back((number, response));
                }
            }
            FrameStatus::NoError if response.frame_type == FrameType::TeachingModeDisable as u8 => {
                self.teaching = false;
            }
            FrameStatus::NoError => {}
            _ => self.damaged += 1,
        }
    }

    /// Removes frames whose response record is overdue, and response records that no thread has fetched.
    fn forget(&mut self) {
        self.written.retain(|(at, _)| at.elapsed() < RECORD_TIME);
        let excess = self.answered.len().saturating_sub(16);
        self.answered.drain(..excess);
    }
}
