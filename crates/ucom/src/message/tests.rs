use proptest::prelude::*;

use super::*;
use crate::admin::Admin;
use crate::buffer::BufferPackage;
use crate::error_code::ErrorCode;
use crate::function::Sequence;
use crate::profile::Endian;
use crate::report::Report;

fn frame(text: &str) -> Frame {
    text.parse().unwrap()
}

fn to(text: &str) -> Result<ToBoard, DecodeError> {
    ToBoard::decode(&frame(text), &Profile::default()).map(|(_, message)| message)
}

fn from(text: &str) -> Result<FromBoard, DecodeError> {
    FromBoard::decode(&frame(text), &Profile::default()).map(|(_, message)| message)
}

/// C-6: a receiver ignores surplus bytes of a message. A receiver refuses a message with missing bytes as too short.
#[test]
fn d12_c6_lengths() {
    assert_eq!(to("201#0000000000000000"), Ok(ToBoard::Info));
    assert_eq!(to("1C1#0202AA"), Ok(ToBoard::SetStatus { mask: 2, value: 2 }));
    let short = |function, len, need| Err(DecodeError::TooShort { function, len, need });
    assert_eq!(to("1C1#02"), short(Function::SetStatus, 1, 2));
    assert_eq!(to("601#010000"), short(Function::Admin, 3, 4));
    assert_eq!(to("2C1#00112233445566"), short(Function::Prog, 7, 8));
    assert_eq!(to("341#0000"), short(Function::Ci, 2, 4));
    assert_eq!(to("341#0000010002"), Err(DecodeError::Length { function: Function::Ci, len: 5 }));
    assert_eq!(
        from("081#").map(|_| ()),
        Err(DecodeError::TooShort { function: Function::Error, len: 0, need: 1 })
    );
    for (text, function) in [("141#", Function::DspInfo), ("641#", Function::Debug)] {
        assert_eq!(from(text), Err(DecodeError::TooShort { function, len: 0, need: 1 }));
    }
    assert_eq!(from("0C1#0155"), Ok(FromBoard::InitAck(1)));
    assert!(short(Function::Prog, 7, 8).unwrap_err().is_length());
    let strict = Profile { dlc_strict: true, ..Profile::default() };
    assert!(ToBoard::decode(&frame("201#00"), &strict).is_err());
    assert!(ToBoard::decode(&frame("201#"), &strict).is_ok());
    assert!(ToBoard::decode(&frame("341#00000100"), &strict).is_ok());
}

/// D-05: the PC and the boards send functions 22, 24 and 26 with the same identifier. The receiver decodes the same
/// frame as a message of the PC or of a board, depending on the sender. For function 22, the length also tells the
/// two messages apart.
#[test]
fn d05_shared_functions() {
    assert_eq!(to("581#"), Ok(ToBoard::DumpIo));
    assert_eq!(to("581#00"), Err(DecodeError::Direction(Function::DumpIo)));
    assert_eq!(from("581#"), Err(DecodeError::Direction(Function::DumpIo)));
    assert!(matches!(from("581#020004000300"), Ok(FromBoard::IoDescription(_))));
    assert_eq!(to("601#01000000"), Ok(ToBoard::Admin(Admin { run: true, ..Admin::default() })));
    assert_eq!(from("601#01000000"), Ok(FromBoard::Admin(Admin { run: true, ..Admin::default() })));
    assert_eq!(to("680#"), Ok(ToBoard::Alive));
    assert_eq!(from("681#"), Ok(FromBoard::Alive));
}

/// D-04: the PC decodes only functions that boards send, and a board decodes only functions that the PC sends.
#[test]
fn d04_direction() {
    for function in Function::ALL {
        // Eight zero bytes are a valid payload of every message except the PC's request of function 22, which has no data.
        let len = if function == Function::DumpIo { 0 } else { 8 };
        let frame = Frame::new(function.id(Sequence::MAX), &[0; 8][..len]).unwrap();
        let profile = Profile::default();
        assert_eq!(ToBoard::decode(&frame, &profile).is_ok(), function.from_pc(), "{function}");
        let frame = Frame::new(function.id(Sequence::MAX), &[0; 8]).unwrap();
        assert_eq!(FromBoard::decode(&frame, &profile).is_ok(), function.from_board(), "{function}");
    }
}

