//! Tests that read, check and write parameter files.

use super::*;
use crate::files::signals::{BoardSignals, Signal, SignalTable, SignalType};
use crate::master::io::{IoDescription, Kind};
use proptest::prelude::*;
use std::panic;
use ucom::{BoardInfo, Profile, Status};

const GOOD: &str = "boards:\n  - board: 1\n    flash_number: 0x0021\n    program_id: 0x1234\n    par:\n      kp: 120\n      current_max: 1.5 A\n      \"#2\": 0x0010\n    ci:\n      set_position: -15.5 deg\n  - board: 2\n    name: jaw\n    program_id: any\n";

fn texts(list: &[&str]) -> Vec<String> {
    list.iter().map(|t| (*t).to_owned()).collect()
}

fn description() -> IoDescription {
    IoDescription {
        description: "head pan".into(),
        ci: texts(&["set_position [0.01 deg]"]),
        so: Vec::new(),
        par: texts(&["kp [mA/deg]", "current_max [mA]", "mode"]),
    }
}

fn signals() -> BoardSignals {
    let table = "[[program]]\nprogram_id = 0x1234\n[program.ci]\nset_position = { scale = 0.01, unit = \"deg\", min = -60, max = 60 }\n\
                 [program.par]\ncurrent_max = { type = \"uint16\", scale = 0.001, unit = \"A\", max = 2 }\nmode = { type = \"hex\" }\n";
    let table = SignalTable::parse(table).unwrap();
    BoardSignals::new(&description(), table.program(0x1234), &Profile::default())
}

fn info() -> BoardInfo {
    BoardInfo { flash_number: 0x21, sequence: 1, status: Status(0x8B), program_id: 0x1234, date: 0x386E }
}

fn refused(text: &str) -> String {
    ParamsFile::parse(text).unwrap_err().to_string()
}

#[test]
fn values_become_words_of_their_signals() {
    let file = ParamsFile::parse(GOOD).unwrap();
    let board = file.board(1).unwrap();
    let target = ParamsTarget { info: &info(), name: None };
    assert_eq!(check_identity(board, &target), []);
    let (ci, par) = check_board(board, &description(), &signals()).unwrap();
    let words = |list: &[ParamsWord]| list.iter().map(|w| (w.index, w.word)).collect::<Vec<_>>();
    assert_eq!(words(&ci), [(0, -1550_i16 as u16)]);
    assert_eq!(words(&par), [(0, 120), (1, 1500), (2, 16)]);
    assert_eq!(ci[0].text, "-15.50 deg");
    assert_eq!((file.board(2).unwrap().program_id, file.board(2).unwrap().flash_number), (None, None));
}

/// A parameter file identifies a board by its number, its flash number or name, and its program.
#[test]
fn another_board_or_program_is_a_problem_with_its_line() {
    let file = ParamsFile::parse(GOOD).unwrap();
    let message = |info: &BoardInfo, number: u8, name: Option<&str>| {
        let target = ParamsTarget { info, name };
        let problems = check_identity(file.board(number).unwrap(), &target);
        problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
    };
    let other = BoardInfo { flash_number: 0x42, program_id: 0x4B3F, ..info() };
    let text = message(&other, 1, None);
    assert!(
        text.contains("line 2, column 5: board 1: its flash number is 0x0042, but the file is for 0x0021"),
        "{text}"
    );
    assert!(text.contains("its program is 0x4B3F, but the names in the file belong to 0x1234"), "{text}");
    let bare = BoardInfo { program_id: 0xFFFF, date: 0xFFFF, ..info() };
    assert!(message(&bare, 1, None).contains("its program is missing"));
    assert_eq!(message(&other, 2, Some("jaw")), "");
    assert!(message(&other, 2, Some("lips")).contains(
        "line 11, column 5: board 2: the file is for `jaw`, but the name in the inventory is `lips`"
    ));
    assert!(message(&other, 2, None).contains("name in the inventory is missing"));
}

