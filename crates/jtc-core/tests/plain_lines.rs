//! Tests of plain lines, on which no extension request was received (J-30, J-51). The hosts on these lines know only the protocol of
//! existing devices.
use crate::rig;

use jtc_core::recorder::{Block, Log, Outcome, Recorder, Replay, SNAPSHOT_MS};
use jtc_core::{Config, ControllerState, TrajectoryState, joint_error};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, Status, UrgentCommand};
use rig::{Rig, point, rest, segment_body};

const SEGMENT: FrameType = FrameType::Trajectory;

/// Returns a path of 4 s in which joint 1 follows a cosine and reaches 0.4 rad/s. The points of this path are 10 ms apart.
fn path() -> Vec<RawPoint> {
    let w = core::f64::consts::TAU / 4.0;
    (0..=400)
        .map(|k| f64::from(k) * 0.01)
        .map(|t| {
            let (sin, cos) = (w * t).sin_cos();
            point(0, 0.25 * (1.0 - cos), 0.25 * w * sin, 0.25 * w * w * cos)
        })
        .map(|mut p| {
            // The velocity is zero at the start and at the end, so the path begins and ends at rest.
            p.velocity[1..].fill(0);
            p
        })
        .collect()
}

/// Returns segment 0 of a trajectory with one segment, which begins at the present position of the arm.
fn first(rig: &Rig) -> Vec<u8> {
    let mut there = RawPoint::default();
    for (raw, joint) in there.position.iter_mut().zip(rig.controller.telemetry().joints) {
        *raw = (joint.position / 3.141592 * 32767.0).round() as i16;
    }
    segment_body(9, 0, 1, 10, &[there; 20])
}

/// Returns a rig that has moved along the path for `ms`.
fn moving(ms: u32) -> Rig {
    let mut rig = Rig::holding();
    rig.execute(&path());
    rig.until(5_000, |rig| rig.controller.telemetry().point >= ms);
    rig
}

/// Returns rigs in all situations of Operate in which a segment can arrive.
fn places() -> Vec<(&'static str, Rig)> {
    let mut places = Vec::new();
    let mut waiting = Rig::with_a_slow_drive(Config::avena());
    waiting.upload(&path(), 10);
    waiting.exec(ExecCommand::Execute);
    waiting.run(50);
    places.push(("waiting for a drive", waiting));
    for ms in [1, 100, 199] {
        let mut blend = Rig::holding();
        let mut beside = path();
        beside.iter_mut().for_each(|point| point.position[1] += 100);
        blend.execute(&beside);
        blend.until(400, |rig| rig.state() == ControllerState::Operate);
        blend.run(ms);
        assert_eq!(blend.controller.telemetry().point, 0);
        places.push(("start blend", blend));
    }
    for ms in [1, 2, 700, 1_500, 3_990, 3_999] {
        places.push(("on the path", moving(ms)));
    }
    for command in [UrgentCommand::Pause, UrgentCommand::Stop] {
        let mut leaving = moving(900);
        leaving.urgent(0, command);
        leaving.run(60);
        places.push(("on the way to a pause or a stop", leaving));
    }
    let mut resumed = moving(900);
    resumed.exec(ExecCommand::Pause);
    resumed.until(600, |rig| rig.state() == ControllerState::HoldPos);
    resumed.exec(ExecCommand::Execute);
    resumed.run(30);
    places.push(("resuming", resumed));
    for (name, rig) in &places {
        let seen = (rig.state(), rig.trajectory());
        assert_eq!(seen, (ControllerState::Operate, TrajectoryState::Execute), "{name}");
    }
    places
}

