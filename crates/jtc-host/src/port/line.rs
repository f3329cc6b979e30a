//! The two directions of a serial line, shared by the owner of the port and by the [door](super::door) through which other programs
//! stop the arm.
//!
//! A Stop of another program is written by the thread of the door, whatever the owner is busy with. It goes between two frames: a long
//! frame that is half written is given up, and a gap on the line tells the controller so (J-03). From then on frames that move the arm and
//! were requested before the Stop are not written any more.

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

/// Longest time in which a write finds no room.
const STALL: Duration = Duration::from_secs(5);
/// Bytes that are handed over at once. A stalled line is noticed, and a Stop waits for no more than these.
const CHUNK: usize = 256;
/// Gap on the line after a frame that was given up: the 5 ms of J-03, and what adapters may take off it.
const GAP: Duration = Duration::from_millis(8);
/// A frame of which no further piece came for this time after its last byte is not continued.
const PIECE: Duration = Duration::from_millis(50);
/// Time for the record of a Stop, beyond three statuses on the line.
const AWAITED: Duration = Duration::from_millis(150);
/// Number of times that a Stop is written before it counts as not confirmed.
const TRIES: u32 = 8;
/// A frame whose record did not come for this time has none.
const RECORD_TIME: Duration = Duration::from_secs(1);
/// Time after another program's Stop in which no motion can be requested, as with an agent.
const CALM: Duration = Duration::from_secs(3);
/// A status or a jog of this age still describes the arm.
const RECENT: Duration = Duration::from_millis(300);
/// Time after which a Stop, or the end of teaching, is written again while statuses do not show it.
const AGAIN: Duration = Duration::from_millis(200);
/// Longest time in which a stopped arm comes to rest.
const REST: Duration = Duration::from_secs(5);
/// Bytes that are kept for an owner that does not read.
const KEPT: usize = 1 << 16;

/// The outcome of another program's Stop or Pause.
#[derive(Clone, Copy, Debug)]
pub struct HaltOutcome {
    /// The controller accepted it.
    pub accepted: bool,
    /// The arm moved when it came.
    pub moved: bool,
    /// The last status.
    pub status: Status,
}

/// The line of one port.
pub struct Line {
    pub path: String,
    pub baud: u32,
    pub start: Instant,
    output: Mutex<Output>,
    /// Stops that wait for the output: the owner's next piece waits for them.
    urgent: AtomicUsize,
    /// Stops and Pauses of other programs, and those of them that are Stops. They change with `Output::halted`.
    halts: AtomicU64,
    stops: AtomicU64,
    /// One Stop is written and confirmed after the other.
    turn: Mutex<()>,
    input: Mutex<Input>,
    seen: Mutex<Seen>,
    news: Condvar,
    closing: AtomicBool,
}

struct Output {
    port: Box<dyn serialport::SerialPort>,
    timeout: Option<Duration>,
    /// Bytes that are still to come of the frame that is being written.
    rest: usize,
    /// When the line will have carried everything that was written.
    free_at: Instant,
    /// The frame that was being written was given up for a Stop.
    given_up: bool,
    /// The last Stop or Pause of another program, until the owner requests a motion anew.
    halted: Option<Halted>,
    /// When the owner jogged last.
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
    /// Bytes that the owner has not read yet.
    pending: VecDeque<u8>,
}

/// Facts from the statuses that came in, whoever read them.
#[derive(Default)]
struct Seen {
    status: Option<(Instant, Status)>,
    /// When the last status of a moving arm was read.
    moved_at: Option<Instant>,
    statuses: u64,
    damaged: u64,
    /// The owner has switched teaching on, and no record says that it is off again.
    teaching: bool,
    /// Frames Execute, Pause and Stop without a record, oldest first, with the number of those that the door wrote.
    written: VecDeque<(Instant, Option<u64>)>,
    numbers: u64,
    answered: VecDeque<(u64, Response)>,
}

/// Counts while it lives, also when its thread panics.
pub(super) struct Counted<'a>(&'a AtomicUsize);

