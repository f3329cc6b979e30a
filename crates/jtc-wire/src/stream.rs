//! The stream parser of the device: finds frames in bytes that arrive in pieces of any length, and reports all other
//! bytes (J-03, J-04).
//!
//! A stream is a sequence of *good frames* and *runs* of other bytes. A run begins with a byte that does not begin a
//! good frame. A run ends at the next good frame or at a gap. The parser reports one event for a run, as soon as it
//! knows the fault of the first byte. The parser skips the other bytes of the run without an event. An incomplete frame
//! ends when its last byte arrives, or at a gap. After a gap, the parser scans again from the second byte of the
//! incomplete frame. A false header therefore does not hide the frames that follow it.
//!
//! Terms: a *candidate* is a position with a header, a known type and a length that is valid for this type. A *gap*
//! is a silence of at least the inter-byte timeout after received bytes.
//!
//! Cost: the parser copies each byte once and adds it to the CRC once, when it arrives. The CRC register is stored at
//! every 64th byte. With two of these registers and some arithmetic, the parser can check a candidate of any length.
//! In hostile input full of false headers, the work for each header is constant, and [`Receiver::poll`] scans a
//! bounded number of headers per call.
use crate::crc::advance;
use crate::event::{LinkEvent, ReceivedEvent};
use crate::frame::{FRAME_MAX, FRAME_MIN, FrameRef, FrameType, HEADER, field};
use crate::response::{FrameStatus, Response};

mod registers;

use registers::Registers;

/// Time after an extension request in which the controller assumes that the client of the line knows the extensions, µs (J-51). After this
/// time, the line is *plain*.
pub const KNOWN_US: u64 = 2_000_000;

/// Maximum number of stored gaps among the held bytes.
const GAPS: usize = 64;
/// Maximum work of one call of `poll`. A skipped byte costs 1, and a candidate whose CRC is checked costs `CANDIDATE`.
const BUDGET: usize = 2048;
const CANDIDATE: usize = 128;

/// Stream parser of rule J-03 with a buffer of at least [`FRAME_MAX`] bytes. If the buffer is shorter, the parser refuses frames that do
/// not fit, like frames with a wrong length.
///
/// ```
/// use jtc_wire::{LinkEvent, Receiver};
/// let mut receiver = Receiver::new(vec![0; jtc_wire::FRAME_MAX], 5000);
/// receiver.push(0, &[0x9B, 0x0C, 0x00]);
/// assert!(!receiver.poll(1000));
/// receiver.push(1000, &[0x06, 0xCD, 0x27]);
/// assert!(receiver.poll(1000));
/// let Some(LinkEvent::Frame(frame)) = receiver.event() else { panic!() };
/// assert_eq!(frame.frame_type, jtc_wire::FrameType::TeachingModeEnable);
/// receiver.release();
/// ```
pub struct Receiver<B> {
    buffer: B,
    inter_byte_timeout_us: u64,
    /// Stream position of the first byte of the buffer.
    base: u64,
    /// Range `start..end` of the held bytes in the buffer.
    start: usize,
    end: usize,
    /// Time at which the last byte arrived, µs.
    last_us: u64,
    /// True if the caller still has bytes that `push` has not accepted. While it is true, silence is not a gap on the line.
    refused: bool,
    /// True if there was a gap before the refused bytes.
    gap_before_refused: bool,
    /// True if the bytes from `start` on belong to a run whose event was already reported.
    in_run: bool,
    /// True if the last call of `poll` ended because it reached its work limit.
    busy: bool,
    event: Option<Found>,
    gaps: Gaps,
    registers: Registers,
    /// Stream position of the incomplete frame, and the time at which its first byte was seen, in µs.
    began: (u64, u64),
    /// Time at which the last extension request was completed, in µs.
    asked_us: Option<u64>,
    /// True if the event is a frame that arrived on a plain line.
    plain: bool,
}

