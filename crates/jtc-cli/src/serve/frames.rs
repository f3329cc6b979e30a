//! Splits the bytes of the controller into complete statuses, so that a host that connects later never receives an incomplete
//! status.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use jtc_wire::{FRAME_MAX, HEADER, STATUS_LEN};

/// First bytes of each status frame.
const START: [u8; 4] = [HEADER, 0x03, (STATUS_LEN >> 8) as u8, STATUS_LEN as u8];

/// Duration of the silence that ends a frame (J-03).
pub(super) const GAP: Duration = Duration::from_millis(5);
/// Smallest size in bytes of the first part of a long write, if the operating system splits a write to a terminal
/// into parts.
const PIECE: usize = 2048;
/// Transmission time of a byte on a serial line at 115,200 Bd.
const BYTE: Duration = Duration::from_micros(87);

/// Bytes of an incomplete frame, and the complete frames.
#[derive(Default)]
pub(super) struct Frames {
    partial: Vec<u8>,
    whole: VecDeque<Vec<u8>>,
}

impl Frames {
    /// Adds bytes that the controller has sent. The function passes on bytes that are not a status (from a disturbed
    /// line) unchanged.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let n = self.partial.len();
            if n < START.len() && byte != START[n] {
                self.flush();
                if byte == START[0] {
                    self.partial.push(byte);
                } else {
                    self.whole.push_back(vec![byte]);
                }
                continue;
            }
            self.partial.push(byte);
            if self.partial.len() == STATUS_LEN {
                self.flush();
            }
        }
    }

    fn flush(&mut self) {
        if !self.partial.is_empty() {
            self.whole.push_back(std::mem::take(&mut self.partial));
        }
    }

    /// Returns `true` if no complete frame is available.
    pub(super) fn is_empty(&self) -> bool {
        self.whole.is_empty()
    }

    /// Removes and returns the oldest complete frame.
    pub(super) fn pop(&mut self) -> Option<Vec<u8>> {
        self.whole.pop_front()
    }
}

/// Tracker of the bytes that the host sends. The tracker determines whether a frame is incomplete, and how long its
/// next byte has been missing.
///
/// With `--speed max`, and while the simulator catches up after a delay, virtual time runs faster than the clock of
/// the host. A gap within a frame must not become longer in virtual time than it was for the host.
///
/// A busy operating system can suspend the host during a write, for longer than the silence that ends a frame. The
/// adapter of a real serial line would still be sending the bytes in its buffer in this time. In a long frame, the
/// silence therefore begins only when a real serial line would have sent the received bytes.
pub(super) struct Incoming {
    head: Vec<u8>,
    /// Number of received bytes of the current frame.
    come: usize,
    /// Number of missing bytes of the current frame.
    missing: usize,
    /// `true` if the bytes that were received last continue a frame.
    continued: bool,
    /// Time at which the simulated line sent the last byte. For a long frame, the value is the time at which a real
    /// serial line would have sent this byte.
    heard: Instant,
}

impl Incoming {
    /// Creates the tracker before the first byte of the host.
    pub(super) fn new(now: Instant) -> Self {
        Self { head: Vec::new(), come: 0, missing: 0, continued: false, heard: now }
    }

    /// Processes bytes of the host that arrived at `now`.
    pub(super) fn push(&mut self, bytes: &[u8], now: Instant) {
        self.continued |= self.mid_frame();
        for &byte in bytes {
            self.come += 1;
            if self.missing > 0 {
                self.missing -= 1;
                continue;
            }
            if self.head.is_empty() {
                self.come = 1;
            }
            if self.head.is_empty() && byte != HEADER {
                continue;
            }
            self.head.push(byte);
            if self.head.len() == 4 {
                let length = usize::from(u16::from_be_bytes([self.head[2], self.head[3]]));
                let sound = (1..=0x11).contains(&self.head[1]) && (6..=FRAME_MAX).contains(&length);
                self.missing = if sound { length - 4 } else { 0 };
                self.head.clear();
            }
        }
        self.heard = if self.mid_frame() && self.come >= PIECE {
            self.heard.max(now) + BYTE * bytes.len() as u32
        } else {
            self.heard.min(now)
        };
    }

    /// Records that the simulated line is sending bytes at `now`.
    pub(super) fn carries(&mut self, now: Instant) {
        self.heard = self.heard.max(now);
    }

    /// Returns `true` while bytes of a frame are missing.
    pub(super) fn mid_frame(&self) -> bool {
        self.missing > 0 || !self.head.is_empty()
    }

