//! A Stop or a Pause must take effect in the tick after its last byte, with any other bytes on the line (J-04).
//!
//! Each test runs two simulations that differ only in the bytes on the serial line. In the first simulation, the host
//! sends only the Stop. In the second simulation, the host also sends other bytes. From the tick after the last byte of
//! the Stop, the two simulations must produce bit-identical commands.
use jtc_core::{ControllerState, TrajectoryState};
use jtc_sim::{Operator, SimConfig, host};
use jtc_wire::{DataStatus, ExecCommand, FrameType, Response, fixed};

/// Bytes that a host writes, each with the time in ms after the start.
type Script = Vec<(u64, Vec<u8>)>;

/// Returns an arm that moves on its path, with a line of `baud` bit/s or without transmission time.
fn moving(baud: Option<u32>) -> Operator {
    let mut operator = Operator::new(SimConfig { baud, ..SimConfig::default() });
    operator.bring_up().expect("it comes up");
    let from = operator.world.truth().q;
    let to = [0, 1, 2, 3, 4, 5].map(|j: usize| from[j] + if j == 1 { 0.3 } else { 0.6 });
    operator.upload(&host::there_and_back(&from, &to, 3.0, 2, 60), 60).expect("it is taken");
    operator.ask(&host::exec(ExecCommand::Execute)).expect("it begins");
    operator.wait("the path", 1000, |world| world.telemetry().point > 300).expect("it moves");
    operator.listener.responses.clear();
    operator
}

/// Runs the script up to the millisecond in which byte `end` of the script has arrived. Returns the operator and the
/// number of that millisecond.
fn play(baud: Option<u32>, script: &Script, end: u64) -> (Operator, u64) {
    let mut operator = moving(baud);
    let before = operator.world.statistics().serial_to_device;
    for ms in 0.. {
        for (_, bytes) in script.iter().filter(|(at, _)| *at == ms) {
            operator.world.host_write(bytes);
        }
        operator.step();
        if operator.world.statistics().serial_to_device - before >= end {
            return (operator, ms);
        }
    }
    unreachable!()
}

/// Checks that a command slows the arm down exactly as on a line without other bytes. Byte `end` of the script is the
/// last byte of the command.
fn acts_at_once(baud: Option<u32>, script: &Script, end: u64, command: ExecCommand) -> Operator {
    let (mut busy, ms) = play(baud, script, end);
    assert_eq!(busy.world.telemetry().trajectory, TrajectoryState::Execute, "still on the way");
    // The simulation without other bytes sends the command so early that its last byte arrives in the same
    // millisecond as in the simulation with other bytes.
    let frame = host::exec(command);
    let lead = baud.map_or(0, |rate| (70_000 / u64::from(rate)) + 1);
    let (mut quiet, quiet_ms) = play(baud, &vec![(ms - lead, frame.clone())], frame.len() as u64);
    assert_eq!(quiet_ms, ms);
    let rest: Script = script.iter().filter(|(at, _)| *at > ms).cloned().collect();
    let mut stood = None;
    for n in 1..2000 {
        let set = |operator: &Operator| operator.world.telemetry().joints.map(|j| j.set_position.to_bits());
        assert_eq!(set(&busy), set(&quiet), "{n} ms after the last byte");
        if quiet.world.telemetry().trajectory != TrajectoryState::Execute {
            stood.get_or_insert(n);
        }
        for (_, bytes) in rest.iter().filter(|(at, _)| *at == ms + n) {
            busy.world.host_write(bytes);
        }
        busy.step();
        quiet.step();
    }
    assert!(stood.is_some_and(|ms| ms <= 500), "it stands after {stood:?} ms");
    let wanted = if command == ExecCommand::Pause { TrajectoryState::Pause } else { TrajectoryState::Stop };
    assert_eq!(busy.world.telemetry().trajectory, wanted);
    assert_eq!((busy.state(), busy.world.telemetry().errors), (ControllerState::HoldPos, 0));
    busy
}

fn exec_records(operator: &Operator) -> Vec<DataStatus> {
    let of_exec = |r: &&Response| r.frame_type == FrameType::TrajSetExecStatus as u8;
    operator.listener.responses.iter().filter(of_exec).map(|r| r.data).collect()
}

