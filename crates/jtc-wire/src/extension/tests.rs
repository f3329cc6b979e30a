use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

use super::*;
use crate::layout::{INFO_LEN, SET_VALUES_MAX};
use crate::{Command, fixed, set_settings};

fn info() -> Info {
    Info {
        missing: 3,
        nodes_missing: 0x41,
        boot_cause: BootCause::Watchdog,
        boots: 77,
        uptime_ms: 0x0102_0304_0506,
        lost_records: 9,
        hash: 0x0123_4567_89AB_CDEF,
        capabilities: capability::SETTINGS | capability::STORE,
        defaults_stored: true,
        store: StoreState::Stored,
        sequence: 5,
        arm: Name::new("avena").unwrap(),
        board: Name::new("nucleo-h745zi-q").unwrap(),
        ..Info::default()
    }
    .with_firmware("0.1.0", "4334c10b6b9b1d2d")
}

#[test]
fn j52_an_info_comes_back_as_it_was_sent() {
    let mut out = [0; ANSWER_MAX];
    let n = Answer::Info(info()).emit(&mut out).unwrap();
    let frame = FrameRef::new_checked(&out[..n]).unwrap();
    assert_eq!(Answer::parse(frame), Some(Answer::Info(info())));
    assert_eq!((info().firmware(), info().revision()), ("0.1.0", "4334c10b6b9b1d2d"));
    // The parser ignores bytes that a later version of the extensions adds. A body that is too short is not valid.
    let body = [&info().emit()[..], &[1, 2, 3]].concat();
    assert_eq!(Info::parse(&body), Some(info()));
    assert_eq!(Info::parse(&body[..INFO_LEN - 1]), None);
}

#[test]
fn j67_an_info_of_before_has_no_program() {
    let program = Program { bytes: 0x0004_4328, crc32: 0x89AB_CDEF };
    let info = Info { program: Some(program), ..info() };
    let body = info.emit();
    assert_eq!(body[136..144], [0, 4, 0x43, 0x28, 0x89, 0xAB, 0xCD, 0xEF]);
    assert_eq!(Info::parse(&body), Some(info));
    let before = Info { program: None, ..info };
    assert_eq!(Info::parse(&before.emit()), Some(before));
    // An older device sends a body of 136 bytes. If the body ends within the newer bytes, the parsed Info does not contain a program.
    for end in INFO_LEN..144 {
        assert_eq!(Info::parse(&body[..end]), Some(before), "{end}");
    }
    let shown = std::format!("{info:#}");
    assert!(shown.contains("program in flash: 279336 bytes, CRC-32 89abcdef"), "{shown}");
}

#[test]
fn j69_an_info_has_the_cause_of_a_held_stop_where_the_device_reports_it() {
    let cause = StopCause { kind: StopKind::Push, joint: 2, value: -61.5, limit: 54.0 };
    let reactions =
        Reactions { stop: Some((cause, 1_250)), yields: 2, jumped: 8, rate: 0.5, held_back_ms: 70 };
    let told = Info { capabilities: capability::STOP_CAUSE, reactions: Some(reactions), ..info() };
    let body = told.emit();
    let bytes =
        [2, 2, 2, 8, 0xC2, 0x76, 0, 0, 0x42, 0x58, 0, 0, 0, 0, 0x04, 0xE2, 0x3F, 0, 0, 0, 0, 0, 0, 0x46];
    assert_eq!(body[144..], bytes);
    assert_eq!(Info::parse(&body), Some(told));
    let shown = std::format!("{told:#}");
    assert!(
        shown.contains("last held stop 1.2 s ago: joint 2 was pushed: the controller held 61.5 N·m"),
        "{shown}"
    );
    // The first device does not report the reactions. The second device stopped for a cause that this version does not know.
    for end in INFO_LEN..INFO_WRITTEN {
        assert_eq!(Info::parse(&body[..end]).unwrap().reactions, None, "{end}");
    }
    assert_eq!(Info::parse(&info().emit()), Some(info()));
    let mut later = body;
    later[144] = 200;
    assert_eq!(Info::parse(&later).unwrap().reactions, Some(Reactions { stop: None, ..reactions }));
}