#[derive(Clone, Copy)]
enum Found {
    Frame(FrameType, usize),
    /// Fault of a run, and its position in the stream.
    Run(Sort, Response, u64),
}

/// Kind of a run.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sort {
    /// Run that begins like a frame.
    Bad,
    Noise,
}

/// Scan result at the first held byte.
enum ScanResult {
    Frame(FrameType, usize),
    /// The parser cannot decide until more bytes or a gap arrive.
    Wait,
    Run(Sort, Response),
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> Receiver<B> {
    /// Creates a parser. `inter_byte_timeout_us` is the silence that ends a frame, µs (5000).
    pub fn new(buffer: B, inter_byte_timeout_us: u32) -> Self {
        Self {
            buffer,
            inter_byte_timeout_us: inter_byte_timeout_us.into(),
            base: 0,
            start: 0,
            end: 0,
            last_us: 0,
            refused: false,
            gap_before_refused: false,
            in_run: false,
            busy: false,
            event: None,
            gaps: Gaps::new(),
            registers: Registers::new(),
            began: (u64::MAX, 0),
            asked_us: None,
            plain: true,
        }
    }

    /// Returns the maximum number of held bytes.
    fn capacity(&self) -> usize {
        self.buffer.as_ref().len().min(FRAME_MAX)
    }

    /// Accepts bytes that were received until `now_us`, and returns the number of accepted bytes. If the buffer is full, the parser accepts
    /// fewer bytes. The caller must pass the remaining bytes again after `release` or more calls of `poll`. A delay of the remaining bytes
    /// does not count as a gap.
    ///
    /// Call `push` at least once every 2 ms while bytes arrive. If the time between two calls is at least the inter-byte timeout, this time
    /// counts as a gap.
    pub fn push(&mut self, now_us: u64, bytes: &[u8]) -> usize {
        if bytes.is_empty() {
            return 0;
        }
        let gap = if self.refused {
            self.gap_before_refused
        } else {
            now_us.saturating_sub(self.last_us) >= self.inter_byte_timeout_us
        };
        if gap && !self.gaps.mark(self.end) {
            self.refused = true;
            self.gap_before_refused = true;
            return 0;
        }
        if self.capacity() - self.end < bytes.len() {
            self.compact();
        }
        let room = self.capacity() - self.end;
        let taken = &bytes[..room.min(bytes.len())];
        let to = self.end..self.end + taken.len();
        self.buffer.as_mut()[to].copy_from_slice(taken);
        self.registers.absorb(self.end, taken);
        self.end += taken.len();
        self.refused = taken.len() < bytes.len();
        // If there was a gap before these bytes, the list of gaps now contains it.
        self.gap_before_refused = false;
        self.last_us = now_us;
        taken.len()
    }

    /// Scans for the next event with a bounded amount of work. Returns true if `event` returns an event. Call `poll` after `push`, and at
    /// least once per millisecond, so that gaps are detected. If `poll` returns false and [`busy`](Self::busy) is true, the next call
    /// continues the scan.
    pub fn poll(&mut self, now_us: u64) -> bool {
        if !self.refused && now_us.saturating_sub(self.last_us) >= self.inter_byte_timeout_us {
            // If the list of gaps is full, `mark` does not store this gap. The last gap in the list is then already
            // at the last byte, or the loop below removes gaps from the list.
            self.gaps.mark(self.end);
        }
        self.busy = false;
        let mut budget = BUDGET;
        while self.event.is_none() {
            if self.gaps.first() == Some(self.start) {
                self.gaps.pop();
                self.in_run = false;
                continue;
            }
            if self.start == self.end {
                return false;
            }
            let Some(left) = budget.checked_sub(CANDIDATE) else {
                self.busy = true;
                return false;
            };
            match self.scan() {
                ScanResult::Wait => {
                    if self.began.0 != self.base + self.start as u64 {
                        self.began = (self.base + self.start as u64, now_us);
                    }
                    return false;
                }
                ScanResult::Frame(kind, n) => {
                    self.in_run = false;
                    self.judge(kind, now_us);
                    self.event = Some(Found::Frame(kind, n));
                }
                ScanResult::Run(sort, response) => {
                    if !self.in_run {
                        self.in_run = true;
                        self.event = Some(Found::Run(sort, response, self.base + self.start as u64));
                    }
                    budget = left - self.pass_over(left);
                }
            }
        }
        true
    }

    /// Returns the event that was found, until the caller releases the event.
    pub fn event(&self) -> Option<LinkEvent<'_>> {
        Some(match self.event? {
            Found::Frame(frame_type, n) => {
                let bytes = &self.buffer.as_ref()[self.start..self.start + n];
                LinkEvent::Frame(FrameRef { frame_type, bytes })
            }
            Found::Run(Sort::Bad, response, _) => LinkEvent::Bad(response),
            Found::Run(Sort::Noise, response, _) => LinkEvent::Noise(response),
        })
    }

