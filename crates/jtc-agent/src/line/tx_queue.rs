//! Transmit queue of the serial line. The queue sends complete frames, one after the other. The queue passes the bytes
//! of a frame to the operating system shortly before the line can send them.
//!
//! The queue cannot recall bytes that the operating system has accepted. At most [`AHEAD`] bytes are therefore queued
//! in the operating system. A Stop does not wait for the remainder of a long frame. For a Stop, the queue aborts a long
//! frame, and the controller detects this by the gap after the frame (J-05).
use std::time::Duration;

use jtc_host::port::line_time;

use super::ClientId;
use super::frame_class::HostFrame;

/// Largest number of bytes that are queued in the operating system: the limit of 256 (J-05) minus a margin. Each
/// delay of the operating system can shift the transmission by up to one byte time, so more bytes can be queued than
/// estimated.
const AHEAD: usize = 250;
/// Silence after an aborted frame: 5 ms (J-03), plus a margin because USB adapters may shorten the gap.
const GAP: Duration = Duration::from_millis(8);
/// Longest remainder of a frame that is still sent before a Stop, in bytes. Sending such a remainder takes at most as
/// long as the gap.
const SHORT: usize = 64;
/// Length of the pieces in which a longer frame is written; a piece can be longer, but not shorter.
const PIECE: usize = 64;

/// Frame for the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Outgoing {
    /// Client that sent the frame.
    pub client: ClientId,
    /// Complete frame.
    pub frame: HostFrame,
}

/// Result of the transmission of a frame: written or aborted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Passed {
    /// The last byte of the frame was written.
    Written(Outgoing),
    /// The transmission of the frame was aborted before its end.
    Abandoned(Outgoing),
}

/// Frame whose bytes the queue is writing.
struct Writing {
    outgoing: Outgoing,
    at: usize,
}

/// Transmit queue, which writes bytes at the rate of the serial line. An urgent frame can overtake the frame that the
/// queue is writing.
pub(super) struct TxQueue {
    baud: Option<u32>,
    urgent: Option<Outgoing>,
    writing: Option<Writing>,
    /// Time at which the serial line will have sent all written bytes.
    free_at: Duration,
    /// Time at which the serial line begins to send the bytes that the queue is passing to the operating system.
    begins_at: Option<Duration>,
    /// End of the silence after an aborted frame.
    silent_until: Duration,
}

impl TxQueue {
    /// Creates the queue of a serial line with the bit rate `baud` in Bd; `None` means that the line has no bit rate.
    pub(super) fn new(baud: Option<u32>) -> Self {
        Self {
            baud,
            urgent: None,
            writing: None,
            free_at: Duration::ZERO,
            begins_at: None,
            silent_until: Duration::ZERO,
        }
    }

    /// Returns the time at which the serial line will have sent all written bytes.
    pub(super) fn free_at(&self) -> Duration {
        self.free_at
    }

    /// Sets the urgent frame, which overtakes all other frames.
    pub(super) fn set_urgent(&mut self, urgent: Option<Outgoing>) {
        self.urgent = urgent;
    }

    /// Returns the bit rate of the serial line in Bd, or `None` if it has no bit rate.
    pub(super) fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// Returns true if a new frame can begin.
    pub(super) fn is_free(&self) -> bool {
        self.writing.is_none() && self.urgent.is_none()
    }

    /// Begins to write a frame; must be called only if [`is_free`](Self::is_free) returns true.
    pub(super) fn begin(&mut self, outgoing: Outgoing) {
        self.writing = Some(Writing { outgoing, at: 0 });
    }

