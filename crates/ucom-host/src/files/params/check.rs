//! Checks a parameter file against the boards on the bus. The check reports every error with its position before any frame is sent.

use super::{ParamsBoard, ParamsEntry, Place};
use crate::files::signals::{BoardSignals, ValueError};
use crate::master::SignalError;
use crate::master::io::{IoDescription, Kind};
use std::collections::BTreeMap;
use ucom::BoardInfo;

/// Identity of a board on the bus.
#[derive(Clone, Copy, Debug)]
pub struct ParamsTarget<'a> {
    /// Answer of the board to PC_INFO.
    pub info: &'a BoardInfo,
    /// Name of the board in the inventory; `None` if the inventory has no name for the board.
    pub name: Option<&'a str>,
}

/// Word of a signal, converted from a value in a parameter file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamsWord {
    /// Index of the signal in its buffer.
    pub index: u16,
    /// Complete name of the signal as the board reports it.
    pub name: String,
    /// Value as a 16-bit word.
    pub word: u16,
    /// Value in the signal's unit, followed by the unit.
    pub text: String,
    /// Requested value and sent value, such as `0.04 → 0.0`, if the requested value lies between two words; `None` otherwise.
    pub rounded: Option<String>,
}

/// Error in a parameter file.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsProblem {
    /// Position of the error in the file.
    pub place: Place,
    /// Board number.
    pub board: u8,
    /// Kind of the error.
    pub kind: ParamsProblemKind,
}

impl core::fmt::Display for ParamsProblem {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { place, board, kind } = self;
        // The error for an unknown name already begins with the board, so the board is not added again.
        let board = if matches!(kind, ParamsProblemKind::NoSignal(_)) {
            String::new()
        } else {
            format!("board {board}: ")
        };
        write!(f, "{place}: {board}{kind}")
    }
}

/// Kinds of errors in a parameter file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsProblemKind {
    /// No board answers to this number.
    #[error("the board does not answer")]
    Absent,
    /// A board with another flash number has this board number.
    #[error("its flash number is 0x{found:04X}, but the file is for 0x{wanted:04X}")]
    WrongFlash {
        /// Flash number in the file.
        wanted: u16,
        /// Flash number of the board.
        found: u16,
    },
    /// The inventory has another name for the board.
    #[error("the file is for `{wanted}`, but the name in the inventory is {}", found.as_ref().map_or("missing".into(), |f| format!("`{f}`")))]
    WrongName {
        /// Name in the file.
        wanted: String,
        /// Name in the inventory.
        found: Option<String>,
    },
    /// The board has another program than the parameter file expects.
    #[error("its program is {}, but the names in the file belong to 0x{wanted:04X}", found.map_or("missing".into(), |f| format!("0x{f:04X}")))]
    WrongProgram {
        /// Program ID in the file.
        wanted: u16,
        /// Program ID of the board; `None` if the board has no application.
        found: Option<u16>,
    },
    /// No signal of the board has this name.
    #[error("{0}")]
    NoSignal(SignalError),
    /// A signal has two entries in the parameter file.
    #[error("{kind} `{name}` has two entries, the first one in line {first}")]
    Twice {
        /// Kind of the signal, `CI` or `PAR`.
        kind: &'static str,
        /// Name of the signal in the file.
        name: String,
        /// Line of the first entry.
        first: u32,
    },
    /// The value is not valid for the signal.
    #[error("{kind} `{name}`: {problem}")]
    Value {
        /// Kind of the signal, `CI` or `PAR`.
        kind: &'static str,
        /// Name of the signal in the file.
        name: String,
        /// Reason why the value is not valid.
        problem: ValueError,
    },
}

/// Checks that the board and its program agree with the parameter file.
pub fn check_identity(board: &ParamsBoard, target: &ParamsTarget<'_>) -> Vec<ParamsProblem> {
    let mut problems = Vec::new();
    let mut add = |kind| problems.push(ParamsProblem { place: board.place, board: board.number, kind });
    let info = target.info;
    if let Some(wanted) = board.flash_number
        && wanted != info.flash_number
    {
        add(ParamsProblemKind::WrongFlash { wanted, found: info.flash_number });
    }
    if let Some(wanted) = &board.name
        && target.name != Some(wanted)
    {
        add(ParamsProblemKind::WrongName { wanted: wanted.clone(), found: target.name.map(str::to_owned) });
    }
    let found = info.has_application().then_some(info.program_id);
    if let Some(wanted) = board.program_id
        && found != Some(wanted)
    {
        add(ParamsProblemKind::WrongProgram { wanted, found });
    }
    problems
}

/// Returns the words for a board whose description is known: first the words of its inputs, then the words of its
/// parameters. If the entry of the board in the file has errors, the function returns all errors.
pub fn check_board(
    board: &ParamsBoard,
    description: &IoDescription,
    signals: &BoardSignals,
) -> Result<(Vec<ParamsWord>, Vec<ParamsWord>), Vec<ParamsProblem>> {
    let mut problems = Vec::new();
    let mut words =
        |kind, entries| check_entries(board.number, kind, entries, description, signals, &mut problems);
    let (ci, par) = (words(Kind::Ci, &board.ci), words(Kind::Par, &board.par));
    if problems.is_empty() { Ok((ci, par)) } else { Err(problems) }
}

fn check_entries(
    board: u8,
    kind: Kind,
    entries: &[ParamsEntry],
    description: &IoDescription,
    signals: &BoardSignals,
    problems: &mut Vec<ParamsProblem>,
) -> Vec<ParamsWord> {
    let mut lines: BTreeMap<u16, u32> = BTreeMap::new();
    let mut words = Vec::new();
    for ParamsEntry { name, given, place } in entries {
        let mut add = |problem| problems.push(ParamsProblem { place: *place, board, kind: problem });
        let index = match description.find(board, kind, name) {
            Ok(index) => index,
            Err(e) => {
                add(ParamsProblemKind::NoSignal(e));
                continue;
            }
        };
        if let Some(first) = lines.insert(index, place.line) {
            add(ParamsProblemKind::Twice { kind: kind.name(), name: name.clone(), first });
            continue;
        }
        let Some(signal) = signals.get(kind, index.into()) else { continue };
        match signal.word(given) {
            Ok(word) => words.push(ParamsWord {
                index,
                name: description.names(kind).get(usize::from(index)).cloned().unwrap_or_default(),
                word,
                text: signal.text_with_unit(word),
                rounded: signal.rounded(given, word).map(|sent| format!("{given} → {sent}")),
            }),
            Err(problem) => add(ParamsProblemKind::Value { kind: kind.name(), name: name.clone(), problem }),
        }
    }
    words
}
