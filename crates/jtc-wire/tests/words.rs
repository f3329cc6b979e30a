//! Tests of the texts of frames, states and codes.
use jtc_bus::NodeState;
use jtc_wire::words::{self, Bits};
use jtc_wire::{
    Code, Command, ControllerState, Described, FRAME_MAX, Floats, FrameRef, FrameStatus, FrameType,
    FrictionTable, GripperStatus, JointStatus, Known, Piece, RawPoint, Response, Status, TrajectoryState,
    arm_model, can_flag, error, fixed, friction_polynomial, friction_table, joint_error, missing_parameter,
    pieces, trajectory,
};

#[test]
fn states_have_their_names_and_other_codes_have_none() {
    let controller = ["Start", "Init", "HoldPos", "Operate", "Teaching", "Error"];
    let trajectory = ["Null", "Stop", "Pause", "Execute", "Finish", "TransNullToStop"];
    let node = |code| match code {
        0 => "Start",
        1 => "Init",
        2 => "ReadyToOperate",
        3 => "OperationEnable",
        10..=16 => "in transition",
        254 => "fault reaction",
        255 => "Fault",
        _ => "unknown state",
    };
    for byte in 0..=255u8 {
        let at = usize::from(byte);
        let (state, execution) = (Code::<ControllerState>::new(byte), Code::<TrajectoryState>::new(byte));
        assert_eq!(state.to_string(), controller.get(at).copied().unwrap_or("unknown state"));
        assert_eq!(execution.to_string(), trajectory.get(at).copied().unwrap_or("unknown"));
        assert_eq!((state.byte(), execution.byte()), (byte, byte), "what is not known is kept");
        assert_eq!(state.known().map(Known::code), (at < controller.len()).then_some(byte));
        assert_eq!(words::friction_type(byte), ["polynomial", "table"].get(at).copied().unwrap_or("unknown"));
        assert_eq!(NodeState::new(byte).name(), node(byte), "{byte}");
    }
    let held = Code::from(ControllerState::HoldPos);
    assert!(held == ControllerState::HoldPos && held != ControllerState::Init);
    assert!(
        held.is_in(&[ControllerState::Error, ControllerState::HoldPos])
            && !held.is_in(&[ControllerState::Error])
    );
    assert_eq!(Code::default(), Code::from(TrajectoryState::Null));
    let [known, unknown] = [2, 9].map(Code::<TrajectoryState>::new);
    assert_eq!(format!("{known:?} {unknown:?}"), "Pause 9");
}

#[test]
fn bits_in_words() {
    let names = ["a", "", "c"];
    assert_eq!(Bits(0, &names).to_string(), "-");
    assert_eq!(Bits(0x8000_0007, &names).to_string(), "a, bit 1, c, bit 31");
    assert_eq!(Bits(4, &names).to_string(), "c");
    assert!(Bits(0b1010, &names).iter().eq([(1, ""), (3, "")]));
}

/// A table in the code contains the masks and the texts of a word. This table must agree with the table of the
/// protocol.
#[test]
fn masks_have_the_texts_of_their_bits() {
    let errors = error::EMERGENCY_INPUT | error::EXTERNAL | error::EXTERNAL_JOINTS;
    assert_eq!(errors, 0x89);
    let text = Bits(errors.into(), &words::JTC_ERRORS).to_string();
    assert_eq!(text, "emergency input, external error, external joints error");
    assert_eq!(joint_error::FRICTION_TABLE, 0x20);
    let text = Bits(joint_error::FRICTION_TABLE.into(), &words::JOINT_INTERNAL).to_string();
    assert_eq!(text, "friction table value missing");
    assert_eq!(missing_parameter::FRICTION | missing_parameter::MODEL, 5);
    assert_eq!(Bits(5, &words::JTC_INIT).to_string(), "friction, arm model");
    let flags = can_flag::TRANSMIT_TIMEOUT | can_flag::no_answer(0) | can_flag::no_answer(6);
    assert_eq!(flags, 0x4101);
    let text = Bits(flags, &words::CAN_FLAGS).to_string();
    assert_eq!(text, "transmit timeout, no answer from node 0 (joint 1), no answer from the gripper");
    assert_eq!(Bits(0x08, &words::NODE_WARNINGS).to_string(), "safety line active");
}

#[test]
fn records_in_words() {
    let shows = |response: Response, text: &str| assert_eq!(response.to_string(), text);
    shows(Response::bad(0x55, FrameStatus::IncorrectFrameType, 0), "type 0x55: incorrect frame type");
    shows(Response::bad(0x04, FrameStatus::IncorrectCrc, 50), "Trajectory of 50 bytes: incorrect CRC");
    let good = Response::good(FrameType::TeachingModeEnable, jtc_wire::DataStatus::NotAllowed, 6);
    shows(good, "TeachingModeEnable of 6 bytes: no error, data: not allowed in this state");
}

