//! The host's stream parser: finds JtcStatus frames and answers to extension requests in bytes that arrive in pieces of any length.
use crate::extension::Answer;
use crate::frame::{FrameRef, FrameType, HEADER, field};
use crate::layout::ANSWER_MAX;
use crate::status::Status;

/// Counters of the bytes and statuses received so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct StatusCounters {
    /// Number of valid statuses.
    pub frames: u64,
    /// Number of byte sequences that looked like a frame of the device but had a wrong CRC or body.
    pub bad_frames: u64,
    /// Number of bytes that do not belong to a valid frame.
    pub skipped_bytes: u64,
}

/// A frame from the device.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)]
pub enum FromDevice<'a> {
    /// Status of the controller.
    Status(Status),
    /// Answer to an extension request (J-50).
    Answer(Answer<'a>),
}

/// Stream parser of the host, for statuses of 165, 173 and 175 bytes (J-08) and for answers to extension requests. The parser
/// resynchronises after noise and lost bytes, and finds every valid frame that follows them.
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
    held: [u8; ANSWER_MAX],
    len: usize,
    /// Number of bytes at the start of `held` that were already returned to the caller. The next call removes these bytes.
    used: usize,
    counters: StatusCounters,
}

impl Default for StatusReceiver {
    fn default() -> Self {
        Self::new()
    }
}

/// Result of the scan at the first held byte.
enum ScanResult {
    /// The first held byte is not the start of a frame of the device.
    Nothing,
    /// The scan needs this number of bytes to decide.
    Needs(usize),
}

impl StatusReceiver {
    /// Creates a parser without held bytes.
    pub const fn new() -> Self {
        Self {
            held: [0; ANSWER_MAX],
            len: 0,
            used: 0,
            counters: StatusCounters { frames: 0, bad_frames: 0, skipped_bytes: 0 },
        }
    }

    /// Removes bytes from the start of `bytes` until a status is complete. Returns `None` if `bytes` becomes empty before a status is
    /// complete. Skips answers to extension requests.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Status> {
        loop {
            if let FromDevice::Status(status) = self.next_frame(bytes)? {
                return Some(status);
            }
        }
    }

    /// Removes bytes from the start of `bytes` until a frame is complete. Returns `None` if `bytes` becomes empty before a frame is
    /// complete.
    pub fn next_frame(&mut self, bytes: &mut &[u8]) -> Option<FromDevice<'_>> {
        self.drop_front(self.used);
        self.used = 0;
        let n = loop {
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
                ScanResult::Needs(n) if parse(&self.held[..n]).is_some() => break n,
                ScanResult::Needs(_) => {
                    self.counters.bad_frames += 1;
                    self.skip();
                }
            }
        };
        self.used = n;
        let frame = parse(&self.held[..n])?;
        self.counters.frames += u64::from(matches!(frame, FromDevice::Status(_)));
        Some(frame)
    }

    /// Returns the bytes of the last frame that [`next_frame`](Self::next_frame) returned, so that a program can forward them.
    pub fn frame_bytes(&self) -> &[u8] {
        self.held.get(..self.used).unwrap_or(&[])
    }

    /// Returns the counters of bytes and statuses.
    pub fn counters(&self) -> StatusCounters {
        self.counters
    }

    /// Returns the number of held bytes, which may be the beginning of a frame.
    pub fn held(&self) -> usize {
        self.len - self.used
    }

    /// Discards the held bytes. The caller must call this function after it has closed the line and opened it again.
    pub fn clear(&mut self) {
        self.counters.skipped_bytes += self.held() as u64;
        (self.len, self.used) = (0, 0);
    }

    /// Skips the first held byte and all bytes up to the next header.
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

fn parse(bytes: &[u8]) -> Option<FromDevice<'_>> {
    let frame = FrameRef::new_checked(bytes)?;
    match frame.frame_type {
        FrameType::JtcStatus => Status::parse(bytes).map(FromDevice::Status),
        _ => Answer::parse(frame).map(FromDevice::Answer),
    }
}