    /// Returns the time at which [`next`](Self::next) may return more bytes. Returns `None` if the queue contains no
    /// bytes.
    pub(super) fn due(&self, now: Duration) -> Option<Duration> {
        if now < self.silent_until {
            return Some(self.silent_until);
        }
        if let Some(urgent) = &self.urgent {
            // An urgent frame is due as soon as the queue has space for this frame and for the rest of the current
            // frame. A long rest counts only as one piece, because the urgent frame then aborts the current frame.
            let needed =
                urgent.frame.bytes.len() + self.rest().filter(|rest| *rest <= SHORT).unwrap_or(PIECE);
            let ahead = AHEAD.saturating_sub(needed);
            return Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))));
        }
        let left = self.writing.as_ref().map(|w| w.outgoing.frame.bytes.len() - w.at)?;
        let ahead = AHEAD - left.min(PIECE);
        Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))))
    }

    /// Returns the bytes to be written now, and the frames that these bytes complete or that the queue has aborted.
    pub(super) fn next(&mut self, now: Duration) -> (Vec<u8>, Vec<Passed>) {
        let (mut bytes, mut passed) = (Vec::new(), Vec::new());
        if now < self.silent_until {
            return (bytes, passed);
        }
        // On a serial line without a bit rate, the queue assumes that no bytes are queued in the operating system.
        // Frames are nevertheless written in pieces, so that a Stop can overtake them.
        let queued = bytes_in(self.free_at.saturating_sub(now), self.baud);
        let room = AHEAD.saturating_sub(queued);
        if self.urgent.is_some() {
            let rest = self.rest();
            if rest.is_some_and(|rest| rest > SHORT) {
                self.silent_until = self.free_at.max(now) + GAP;
                passed.extend(self.writing.take().map(|writing| Passed::Abandoned(writing.outgoing)));
                return (bytes, passed);
            }
            // The urgent frame is written as soon as the rest of the current frame and the urgent frame together fit
            // within the limit of queued bytes. The urgent frame would not arrive sooner if it were written earlier.
            let needed =
                self.urgent.as_ref().map_or(0, |urgent| urgent.frame.bytes.len()) + rest.unwrap_or(0);
            if queued == 0 || needed <= room {
                if let Some(writing) = self.writing.take_if(|writing| writing.at > 0) {
                    bytes.extend(&writing.outgoing.frame.bytes[writing.at..]);
                    passed.push(Passed::Written(writing.outgoing));
                }
                if let Some(urgent) = self.urgent.take() {
                    bytes.extend(&urgent.frame.bytes);
                    passed.push(Passed::Written(urgent));
                }
            }
        } else if let Some(writing) = &mut self.writing {
            let left = writing.outgoing.frame.bytes.len() - writing.at;
            if room >= left.min(PIECE) {
                let end = writing.at + left.min(room);
                bytes.extend(&writing.outgoing.frame.bytes[writing.at..end]);
                writing.at = end;
            }
            if writing.at == writing.outgoing.frame.bytes.len()
                && let Some(writing) = self.writing.take()
            {
                passed.push(Passed::Written(writing.outgoing));
            }
        }
        let begins_at = self.free_at.max(now);
        if !bytes.is_empty() {
            self.begins_at.get_or_insert(begins_at);
        }
        self.free_at = begins_at + line_time(bytes.len(), self.baud);
        (bytes, passed)
    }

    /// Records that the operating system accepted the bytes only now, later than the queue assumed. If the serial
    /// line was idle, it also began to send later, so it becomes free later than estimated.
    pub(super) fn handed_over(&mut self, now: Duration) {
        if let Some(begins_at) = self.begins_at.take() {
            self.free_at += now.saturating_sub(begins_at);
        }
    }

    /// Aborts the frame that is being written. Returns the aborted frame, and true if a part of it was written.
    pub(super) fn give_up(&mut self, now: Duration) -> Option<(Outgoing, bool)> {
        let writing = self.writing.take()?;
        if writing.at > 0 {
            self.silent_until = self.free_at.max(now) + GAP;
        }
        Some((writing.outgoing, writing.at > 0))
    }

    /// Returns the number of bytes of the current frame that are not written yet; `None` if no byte of it was
    /// written.
    fn rest(&self) -> Option<usize> {
        let writing = self.writing.as_ref().filter(|writing| writing.at > 0)?;
        Some(writing.outgoing.frame.bytes.len() - writing.at)
    }

    /// Returns the frame that is being written, and the number of its bytes that were written.
    pub(super) fn writing(&self) -> Option<(&Outgoing, usize)> {
        self.writing.as_ref().map(|w| (&w.outgoing, w.at))
    }
}

/// Returns the number of 8N1 bytes that the serial line sends in the duration `time`, rounded up.
fn bytes_in(time: Duration, baud: Option<u32>) -> usize {
    baud.map_or(0, |baud| (time.as_secs_f64() * f64::from(baud) / 10.0).ceil() as usize)
}