#[test]
fn what_is_no_frame_in_words() {
    let shows = |bytes: &[u8], text: &str| assert_eq!(Described(bytes).to_string(), text);
    shows(&[0x9B, 0x0C, 0], "3 bytes, too few for a frame");
    shows(&[0x9B, 0x55, 0, 6, 1, 2], "frame of unknown type 55, 6 bytes");
    shows(&[0x9B, 0x0C, 0, 5], "TeachingModeEnable with an invalid length field, 5; 4 bytes");
    shows(&[0x9B, 0x0C, 0, 6], "TeachingModeEnable: 4 bytes of 6");
    shows(&[0x9B, 0x0C, 0, 6, 0xCD], "TeachingModeEnable: 5 bytes of 6");
    shows(&[0x9B, 0x0C, 0, 6, 0, 1], "TeachingModeEnable of 6 bytes: CRC is 0001, should be CD27");
    shows(&[0x9B, 0x0C, 0, 6, 0xCD, 0x27, 0], "TeachingModeEnable: 7 bytes of 6");
    shows(&fixed::TEACHING_MODE_ENABLE, "TeachingModeEnable");
    shows(&fixed::PUMP_ON, "GripperControl: pump on");
    shows(&fixed::STOP, "TrajSetExecStatus: stop");
    shows(&fixed::PAUSE, "TrajSetExecStatus: pause");
    shows(&fixed::EXECUTE, "TrajSetExecStatus: execute");
    shows(&fixed::clear_current_errors(false, 0), "ClearCurrentErrors: nodes: -");
}

#[test]
fn every_number_of_a_segment() {
    let point = RawPoint {
        position: [32767, 0, 0, 0, 0, -32767],
        velocity: [32767, 0, 0, 0, 0, -32767],
        acceleration: [32767, 0, 0, 0, 0, -32767],
    };
    let mut out = [0; 200];
    let n = trajectory(&mut out, (7, 0, 2), 20, [RawPoint::default(), point]).expect("it fits");
    let frame = FrameRef::new_checked(&out[..n]).expect("a good frame");
    let zeros = "0.0000 0.0000 0.0000 0.0000";
    let text = format!(
        "Trajectory: trajectory 7, segment 0 of 2, 2 points, 20 ms apart\n     \
         0 rad 0.0000 {zeros} 0.0000 rad/s 0.0000 {zeros} 0.0000 rad/s² 0.0000 {zeros} 0.0000\n     \
         1 rad 3.1416 {zeros} -3.1416 rad/s 6.2832 {zeros} -6.2832 rad/s² 12.5664 {zeros} -12.5664"
    );
    assert_eq!(format!("{frame:#}"), text);
}

#[test]
fn every_number_of_the_parameters() {
    let mut out = vec![0; FRAME_MAX];
    let words = |bytes: &[u8]| {
        let frame = FrameRef::new_checked(bytes).expect("a good frame");
        (format!("{frame}"), format!("{frame:#}"))
    };
    let joints: [[f64; 6]; 7] = core::array::from_fn(|j| core::array::from_fn(|i| (10 * j + i) as f64));
    let links: [[f64; 13]; 7] = core::array::from_fn(|j| core::array::from_fn(|i| (100 * j + i) as f64));
    let n = arm_model(&mut out, &joints, &links).expect("good");
    let (short, long) = words(&out[..n]);
    assert_eq!(short, "ArmModel: 133 numbers");
    let lines: Vec<&str> = long.lines().collect();
    assert_eq!((lines.len(), lines[0]), (134, "ArmModel"));
    assert_eq!(
        (lines[1 + 9], lines[1 + 42 + 13 + 12]),
        ("  ArmModel joint 2 roll = 13", "  ArmModel link 1 mass = 112")
    );

    let velocity: [f32; 20] = core::array::from_fn(|i| i as f32);
    let temperature: [f32; 20] = core::array::from_fn(|i| 10.0 + i as f32);
    let torque = [[0.5; 20]; 20];
    let table = FrictionTable { velocity: &velocity, temperature: &temperature, torque: &torque };
    let n = friction_table(&mut out, &[table; 6]).expect("good");
    let (short, long) = words(&out[..n]);
    assert_eq!(short, "FrictionTable: joint 1 0..19 rad/s, 10..29 °C");
    assert_eq!(long.lines().count(), 2641);
    assert!(long.starts_with(&format!("{short}\n  FrictionTable joint 1 velocity 0 = 0\n")), "{long}");
}

#[test]
fn j06_coefficients_are_called_by_their_index() {
    fn check<const N: usize>() {
        let mut out = [0; 150];
        let coefficients: [[f64; N]; 6] =
            core::array::from_fn(|j| core::array::from_fn(|i| (10 * j + i) as f64));
        let n = friction_polynomial(&mut out, &coefficients).expect("good");
        let frame = FrameRef::new_checked(&out[..n]).expect("a good frame");
        let short = format!("FrictionPolynomial: {N} coefficients a joint");
        assert_eq!(format!("{frame}"), short);
        let mut long = short;
        for (j, joint) in coefficients.iter().enumerate() {
            for (i, value) in joint.iter().enumerate().rev() {
                long += &format!("\n  joint {} c{i} = {value}", j + 1);
            }
        }
        assert_eq!(format!("{frame:#}"), long);
    }
    check::<4>();
    check::<6>();
}