fn scan(held: &[u8]) -> ScanResult {
    let Some((&header, rest)) = held.split_first() else { return ScanResult::Needs(field::LENGTH.end) };
    let kind = match rest.first() {
        _ if header != HEADER => return ScanResult::Nothing,
        None => return ScanResult::Needs(field::LENGTH.end),
        Some(&kind) => FrameType::from_byte(kind).filter(|kind| !kind.from_host()),
    };
    let Some(kind) = kind else { return ScanResult::Nothing };
    match held.get(field::LENGTH) {
        None => ScanResult::Needs(field::LENGTH.end),
        Some(n) => match usize::from(u16::from_be_bytes([n[0], n[1]])) {
            // Statuses and answers are never longer than `ANSWER_MAX`, so `min` does not change the length.
            n if kind.can_have(n) => ScanResult::Needs(n.min(ANSWER_MAX)),
            _ => ScanResult::Nothing,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn j50_statuses_are_found_among_what_requests_return() {
        let mut out = [0; ANSWER_MAX];
        let arm = Answer::Arm { offset: 7, total: 1900, bytes: &[0x9B; 246] };
        let n = arm.emit(&mut out).expect("it fits");
        assert_eq!(n, ANSWER_MAX);
        let status = Status { gripper: Some(Default::default()), ..Status::default() };
        let stream =
            [&[0x9B, 0x50][..], &out, &status.emit(), &[0x9B; 3], &out, &out, &status.emit()].concat();
        for piece in [1, 2, 3, 7, 255, 256, 1000] {
            let (mut receiver, mut kinds, mut statuses) = (StatusReceiver::new(), Vec::new(), 0);
            let mut only_statuses = StatusReceiver::new();
            for mut bytes in stream.chunks(piece) {
                let mut again = bytes;
                while let Some(frame) = receiver.next_frame(&mut bytes) {
                    match frame {
                        FromDevice::Status(found) => {
                            assert_eq!(found, status);
                            kinds.push('s');
                        }
                        FromDevice::Answer(found) => {
                            assert_eq!(found, arm);
                            kinds.push('a');
                        }
                    }
                }
                while only_statuses.next(&mut again).is_some() {
                    statuses += 1;
                }
            }
            assert_eq!((kinds, statuses), (['a', 's', 'a', 'a', 's'].to_vec(), 2), "pieces of {piece}");
            assert_eq!(
                (receiver.counters().frames, receiver.counters().skipped_bytes, receiver.held()),
                (2, 5, 0)
            );
        }
    }

    #[test]
    fn j04_j08_a_status_that_is_passed_on_has_another_record_and_nothing_else_changed() {
        use crate::response::{DataStatus, Response};
        let emitted = Status { point: 77, ..Status::default() }.emit();
        let record = Response::good(FrameType::GetInfo, DataStatus::NotAllowed, 6);
        // The test includes the layout without a gripper and the layout with a short point index.
        for (cut, length) in [(0..0, 175), (163..173, 165), (17..19, 173)] {
            let mut bytes: Vec<u8> =
                emitted.iter().enumerate().filter(|(i, _)| !cut.contains(i)).map(|(_, b)| *b).collect();
            bytes[field::LENGTH].copy_from_slice(&(length as u16).to_be_bytes());
            let end = length - field::CRC_LEN;
            let crc = crate::crc16(&bytes[..end]);
            bytes[end..].copy_from_slice(&crc.to_be_bytes());
            let before = Status::parse(&bytes).expect("it is a status");
            let mut receiver = StatusReceiver::new();
            assert!(receiver.next_frame(&mut &bytes[..]).is_some());
            let mut passed = receiver.frame_bytes().to_vec();
            assert_eq!(passed, bytes);
            assert!(Status::replace_response(&mut passed, &record));
            assert_eq!(Status::parse(&passed), Some(Status { response: record, ..before }));
            passed[40] ^= 1;
            assert!(!Status::replace_response(&mut passed, &record), "it is damaged");
        }
        let mut info = crate::fixed::GET_INFO;
        assert!(!Status::replace_response(&mut info, &record));
    }
}