/// An existing proxy repeats a refused segment for ever, and does not forward any other frame during this time. Therefore segment 0 stops
/// the arm, and the controller accepts the segment when the arm is at rest.
#[test]
fn j30_segment_0_on_a_plain_line_stops_the_arm_and_is_taken_when_it_stands() {
    for (n, (name, mut rig)) in places().into_iter().enumerate() {
        rig.plain = true;
        rig.statuses.clear();
        let mut refused = 0;
        loop {
            let segment = first(&rig);
            match rig.ask(SEGMENT, &segment) {
                DataStatus::NoError => break,
                data => assert_eq!(data, DataStatus::IncorrectValue, "{name}: 6 for a host that knows no 7"),
            }
            assert!(rig.trajectory() != TrajectoryState::Execute || rig.state() == ControllerState::Operate);
            refused += 1;
            assert!(refused < 400, "{name} {n}: never taken, {:?}", rig.controller.telemetry());
            rig.run(5);
        }
        assert!(refused > 0, "{name}: not while it moves");
        assert_eq!(
            (rig.state(), rig.trajectory()),
            (ControllerState::HoldPos, TrajectoryState::Stop),
            "{name}"
        );
        assert_eq!(rig.errors(), 0, "{name}");
        // The new trajectory begins at the present position of the arm, so the controller accepts Execute.
        rig.nodes[2].slow_enable = false;
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError, "{name}");
    }
}

/// In each tick, segment 0 on a plain line has the same effect as a Stop.
#[test]
fn j30_segment_0_on_a_plain_line_acts_as_a_stop_does() {
    for ((name, mut stopped), (_, mut rig)) in places().into_iter().zip(places()) {
        let segment = first(&rig);
        stopped.send(FrameType::TrajSetExecStatus, &[ExecCommand::Stop as u8]);
        rig.plain = true;
        rig.send(SEGMENT, &segment);
        for tick in 0..900 {
            stopped.tick();
            rig.tick();
            let [a, b] = [&stopped, &rig].map(|rig| rig.controller.telemetry());
            assert_eq!((a.state, a.trajectory, a.point), (b.state, b.trajectory, b.point), "{name}, {tick}");
            assert_eq!(a.joints, b.joints, "{name}, tick {tick}");
        }
        assert_eq!(rig.trajectory(), TrajectoryState::Stop, "{name}");
    }
}

#[test]
fn j30_only_segment_0_on_a_plain_line_and_only_in_operate_stops_anything() {
    let empty: &[RawPoint] = &[];
    for (plain, segment, points, stops, data) in [
        (true, 0, &[rest(0); 3][..], true, DataStatus::IncorrectValue),
        // The segment acts as a Stop even if it contains an error, because the host repeats the segment until the controller accepts it.
        (true, 0, empty, true, DataStatus::IncorrectValue),
        (true, 0, &[rest(32_767); 1500], true, DataStatus::IncorrectValue),
        (true, 1, &[rest(0); 3], false, DataStatus::IncorrectValue),
        (true, 99, &[rest(0); 3], false, DataStatus::IncorrectValue),
        (false, 0, &[rest(0); 3], false, DataStatus::NotAllowed),
        (false, 1, &[rest(0); 3], false, DataStatus::NotAllowed),
    ] {
        let mut rig = moving(1_000);
        rig.plain = plain;
        assert_eq!(rig.ask(SEGMENT, &segment_body(9, segment, 100, 10, points)), data, "{plain} {segment}");
        rig.run(700);
        let to = if stops { TrajectoryState::Stop } else { TrajectoryState::Execute };
        assert_eq!(rig.trajectory(), to, "plain {plain}, segment {segment}, {} points", points.len());
    }
    // In states without a commanded motion, segment 0 on a plain line has the same effect as on any other line.
    for (name, leave) in [
        ("Teaching", (|rig: &mut Rig| rig.send(FrameType::TeachingModeEnable, &[])) as fn(&mut Rig)),
        ("Error", |rig| rig.press_stop(1)),
        ("Init", |rig| rig.send(FrameType::ResetCanDevices, &[1, 0, 0, 0])),
    ] {
        let mut rig = Rig::holding();
        leave(&mut rig);
        rig.until(2_000, |rig| rig.state() != ControllerState::HoldPos);
        let before = rig.state();
        rig.plain = true;
        let segment = first(&rig);
        assert_eq!(rig.ask(SEGMENT, &segment), DataStatus::IncorrectValue, "{name}");
        assert_eq!(rig.state(), before, "{name}");
    }
    // Segment 0 replaces a paused, stopped or finished path at once, on a plain line as on any other line.
    for plain in [true, false] {
        let mut rig = moving(1_000);
        rig.exec(ExecCommand::Pause);
        rig.until(600, |rig| rig.state() == ControllerState::HoldPos);
        rig.plain = plain;
        let segment = first(&rig);
        assert_eq!(rig.ask(SEGMENT, &segment), DataStatus::NoError);
        assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    }
}

