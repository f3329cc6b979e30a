//! Tests of a Stop during an upload, which drops the upload. The controller does not execute any part of the dropped upload, and jogging,
//! Teaching and the next upload are possible (J-30, J-58).
use crate::rig;

use jtc_core::{ControllerState, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, Response, UrgentCommand};
use rig::{Rig, floats, rest, segment_body};

use DataStatus::{IncorrectSegmentOrder, IncorrectValue, NoError, NotAllowed};

/// Number of segments of the upload that a Stop drops.
const SEGMENTS: u16 = 4;

fn segment(number: u16, segment: u16, points: usize) -> Vec<u8> {
    segment_body(number, segment, SEGMENTS, 10, &vec![rest(0); points])
}

fn jog(rig: &mut Rig) -> DataStatus {
    rig.ask(FrameType::Jog, &floats([0.1f32, 0.0, 0.0, 0.0, 0.0, 0.0]))
}

/// Returns the data statuses of the Stop frames.
fn stops(rig: &Rig) -> Vec<DataStatus> {
    let stop = |record: &&Response| record.frame_type == FrameType::TrajSetExecStatus as u8;
    rig.records().iter().filter(stop).map(|record| record.data).collect()
}

/// Checks that jogging and Teaching are possible after the Stop and, if `upload` is `true`, also the next upload.
fn all_is_free(rig: &mut Rig, upload: bool) {
    assert_eq!(rig.exec(ExecCommand::Execute), NotAllowed, "nothing to execute");
    if upload {
        // The next upload has other points, and must not contain any point of the earlier upload.
        let points: Vec<RawPoint> = vec![rest(0); 60];
        rig.upload(&points, 10);
        assert_eq!(rig.exec(ExecCommand::Execute), NoError);
        rig.until(2_000, |rig| rig.trajectory() == TrajectoryState::Finish);
        rig.tick();
        assert_eq!(rig.controller.telemetry().point, 590, "59 steps of 10 ms");
    }
    assert_eq!(jog(rig), NoError);
    rig.run(700);
    assert_eq!(rig.ask(FrameType::TeachingModeEnable, &[]), NoError);
    rig.until(1_000, |rig| rig.state() == ControllerState::Teaching);
    assert_eq!(rig.errors(), 0);
}

#[test]
fn j30_a_stop_between_two_segments_drops_the_upload() {
    for line in [0, 1] {
        for received in 1..SEGMENTS {
            for (urgent, upload) in [(true, true), (true, false), (false, true)] {
                let mut rig = Rig::holding();
                for n in 0..received {
                    assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, n, 30)), NoError);
                }
                rig.statuses.clear();
                if urgent {
                    rig.urgent(line, UrgentCommand::Stop);
                } else {
                    rig.send_on(line, FrameType::TrajSetExecStatus, &[1]);
                }
                rig.run(5);
                assert_eq!(stops(&rig), [NoError], "it has done something");
                assert_eq!(
                    (rig.state(), rig.trajectory()),
                    (ControllerState::HoldPos, TrajectoryState::Null)
                );
                // If a client continues the dropped upload, the controller must refuse each segment, and must never
                // execute any part of the upload.
                for n in received..SEGMENTS {
                    assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, n, 30)), NotAllowed, "segment {n}");
                    assert_eq!(rig.exec(ExecCommand::Execute), NotAllowed);
                }
                all_is_free(&mut rig, upload);
            }
        }
    }
}

/// A Stop can arrive in any tick while segments wait or are being processed. The Stop must drop these segments together
/// with their upload.
#[test]
fn j30_a_stop_in_the_middle_of_a_segment_drops_it_with_the_upload() {
    for begun in 0..3 {
        for ticks in 0..45 {
            let mut rig = Rig::holding();
            for n in 0..begun {
                assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, n, 10)), NoError);
            }
            rig.statuses.clear();
            for n in begun..SEGMENTS {
                rig.send(FrameType::Trajectory, &segment(7, n, 1_000));
            }
            rig.run(ticks);
            rig.urgent(1, UrgentCommand::Stop);
            rig.run(250);
            let records: Vec<_> =
                rig.records().into_iter().filter(|r| r.frame_type == FrameType::Trajectory as u8).collect();
            let taken = records.iter().take_while(|record| record.data == NoError).count();
            assert_eq!(records.len(), usize::from(SEGMENTS - begun));
            assert!(
                taken < records.len() && records[taken..].iter().all(|r| r.data == NotAllowed),
                "{records:?}"
            );
            assert_eq!(rig.trajectory(), TrajectoryState::Null, "{begun} segments, {ticks} ms");
            all_is_free(&mut rig, ticks % 2 == 0);
        }
    }
}

