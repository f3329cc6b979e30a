//! Tests of the frame bytes, the scaling, and the numbers on the protocol pages.
use jtc_bus::NodeState;
use jtc_wire::{
    ACCELERATION_SCALE, Channel, Command, ControllerState, DataStatus, Described, EncodeError, ExecCommand,
    FRAME_MAX, FrameRef, FrameStatus, FrameType, FrictionTable, GripperStatus, JointStatus, OutOfScale,
    POSITION_SCALE, RawPoint, Response, STATUS_LEN, Status, StatusReceiver, TrajectoryState, VELOCITY_SCALE,
    arm_model, crc16, fixed, floats, friction_polynomial, friction_table, pid_param, trajectory,
};
use proptest::prelude::*;

fn crc_of(frame: &[u8]) -> u16 {
    u16::from_be_bytes([frame[frame.len() - 2], frame[frame.len() - 1]])
}

fn parse(frame: &[u8]) -> Result<Command<'_>, DataStatus> {
    Command::parse(FrameRef::new_checked(frame).expect("a good frame"))
}

#[test]
fn j02_printed_crcs() {
    assert_eq!(crc_of(&fixed::CLEAR_OCCURRED_ERRORS), 0xD626);
    assert_eq!(crc_of(&fixed::FRICTION_TABLE_USE_DEFAULT), 0x0AE6);
    assert_eq!(crc_of(&fixed::PID_PARAM_USE_DEFAULT), 0x11E7);
    assert_eq!(crc_of(&fixed::ARM_MODEL_USE_DEFAULT), 0x7F87);
    assert_eq!(crc_of(&fixed::TEACHING_MODE_ENABLE), 0xCD27);
    assert_eq!(crc_of(&fixed::TEACHING_MODE_DISABLE), 0xFA17);
    assert_eq!(crc_of(&fixed::STOP), 0x5DDC);
    assert_eq!(crc_of(&fixed::PAUSE), 0x6DBF);
    assert_eq!(crc_of(&fixed::EXECUTE), 0x7D9E);
    assert_eq!(crc_of(&fixed::clear_current_errors(true, 0)), 0x9EE1);
    assert_eq!(crc_of(&fixed::clear_current_errors(false, 0xFF)), 0x2736);
    assert_eq!(crc_of(&fixed::reset_can_devices(0xFF)), 0x2CEC);
    assert_eq!(crc_of(&fixed::PUMP_ON), 0xA99A);
    assert_eq!(crc_of(&fixed::PUMP_OFF), 0xDF2E);
}

/// E-04: for this frame, the manual prints the CRC of another frame.
#[test]
fn e04_friction_polynomial_use_default() {
    assert_eq!(fixed::FRICTION_POLYNOMIAL_USE_DEFAULT, [0x9B, 0x0F, 0x00, 0x06, 0x94, 0x77]);
    assert_eq!(crc_of(&fixed::empty(FrameType::FrictionPolynomial)), 0xA347);
}

/// E-03: type and length of TrajSetExecStatus.
#[test]
fn e03_exec_status() {
    assert_eq!(fixed::EXECUTE, [0x9B, 0x0B, 0x00, 0x07, 0x03, 0x7D, 0x9E]);
}

#[test]
fn j06_command_and_pump_bytes() {
    for byte in 0..=255u8 {
        let mut frame = [0x9B, 0x0B, 0, 7, byte, 0, 0];
        let crc = crc16(&frame[..5]).to_be_bytes();
        frame[5..].copy_from_slice(&crc);
        let expected = match byte {
            1 => Ok(Command::TrajSetExecStatus(ExecCommand::Stop)),
            2 => Ok(Command::TrajSetExecStatus(ExecCommand::Pause)),
            3 => Ok(Command::TrajSetExecStatus(ExecCommand::Execute)),
            _ => Err(DataStatus::IncorrectValue),
        };
        assert_eq!(parse(&frame), expected);

        let mut frame = [0x9B, 0x11, 0, 10, byte, 0, 0, 0, 0, 0];
        let crc = crc16(&frame[..8]).to_be_bytes();
        frame[8..].copy_from_slice(&crc);
        let expected = match byte {
            0 | 1 => Ok(Command::GripperControl { pump: byte == 1 }),
            _ => Err(DataStatus::IncorrectValue),
        };
        assert_eq!(parse(&frame), expected);
    }
}