#[test]
fn d37_flags_other_than_0_and_1() {
    assert_eq!(to("601#02000000"), Err(DecodeError::Value(Function::Admin)));
}

/// D-15, D-24: the example frames of the protocol page decode to the expected messages.
#[test]
fn d15_d24_golden_frames() {
    let profile = Profile::default();
    let one = Sequence::new(1).unwrap();
    let pc = [
        (ToBoard::Reset, Sequence::ZERO, "000#"),
        (ToBoard::Init, one, "281#"),
        (ToBoard::Info, one, "201#"),
        (ToBoard::SetStatus { mask: 2, value: 2 }, one, "1C1#0202"),
        (ToBoard::XReset, one, "041#"),
        (ToBoard::Alive, Sequence::ZERO, "680#"),
        (ToBoard::Start, one, "301#"),
        (ToBoard::McaStart, one, "541#"),
        (ToBoard::DumpIo, one, "581#"),
        (ToBoard::DumpCi, one, "5C1#"),
        (
            ToBoard::Par(BufferPackage { offset: 0, count: 3, words: [120, 5, 1] }),
            one,
            "3C1#0000780005000100",
        ),
        (
            ToBoard::Ci(BufferPackage { offset: 0, count: 2, words: [1500, 0xFFEC, 0] }),
            one,
            "341#0000DC05ECFF0000",
        ),
        (ToBoard::Admin(Admin { run: true, active: true, ..Admin::default() }), one, "601#01010000"),
        (ToBoard::Prog(*b"\x0B\x30\x55\x7A\x9F\xC4\xE9\x0E"), one, "2C1#0B30557A9FC4E90E"),
    ];
    for (message, to, text) in pc {
        assert_eq!(message.encode(to, &profile), frame(text));
    }
    let board = [
        (FromBoard::InitAck(1), "0C1#01"),
        (FromBoard::Ready, "181#"),
        (FromBoard::ProgFinished, "101#"),
        (FromBoard::McaReady, "501#"),
        (FromBoard::Alive, "681#"),
        (FromBoard::Error(ErrorCode::AutostartForbidden), "081#0B"),
        (FromBoard::Report(Report::flash7(0x0042)), "482#42"),
        (
            FromBoard::So(BufferPackage { offset: 0, count: 3, words: [100, 101, 102] }),
            "381#0000640065006600",
        ),
        (FromBoard::So(BufferPackage { offset: 3, count: 1, words: [103, 0, 0] }), "381#0300670000000000"),
        (FromBoard::Ci(BufferPackage { offset: 0, count: 2, words: [0, 0, 0] }), "6C1#0000000000000000"),
    ];
    for (message, text) in board {
        assert_eq!(message.encode(one, &profile), frame(text));
    }
}

#[test]
fn errors_in_words() {
    let function = Function::SetStatus;
    for (error, text) in [
        (DecodeError::Foreign(crate::foreign::Foreign::Remote), "remote frame"),
        (DecodeError::Direction(function), "PC_SETSTATUS is not sent in this direction"),
        (
            DecodeError::TooShort { function, len: 1, need: 2 },
            "PC_SETSTATUS has 1 bytes, expected at least 2",
        ),
        (DecodeError::Length { function, len: 3 }, "PC_SETSTATUS cannot have 3 bytes"),
        (DecodeError::Value(function), "PC_SETSTATUS has a flag that is neither 0 nor 1"),
    ] {
        assert_eq!(std::format!("{error}"), text);
    }
}

