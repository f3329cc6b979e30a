//! Begin, snapshots and end of a log, and the pages that hosts read (J-56).
extern crate std;
use std::vec::Vec;

use jtc_bus::Frame;
use jtc_wire::{Answer, FrameRef, FrameType, LinkEvent, LogState};

use super::bench::{Bench, OUTPUTS};
use crate::extension::state::LogRequest;
use crate::io::{HostEvent, Outputs};
use crate::recorder::{chain, check};
use crate::{ControllerState, TrajectoryState};

/// A frame of more than 48 bytes, which the log does not contain.
const LONG: HostEvent<'_> = HostEvent {
    line: 0,
    overtaken: false,
    plain: false,
    event: LinkEvent::Frame(FrameRef { frame_type: FrameType::ClearOccurredErrors, bytes: &[0; 49] }),
};

/// The first tick of a log is recorded as a snapshot. After every 500 ticks, the next snapshot follows.
#[test]
fn j56_a_snapshot_follows_after_every_500_ticks() {
    let mut bench = Bench::new();
    bench.record(1 + 1_000);
    assert_eq!(bench.ticks_after_snapshots(), [500, 500, 0]);
}

/// After an input that is not in the log, the next snapshot follows 250 ticks after the last snapshot. If 250 ticks
/// have already passed, the next snapshot follows at once.
#[test]
fn j56_the_next_snapshot_comes_early_after_a_frame_that_is_not_in_the_log() {
    for (omitted_at, expected) in [(10, [250, 500, 250]), (250, [250, 500, 250]), (300, [300, 500, 200])] {
        let mut bench = Bench::new();
        bench.record(1 + omitted_at - 1);
        bench.record_event(&[LONG]);
        bench.record(1_000 - omitted_at);
        assert_eq!(bench.ticks_after_snapshots(), expected, "omitted in tick {omitted_at}");
    }
}

/// If a host sends parameters again and again, the snapshot does not wait for the hash of the arm for more than 1,000 ticks.
#[test]
fn j56_a_snapshot_waits_at_most_1000_ticks_for_the_hash_of_the_arm() {
    let mut bench = Bench::new();
    bench.record(1);
    for _ in 0..1_001 {
        bench.controller.extensions.forget_hash();
        bench.record(1);
        assert_eq!(bench.controller.extensions.hash, None);
    }
    assert_eq!(bench.ticks_after_snapshots(), [1_000, 1]);
}

#[test]
fn j56_the_log_stops_300_ms_after_the_first_error_whatever_follows() {
    let mut bench = Bench::new();
    bench.controller.state = ControllerState::HoldPos;
    bench.record(10);
    bench.controller.errors.raise_device();
    bench.record(1);
    // The error is cleared 99 ticks later, and the torque comes back at once.
    bench.controller.state = ControllerState::Error;
    bench.record(98);
    bench.controller.errors.clear_current();
    bench.controller.state = ControllerState::HoldPos;
    bench.record(1);
    // A second error begins after 100 ticks. The log still stops 300 ticks after the first error.
    bench.controller.errors.raise_device();
    bench.record(200);
    assert_eq!(bench.recorder.state(), LogState::Recording);
    bench.record(1);
    assert_eq!(bench.recorder.state(), LogState::Error);
    // The log contains 9 ticks before the error, the tick of the error, and 300 ticks after the error.
    assert_eq!(bench.ticks_after_snapshots(), [310]);
}

#[test]
fn j56_a_log_that_has_not_stopped_continues_when_the_torque_comes_on() {
    let mut bench = Bench::new();
    bench.record(1 + 10);
    bench.controller.state = ControllerState::HoldPos;
    bench.record(5);
    assert_eq!(bench.ticks_after_snapshots(), [15]);
}

#[test]
fn j56_a_log_begins_with_the_hash_of_the_arm_or_with_an_error() {
    let mut bench = Bench::unnamed();
    bench.record(1);
    assert_eq!(bench.controller.extensions.hash, None);
    assert_eq!(bench.blocks().len(), 0);
    bench.controller.errors.raise_device();
    bench.record(1);
    assert_eq!(bench.ticks_after_snapshots(), [0]);
    bench.record(299);
    assert_eq!(bench.recorder.state(), LogState::Recording);
    bench.record(1);
    assert_eq!(bench.recorder.state(), LogState::Error);
}

