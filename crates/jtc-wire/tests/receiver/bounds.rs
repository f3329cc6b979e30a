//! Tests of the stream parser of the device at its limits: calls without bytes, a full buffer, and the work
//! of one call.
use jtc_wire::{FRAME_MAX, FrameStatus, HEADER, LinkEvent, Receiver, fixed};

use super::{INTER_BYTE_TIMEOUT_US, ON, receiver};

/// A call without bytes must not reset the timeout of an incomplete frame.
#[test]
fn j03_no_bytes_end_no_silence() {
    let mut receiver = Receiver::new([0; 64], INTER_BYTE_TIMEOUT_US);
    assert_eq!(receiver.push(0, &ON[..4]), 4);
    assert_eq!(receiver.push(4000, &[]), 0);
    assert!(receiver.poll(5000));
    let Some(LinkEvent::Bad(record)) = receiver.event() else { panic!("no gap was seen") };
    assert_eq!(record.status, FrameStatus::DiscontinuousFrame);
}

#[test]
fn a_frame_that_waits_to_be_released_is_not_the_middle_of_one() {
    let mut receiver = Receiver::new([0; 64], INTER_BYTE_TIMEOUT_US);
    for _ in 0..2 {
        receiver.push(0, &ON);
        assert!(receiver.mid_frame(), "nobody has looked yet");
        assert!(receiver.poll(0));
        assert!(!receiver.mid_frame(), "the frame is whole");
        receiver.push(0, &ON[..3]);
        assert!(receiver.mid_frame(), "the next one has begun");
        receiver.release();
        assert!(receiver.mid_frame());
        receiver.push(0, &ON[3..]);
        assert!(receiver.poll(0));
        receiver.release();
        assert!(!receiver.mid_frame());
    }
}

#[test]
fn a_frame_as_long_as_the_buffer_fits() {
    let mut receiver = Receiver::new([0; 7], INTER_BYTE_TIMEOUT_US);
    for _ in 0..3 {
        assert_eq!(receiver.push(0, &fixed::STOP), 7);
        assert!(receiver.poll(0));
        assert!(matches!(receiver.event(), Some(LinkEvent::Frame(frame)) if frame.bytes == fixed::STOP));
        receiver.release();
    }
}

/// The parser must copy each byte once, when it arrives, unless the buffer has no space after the held
/// bytes.
#[test]
fn j07_held_bytes_stay_where_they_are_while_there_is_room() {
    let mut receiver = Receiver::new([0; 64], INTER_BYTE_TIMEOUT_US);
    receiver.push(0, &ON);
    assert!(receiver.poll(0));
    receiver.release();
    receiver.push(0, &ON);
    assert!(receiver.poll(0));
    let place = |receiver: &Receiver<[u8; 64]>| match receiver.event() {
        Some(LinkEvent::Frame(frame)) => frame.bytes.as_ptr(),
        _ => panic!("no frame"),
    };
    let before = place(&receiver);
    for n in [1, 51] {
        assert_eq!(receiver.push(0, &[HEADER; 51][..n]), n);
        assert_eq!(place(&receiver), before, "the buffer is not yet full");
    }
    assert_eq!(receiver.push(0, &[HEADER; 20]), 6, "the bytes of the first frame are free");
    assert_ne!(place(&receiver), before);
}

/// A call of `poll` must skip at most 2,048 bytes, so that it does not delay a tick (J-07).
#[test]
fn j07_noise_is_passed_over_in_bounded_steps() {
    let mut receiver = receiver();
    assert_eq!(receiver.push(0, &[0; FRAME_MAX]), FRAME_MAX);
    assert!(receiver.poll(0));
    receiver.release();
    let mut polls = 1;
    while receiver.poll(0) || receiver.busy() {
        polls += 1;
        assert!(polls < FRAME_MAX, "it makes no progress");
    }
    assert!(polls >= FRAME_MAX / 2048, "{polls} polls");
    assert!(!receiver.mid_frame(), "all is passed over");
}