fn packages() -> impl Strategy<Value = BufferPackage> {
    (any::<u16>(), any::<[u16; 3]>()).prop_map(|(offset, words)| BufferPackage { offset, count: 3, words })
}

fn admins() -> impl Strategy<Value = Admin> {
    any::<[bool; 4]>().prop_map(|[run, active, debug, global_debug]| Admin {
        run,
        active,
        debug,
        global_debug,
    })
}

fn pc_messages() -> impl Strategy<Value = ToBoard> {
    prop_oneof![
        prop::sample::select(std::vec![
            ToBoard::Reset,
            ToBoard::XReset,
            ToBoard::Info,
            ToBoard::Report,
            ToBoard::Init,
            ToBoard::Start,
            ToBoard::McaStart,
            ToBoard::DumpIo,
            ToBoard::DumpCi,
            ToBoard::Alive,
        ]),
        (any::<u8>(), any::<u8>()).prop_map(|(mask, value)| ToBoard::SetStatus { mask, value }),
        any::<[u8; 8]>().prop_map(ToBoard::Prog),
        packages().prop_map(ToBoard::Ci),
        packages().prop_map(ToBoard::Par),
        admins().prop_map(ToBoard::Admin),
    ]
}

fn board_messages() -> impl Strategy<Value = FromBoard> {
    let payloads =
        || prop::collection::vec(any::<u8>(), 1..=8).prop_map(|bytes| Payload::new(&bytes).unwrap());
    prop_oneof![
        any::<u8>().prop_map(|code| FromBoard::Error(ErrorCode::from_number(code))),
        any::<u8>().prop_map(FromBoard::InitAck),
        prop::sample::select(std::vec![
            FromBoard::ProgFinished,
            FromBoard::Ready,
            FromBoard::McaReady,
            FromBoard::Alive
        ]),
        payloads().prop_map(FromBoard::Info),
        payloads().prop_map(FromBoard::IoDescription),
        payloads().prop_map(FromBoard::Debug),
        packages().prop_map(FromBoard::So),
        packages().prop_map(FromBoard::Ci),
        admins().prop_map(FromBoard::Admin),
        (0..4u8, 0..32u8, any::<u8>()).prop_map(|(k, id, ucom_id)| {
            FromBoard::Report(Report { k, id_field: Sequence::new(id).unwrap(), ucom_id })
        }),
    ]
}

fn profiles() -> impl Strategy<Value = Profile> {
    any::<[bool; 3]>().prop_map(|[big, short, strict]| Profile {
        endian: if big { Endian::Big } else { Endian::Little },
        pd_short_last: short,
        dlc_strict: strict,
        ..Profile::default()
    })
}

proptest! {
    /// D-12: in every profile, encoding and then decoding a message returns the original message.
    #[test]
    fn d12_round_trip(pc in pc_messages(), board in board_messages(), number in 0..32u8, profile in profiles()) {
        let number = Sequence::new(number).unwrap();
        let frame = pc.encode(number, &profile);
        prop_assert_eq!(ToBoard::decode(&frame, &profile), Ok((number, pc)));
        let frame = board.encode(number, &profile);
        let seen = if let FromBoard::Report(report) = board { report.id_field } else { number };
        prop_assert_eq!(FromBoard::decode(&frame, &profile), Ok((seen, board)));
    }

    /// D-12: decoding any frame returns a message or an error and never panics. A decoded message is encoded with the
    /// function of its frame.
    #[test]
    fn d12_any_frame(id in 0..0x800u16, data in prop::collection::vec(any::<u8>(), 0..=8), profile in profiles()) {
        let frame = Frame::new(id, &data).unwrap();
        if let Ok((to, message)) = ToBoard::decode(&frame, &profile) {
            prop_assert_eq!(message.encode(to, &profile).id(), id);
        }
        if let Ok((from, message)) = FromBoard::decode(&frame, &profile) {
            prop_assert_eq!(message.encode(from, &profile).id(), id);
        }
    }
}
