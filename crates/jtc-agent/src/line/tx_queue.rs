//! Transmit queue of the serial line. The queue sends whole frames, one after the other, and passes their bytes to the
//! operating system shortly before the line can send them.
//!
//! Bytes that the operating system has accepted cannot be taken back, so at most [`AHEAD`] bytes are queued in the
//! operating system. A Stop does not wait for the remainder of a long frame. The queue aborts this frame, and the
//! controller detects this by the gap after it (J-05).
use std::time::Duration;

use jtc_host::port::line_time;

use super::ClientId;
use super::frame_class::HostFrame;

/// Largest number of bytes that are queued in the operating system: 256 (J-05) minus a margin. Each delay of the system
/// can delay the serial line by up to one byte more than estimated.
const AHEAD: usize = 250;
/// Silence after an aborted frame: 5 ms (J-03), plus a margin because USB adapters may shorten the gap.
const GAP: Duration = Duration::from_millis(8);
/// Remainders of frames up to this length, in bytes, are still sent before a Stop, because sending them takes at most
/// as long as the gap.
const SHORT: usize = 64;
/// Smallest number of bytes of a longer frame that are written in one step.
const PIECE: usize = 64;

/// Frame for the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Outgoing {
    /// Client that sent the frame.
    pub client: ClientId,
    /// Whole frame.
    pub frame: HostFrame,
}

/// Result of the transmission of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Passed {
    /// The last byte of the frame was written.
    Written(Outgoing),
    /// The frame was aborted before its end.
    Abandoned(Outgoing),
}

/// Frame whose bytes are currently written.
struct Writing {
    outgoing: Outgoing,
    at: usize,
}

/// Transmit queue, which adapts the bytes that it writes to the rate of the serial line. An urgent frame can overtake
/// the current frame.
pub(super) struct TxQueue {
    baud: Option<u32>,
    urgent: Option<Outgoing>,
    writing: Option<Writing>,
    /// Time at which the serial line will have sent all written bytes.
    free_at: Duration,
    /// Time at which the serial line begins to send the bytes that are currently passed to the operating system.
    begins_at: Option<Duration>,
    /// End of the silence after an aborted frame.
    silent_until: Duration,
}

impl TxQueue {
    /// Creates the queue of a line with this bit rate in Bd; `None` means that the serial line has no bit rate.
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

    /// Sets the frame that overtakes all other frames.
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

    /// Begins a frame; call it only if [`is_free`](Self::is_free) returns true.
    pub(super) fn begin(&mut self, outgoing: Outgoing) {
        self.writing = Some(Writing { outgoing, at: 0 });
    }

    /// Returns the time at which [`next`](Self::next) may return more bytes. Returns `None` if no bytes wait.
    pub(super) fn due(&self, now: Duration) -> Option<Duration> {
        if now < self.silent_until {
            return Some(self.silent_until);
        }
        if let Some(urgent) = &self.urgent {
            // If the urgent frame replaces the current frame, the current frame is aborted at the time at which its
            // next piece could be written.
            let needed =
                urgent.frame.bytes.len() + self.rest().filter(|rest| *rest <= SHORT).unwrap_or(PIECE);
            let ahead = AHEAD.saturating_sub(needed);
            return Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))));
        }
        let left = self.writing.as_ref().map(|w| w.outgoing.frame.bytes.len() - w.at)?;
        let ahead = AHEAD - left.min(PIECE);
        Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))))
    }

    /// Returns the bytes to write now, and the frames that end with them.
    pub(super) fn next(&mut self, now: Duration) -> (Vec<u8>, Vec<Passed>) {
        let (mut bytes, mut passed) = (Vec::new(), Vec::new());
        if now < self.silent_until {
            return (bytes, passed);
        }
        // On a line without a rate, no bytes are assumed to be queued. The frames are still written in pieces, so that
        // a Stop can overtake them.
        let queued = bytes_in(self.free_at.saturating_sub(now), self.baud);
        let room = AHEAD.saturating_sub(queued);
        if self.urgent.is_some() {
            let rest = self.rest();
            if rest.is_some_and(|rest| rest > SHORT) {
                self.silent_until = self.free_at.max(now) + GAP;
                passed.extend(self.writing.take().map(|writing| Passed::Abandoned(writing.outgoing)));
                return (bytes, passed);
            }
            // The urgent frame is written when it fits, with the remainder of the current frame, within the limit of
            // queued bytes. If it were written earlier, it would not arrive sooner.
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

    /// Records that the operating system accepted the bytes only now. If the serial line was idle, it began to send
    /// later than estimated, so it is also free later.
    pub(super) fn handed_over(&mut self, now: Duration) {
        if let Some(begins_at) = self.begins_at.take() {
            self.free_at += now.saturating_sub(begins_at);
        }
    }

    /// Aborts the current frame. Returns the frame, and true if the controller has received a part of it.
    pub(super) fn give_up(&mut self, now: Duration) -> Option<(Outgoing, bool)> {
        let writing = self.writing.take()?;
        if writing.at > 0 {
            self.silent_until = self.free_at.max(now) + GAP;
        }
        Some((writing.outgoing, writing.at > 0))
    }

    /// Returns the number of bytes that remain of the current frame.
    fn rest(&self) -> Option<usize> {
        let writing = self.writing.as_ref().filter(|writing| writing.at > 0)?;
        Some(writing.outgoing.frame.bytes.len() - writing.at)
    }

    /// Returns the current frame, and the number of bytes of this frame that were written.
    pub(super) fn writing(&self) -> Option<(&Outgoing, usize)> {
        self.writing.as_ref().map(|w| (&w.outgoing, w.at))
    }
}

/// Returns the number of 8N1 bytes that the serial line sends in a time, rounded up.
fn bytes_in(time: Duration, baud: Option<u32>) -> usize {
    baud.map_or(0, |baud| (time.as_secs_f64() * f64::from(baud) / 10.0).ceil() as usize)
}
