//! The links, which convert received bytes to frames. Each serial line has its own parser. The link loop passes the
//! events of the parsers to the tick in batches, through one slot.
//!
//! A batch is a copy of the events. Therefore a parser can accept more bytes while the controller executes a long
//! frame over several ticks. If bytes arrive faster than the tick executes frames, first the buffer of the parser
//! becomes full, then the DMA ring. When the ring is full, bytes are lost. Stop and Pause are not lost, because the
//! tick itself searches the received bytes for these commands.
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use embassy_time::{Duration, Instant};
use jtc_wire::{EventBatch, FRAME_MAX, ReceivedEvent, Receiver};
use openjtc_firmware::{BAUD, lines};

use crate::arm_store::Store;
use crate::program;
use crate::summary::{self, Summary};
use crate::uart;

/// Inter-byte timeout, µs. A frame ends if the line is silent for this time (J-03).
pub const INTER_BYTE_TIMEOUT_US: u32 = 5_000;
/// Largest number of bytes that the link loop passes to a parser in one call.
const CHUNK: usize = 1024;
/// Largest number of passes of the link loop before the loop waits for the next tick.
const ROUNDS: usize = 64;
/// Largest number of bytes that DMA may have written and the link loop has not read yet. DMA overwrites bytes that
/// are older than the length of the ring, and DMA continues while the link loop reads.
const BEHIND: u32 = (uart::RING - 4 * CHUNK) as u32;

/// Number of wake-ups of the link loop. The tick reads this number to detect that the link loop has stopped.
pub static ROUNDS_DONE: AtomicU32 = AtomicU32::new(0);

/// Number of bytes that each line had received at the last tick, modulo 2³².
pub static RECEIVED: [AtomicU32; lines::LINES] = [const { AtomicU32::new(0) }; lines::LINES];

/// A cell through which the link loop and the tick pass the slot to each other. Only the side that owns the reference
/// may use the slot.
type Place = Mutex<Cell<Option<&'static mut EventBatch>>>;
static FULL: Place = Mutex::new(Cell::new(None));
static EMPTY: Place = Mutex::new(Cell::new(None));

