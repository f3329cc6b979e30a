//! Tests of the DBC files. The crate `can-dbc` reads the files, and the tests decode frames with the result.

use can_dbc::{ByteOrder, Dbc, Message, MessageId, MultiplexIndicator, Signal, ValueType};
use std::panic;

use super::*;
use ucom::{BufferPackage, Frame, Packages};

fn boards() -> Vec<DbcBoard> {
    let signal = crate::files::Signal::bare(&ucom::Profile::default());
    let texts = |list: &[&str]| {
        list.iter().map(|t| NamedSignal { name: (*t).to_owned(), signal: signal.clone() }).collect::<Vec<_>>()
    };
    vec![
        DbcBoard {
            number: 1,
            ci: texts(&["target velocity", "current limit"]),
            so: texts(&["pos_soll", "pos ist", "current [mA]", "Temperatur °C", "pos ist"]),
            par: texts(&["P", "I", "D"]),
        },
        DbcBoard { number: 31, ..Default::default() },
    ]
}

fn message(dbc: &Dbc, id: u16) -> &Message {
    dbc.messages.iter().find(|m| m.id == MessageId::Standard(id)).unwrap_or_else(|| panic!("no {id:03X}"))
}

/// Computes a signal's value bit by bit, using only the rules of the DBC format.
fn value(signal: &Signal, data: &[u8]) -> i64 {
    let bit = |n: u64| i64::from(data[n as usize / 8] >> (n % 8) & 1);
    let mut raw = 0_i64;
    if signal.byte_order == ByteOrder::LittleEndian {
        (0..signal.size).for_each(|i| raw |= bit(signal.start_bit + i) << i);
    } else {
        let mut at = signal.start_bit;
        for _ in 0..signal.size {
            raw = raw << 1 | bit(at);
            at = if at.is_multiple_of(8) { at + 15 } else { at - 1 };
        }
    }
    if signal.value_type == ValueType::Signed && raw >> (signal.size - 1) & 1 == 1 {
        raw -= 1 << signal.size;
    }
    raw
}

/// Returns the decoded signals in a frame. The result contains a multiplexed signal only if the frame contains the signal.
fn decode(dbc: &Dbc, frame: &Frame) -> Vec<(String, i64)> {
    let message = message(dbc, frame.id());
    let data = frame.payload().padded();
    let selector =
        message.signals.iter().find(|s| s.multiplexer_indicator == MultiplexIndicator::Multiplexor);
    let selected = selector.map(|s| value(s, &data));
    let applies = |s: &&Signal| match s.multiplexer_indicator {
        MultiplexIndicator::Plain => true,
        MultiplexIndicator::MultiplexedSignal(m) => selected == Some(m as i64),
        _ => false,
    };
    message.signals.iter().filter(applies).map(|s| (s.name.clone(), value(s, &data))).collect()
}

/// P-21: the sensor outputs in a DBC file have the names from the board's description. SO frames in either byte order
/// decode to the same values.
#[test]
fn p21_so_frames_decode_by_name() {
    let numbers = [100_i16, -20, 32767, -32768, 5];
    for endian in [Endian::Little, Endian::Big] {
        let text = dbc(&boards(), endian);
        let dbc = Dbc::try_from(text.as_str()).expect("a DBC file");
        let words = numbers.map(|n| n as u16);
        let mut seen = Vec::new();
        for package in Packages::new(&words) {
            let payload = package.payload(endian, false);
            let frame = Frame::of(Function::So, Sequence::new(1).unwrap(), payload);
            seen.extend(decode(&dbc, &frame));
        }
        let names = ["pos_soll", "pos_ist", "current_mA", "Temperatur_C", "pos_ist_2"];
        let expected: Vec<_> =
            names.iter().zip(numbers).map(|(n, v)| ((*n).to_owned(), i64::from(v))).collect();
        assert_eq!(seen, expected);
    }
}