/// The controller received segment 0 of an upload before the Stop, but has not processed it yet. The Stop drops this
/// upload, and the earlier trajectory stays in memory.
#[test]
fn j30_a_stop_drops_an_upload_that_waits_and_keeps_what_is_there() {
    let mut rig = Rig::holding();
    rig.upload(&[rest(0); 60], 10);
    rig.send(FrameType::FrictionTableUseDefault, &[]);
    for n in 0..SEGMENTS {
        rig.send(FrameType::Trajectory, &segment(8, n, 10));
    }
    rig.statuses.clear();
    rig.urgent(1, UrgentCommand::Stop);
    rig.run(60);
    let segments: Vec<_> = rig.records().iter().filter(|r| r.frame_type == 0x04).map(|r| r.data).collect();
    assert_eq!(segments, [NotAllowed; SEGMENTS as usize]);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    assert_eq!(
        rig.ask(FrameType::Trajectory, &segment(8, 2, 10)),
        NotAllowed,
        "a segment of it that comes late"
    );
    assert_eq!(rig.exec(ExecCommand::Execute), NoError);
    rig.until(2_000, |rig| rig.trajectory() == TrajectoryState::Finish);
    rig.tick();
    assert_eq!(rig.controller.telemetry().point, 590);
    // The next upload must be possible, and the controller must check the order of its segments as usual.
    assert_eq!(rig.ask(FrameType::Trajectory, &segment(9, 0, 10)), NoError);
    assert_eq!(rig.ask(FrameType::Trajectory, &segment(9, 2, 10)), IncorrectSegmentOrder);
}

#[test]
fn j30_an_upload_that_follows_a_stop_is_free_of_it() {
    for number in [7, 8] {
        let mut rig = Rig::holding();
        assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, 0, 10)), NoError);
        rig.urgent(0, UrgentCommand::Stop);
        for n in 0..SEGMENTS {
            rig.send(FrameType::Trajectory, &segment(number, n, 10));
        }
        rig.run(200);
        assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    }
}

#[test]
fn j30_a_pause_drops_no_upload() {
    let mut rig = Rig::holding();
    for n in 0..SEGMENTS {
        rig.send(FrameType::Trajectory, &segment(7, n, 200));
        rig.run(7);
        rig.urgent(1, UrgentCommand::Pause);
        rig.run(40);
    }
    assert_eq!(stops(&rig), [NotAllowed; SEGMENTS as usize]);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
}

/// A host on a plain line cannot handle a refused segment. Therefore a host on a plain line can complete the upload. The Stop still takes
/// effect, so the controller does not execute the trajectory.
#[test]
fn j30_an_upload_on_a_plain_line_is_completed_after_a_stop_and_not_executed() {
    // The test varies the line of the Stop, the segment that is being processed, and the ticks since this segment was sent.
    for line in [0, 1] {
        for at in 0..SEGMENTS {
            for ticks in [0, 1, 5, 19, 23] {
                let case = format!("line {line}, segment {at}, {ticks} ms");
                let mut rig = Rig::holding();
                // The upload below replaces this trajectory, so the controller must not execute this trajectory
                // later.
                rig.upload(&[rest(0); 60], 10);
                rig.plain = true;
                rig.statuses.clear();
                for n in 0..SEGMENTS {
                    rig.send(FrameType::Trajectory, &segment(7, n, 300));
                    if n == at {
                        rig.run(ticks);
                        rig.urgent(line, UrgentCommand::Stop);
                    }
                    rig.run(60);
                }
                let refused = rig.records().iter().any(|r| r.frame_type == 0x04 && !r.accepted());
                assert!(!refused, "{case}: {:?}", rig.records());
                assert_eq!(rig.trajectory(), TrajectoryState::Stop, "{case}");
                for _ in 0..3 {
                    assert_eq!(rig.exec(ExecCommand::Execute), IncorrectValue, "{case}");
                    rig.run(20);
                    assert_eq!(rig.state(), ControllerState::HoldPos, "{case}");
                }
                if at > 0 {
                    assert_eq!(stops(&rig)[0], NoError, "{case}: it has done something");
                }
                // The controller executes the next upload.
                rig.upload(&[rest(0); 60], 10);
                assert_eq!(rig.exec(ExecCommand::Execute), NoError, "{case}");
                rig.until(2_000, |rig| rig.trajectory() == TrajectoryState::Finish);
                assert_eq!(rig.exec(ExecCommand::Execute), NoError, "{case}: once more");
            }
        }
    }
}

