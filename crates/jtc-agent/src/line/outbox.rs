//! What goes to the device: whole frames, one after the other, a few bytes ahead of the line.
//!
//! Bytes that an operating system has taken cannot be taken back. So no more than [`AHEAD`] of them are ever on their way, and a Stop
//! need not wait for the rest of a long frame: that is abandoned, and the device knows by the gap behind it (J-05).
use std::time::Duration;

use jtc_host::port::line_time;

use super::ClientId;
use super::class::HostFrame;

/// Most bytes of a frame on their way at once: 256 (J-05), less what the end of a byte and of a hand-over may be taken for, early by a byte
/// each time that the system holds one up.
const AHEAD: usize = 250;
/// Silence behind an abandoned frame: the 5 ms of J-03, and as much as adapters may take off it.
const GAP: Duration = Duration::from_millis(8);
/// Rests of frames up to this are sent before a Stop: it takes no longer than the gap would.
const SHORT: usize = 64;
/// Fewest bytes of a longer frame that are written at once.
const PIECE: usize = 64;

/// A frame on its way to the device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outgoing {
    /// Who sent it.
    pub client: ClientId,
    /// All of it.
    pub frame: HostFrame,
}

/// What has become of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Passed {
    /// Its last byte was written.
    Written(Outgoing),
    /// It was given up in the middle.
    Abandoned(Outgoing),
}

/// A frame that is being written.
struct Writing {
    outgoing: Outgoing,
    at: usize,
}

/// Paces what is written on a line, and lets what is urgent overtake.
pub struct Outbox {
    baud: Option<u32>,
    urgent: Option<Outgoing>,
    writing: Option<Writing>,
    /// When the line will have carried everything that was written.
    free_at: Duration,
    /// When it begins to carry what is being handed over, where some is.
    begins_at: Option<Duration>,
    /// The silence behind an abandoned frame lasts until then.
    silent_until: Duration,
}

impl Outbox {
    /// Of a line at this rate, Bd, if it has one.
    pub fn new(baud: Option<u32>) -> Self {
        Self {
            baud,
            urgent: None,
            writing: None,
            free_at: Duration::ZERO,
            begins_at: None,
            silent_until: Duration::ZERO,
        }
    }

    /// When the line will have carried everything that was written.
    pub fn free_at(&self) -> Duration {
        self.free_at
    }

    /// The frame that overtakes all others, if there is one.
    pub fn set_urgent(&mut self, urgent: Option<Outgoing>) {
        self.urgent = urgent;
    }

    /// Rate of the line, Bd, if it has one.
    pub fn baud(&self) -> Option<u32> {
        self.baud
    }

    /// A frame can be begun.
    pub fn is_free(&self) -> bool {
        self.writing.is_none() && self.urgent.is_none()
    }

    /// Begins a frame; only where [`is_free`](Self::is_free).
    pub fn begin(&mut self, outgoing: Outgoing) {
        self.writing = Some(Writing { outgoing, at: 0 });
    }

    /// When [`next`](Self::next) may have more to write than it has now; `None`: when there is more to send.
    pub fn due(&self, now: Duration) -> Option<Duration> {
        if now < self.silent_until {
            return Some(self.silent_until);
        }
        if let Some(urgent) = &self.urgent {
            // One that is abandoned for it is so when there would be room for a piece of it.
            let needed =
                urgent.frame.bytes.len() + self.rest().filter(|rest| *rest <= SHORT).unwrap_or(PIECE);
            let ahead = AHEAD.saturating_sub(needed);
            return Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))));
        }
        let left = self.writing.as_ref().map(|w| w.outgoing.frame.bytes.len() - w.at)?;
        let ahead = AHEAD - left.min(PIECE);
        Some(now.max(self.free_at.saturating_sub(line_time(ahead, self.baud))))
    }

    /// What is to be written now, and what has become of frames with that.
    pub fn next(&mut self, now: Duration) -> (Vec<u8>, Vec<Passed>) {
        let (mut bytes, mut passed) = (Vec::new(), Vec::new());
        if now < self.silent_until {
            return (bytes, passed);
        }
        // Bytes that fit: the whole of a line without a rate, in pieces all the same, for what overtakes.
        let queued = bytes_in(self.free_at.saturating_sub(now), self.baud);
        let room = AHEAD.saturating_sub(queued);
        if self.urgent.is_some() {
            let rest = self.rest();
            if rest.is_some_and(|rest| rest > SHORT) {
                self.silent_until = self.free_at.max(now) + GAP;
                passed.extend(self.writing.take().map(|writing| Passed::Abandoned(writing.outgoing)));
                return (bytes, passed);
            }
            // A piece of a frame may be ahead of it, no more. What is written before there is room comes no sooner.
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

    /// The system has taken the bytes only now: where the line had nothing else to carry it began later, and is free later.
    pub fn handed_over(&mut self, now: Duration) {
        if let Some(begins_at) = self.begins_at.take() {
            self.free_at += now.saturating_sub(begins_at);
        }
    }

    /// Gives up the frame that has been begun. True when the device has seen a part of it.
    pub fn give_up(&mut self, now: Duration) -> Option<(Outgoing, bool)> {
        let writing = self.writing.take()?;
        if writing.at > 0 {
            self.silent_until = self.free_at.max(now) + GAP;
        }
        Some((writing.outgoing, writing.at > 0))
    }

    /// Bytes that are left of a frame that has been begun.
    fn rest(&self) -> Option<usize> {
        let writing = self.writing.as_ref().filter(|writing| writing.at > 0)?;
        Some(writing.outgoing.frame.bytes.len() - writing.at)
    }

    /// The frame that has been begun, and how much of it was written.
    pub fn writing(&self) -> Option<(&Outgoing, usize)> {
        self.writing.as_ref().map(|w| (&w.outgoing, w.at))
    }
}

/// Bytes that a line of 8N1 carries in this time, rounded up.
fn bytes_in(time: Duration, baud: Option<u32>) -> usize {
    baud.map_or(0, |baud| (time.as_secs_f64() * f64::from(baud) / 10.0).ceil() as usize)
}