#[test]
fn j06_masks() {
    let command = Command::ClearCurrentErrors { jtc: false, nodes: 0x7F };
    assert_eq!(parse(&fixed::clear_current_errors(false, 0xFF)), Ok(command));
    assert_eq!(parse(&fixed::reset_can_devices(0xC1)), Ok(Command::ResetCanDevices { nodes: 0x41 }));
}

#[test]
fn a_status_is_no_command() {
    assert_eq!(parse(&Status::default().emit()), Err(DataStatus::NotAllowed));
}

#[test]
fn trajectory_bytes() {
    let point = RawPoint { position: [1, -1, 0, 0, 0, 0x1234], velocity: [2; 6], acceleration: [-2; 6] };
    let mut out = [0; 50];
    assert_eq!(trajectory(&mut out, (1, 2, 3), 10, [point]), Ok(50));
    assert_eq!(out[..12], [0x9B, 0x04, 0x00, 0x32, 0, 1, 0, 2, 0, 3, 0, 10]);
    assert_eq!(out[12..24], [0, 1, 0xFF, 0xFF, 0, 0, 0, 0, 0, 0, 0x12, 0x34]);
    assert_eq!(out[24..36], [0, 2].repeat(6)[..]);
    assert_eq!(out[36..48], [0xFF, 0xFE].repeat(6)[..]);
    let Ok(Command::Trajectory(segment)) = parse(&out) else { panic!("no trajectory") };
    assert_eq!((segment.trajectory, segment.segment, segment.segments, segment.step_time), (1, 2, 3, 10));
    assert_eq!((segment.len(), segment.point(0), segment.point(1)), (1, Some(point), None));
}

#[test]
fn encoders_refuse_what_does_not_fit() {
    let point = RawPoint::default();
    let mut out = [0; FRAME_MAX];
    assert_eq!(trajectory(&mut out, (0, 0, 1), 10, [point; 1666]), Ok(59_990));
    let error = EncodeError::TooManyPoints { points: 1667, limit: 1666 };
    assert_eq!(trajectory(&mut out, (0, 0, 1), 10, [point; 1667]), Err(error));
    let error = EncodeError::BufferTooShort { needed: 50, given: 49 };
    assert_eq!(trajectory(&mut out[..49], (0, 0, 1), 10, [point]), Err(error));
    let error = EncodeError::WrongCount { frame_type: FrameType::PidParam, count: 29 };
    assert_eq!(floats(&mut out, FrameType::PidParam, [0.0; 29]), Err(error));
    let error = EncodeError::BufferTooShort { needed: 10, given: 9 };
    assert_eq!(Command::GripperControl { pump: true }.emit(&mut out[..9]), Err(error));
}

#[test]
fn j06_floats_that_are_none() {
    let mut out = [0; 600];
    let mut gains = [[1.0; 5]; 6];
    gains[2][1] = f64::NAN;
    let error = pid_param(&mut out, &gains).expect_err("not a number");
    assert_eq!(error.to_string(), "PidParam joint 3 Ki: NaN is not a number that a frame can carry");
    let mut links = [[0.5; 13]; 7];
    links[6][12] = 1e300;
    let error = arm_model(&mut out, &[[0.0; 6]; 7], &links).expect_err("too large for an f32");
    assert!(error.to_string().starts_with("ArmModel link 6 mass: 1"), "{error}");
}