/// The text of every cause must contain the number of the joint, except for the kind Approach. The text must also
/// contain the unit of the value, except for the kind Unstable.
#[test]
fn j69_every_cause_has_its_words() {
    for kind in StopKind::ALL {
        let text = std::format!("{}", StopCause { kind, joint: 4, value: 1.25, limit: 0.5 });
        assert!(text.contains("joint 4") || kind == StopKind::Approach, "{text}");
        assert!(kind.unit().is_empty() || kind == StopKind::Unstable || text.contains(kind.unit()), "{text}");
        assert_eq!(StopKind::from_byte(kind as u8), Some(kind));
    }
    assert_eq!(StopKind::from_byte(0), None);
}

#[test]
fn j52_a_firmware_without_a_revision_is_shown_without_brackets() {
    for (revision, shown) in [("4334c10", "0.1.0 (4334c10)"), ("", "0.1.0")] {
        let info = info().with_firmware("0.1.0", revision);
        assert_eq!(std::format!("{}", info.firmware_and_revision()), shown);
        assert!(std::format!("{info}").contains(&std::format!("firmware {shown} on ")), "{info}");
    }
}

#[test]
fn j54_names_are_text_that_fits() {
    assert_eq!(Name::new("Arm 7, Ünit").unwrap().as_str(), "Arm 7, Ünit");
    assert_eq!(Name::new("a\nb"), None);
    assert_eq!(Name::new(&"x".repeat(33)), None);
    assert_eq!(Name::new(&"x".repeat(32)).unwrap().as_str().len(), 32);
    assert_eq!(Name::cut(&"ü".repeat(40)).as_str(), "ü".repeat(16));
    assert_eq!(Name::cut("a\tb").as_str(), "ab");
    let mut bytes = *Name::new("ab").unwrap().as_bytes();
    bytes[5] = b'x';
    assert_eq!(Name::parse(&bytes), None, "something behind the end");
    assert_eq!(Name::parse(&[0xFF; 32]), None);
    assert_eq!(Name::parse(&[b'a'; 31]), None);
}

#[test]
fn j53_values_travel_whole() {
    let values: Vec<_> = (0..SET_VALUES_MAX)
        .map(|i| SettingValue { setting: i as u8, joint: (i % 7) as u8, value: 1.0 / (i + 1) as f64 })
        .collect();
    let mut out = vec![0; 6 + VALUE_LEN * SET_VALUES_MAX];
    for count in [1, 2, 24, SET_VALUES_MAX] {
        let n = set_settings(&mut out, values[..count].iter().copied()).unwrap();
        let frame = FrameRef::new_checked(&out[..n]).unwrap();
        let Ok(Command::SetSettings(read)) = Command::parse(frame) else { panic!("{count}") };
        assert!(read.iter().eq(values[..count].iter().copied()));
    }
    let one_more = values.iter().chain(&values[..1]).copied();
    assert!(matches!(set_settings(&mut out, one_more), Err(EncodeError::WrongCount { count: 257, .. })));
    assert!(matches!(set_settings(&mut out, []), Err(EncodeError::WrongCount { count: 0, .. })));
    let short = set_settings(&mut out[..15], values[..1].iter().copied());
    assert_eq!(short, Err(EncodeError::BufferTooShort { needed: 16, given: 15 }));
}

/// The expected bytes are the bytes of the examples on the protocol page.
#[test]
fn j50_requests_are_these_bytes() {
    assert_eq!(fixed::GET_INFO[..4], [0x9B, 0x40, 0, 6]);
    assert_eq!(fixed::get_settings(0x0102)[..6], [0x9B, 0x41, 0, 8, 1, 2]);
    assert_eq!(fixed::get_arm(0x0304)[..6], [0x9B, 0x44, 0, 8, 3, 4]);
    assert_eq!(fixed::get_log(0x0102_0304, 0x0506)[..10], [0x9B, 0x4C, 0, 12, 1, 2, 3, 4, 5, 6]);
    assert_eq!(fixed::CLEAR_LOG[..4], [0x9B, 0x4D, 0, 6]);
    assert_eq!(fixed::get_points(0x0102)[..6], [0x9B, 0x4E, 0, 8, 1, 2]);
    assert_eq!(fixed::STORE_ARM[..4], [0x9B, 0x45, 0, 6]);
    assert_eq!(fixed::DISABLE[..4], [0x9B, 0x46, 0, 6]);
    let value = SettingValue { setting: 3, joint: 6, value: -1.5 };
    assert_eq!(value.emit(), [3, 6, 0xBF, 0xF8, 0, 0, 0, 0, 0, 0]);
}

