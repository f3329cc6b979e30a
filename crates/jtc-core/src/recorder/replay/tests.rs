//! Comparison of a replay with the log: which ticks agree, which differ, and which are uncertain (J-56).
extern crate std;
use std::boxed::Box;
use std::vec::Vec;

use jtc_wire::{FrameRef, LinkEvent, fixed};

use super::Unsure::{Arm, Input, Points};
use super::*;
use crate::recorder::block::{head, sealed_block};
use crate::recorder::tests::bench::Bench;
use crate::{Config, TrajectoryState};
use Outcome::{Differs, Same, Unsure};

fn frame(frame_type: FrameType, bytes: &[u8]) -> HostEvent<'_> {
    let event = LinkEvent::Frame(FrameRef { frame_type, bytes });
    HostEvent { line: 0, overtaken: false, plain: false, event }
}

/// Host event of a recorded tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Host {
    Quiet,
    /// A frame of more than 48 bytes, which the log does not contain.
    Long,
    StoreArm,
    /// A TrajSetExecStatus.
    Exec,
}

impl Host {
    fn events(self) -> Vec<HostEvent<'static>> {
        match self {
            Self::Quiet => Vec::new(),
            Self::Long => Vec::from([frame(FrameType::ClearOccurredErrors, &[0; 49])]),
            Self::StoreArm => Vec::from([frame(FrameType::StoreArm, &fixed::STORE_ARM)]),
            Self::Exec => Vec::from([frame(FrameType::TrajSetExecStatus, &fixed::STOP)]),
        }
    }
}

/// Returns a replay of the log of a bench, by another controller with the same arm.
fn replay(blocks: &[Block], points_hash: Option<u32>) -> Replay<'_, [RawPoint; 4]> {
    let controller = Box::new(Controller::new(Config::avena(), [RawPoint::default(); 4]));
    Replay::new(Log::new(blocks), *controller, points_hash)
}

/// Parts of the replay of a log.
struct Replayed {
    ticks: Vec<Outcome>,
    /// Outcomes of the steps that are snapshots.
    snapshots: Vec<Outcome>,
}

fn replayed(bench: &Bench, points_hash: Option<u32>) -> Replayed {
    let blocks = bench.blocks();
    let mut all = Replayed { ticks: Vec::new(), snapshots: Vec::new() };
    for step in replay(&blocks, points_hash) {
        assert_eq!(step.inputs.is_some(), step.outputs.is_some());
        let list = if step.inputs.is_some() { &mut all.ticks } else { &mut all.snapshots };
        list.push(step.outcome);
    }
    all
}

/// Each case is a list of ticks. Each tick has a host event, and a flag that is `true` if the recorded outputs differ
/// from the outputs of the controller. A snapshot and a quiet tick follow each list.
#[test]
fn j56_each_tick_of_a_replay_has_its_outcome() {
    use Host::{Exec, Long, Quiet, StoreArm};
    const ARM: Outcome = Unsure(Arm);
    const INPUT: Outcome = Unsure(Input);
    const POINTS: Outcome = Unsure(Points);
    type Case<'a> = (bool, bool, &'a [(Host, bool)], &'a [Outcome]);
    // The first two columns show whether the arm and the points are known.
    let cases: &[Case<'_>] = &[
        (true, true, &[(Quiet, false), (Quiet, true), (Quiet, false)], &[Same, Differs, Differs, Same]),
        // A frame whose bytes are not in the log may have had no effect. The replay assumes this until the outputs
        // differ.
        (true, true, &[(Long, false), (Quiet, false), (Quiet, false)], &[Same, Same, Same, Same]),
        (true, true, &[(Long, false), (Quiet, true), (Quiet, false)], &[Same, INPUT, INPUT, Same]),
        (true, true, &[(Long, true), (Quiet, false)], &[INPUT, INPUT, Same]),
        (true, true, &[(StoreArm, false), (Quiet, true)], &[Same, INPUT, Same]),
        (true, true, &[(StoreArm, true), (Quiet, false)], &[INPUT, INPUT, Same]),
        // After a difference, a frame that is not in the log does not change the outcome to unsure.
        (true, true, &[(Quiet, true), (Long, false), (Exec, false)], &[Differs, Differs, Differs, Same]),
        (true, false, &[(Quiet, true), (Exec, false)], &[Differs, Differs, Same]),
        (true, true, &[(Exec, false), (Quiet, false), (Quiet, true)], &[Same, Same, Differs, Same]),
        (true, true, &[(Exec, true)], &[Differs, Same]),
        (true, false, &[(Quiet, false), (Exec, false), (Quiet, false)], &[Same, POINTS, POINTS, Same]),
        (true, false, &[(StoreArm, false), (Exec, true)], &[Same, INPUT, Same]),
        (false, true, &[(Quiet, false), (Quiet, true), (Long, false)], &[ARM, ARM, ARM, ARM]),
        (false, false, &[(Long, false), (StoreArm, false), (Exec, false)], &[ARM, ARM, ARM, ARM]),
    ];
    for (arm, points, ticks, expected) in cases {
        let mut bench = Bench::new();
        if !arm {
            bench.controller.extensions.hash = Some(1);
        }
        bench.tick(&[], false);
        for (host, differs) in *ticks {
            bench.tick(&host.events(), *differs);
        }
        bench.snapshot();
        bench.tick(&[], false);
        let points_hash =
            if *points { bench.controller.points_hash() } else { !bench.controller.points_hash() };
        let replayed = replayed(&bench, Some(points_hash));
        assert_eq!(replayed.ticks, *expected, "arm {arm}, points {points}: {ticks:?}");
        // The second snapshot belongs to a tick that was already replayed.
        assert_eq!(replayed.snapshots, [if *arm { Same } else { ARM }], "{ticks:?}");
    }
}