/// A received FrictionPolynomial frame never contains too few numbers, but code can construct such a command. Its
/// text must then show 0 coefficients.
#[test]
fn j07_a_polynomial_of_too_few_numbers_can_be_said() {
    let command = Command::FrictionPolynomial(Floats::new(&[0; 20]));
    assert_eq!(format!("{command:#}"), "FrictionPolynomial: 0 coefficients a joint");
}

#[test]
fn a_status_says_only_what_there_is() {
    let status = Status::default();
    assert_eq!(status.to_string(), "JtcStatus: Start, trajectory Null, point 0");
    let mut text = String::from(
        "JtcStatus: Start, trajectory Null, point 0\n  occurred: -\n  friction: polynomial\n  CAN occurred: -",
    );
    for joint in 1..=6 {
        text += &format!("\n  joint {joint}: Start, 0.000000 rad, 0.000000 rad/s, 0.000 N·m, 0 °C");
    }
    assert_eq!(format!("{status:#}"), text);
    let gripper = "\n  gripper: Start, pump off, pressure 1 not reached, pressure 2 not reached";
    let status = Status { gripper: Some(GripperStatus::default()), ..status };
    assert_eq!(format!("{status:#}"), text + gripper);
}

#[test]
fn a_node_says_all_that_is_wrong_with_it() {
    let joint = JointStatus {
        state: NodeState::FAULT,
        mc_current: 0x02,
        mc_occurred: 0x06,
        errors: 0x04,
        warnings: 0x08,
        internal: 0x08,
        internal_occurred: 0x18,
        position: -1.25,
        velocity: 0.5,
        torque: 42.0,
        temperature: 31,
    };
    assert_eq!(
        joint.to_string(),
        "Fault, -1.250000 rad, 0.500000 rad/s, 42.000 N·m, 31 °C; found by the controller: torque over limit; \
         occurred: torque over limit, position error over limit; motor control: over-voltage; \
         motor control occurred: over-voltage, under-voltage; errors: over-speed; warnings: safety line active"
    );
    let gripper = GripperStatus {
        state: NodeState::ENABLED,
        pump: 1,
        pressure1: 1,
        pressure2: 0,
        errors: 1,
        warnings: 2,
    };
    assert_eq!(
        gripper.to_string(),
        "OperationEnable, pump on, pressure 1 reached, pressure 2 not reached; errors: position encoder; \
         warnings: outside working area"
    );
}

/// Concatenated in order, the pieces must give the whole capture. Each valid frame must be one piece, and so must the bytes between
/// two frames.
#[test]
fn a_capture_in_pieces() {
    let status = Status::default().emit();
    let mut broken = fixed::STOP;
    broken[6] ^= 1;
    let parts: [&[u8]; 7] = [
        &[0x00, 0x9B, 0x9B],
        &fixed::STOP,
        &fixed::PUMP_ON,
        &broken,
        &status,
        &fixed::PAUSE,
        &fixed::EXECUTE[..6],
    ];
    let capture = parts.concat();
    let good = |bytes| Piece::Frame(FrameRef::new_checked(bytes).expect("a good frame"));
    let expected = [
        Piece::Other(parts[0]),
        good(parts[1]),
        good(parts[2]),
        Piece::Other(parts[3]),
        good(parts[4]),
        good(parts[5]),
        Piece::Other(parts[6]),
    ];
    assert_eq!(pieces(&capture).collect::<Vec<_>>(), expected);
    assert_eq!(pieces(&fixed::STOP).count(), 1);
    assert_eq!(pieces(&[]).next(), None);
}

/// J-31: the states in which the controller holds the arm, and the state in which the arm moves. The expected bytes
/// are the bytes in the manual.
#[test]
fn a_status_knows_whether_the_controller_comes_up_or_executes() {
    let of = |state: u8, trajectory: u8| Status {
        state: Code::new(state),
        trajectory: Code::new(trajectory),
        ..Status::default()
    };
    let coming_up: Vec<u8> = (0..=8).filter(|state| of(*state, 0).is_coming_up()).collect();
    assert_eq!(coming_up, [0, 1]);
    let executing: Vec<u8> = (0..=8).filter(|trajectory| of(5, *trajectory).is_executing()).collect();
    assert_eq!(executing, [3]);
}

#[test]
fn positions_of_a_status_are_those_of_its_joints() {
    let mut status = Status::default();
    for (joint, position) in status.joints.iter_mut().zip([0.5, -1.0, 1.5, -2.0, 2.5, -3.0]) {
        joint.position = position;
    }
    assert_eq!(status.positions(), [0.5, -1.0, 1.5, -2.0, 2.5, -3.0]);
}
