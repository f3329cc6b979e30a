//! Inputs of a tick other than bus frames: the safety input, late ticks, urgent commands and host events (J-56).
extern crate std;
use std::vec::Vec;

use jtc_bus::{Frame, id};
use jtc_wire::{FrameRef, FrameStatus, FrameType, LinkEvent, Response, UrgentCommand, UrgentCommands};

use super::read_back;
use crate::io::{BusState, HostEvent, Inputs};
use crate::recorder::{RecordedInputs, RecordedKind};

fn event(event: LinkEvent<'_>) -> HostEvent<'_> {
    HostEvent { line: 1, overtaken: false, plain: false, event }
}

fn frame(frame_type: FrameType, bytes: &[u8]) -> HostEvent<'_> {
    event(LinkEvent::Frame(FrameRef { frame_type, bytes }))
}

/// Returns the recorded inputs of one tick.
fn recorded(inputs: Inputs<'_>) -> RecordedInputs {
    let done = inputs.host.len();
    read_back(&[(inputs, done)])[0].0
}

fn kinds(inputs: &RecordedInputs) -> Vec<RecordedKind> {
    inputs.host().iter().map(|event| event.kind).collect()
}

/// In each tick of this test, at most one input differs from a quiet tick. The bus is empty, or all nodes have
/// answered in order.
#[test]
fn j56_each_input_is_recorded_if_all_others_are_quiet() {
    let mut twice = UrgentCommands::NONE;
    twice.add(UrgentCommand::Pause, 3);
    twice.add(UrgentCommand::Stop, 2);
    let mut pause = UrgentCommands::NONE;
    pause.add(UrgentCommand::Stop, 1);
    pause.add(UrgentCommand::Pause, 255);
    let mut stop = UrgentCommands::NONE;
    stop.push(UrgentCommand::Stop);
    let noise = [event(LinkEvent::Noise(Response::bad(0, FrameStatus::IncorrectHeader, 0)))];
    let answers: Vec<Frame> = (0..7).filter_map(|n| Frame::new(id::MOVE_ANSWER + n, &[0; 16])).collect();
    let state = |acknowledged, bus_off| BusState { acknowledged, bus_off };
    for bus in [&[][..], &answers] {
        let quiet = Inputs { bus, ..Inputs::QUIET };
        for inputs in [
            quiet,
            Inputs { safety_input: false, ..quiet },
            Inputs { status_free: false, ..quiet },
            Inputs { bus_state: state(false, false), ..quiet },
            Inputs { bus_state: state(true, true), ..quiet },
            Inputs { bus_state: state(false, true), ..quiet },
            Inputs { missed_ticks: 1, ..quiet },
            Inputs { missed_ticks: 0xABCD, ..quiet },
            Inputs { urgent: [stop, UrgentCommands::NONE], ..quiet },
            Inputs { urgent: [UrgentCommands::NONE, twice], ..quiet },
            Inputs { urgent: [pause, twice], ..quiet },
            Inputs { host: &noise, ..quiet },
        ] {
            let read = recorded(inputs);
            assert_eq!(read.safety_input, inputs.safety_input);
            assert_eq!(read.status_free, inputs.status_free);
            assert_eq!(read.bus_state, inputs.bus_state);
            assert_eq!(read.missed_ticks, inputs.missed_ticks);
            assert_eq!(read.urgent, inputs.urgent);
            assert_eq!(read.host().len(), inputs.host.len());
            assert!(read.is_whole());
        }
    }
}

#[test]
fn j56_host_events_are_recorded_with_their_kind() {
    let bad = |status| Response::bad(4, status, 0);
    for (link, kind) in [
        (LinkEvent::Bad(bad(FrameStatus::IncorrectCrc)), RecordedKind::Bad(FrameStatus::IncorrectCrc)),
        (
            LinkEvent::Noise(bad(FrameStatus::DiscontinuousFrame)),
            RecordedKind::Noise(FrameStatus::DiscontinuousFrame),
        ),
    ] {
        for (line, overtaken, plain) in [(0, false, true), (1, true, false)] {
            let host = [HostEvent { line, overtaken, plain, event: link }];
            let read = recorded(Inputs { host: &host, ..Inputs::QUIET });
            assert_eq!(kinds(&read), [kind]);
            assert_eq!(read.host()[0].event(), host[0]);
            assert!(read.is_whole());
        }
    }
    let host = [frame(FrameType::SetSettings, b"bytes of a frame")];
    let read = recorded(Inputs { host: &host, ..Inputs::QUIET });
    assert_eq!((kinds(&read), read.host()[0].event()), ([RecordedKind::Frame].to_vec(), host[0]));
}

/// The log contains no parameters, and no host frames of more than 48 bytes.
#[test]
fn j56_a_log_contains_no_parameters_and_no_long_frames() {
    use FrameType::*;
    use RecordedKind::{Frame, Unrecorded};
    let bytes = [1; 49];
    for (frame_type, len, kind) in [
        (SetSettings, 48, Frame),
        (SetSettings, 49, Unrecorded),
        (GetInfo, 6, Frame),
        (Trajectory, 14, Frame),
        (FrictionTable, 6, Unrecorded),
        (FrictionTableUseDefault, 6, Unrecorded),
        (PidParam, 6, Unrecorded),
        (PidParamUseDefault, 6, Unrecorded),
        (ArmModel, 6, Unrecorded),
        (ArmModelUseDefault, 6, Unrecorded),
        (FrictionPolynomial, 6, Unrecorded),
        (FrictionPolynomialUseDefault, 6, Unrecorded),
    ] {
        let host = [frame(frame_type, &bytes[..len])];
        let read = recorded(Inputs { host: &host, ..Inputs::QUIET });
        assert_eq!(kinds(&read), [kind], "{frame_type:?}, {len} bytes");
        assert_eq!(read.is_whole(), kind == Frame);
        let stored: &[u8] = if kind == Frame { &bytes[..len] } else { &[] };
        assert_eq!((read.host()[0].bytes(), read.host()[0].frame_type), (stored, frame_type as u8));
    }
}

