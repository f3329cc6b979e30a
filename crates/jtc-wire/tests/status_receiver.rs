//! Tests of the status parser of the host: the counters of the parser, and bytes for which it must not wait.
use jtc_wire::{STATUS_LEN, Status, StatusReceiver};

/// Passes all bytes to the parser at once and returns the number of statuses found.
fn feed(receiver: &mut StatusReceiver, mut bytes: &[u8]) -> usize {
    core::iter::from_fn(|| receiver.next(&mut bytes)).count()
}

#[test]
fn j08_what_is_no_status_is_not_waited_for() {
    let status = Status::default().emit();
    for noise in
        [&[0x9B, 0x04, 0, 175][..], &[0x00, 0x03, 0, 175], &[0x9B, 0x03, 0, 174], &[0x00, 0x04, 0, 175]]
    {
        let mut receiver = StatusReceiver::new();
        assert_eq!(feed(&mut receiver, noise), 0);
        assert_eq!(feed(&mut receiver, &status), 1, "behind {noise:02X?}");
        assert_eq!(receiver.counters().bad_frames, 0, "it never looked like a status");
        assert_eq!(receiver.counters().skipped_bytes, noise.len() as u64);
    }
}

#[test]
fn j08_a_wrong_crc_is_counted_once() {
    let mut receiver = StatusReceiver::new();
    let status = Status::default().emit();
    let mut bad = status;
    bad[STATUS_LEN - 1] ^= 1;
    assert_eq!(feed(&mut receiver, &[bad, status, bad, status].concat()), 2);
    let counters = receiver.counters();
    assert_eq!((counters.frames, counters.bad_frames), (2, 2));
    assert_eq!(counters.skipped_bytes, 2 * STATUS_LEN as u64);
}

/// The test closes a line and opens it again. The half of a status that arrived before must not be joined to the bytes after
/// it.
#[test]
fn j08_what_is_held_can_be_forgotten() {
    let mut receiver = StatusReceiver::new();
    let status = Status::default().emit();
    for round in 1..=2 {
        assert_eq!(feed(&mut receiver, &status[..100]), 0);
        assert_eq!(receiver.held(), 100);
        receiver.clear();
        assert_eq!((receiver.held(), receiver.counters().skipped_bytes), (0, 100 * round));
        assert_eq!(feed(&mut receiver, &status), 1);
        assert_eq!((receiver.held(), receiver.counters().frames), (0, round));
    }
}