impl<'a> Counted<'a> {
    pub fn new(counter: &'a AtomicUsize) -> Self {
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
    /// The line of an open port.
    pub fn new(path: &str, baud: u32, port: Box<dyn serialport::SerialPort>) -> Result<Self, PortError> {
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

    /// Reads for the owner.
    pub fn read(&self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
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

    /// Writes for the owner: a frame, or a piece of one.
    pub fn write_all(&self, bytes: &[u8]) -> Result<(), PortError> {
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

    /// Number of Stops and Pauses of other programs so far. It waits for nothing.
    pub fn halts(&self) -> Halts {
        // A Stop counts in `halts` first: so no Stop is seen here without its number.
        let stops = self.stops.load(Ordering::SeqCst);
        Halts { all: self.halts.load(Ordering::SeqCst), stops }
    }

    /// The owner sends a motion from now on that was requested after so many halts. The gate opens unless another halt came since, or the
    /// last one has just come.
    pub fn ask_to_move(&self, after: u64) {
        self.open_gate(after, |_| true);
    }

    /// Like `ask_to_move`, to resume a paused motion. No motion goes on after a Stop.
    pub fn ask_to_resume(&self, after: u64) {
        self.open_gate(after, |halt| halt == Halt::Pause);
    }

    fn open_gate(&self, after: u64, opens: impl Fn(Halt) -> bool) {
        let mut output = lock(&self.output);
        let over = |halted: &mut Halted| opens(halted.halt) && halted.at.elapsed() >= CALM;
        if after == self.halts.load(Ordering::SeqCst) && output.halted.take_if(over).is_some() {
            output.given_up = false;
        }
    }

    /// The owner closes the port: nobody waits any more.
    pub fn close(&self) {
        self.closing.store(true, Ordering::SeqCst);
        self.news.notify_all();
    }

    /// The owner closes the port.
    pub fn is_closing(&self) -> bool {
        self.closing.load(Ordering::SeqCst)
    }

    /// Writes another program's Stop or Pause, again until the controller has received it. `None`: it is not confirmed. An owner that
    /// closes the port meanwhile waits for that: it ends because of the Stop.
    pub fn halt(&self, halt: Halt, by: &str) -> Result<Option<HaltOutcome>, PortError> {
        match self.write_halt(halt, by) {
            // A Pause after a Stop is not written: there is nothing to pause.
            Err(PortError::Halted { .. }) => {
                let status = lock(&self.seen).status.map(|(_, status)| status);
                Ok(status.map(|status| HaltOutcome { accepted: false, moved: false, status }))
            }
            done => done,
        }
    }

    fn write_halt(&self, halt: Halt, by: &str) -> Result<Option<HaltOutcome>, PortError> {
        let (begin, mut jogged) = (Instant::now(), false);
        // First of all nothing that moves the arm passes any more.
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
        // An arm that is taught is loose, and a Stop holds it.
        let taught = status.is_some_and(|status| status.state == ControllerState::Teaching);
        if halt == Halt::Stop && (taught || lock(&self.seen).teaching) {
            self.write_urgent(&fixed::TEACHING_MODE_DISABLE, false)?;
        }
        Ok(record.zip(status).map(|(record, status)| HaltOutcome {
            accepted: record.data == DataStatus::NoError,
            // An owner that does not read leaves old statuses for now.
            moved: moved || taught || self.moved_since(begin),
            status,
        }))
    }

    /// Waits until the arm stands: the last status, and whether it stands.
    pub fn wait_for_rest(&self, halt: Halt) -> Option<(Status, Standstill)> {
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
                    // A line that takes nothing more shows as an arm that does not stand.
                    let _ = self.insist(&status);
                }
                standstill.see(at.duration_since(self.start), &status);
                // Teaching that was requested may begin as soon as the arm rests.
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

    /// Writes again what a Stop brings about and statuses do not show: the end of teaching, and a Stop where the Pause of another sender came
    /// after it.
    fn insist(&self, status: &Status) -> Result<(), PortError> {
        if status.state == ControllerState::Teaching || lock(&self.seen).teaching {
            self.write_urgent(&fixed::TEACHING_MODE_DISABLE, false)?;
        }
        if is_paused(status) {
            self.write_urgent(&fixed::STOP, true)?;
        }
        Ok(())
    }

    /// A status of a moving arm was read since then.
    fn moved_since(&self, time: Instant) -> bool {
        lock(&self.seen).moved_at.is_some_and(|at| at >= time)
    }

    /// The record of a Stop that was written with a number from `first` on.
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

    /// Waits for the next status. An owner that does not read is no hindrance: then this reads for it.
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
            // The owner meets the error when it reads.
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

    /// The owner begins a frame with these bytes, or goes on with one.
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
            // An upload leads to a motion.
            || is(FrameType::Trajectory);
        // A Pause in the deceleration of a Stop would leave a motion that can be resumed.
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

    /// Writes a frame ahead of the rest of what the owner writes.
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

    /// Does something with the output before the owner writes its next piece.
    fn urgently(&self, work: impl FnOnce(&mut Output) -> Result<(), PortError>) -> Result<(), PortError> {
        let _counted = Counted::new(&self.urgent);
        work(&mut lock(&self.output))
    }

    /// A lock is not handed over in turn: the owner waits for Stops that wait for it. They take as long as one short write.
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
    /// The arm may still be coming to rest after a Stop.
    fn is_stopped(&self) -> bool {
        self.halted.as_ref().is_some_and(|halted| halted.halt == Halt::Stop && halted.at.elapsed() < REST)
    }

    fn refusal(&self) -> PortError {
        PortError::Halted { by: self.halted.as_ref().map(|halted| halted.by.clone()) }
    }
}

impl Seen {
    /// A frame Execute, Pause or Stop is written now.
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

    /// Frames whose record does not come any more, and records that nobody waits for.
    fn forget(&mut self) {
        self.written.retain(|(at, _)| at.elapsed() < RECORD_TIME);
        let excess = self.answered.len().saturating_sub(16);
        self.answered.drain(..excess);
    }
}