#[test]
fn j30_j56_a_replay_stops_where_segment_0_on_a_plain_line_has_stopped() {
    let memory: [Vec<Block>; 2] = [vec![[0; 256]; 90], vec![[0; 256]; 6]];
    let mut rig = Rig::new(Config::avena());
    rig.recorder = Some(Recorder::new(memory, false));
    rig.defaults();
    rig.run(700);
    rig.move_along(&path(), 1_000);
    rig.plain = true;
    let segment = first(&rig);
    for _ in 0..40 {
        if rig.ask(SEGMENT, &segment) == DataStatus::NoError {
            break;
        }
        rig.run(7);
    }
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    // The flight recorder has recorded the motion until the new points arrive, and a replay must reproduce it.
    let blocks: Vec<Block> = rig.recorder.as_ref().unwrap().blocks().copied().collect();
    let mut moving = Rig::holding();
    moving.upload(&path(), 10);
    let points = moving.controller.points_hash();
    let mut ended = false;
    for step in Replay::new(Log::new(&blocks), moving.controller.clone(), Some(points)) {
        let braking = step.telemetry.trajectory == TrajectoryState::Execute && step.telemetry.point > 1_000;
        assert_ne!(step.outcome, Outcome::Differs, "tick {}", step.telemetry.tick);
        assert!(!braking || step.outcome == Outcome::Same, "{:?}", step.outcome);
        ended |= braking;
    }
    assert!(ended);
}

#[test]
fn j51_numbers_above_6_are_6_on_a_plain_line() {
    let mut rig = Rig::holding();
    for plain in [true, false, true] {
        rig.plain = plain;
        let data = if plain { DataStatus::IncorrectValue } else { DataStatus::NotAllowed };
        assert_eq!(rig.exec(ExecCommand::Execute), data);
        rig.urgent(1, UrgentCommand::Stop);
        rig.run(5);
        assert_eq!(rig.records().last().map(|record| record.data), Some(data), "a Stop with nothing to stop");
    }
    // Data status 8 means that the arm is not at the first point.
    for plain in [true, false] {
        rig.plain = plain;
        rig.upload(&[rest(5_000); 3], 10);
        let data = if plain { DataStatus::IncorrectValue } else { DataStatus::StartPositionMismatch };
        assert_eq!(rig.exec(ExecCommand::Execute), data);
    }
}

/// Returns segment `segment` of a trajectory with three segments.
fn of_three(segment: u16) -> Vec<u8> {
    segment_body(9, segment, 3, 10, &[rest(5_000); 20])
}

