//! Byte streams that are generated from the fuzz input: frames, damaged frames, false headers, noise and gaps. The bytes arrive in pieces
//! of any length, and the reader is slow.
use std::vec;
use std::vec::Vec;

use super::reference::{Event, placed_events, urgent_ends};
use super::{body_len, sealed};
use crate::{FrameType, HEADER, LinkEvent, Receiver, UrgentWatch, fixed};

const INTER_BYTE_TIMEOUT_US: u64 = 5000;

enum Step {
    Bytes(Vec<u8>),
    /// Time without bytes on the line, in µs.
    Silence(u64),
    /// After this step, each event is released only after this number of pushes.
    Hold(u8),
    /// After this step, bytes arrive in pieces of this length.
    Pieces(usize),
    /// After this step, `poll` is called either after each piece, or only when necessary.
    Lazy(bool),
}

/// Reads the bytes of the input in order, and returns zeros after the end.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }
    fn take(&mut self, n: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(n.min(self.0.len()));
        self.0 = rest;
        taken
    }
    fn kind(&mut self) -> FrameType {
        loop {
            let kind = FrameType::ALL[usize::from(self.byte()) % FrameType::ALL.len()];
            if kind != FrameType::JtcStatus || self.0.is_empty() {
                return kind;
            }
        }
    }
    /// Returns a valid frame whose body is filled with a repeated byte sequence.
    fn frame(&mut self) -> Vec<u8> {
        let kind = self.kind();
        let n = body_len(kind, self.byte());
        let seed = [self.byte(), self.byte(), self.byte()];
        let body: Vec<u8> = seed.iter().copied().cycle().take(n).collect();
        sealed(kind as u8, &body)
    }
    fn step(&mut self) -> Step {
        Step::Bytes(match self.byte() % 16 {
            // 200 µs have already passed since the last byte. If the next input byte is 0, the whole silence is
            // therefore exactly as long as a gap.
            0 => return Step::Silence(INTER_BYTE_TIMEOUT_US - 200 + u64::from(self.byte()) * 100),
            1 => return Step::Silence(INTER_BYTE_TIMEOUT_US - 201),
            2 => return Step::Hold(self.byte() % 40),
            3 => return Step::Pieces(usize::from(self.byte()) * 3 + 1),
            4 => return Step::Lazy(self.byte() % 2 == 1),
            5 => {
                let n = self.byte() % 32;
                self.take(n.into()).to_vec()
            }
            6 | 7 => self.frame(),
            8 => {
                let mut frame = self.frame();
                let at = usize::from(u16::from_be_bytes([self.byte(), self.byte()])) % frame.len();
                frame[at] ^= self.byte() | 1;
                frame
            }
            9 => {
                let mut frame = self.frame();
                frame.truncate(usize::from(self.byte()) % frame.len());
                frame
            }
            10 => {
                let kind = self.kind();
                let n = (body_len(kind, self.byte()) + 6) as u16;
                vec![HEADER, kind as u8, (n >> 8) as u8, n as u8]
            }
            11 => {
                let n = 14 + 36 * u16::from(self.byte()) * 6;
                let [high, low] = n.to_be_bytes();
                [HEADER, 4, high, low].repeat(usize::from(self.byte()) + 1)
            }
            12 => [HEADER].repeat(self.byte().into()),
            13 => {
                // Returns a Trajectory frame whose body contains other frames. The CRC of the Trajectory frame is
                // wrong in some cases.
                let mut body: Vec<u8> = (0..4).flat_map(|_| self.frame()).collect();
                body.resize(8 + body.len().next_multiple_of(36), self.byte());
                let mut frame = sealed(FrameType::Trajectory as u8, &body);
                let last = frame.len() - 1;
                frame[last] ^= self.byte() % 2;
                frame
            }
            14 => [self.byte()].repeat(usize::from(self.byte()) * 20),
            _ => match self.byte() {
                kind @ 0..16 => {
                    // Returns a Stop or a Pause that is repeated a few times. The last repetition is cut off.
                    let frame = if kind % 2 == 0 { fixed::STOP } else { fixed::PAUSE };
                    let mut frames = frame.repeat(usize::from(kind / 2) + 1);
                    frames.truncate(frames.len() - usize::from(self.byte() % 8));
                    frames
                }
                byte => vec![byte],
            },
        })
    }
}

/// A receiver and the events that it has found.
struct Driver {
    receiver: Receiver<Vec<u8>>,
    now: u64,
    /// Time of the last byte, µs.
    last: u64,
    hold: u8,
    /// Number of pushes until the current event is released.
    held: u8,
    piece: usize,
    lazy: bool,
    found: Vec<(u64, Event)>,
    watch: UrgentWatch<1>,
    /// Current time for the watch, µs. The watch receives the bytes as soon as they arrive, even if the reader is slow.
    arrived_us: u64,
    /// Stream positions at which a Stop or a Pause ended.
    urgent: Vec<u64>,
    urgent_count: usize,
    bytes: usize,
    busy_polls: usize,
}

impl Driver {
    fn poll(&mut self) -> bool {
        let found = self.receiver.poll(self.now);
        assert_eq!(found, self.receiver.event().is_some());
        if !found && self.receiver.busy() {
            self.busy_polls += 1;
            assert!(self.busy_polls <= self.bytes / 15 + 1, "too much work for so few bytes");
        }
        found
    }

    fn release(&mut self) {
        let event = match self.receiver.event().expect("an event is there") {
            LinkEvent::Frame(frame) => {
                assert_eq!(crate::FrameRef::new_checked(frame.bytes), Some(frame));
                Event::Frame(frame.bytes.to_vec())
            }
            LinkEvent::Bad(response) => Event::Bad(response),
            LinkEvent::Noise(response) => {
                assert_eq!(response.frame_type, 0, "noise is of no type");
                Event::Bad(response)
            }
        };
        let position = self.receiver.event_position().expect("an event is there");
        self.found.push((position, event));
        assert!(self.found.len() <= self.bytes, "more events than bytes");
        self.receiver.release();
        self.held = self.hold;
    }

