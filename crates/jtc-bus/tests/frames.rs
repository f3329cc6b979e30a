//! Tests of the frames of the bus, byte by byte and as properties of random frames.

use jtc_bus::{
    Answer, Bits, Frame, FrameError, GRIPPER, GripperReport, JOINTS, JointReport, NODES, NodeState,
    POSITION_FULL_SCALE, Request, Scale, TORQUE_FULL_SCALE, Target, config, error, warning,
};
use proptest::num::f64::ANY;
use proptest::prelude::*;

const SCALE: Scale = Scale { velocity: 2.0 };

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(id, data).expect("a frame of this bus")
}

#[test]
fn j11_move() {
    let request = Request::Move { torque: [360.0, -360.0, 180.0, 0.011, -0.011, 0.0], pump: true };
    let bytes = [0x7F, 0xFF, 0x80, 0x01, 0x40, 0x00, 0, 1, 0xFF, 0xFF, 0, 0, 1, 0, 0, 0];
    assert_eq!(request.emit(), frame(0x000, &bytes));
}

#[test]
fn j11_change_fsm() {
    use Target::{Enable, Init, NoChange, Ready};
    let request = Request::ChangeFsm { target: [Enable, Ready, Init, NoChange, Enable, Ready, Init] };
    assert_eq!(request.emit(), frame(0x010, &[3, 2, 1, 0, 3, 2, 1]));
}

#[test]
fn j11_change_mode() {
    let request = Request::ChangeMode {
        mode: [1; JOINTS],
        config: [config::JOINT_DEFAULT; JOINTS],
        gripper: config::GRIPPER_DEFAULT,
    };
    let bytes = [1, 0x17, 1, 0x17, 1, 0x17, 1, 0x17, 1, 0x17, 1, 0x17, 0, 0x04, 0, 0];
    assert_eq!(request.emit(), frame(0x0F0, &bytes));
}

#[test]
fn j11_resets() {
    assert_eq!(Request::ResetAll.emit(), frame(0x0A0, &[]));
    for node in 0..NODES as u8 {
        let frame = Request::Reset(node).emit();
        assert_eq!((frame.id, frame.data()), (0x1A0 + u16::from(node), &[][..]));
        assert_eq!(Request::parse(&frame), Ok(Request::Reset(node)));
    }
    assert!(!Request::ResetAll.is_answered() && !Request::Reset(3).is_answered());
    assert!(Request::zero_torque(false).is_answered());
}

#[test]
fn j23_a_reset_of_no_node_reaches_no_node() {
    for node in NODES as u8..=255 {
        let frame = Request::Reset(node).emit();
        assert_eq!(frame.id, 0x1AF);
        assert_eq!(Request::parse(&frame), Err(FrameError::UnknownId(0x1AF)));
    }
}

#[test]
fn j11_joint_answer_of_16_and_20_bytes() {
    let mut bytes = [0; 24];
    bytes[..14].copy_from_slice(&[0x7F, 0xFF, 0xFF, 0xFF, 0x80, 0x01, 0x40, 0, 33, 3, 0x40, 0x42, 2, 8]);
    bytes[16] = 55;
    let mut report = JointReport {
        position: POSITION_FULL_SCALE,
        velocity: -2.0,
        torque: 16384.0 * TORQUE_FULL_SCALE / 32767.0,
        temperature: 33,
        state: NodeState::ENABLED,
        mc_current: 0x40,
        mc_occurred: 0x42,
        errors: 0x02,
        warnings: warning::SAFETY_LINE,
        motor_temperature: None,
    };
    for node in 0..JOINTS as u8 {
        let id = 0x200 + u16::from(node);
        let short = Answer::parse(&frame(id, &bytes[..16]), SCALE);
        assert_eq!(short, Ok(Answer::Joint { node, report }));
        let long = JointReport { motor_temperature: Some(55), ..report };
        for len in [20, 24] {
            let answer = Answer::parse(&frame(id, &bytes[..len]), SCALE);
            assert_eq!(answer, Ok(Answer::Joint { node, report: long }));
        }
        assert_eq!(Answer::Joint { node, report: long }.emit(SCALE), frame(id, &bytes[..20]));
        // Only a report of 20 bytes contains the bytes from offset 16.
        let mut short = frame(id, &bytes[..16]);
        assert_eq!(Answer::Joint { node, report }.emit(SCALE), short);
        short.id += 1;
        assert_ne!(Answer::Joint { node, report }.emit(SCALE), short);
    }
    report.velocity = -Scale::OLDER.velocity;
    let answer = Answer::parse(&frame(0x200, &bytes[..16]), Scale::OLDER);
    assert_eq!(answer, Ok(Answer::Joint { node: 0, report }));
}