/// The state of the line when segment 0 arrives (plain or not plain) determines the data statuses of the whole upload
/// and of its Execute. A later change of the line has no effect on them.
#[test]
fn j51_segment_0_decides_the_numbers_of_its_upload_and_its_execute() {
    use DataStatus::{IncorrectSegmentOrder, IncorrectValue, NoError, NotAllowed, StartPositionMismatch};
    let in_words = |plain, data| if plain { IncorrectValue } else { data };
    for plain in [true, false] {
        for later in 0u8..16 {
            let case = format!("segment 0 on a plain line: {plain}, later frames {later:#06b}");
            let at = |n: u8| later >> n & 1 == 1;
            let mut rig = Rig::holding();
            rig.plain = plain;
            assert_eq!(rig.ask(SEGMENT, &of_three(0)), NoError);
            rig.plain = at(0);
            assert_eq!(rig.ask(SEGMENT, &of_three(1)), NoError);
            assert_eq!(rig.exec(ExecCommand::Execute), in_words(plain, NotAllowed), "{case}");
            assert_eq!(rig.ask(SEGMENT, &of_three(1)), IncorrectSegmentOrder, "{case}");
            rig.plain = at(1);
            assert_eq!(rig.ask(SEGMENT, &of_three(2)), NoError);
            rig.plain = at(2);
            for _ in 0..2 {
                let data = rig.exec(ExecCommand::Execute);
                assert_eq!(data, in_words(plain, StartPositionMismatch), "{case}");
            }
            // The data statuses of other frames depend on whether the line is plain when these frames arrive.
            rig.plain = at(3);
            let data = rig.exec(ExecCommand::Stop);
            assert_eq!(data, in_words(at(3), NotAllowed), "{case}");
            // In this state, the controller does not accept segments of an upload that has already begun.
            rig.plain = plain;
            assert_eq!(rig.ask(SEGMENT, &of_three(0)), NoError);
            rig.press_stop(1);
            rig.run(5);
            rig.plain = at(0);
            assert_eq!(rig.ask(SEGMENT, &of_three(1)), in_words(plain, NotAllowed), "{case}");
        }
    }
}

/// If a Stop drops an upload, the state of the line when segment 0 arrived determines the data status of the later
/// segments. A client with extensions gets NotAllowed, even if its line has become plain because the client was
/// silent for 2 s.
#[test]
fn j51_a_drop_is_told_to_a_client_that_was_silent_for_2_s() {
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(SEGMENT, &of_three(0)), DataStatus::NoError);
    rig.plain = true;
    rig.urgent(1, UrgentCommand::Stop);
    rig.run(5);
    assert_eq!(rig.ask(SEGMENT, &of_three(1)), DataStatus::NotAllowed, "not 6, as for wrong points");
}

/// Several clients can execute the same trajectory, one after another. The controller does not know whether the
/// client of a later Execute can handle data statuses above 6. The data status of an Execute therefore also depends
/// on the line of this Execute.
#[test]
fn j51_the_execute_of_another_client_has_the_numbers_of_its_own() {
    for plain in [true, false] {
        let mut rig = Rig::holding();
        rig.plain = plain;
        rig.upload(&[rest(0); 60], 10);
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError);
        for again in [true, false, true] {
            rig.plain = again;
            let data = if plain || again { DataStatus::IncorrectValue } else { DataStatus::NotAllowed };
            assert_eq!(rig.exec(ExecCommand::Execute), data, "{plain} {again}");
        }
    }
}

/// Returns points that violate J-36, each with the error that the joint with index 3 would have in motion.
fn broken() -> Vec<(&'static str, Vec<RawPoint>, u16)> {
    let (still, at) = (rest(0), |q, v, a| point(3, q, v, a));
    let long = |bad: RawPoint, place: usize| {
        let mut points = vec![still; 900];
        points[place] = bad;
        points
    };
    vec![
        ("beyond a limit", long(at(3.1, 0.0, 0.0), 450), joint_error::POSITION),
        ("a jump in the first segment", long(at(0.5, 0.0, 0.0), 10), joint_error::VELOCITY),
        ("too fast", long(at(0.0, 1.9, 0.0), 899), joint_error::VELOCITY),
        ("too fast at the begin", long(at(0.0, 0.03, 0.0), 0), joint_error::VELOCITY),
        ("not at rest at the end", long(at(0.0, 0.03, 0.0), 899), joint_error::VELOCITY),
        ("too steep", long(at(0.0, 0.0, 12.5), 300), joint_error::ACCELERATION),
    ]
}

