//! Second stream parser, used as a reference for the stream parser of the device. The reference parser is slow and needs the complete
//! stream, so its correctness is easy to verify.
use std::vec::Vec;

use crate::{FrameRef, FrameStatus, Response};

/// Event in the stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// Bytes of a valid frame.
    Frame(Vec<u8>),
    /// Run of bytes that do not belong to a valid frame.
    Bad(Response),
}

/// Returns the events of a stream. `regions` are the parts of the stream between gaps; `capacity` is the length of the longest frame that
/// fits into the buffer.
pub fn events(regions: &[Vec<u8>], capacity: usize) -> Vec<Event> {
    placed_events(regions, capacity).into_iter().map(|(_, event)| event).collect()
}

/// Like `events`, and also returns the position of the first byte of each event in the stream.
pub(super) fn placed_events(regions: &[Vec<u8>], capacity: usize) -> Vec<(u64, Event)> {
    let mut all = Vec::new();
    let mut begin = 0;
    for region in regions {
        all.extend(of_region(region, capacity).into_iter().map(|(at, event)| (begin + at as u64, event)));
        begin += region.len() as u64;
    }
    all
}

/// Returns the positions in the stream at which a Stop or a Pause ends, including a Stop or a Pause inside other frames.
pub(super) fn urgent_ends(regions: &[Vec<u8>]) -> Vec<u64> {
    let mut all = Vec::new();
    let mut begin = 0;
    for region in regions {
        let ends = region.windows(7).enumerate().filter(|(_, bytes)| {
            FrameRef::new_checked(bytes)
                .is_some_and(|frame| frame.bytes[1] == 0x0B && matches!(bytes[4], 1 | 2))
        });
        all.extend(ends.map(|(at, _)| begin + at as u64 + 7));
        begin += region.len() as u64;
    }
    all
}

fn of_region(region: &[u8], capacity: usize) -> Vec<(usize, Event)> {
    let mut found = Vec::new();
    let mut run = None;
    let mut at = 0;
    while at < region.len() {
        if let Some(n) = good_frame(&region[at..], capacity) {
            found.extend(run.take().map(|from| (from, Event::Bad(judge(&region[from..], capacity)))));
            found.push((at, Event::Frame(region[at..at + n].to_vec())));
            at += n;
        } else {
            run.get_or_insert(at);
            at += 1;
        }
    }
    found.extend(run.map(|from| (from, Event::Bad(judge(&region[from..], capacity)))));
    found
}

/// Returns the length of the valid frame at the start of the bytes, or `None` if the bytes do not start with one.
fn good_frame(bytes: &[u8], capacity: usize) -> Option<usize> {
    let n = usize::from(u16::from_be_bytes([*bytes.get(2)?, *bytes.get(3)?]));
    let frame = FrameRef::new_checked(bytes.get(..n)?)?;
    let of_device = matches!(frame.frame_type as u8, 3 | 0x50..);
    (!of_device && n <= capacity).then_some(n)
}

/// Returns the response record of bytes that do not begin with a valid frame and end at a gap.
fn judge(bytes: &[u8], capacity: usize) -> Response {
    let record = |kind, status, length: usize| Response::bad(kind, status, length as u16);
    if bytes[0] != 0x9B {
        return record(0, FrameStatus::IncorrectHeader, 0);
    }
    if bytes.len() == 1 {
        return record(0, FrameStatus::DiscontinuousFrame, 1);
    }
    let known = matches!(bytes[1], 1 | 2 | 4..=0x11 | 0x40..=0x47 | 0x4C..=0x4E);
    if !known {
        return record(bytes[1], FrameStatus::IncorrectFrameType, 0);
    }
    if bytes.len() < 4 {
        return record(bytes[1], FrameStatus::DiscontinuousFrame, bytes.len());
    }
    let n = usize::from(bytes[2]) * 256 + usize::from(bytes[3]);
    if n < 6 || n > capacity {
        return record(0, FrameStatus::IncorrectHeader, 0);
    }
    let possible = match bytes[1] {
        0x01 => n == 6 || n == 10,
        0x04 => n >= 14 && (n - 14) % 36 == 0,
        0x05 => n == 10566,
        0x07 => n == 126,
        0x09 => n == 538,
        0x0B => n == 7,
        0x0E => n == 6 || n == 102 || n == 150,
        0x10 | 0x11 => n == 10,
        0x41 | 0x44 | 0x4E => n == 8,
        0x42 => (16..=2566).contains(&n) && (n - 6) % 10 == 0,
        0x43 => n == 38,
        0x47 => n == 30,
        0x4C => n == 12,
        _ => n == 6,
    };
    match () {
        () if !possible => record(bytes[1], FrameStatus::IncorrectFrameType, n),
        () if bytes.len() < n => record(bytes[1], FrameStatus::DiscontinuousFrame, bytes.len()),
        () => record(bytes[1], FrameStatus::IncorrectCrc, n),
    }
}