    /// Returns how long the host has been silent within a frame. Returns zero if further bytes of the frame have just
    /// arrived. Returns `None` outside a frame, or if the silence is long enough to end the frame.
    pub(super) fn silence(&mut self, now: Instant) -> Option<Duration> {
        if std::mem::take(&mut self.continued) {
            self.carries(now);
            return Some(Duration::ZERO);
        }
        let silence = self.mid_frame().then(|| now.saturating_duration_since(self.heard))?;
        if silence < GAP {
            return Some(silence);
        }
        *self = Self::new(self.heard);
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(fill: u8) -> Vec<u8> {
        let mut frame = vec![fill; STATUS_LEN];
        frame[..4].copy_from_slice(&START);
        frame
    }

    #[test]
    fn statuses_leave_whole_in_any_chunking() {
        let stream: Vec<u8> = (1..6).flat_map(status).collect();
        for chunk in [1, 7, 174, 175, 176, 875] {
            let mut frames = Frames::default();
            stream.chunks(chunk).for_each(|c| frames.push(c));
            let out: Vec<Vec<u8>> = std::iter::from_fn(|| frames.pop()).collect();
            assert_eq!(out, (1..6).map(status).collect::<Vec<_>>(), "chunks of {chunk}");
        }
    }

    #[test]
    fn noise_loses_no_byte_and_no_status_after_it() {
        let mut frames = Frames::default();
        let mut stream = vec![0x9B, 0x9B, 0x03, 0x00, 0x11];
        stream.extend(status(9));
        frames.push(&stream);
        let out: Vec<Vec<u8>> = std::iter::from_fn(|| frames.pop()).collect();
        assert_eq!(out.concat(), stream);
        assert_eq!(out.last(), Some(&status(9)));
    }

    #[test]
    fn a_frame_of_the_host_is_followed_to_its_end() {
        let start = Instant::now();
        let mut incoming = Incoming::new(start);
        for &byte in &[0x00, 0x9B, 0x0B, 0x00, 0x07, 0x03, 0x7D] {
            incoming.push(&[byte], start);
        }
        assert_eq!(incoming.silence(start), Some(Duration::ZERO));
        let later = |ms| start + Duration::from_millis(ms);
        assert_eq!(incoming.silence(later(4)), Some(Duration::from_millis(4)));
        incoming.carries(later(4));
        assert_eq!(incoming.silence(later(8)), Some(Duration::from_millis(4)));
        incoming.push(&[0x9E], later(8));
        assert_eq!(incoming.silence(later(8)), Some(Duration::ZERO), "the last byte came in time");
        assert_eq!(incoming.silence(later(8)), None, "the frame is complete");
        incoming.push(&[0x9B, 0x0B, 0xFF, 0xFF], later(8));
        assert!(!incoming.mid_frame(), "no frame has this length");
        incoming.push(&[0x9B, 0x0B], later(8));
        incoming.carries(later(8));
        assert_eq!(incoming.silence(later(12)), Some(Duration::from_millis(4)));
        assert_eq!(incoming.silence(later(13)), None, "too late");
        assert!(!incoming.mid_frame(), "the next byte begins a new frame");
    }

    #[test]
    fn a_long_write_may_be_interrupted() {
        let start = Instant::now();
        let later = |ms| start + Duration::from_millis(ms);
        let mut incoming = Incoming::new(start);
        let mut frame = vec![0; 9006];
        frame[..4].copy_from_slice(&[HEADER, 0x04, 0x23, 0x2E]);
        // The operating system suspends the host after 2,048 bytes. A serial line needs 178 ms for these bytes, so no
        // silence counts before this time.
        incoming.push(&frame[..2048], start);
        assert_eq!(incoming.silence(start), Some(Duration::ZERO));
        assert_eq!(incoming.silence(later(170)), Some(Duration::ZERO));
        incoming.push(&frame[2048..], later(170));
        assert_eq!(incoming.silence(later(170)), Some(Duration::ZERO));
        assert!(!incoming.mid_frame(), "complete");
        incoming.push(&frame[..9], later(171));
        incoming.carries(later(171));
        assert_eq!(incoming.silence(later(171)), Some(Duration::ZERO));
        assert_eq!(incoming.silence(later(176)), None, "the credit ends with the frame");
        // If the host sends nothing more, the silence begins when a serial line would have sent the 2,048 bytes, and
        // then ends the frame. After fewer bytes, the silence begins at once.
        incoming.push(&frame[..2048], later(170));
        assert!(incoming.silence(later(300)).is_some() && incoming.silence(later(400)).is_none());
        incoming.push(&frame[..2047], later(600));
        incoming.carries(later(600));
        assert_eq!(incoming.silence(later(605)), None);
    }
}