/// Uploads these points in this number of segments. Returns the data status of each segment.
fn uploaded(rig: &mut Rig, points: &[RawPoint], segments: usize) -> Vec<DataStatus> {
    let parts: Vec<_> = points.chunks(points.len().div_ceil(segments)).collect();
    assert_eq!(parts.len(), segments);
    (0u16..)
        .zip(&parts)
        .map(|(n, part)| rig.ask(SEGMENT, &segment_body(9, n, segments as u16, 10, part)))
        .collect()
}

/// Existing hosts wait for ever if the controller refuses a segment for any reason. On a plain line, the controller
/// therefore accepts the segments of a refused trajectory, but does not execute it.
#[test]
fn j36_a_refused_trajectory_on_a_plain_line_is_taken_and_not_executed() {
    for (name, points, error) in broken() {
        for segments in [1, 2, 3, 9] {
            let case = format!("{name}, {segments} segments");
            let mut config = Config::avena();
            config.joints[3].acceleration_max = 8.0;
            let mut rig = Rig::holding_with(config);
            rig.plain = true;
            // Before the refused trajectory, the test uploads a valid one. The controller must not execute the valid
            // trajectory instead of the refused one.
            rig.upload(&[rest(0); 60], 10);
            assert_eq!(uploaded(&mut rig, &points, segments), vec![DataStatus::NoError; segments], "{case}");
            assert_eq!(
                (rig.state(), rig.trajectory()),
                (ControllerState::HoldPos, TrajectoryState::Stop),
                "{case}"
            );
            let before = rig.status();
            assert_eq!((before.errors, before.occurred), (0, 0), "{case}: nothing is executed yet");
            for again in 0..3 {
                assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::IncorrectValue, "{case}");
                rig.run(50);
                let status = rig.status();
                assert_eq!((status.state, status.trajectory), (before.state, before.trajectory), "{case}");
                let joints = status.joints.map(|joint| (joint.internal, joint.internal_occurred));
                assert_eq!(joints, [(0, 0), (0, 0), (0, 0), (0, error), (0, 0), (0, 0)], "{case}");
                let internal = jtc_core::error::INTERNAL | jtc_core::error::INTERNAL_JOINTS;
                assert_eq!((status.errors, status.occurred), (0, internal), "{case}");
                assert!(rig.last.safety_output, "{case}: nothing has failed");
                if again == 1 {
                    assert_eq!(rig.ask(FrameType::ClearOccurredErrors, &[]), DataStatus::NoError);
                    assert_eq!(rig.status().joints[3].internal_occurred, 0);
                }
            }
            assert!(rig.controller.violation().is_some_and(|v| v.joint == 3), "{case}");
            // As for any trajectory that is not being executed, the controller refuses a Stop. After this Stop, the
            // next upload is possible.
            assert_eq!(rig.exec(ExecCommand::Stop), DataStatus::IncorrectValue);
            assert_eq!(uploaded(&mut rig, &vec![rest(0); 60], segments), vec![DataStatus::NoError; segments]);
            assert_eq!(rig.controller.violation(), None);
            assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError, "{case}");
            rig.until(2_000, |rig| rig.trajectory() == TrajectoryState::Finish);
        }
    }
}