#[test]
fn j04_a_stop_behind_hundreds_of_frames() {
    for (baud, frames) in [(Some(115_200), 400), (Some(9600), 400)] {
        let bytes = [fixed::CLEAR_OCCURRED_ERRORS.repeat(frames), fixed::STOP.to_vec()].concat();
        let end = bytes.len() as u64;
        let busy = acts_at_once(baud, &vec![(0, bytes)], end, ExecCommand::Stop);
        if baud == Some(115_200) {
            assert_eq!(exec_records(&busy), [DataStatus::NoError], "one record of its own");
        }
    }
}

#[test]
fn j04_a_stop_behind_four_thousand_frames() {
    // At 115,200 bit/s, the 4000 frames (24,000 bytes) take two seconds. At 15 Mbit/s, 200,000 frames do not fit into
    // the buffer of the board, so bytes must be lost.
    for (baud, frames) in [(115_200, 4000), (15_000_000, 4000), (15_000_000, 200_000)] {
        let bytes = [fixed::CLEAR_OCCURRED_ERRORS.repeat(frames), fixed::STOP.to_vec()].concat();
        let end = bytes.len() as u64;
        let busy = acts_at_once(Some(baud), &vec![(0, bytes)], end, ExecCommand::Stop);
        let lost = busy.world.statistics().lost_bytes;
        assert_eq!(lost > 0, frames == 200_000, "{lost} bytes of {end} at {baud} Bd");
        if lost == 0 {
            assert_eq!(exec_records(&busy), [DataStatus::NoError]);
        }
    }
}

/// At 921,600 bit/s, the controller executes 40,000 short frames without losing a frame; only response records may be
/// lost. Above 960 kBd, the shortest frames arrive faster than the controller executes them.
#[test]
fn j04_short_frames_are_executed_as_fast_as_they_come() {
    let mut operator = moving(Some(921_600));
    operator.world.host_write(&fixed::PUMP_OFF.repeat(20_000));
    operator.world.host_write(&fixed::CLEAR_OCCURRED_ERRORS.repeat(20_000));
    let mut done = 0;
    while operator.world.host_write_pending() > 0 {
        operator.step();
        done += operator.world.worked().len();
    }
    operator.step();
    done += operator.world.worked().len();
    assert_eq!(done, 40_000, "when the last byte has come, the last frame is executed in the same tick");
    assert_eq!(operator.world.statistics().lost_bytes, 0);
}

#[test]
fn j04_a_stop_among_pump_frames() {
    // The host sends a frame every 10 ms for 5 s, and a Pause after about 3 s.
    let mut script: Script = (0..500).map(|n| (10 * n, fixed::PUMP_OFF.to_vec())).collect();
    script.insert(300, (3004, fixed::PAUSE.to_vec()));
    let end = 300 * 10 + 10 + 7;
    let before: u64 = script.iter().filter(|(at, _)| *at <= 3004).map(|(_, bytes)| bytes.len() as u64).sum();
    assert!(before <= end);
    let busy = acts_at_once(Some(115_200), &script, before, ExecCommand::Pause);
    assert_eq!(exec_records(&busy), [DataStatus::NoError]);
}

#[test]
fn j04_a_stop_in_noise() {
    for baud in [115_200, 9600] {
        for byte in [0x00, 0x55, 0xFF, 0x9B, 0x0B] {
            // The host sends a noise byte every 6 ms for 3 s. The Stop follows one of these bytes without a gap.
            let mut script: Script = (0..500).map(|n| (6 * n, vec![byte])).collect();
            script[250].1.extend(fixed::STOP);
            let end = 251 + 7;
            let busy = acts_at_once(Some(baud), &script, end, ExecCommand::Stop);
            assert_eq!(exec_records(&busy), [DataStatus::NoError], "0x{byte:02X} at {baud} Bd");
            assert_eq!(busy.world.telemetry().records_lost, 0);
        }
    }
}

#[test]
fn j04_a_stop_behind_a_false_header_and_a_long_frame() {
    let points = host::there_and_back(&[0.0; 6], &[0.1; 6], 1.0, 2, 10);
    // GetInfo marks the client as a client that uses the extensions. Without GetInfo, segment 0 would itself act as a
    // Stop (J-30).
    let long = [&fixed::GET_INFO[..], &host::trajectory(&points, 10, 400).concat()].concat();
    for front in [&[0x9B, 0x04, 0xEA, 0x56][..], &[0x9B], &long, &long[..long.len() - 3]] {
        let bytes = [front, &fixed::STOP].concat();
        let end = bytes.len() as u64;
        let busy = acts_at_once(Some(115_200), &vec![(0, bytes)], end, ExecCommand::Stop);
        assert_eq!(exec_records(&busy), [DataStatus::NoError], "{} bytes in front", front.len());
    }
}

