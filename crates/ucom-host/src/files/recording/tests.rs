//! Tests of the requirements C-3 and C-7 for recording files. The reference checks run the Python readers.

use proptest::prelude::*;
use std::io::Cursor;
use std::panic;

use super::*;

fn read(text: &str) -> Result<Vec<Record>, RecordingError> {
    Recording::read_candump(format!("{text}\n").as_bytes()).map(|r| r.records)
}

fn problem(line: &str) -> RecordProblem {
    match read(line) {
        Err(RecordingError::Line { line: 1, problem }) => problem,
        other => panic!("{other:?}"),
    }
}

/// C-3: a reset of all boards is read from a recording and written to a recording like any other frame.
#[test]
fn c3_reset_for_all_is_kept() {
    let records = read("(1.5) can0 000#\n").unwrap();
    assert_eq!(records[0].frame.as_classic(), Some((0, &[][..])));
    let mut out = CandumpWriter::new(Vec::new());
    out.write(&records[0]).unwrap();
    assert_eq!(String::from_utf8(out.into_inner()).unwrap(), "(0000000001.500000) can0 000#\n");
}

#[test]
fn times_have_any_number_of_digits() {
    let times = ["(7) ", "(7.5) ", "(7.123456) ", "(7.123456789) ", "(7.1234567891) "];
    let ns: Vec<u64> =
        times.iter().map(|t| read(&format!("{t} can0 123#")).unwrap()[0].time_ns % 1_000_000_000).collect();
    assert_eq!(ns, [0, 500_000_000, 123_456_000, 123_456_789, 123_456_789]);
}

/// can-utils of 2020 refuses a log whose times do not have six decimals.
#[test]
fn times_are_written_with_six_decimals() {
    let frame = RecordedFrame::classic(0x680, &[]);
    let record = Record { time_ns: 7_123_456_789, channel: "can0".into(), direction: None, frame };
    let mut out = CandumpWriter::new(Vec::new());
    out.write(&record).unwrap();
    assert_eq!(String::from_utf8(out.into_inner()).unwrap(), "(0000000007.123456) can0 680#\n");
}

/// D-02: foreign frames in a recording are read with their kind, and are written as the original text.
#[test]
fn d02_foreign_lines_are_recognised() {
    for frame in [
        "12345678#11",
        "123#R",
        "123#R4",
        "123#R8_9",
        "123##1AABB",
        "20000080#0102030405060708",
        "123#1122334455667788_B",
    ] {
        let records = read(&format!("(0000000001.000000) can0 {frame}\n")).unwrap();
        assert_eq!(records[0].frame.to_string(), frame);
        assert_eq!(records[0].frame.as_classic().is_some(), frame.ends_with("_B"), "{frame}");
    }
}

#[test]
fn bad_lines_are_named() {
    assert_eq!(problem("nonsense"), RecordProblem::Columns);
    assert_eq!(problem("(x) can0 123#"), RecordProblem::Time);
    for error_that_is_no_data_frame in ["20000080##1AABB", "20000080#R8"] {
        assert_eq!(problem(&format!("(1.0) can0 {error_that_is_no_data_frame}")), RecordProblem::Data);
    }
    assert_eq!(problem("(1) can0 823#"), RecordProblem::Id);
    assert_eq!(problem("(1) can0 12#"), RecordProblem::Id);
    assert_eq!(problem("(1) can0 123#1"), RecordProblem::Data);
    assert_eq!(problem("(1) can0 123#112233445566778899"), RecordProblem::Data);
    assert_eq!(problem("(1) can0 123#R9"), RecordProblem::Length);
    assert_eq!(problem(&"x".repeat(MAX_LINE + 1)), RecordProblem::TooLong);
}

#[test]
fn profile_in_comment_lines_is_read() {
    let mut out = CandumpWriter::new(Vec::new());
    out.comment_profile("endian = \"big\"\nbitrate = 500000\n").unwrap();
    let text = String::from_utf8(out.into_inner()).unwrap() + "# other\n(1) can0 123#\n";
    let recording = Recording::read_candump(text.as_bytes()).unwrap();
    assert_eq!(recording.profile.as_deref(), Some("endian = \"big\"\nbitrate = 500000\n"));
    assert_eq!(recording.records.len(), 1);
}