    fn drain(&mut self) {
        while self.poll() || self.receiver.busy() {
            if self.receiver.event().is_some() {
                self.release();
            }
        }
    }

    /// Passes the same pieces to the watch as to the reader. The watch must find the same commands as the reference parser finds in the
    /// complete stream.
    fn watch(&mut self, bytes: &[u8]) {
        self.arrived_us +=
            if self.now - self.last >= INTER_BYTE_TIMEOUT_US { INTER_BYTE_TIMEOUT_US } else { 0 };
        for piece in bytes.chunks(self.piece) {
            let before = self.watch.received(0);
            self.watch.scan(0, self.arrived_us, piece);
            let commands = self.watch.take()[0];
            let count: usize = commands.iter().map(|(_, count)| usize::from(count)).sum();
            let ends: Vec<u64> = (before + 1..=before + piece.len() as u64)
                .filter(|end| self.watch.overtaken(0, end - 1))
                .collect();
            // The position `overtaken` depends only on the last command in this piece. The earlier commands are only
            // counted.
            self.urgent.extend(ends.last().filter(|_| count > 0));
            self.urgent_count += count;
        }
    }

    fn push(&mut self, mut bytes: &[u8]) {
        self.watch(bytes);
        while !bytes.is_empty() {
            let piece = &bytes[..self.piece.min(bytes.len())];
            let taken = self.receiver.push(self.now, piece);
            assert!(taken <= piece.len());
            bytes = &bytes[taken..];
            self.bytes += taken;
            if taken < piece.len() {
                // A frame must stay complete even if the reader was delayed by more than a gap.
                self.now += 2 * INTER_BYTE_TIMEOUT_US;
                let before = self.found.len();
                self.drain();
                assert!(taken > 0 || self.found.len() > before || self.receiver.event().is_none());
                continue;
            }
            if self.held > 0 {
                self.held -= 1;
                self.poll();
            } else if !self.lazy {
                self.drain();
            }
            self.last = self.now;
            self.now += 200;
        }
    }
}

/// Returns the bytes of a script, split at its gaps, for tests with their own line and receiver.
pub fn stream_regions(data: &[u8]) -> Vec<Vec<u8>> {
    let mut reader = Reader(data);
    reader.byte();
    let mut regions = vec![Vec::new()];
    // Time since the last byte, in µs.
    let mut silence = 200;
    while !reader.0.is_empty() && regions.iter().map(Vec::len).sum::<usize>() < 150_000 {
        match reader.step() {
            Step::Bytes(bytes) if bytes.is_empty() => {}
            Step::Bytes(bytes) => {
                if silence >= INTER_BYTE_TIMEOUT_US {
                    regions.push(Vec::new());
                }
                regions.last_mut().expect("one at least").extend(bytes);
                silence = 200;
            }
            Step::Silence(us) => silence += us,
            Step::Hold(_) | Step::Pieces(_) | Step::Lazy(_) => {}
        }
    }
    regions
}

/// Runs a script. The first byte selects the size of the buffer; the bytes after it are the steps. The receiver must find the same events
/// as the reference parser finds in the complete stream.
pub fn stream_parser(data: &[u8]) {
    const CAPACITY: [usize; 5] = [64, 256, 1500, 11_000, crate::FRAME_MAX];
    let mut reader = Reader(data);
    let capacity = CAPACITY[usize::from(reader.byte()) % CAPACITY.len()];
    let mut driver = Driver {
        receiver: Receiver::new(vec![0; capacity], INTER_BYTE_TIMEOUT_US as u32),
        now: 0,
        last: 0,
        hold: 0,
        held: 0,
        piece: usize::MAX,
        lazy: false,
        found: Vec::new(),
        watch: UrgentWatch::new(INTER_BYTE_TIMEOUT_US as u32),
        arrived_us: 0,
        urgent: Vec::new(),
        urgent_count: 0,
        bytes: 0,
        busy_polls: 0,
    };
    let mut regions = vec![Vec::new()];
    while !reader.0.is_empty() && regions.iter().map(Vec::len).sum::<usize>() < 150_000 {
        match reader.step() {
            Step::Bytes(bytes) if bytes.is_empty() => {}
            Step::Bytes(bytes) => {
                if driver.now - driver.last >= INTER_BYTE_TIMEOUT_US {
                    regions.push(Vec::new());
                }
                driver.push(&bytes);
                regions.last_mut().expect("one at least").extend(bytes);
            }
            Step::Silence(us) => driver.now += us,
            Step::Hold(n) => driver.hold = n,
            Step::Pieces(n) => driver.piece = n,
            Step::Lazy(lazy) => driver.lazy = lazy,
        }
    }
    driver.now += INTER_BYTE_TIMEOUT_US;
    driver.drain();
    assert!(!driver.receiver.mid_frame(), "nothing is left");
    assert_eq!(driver.found, placed_events(&regions, capacity));
    let ends = urgent_ends(&regions);
    assert_eq!(driver.urgent_count, ends.len(), "every Stop and every Pause, once");
    assert!(driver.urgent.iter().all(|end| ends.contains(end)));
    for (position, event) in &driver.found {
        if let Event::Frame(bytes) = event
            && (bytes[..] == fixed::STOP || bytes[..] == fixed::PAUSE)
        {
            assert!(ends.contains(&(position + 7)), "what the parser finds was seen before");
        }
    }
}