#[test]
fn j56_a_get_log_before_the_log_begins_does_not_pause_the_recording() {
    let mut bench = Bench::unnamed();
    bench.controller.extensions.log_request = Some(LogRequest::Page { line: 0, block: 0, offset: 0 });
    bench.record(1);
    assert_eq!(bench.blocks().len(), 0);
    bench.controller.extensions.hash = Some(7);
    bench.record(4);
    assert_eq!(bench.ticks_after_snapshots(), [3]);
}

/// A page contains the bytes from the requested offset, which the recorder rounds down to a whole word.
#[test]
fn j56_a_page_begins_at_the_requested_word() {
    let mut bench = Bench::new();
    bench.record(200);
    let block = bench.blocks()[0];
    for (requested, offset, word) in [(0, 0, 0), (8, 8, 2), (10, 8, 2), (232, 232, 58), (1_023, 1_020, 255)] {
        bench.controller.extensions.log_request =
            Some(LogRequest::Page { line: 0, block: 0, offset: requested });
        bench.record(1);
        assert_eq!(bench.controller.extensions.answers.send(), Some(0));
        let frame = FrameRef::new_checked(bench.controller.answer_frame()).expect("a valid frame");
        let Some(Answer::Log(page)) = Answer::parse(frame) else { panic!("not a Log frame") };
        let bytes: Vec<u8> = block[word..].iter().flat_map(|word| word.to_le_bytes()).take(232).collect();
        assert_eq!((page.offset, page.block, page.bytes), (offset, 0, &bytes[..]), "{requested}");
    }
}

/// Two ticks that differ in one word of the outputs never have the same check value, because each step of the
/// computation is reversible. The states are combined in one word: errors << 16 | state << 8 | trajectory << 4 |
/// safety output.
#[test]
fn j56_the_check_value_depends_on_every_output() {
    use ControllerState::{HoldPos, Init};
    use TrajectoryState::{Null, Pause};
    let mut bench = Bench::new();
    let mut values = Vec::new();
    let frame = |id, bytes: &[u8]| Frame::new(id, bytes);
    let moves = |at: usize| {
        let mut bytes = [0; 16];
        bytes[at] = 1;
        Frame::new(0x020, &bytes)
    };
    let mut add = |before, errors, state, trajectory, safety_output, bus| {
        (bench.controller.state, bench.controller.trajectory) = (state, trajectory);
        values.push(chain(before, &bench.controller, errors, &Outputs { bus, safety_output, ..OUTPUTS }));
    };
    add(0, 0, Init, Null, false, None);
    // Rotated left by 5 bits, this check value of the earlier ticks becomes 0x8000_0000. The combined words of the
    // states below are all different from 0x8000_0000.
    add(0x0400_0000, 0, Init, Null, false, None);
    add(0, 1, Init, Null, false, None);
    add(0, 2, Init, Null, false, None);
    add(0, 0, HoldPos, Null, false, None);
    add(0, 0, Init, Pause, false, None);
    add(0, 0, Init, Null, true, None);
    for (n, value) in values.iter().enumerate() {
        assert!(!values[n + 1..].contains(value), "{n} of {values:x?}");
    }
    let mut values = Vec::new();
    let frames = [frame(0x020, &[0; 16]), frame(0x010, &[0; 16])];
    let frames = frames.into_iter().chain([0, 4, 8, 12, 15].map(moves));
    let others = [frame(0x030, &[0, 0]), frame(0x030, &[1, 0]), frame(0x030, &[0, 1])];
    for bus in frames.chain(others) {
        assert!(bus.is_some());
        values.push(chain(0, &bench.controller, 0, &Outputs { bus, ..OUTPUTS }));
    }
    for (n, value) in values.iter().enumerate() {
        assert!(!values[n + 1..].contains(value), "frame {n} of {values:x?}");
    }
}

/// The log contains the high half of the check value.
#[test]
fn j56_the_recorded_check_value_is_the_high_half() {
    for (value, expected) in [(0xABCD_1234, 0xABCD), (0x0001_0000, 1), (0x0000_FFFF, 0)] {
        assert_eq!(check(value), expected, "{value:x}");
    }
}