/// On a plain line, only a Stop during the upload prevents the execution of the trajectory.
#[test]
fn j30_an_upload_on_a_plain_line_without_a_stop_is_executed() {
    for command in [None, Some(UrgentCommand::Pause), Some(UrgentCommand::Stop)] {
        let mut rig = Rig::holding();
        rig.plain = true;
        // The Stop or Pause arrives before the upload and does not affect the upload. A Pause during the upload does
        // not affect it either.
        if let Some(command) = command {
            rig.urgent(1, command);
            rig.run(3);
        }
        for n in 0..SEGMENTS {
            if command == Some(UrgentCommand::Pause) {
                rig.urgent(0, UrgentCommand::Pause);
            }
            assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, n, 30)), NoError);
        }
        assert_eq!(rig.exec(ExecCommand::Execute), NoError, "{command:?}");
    }
}

/// A Stop drops an upload of a client with extensions, even if the line of this client has become plain.
#[test]
fn j30_an_upload_of_a_client_that_knows_extensions_is_dropped_on_a_line_that_became_plain() {
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, 0, 10)), NoError);
    rig.plain = true;
    rig.urgent(0, UrgentCommand::Stop);
    rig.run(5);
    assert_eq!(stops(&rig), [NoError]);
    assert_eq!(
        rig.ask(FrameType::Trajectory, &segment(7, 1, 10)),
        NotAllowed,
        "in the words of its segment 0"
    );
}

/// An incomplete upload does not prevent jogging, and a host may complete an upload during a jog.
#[test]
fn j58_joints_are_jogged_during_an_upload() {
    for plain in [true, false] {
        let mut rig = Rig::holding();
        for n in 0..SEGMENTS {
            rig.plain = plain;
            assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, n, 100)), NoError);
            rig.plain = false;
            assert_eq!(jog(&mut rig), NoError, "after segment {n}");
            rig.run(100);
        }
        // J-51: the line of segment 0 determines the data status of the refused Execute.
        let refused = if plain { IncorrectValue } else { NotAllowed };
        assert_eq!(rig.exec(ExecCommand::Execute), refused, "not while joints are jogged");
        // A Stop ends the jog and also drops the upload.
        assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, 0, 100)), NoError);
        assert_eq!(jog(&mut rig), NoError);
        rig.urgent(0, UrgentCommand::Stop);
        rig.run(800);
        assert_eq!(rig.ask(FrameType::Trajectory, &segment(7, 1, 100)), NotAllowed);
        assert_eq!((rig.state(), rig.trajectory()), (ControllerState::HoldPos, TrajectoryState::Null));
    }
}

/// Several Stops arrive, and segment 0 of an upload is sent before the last of these Stops. The last Stop must drop
/// this upload, even while response records of the earlier Stops still wait.
#[test]
fn j30_each_of_several_stops_drops_the_upload_before_it() {
    for frames_first in 0..2 {
        for stops_first in 1..4 {
            for line in [0, 1] {
                for ticks in [0, 1, 2, 5] {
                    let case =
                        format!("{frames_first} long frames, {stops_first} Stops, line {line}, {ticks} ms");
                    let mut rig = Rig::holding();
                    rig.statuses.clear();
                    // The friction frame takes some ticks, during which the other frames wait.
                    (0..frames_first).for_each(|_| rig.send(FrameType::FrictionTableUseDefault, &[]));
                    (0..stops_first).for_each(|_| rig.urgent(0, UrgentCommand::Stop));
                    rig.send(FrameType::Trajectory, &segment(7, 0, 10));
                    if frames_first > 0 {
                        rig.run(ticks);
                    }
                    rig.urgent(line, UrgentCommand::Stop);
                    for n in 1..SEGMENTS {
                        rig.send(FrameType::Trajectory, &segment(7, n, 10));
                    }
                    rig.run(80);
                    let segments: Vec<_> =
                        rig.records().iter().filter(|r| r.frame_type == 0x04).map(|r| r.data).collect();
                    assert_eq!(segments, [NotAllowed; SEGMENTS as usize], "{case}");
                    assert_eq!(rig.trajectory(), TrajectoryState::Null, "{case}");
                    assert_eq!(rig.exec(ExecCommand::Execute), NotAllowed, "{case}");
                    rig.upload(&[rest(0); 60], 10);
                    assert_eq!(rig.exec(ExecCommand::Execute), NoError, "{case}: the next upload is free");
                }
            }
        }
    }
}
