//! Streams of statuses in all layouts, damaged statuses and noise.
use std::format;
use std::vec::Vec;

use super::sealed;
use crate::{Answer, FrameRef, FrameType, Status, StatusReceiver};

/// Returns the statuses of a complete stream, and the number of bytes that do not belong to a status. Each status is found at the first
/// position at which a status begins.
fn reference(stream: &[u8]) -> (Vec<Status>, u64) {
    let (mut found, mut skipped, mut at) = (Vec::new(), 0, 0);
    while at < stream.len() {
        let status = [165, 173, 175].into_iter().find_map(|n| {
            let frame = FrameRef::new_checked(stream.get(at..at + n)?)?;
            (frame.frame_type == FrameType::JtcStatus).then(|| Status::parse(frame.bytes))?
        });
        let returned = || {
            let n = usize::from(u16::from_be_bytes([*stream.get(at + 2)?, *stream.get(at + 3)?]));
            Answer::parse(FrameRef::new_checked(stream.get(at..at + n)?)?).map(|_| n)
        };
        match status {
            None if let Some(n) = returned() => at += n,
            Some(status) => {
                at += usize::from(u16::from_be_bytes([stream[at + 2], stream[at + 3]]));
                found.push(status);
            }
            None => {
                at += 1;
                skipped += 1;
            }
        }
    }
    (found, skipped)
}

/// Runs a script. The first byte is the length of the pieces. The steps follow: statuses generated from some bytes, damaged statuses, and
/// noise.
pub fn status_stream(data: &[u8]) {
    let Some((piece, mut rest)) = data.split_first() else { return };
    let mut stream = Vec::new();
    while let [step, more @ ..] = rest {
        let n = usize::from(step >> 3).min(more.len());
        let (bytes, more) = more.split_at(n);
        rest = more;
        let status = |len: usize| {
            let body: Vec<u8> = bytes.iter().chain(&[0x9B, 3]).copied().cycle().take(len - 6).collect();
            sealed(FrameType::JtcStatus as u8, &body)
        };
        match step % 8 {
            0 => stream.extend(status(165)),
            1 => stream.extend(status(173)),
            2 | 3 => stream.extend(status(175)),
            4 => {
                let mut broken = status(175);
                broken[bytes.first().map_or(0, |at| usize::from(*at) % 175)] ^= 0x10;
                stream.extend(broken);
            }
            5 => stream.extend(&status(175)[..n * 5]),
            7 if n > 3 => stream.extend(sealed(FrameType::Arm as u8, bytes)),
            _ => stream.extend(bytes),
        }
    }
    // With these bytes at the end, the receiver can decide whether the last candidate of the stream is valid.
    stream.extend([0; 256]);

    let mut receiver = StatusReceiver::new();
    let mut found = Vec::new();
    for mut piece in stream.chunks(usize::from(*piece) + 1) {
        while let Some(status) = receiver.next(&mut piece) {
            let again = Status::parse(&status.emit()).expect("what is sent is understood");
            assert_eq!(again.emit(), status.emit());
            if found.is_empty() {
                let _ = format!("{status} {status:#}");
            }
            found.push(status);
        }
        assert!(piece.is_empty());
    }
    let (expected, skipped) = reference(&stream);
    // The code compares bytes, because a NaN is not equal to itself.
    let bytes = |all: &[Status]| all.iter().map(|s| (s.emit(), s.gripper.is_some())).collect::<Vec<_>>();
    assert_eq!(bytes(&found), bytes(&expected));
    assert_eq!(receiver.counters().frames, expected.len() as u64);
    assert_eq!(receiver.counters().skipped_bytes + receiver.held() as u64, skipped);
}
