//! Tests with bytes that are not a valid frame, command or status because of a single fault.
use jtc_wire::{
    ALL_NODES, Command, DataStatus, Floats, FrameRef, FrameStatus, FrameType, HEADER, LinkEvent, RawPoint,
    Response, Segment, Status, crc16, fixed,
};

/// Returns the bytes, followed by the CRC of these bytes.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    [bytes, &crc16(bytes).to_be_bytes()].concat()
}

#[test]
fn j05_a_frame_needs_its_header_type_length_and_crc_at_once() {
    let kind = FrameType::TeachingModeEnable as u8;
    assert!(FrameRef::new_checked(&sealed(&[HEADER, kind, 0, 6])).is_some());
    for (wrong, bytes) in [
        ("header", &[HEADER ^ 1, kind, 0, 6][..]),
        ("type", &[HEADER, 0x55, 0, 6]),
        ("length: fewer than there are", &[HEADER, kind, 0, 6, 0, 0]),
        ("length: more than there are", &[HEADER, FrameType::ClearCurrentErrors as u8, 0, 10]),
        ("length: not one of its type", &[HEADER, kind, 0, 8, 0, 0]),
    ] {
        assert_eq!(FrameRef::new_checked(&sealed(bytes)), None, "{wrong}");
    }
    for bit in 0..48 {
        let mut bytes = fixed::TEACHING_MODE_ENABLE;
        bytes[bit / 8] ^= 0x80 >> (bit % 8);
        assert_eq!(FrameRef::new_checked(&bytes), None, "bit {bit}");
    }
}

/// `Command::parse` must refuse a list of floats if its number of floats is not permitted for the frame type, even if
/// no receiver has checked the frame before.
#[test]
fn j07_floats_of_another_count_are_no_command() {
    let bytes = vec![0; 10_580];
    for kind in
        [FrameType::FrictionTable, FrameType::PidParam, FrameType::ArmModel, FrameType::FrictionPolynomial]
    {
        for n in (6..700).chain(10_500..10_580) {
            let parsed = Command::parse(FrameRef { frame_type: kind, bytes: &bytes[..n] });
            let expected = if kind.can_have(n) { Ok(kind) } else { Err(DataStatus::IncorrectValue) };
            let parsed_type = parsed.map(|command| match command {
                Command::FrictionPolynomialUseDefault => FrameType::FrictionPolynomial,
                command => command.frame_type(),
            });
            assert_eq!(parsed_type, expected, "{kind} of {n} bytes");
        }
    }
}

#[test]
fn j07_a_body_that_is_cut_off_is_no_command() {
    let bytes = [1; 16];
    let parse = |frame_type, n: usize| Command::parse(FrameRef { frame_type, bytes: &bytes[..6 + n] });
    for (kind, needed) in [
        (FrameType::ClearCurrentErrors, 2),
        (FrameType::TrajSetExecStatus, 1),
        (FrameType::ResetCanDevices, 1),
        (FrameType::GripperControl, 1),
        (FrameType::Trajectory, 8),
    ] {
        for n in 0..needed {
            let expected = match (kind, n) {
                // Some hosts send ClearCurrentErrors frames of this length.
                (FrameType::ClearCurrentErrors, 0) => {
                    Ok(Command::ClearCurrentErrors { jtc: true, nodes: ALL_NODES })
                }
                _ => Err(DataStatus::IncorrectValue),
            };
            assert_eq!(parse(kind, n), expected, "{kind} with {n} bytes");
        }
        assert!(parse(kind, needed).is_ok(), "{kind}");
    }
}

#[test]
fn j06_only_bit_0_of_the_first_mask_is_the_controller() {
    for mask in 0..=255 {
        let frame = sealed(&[HEADER, FrameType::ClearCurrentErrors as u8, 0, 10, mask, 0x41, 0, 0]);
        let parsed = Command::parse(FrameRef::new_checked(&frame).expect("a good frame"));
        assert_eq!(parsed, Ok(Command::ClearCurrentErrors { jtc: mask % 2 == 1, nodes: 0x41 }));
    }
}

#[test]
fn j05_every_event_says_how_it_arrived() {
    let good = FrameRef::new_checked(&fixed::STOP).expect("a good frame");
    assert_eq!(LinkEvent::Frame(good).status(), FrameStatus::NoError);
    for status in [FrameStatus::IncorrectHeader, FrameStatus::IncorrectCrc, FrameStatus::DiscontinuousFrame] {
        let record = Response::bad(0, status, 0);
        assert_eq!([LinkEvent::Bad(record).status(), LinkEvent::Noise(record).status()], [status; 2]);
    }
}

#[test]
fn j08_a_frame_of_another_type_is_no_status() {
    assert_eq!(Status::parse(&fixed::STOP), None);
    assert!(Status::parse(&Status::default().emit()).is_some());
}

/// In a status without a response, the response record contains 0, 0, 0, 0.
#[test]
fn j04_a_status_without_a_record_confirms_nothing() {
    let bytes = Status::default().emit();
    assert_eq!(bytes[4..9], [0; 5]);
    assert_eq!(Status::parse(&bytes).expect("a good status").response(), None);
}

#[test]
fn a_rest_of_a_float_is_none() {
    let bytes: Vec<u8> = [1.5f32, -2.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    for n in 0..=8 {
        let floats = Floats::new(&bytes[..n]);
        assert_eq!((floats.len(), floats.is_empty()), (n / 4, n < 4), "{n} bytes");
        assert_eq!(floats.iter().collect::<Vec<_>>(), [1.5, -2.0][..n / 4]);
        assert_eq!(floats.as_bytes(), &bytes[..n / 4 * 4]);
    }
}

/// An empty segment is an incorrect value (J-06), so the code must detect an empty segment.
#[test]
fn j06_points_of_a_segment() {
    let point = |i: i16| RawPoint { position: [i; 6], ..RawPoint::default() };
    let body = [&[0; 8][..], &point(1).emit(), &point(2).emit(), &[7; 35]].concat();
    let empty = Segment::parse(&body[..43]).expect("four numbers");
    assert_eq!((empty.len(), empty.is_empty(), empty.point(0)), (0, true, None));
    let two = Segment::parse(&body).expect("four numbers");
    assert_eq!((two.len(), two.is_empty(), two.point(1), two.point(2)), (2, false, Some(point(2)), None));
    for first in 0..4 {
        let expected = [point(1), point(2)];
        assert_eq!(two.points_from(first).collect::<Vec<_>>(), expected.get(first..).unwrap_or(&[]));
    }
    assert!(two.points().eq([point(1), point(2)]));
    assert_eq!(Segment::parse(&body[..7]), None);
}