#[test]
fn j11_gripper_answer() {
    let bytes = [1, 0, 7, 0, 0, 0, 0, 0, 0, 2, 0, 0, 4, 8, 0, 0];
    let report = GripperReport {
        pump: true,
        pressure1: false,
        pressure2: true,
        state: NodeState::READY,
        errors: 4,
        warnings: 8,
    };
    assert_eq!(Answer::parse(&frame(0x206, &bytes), SCALE), Ok(Answer::Gripper(report)));
    let again = Answer::Gripper(report).emit(SCALE);
    assert_eq!((again.id, again.data()[2]), (0x206, 1));
    assert_eq!(Answer::parse(&again, SCALE), Ok(Answer::Gripper(report)));
}

#[test]
fn j11_state_and_mode_answers() {
    for node in 0..NODES as u8 {
        let id = u16::from(node);
        for byte in 0..=255 {
            let answer = Answer::parse(&frame(0x210 + id, &[byte]), SCALE);
            assert_eq!(answer, Ok(Answer::State { node, state: NodeState::new(byte) }));
            let answer = Answer::parse(&frame(0x2F0 + id, &[byte, 9, 9]), SCALE);
            assert_eq!(answer, Ok(Answer::Mode { node, accepted: byte == 1 }));
        }
        assert_eq!(
            Answer::State { node, state: NodeState::FAULT_REACTION }.emit(SCALE),
            frame(0x210 + id, &[254])
        );
        assert_eq!(Answer::Mode { node, accepted: true }.emit(SCALE), frame(0x2F0 + id, &[1]));
    }
}

#[test]
fn j11_a_joint_that_does_not_exist_is_never_somebody_else() {
    for node in JOINTS as u8..=255 {
        let answer = Answer::Joint { node, report: JointReport::default() };
        assert_eq!(answer.emit(SCALE).id, 0x20F, "the gripper is no joint");
        if usize::from(node) > GRIPPER {
            assert_eq!(Answer::State { node, state: NodeState::INIT }.emit(SCALE).id, 0x21F);
            assert_eq!(Answer::Mode { node, accepted: true }.emit(SCALE).id, 0x2FF);
        }
    }
}

#[test]
fn j16_only_four_states_can_be_asked_for() {
    for byte in 0..=255 {
        assert_eq!(Target::from_byte(byte).map(|target| target as u8), (byte <= 3).then_some(byte));
        let parsed = Request::parse(&frame(0x010, &[0, 0, 0, byte, 0, 0, 0]));
        if byte > 3 {
            assert_eq!(parsed, Err(FrameError::BadValue { id: 0x010, at: 3, value: byte }));
        } else {
            assert_eq!(parsed.unwrap().emit().data()[3], byte);
        }
    }
}

#[test]
fn j15_every_id_is_known_or_an_error() {
    let requests: Vec<u16> = [0x000, 0x010, 0x0A0, 0x0F0].into_iter().chain(0x1A0..0x1A7).collect();
    let answers: Vec<u16> = (0x200..0x207).chain(0x210..0x217).chain(0x2F0..0x2F7).collect();
    for id in 0..0x800 {
        let frame = frame(id, &[0; 24]);
        let unknown = FrameError::UnknownId(id);
        assert_eq!(Request::parse(&frame).err(), (!requests.contains(&id)).then_some(unknown));
        assert_eq!(Answer::parse(&frame, SCALE).err(), (!answers.contains(&id)).then_some(unknown));
    }
}

#[test]
fn j15_short_frames_are_errors() {
    let lengths = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24];
    let needs = [(0x000, 16), (0x010, 7), (0x0F0, 16), (0x0A0, 0), (0x1A3, 0)];
    for (id, need) in needs {
        for len in lengths {
            let error = FrameError::TooShort { id, len: len as u8, need: need as u8 };
            let parsed = Request::parse(&frame(id, &[0; 24][..len]));
            assert_eq!(parsed.err(), (len < need).then_some(error));
        }
    }
    for (id, need) in [(0x200, 16), (0x205, 16), (0x206, 16), (0x210, 1), (0x2F6, 1)] {
        for len in lengths {
            let error = FrameError::TooShort { id, len: len as u8, need: need as u8 };
            let parsed = Answer::parse(&frame(id, &[0; 24][..len]), SCALE);
            assert_eq!(parsed.err(), (len < need).then_some(error));
        }
    }
}

#[test]
fn errors_say_what_is_wrong() {
    let text = |error: FrameError| error.to_string();
    assert_eq!(text(FrameError::UnknownId(0x3FF)), "no frame of the joint bus has id 0x3FF");
    let short = FrameError::TooShort { id: 0x203, len: 8, need: 16 };
    assert_eq!(text(short), "frame 0x203 has 8 bytes and needs 16");
}