#[test]
fn parameters_in_the_order_of_the_wire() {
    let mut out = vec![0; FRAME_MAX];
    let n = friction_polynomial(&mut out, &[[0.0, 1.0, 2.0, 3.0]; 6]).expect("good");
    assert_eq!(n, 102);
    let Ok(Command::FrictionPolynomial(c)) = parse(&out[..n]) else { panic!("no polynomial") };
    assert_eq!(c.iter().take(5).collect::<Vec<_>>(), [3.0, 2.0, 1.0, 0.0, 3.0], "highest index first");

    let n = friction_polynomial(&mut out, &[[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]; 6]).expect("good");
    assert_eq!((n, &out[4..8]), (150, &5f32.to_be_bytes()[..]));

    let gains = core::array::from_fn(|j| core::array::from_fn(|i| (10 * j + i) as f64));
    let n = pid_param(&mut out, &gains).expect("good");
    let Ok(Command::PidParam(values)) = parse(&out[..n]) else { panic!("no gains") };
    assert_eq!((n, values.len(), values.get(7), values.get(30)), (126, 30, Some(12.0), None));

    let joints = core::array::from_fn(|j| core::array::from_fn(|i| (100 * j + i) as f64));
    let links = core::array::from_fn(|j| core::array::from_fn(|i| (1000 + 100 * j + i) as f64));
    let n = arm_model(&mut out, &joints, &links).expect("good");
    let Ok(Command::ArmModel(values)) = parse(&out[..n]) else { panic!("no model") };
    assert_eq!(
        (n, values.get(41), values.get(42), values.get(132)),
        (538, Some(605.0), Some(1000.0), Some(1612.0))
    );

    let axis: [f32; 20] = core::array::from_fn(|i| i as f32);
    let torque = core::array::from_fn(|v| core::array::from_fn(|t| (100 * v + t) as f32));
    let tables = [FrictionTable { velocity: &axis, temperature: &axis, torque: &torque }; 6];
    let n = friction_table(&mut out, &tables).expect("good");
    let Ok(Command::FrictionTable(values)) = parse(&out[..n]) else { panic!("no table") };
    assert_eq!((n, values.len()), (10_566, 2640));
    assert_eq!(values.get(440 + 40 + 3 * 20 + 7), Some(307.0), "a row per velocity");
}

#[test]
fn scale_ends() {
    let zero = [0.0; 6];
    let top = RawPoint::from_si(&[POSITION_SCALE; 6], &[-VELOCITY_SCALE; 6], &[ACCELERATION_SCALE; 6]);
    let expected = RawPoint { position: [32767; 6], velocity: [-32767; 6], acceleration: [32767; 6] };
    assert_eq!(top, Ok(expected));
    assert_eq!(expected.position_rad(), [POSITION_SCALE; 6]);

    let mut velocity = zero;
    velocity[4] = -6.2832;
    let error = RawPoint::from_si(&zero, &velocity, &zero).expect_err("outside the scale");
    let expected = OutOfScale { joint: 4, channel: Channel::Velocity, value: -6.2832, limit: VELOCITY_SCALE };
    assert_eq!(error, expected);
    let text = "velocity of joint 4 is -6.2832 rad/s, but a frame carries only -6.283185..6.283185 rad/s";
    assert_eq!(error.to_string(), text);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    /// The encoder rounds a value to the nearest raw value, or refuses it. A value must never wrap around or be
    /// clipped.
    #[test]
    fn scaling_never_wraps_or_clips(value in any::<f64>(), near in -4.0..4.0, joint in 0..6usize) {
        for value in [value, near] {
            let mut position = [0.0; 6];
            position[joint] = value;
            match RawPoint::from_si(&position, &[0.0; 6], &[0.0; 6]) {
                Ok(raw) => {
                    let error = (raw.position_rad()[joint] - value).abs();
                    prop_assert!(error <= 0.500_001 * POSITION_SCALE / 32767.0, "{value}: {error}");
                }
                Err(e) => {
                    prop_assert!(value.is_nan() || value.abs() > POSITION_SCALE);
                    prop_assert_eq!((e.joint, e.channel), (joint, Channel::Position));
                }
            }
        }
    }

    #[test]
    fn raw_points_survive_the_way_through_si(raw in any::<[[i16; 6]; 3]>()) {
        let [position, velocity, acceleration] = raw.map(|v| v.map(|x| x.max(-32767)));
        let raw = RawPoint { position, velocity, acceleration };
        let again = RawPoint::from_si(&raw.position_rad(), &raw.velocity_rad_s(), &raw.acceleration_rad_s2());
        prop_assert_eq!(again, Ok(raw));
        prop_assert_eq!(RawPoint::parse(&raw.emit()), raw);
    }
}