    /// Returns the stream position of the first byte of the event, counted from the first byte that was pushed. With this position the
    /// controller can order the event relative to the urgent commands that an [`UrgentWatch`](crate::UrgentWatch) has found.
    pub fn event_position(&self) -> Option<u64> {
        Some(match self.event? {
            Found::Frame(..) => self.base + self.start as u64,
            Found::Run(_, _, position) => position,
        })
    }

    /// Returns the event in the form that a controller uses, including the line number.
    pub fn received(&self, line: usize) -> Option<ReceivedEvent<'_>> {
        let (event, position) = (self.event()?, self.event_position()?);
        Some(ReceivedEvent { line, position, plain: self.plain, event })
    }

    /// Determines whether the line of a complete frame was plain when the frame began. After an extension request, the line is not plain.
    fn judge(&mut self, kind: FrameType, now_us: u64) {
        let (position, seen_us) = self.began;
        let began_us = if position == self.base + self.start as u64 { seen_us } else { now_us };
        let known = |asked_us: u64| began_us.saturating_sub(asked_us) <= KNOWN_US;
        self.plain = !kind.is_extension() && !self.asked_us.is_some_and(known);
        if kind.is_extension() {
            self.asked_us = Some(now_us);
        }
    }

    /// Discards all held bytes and the event after a loss of bytes. `position` is the stream position of the next
    /// byte. The parser reports the loss as one run that was not completely received (J-04). The bytes before the
    /// next frame belong to this run.
    pub fn restart(&mut self, position: u64) {
        (self.base, self.start, self.end) = (position, 0, 0);
        (self.refused, self.gap_before_refused) = (false, false);
        let lost = Response::bad(0, FrameStatus::DiscontinuousFrame, 0);
        (self.in_run, self.busy) = (true, false);
        self.event = Some(Found::Run(Sort::Noise, lost, position));
        (self.gaps, self.registers) = (Gaps::new(), Registers::new());
    }

    /// Releases the event, so that `poll` can find the next event.
    pub fn release(&mut self) {
        if let Some(Found::Frame(_, n)) = self.event.take() {
            self.start += n;
        }
    }

    /// Returns true if the parser holds bytes that may become a frame.
    pub fn mid_frame(&self) -> bool {
        let frame = match self.event {
            Some(Found::Frame(_, n)) => n,
            _ => 0,
        };
        self.end > self.start + frame
    }

    /// Returns true if the last call of `poll` ended because it reached its work limit. The next call of `poll` can then continue without
    /// new bytes.
    pub fn busy(&self) -> bool {
        self.busy
    }

    /// Scans the bytes at `start` up to the next gap. `start..end` contains at least one byte.
    fn scan(&self) -> ScanResult {
        let closed = self.gaps.first();
        let limit = closed.unwrap_or(self.end);
        let seen = &self.buffer.as_ref()[self.start..limit];
        let run = |sort, kind, status, length: usize| {
            ScanResult::Run(sort, Response::bad(kind, status, length as u16))
        };
        let bad = |kind, status, length| run(Sort::Bad, kind, status, length);
        let incomplete = |kind| match closed {
            Some(_) => bad(kind, FrameStatus::DiscontinuousFrame, seen.len()),
            None => ScanResult::Wait,
        };
        if seen[field::HEADER] != HEADER {
            return run(Sort::Noise, 0, FrameStatus::IncorrectHeader, 0);
        }
        let Some(&byte) = seen.get(field::TYPE) else {
            return match closed {
                // The header is incomplete and has no type byte.
                Some(_) => run(Sort::Noise, 0, FrameStatus::DiscontinuousFrame, seen.len()),
                None => ScanResult::Wait,
            };
        };
        let kind = match FrameType::from_byte(byte) {
            Some(kind) if kind.from_host() => kind,
            _ => return bad(byte, FrameStatus::IncorrectFrameType, 0),
        };
        let Some(&[high, low]) = seen.get(field::LENGTH).and_then(<[u8]>::first_chunk) else {
            return incomplete(byte);
        };
        let n = usize::from(u16::from_be_bytes([high, low]));
        if n < FRAME_MIN || n > self.capacity() {
            return bad(0, FrameStatus::IncorrectHeader, 0);
        }
        if !kind.can_have(n) {
            return bad(byte, FrameStatus::IncorrectFrameType, n);
        }
        if seen.len() < n {
            return incomplete(byte);
        }
        let (from, to) = (self.start, self.start + n);
        if self.register(to) == advance(self.register(from), n) {
            ScanResult::Frame(kind, n)
        } else {
            bad(byte, FrameStatus::IncorrectCrc, n)
        }
    }

    /// Skips the first held byte and at most `most` more bytes, until the next header or gap. Returns the number of skipped bytes after the
    /// first byte.
    fn pass_over(&mut self, most: usize) -> usize {
        self.start += 1;
        let limit = self.gaps.first().unwrap_or(self.end).min(self.start + most);
        let rest = &self.buffer.as_ref()[self.start..limit];
        let passed = rest.iter().position(|byte| *byte == HEADER).unwrap_or(rest.len());
        self.start += passed;
        passed
    }

    /// Returns the CRC register before byte `at` of the buffer.
    fn register(&self, at: usize) -> u16 {
        self.registers.at(at, self.buffer.as_ref())
    }

    /// Moves the held bytes to the front of the buffer.
    fn compact(&mut self) {
        if self.start == 0 {
            return;
        }
        self.registers.shift(self.start, self.buffer.as_ref());
        self.gaps.shift(self.start);
        self.base += self.start as u64;
        self.buffer.as_mut().copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
    }
}

/// Positions of gaps in the buffer, in order.
struct Gaps {
    places: [u16; GAPS],
    count: usize,
}

impl Gaps {
    const fn new() -> Self {
        Self { places: [0; GAPS], count: 0 }
    }

    fn first(&self) -> Option<usize> {
        (self.count > 0).then_some(usize::from(self.places[0]))
    }

    fn pop(&mut self) {
        self.places.copy_within(1.., 0);
        self.count = self.count.saturating_sub(1);
    }

    /// Stores a gap before the byte at `place`. The gaps must be stored in order. Returns false if the list of gaps is full.
    fn mark(&mut self, place: usize) -> bool {
        let place = place as u16;
        if self.places[..self.count].last() == Some(&place) {
            return true;
        }
        let Some(free) = self.places.get_mut(self.count) else { return false };
        *free = place;
        self.count += 1;
        true
    }

    fn shift(&mut self, by: usize) {
        for place in &mut self.places[..self.count] {
            *place -= by as u16;
        }
    }
}

const _: () = assert!(size_of::<Receiver<[u8; FRAME_MAX]>>() <= FRAME_MAX + 2560);
