//! Plain lines, on which no extension request came: hosts that know the protocol of existing devices only (J-30, J-51).
mod rig;

use jtc_core::recorder::{Block, Log, Outcome, Recorder, Replay};
use jtc_core::{Config, ControllerState, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint, UrgentCommand};
use rig::{Rig, point, rest, segment_body};

const SEGMENT: FrameType = FrameType::Trajectory;

/// A path over 4 s, with joint 1 at up to 0.4 rad/s: points of two cosines, 10 ms apart.
fn path() -> Vec<RawPoint> {
    let w = core::f64::consts::TAU / 4.0;
    (0..=400)
        .map(|k| f64::from(k) * 0.01)
        .map(|t| {
            let (sin, cos) = (w * t).sin_cos();
            point(0, 0.25 * (1.0 - cos), 0.25 * w * sin, 0.25 * w * w * cos)
        })
        .map(|mut p| {
            // It begins and ends at rest.
            p.velocity[1..].fill(0);
            p
        })
        .collect()
}

/// Segment 0 of one, of an arm that stands where it is.
fn first(rig: &Rig) -> Vec<u8> {
    let mut there = RawPoint::default();
    for (raw, joint) in there.position.iter_mut().zip(rig.controller.telemetry().joints) {
        *raw = (joint.position / 3.141592 * 32767.0).round() as i16;
    }
    segment_body(9, 0, 1, 10, &[there; 20])
}

/// The arm moves along the path since so many ms.
fn moving(ms: u32) -> Rig {
    let mut rig = Rig::holding();
    rig.execute(&path());
    rig.until(5_000, |rig| rig.controller.telemetry().point >= ms);
    rig
}

/// Where in Operate a segment can arrive.
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

/// An existing proxy repeats a refused segment for ever, and forwards nothing else. So it stops the arm, and is taken when the arm stands.
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
        // The new trajectory is there, and begins where the arm stands.
        rig.nodes[2].slow_enable = false;
        assert_eq!(rig.exec(ExecCommand::Execute), DataStatus::NoError, "{name}");
    }
}

/// It does what a Stop does, in each tick.
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
        // Whatever is wrong with it: its host goes on repeating it.
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
    // Without a motion a plain line is like any other.
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
    // Paused, stopped and finished paths give way to it, as ever.
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
    // The log of the motion, up to the new points.
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
    // 8: the arm is not at the first point.
    for plain in [true, false] {
        rig.plain = plain;
        rig.upload(&[rest(5_000); 3], 10);
        let data = if plain { DataStatus::IncorrectValue } else { DataStatus::StartPositionMismatch };
        assert_eq!(rig.exec(ExecCommand::Execute), data);
    }
}

/// Segment `segment` of three.
fn of_three(segment: u16) -> Vec<u8> {
    segment_body(9, segment, 3, 10, &[rest(5_000); 20])
}

/// What its segment 0 has found holds, whatever the line is for the frames behind it.
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
            // Other frames are those of their own time.
            rig.plain = at(3);
            let data = rig.exec(ExecCommand::Stop);
            assert_eq!(data, in_words(at(3), NotAllowed), "{case}");
            // The state forbids the segments of an upload that has been begun.
            rig.plain = plain;
            assert_eq!(rig.ask(SEGMENT, &of_three(0)), NoError);
            rig.press_stop(1);
            rig.run(5);
            rig.plain = at(0);
            assert_eq!(rig.ask(SEGMENT, &of_three(1)), in_words(plain, NotAllowed), "{case}");
        }
    }
}

/// A drop is told in the words of segment 0.
#[test]
fn j51_a_drop_is_told_to_a_client_that_was_silent_for_2_s() {
    let mut rig = Rig::holding();
    assert_eq!(rig.ask(SEGMENT, &of_three(0)), DataStatus::NoError);
    rig.plain = true;
    rig.urgent(1, UrgentCommand::Stop);
    rig.run(5);
    assert_eq!(rig.ask(SEGMENT, &of_three(1)), DataStatus::NotAllowed, "not 6, as for wrong points");
}

/// After its Execute a trajectory may be executed by another client, which has not shown that it knows more than 6.
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
