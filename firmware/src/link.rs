//! From bytes to frames: each line has a parser of its own; what the parsers find goes to the tick through one slot.
//!
//! The slot holds a copy, so that a parser can take more bytes while the tick works a long frame off, slice by slice.
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant};
use jtc_wire::{DataStatus, FRAME_MAX, FrameRef, FrameStatus, FrameType, LinkEvent, Receiver, Response};
use openjtc_firmware::{BAUD, lines};

use crate::uart;

/// A gap within a frame that ends it, µs (J-03).
const GAP_US: u32 = 5_000;
/// Bytes given to a parser at once.
const CHUNK: usize = 1024;
/// Rounds before the links wait for the next tick.
const ROUNDS: usize = 64;

/// There may be something to do: a tick has ended, or a line has fallen idle.
pub static WORK: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Counts up with every round of the links: the tick sees by it that they are alive.
pub static ROUNDS_DONE: AtomicU32 = AtomicU32::new(0);

/// What the tick works on: an event of a line, copied. Integers only: all zeros are a value.
pub struct Handover {
    line: u8,
    /// Type and status as their numbers.
    frame_type: u8,
    status: u8,
    length: u16,
    frame: [u8; FRAME_MAX],
}

impl Handover {
    fn set(&mut self, line: usize, event: LinkEvent<'_>) {
        self.line = line as u8;
        match event {
            LinkEvent::Frame(frame) => {
                self.status = FrameStatus::NoError as u8;
                self.frame_type = frame.frame_type as u8;
                self.length = frame.bytes.len() as u16;
                if let Some(place) = self.frame.get_mut(..frame.bytes.len()) {
                    place.copy_from_slice(frame.bytes);
                }
            }
            LinkEvent::Bad(response) => {
                self.status = response.status as u8;
                self.frame_type = response.frame_type;
                self.length = response.length;
            }
        }
    }

    /// The line it came from.
    pub fn line(&self) -> usize {
        self.line.into()
    }

    /// The event.
    pub fn event(&self) -> LinkEvent<'_> {
        let status = FrameStatus::from_byte(self.status).unwrap_or_default();
        let frame = FrameType::from_byte(self.frame_type).zip(self.frame.get(..self.length.into()));
        match frame {
            Some((frame_type, bytes)) if status == FrameStatus::NoError => {
                LinkEvent::Frame(FrameRef { frame_type, bytes })
            }
            _ => LinkEvent::Bad(Response {
                frame_type: self.frame_type,
                status,
                data: DataStatus::Idle,
                length: self.length,
            }),
        }
    }
}

/// Where the slot is put for the other side to take. Whoever has the reference may use it; there is but one.
type Place = Mutex<Cell<Option<&'static mut Handover>>>;
static FULL: Place = Mutex::new(Cell::new(None));
static EMPTY: Place = Mutex::new(Cell::new(None));

/// The links' end of the slot.
pub struct SlotIn(());

