//! Tests of events that are not released yet, and of bytes that arrive before the release.
use jtc_wire::{Command, FRAME_MAX, FrameStatus, HEADER, LinkEvent, Receiver, Response};

use super::{INTER_BYTE_TIMEOUT_US, ON, receiver, segment};

#[test]
fn j04_an_event_stays_until_it_is_released_and_bytes_queue_behind_it() {
    let mut receiver = receiver();
    let mut now = 0;
    // The test sends more frames, each after a gap, than the number of gaps that the receiver can store. The receiver refuses some bytes
    // at first, but must not lose a frame.
    let (mut sent, mut received) = (0, 0);
    while received < 500 {
        if sent < 500 && receiver.push(now, &ON) == ON.len() {
            sent += 1;
            now += 10_000;
        } else {
            assert!(receiver.poll(now));
            let Some(LinkEvent::Frame(frame)) = receiver.event() else { panic!("no frame") };
            assert_eq!(frame.bytes, ON);
            receiver.release();
            received += 1;
        }
    }
    assert!(!receiver.poll(now + 10_000));
}

/// The test sends each half of a frame after a gap. If the list of gaps is full, the parser refuses a half, and the
/// test sends this half again later. The parser must never join two halves.
#[test]
fn j05_gaps_are_never_forgotten() {
    for first in 0..2 {
        let mut receiver = receiver();
        let (mut now, mut piece, mut bad, mut refused) = (0, first, 0, 0);
        while piece < 300 {
            let half = if piece % 2 == 0 { &ON[..3] } else { &ON[3..] };
            if receiver.push(now, half) == 3 {
                piece += 1;
                now += 10_000;
                continue;
            }
            refused += 1;
            assert!(receiver.poll(now));
            assert!(
                matches!(receiver.event(), Some(LinkEvent::Bad(_) | LinkEvent::Noise(_))),
                "piece {piece}"
            );
            receiver.release();
            bad += 1;
        }
        while receiver.poll(now) {
            assert!(matches!(receiver.event(), Some(LinkEvent::Bad(_) | LinkEvent::Noise(_))));
            receiver.release();
            bad += 1;
        }
        assert_eq!(bad, 300 - first, "one record each");
        assert!(refused > 100);
    }
}

#[test]
fn j04_silence_behind_a_held_event_is_one_gap() {
    let mut receiver = receiver();
    receiver.push(0, &ON);
    receiver.push(0, &ON[..4]);
    for now in 0..1000 {
        assert!(receiver.poll(now * 1000));
    }
    assert_eq!(receiver.push(1_000_000, &ON), 6);
}

/// The buffer accepts only a part of the bytes. The reader passes the remaining bytes after a delay that is longer
/// than a gap, but the frame must still be complete.
#[test]
fn j03_a_slow_reader_is_no_gap() {
    let mut receiver = receiver();
    let frame = segment(1000);
    let bytes = frame.repeat(2);
    let taken = receiver.push(0, &bytes);
    assert_eq!(taken, FRAME_MAX);
    for now in [1, 100_000] {
        assert!(receiver.poll(now));
        let Some(LinkEvent::Frame(received)) = receiver.event() else { panic!("no frame") };
        assert_eq!(received.bytes, frame);
    }
    receiver.release();
    assert!(!receiver.poll(200_000));
    assert_eq!(receiver.push(200_000, &bytes[taken..]), bytes.len() - taken);
    assert!(receiver.poll(200_000));
    let Some(LinkEvent::Frame(received)) = receiver.event() else { panic!("no frame") };
    assert_eq!(received.bytes, frame);
}

/// The test sends 15,000 false headers, and each header announces tens of thousands of bytes. The parser must need
/// only a limited number of calls, each with a limited amount of work.
#[test]
fn j07_hostile_bytes_cost_little() {
    let mut receiver = receiver();
    let bytes: Vec<u8> = (0..FRAME_MAX / 4)
        .flat_map(|i| {
            let n = 14 + 36 * (i % 1666) as u16;
            [HEADER, 0x04, (n >> 8) as u8, n as u8]
        })
        .collect();
    assert_eq!(receiver.push(0, &bytes), FRAME_MAX);
    let mut polls = 0;
    loop {
        polls += 1;
        let found = receiver.poll(5000);
        receiver.release();
        if !found && !receiver.busy() {
            break;
        }
    }
    assert!((15_000 / 32..=15_000 / 14).contains(&polls), "{polls} polls");
    assert_eq!(receiver.push(6000, &ON), 6);
    assert!(receiver.poll(6000));
}

/// If the buffer is too short, the parser must refuse long frames and continue.
#[test]
fn a_short_buffer() {
    let mut receiver = Receiver::new([0; 64], INTER_BYTE_TIMEOUT_US);
    let bytes = [&segment(2)[..], &ON].concat();
    let mut rest = &bytes[..];
    let mut received = Vec::new();
    for now in 0..100 {
        rest = &rest[receiver.push(now, rest)..];
        while receiver.poll(now) || receiver.busy() {
            match receiver.event() {
                Some(LinkEvent::Bad(record) | LinkEvent::Noise(record)) => received.push(record),
                Some(LinkEvent::Frame(frame)) => {
                    assert_eq!(received, [Response::bad(0, FrameStatus::IncorrectHeader, 0)]);
                    assert_eq!(Command::parse(frame), Ok(Command::TeachingModeEnable));
                    return;
                }
                None => {}
            }
            receiver.release();
        }
    }
    panic!("the frame was not found");
}

/// Bytes in the middle of a frame are lost. The parser must report the loss with one response record (J-04), and must
/// not treat the last bytes of this frame as a frame. The parser must find the next frame at its true position.
#[test]
fn j04_lost_bytes_have_one_record_and_are_not_joined_across() {
    let mut receiver = receiver();
    let frame = segment(100);
    receiver.push(0, &ON);
    assert!(receiver.poll(0));
    assert_eq!(receiver.event_position(), Some(0));
    receiver.push(0, &frame[..500]);
    receiver.restart(1000);
    assert!(!receiver.mid_frame(), "what was held is gone");
    receiver.push(0, &frame[994..]);
    receiver.push(0, &ON);
    assert!(receiver.poll(0));
    let lost = Response { status: FrameStatus::DiscontinuousFrame, ..Response::NONE };
    assert_eq!(receiver.event(), Some(LinkEvent::Noise(lost)));
    assert_eq!(receiver.event_position(), Some(1000));
    receiver.release();
    while !receiver.poll(0) && receiver.busy() {}
    assert!(matches!(receiver.event(), Some(LinkEvent::Frame(found)) if found.bytes == ON));
    assert_eq!(receiver.event_position(), Some(1000 + frame.len() as u64 - 994));
}