#[test]
fn fzi_has_eight_bytes_and_a_decimal_id() {
    let mut out = FziWriter::new(Vec::new()).unwrap();
    let frame = RecordedFrame::classic(0x141, &[0x21, 0]);
    let record = Record { time_ns: 12_000_034_000, channel: "can0".into(), direction: None, frame };
    out.write(&record).unwrap();
    let foreign = RecordedFrame { extended: true, ..record.frame.clone() };
    let refused = out.write(&Record { frame: foreign, ..record.clone() });
    assert!(matches!(refused, Err(RecordingError::NotRepresentable { .. })));
    let text = String::from_utf8(out.into_inner()).unwrap();
    assert_eq!(text, format!("{FZI_HEADER}\n12.000034 321 2 21 00 00 00 00 00 00 00\n"));
    assert_eq!(Recording::read_fzi(text.as_bytes()).unwrap().records, [record]);
    assert!(matches!(FziReader::new(&b"# FZI-CAN 1.1"[..]), Err(RecordingError::FziHeader { .. })));
}

fn frames() -> impl Strategy<Value = RecordedFrame> {
    let bytes = |most| prop::collection::vec(any::<u8>(), 0..=most);
    let id = (any::<bool>(), any::<u32>()).prop_map(|(e, id)| (e, id & if e { 0x1FFF_FFFF } else { 0x7FF }));
    let data = bytes(8).prop_map(|d| (FrameKind::Data, d));
    let remote = (0_u8..=8).prop_map(|length| (FrameKind::Remote { length }, Vec::new()));
    let fd = (bytes(64), 0_u8..4).prop_map(|(d, flags)| (FrameKind::Fd { flags }, d));
    (id, prop_oneof![data, remote, fd]).prop_map(|((extended, id), (kind, data))| RecordedFrame {
        id,
        extended,
        kind,
        data,
        dlc: None,
    })
}

/// Returns the bytes in a file whose writer was killed.
fn left_behind(format: RecordingFormat, records: &[Record]) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("recording");
    let mut writer = RecordingWriter::create(&path, format, "endian = \"big\"\n").unwrap();
    for record in records {
        writer.write(record, None).unwrap();
        writer.flush().unwrap();
    }
    let bytes = std::fs::read(&path).unwrap();
    drop(writer);
    bytes
}

/// If a writer is killed, its file may end at any byte. All complete records are read, no other record appears in the result, and the
/// damage is reported.
#[test]
fn a_file_that_is_cut_off_is_read_up_to_its_last_whole_record() {
    let record = |i: u64| {
        let frame = RecordedFrame::classic(0x141, &[i as u8, 2, 3, 4, 5, 6, 7, 8]);
        Record { time_ns: 1_000_000_000 + i * 1_000_000, channel: "can0".into(), direction: None, frame }
    };
    let records: Vec<Record> = (0..6).map(record).collect();
    for format in [RecordingFormat::Candump, RecordingFormat::FziCan, RecordingFormat::Mcap] {
        let bytes = left_behind(format, &records);
        let (mut most, mut named) = (0, 0);
        let start = if format == RecordingFormat::Mcap { 9 } else { FZI_HEADER.len() + 1 };
        for end in start..=bytes.len() {
            let cut = bytes.get(..end).unwrap();
            let read = match format {
                RecordingFormat::Candump => Recording::read_candump(cut),
                RecordingFormat::FziCan => Recording::read_fzi(cut),
                RecordingFormat::Mcap => read_mcap(cut),
            };
            let read = read.unwrap_or_else(|e| panic!("{format:?} cut at {end}: {e}"));
            assert_eq!(read.records, records[..read.records.len()], "{format:?} cut at {end}");
            assert!(read.records.len() >= most, "{format:?} cut at {end}: a record less than before");
            most = read.records.len();
            named += usize::from(read.broken_off.is_some());
            if format != RecordingFormat::Mcap {
                let lines = cut.iter().filter(|b| **b == b'\n').count();
                let head = usize::from(format == RecordingFormat::FziCan);
                assert_eq!(read.records.len() + head, lines, "{format:?} cut at {end}");
                assert_eq!(read.broken_off.is_some(), cut.last() != Some(&b'\n'), "{format:?} cut at {end}");
            }
        }
        assert_eq!(most, records.len(), "{format:?}");
        assert!(named > 100, "{format:?}: {named}");
    }
}

