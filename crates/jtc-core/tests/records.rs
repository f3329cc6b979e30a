//! Tests of the response record of each frame, the order of these records, and frames that wait for other frames (J-04).
use crate::rig;

use jtc_core::{ControllerState, RECORDS_MAX, TrajectoryState};
use jtc_wire::{DataStatus, ExecCommand, FrameStatus, FrameType, RawPoint, Response, UrgentCommand};
use proptest::prelude::*;
use rig::{Rig, rest, segment_body};

const NOISE: Response = Response::bad(0, FrameStatus::IncorrectHeader, 0);

/// Returns a rig on a path. A status leaves this rig every 15 ms, as at 115 200 Bd.
fn moving() -> Rig {
    let mut rig = Rig::holding();
    let points: Vec<RawPoint> = (0..400).map(|_| rest(0)).collect();
    rig.move_along(&points, 301);
    rig.statuses.clear();
    rig
}

/// Executes ticks in which the line accepts a status every 15 ms.
fn run_slowly(rig: &mut Rig, ticks: usize) {
    for n in 0..ticks {
        rig.status_free = n % 15 == 0;
        rig.tick();
    }
    rig.status_free = true;
}

/// Executes at most `ticks` ticks, until the trajectory leaves the state Execute because path time slows down.
/// Returns the new state.
fn stopped_within(rig: &mut Rig, ticks: usize) -> TrajectoryState {
    rig.until(ticks, |r| r.trajectory() != TrajectoryState::Execute);
    rig.trajectory()
}

fn exec_record(data: DataStatus) -> Response {
    Response::good(FrameType::TrajSetExecStatus, data, 7)
}

#[test]
fn j04_stop_and_pause_wait_for_no_record() {
    for (command, to) in
        [(UrgentCommand::Stop, TrajectoryState::Stop), (UrgentCommand::Pause, TrajectoryState::Pause)]
    {
        let mut rig = moving();
        // The line accepts no status, so every response record waits.
        rig.status_free = false;
        for _ in 0..400 {
            rig.send(FrameType::ClearOccurredErrors, &[]);
        }
        rig.run(50);
        rig.urgent(0, command);
        let index = rig.controller.telemetry().point;
        assert_eq!(stopped_within(&mut rig, 300), to);
        assert!(rig.controller.telemetry().point < index + 300, "it has slowed down");
        rig.status_free = true;
        rig.run(100);
        let records = rig.records();
        assert_eq!(records.len(), RECORDS_MAX);
        assert_eq!(*records.last().unwrap(), exec_record(DataStatus::NoError), "in its turn, the last");
        assert_eq!(rig.controller.telemetry().records_lost, 401 - RECORDS_MAX as u32);
    }
}

#[test]
fn j04_a_stop_acts_while_a_long_frame_is_executed() {
    let mut rig = moving();
    rig.exec(ExecCommand::Pause);
    rig.until(400, |r| r.trajectory() == TrajectoryState::Pause);
    // The controller needs many ticks to process this segment. A Stop that arrives meanwhile must take effect at
    // once, but its response record must come last.
    let points: Vec<RawPoint> = (0..1500).map(|_| rest(0)).collect();
    rig.statuses.clear();
    rig.send(FrameType::FrictionTableUseDefault, &[]);
    rig.send(FrameType::Trajectory, &segment_body(9, 1, 2, 10, &points));
    rig.urgent(0, UrgentCommand::Stop);
    rig.tick();
    assert_eq!(rig.trajectory(), TrajectoryState::Stop, "in the first tick");
    rig.run(40);
    let types: Vec<u8> = rig.records().iter().map(|r| r.frame_type).collect();
    assert_eq!(types, [0x06, 0x04, 0x0B], "records in the order of the frames");
    assert_eq!(rig.records()[2], exec_record(DataStatus::NoError));
}

#[test]
fn j04_a_stop_cancels_the_execute_before_it_and_not_the_one_after() {
    for (command, data) in
        [(UrgentCommand::Stop, DataStatus::NoError), (UrgentCommand::Pause, DataStatus::NotAllowed)]
    {
        let mut rig = Rig::holding();
        rig.upload(&[rest(0); 50], 10);
        rig.statuses.clear();
        // All these frames arrive within one tick, with an Execute on each line.
        rig.send_on(1, FrameType::TrajSetExecStatus, &[3]);
        rig.send(FrameType::TrajSetExecStatus, &[3]);
        rig.urgent(0, command);
        rig.run(20);
        assert_eq!((rig.state(), rig.trajectory()), (ControllerState::HoldPos, TrajectoryState::Stop));
        let refused = exec_record(DataStatus::NotAllowed);
        // The controller refuses both Execute frames, because the command arrived after them. The trajectory is
        // already in the state Stop, so a Pause is refused and a Stop is accepted.
        assert_eq!(rig.records(), [refused, refused, exec_record(data)]);
        // A Stop or Pause does not affect an Execute that arrives after it.
        rig.statuses.clear();
        rig.urgent(0, command);
        rig.send(FrameType::TrajSetExecStatus, &[3]);
        rig.run(20);
        assert_eq!(rig.trajectory(), TrajectoryState::Execute);
        assert_eq!(
            rig.records(),
            [refused, exec_record(DataStatus::NoError)],
            "nothing to stop, then Execute"
        );
    }
}