/// The controller changes between two ticks, and the outputs do not show this change. The replay must report the
/// difference at the next snapshot.
#[test]
fn j56_a_snapshot_that_differs_from_the_replayed_state_is_reported() {
    let mut bench = Bench::new();
    (0..4).for_each(|_| bench.tick(&[], false));
    bench.controller.teaching_waits_ms += 1;
    bench.snapshot();
    bench.tick(&[], false);
    let replayed = replayed(&bench, None);
    assert_eq!(replayed.ticks, [Same; 4]);
    assert_eq!(replayed.snapshots, [Same, Differs]);
}

/// After a gap or a restart of the device, the replay reports the next snapshot as a separate step.
#[test]
fn j56_a_snapshot_of_another_tick_or_start_of_the_device_is_a_step() {
    for (boots, ticks) in [(1, 0), (0, 1), (1, 1)] {
        let mut bench = Bench::new();
        (0..4).for_each(|_| bench.tick(&[], false));
        bench.controller.extensions.identity.boots += boots;
        for _ in 0..ticks {
            bench.controller.tick(&Inputs::QUIET);
        }
        bench.snapshot();
        bench.tick(&[], false);
        let blocks = bench.blocks();
        let steps: Vec<_> = replay(&blocks, None)
            .map(|step| (step.inputs.is_some(), step.outcome, step.boots, step.telemetry.tick))
            .collect();
        let first = steps[0].3;
        let mut expected = Vec::from([(false, Same, 0, first)]);
        expected.extend((1..4).map(|n| (true, Same, 0, first + n)));
        expected.push((false, Same, boots, first + 3 + ticks));
        expected.push((true, Same, boots, first + 4 + ticks));
        assert_eq!(steps, expected, "{boots} starts and {ticks} ticks");
    }
}

/// A paused trajectory continues from its points, so a replay needs the same points.
#[test]
fn j56_the_outcome_of_a_snapshot_depends_on_the_points_during_a_trajectory() {
    for trajectory in TrajectoryState::ALL {
        let mut bench = Bench::new();
        bench.controller.trajectory = trajectory;
        bench.record(1);
        let hash = bench.controller.points_hash();
        let needed = matches!(trajectory, TrajectoryState::Execute | TrajectoryState::Pause);
        let unknown = if needed { Unsure(Points) } else { Same };
        assert_eq!(replayed(&bench, Some(hash)).snapshots, [Same]);
        assert_eq!(replayed(&bench, Some(!hash)).snapshots, [unknown], "{trajectory:?}");
        assert_eq!(replayed(&bench, None).snapshots, [unknown], "{trajectory:?}");
    }
}

#[test]
fn j56_a_replay_shows_the_hash_of_its_arm() {
    let bench = Bench::new();
    let arm = replay(&[], None).arm();
    assert!(arm.is_some_and(|hash| hash > 1));
    assert_eq!(arm, bench.controller.extensions.hash);
}

/// The newest valid block shows why the log ends.
#[test]
fn j56_the_end_of_a_log_is_its_newest_valid_block() {
    let sealed = |sequence| sealed_block(sequence, 0, &[5]);
    let mut damaged = sealed(9);
    damaged[head::COMMIT] ^= 1 << 20;
    assert_eq!(Log::new(&[sealed(7), sealed(8)]).end(), Some((8, LogState::Error)));
    assert_eq!(Log::new(&[sealed(7), sealed(8), damaged]).end(), Some((8, LogState::Error)));
    assert_eq!(Log::new(&[damaged]).end(), None);
    assert_eq!(Log::new(&[]).end(), None);
}

fn digest(values: &[(u32, u32)]) -> Digest {
    let mut digest = Digest::default();
    values.iter().for_each(|(value, bits)| digest.put(*value, *bits));
    digest
}

/// The digest covers the values, their order and their lengths.
#[test]
fn j56_states_with_different_bits_have_different_digests() {
    assert!(digest(&[(1, 8), (2, 5)]) == digest(&[(1, 8), (2, 5)]));
    for other in [
        &[(3, 8), (2, 5)][..],
        &[(1, 8), (3, 5)],
        &[(2, 8), (1, 5)],
        &[(1, 5), (2, 8)],
        &[(1, 7), (2, 6)],
        &[(1, 8)],
        &[],
    ] {
        assert!(digest(&[(1, 8), (2, 5)]) != digest(other), "{other:?}");
        assert!(digest(&[(1, 8), (2, 5)]).hash != digest(other).hash, "{other:?}");
    }
    assert_eq!(digest(&[(1, 8), (2, 5), (0, 32)]).bits, 45);
}