/// A segment 0 stops a motion in Operate (J-30), so a replay needs to know it. The bytes of a segment start after the four bytes of the
/// head, and the segment number is in bytes 6 and 7.
#[test]
fn j56_only_segment_0_of_a_trajectory_begins_an_upload_in_a_replay() {
    let mut segments = [[0; 50]; 3];
    segments[1][7] = 1;
    segments[2][6] = 1;
    // A Trajectory frame with the number 0 and without points has 14 bytes.
    for (frame_type, bytes, replayed) in [
        (FrameType::Trajectory, &segments[0], 14),
        (FrameType::Trajectory, &segments[1], 0),
        (FrameType::Trajectory, &segments[2], 0),
        (FrameType::PidParam, &segments[0], 0),
        (FrameType::SetSettings, &segments[0], 0),
    ] {
        let host = [frame(frame_type, bytes)];
        let read = recorded(Inputs { host: &host, ..Inputs::QUIET });
        assert_eq!(kinds(&read), [RecordedKind::Unrecorded]);
        let expected = FrameRef { frame_type, bytes: &[0; 14][..replayed] };
        assert_eq!(read.host()[0].event().event, LinkEvent::Frame(expected), "{frame_type:?} {bytes:?}");
    }
}

/// The log contains all events that the controller has completed. The log also contains the next event, because the
/// controller may have executed a part of it.
#[test]
fn j56_the_events_that_the_controller_has_looked_at_are_recorded() {
    let frames: Vec<_> = (0..4).map(|_| frame(FrameType::GetInfo, &[0; 6])).collect();
    for (done, expected) in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 4)] {
        let read = read_back(&[(Inputs { host: &frames, ..Inputs::QUIET }, done)]);
        assert_eq!(read[0].0.host().len(), expected, "{done} completed events");
        assert!(read[0].0.is_whole());
    }
}

/// The log has space for 500 bytes at one time. An event takes two bytes, plus the bytes of its frame if the log contains them.
#[test]
fn j56_the_log_stores_at_most_500_bytes_from_hosts_at_once() {
    // A frame of 48 bytes takes 50 bytes.
    let frames = [frame(FrameType::SetSettings, &[0; 48]); 11];
    let read = recorded(Inputs { host: &frames[..10], ..Inputs::QUIET });
    assert_eq!((read.host().len(), read.is_whole()), (10, true));
    let read = recorded(Inputs { host: &frames, ..Inputs::QUIET });
    assert_eq!((read.host().len(), read.is_whole()), (10, false));
    assert!(kinds(&read).iter().all(|kind| *kind == RecordedKind::Frame));
    // Nine frames of 50 bytes and two events of two bytes take 454 bytes. A frame of 44 bytes takes 46 bytes, and no byte is left.
    let long = [0; 49];
    let mut events = Vec::from([frames[0]; 9]);
    events.extend([frame(FrameType::SetSettings, &long), frame(FrameType::SetSettings, &long)]);
    events.extend([frame(FrameType::SetSettings, &long[..44])]);
    let read = recorded(Inputs { host: &events, ..Inputs::QUIET });
    assert_eq!(read.host().len(), 12);
    assert_eq!(kinds(&read)[11], RecordedKind::Frame);
    events.push(frame(FrameType::GetInfo, &[]));
    let read = recorded(Inputs { host: &events, ..Inputs::QUIET });
    assert_eq!((read.host().len(), kinds(&read)[11]), (12, RecordedKind::Frame));
}

/// On average, the log stores two bytes per tick. A frame of 8 bytes takes ten bytes. Five ticks after the log was
/// full, the log therefore has space for this frame.
#[test]
fn j56_the_log_stores_two_bytes_from_hosts_per_tick() {
    let full = [frame(FrameType::SetSettings, &[0; 48]); 10];
    let short = [frame(FrameType::SetSettings, &[0; 8])];
    for (wait, expected) in [(1, 0), (4, 0), (5, 1), (6, 1)] {
        let mut ticks = Vec::from([(Inputs { host: &full, ..Inputs::QUIET }, 10)]);
        ticks.resize(wait, (Inputs::QUIET, 0));
        ticks.push((Inputs { host: &short, ..Inputs::QUIET }, 1));
        let read = read_back(&ticks);
        assert_eq!(read[0].0.host().len(), 10);
        let (last, _) = read[wait];
        assert_eq!((last.host().len(), last.is_whole()), (expected, expected == 1), "after {wait} ticks");
    }
    // The allowance does not exceed 500 bytes after a long quiet time.
    let eleven = [full[0]; 11];
    let mut ticks = Vec::from([(Inputs::QUIET, 0); 300]);
    ticks.push((Inputs { host: &eleven, ..Inputs::QUIET }, 11));
    assert_eq!(read_back(&ticks)[300].0.host().len(), 10);
}
