//! Queues of the response records that wait for a status frame (J-04), one queue for each host line.
use jtc_wire::Response;

/// Highest number of response records that can wait on a line. No record is lost until this number is exceeded.
pub const RECORDS_MAX: usize = 64;
/// Number of host lines.
pub const HOST_LINES: usize = 2;

/// Response records of one line, oldest first.
#[derive(Clone, Debug)]
struct ResponseQueue {
    ring: [Response; RECORDS_MAX],
    first: usize,
    len: usize,
    /// Index of the response record for noise (bytes that are not a frame), counted from the oldest record. A queue
    /// contains at most one such record.
    noise: Option<usize>,
}

impl ResponseQueue {
    const fn new() -> Self {
        Self { ring: [Response::NONE; RECORDS_MAX], first: 0, len: 0, noise: None }
    }

    fn slot(&mut self, n: usize) -> &mut Response {
        &mut self.ring[(self.first + n) % RECORDS_MAX]
    }

    /// Appends a response record to the queue. Returns `false` if the queue was full, so that a record is lost.
    ///
    /// A full queue loses its record for noise, if it contains one. If not, it loses the new record if this record is
    /// for noise, and its oldest record in all other cases.
    fn push(&mut self, response: Response, noise: bool) -> bool {
        if noise && self.noise.is_some() {
            // The record for noise that already waits also represents the new noise.
            return true;
        }
        let full = self.len == RECORDS_MAX;
        if full {
            match self.noise.take() {
                Some(place) => self.remove(place),
                None if noise => return false,
                None => drop(self.pop()),
            }
        }
        if noise {
            self.noise = Some(self.len);
        }
        *self.slot(self.len) = response;
        self.len += 1;
        !full
    }

    fn remove(&mut self, place: usize) {
        for n in place + 1..self.len {
            *self.slot(n - 1) = *self.slot(n);
        }
        self.len -= 1;
    }

    fn pop(&mut self) -> Option<Response> {
        if self.len == 0 {
            return None;
        }
        let response = *self.slot(0);
        self.first = (self.first + 1) % RECORDS_MAX;
        self.len -= 1;
        // `noise` counts from the oldest record, which was removed, so `noise` decreases by one. If the removed
        // record was the record for noise, the queue no longer contains one.
        self.noise = self.noise.and_then(|place| place.checked_sub(1));
        Some(response)
    }
}

/// Queues of the response records of all lines. A full queue does not drop records of another line.
#[derive(Clone, Debug)]
pub(crate) struct ResponseQueues {
    lines: [ResponseQueue; HOST_LINES],
    /// Index of the line whose record is sent next.
    turn: usize,
    lost: u32,
}

impl ResponseQueues {
    pub(crate) const fn new() -> Self {
        Self { lines: [const { ResponseQueue::new() }; HOST_LINES], turn: 0, lost: 0 }
    }

    /// Returns `true` if no response record waits.
    pub(crate) fn is_empty(&self) -> bool {
        self.lines.iter().all(|queue| queue.len == 0)
    }

    /// Returns the number of response records that were lost since the start because too many records were waiting.
    pub(crate) fn lost(&self) -> u32 {
        self.lost
    }

    /// Adds a response record for `line`. `noise` is `true` if the received bytes are not a frame.
    pub(crate) fn push(&mut self, line: usize, response: Response, noise: bool) {
        let kept = self.lines.get_mut(line).is_some_and(|queue| queue.push(response, noise));
        self.lost = self.lost.saturating_add(u32::from(!kept));
    }

    /// Returns the index of a line and its oldest response record. The lines take turns if several lines have a record.
    pub(crate) fn pop(&mut self) -> Option<(usize, Response)> {
        for _ in 0..HOST_LINES {
            let line = self.turn;
            self.turn = (line + 1) % HOST_LINES;
            if let Some(response) = self.lines.get_mut(line)?.pop() {
                return Some((line, response));
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use jtc_wire::{DataStatus, FrameStatus, FrameType};
    use std::vec::Vec;

    const NOISE: Response = Response::bad(0, FrameStatus::IncorrectHeader, 0);

    fn good(n: u16) -> Response {
        Response::good(FrameType::PidParam, DataStatus::NoError, n)
    }

    fn all(records: &mut ResponseQueues) -> Vec<(usize, Response)> {
        std::iter::from_fn(|| records.pop()).collect()
    }

    #[test]
    fn j04_sixty_four_records_wait_and_come_in_order() {
        let mut records = ResponseQueues::new();
        for round in 0..3 {
            (0..64).for_each(|n| records.push(0, good(100 * round + n), false));
            assert_eq!(all(&mut records), (0..64).map(|n| (0, good(100 * round + n))).collect::<Vec<_>>());
        }
        assert_eq!((records.lost(), records.is_empty()), (0, true));
    }

    #[test]
    fn j04_the_oldest_go_when_more_wait_and_are_counted() {
        let mut records = ResponseQueues::new();
        (0..100).for_each(|n| records.push(0, good(n), false));
        records.push(1, good(7), false);
        assert_eq!(records.lost(), 36);
        let left = all(&mut records);
        assert_eq!((left[0], left[1], left[2]), ((0, good(36)), (1, good(7)), (0, good(37))));
        assert_eq!(left.len(), 65);
    }

    #[test]
    fn j04_noise_joins_the_record_of_noise_that_waits() {
        let mut records = ResponseQueues::new();
        for n in 0..5 {
            records.push(0, NOISE, true);
            records.push(0, good(n), false);
            records.push(1, NOISE, true);
        }
        let left = all(&mut records);
        assert_eq!(left.iter().filter(|(_, record)| *record == NOISE).count(), 2, "one a line");
        assert_eq!(left[0], (0, NOISE));
        assert_eq!((records.lost(), left.len()), (0, 7));
        // The previous record for noise was sent, so the next noise gets a new record.
        records.push(0, good(9), false);
        records.push(0, NOISE, true);
        assert_eq!(all(&mut records), [(0, good(9)), (0, NOISE)]);
    }

    #[test]
    fn j04_noise_goes_first() {
        let mut records = ResponseQueues::new();
        (0..63).for_each(|n| records.push(0, good(n), false));
        records.push(0, NOISE, true);
        records.push(0, good(63), false);
        assert_eq!(records.lost(), 1);
        // Now 64 records of frames wait, so the queue does not accept a record for noise.
        records.push(0, NOISE, true);
        assert_eq!(records.lost(), 2);
        assert_eq!(all(&mut records), (0..64).map(|n| (0, good(n))).collect::<Vec<_>>());
    }

    /// The index of the ring must not grow without a limit, because it would overflow.
    #[test]
    fn j04_the_ring_stays_a_ring() {
        let mut queue = ResponseQueue::new();
        for n in 0..200 {
            assert!(queue.first < RECORDS_MAX, "{n}");
            queue.push(good(n), false);
            assert_eq!(queue.pop(), Some(good(n)));
        }
    }

    /// When a full queue drops its record for noise, the other response records must keep their order. The test
    /// covers several positions of the dropped record.
    #[test]
    fn j04_what_goes_for_another_leaves_the_others_in_order() {
        for place in [0, 1, 30, 62, 63] {
            let mut records = ResponseQueues::new();
            (0..place).for_each(|n| records.push(0, good(n), false));
            records.push(0, NOISE, true);
            (place..64).for_each(|n| records.push(0, good(n), false));
            assert_eq!(records.lost(), 1);
            assert_eq!(all(&mut records), (0..64).map(|n| (0, good(n))).collect::<Vec<_>>(), "{place}");
        }
    }
}