/// D-11: type, scale, offset, unit and limits of the signal table appear in the DBC signals.
#[test]
fn d11_signals_carry_scale_offset_and_unit() {
    let table = "[[program]]\nprogram_id = 1\nso.angle = { scale = 0.01, unit = \"deg\", min = -60, max = 60 }\n\
                 so.warm = { type = \"uint16\", scale = -0.1, offset = -40, unit = \"°C\" }\nso.bits = { type = \"hex\" }\n";
    let table = crate::files::SignalTable::parse(table).unwrap();
    let names = ["angle [x]", "warm", "bits", "bare"].map(str::to_owned).to_vec();
    let description = IoDescription { so: names, ..Default::default() };
    let signals = BoardSignals::new(&description, table.program(1), &ucom::Profile::default());
    let text = dbc(&[DbcBoard::new(1, &description, &signals)], Endian::Little);
    let dbc = Dbc::try_from(text.as_str()).expect("a DBC file");
    let signals = &message(&dbc, Function::So.id(Sequence::new(1).unwrap())).signals;
    let seen: Vec<_> = signals[1..]
        .iter()
        .map(|s| (s.name.as_str(), s.factor, s.offset, s.unit.as_str(), s.value_type == ValueType::Signed))
        .collect();
    let expected = [
        ("angle", 0.01, 0.0, "deg", true),
        ("warm", -0.1, -40.0, "°C", false),
        ("bits", 1.0, 0.0, "", false),
        ("bare", 1.0, 0.0, "", true),
    ];
    assert_eq!(seen, expected, "{text}");
    assert!(text.contains("(0.01,0) [-60|60] \"deg\""), "{text}");
}

/// The limits in the file have no additional digits from floating-point arithmetic: the file contains 3276.7 and not
/// 3276.7000000000003.
#[test]
fn d11_ranges_of_signals_are_short() {
    let table = "[[program]]\nprogram_id = 1\nso.tenths = { scale = 0.1 }\nso.odd = { scale = 0.1, min = -0.125, max = 7.25 }\n\
                 so.bits = { type = \"hex\" }\nso.switch = { type = \"bool\" }\n";
    let table = crate::files::SignalTable::parse(table).unwrap();
    let names = ["tenths", "odd", "bits", "switch"].map(str::to_owned).to_vec();
    let description = IoDescription { so: names, ..Default::default() };
    let signals = BoardSignals::new(&description, table.program(1), &ucom::Profile::default());
    let text = dbc(&[DbcBoard::new(1, &description, &signals)], Endian::Little);
    for range in ["(0.1,0) [-3276.8|3276.7]", "(0.1,0) [-0.125|7.25]", "(1,0) [0|65535]", "(1,0) [0|1]"] {
        assert!(text.contains(range), "{range}: {text}");
    }
    Dbc::try_from(text.as_str()).expect("a DBC file");
}

/// Decodes the golden frame of a board's information, and a PC_SETSTATUS.
#[test]
fn static_messages_decode() {
    let text = dbc(&boards(), Endian::Little);
    let dbc = Dbc::try_from(text.as_str()).unwrap();
    let info = decode(&dbc, &"141#2100011934126E38".parse().unwrap());
    let get = |name: &str| info.iter().find(|(n, _)| n == name).unwrap().1;
    assert_eq!(
        (get("flash_number"), get("sequence"), get("program_id"), get("flash_date")),
        (0x21, 1, 0x1234, 0x386E)
    );
    let bits: Vec<&str> = info.iter().filter(|(_, v)| *v == 1).map(|(n, _)| n.as_str()).collect();
    assert_eq!(bits, ["sequence", "exlrun", "init", "ipinit"]);
    assert_eq!(decode(&dbc, &"1C1#0202".parse().unwrap())[0], ("mask".into(), 2));
    assert_eq!(message(&dbc, 0).size, 0);
}

#[test]
fn every_message_has_a_name_and_an_identifier_of_its_own() {
    let text = dbc(&boards(), Endian::Big);
    let dbc = Dbc::try_from(text.as_str()).unwrap();
    let mut names: Vec<_> = dbc.messages.iter().map(|m| m.name.clone()).collect();
    let mut ids: Vec<_> = dbc.messages.iter().map(|m| m.id).collect();
    let count = names.len();
    names.sort();
    names.dedup();
    ids.sort_by_key(|id| id.raw());
    ids.dedup();
    assert_eq!((names.len(), ids.len()), (count, count));
    // Expected number of messages: 24 functions for each of the two boards, 128 reports (4 functions with 32 numbers
    // each), and 11 messages for the broadcasts and for the error of a board without a number.
    assert_eq!(count, 2 * 24 + 128 + 11);
}

#[test]
fn so_without_signals_has_no_selector() {
    let text = dbc(&boards(), Endian::Little);
    let dbc = Dbc::try_from(text.as_str()).unwrap();
    assert!(message(&dbc, Function::So.id(Sequence::MAX)).signals.is_empty());
    assert_eq!(BufferPackage::at(&[], 0), None);
}
