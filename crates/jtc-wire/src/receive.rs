//! The host's stream parser: finds JtcStatus frames in bytes that arrive in any pieces.
use crate::frame::{FrameType, HEADER, field};
use crate::status::{STATUS_LEN, Status};

/// Bytes and statuses received so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct StatusCounters {
    /// Good statuses.
    pub frames: u64,
    /// Bytes that looked like a status but had a wrong CRC.
    pub bad_frames: u64,
    /// Bytes that belong to no good status.
    pub skipped_bytes: u64,
}

/// Stream parser of the host, for the layouts of 165, 173 and 175 bytes (J-08). It resynchronises after noise
/// and lost bytes without losing a good status that follows them.
///
/// ```
/// use jtc_wire::{Status, StatusReceiver};
/// let mut receiver = StatusReceiver::new();
/// let bytes = [&[1, 2, 3][..], &Status::default().emit()].concat();
/// let mut rest = &bytes[..];
/// while let Some(status) = receiver.next(&mut rest) {
///     assert_eq!(status, Status { gripper: Some(Default::default()), ..Default::default() });
/// }
/// assert!(rest.is_empty());
/// assert_eq!((receiver.counters().frames, receiver.counters().skipped_bytes), (1, 3));
/// ```
#[derive(Clone, Debug)]
pub struct StatusReceiver {
    held: [u8; STATUS_LEN],
    len: usize,
    counters: StatusCounters,
}

impl Default for StatusReceiver {
    fn default() -> Self {
        Self::new()
    }
}

/// The scan result at the first held byte.
enum ScanResult {
    /// The first held byte begins no status.
    Nothing,
    /// This many bytes are needed to decide.
    Needs(usize),
}

impl StatusReceiver {
    /// Nothing held.
    pub const fn new() -> Self {
        Self {
            held: [0; STATUS_LEN],
            len: 0,
            counters: StatusCounters { frames: 0, bad_frames: 0, skipped_bytes: 0 },
        }
    }

    /// Takes bytes from the front of `bytes` until a status is complete; `None` when all are taken.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Status> {
        loop {
            match scan(&self.held[..self.len]) {
                ScanResult::Nothing => self.skip(),
                ScanResult::Needs(n) if self.len < n => {
                    if bytes.is_empty() {
                        return None;
                    }
                    let (taken, rest) = bytes.split_at((n - self.len).min(bytes.len()));
                    self.held[self.len..self.len + taken.len()].copy_from_slice(taken);
                    self.len += taken.len();
                    *bytes = rest;
                }
                ScanResult::Needs(n) => match Status::parse(&self.held[..n]) {
                    Some(status) => {
                        self.drop_front(n);
                        self.counters.frames += 1;
                        return Some(status);
                    }
                    None => {
                        self.counters.bad_frames += 1;
                        self.skip();
                    }
                },
            }
        }
    }

    /// Bytes and statuses received so far.
    pub fn counters(&self) -> StatusCounters {
        self.counters
    }

    /// Bytes held that may become a status.
    pub fn held(&self) -> usize {
        self.len
    }

    /// Discards the held bytes: for a line that was closed and opened again.
    pub fn clear(&mut self) {
        self.counters.skipped_bytes += self.len as u64;
        self.len = 0;
    }

    /// Skips the first byte and all up to the next header.
    fn skip(&mut self) {
        let rest = &self.held[1..self.len];
        let more = rest.iter().position(|byte| *byte == HEADER).unwrap_or(rest.len());
        self.counters.skipped_bytes += 1 + more as u64;
        self.drop_front(1 + more);
    }

    fn drop_front(&mut self, n: usize) {
        self.held.copy_within(n..self.len, 0);
        self.len -= n;
    }
}

fn scan(held: &[u8]) -> ScanResult {
    let wrong = |at: usize, value: u8| held.get(at).is_some_and(|byte| *byte != value);
    if wrong(field::HEADER, HEADER) || wrong(field::TYPE, FrameType::JtcStatus as u8) {
        return ScanResult::Nothing;
    }
    match held.get(field::LENGTH) {
        None => ScanResult::Needs(field::LENGTH.end),
        Some(n) => match usize::from(u16::from_be_bytes([n[0], n[1]])) {
            n if FrameType::JtcStatus.can_have(n) => ScanResult::Needs(n),
            _ => ScanResult::Nothing,
        },
    }
}
