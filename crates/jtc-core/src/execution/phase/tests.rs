//! Tests of the phases of an execution (J-33, J-34, J-56).
use super::*;
use crate::bit_codec::tests::Bits;

const LEAVES: [Option<TrajectoryState>; 3] =
    [None, Some(TrajectoryState::Pause), Some(TrajectoryState::Stop)];

/// Returns an approach whose clock has this time (ms) and this rate.
fn approaching(time: f64, rate: f64, leave: Option<TrajectoryState>) -> Phase {
    let mut clock = PathClock::start(1.0);
    (clock.time, clock.rate) = (time, rate);
    Phase::Approaching { from: [0.25, -0.5, 1.0, 0.0, -1.5, 2.0], length_ms: 350.0, clock, leave }
}

#[test]
fn j56_every_phase_reads_back_as_it_was_written() {
    let approaches = LEAVES.map(|leave| approaching(12.0, 0.75, leave));
    let runs = LEAVES.map(|leave| Phase::Running { leave });
    let others = [Phase::BEGIN, Phase::Waiting { elapsed_ms: 70_000 }, Phase::AtStart];
    for phase in approaches.into_iter().chain(runs).chain(others) {
        let mut bits = Bits::default();
        phase.write(&mut bits);
        // The test writes a byte after the phase. If this byte is read correctly, the phase was read to its end.
        0xA5_u8.write(&mut bits);
        assert_eq!(Phase::read(&mut bits), phase);
        assert_eq!(u8::read(&mut bits), 0xA5, "{phase:?}");
        assert!(!bits.is_damaged(), "{phase:?}");
    }
}

#[test]
fn j34_only_the_wait_before_the_approach_waits_for_the_joints() {
    assert!(Phase::BEGIN.waits() && Phase::Waiting { elapsed_ms: 9 }.waits());
    assert!(!Phase::AtStart.waits() && !Phase::Running { leave: None }.waits());
    assert!(!approaching(0.0, 1.0, None).waits());
}

/// A path goes on until the controller accepts a Pause or a Stop. This also applies to an approach after its first
/// tick. Before this tick, the arm does not move.
#[test]
fn j75_a_motion_goes_on_until_a_pause_or_stop() {
    for leave in LEAVES {
        let goes_on = leave.is_none();
        assert_eq!(Phase::Running { leave }.goes_on(), goes_on, "{leave:?}");
        assert_eq!(approaching(1.0, 1.0, leave).goes_on(), goes_on, "{leave:?}");
        assert!(!approaching(0.0, 1.0, leave).goes_on(), "the arm does not move yet");
    }
    assert!(!Phase::BEGIN.goes_on() && !Phase::AtStart.goes_on());
}

/// During the approach, path time is at rest, and the rate of the motion is the rate of the clock of the approach.
#[test]
fn j69_the_rate_of_a_motion_is_the_rate_of_its_own_clock() {
    let path = PathClock::start(0.25);
    for leave in LEAVES {
        assert_eq!(approaching(1.0, 0.75, leave).rate(&path), 0.75);
        assert_eq!(Phase::Running { leave }.rate(&path), 0.25);
    }
    assert_eq!((Phase::BEGIN.rate(&path), Phase::AtStart.rate(&path)), (0.25, 0.25));
}