#[test]
fn j04_a_stop_cancels_an_execute_that_waits() {
    let mut operator = moving(Some(115_200));
    operator.ask(&host::exec(ExecCommand::Stop)).expect("it stops");
    operator
        .wait("Stop", 600, |world| world.telemetry().trajectory == TrajectoryState::Stop)
        .expect("it stops");
    operator.listener.responses.clear();
    // The host sends frames with gains, which need one tick each, and then an Execute and a Stop. The Stop must
    // cancel the waiting Execute.
    let frames = [&fixed::PID_PARAM_USE_DEFAULT.repeat(30)[..], &fixed::EXECUTE, &fixed::STOP].concat();
    operator.world.host_write(&frames);
    for _ in 0..1500 {
        operator.step();
        assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Stop, "nothing moves");
    }
    // The trajectory was uploaded by a host without extensions. The controller therefore rejects the Execute of this
    // host with a data status that existing hosts know (J-51).
    assert_eq!(exec_records(&operator), [DataStatus::IncorrectValue, DataStatus::NoError]);
    assert_eq!(operator.listener.responses.len(), 32, "one record a frame");
}

/// An existing proxy sends new waypoints while the arm moves. The proxy sends only these frames again and again until
/// the controller accepts them. The arm must stop, and the controller must then accept the frames.
#[test]
fn j30_a_host_that_repeats_segment_0_stops_the_arm_and_is_taken() {
    for baud in [Some(115_200), None] {
        let mut operator = moving(baud);
        // After more than 2 s without an extension request, the controller treats the host as a host without
        // extensions (J-51).
        operator.run(2_100);
        assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Execute);
        let mut refused = 0;
        loop {
            let there = operator.world.telemetry().joints.map(|joint| joint.position);
            let frames = host::trajectory(&host::there_and_back(&there, &there, 0.1, 2, 10), 10, 400);
            assert_eq!(frames.len(), 1);
            match operator.response(&frames[0]).expect("a record").data {
                DataStatus::NoError => break,
                data => assert_eq!(data, DataStatus::IncorrectValue),
            }
            refused += 1;
            assert!(refused < 1_000, "it is never taken");
        }
        assert!(refused > 0);
        let t = operator.world.telemetry();
        assert_eq!((t.state, t.trajectory, t.errors), (ControllerState::HoldPos, TrajectoryState::Stop, 0));
    }
}

/// A user of an existing proxy requests a motion beyond a limit. The proxy would repeat a rejected segment forever,
/// and would not forward any other command. The controller must therefore accept the segments and reject only the
/// Execute.
#[test]
fn j36_an_existing_host_outlives_a_trajectory_that_breaks_a_limit() {
    for baud in [Some(115_200), None] {
        let mut operator = moving(baud);
        operator.ask(&host::exec(ExecCommand::Stop)).expect("it stops");
        operator
            .wait("Stop", 600, |world| world.telemetry().trajectory == TrajectoryState::Stop)
            .expect("it stops");
        operator.run(2_100);
        let there = operator.world.telemetry().joints.map(|joint| joint.position);
        let mut beyond = there;
        beyond[1] = 1.8;
        for per_segment in [400, 50] {
            let points = host::there_and_back(&there, &beyond, 2.0, 1, 10);
            for frame in host::trajectory(&points, 10, per_segment) {
                assert_eq!(operator.response(&frame).expect("a record").data, DataStatus::NoError);
            }
            assert_eq!(operator.world.telemetry().trajectory, TrajectoryState::Stop);
            let execute = host::exec(ExecCommand::Execute);
            assert_eq!(operator.response(&execute).expect("a record").data, DataStatus::IncorrectValue);
        }
        let points = host::there_and_back(&there, &there, 0.1, 2, 10);
        for frame in [host::trajectory(&points, 10, 400).concat(), host::exec(ExecCommand::Execute)] {
            assert_eq!(operator.response(&frame).expect("a record").data, DataStatus::NoError);
        }
        operator
            .wait("Finish", 2_000, |world| world.telemetry().trajectory == TrajectoryState::Finish)
            .expect("it moves");
        assert_eq!(operator.world.telemetry().errors, 0);
    }
}