/// The tick's end of the slot, with the event that it works on.
pub struct SlotOut(Option<&'static mut Handover>);

/// Both ends of the slot, which is empty.
pub fn slot(memory: &'static mut Handover) -> (SlotIn, SlotOut) {
    critical_section::with(|cs| EMPTY.borrow(cs).set(Some(memory)));
    (SlotIn(()), SlotOut(None))
}

impl SlotIn {
    /// Hands an event to the tick; false when it still has one.
    fn send(&mut self, line: usize, event: LinkEvent<'_>) -> bool {
        let Some(slot) = critical_section::with(|cs| EMPTY.borrow(cs).take()) else { return false };
        slot.set(line, event);
        critical_section::with(|cs| FULL.borrow(cs).set(Some(slot)));
        true
    }
}

impl SlotOut {
    /// The oldest event, until it is done.
    pub fn event(&mut self) -> Option<&Handover> {
        if self.0.is_none() {
            self.0 = critical_section::with(|cs| FULL.borrow(cs).take());
        }
        self.0.as_deref()
    }

    /// The event is worked off.
    pub fn done(&mut self) {
        if let Some(slot) = self.0.take() {
            critical_section::with(|cs| EMPTY.borrow(cs).set(Some(slot)));
        }
    }
}

/// A line and its parser.
pub struct Link {
    line: usize,
    uart: uart::Receiver,
    parser: Receiver<&'static mut [u8]>,
    /// The parser has found something.
    found: bool,
    /// When the ring was looked at last, µs.
    looked_us: u64,
    /// Bytes that were left in the ring then.
    left: usize,
}

impl Link {
    /// A link over `line`, whose bytes `uart` receives.
    pub fn new(line: usize, uart: uart::Receiver, buffer: &'static mut [u8; FRAME_MAX]) -> Self {
        let parser = Receiver::new(&mut buffer[..], GAP_US);
        Self { line, uart, parser, found: false, looked_us: 0, left: 0 }
    }

    /// Takes what has arrived and looks for an event; true when there is more to do at once.
    fn receive(&mut self) -> bool {
        // The clock first: a byte that arrives after it is not counted as silence before it.
        let now = Instant::now().as_micros();
        let waiting = self.uart.waiting();
        let new = waiting.saturating_sub(self.left);
        if new > 0 && self.left == 0 {
            self.begin(now, new);
        }
        let mut chunk = [0; CHUNK];
        let bytes = self.uart.peek(&mut chunk);
        let taken = self.parser.push(now, bytes);
        self.uart.take(taken);
        self.left = self.uart.waiting().min(waiting.saturating_sub(taken));
        self.looked_us = now;
        if !self.found {
            self.found = self.parser.poll(now);
        }
        (taken > 0 && self.left > 0) || (!self.found && self.parser.busy())
    }

    /// The first of `new` bytes arrived earlier than the last, which matters for a gap before it: at the latest
    /// when it had to for all of them to be here by now, and not before the ring was last looked at.
    fn begin(&mut self, now: u64, new: usize) {
        let first = (now.saturating_sub(duration_us(new))).max(self.looked_us);
        let mut byte = [0];
        let taken = self.parser.push(first, self.uart.peek(&mut byte));
        self.uart.take(taken);
    }

    /// Gives the event to the tick if the slot is free.
    fn hand_over(&mut self, slot: &mut SlotIn) -> bool {
        if !self.found {
            return false;
        }
        let Some(event) = self.parser.event() else { return false };
        if !slot.send(self.line, event) {
            return false;
        }
        self.parser.release();
        self.found = false;
        true
    }
}

/// Time of `bytes` on the line: ten bits each.
fn duration_us(bytes: usize) -> u64 {
    bytes as u64 * 10_000_000 / u64::from(BAUD)
}

/// Serves both lines for ever.
pub async fn run(mut links: [Link; lines::LINES], mut slot: SlotIn) -> ! {
    // Line whose turn it is: one that floods the slot does not keep the other from it.
    let mut turn = 0;
    let mut report = Report::new();
    loop {
        WORK.wait().await;
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
        report.log(&mut links);
    }
}

/// Logs what changed, at most once a second.
struct Report {
    next: Instant,
    line_errors: [u32; lines::LINES],
    tick: crate::tick::Summary,
}

impl Report {
    fn new() -> Self {
        Self { next: Instant::now(), line_errors: [0; lines::LINES], tick: crate::tick::Summary::new() }
    }

    fn log(&mut self, links: &mut [Link; lines::LINES]) {
        let now = Instant::now();
        if now < self.next {
            return;
        }
        self.next = now + Duration::from_secs(1);
        let errors = [links[0].uart.errors(), links[1].uart.errors()];
        if errors != self.line_errors {
            self.line_errors = errors;
            defmt::warn!("line errors: RS422 {=u32}, USB {=u32}", errors[0], errors[1]);
        }
        let tick = crate::tick::summary();
        if tick != self.tick {
            self.tick = tick;
            defmt::info!("{}", tick);
        }
    }
}