/// The file of a killed writer ends with an incomplete MCAP chunk. The header of the chunk does not contain its length yet.
#[test]
fn a_chunk_without_its_end_hides_nothing_before_it() {
    let record = |i: u64| {
        let frame = RecordedFrame::classic((i % 0x700) as u16, &i.to_le_bytes());
        Record { time_ns: i, channel: "can0".into(), direction: None, frame }
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("recording.mcap");
    let mut writer = RecordingWriter::create(&path, RecordingFormat::Mcap, "endian = \"big\"\n").unwrap();
    let mut flushed = 0;
    for i in 0..5_000 {
        writer.write(&record(i), Some("MCA_DSP_SO")).unwrap();
        if i % 2_000 == 1_000 {
            writer.flush().unwrap();
            flushed = i + 1;
        }
    }
    let bytes = std::fs::read(&path).unwrap();
    let read = read_mcap(&bytes).unwrap();
    assert!(read.records.len() as u64 >= flushed, "{} of {flushed}", read.records.len());
    assert!(read.broken_off.is_some());
    assert!((0..).map(record).zip(&read.records).all(|(wrote, read)| wrote == *read));
    drop(writer);
}

fn records(us: bool) -> impl Strategy<Value = Vec<Record>> {
    let direction = prop_oneof![Just(None), Just(Some(Direction::Sent)), Just(Some(Direction::Received))];
    let record = (0_u64..1 << 60, direction, frames()).prop_map(move |(t, direction, frame)| Record {
        time_ns: if us { t / 1000 * 1000 } else { t },
        channel: "can0".into(),
        direction,
        frame,
    });
    prop::collection::vec(record, 0..20)
}

proptest! {
    /// C-7 for candump: any frames are read back unchanged, with times in µs.
    #[test]
    fn c7_candump_round_trip(records in records(true)) {
        let mut out = CandumpWriter::new(Vec::new());
        records.iter().for_each(|r| out.write(r).unwrap());
        let text = String::from_utf8(out.into_inner()).unwrap();
        prop_assert_eq!(read(&text).unwrap(), records);
    }

    /// C-7 for FZI-CAN: frames that the format can represent are read back unchanged, including frames with a DLC below 8.
    #[test]
    fn c7_fzi_round_trip(records in records(true)) {
        let mut out = FziWriter::new(Vec::new()).unwrap();
        let kept: Vec<Record> = records.iter().filter(|r| out.write(r).is_ok()).cloned().collect();
        prop_assert!(kept.iter().all(|r| r.frame.as_classic().is_some()));
        let back = Recording::read_fzi(&out.into_inner()[..]).unwrap().records;
        let plain: Vec<Record> = kept.into_iter().map(|r| Record { direction: None, ..r }).collect();
        prop_assert_eq!(back, plain);
    }

    /// The frames and the profile that are read from an MCAP file are equal to those that were written.
    #[test]
    fn mcap_round_trip(records in records(false)) {
        let mut out = McapWriter::new(Cursor::new(Vec::new()), "endian = \"big\"\n").unwrap();
        records.iter().for_each(|r| out.write(r, Some("PC_RESET")).unwrap());
        let file = out.finish().unwrap().into_inner();
        prop_assert_eq!(RecordingFormat::detect(&file), RecordingFormat::Mcap);
        let back = read_mcap(&file).unwrap();
        prop_assert_eq!(back.records, records);
        prop_assert_eq!(back.profile.as_deref(), Some("endian = \"big\"\n"));
    }

    /// Random text results in records or in a specific error.
    #[test]
    fn any_text_is_read_or_refused(text in "[ -~\n#()R]{0,200}", bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = read(&text);
        let _ = Recording::read_candump(&bytes[..]);
        let _ = Recording::read_fzi(format!("{FZI_HEADER}\n{text}").as_bytes());
        let _ = read_mcap(&bytes);
    }
}

#[test]
fn files_know_their_profile() {
    let dir = tempfile::tempdir().unwrap();
    for (name, format) in [
        ("a.log", RecordingFormat::Candump),
        ("a.fzi", RecordingFormat::FziCan),
        ("a.mcap", RecordingFormat::Mcap),
    ] {
        let path = dir.path().join(name);
        assert_eq!(RecordingFormat::of_path(&path), format);
        let mut writer = RecordingWriter::create(&path, format, "endian = \"big\"\n").unwrap();
        let frame = RecordedFrame::classic(0, &[]);
        let record = Record { time_ns: 5_000, channel: "can0".into(), direction: None, frame };
        writer.write(&record, None).unwrap();
        writer.finish().unwrap();
        let back = Recording::read(&path).unwrap();
        assert_eq!((back.profile.as_deref(), &back.records[..]), (Some("endian = \"big\"\n"), &[record][..]));
    }
}
