//! Code of the fuzz targets for file readers. Each target passes arbitrary bytes to a file reader. A panic of the reader, or a property
//! that is not fulfilled, is an error.

use std::io::Cursor;
use ucom::Profile;

use crate::ProfileFile;
use crate::master::io::{IoDescription, Kind};

use super::image::{Format, Gaps, Image, ImageOptions};
use super::inventory::Inventory;
use super::params::{ParamsFile, SavedBoard, SavedSignal, check_board, params_text};
use super::recording::{CandumpWriter, FZI_HEADER, FziWriter, McapWriter, Recording, read_mcap};
use super::signals::{BoardSignals, SignalTable, SignalValue};

/// Reads images in every format; the first byte selects the format.
pub fn image(data: &[u8]) {
    let Some((&choice, data)) = data.split_first() else { return };
    let format = [None, Some(Format::Bin), Some(Format::IntelHex), Some(Format::SRecord)];
    let gaps = if choice & 4 == 0 { Gaps::Refuse } else { Gaps::Fill(choice) };
    let options = ImageOptions {
        format: format[usize::from(choice & 3)],
        gaps,
        swap_bytes: choice & 8 != 0,
        max_bytes: 1 << 16,
        ..Default::default()
    };
    if let Ok(image) = Image::parse(data, &options) {
        assert!(!image.bytes().is_empty() && image.bytes().len().is_multiple_of(2));
        assert!(image.bytes().len() <= (1 << 16) + 1);
    }
}

/// Reads recordings in every format. If the target reads a recording and writes it again in the same format, the recording is unchanged.
pub fn recording(data: &[u8]) {
    // Changes a recording to the form in which it is read back: the text formats store times in whole microseconds,
    // and a file that this program has written is never incomplete.
    let as_written = |recording: &mut Recording| {
        recording.records.iter_mut().for_each(|r| r.time_ns -= r.time_ns % 1000);
        recording.broken_off = None;
    };
    if let Ok(mut recording) = Recording::read_candump(data) {
        as_written(&mut recording);
        let mut out = CandumpWriter::new(Vec::new());
        recording.records.iter().for_each(|r| out.write(r).expect("a vector takes all"));
        let again = Recording::read_candump(&out.into_inner()[..]).expect("our own form");
        assert_eq!(again.records, recording.records);
    }
    let mut stream = FZI_HEADER.as_bytes().to_vec();
    stream.push(b'\n');
    stream.extend_from_slice(data);
    if let Ok(mut recording) = Recording::read_fzi(&stream[..]) {
        as_written(&mut recording);
        let mut out = FziWriter::new(Vec::new()).expect("a vector takes all");
        recording.records.iter().for_each(|r| out.write(r).expect("a frame of this form"));
        assert_eq!(Recording::read_fzi(&out.into_inner()[..]).expect("our own form"), recording);
    }
    if let Ok(recording) = read_mcap(data) {
        let profile = recording.profile.as_deref().unwrap_or_default();
        let mut out = McapWriter::new(Cursor::new(Vec::new()), profile).expect("a vector takes all");
        recording.records.iter().for_each(|r| out.write(r, None).expect("a vector takes all"));
        let file = out.finish().expect("a vector takes all").into_inner();
        assert_eq!(read_mcap(&file).expect("our own form").records, recording.records);
    }
}

/// Reads inventories. If the target reads an inventory and writes it again as text, the inventory is unchanged.
pub fn inventory(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(inventory) = Inventory::parse(text) {
        assert_eq!(Inventory::parse(&inventory.to_toml()).expect("our own form"), inventory);
    }
}

/// Reads signal tables. For every signal, a word is displayed as text. This text must convert to a word that is
/// displayed as the same text, unless a limit forbids the word.
pub fn edges(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(table) = SignalTable::parse(text) else { return };
    for id in [0x1234, 1, 0, 0xFFFF] {
        let Some(program) = table.program(id) else { continue };
        for kind in [Kind::Ci, Kind::So, Kind::Par] {
            for (i, name) in program.names(kind).enumerate() {
                let Some(signal) = program.signal(kind, i, name) else { continue };
                for word in [0, 1, 0x7FFF, 0x8000, 0xFFFF] {
                    let given: SignalValue =
                        signal.text_with_unit(word).parse().expect("what is shown can be given");
                    let (again, text) = (signal.word(&given), signal.text(word));
                    let limited = signal.min.is_some() || signal.max.is_some();
                    // If the offset is more than 1e9 times the scale, a displayed value has too few digits to
                    // distinguish neighbouring words.
                    let coarse = signal.offset.abs() > signal.scale.abs() * 1e9;
                    // A scaled signal without a unit accepts only raw words.
                    let no_unit = signal.unit.is_empty() && (signal.scale != 1.0 || signal.offset != 0.0);
                    if no_unit && matches!(again, Err(super::signals::ValueError::NoUnit { .. })) {
                        continue;
                    }
                    let same = again.as_ref().is_ok_and(|w| signal.text(*w) == text);
                    assert!(
                        same || limited || coarse || signal.kind == super::SignalType::Bool,
                        "{signal:?} {word} {text} {again:?}"
                    );
                }
            }
        }
    }
}

/// Reads parameter files and checks them against a board. The valid values are then written as a parameter file,
/// which must result in the same words when it is read again.
pub fn params(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(file) = ParamsFile::parse(text) else { return };
    let profile = Profile::default();
    for board in &file.boards {
        let names =
            |list: &[super::params::ParamsEntry]| list.iter().map(|e| e.name.clone()).collect::<Vec<_>>();
        let description =
            IoDescription { ci: names(&board.ci), par: names(&board.par), ..Default::default() };
        let signals = BoardSignals::new(&description, None, &profile);
        let Ok((_, par)) = check_board(board, &description, &signals) else { continue };
        let word = |i: usize| par.iter().find(|w| usize::from(w.index) == i).map(|w| w.word);
        let saved = |(i, signal): (usize, &super::Signal)| SavedSignal {
            signal: signal.clone(),
            word: word(i),
            remark: String::new(),
        };
        let all = signals.all(Kind::Par).iter().enumerate().map(saved).collect();
        let saved = SavedBoard {
            number: board.number,
            description: description.clone(),
            par: all,
            ..Default::default()
        };
        let again = ParamsFile::parse(&params_text(&[saved])).expect("our own form");
        let again = again.board(board.number).expect("the same board");
        let (_, words) = check_board(again, &description, &signals).expect("our own names and values");
        let pairs =
            |list: &[super::params::ParamsWord]| list.iter().map(|w| (w.index, w.word)).collect::<Vec<_>>();
        let mut before = pairs(&par);
        before.sort_unstable();
        assert_eq!(pairs(&words), before);
    }
}

/// Reads the text of a profile file.
pub fn profile(data: &[u8]) {
    let Ok(text) = core::str::from_utf8(data) else { return };
    if let Ok(profile) = Profile::from_toml(text) {
        assert_eq!(Profile::from_toml(&profile.to_toml()), Ok(profile));
    }
}