fn status() -> Status {
    Status {
        response: Response::good(FrameType::Trajectory, DataStatus::IncorrectSegmentOrder, 18_014),
        state: ControllerState::Error.into(),
        errors: 0x0109,
        occurred: 0x0208,
        jtc_init: 0x07,
        node_init: 0x41,
        trajectory: TrajectoryState::Execute.into(),
        point: 0x0001_D4C0,
        friction_type: 1,
        can_error: 1,
        can_current: 0x4001,
        can_occurred: 0x4100,
        joints: core::array::from_fn(|j| {
            let n = 10 * j as u8;
            JointStatus {
                state: NodeState::new(n + 1),
                mc_current: n + 2,
                mc_occurred: n + 3,
                errors: n + 4,
                warnings: n + 5,
                internal: 0x1100 + u16::from(n),
                internal_occurred: 0x2200 + u16::from(n),
                position: 1.5 + j as f32,
                velocity: -0.25,
                torque: 42.0,
                temperature: n + 9,
            }
        }),
        gripper: Some(GripperStatus {
            state: NodeState::ENABLED,
            pump: 1,
            pressure1: 1,
            pressure2: 0,
            errors: 8,
            warnings: 1,
        }),
    }
}

/// E-01, E-02, E-05: the length of the status, the point index of four bytes, and joint 1 at byte 53.
#[test]
fn e01_e02_e05_status_layout() {
    let bytes = status().emit();
    assert_eq!(bytes[..10], [0x9B, 0x03, 0x00, 0xAF, 4, 1, 4, 0x46, 0x5E, 5]);
    assert_eq!(bytes[10..17], [0x01, 0x09, 0x02, 0x08, 0x07, 0x41, 3]);
    assert_eq!(bytes[17..23], [0x00, 0x01, 0xD4, 0xC0, 1, 1]);
    assert_eq!(bytes[23..31], [0, 0, 0x40, 0x01, 0, 0, 0x41, 0x00]);
    assert_eq!(bytes[31..40], [1, 2, 3, 4, 5, 0x11, 0x00, 0x22, 0x00]);
    assert_eq!(bytes[40..44], 1.5f32.to_be_bytes());
    assert_eq!(bytes[44..48], (-0.25f32).to_be_bytes());
    assert_eq!(bytes[48..53], [0x42, 0x28, 0, 0, 9]);
    assert_eq!(bytes[53], 11);
    assert_eq!(bytes[163..173], [3, 1, 1, 0, 8, 1, 0, 0, 0, 0]);
    assert_eq!(crc16(&bytes[..173]), crc_of(&bytes));
    assert_eq!(Status::parse(&bytes), Some(status()));
}

/// Returns one status in the three layouts.
fn layouts() -> [Vec<u8>; 3] {
    let full = status().emit();
    let sealed = |mut bytes: Vec<u8>| {
        let n = bytes.len() as u16 + 2;
        bytes[2..4].copy_from_slice(&n.to_be_bytes());
        let crc = crc16(&bytes);
        bytes.extend(crc.to_be_bytes());
        bytes
    };
    let short_index = sealed([&full[..17], &full[19..173]].concat());
    let no_gripper = sealed(full[..163].to_vec());
    [full.to_vec(), short_index, no_gripper]
}

