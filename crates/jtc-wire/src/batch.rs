//! Events from the parsers of all serial lines, copied in order for the controller. While the controller processes the events, the
//! parsers can accept more bytes.
use crate::event::{LinkEvent, ReceivedEvent};
use crate::frame::{FRAME_MAX, FrameRef, FrameType};
use crate::response::{DataStatus, FrameStatus, Response};

/// Maximum number of events in a batch, and of events that a controller executes in one tick.
pub const EVENTS_MAX: usize = 16;

/// Events in the order of execution. All fields are integers, so that zeroed memory is an empty batch.
pub struct EventBatch {
    /// Number of stored events, and number of events that the controller has executed.
    len: u16,
    done: u16,
    /// Number of used bytes of the byte buffer.
    used: u16,
    entries: [Entry; EVENTS_MAX],
    bytes: [u8; FRAME_MAX],
}

#[derive(Clone, Copy)]
struct Entry {
    position: u64,
    /// Position of the bytes of a frame in the byte buffer.
    start: u16,
    length: u16,
    line: u8,
    plain: u8,
    sort: u8,
    frame_type: u8,
    status: u8,
}

const FRAME: u8 = 0;
const BAD: u8 = 1;
const NOISE: u8 = 2;

impl EventBatch {
    /// Creates an empty batch.
    pub const fn new() -> Self {
        let entry =
            Entry { position: 0, start: 0, length: 0, line: 0, plain: 0, sort: 0, frame_type: 0, status: 0 };
        Self { len: 0, done: 0, used: 0, entries: [entry; EVENTS_MAX], bytes: [0; FRAME_MAX] }
    }

    /// Copies an event. Returns `false` if the batch has too few free entries or bytes for the event.
    pub fn push(&mut self, received: &ReceivedEvent<'_>) -> bool {
        let start = usize::from(self.used);
        let Some(entry) = self.entries.get_mut(usize::from(self.len)) else { return false };
        let (sort, frame_type, status, length) = match received.event {
            LinkEvent::Frame(frame) => {
                let Some(place) = self.bytes.get_mut(start..start + frame.bytes.len()) else { return false };
                place.copy_from_slice(frame.bytes);
                // A frame has at most FRAME_MAX bytes, so the sum fits into 16 bits.
                self.used += frame.bytes.len() as u16;
                (FRAME, frame.frame_type as u8, FrameStatus::NoError, frame.bytes.len() as u16)
            }
            LinkEvent::Bad(r) => (BAD, r.frame_type, r.status, r.length),
            LinkEvent::Noise(r) => (NOISE, r.frame_type, r.status, r.length),
        };
        *entry = Entry {
            position: received.position,
            start: start as u16,
            length,
            line: received.line as u8,
            plain: received.plain.into(),
            sort,
            frame_type,
            status: status as u8,
        };
        self.len += 1;
        true
    }

    /// Returns the pending event with index `n`.
    pub fn get(&self, n: usize) -> Option<ReceivedEvent<'_>> {
        let n = usize::from(self.done).checked_add(n)?;
        let entry = self.entries.get(..usize::from(self.len))?.get(n)?;
        let response = Response {
            frame_type: entry.frame_type,
            status: FrameStatus::from_byte(entry.status).unwrap_or_default(),
            data: DataStatus::Idle,
            length: entry.length,
        };
        let event = match entry.sort {
            NOISE => LinkEvent::Noise(response),
            BAD => LinkEvent::Bad(response),
            _ => {
                let start = usize::from(entry.start);
                let bytes = self.bytes.get(start..start + usize::from(entry.length))?;
                LinkEvent::Frame(FrameRef { frame_type: FrameType::from_byte(entry.frame_type)?, bytes })
            }
        };
        Some(ReceivedEvent {
            line: entry.line.into(),
            position: entry.position,
            plain: entry.plain != 0,
            event,
        })
    }

    /// Marks the oldest `count` pending events as done. When all events are done, the batch is emptied.
    pub fn done(&mut self, count: usize) {
        let left = usize::from(self.len - self.done);
        self.done += count.min(left) as u16;
        if self.done == self.len {
            (self.len, self.done, self.used) = (0, 0, 0);
        }
    }

    /// Returns `true` if no event is pending.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl Default for EventBatch {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixed;
    use std::boxed::Box;

    fn frame(bytes: &[u8]) -> LinkEvent<'_> {
        LinkEvent::Frame(FrameRef::new_checked(bytes).expect("a good frame"))
    }

    #[test]
    fn j04_events_come_out_as_they_went_in() {
        let mut batch = Box::new(EventBatch::new());
        let bad = Response::bad(4, FrameStatus::IncorrectCrc, 18_014);
        let noise = Response::bad(0, FrameStatus::IncorrectHeader, 0);
        let events =
            [frame(&fixed::STOP), LinkEvent::Bad(bad), LinkEvent::Noise(noise), frame(&fixed::PUMP_ON)];
        for round in 0..3u64 {
            for (n, event) in events.into_iter().enumerate() {
                let (line, position) = (n % 2, round + n as u64);
                assert!(batch.push(&ReceivedEvent { line, position, plain: n % 3 == 0, event }));
            }
            for (n, event) in events.into_iter().enumerate() {
                let received = batch.get(0).expect("one is left");
                let (line, position) = (n % 2, round + n as u64);
                assert_eq!(received, ReceivedEvent { line, position, plain: n % 3 == 0, event });
                assert_eq!(batch.get(1).is_none(), n == 3);
                batch.done(1);
            }
            assert!(batch.is_empty() && batch.get(0).is_none());
        }
    }

    #[test]
    fn more_than_all_is_all() {
        let mut batch = Box::new(EventBatch::new());
        for done in 0..4 {
            for position in 0..3 {
                assert!(batch.push(&ReceivedEvent {
                    line: 0,
                    position,
                    plain: true,
                    event: frame(&fixed::STOP)
                }));
                assert!(!batch.is_empty());
            }
            batch.done(done);
            assert_eq!(batch.is_empty(), done == 3);
            batch.done(4);
            assert!(batch.is_empty() && batch.get(0).is_none());
        }
    }

    #[test]
    fn j07_a_full_batch_takes_nothing_more() {
        let mut batch = Box::new(EventBatch::new());
        let stop = ReceivedEvent { line: 0, position: 0, plain: true, event: frame(&fixed::STOP) };
        assert_eq!((0..100).filter(|_| batch.push(&stop)).count(), EVENTS_MAX);
        batch.done(EVENTS_MAX + 5);
        let mut long = std::vec![0; FRAME_MAX];
        let n =
            crate::trajectory(&mut long, (0, 0, 1), 10, [crate::RawPoint::default(); 1666]).expect("it fits");
        let segment = ReceivedEvent { line: 0, position: 7, plain: false, event: frame(&long[..n]) };
        assert!(batch.push(&segment) && !batch.push(&segment), "there is room for one of that length");
        assert_eq!(batch.get(0), Some(segment));
    }
}
