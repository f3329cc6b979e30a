//! A host on a serial line, with the bytes that it sent and received.
use std::collections::VecDeque;

use jtc_wire::{Answer, FrameRef, FromDevice, Info, Response, Status, StatusReceiver};
use openjtc_emulator::WireByte;
use openjtc_emulator::clock::Time;

use super::flight::Event;

/// A simulated host on a serial line.
#[derive(Default)]
pub struct Host {
    /// All bytes that the host sent.
    pub sent: Vec<u8>,
    /// Number of sent bytes up to the end of the last frame that the board has executed.
    found: usize,
    /// Bytes that the host must receive next, which are the statuses of the shadow controller.
    pub expected: VecDeque<u8>,
    receiver: StatusReceiver,
    /// The newest status that the host received.
    pub last: Option<Status>,
    /// The newest Info that the host received.
    pub info: Option<Info>,
    /// Times at which the host received the last byte of each status.
    pub times: Vec<Time>,
    /// Response records that the host received, oldest first.
    pub records: Vec<Response>,
    /// Number of bytes that the host received.
    pub received: u64,
    /// Time of the last board reset, as long as bytes from before the reset may still arrive; otherwise `None`.
    reset: Option<Time>,
}

impl Host {
    /// Receives bytes from the board. Each byte must equal the next byte of the shadow controller.
    pub fn receive(&mut self, bytes: &[WireByte]) {
        for byte in bytes {
            self.received += 1;
            // Bytes that were on the line when the board was reset are lost.
            if self.reset.is_some_and(|reset| byte.end < reset) {
                continue;
            }
            if let Some(expected) = self.expected.pop_front() {
                assert_eq!(byte.byte, expected, "byte {} from the device", self.received);
            } else {
                panic!("byte {} from the device, {:#04x}, belongs to no status", self.received, byte.byte);
            }
            let mut one = &[byte.byte][..];
            match self.receiver.next_frame(&mut one) {
                Some(FromDevice::Status(status)) => {
                    self.records.extend(status.response());
                    self.last = Some(status);
                    self.times.push(byte.end);
                }
                Some(FromDevice::Answer(Answer::Info(info))) => self.info = Some(info),
                Some(FromDevice::Answer(_)) | None => {}
            }
        }
    }

    /// Returns the numbers of statuses, invalid frames and invalid bytes that the host received.
    pub fn counters(&self) -> jtc_wire::StatusCounters {
        self.receiver.counters()
    }

    /// Drops all bytes that are in transmission, because the board was reset.
    pub fn device_was_reset(&mut self, time: Time) {
        self.reset = Some(time);
        self.expected.clear();
        self.receiver.clear();
    }

    /// Returns the bytes of a frame that the board has recorded. The host must have sent these bytes after the last
    /// recorded frame.
    pub fn frame(&self, event: &Event) -> Vec<u8> {
        let length = usize::from(event.len);
        let (_, bytes) = self.place(event);
        assert_eq!(bytes.len(), length);
        bytes.to_vec()
    }

    fn place(&self, event: &Event) -> (usize, &[u8]) {
        let length = usize::from(event.len);
        let [high, low] = event.crc.to_be_bytes();
        let rest = &self.sent[self.found..];
        rest.windows(length)
            .enumerate()
            .find(|(_, bytes)| {
                bytes[..2] == [0x9B, event.frame_type]
                    && bytes[length - 2..] == [high, low]
                    && FrameRef::new_checked(bytes).is_some()
            })
            .unwrap_or_else(|| panic!("the host sent no frame like {event:?}"))
    }

    /// Records that the board has executed this frame.
    pub fn done(&mut self, event: &Event) {
        let (at, bytes) = self.place(event);
        self.found += at + bytes.len();
    }
}