#[test]
fn j08_layouts_of_other_builds() {
    let [full, short_index, no_gripper] = layouts();
    assert_eq!((full.len(), short_index.len(), no_gripper.len()), (STATUS_LEN, 173, 165));
    assert_eq!(Status::parse(&short_index), Some(Status { point: 0xD4C0, ..status() }));
    assert_eq!(Status::parse(&no_gripper), Some(Status { gripper: None, ..status() }));
    for n in 0..STATUS_LEN {
        assert_eq!(Status::parse(&full[..n]), None);
    }
}

/// J-04: a record with an unknown code must confirm nothing.
#[test]
fn j04_unknown_codes_confirm_nothing() {
    for (at, byte) in [(5, 6), (6, 9)] {
        let mut bytes = status().emit();
        bytes[at] = byte;
        let crc = crc16(&bytes[..173]).to_be_bytes();
        bytes[173..].copy_from_slice(&crc);
        assert_eq!(Status::parse(&bytes).expect("else good").response(), None);
    }
}

#[test]
fn j08_statuses_are_found_after_noise_and_lost_bytes() {
    let mut receiver = StatusReceiver::new();
    let mut received = 0;
    for lost in 0..STATUS_LEN {
        let [full, short_index, no_gripper] = layouts();
        let mut cut = full.clone();
        cut.remove(lost);
        let stream = [&[0x9B, 0x9B, 0x03][..], &cut, &full, &short_index, &no_gripper].concat();
        for mut piece in stream.chunks(lost % 40 + 1) {
            while let Some(s) = receiver.next(&mut piece) {
                assert_eq!(s.joints, status().joints);
                received += 1;
            }
        }
    }
    assert_eq!(received, 3 * STATUS_LEN);
    assert_eq!(receiver.counters().frames, received as u64);
    assert_eq!(receiver.counters().skipped_bytes, (STATUS_LEN * (3 + 174)) as u64);
    assert!(receiver.counters().bad_frames >= 171);
}

#[test]
fn every_frame_in_words() {
    let shows = |bytes: &[u8], text: &str| assert_eq!(Described(bytes).to_string(), text);
    shows(
        &fixed::clear_current_errors(true, 0x41),
        "ClearCurrentErrors: the controller's own, nodes: node 0 (joint 1), gripper",
    );
    shows(
        &fixed::empty(FrameType::FrictionPolynomial),
        "FrictionPolynomialUseDefault (sent as an empty FrictionPolynomial)",
    );
    shows(&fixed::PUMP_OFF, "GripperControl: pump off");
    shows(&fixed::reset_can_devices(0x02), "ResetCanDevices: node 1 (joint 2)");
    shows(&[0x9B, 0x0B, 0, 9], "TrajSetExecStatus with an invalid length field, 9; 4 bytes");
    shows(&[0x9B, 0x09, 2, 0x1A, 0, 0], "ArmModel: 6 bytes of 538");
    shows(&[0x00; 7], "7 bytes that begin with 00 instead of 9B");
    let mut out = [0; 200];
    let n = trajectory(&mut out, (0, 1, 24), 10, [RawPoint::default(); 3]).expect("it fits");
    shows(&out[..n], "Trajectory: trajectory 0, segment 1 of 24, 3 points, 10 ms apart");
    let text = Described(&status().emit()).to_string();
    assert!(text.starts_with(
        "JtcStatus: Error, trajectory Execute, point 120000; record: Trajectory of 18014 bytes: no error, data: \
         incorrect segment order; errors: emergency input, external error, bit 8; missing: friction, PID, arm model"
    ), "{text}");
    let details = format!("{:#}", status());
    assert_eq!(details.lines().count(), 11, "{details}");
    assert_eq!(Response { status: FrameStatus::Idle, ..Default::default() }.to_string(), "no record");
}
