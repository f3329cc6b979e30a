//! Two serial lines, one controller: which line a response record goes to (J-04).
//!
//! The controller answers every event with one record, in order. So it is enough to remember the line of each
//! event: the oldest one is where the next record goes. The other line gets the same status without a record.
use jtc_wire::{STATUS_LEN, crc16, field::status as field};

/// Serial lines.
pub const LINES: usize = 2;
/// RS422.
pub const RS422: usize = 0;
/// The virtual serial port of the ST-LINK.
pub const USB: usize = 1;

/// Lines of the events whose records have not been sent, oldest first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Awaiting {
    /// Bit n: line of the n-th.
    lines: u32,
    count: u32,
}

impl Awaiting {
    /// None.
    pub const fn new() -> Self {
        Self { lines: 0, count: 0 }
    }

    /// The controller took an event from `line`. It holds fewer records than there is room for here.
    pub fn push(&mut self, line: usize) {
        if self.count < u32::BITS {
            self.lines |= u32::from(line == USB) << self.count;
            self.count += 1;
        }
    }

    /// Line of the oldest record.
    pub fn pop(&mut self) -> Option<usize> {
        let line = if self.lines & 1 == 0 { RS422 } else { USB };
        self.count = self.count.checked_sub(1)?;
        self.lines >>= 1;
        Some(line)
    }
}

/// The status carries a record.
pub fn has_record(status: &[u8; STATUS_LEN]) -> bool {
    status[field::RESPONSE_STATUS] != 0
}

/// The same status without a record.
pub fn without_record(status: &[u8; STATUS_LEN]) -> [u8; STATUS_LEN] {
    let mut idle = *status;
    idle[field::RESPONSE_TYPE..field::RESPONSE_LENGTH.end].fill(0);
    let crc = crc16(&idle[..field::CRC.start]);
    idle[field::CRC].copy_from_slice(&crc.to_be_bytes());
    idle
}

#[cfg(test)]
mod tests {
    use super::*;
    use jtc_wire::{DataStatus, FrameType, Response, Status};

    #[test]
    fn j04_records_go_where_their_frames_came_from_in_order() {
        let mut awaiting = Awaiting::new();
        let order =
            [USB, RS422, RS422, USB, USB, RS422, USB, RS422, RS422, USB, USB, USB, RS422, USB, RS422, USB];
        for round in 0..5 {
            for line in order {
                awaiting.push(line);
            }
            for line in order {
                assert_eq!(awaiting.pop(), Some(line), "round {round}");
            }
            assert_eq!(awaiting.pop(), None);
        }
        for _ in 0..100 {
            awaiting.push(USB);
        }
        assert_eq!(std::iter::from_fn(|| awaiting.pop()).count(), 32);
        assert_eq!(awaiting, Awaiting::new());
    }

    #[test]
    fn j04_the_other_line_gets_the_same_status_without_a_record() {
        let response = Response::good(FrameType::PidParam, DataStatus::NotAllowed, 126);
        let mut status =
            Status { response, fsm: 3, point: 77, gripper: Some(Default::default()), ..Default::default() };
        let sent = status.emit();
        assert!(has_record(&sent));
        status.response = Response::default();
        let idle = without_record(&sent);
        assert!(!has_record(&idle));
        assert_eq!(Status::parse(&idle), Some(status), "with a good CRC");
        assert_eq!(without_record(&idle), idle);
    }
}