#[test]
fn frames_read_as_words() {
    let request = Request::Move { torque: [1.2, -3.4, 0.0, 0.0, 0.0, 0.0], pump: false };
    assert_eq!(request.emit().to_string(), "000 Move 1.2 -3.4 0.0 0.0 0.0 0.0 N·m, pump off");
    let mut target = [Target::NoChange; NODES];
    target[2] = Target::Enable;
    assert_eq!(Request::ChangeFsm { target }.emit().to_string(), "010 ChangeFsm - - enable - - - -");
    let report = JointReport {
        position: 0.5,
        temperature: 31,
        state: NodeState::FAULT,
        mc_current: 0x40,
        mc_occurred: 0x42,
        errors: 0x02,
        warnings: 0x01,
        ..JointReport::default()
    };
    assert_eq!(
        Answer::Joint { node: 4, report }.emit(SCALE).to_string(),
        "204 joint 5 0.5000 rad, 0.0000 rad/s, 0.0 N·m, 31 °C, fault, motor control: over-current, \
         motor control before: over-voltage, errors: motor-control fault, warnings: position not accurate"
    );
    assert_eq!(frame(0x3FF, &[1, 0xAB]).to_string(), "3FF no frame of the joint bus has id 0x3FF: 01 AB");
    let short = frame(0x000, &[]);
    assert_eq!(short.to_string(), "000 frame 0x000 has 0 bytes and needs 16: no bytes");
    let short = frame(0x203, &[1, 2]);
    assert_eq!(short.to_string(), "203 frame 0x203 has 2 bytes and needs 16: 01 02");
}

#[test]
fn configurations_read_as_words() {
    let request =
        Request::ChangeMode { mode: [0, 1, 2, 3, 1, 1], config: [0, 0x17, 0x17, 1, 0x17, 0x17], gripper: 0 };
    assert_eq!(
        request.emit().to_string(),
        "0F0 ChangeMode none/00 torque/17 speed/17 mode-3/01 torque/17 torque/17, gripper 00 (-)"
    );
}

#[test]
fn what_a_gripper_says_reads_as_words() {
    assert_eq!(Request::Reset(6).emit().to_string(), "1A6 Reset gripper");
    let report = GripperReport {
        pump: true,
        pressure1: true,
        state: NodeState::FAULT,
        errors: 0x06,
        ..Default::default()
    };
    assert_eq!(
        Answer::Gripper(report).emit(SCALE).to_string(),
        "206 gripper pump on, level 1 reached, level 2 not reached, fault, \
         errors: motor-control fault, over-speed"
    );
    assert_eq!(Bits(0, &error::NAMES).to_string(), "-");
}

/// Returns the torques as a drive reads them.
fn drives_torque(frame: &Frame) -> [i16; JOINTS] {
    core::array::from_fn(|joint| i16::from_be_bytes([frame.data()[2 * joint], frame.data()[2 * joint + 1]]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4_000, failure_persistence: None, ..Default::default() })]

    #[test]
    fn j13_no_torque_wraps_or_changes_sign(torque in prop::array::uniform6(ANY), pump: bool) {
        let frame = Request::Move { torque, pump }.emit();
        for (asked, sent) in torque.into_iter().zip(drives_torque(&frame)) {
            if asked.is_nan() {
                prop_assert_eq!(sent, 0);
            } else if asked.abs() >= TORQUE_FULL_SCALE {
                prop_assert_eq!(f64::from(sent), 32767.0_f64.copysign(asked));
            } else {
                let drive = f64::from(sent) * 360.0 / 32767.0;
                prop_assert!((drive - asked).abs() <= 0.0055, "{} sent as {}", asked, drive);
                prop_assert!(f64::from(sent) * asked >= 0.0);
            }
        }
        prop_assert_eq!(&frame.data()[12..], &[u8::from(pump), 0, 0, 0]);
    }

    #[test]
    fn j13_reports_saturate_too(position in ANY, velocity in ANY, torque in ANY) {
        let report = JointReport { position, velocity, torque, ..JointReport::default() };
        let frame = Answer::Joint { node: 1, report }.emit(SCALE);
        let Ok(Answer::Joint { report: received, .. }) = Answer::parse(&frame, SCALE) else {
            panic!("not understood: {frame}");
        };
        let pairs = [
            (position, received.position, POSITION_FULL_SCALE),
            (velocity, received.velocity, 2.0),
            (torque, received.torque, TORQUE_FULL_SCALE),
        ];
        for (sent, received, scale) in pairs {
            prop_assert!(received.abs() <= scale);
            prop_assert!(sent.is_nan() && received == 0.0 || received * sent >= 0.0);
            if sent.abs() < scale {
                prop_assert!((received - sent).abs() <= 0.51 * scale / 32767.0);
            }
        }
    }

    #[test]
    fn j11_requests_survive_the_wire(
        raw in prop::array::uniform6(-32767..=32767_i16),
        pump: bool,
        mode in prop::array::uniform6(0..=255_u8),
        bits in prop::array::uniform6(0..=255_u8),
        gripper: u8,
        targets in prop::array::uniform7(0..=3_u8),
    ) {
        let requests = [
            Request::Move { torque: raw.map(|raw| f64::from(raw) * TORQUE_FULL_SCALE / 32767.0), pump },
            Request::ChangeMode { mode, config: bits, gripper },
            Request::ChangeFsm { target: targets.map(|byte| Target::from_byte(byte).unwrap()) },
        ];
        for request in requests {
            let frame = request.emit();
            prop_assert_eq!(Request::parse(&frame), Ok(request));
            prop_assert!(Answer::parse(&frame, SCALE).is_err());
        }
    }
}