/// All errors of a parameter file are reported together, each with line and column.
#[test]
fn names_and_ranges_are_checked_with_their_place() {
    let text = "boards:\n- board: 1\n  flash_number: 33\n  program_id: any\n  par:\n    kq: 1\n    KP: 4000\n    kp: 70000\n    current_max: 3 A\n    mode: on\n  ci:\n    set_position: 61 deg\n";
    let file = ParamsFile::parse(text).unwrap();
    let problems = check_board(file.board(1).unwrap(), &description(), &signals()).unwrap_err();
    let message: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert_eq!(
        message,
        [
            "line 12, column 19: board 1: CI `set_position`: 61 deg is outside -60.00..60.00 deg",
            "line 6, column 9: board 1 has no PAR `kq`; similar: `kp [mA/deg]`",
            "line 8, column 9: board 1: PAR `kp` has two entries, the first one in line 7",
            "line 9, column 18: board 1: PAR `current_max`: 3 A is outside 0.000..2.000 A",
            "line 10, column 11: board 1: PAR `mode`: on: the signal is a number",
        ]
    );
}

#[test]
fn what_is_no_parameter_file_is_refused_with_its_place() {
    assert!(
        refused("boards:\n  - board: 32\n    flash_number: 1\n    program_id: any\n")
            .contains("line 2, column 12: \"32\" is not a board number")
    );
    assert!(
        refused("boards:\n  - board: 1\n    program_id: any\n")
            .contains("line 2, column 5: board 1: flash_number and name are missing")
    );
    assert!(refused("boards:\n  - board: 1\n    name: x\n").contains("program_id is missing"));
    assert!(
        refused("boards:\n  - board: 1\n    flash_number: 0x12345\n")
            .contains("line 3, column 19: \"0x12345\" is not a valid flash number")
    );
    let twice =
        "boards:\n  - {board: 1, name: a, program_id: any}\n  - {board: 1, name: b, program_id: any}\n";
    assert!(refused(twice).contains("line 3, column 5: board 1 has two entries, the first one in line 2"));
    let of = |par: &str| {
        refused(&format!("boards:\n  - board: 1\n    name: x\n    program_id: any\n    par:\n      {par}\n"))
    };
    assert!(of("kp: abc").contains("line 6, column 11: board 1, `kp`: \"abc\" is not a value"));
    assert!(of("kp: 0x10000").contains("not a 16-bit word"));
    assert!(of("kp: ~").contains("line 6") && of("kp:").contains("line 6"), "{}", of("kp:"));
    assert!(of("kp: 1\n      kp: 2").contains("line 7"), "{}", of("kp: 1\n      kp: 2"));
    let message = of("kp: 1\n      kp: 2");
    assert!(message.contains("`kp` has two entries") && !message.contains("Policy"), "{message}");
    let message = of("kp: [1, 2]");
    assert!(message.contains("line 6, column 11: ") && message.contains("one value"), "{message}");
    let message = refused("boards: []\n---\nboards: []\n");
    assert!(message.contains("line 2") || message.contains("line 3"), "{message}");
    assert!(message.contains("second document") && !message.contains("from_"), "{message}");
    assert!(refused("boards:\n  - bord: 1\n").contains("line 2"));
    assert!(refused("boards: 3\n").contains("line 1"), "{}", refused("boards: 3\n"));
    assert!(refused("# nothing").contains("the file is empty"), "{}", refused("# nothing"));
    assert!(refused("boards: [\n").contains("line"));
}

fn saved() -> SavedBoard {
    let signals = signals();
    let all = |kind: Kind, words: &[Option<u16>]| {
        let signals = signals.all(kind).iter().cloned().zip(words);
        signals.map(|(signal, word)| SavedSignal { signal, word: *word, remark: "once".into() }).collect()
    };
    SavedBoard {
        number: 1,
        flash_number: 0x21,
        name: "neck: \"yaw\"".into(),
        program_id: 0x1234,
        description: description(),
        par: all(Kind::Par, &[Some(120), None, Some(0x8001)]),
        ci: all(Kind::Ci, &[None]),
    }
}

/// D-35: a saved file contains a signal without a requested value only as a comment.
#[test]
fn d35_a_saved_file_has_no_value_that_nobody_wanted() {
    let text = params_text(&[saved()]);
    let file = ParamsFile::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let board = file.board(1).unwrap();
    assert_eq!(board.name.as_deref(), Some("neck: \"yaw\""));
    let (ci, par) = check_board(board, &description(), &signals()).unwrap();
    assert!(ci.is_empty());
    assert_eq!(par.iter().map(|w| (w.index, w.word)).collect::<Vec<_>>(), [(0, 120), (2, 0x8001)]);
    assert!(text.contains("# current_max:  # 0.000..2.000 A; once"), "{text}");
    assert!(text.contains(" kp: 0x0078   # 120; -32768..32767; once"), "{text}");
    assert_eq!(ParamsFile::parse(&params_text(&[])).unwrap(), ParamsFile::default());
}