#[test]
fn j04_each_stop_has_one_record_that_says_what_it_did() {
    let mut rig = moving();
    rig.urgent(0, UrgentCommand::Pause);
    rig.urgent(0, UrgentCommand::Stop);
    rig.urgent(1, UrgentCommand::Stop);
    stopped_within(&mut rig, 300);
    assert_eq!(rig.trajectory(), TrajectoryState::Stop);
    let accepted = exec_record(DataStatus::NoError);
    assert_eq!(rig.records(), [accepted; 3]);
    rig.statuses.clear();
    rig.urgent(0, UrgentCommand::Stop);
    rig.run(5);
    assert_eq!(rig.records(), [exec_record(DataStatus::NotAllowed)]);
}

#[test]
fn j04_a_command_that_is_not_short_waits_for_its_own_tick() {
    let mut rig = Rig::holding();
    let long = [
        FrameType::PidParamUseDefault,
        FrameType::ClearOccurredErrors,
        FrameType::FrictionPolynomialUseDefault,
    ];
    for _ in 0..10 {
        long.iter().for_each(|t| rig.send(*t, &[]));
    }
    let mut waiting = rig.waiting();
    while waiting > 0 {
        rig.tick();
        let done = waiting - rig.waiting();
        assert!((1..=2).contains(&done), "at least one, and one of them costly: {done}");
        waiting = rig.waiting();
    }
    // If a frame changes the controller state, the controller must check the next frame in the new state.
    rig.statuses.clear();
    rig.send(FrameType::TeachingModeEnable, &[]);
    rig.send(FrameType::TeachingModeDisable, &[]);
    rig.send(FrameType::TeachingModeEnable, &[]);
    rig.send(FrameType::TeachingModeDisable, &[]);
    rig.send(FrameType::Trajectory, &segment_body(1, 0, 1, 10, &[rest(0); 3]));
    rig.run(10);
    assert!(rig.records().iter().all(Response::accepted), "{:?}", rig.records());
    // The controller executes several short frames in one tick.
    (0..160).for_each(|_| rig.send(FrameType::ClearOccurredErrors, &[]));
    rig.run(10);
    assert_eq!(rig.waiting(), 0);
}

#[test]
fn j04_noise_makes_one_record_while_it_waits() {
    let mut rig = Rig::holding();
    rig.run(50);
    rig.statuses.clear();
    rig.status_free = false;
    for _ in 0..200 {
        rig.send_noise(NOISE);
        rig.run(6);
    }
    rig.send(FrameType::PidParamUseDefault, &[]);
    rig.status_free = true;
    rig.run(200);
    let records = rig.records();
    assert_eq!(records.len(), 2, "{records:?}");
    assert_eq!((records[0], records[1].frame_type), (NOISE, 0x08));
    assert_eq!(rig.controller.telemetry().records_lost, 0);
}

#[test]
fn j04_a_line_that_floods_loses_no_record_of_the_other() {
    let mut rig = Rig::holding();
    rig.run(50);
    rig.statuses.clear();
    for n in 0..2000 {
        rig.send_on(0, FrameType::ClearOccurredErrors, &[]);
        if n % 100 == 50 {
            rig.send_on(1, FrameType::PidParamUseDefault, &[]);
        }
    }
    run_slowly(&mut rig, 3000);
    let other = rig.records().iter().filter(|r| r.frame_type == 0x08).count();
    assert_eq!(other, 20);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..Default::default() })]

    /// For any order of the frames, each frame gets exactly one response record if at most 64 records wait. The records of each line have
    /// the order of its frames.
    #[test]
    fn j04_exactly_one_record_a_frame(sent in prop::collection::vec((0usize..2, 0u8..8), 1..60)) {
        let mut rig = Rig::holding();
        rig.upload(&[rest(0); 300], 10);
        rig.run(50);
        rig.statuses.clear();
        let mut expected = [vec![], vec![]];
        for (line, what) in sent {
            let (frame_type, body): (FrameType, &[u8]) = match what {
                0 => (FrameType::ClearOccurredErrors, &[]),
                1 => (FrameType::PidParamUseDefault, &[]),
                2 => (FrameType::TrajSetExecStatus, &[3]),
                3 => (FrameType::TrajSetExecStatus, &[9]),
                4 | 5 => (FrameType::TrajSetExecStatus, &[0]),
                6 => (FrameType::FrictionTableUseDefault, &[]),
                _ => (FrameType::GripperControl, &[0, 0, 0, 0]),
            };
            match what {
                4 => rig.urgent(line, UrgentCommand::Stop),
                5 => rig.urgent(line, UrgentCommand::Pause),
                _ => rig.send_on(line, frame_type, body),
            }
            expected[line].push(frame_type as u8);
            if what == 7 {
                run_slowly(&mut rig, 3);
            }
        }
        let mut found = [vec![], vec![]];
        for _ in 0..200 {
            rig.tick();
            if let Some(line) = rig.last.record_line {
                found[line].push(rig.statuses.last().unwrap().response.frame_type);
            }
        }
        // The response records of the frames that were sent slowly arrived before the loop above.
        let early = rig.records().len() - found[0].len() - found[1].len();
        prop_assert_eq!(early + found[0].len() + found[1].len(), expected[0].len() + expected[1].len());
        for line in 0..2 {
            prop_assert!(expected[line].ends_with(&found[line]), "{:?} {:?}", expected[line], found[line]);
        }
    }
}
