//! Tests of inputs that the encoders refuse, and of the names of the numbers in a frame.
use jtc_wire::{
    Command, EncodeError, FRAME_MAX, FloatName, Floats, FrameType, RawPoint, floats, pid_param, trajectory,
};

#[test]
fn only_frames_of_floats_are_made_of_floats() {
    let mut out = vec![0; FRAME_MAX];
    for frame_type in FrameType::ALL {
        let fits: &[usize] = match frame_type {
            FrameType::FrictionTable => &[6 * (20 + 20 + 400)],
            FrameType::PidParam => &[6 * 5],
            FrameType::ArmModel => &[7 * 6 + 7 * 13],
            FrameType::FrictionPolynomial => &[6 * 4, 6 * 6],
            FrameType::Jog => &[6],
            _ => &[],
        };
        for count in (0..150).chain(2639..2642) {
            let expected = match fits.contains(&count) {
                true => Ok(6 + 4 * count),
                false => Err(EncodeError::WrongCount { frame_type, count }),
            };
            assert_eq!(floats(&mut out, frame_type, vec![0.0; count]), expected);
        }
    }
    let bytes = [0; 4 * 29];
    let error = EncodeError::WrongCount { frame_type: FrameType::PidParam, count: 29 };
    assert_eq!(Command::PidParam(Floats::new(&bytes)).emit(&mut out), Err(error));
}

/// If the buffer is too short, the encoder reports a needed length. This length must be greater than the length of the
/// buffer, and not greater than the length of the complete frame. The needed length can be less than the complete
/// length, because the encoder stops before it has read all numbers.
#[test]
fn a_buffer_that_is_too_short_is_told_how_long_it_must_be() {
    type Encoder = fn(&mut [u8]) -> Result<usize, EncodeError>;
    let pid: Encoder = |out| pid_param(out, &[[1.0; 5]; 6]);
    let points: Encoder = |out| trajectory(out, (0, 0, 1), 10, [RawPoint::default(); 3]);
    for (encode, length) in [(pid, 126), (points, 122)] {
        for given in 0..length {
            let Err(EncodeError::BufferTooShort { needed, given: seen }) = encode(&mut vec![0; given]) else {
                panic!("{given} bytes are enough for {length}");
            };
            assert_eq!(seen, given);
            assert!(given < needed && needed <= length, "{needed} of {length} with {given}");
        }
        assert_eq!(encode(&mut vec![0; length]), Ok(length));
    }
}

/// The names must be in the order of the wire format (see the table of frames).
#[test]
fn j06_every_number_has_its_name() {
    let names = |kind, count| (0..count).map(move |i| FloatName(kind, i).to_string());

    let mut expected = Vec::new();
    for joint in 1..=6 {
        expected
            .extend(["Kp", "Ki", "Kd", "IntMin", "IntMax"].map(|g| format!("PidParam joint {joint} {g}")));
    }
    assert!(names(FrameType::PidParam, 30).eq(expected));

    let origin = ["x", "y", "z", "roll", "pitch", "yaw"];
    let inertia = ["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
    let mut expected = Vec::new();
    for joint in ["joint 1", "joint 2", "joint 3", "joint 4", "joint 5", "joint 6", "flange"] {
        expected.extend(origin.map(|number| format!("ArmModel {joint} {number}")));
    }
    for link in 0..7 {
        expected.extend(origin.map(|number| format!("ArmModel link {link} {number}")));
        expected.extend(inertia.map(|number| format!("ArmModel link {link} {number}")));
        expected.push(format!("ArmModel link {link} mass"));
    }
    assert!(names(FrameType::ArmModel, 133).eq(expected));

    let mut expected = Vec::new();
    for joint in 1..=6 {
        expected.extend((0..20).map(|v| format!("FrictionTable joint {joint} velocity {v}")));
        expected.extend((0..20).map(|t| format!("FrictionTable joint {joint} temperature {t}")));
        for v in 0..20 {
            expected.extend((0..20).map(|t| format!("FrictionTable joint {joint} torque [{v}][{t}]")));
        }
    }
    assert!(names(FrameType::FrictionTable, 2640).eq(expected));
    assert_eq!(FloatName(FrameType::FrictionPolynomial, 7).to_string(), "FrictionPolynomial number 7");
}

#[test]
fn errors_name_what_was_asked_and_the_limit() {
    let shows = |error: EncodeError, text: &str| assert_eq!(error.to_string(), text);
    shows(
        EncodeError::BufferTooShort { needed: 126, given: 10 },
        "the frame has 126 bytes, but the buffer has 10",
    );
    shows(
        EncodeError::TooManyPoints { points: 1667, limit: 1666 },
        "1667 points, expected at most 1666 in a frame",
    );
    let error = EncodeError::WrongCount { frame_type: FrameType::PidParam, count: 29 };
    shows(error, "wrong count of numbers for a PidParam frame: 29");
}