/// The line of segment 0 determines for the whole upload how the controller treats a trajectory that violates J-36.
/// On a plain line, the controller accepts the segments, and refuses only the Execute. The result of the check
/// applies to every client that executes the trajectory.
#[test]
fn j36_segment_0_decides_whether_a_refused_trajectory_is_taken() {
    let (_, points, error) = broken().remove(0);
    let parts: Vec<_> = points.chunks(300).collect();
    let body = |n: u16| segment_body(9, n, 3, 10, parts[usize::from(n)]);
    for plain in [true, false] {
        for later in [true, false] {
            let mut rig = Rig::holding();
            rig.plain = plain;
            assert_eq!(rig.ask(SEGMENT, &body(0)), DataStatus::NoError);
            rig.plain = later;
            let data = if plain { DataStatus::NoError } else { DataStatus::IncorrectValue };
            assert_eq!(rig.ask(SEGMENT, &body(1)), data, "{plain} {later}");
            if !plain {
                assert_eq!(rig.trajectory(), TrajectoryState::Null);
                continue;
            }
            assert_eq!(rig.ask(SEGMENT, &body(2)), DataStatus::NoError);
            // The data status of Execute is 6 (wrong content) on every line. A client that knows all data statuses
            // gets the same data status.
            for (line, plain) in [(0, true), (0, false), (1, true), (1, false)] {
                rig.plain = plain;
                rig.statuses.clear();
                rig.send_on(line, FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]);
                rig.run(50);
                let data: Vec<_> = rig.records().iter().map(|record| record.data).collect();
                assert_eq!(data, [DataStatus::IncorrectValue], "line {line}, plain {plain}");
                assert_eq!(rig.trajectory(), TrajectoryState::Stop);
            }
            assert_eq!(rig.status().joints[3].internal_occurred, error);
        }
    }
}

/// Frames that are not a valid trajectory are refused on a plain line as well. In the frames of this test, the counts, the order or the
/// step time is wrong.
#[test]
fn j30_j36_only_content_is_taken_on_a_plain_line() {
    use DataStatus::{
        IncorrectSegmentOrder, IncorrectStepTime, IncorrectValue, TooManyPoints, TooManySegments,
    };
    let mut rig = Rig::holding();
    rig.plain = true;
    for (segment, segments, step, points, data) in [
        (1, 3, 10, 3, IncorrectSegmentOrder),
        (0, 3, 0, 3, IncorrectStepTime),
        (0, 101, 10, 3, TooManySegments),
        (0, 1, 10, 1_501, TooManyPoints),
        (0, 1, 10, 0, IncorrectValue),
    ] {
        let body = segment_body(9, segment, segments, step, &vec![rest(0); points]);
        assert_eq!(rig.ask(SEGMENT, &body), data);
        assert_eq!(rig.trajectory(), TrajectoryState::Null);
    }
}

/// The snapshots of the flight recorder contain the result of the check. The replay must therefore refuse the
/// Execute, like the device.
#[test]
fn j36_j56_a_replay_knows_the_verdict_on_a_refused_trajectory() {
    let (_, points, error) = broken().remove(0);
    let memory: [Vec<Block>; 2] = [vec![[0; 256]; 90], vec![[0; 256]; 6]];
    let mut rig = Rig::new(Config::avena());
    rig.recorder = Some(Recorder::new(memory, false));
    rig.defaults();
    rig.run(700);
    rig.plain = true;
    uploaded(&mut rig, &points, 3);
    rig.run(2 * SNAPSHOT_MS as usize);
    let executed = rig.controller.telemetry().tick;
    assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::IncorrectValue);
    rig.run(100);
    let blocks: Vec<Block> = rig.recorder.as_ref().unwrap().blocks().copied().collect();
    // The log does not contain the points, but it contains the result of the check of these points.
    let other = Rig::holding().controller;
    let mut last = None;
    let mut replay = Replay::new(Log::new(&blocks), other, None);
    for step in &mut replay {
        assert_ne!(step.outcome, Outcome::Differs, "tick {}", step.telemetry.tick);
        assert_ne!(step.telemetry.state, ControllerState::Operate);
        last = Some((step.outcome, step.telemetry.tick));
    }
    assert!(last.is_some_and(|(outcome, tick)| outcome == Outcome::Same && tick > executed + 50), "{last:?}");
    let status = Status::parse(replay.controller().status_frame()).expect("a status");
    assert_eq!(status.joints[3].internal_occurred, error);
}