/// D-11, D-35: a parameter file is saved with one signal table, and read with another signal table or without a
/// table. Each value in the file results in the saved word or in an error, never in another word.
#[test]
fn d11_a_saved_file_never_changes_its_meaning_with_the_table() {
    let description = IoDescription { par: texts(&["kd"]), ..Default::default() };
    let profile = Profile::default();
    let tables = [
        "",
        "{ scale = 0.1 }",
        "{ scale = 0.01, unit = \"deg\" }",
        "{ scale = 0.1, unit = \"A: #x\" }",
        "{ type = \"hex\" }",
        "{}",
    ];
    let signals = tables.map(|signal| {
        let table = format!("[[program]]\nprogram_id = 7\npar.kd = {signal}\n");
        let table =
            if signal.is_empty() { SignalTable::default() } else { SignalTable::parse(&table).unwrap() };
        BoardSignals::new(&description, table.program(7), &profile)
    });
    for (i, saved) in signals.iter().enumerate() {
        for word in [4_u16, 0xFFFE, 0x7FFF, 0x8000] {
            let signal = saved.get(Kind::Par, 0).unwrap().clone();
            let par = vec![SavedSignal { signal, word: Some(word), remark: String::new() }];
            let description = description.clone();
            let board = SavedBoard { number: 1, program_id: 7, description, par, ..Default::default() };
            let text = params_text(&[board]);
            let file = ParamsFile::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
            for (k, signals) in signals.iter().enumerate() {
                match check_board(&file.boards[0], &file_names(), signals) {
                    Ok((_, par)) => assert_eq!(par[0].word, word, "{text}, table {k}"),
                    Err(e) => assert!(i != k, "{e:?}: {text}"),
                }
            }
        }
    }
}

fn file_names() -> IoDescription {
    IoDescription { par: texts(&["kd"]), ..Default::default() }
}

fn names() -> impl Strategy<Value = Vec<String>> {
    let name = prop_oneof![
        any::<String>(),
        "[a-c]{1,2}( \\[[a-z/]{1,4}\\])?",
        prop::sample::select(texts(&[
            "", "yes", "~", "0", "#1", "a: b", "- x", "? y", "\"", "x # y", "é\u{85}"
        ]))
    ];
    prop::collection::vec(name, 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

    /// For any parameter names, a saved file is read back as equal words at equal positions.
    #[test]
    fn a_saved_file_gives_the_same_words(par in names(), words in prop::collection::vec(any::<Option<u16>>(), 8), kind in 0..4_usize, text in any::<String>()) {
        let description = IoDescription { description: text.clone(), par, ..Default::default() };
        let kind = [SignalType::Int16, SignalType::Uint16, SignalType::Hex, SignalType::Bool][kind];
        let signal = Signal { kind, known: true, ..Signal::bare(&Profile::default()) };
        let value = |w: &Option<u16>| w.map(|w| if kind == SignalType::Bool { w & 1 } else { w });
        let par: Vec<_> = description.par.iter().zip(&words).map(|(_, w)| SavedSignal { signal: signal.clone(), word: value(w), remark: text.clone() }).collect();
        let board = SavedBoard { number: 3, flash_number: 9, name: text, program_id: 7, description: description.clone(), par: par.clone(), ci: Vec::new() };
        let written = params_text(&[board]);
        let file = ParamsFile::parse(&written).map_err(|e| TestCaseError::fail(format!("{e}\n{written}")))?;
        let mut signals = BoardSignals::new(&description, None, &Profile::default());
        signals.replace_par(signal);
        let (_, words) = check_board(file.board(3).unwrap(), &description, &signals).map_err(|e| TestCaseError::fail(format!("{e:?}\n{written}")))?;
        let got: Vec<_> = words.iter().map(|w| (usize::from(w.index), w.word)).collect();
        let wanted: Vec<_> = par.iter().enumerate().filter_map(|(i, s)| Some((i, s.word?))).collect();
        prop_assert_eq!(got, wanted, "{}", written);
    }

    #[test]
    fn any_text_is_a_file_or_an_error(text in any::<String>()) {
        let _ = ParamsFile::parse(&text);
    }
}