/// The expected bytes are the bytes of the examples on the protocol page.
#[test]
fn j56_a_page_of_the_log_is_these_bytes() {
    let page = LogPage {
        state: LogState::Error,
        block: 0x1234,
        offset: 1016,
        end: 0x1235,
        points: 501,
        points_hash: 0xDEAD_BEEF,
        bytes: &[0, 0, 0, 0, 1, 2, 3, 4],
    };
    let mut out = [0; ANSWER_MAX];
    let n = Answer::Log(page).emit(&mut out).unwrap();
    let bytes = [
        0x9B, 0x5C, 0, 0x1F, 2, 0, 0, 0x12, 0x34, 0x03, 0xF8, 0, 0, 0x12, 0x35, 0x01, 0xF5, 0xDE, 0xAD, 0xBE,
        0xEF, 0, 0, 0, 0, 1, 2, 3, 4,
    ];
    assert_eq!(out[..n - 2], bytes);
    assert_eq!(Answer::parse(FrameRef::new_checked(&out[..n]).unwrap()), Some(Answer::Log(page)));
    // The longest Log frame may have at most 256 bytes (J-56).
    let full = LogPage { bytes: &[7; LOG_PAGE], ..page };
    assert!(Answer::Log(full).emit(&mut out).unwrap() <= 256);
}

/// The expected value is the published test vector of 64-bit FNV-1a.
#[test]
fn j52_the_hash_is_fnv_1a() {
    assert_eq!(Hash::new().value(), 0xCBF2_9CE4_8422_2325);
    assert_eq!(Hash::new().update(b"a").value(), 0xAF63_DC4C_8601_EC8C);
    assert_eq!(Hash::new().update(b"foo").update(b"bar").value(), 0x8594_4171_F739_67E8);
}

/// Returns an arm image with `settings` values.
fn image_bytes(table: bool, settings: u16) -> Vec<u8> {
    let mut bytes = b"JTCA".to_vec();
    bytes.extend([1, table.into()]);
    bytes.extend(settings.to_be_bytes());
    bytes.resize(660 + if table { 10_560 } else { 144 } + 10 * usize::from(settings) + 32, 0);
    bytes
}

#[test]
fn j54_an_image_is_read_whole_or_not_at_all() {
    for (table, settings) in [(false, 0), (false, 100), (true, 100)] {
        let mut bytes = image_bytes(table, settings);
        let read = ArmImage::parse(&bytes).unwrap();
        assert_eq!(read.pid.len(), 30);
        assert_eq!(read.model.len(), 133);
        let friction = match read.friction {
            FrictionImage::Polynomial(floats) => (false, floats.len()),
            FrictionImage::Table(floats) => (true, floats.len()),
        };
        assert_eq!(friction, (table, if table { 2640 } else { 36 }));
        assert_eq!(read.settings.len(), usize::from(settings));
        assert!(bytes.len() <= IMAGE_MAX);
        assert_eq!(ArmImage::parse(&bytes[..bytes.len() - 1]), None);
        // The name of the arm must not change the hash of the image.
        let hash = Hash::of_image(&bytes);
        let at = bytes.len() - 32;
        bytes[at] = b'x';
        assert_eq!(Hash::of_image(&bytes), hash);
        bytes[at - 1] ^= 1;
        assert_ne!(Hash::of_image(&bytes), hash);
        bytes.push(0);
        assert_eq!(ArmImage::parse(&bytes), None);
    }
    for (at, byte) in [(0, b'X'), (4, 2), (5, 2), (7, 1)] {
        let mut bytes = image_bytes(false, 0);
        bytes[at] = byte;
        assert_eq!(ArmImage::parse(&bytes), None, "byte {at}");
    }
}

proptest! {
    #[test]
    fn j50_no_body_makes_a_parser_panic(kind in 0x40u8..0x60, body in prop::collection::vec(any::<u8>(), 0..400)) {
        let bytes = crate::fuzzing::sealed(kind, &body);
        if let Some(frame) = FrameRef::new_checked(&bytes) {
            if let Some(answer) = Answer::parse(frame) {
                let mut out = [0; ANSWER_MAX];
                // Encoding a parsed answer must give the original bytes, except for bytes that a later version may have added to an
                // Info.
                if let Ok(n) = answer.emit(&mut out) && !matches!(answer, Answer::Info(_)) {
                    prop_assert_eq!(&out[..n], &bytes[..]);
                }
                let _ = std::format!("{answer} {answer:#}");
            }
            let _ = Command::parse(frame);
        }
        let _ = ArmImage::parse(&body);
    }
}