/// The side of the slot that belongs to the link loop, with the batch that the loop fills.
pub struct SlotIn(Option<&'static mut EventBatch>);

/// The side of the slot that belongs to the tick, with the batch that the tick executes.
pub struct SlotOut(Option<&'static mut EventBatch>);

/// Creates both sides of the slot. The slot is empty at first.
pub fn slot(memory: &'static mut EventBatch) -> (SlotIn, SlotOut) {
    critical_section::with(|cs| EMPTY.borrow(cs).set(Some(memory)));
    (SlotIn(None), SlotOut(None))
}

impl SlotIn {
    /// Adds an event to the batch. Returns `false` if the tick owns the batch, or if the batch is full.
    fn push(&mut self, received: &ReceivedEvent<'_>) -> bool {
        if self.0.is_none() {
            self.0 = critical_section::with(|cs| EMPTY.borrow(cs).take());
        }
        self.0.as_mut().is_some_and(|batch| batch.push(received))
    }

    /// Passes the batch to the tick if the batch contains an event.
    fn send(&mut self) {
        if let Some(batch) = self.0.take_if(|batch| !batch.is_empty()) {
            critical_section::with(|cs| FULL.borrow(cs).set(Some(batch)));
        }
    }
}

impl SlotOut {
    /// Returns the current batch. If all events of the last batch are processed, takes the next batch from the link
    /// loop. Returns `None` if no batch is waiting.
    pub fn batch(&mut self) -> Option<&EventBatch> {
        if self.0.is_none() {
            self.0 = critical_section::with(|cs| FULL.borrow(cs).take());
        }
        self.0.as_deref()
    }

    /// Marks the oldest `count` events of the batch as processed.
    pub fn done(&mut self, count: usize) {
        if let Some(batch) = &mut self.0 {
            batch.done(count);
        }
        if let Some(batch) = self.0.take_if(|batch| batch.is_empty()) {
            critical_section::with(|cs| EMPTY.borrow(cs).set(Some(batch)));
        }
    }
}

/// Link of a serial line, with the parser of the line.
pub struct Link {
    line: usize,
    uart: uart::Receiver,
    parser: Receiver<&'static mut [u8]>,
    /// Number of bytes taken from the line, including lost bytes.
    taken: u64,
    /// Number of received bytes that were lost.
    lost: u64,
    /// Time at which the DMA ring was last checked, µs.
    looked_us: u64,
    /// Number of bytes that were in the DMA ring at the last check.
    left: usize,
}

impl Link {
    /// Creates the link of `line`, whose bytes `uart` receives.
    pub fn new(line: usize, uart: uart::Receiver, buffer: &'static mut [u8; FRAME_MAX]) -> Self {
        let parser = Receiver::new(&mut buffer[..], INTER_BYTE_TIMEOUT_US);
        Self { line, uart, parser, taken: 0, lost: 0, looked_us: 0, left: 0 }
    }

    /// Takes the received bytes out of the DMA ring and searches them for an event. Returns `true` if this function
    /// must be called again at once.
    fn receive(&mut self) -> bool {
        // The clock is read before the bytes. Otherwise, a byte could arrive between the two reads, and the measured
        // silence before this byte would be too long.
        let now = Instant::now().as_micros();
        self.catch_up();
        let waiting = self.uart.waiting();
        let new = waiting.saturating_sub(self.left);
        if new > 0 && self.left == 0 {
            self.begin(now, new);
        }
        let mut chunk = [0; CHUNK];
        let bytes = self.uart.peek(&mut chunk);
        let taken = self.parser.push(now, bytes);
        self.take(taken);
        self.left = self.uart.waiting().min(waiting.saturating_sub(taken));
        self.looked_us = now;
        let found = self.parser.poll(now);
        (taken > 0 && self.left > 0) || (!found && self.parser.busy())
    }

    fn take(&mut self, count: usize) {
        self.uart.take(count);
        self.taken += count as u64;
    }

    /// Drops all waiting bytes if DMA may have overwritten some of them.
    fn catch_up(&mut self) {
        let received = RECEIVED[self.line].load(Ordering::Relaxed);
        let behind = received.wrapping_sub(self.taken as u32);
        // If the link loop took bytes after the last tick, the difference is negative, which appears here as a value
        // of at least 2³¹.
        if behind > BEHIND && behind < 1 << 31 {
            self.lost += u64::from(behind);
            self.taken += u64::from(behind);
            self.uart.jump(self.taken);
            self.parser.restart(self.taken);
            self.left = 0;
        }
    }

    /// Passes the first of `new` bytes to the parser, with the time of arrival of this byte. The time determines if
    /// there was a gap before the byte. The time is `now` minus the transmission time of `new` bytes, but not before
    /// the last check of the DMA ring.
    fn begin(&mut self, now: u64, new: usize) {
        let first = (now.saturating_sub(duration_us(new))).max(self.looked_us);
        let mut byte = [0];
        let taken = self.parser.push(first, self.uart.peek(&mut byte));
        self.take(taken);
    }

    /// Adds the event of the parser to the batch if the batch has space.
    fn hand_over(&mut self, slot: &mut SlotIn) -> bool {
        let moved = self.parser.received(self.line).is_some_and(|received| slot.push(&received));
        if moved {
            self.parser.release();
        }
        moved
    }
}

/// Returns the transmission time of `bytes` in µs, with ten bits per byte.
fn duration_us(bytes: usize) -> u64 {
    bytes as u64 * 10_000_000 / u64::from(BAUD)
}

/// Serves both serial lines, stores arms, and computes the checksum of the program in flash. This function never
/// returns.
pub async fn run(mut links: [Link; lines::LINES], mut slot: SlotIn, mut store: Store) -> ! {
    // Line that the loop serves next. The loop alternates between the lines, so that a line whose events fill the
    // slot does not block the other line.
    let mut turn = 0;
    let mut report = Report::new();
    let mut program = program::Reader::new();
    loop {
        uart::WORK.wait().await;
        ROUNDS_DONE.fetch_add(1, Ordering::Relaxed);
        for _ in 0..ROUNDS {
            let mut more = false;
            for link in &mut links {
                more |= link.receive();
            }
            for offset in 0..lines::LINES {
                let line = (turn + offset) % lines::LINES;
                if links[line].hand_over(&mut slot) {
                    turn = (line + 1) % lines::LINES;
                    more = true;
                }
            }
            if !more {
                break;
            }
        }
        slot.send();
        store.step();
        program.step();
        report.log(&mut links);
    }
}

/// Logs changes, at most once a second. Each log line contains only one number, because interrupts are masked while a
/// line is written, and the tick must begin in time.
struct Report {
    next: Instant,
    line_errors: [u32; lines::LINES],
    lost: [u64; lines::LINES],
    tick: Summary,
}

impl Report {
    fn new() -> Self {
        Self {
            next: Instant::now(),
            line_errors: [0; lines::LINES],
            lost: [0; lines::LINES],
            tick: Summary::new(),
        }
    }

    fn log(&mut self, links: &mut [Link; lines::LINES]) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + Duration::from_secs(1);
        let errors = [links[0].uart.errors(), links[1].uart.errors()];
        let last = core::mem::replace(&mut self.line_errors, errors);
        if errors[0] != last[0] {
            defmt::warn!("line errors, RS422: {=u32}", errors[0]);
        }
        if errors[1] != last[1] {
            defmt::warn!("line errors, USB: {=u32}", errors[1]);
        }
        let lost = [links[0].lost, links[1].lost];
        let last = core::mem::replace(&mut self.lost, lost);
        if lost[0] != last[0] {
            defmt::warn!("bytes lost, more than can be executed, RS422: {=u64}", lost[0]);
        }
        if lost[1] != last[1] {
            defmt::warn!("bytes lost, more than can be executed, USB: {=u64}", lost[1]);
        }
        let tick = critical_section::with(|cs| summary::LAST.borrow(cs).get());
        let last = core::mem::replace(&mut self.tick, tick);
        if tick != last {
            tick.log(&last);
        }
    }
}
