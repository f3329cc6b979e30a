//! Conversion of boards and findings to JSON, with the field names of the dataclasses of `openjtc.ucom`.

use serde_json::{Value, json};
use ucom::{BoardInfo, Profile, Status};
use ucom_host::date_text;
use ucom_host::files::{Inventory, Signal, SignalType};
use ucom_host::master::io::{Kind, ParValue, short};
use ucom_host::master::{BoardSeen, Master, state_name};
use ucom_host::session::{Known, name_of};

/// Converts the number of a board and its answer to the request PC_INFO.
pub(super) fn info(number: u8, info: &BoardInfo, profile: &Profile, inventory: Option<&Inventory>) -> Value {
    let application = info.has_application();
    let status: Vec<&str> =
        Status::NAMES.iter().filter(|(_, bit)| info.status.has(*bit)).map(|(name, _)| *name).collect();
    json!({
        "number": number,
        "name": name_of(inventory, info.flash_number).unwrap_or_default(),
        "flash_number": info.flash_number,
        "state": state_name(info.status),
        "status": status,
        "program_id": application.then_some(info.program_id),
        "flash_date": application.then(|| date_text(profile, info.date)),
        "description": "",
    })
}

/// Like [`info`], but includes the description of the board.
pub(super) fn board(seen: &BoardSeen, profile: &Profile, inventory: Option<&Inventory>) -> Value {
    let mut value = info(seen.number, &seen.info, profile, inventory);
    value["description"] = json!(seen.description.as_deref().unwrap_or_default());
    value
}

/// Converts several boards.
pub(super) fn boards(seen: &[BoardSeen], profile: &Profile, inventory: Option<&Inventory>) -> Value {
    seen.iter().map(|one| board(one, profile, inventory)).collect()
}

/// Returns the findings as text. Commands in the text have the form in which a user types them.
pub(super) fn texts(findings: &[impl ToString]) -> Vec<String> {
    findings.iter().map(|finding| finding.to_string().replace('`', "")).collect()
}

/// Converts all kinds of signals of a board.
pub(super) fn signals(known: &Known) -> Value {
    let of = |kind: Kind| -> Value {
        let pairs = known.names.names(kind).iter().zip(known.signals.all(kind)).enumerate();
        pairs.map(|(index, (text, one))| signal(index, text, one)).collect()
    };
    json!({
        "board": known.board,
        "description": known.names.description,
        "inputs": of(Kind::Ci),
        "outputs": of(Kind::So),
        "parameters": of(Kind::Par),
    })
}

fn signal(index: usize, text: &str, signal: &Signal) -> Value {
    let kind = match signal.kind {
        SignalType::Int16 => "int16",
        SignalType::Uint16 => "uint16",
        SignalType::Hex => "hex",
        SignalType::Bool => "bool",
    };
    let (minimum, maximum) = signal.range();
    json!({
        "name": short(text),
        "text": text,
        "index": index,
        "type": kind,
        "unit": signal.unit,
        "scale": signal.scale,
        "offset": signal.offset,
        "minimum": minimum,
        "maximum": maximum,
        "known": signal.known,
    })
}

/// Converts the words of a buffer to pairs of name and value, in the order of the buffer. The value of an unknown word is
/// null.
pub(super) fn named(known: &Known, kind: Kind, words: &[Option<u16>]) -> Value {
    let pair = |(index, key): (usize, String)| {
        let word = words.get(index).copied().flatten();
        let signal = known.signals.get(kind, index);
        json!([key, signal.zip(word).map(|(signal, word)| signal.json(word))])
    };
    known.keys(kind).into_iter().enumerate().map(pair).collect()
}

/// Like [`named`], for outputs. All words of the outputs are known.
pub(super) fn outputs(known: &Known, words: &[u16]) -> Value {
    named(known, Kind::So, &words.iter().copied().map(Some).collect::<Vec<_>>())
}

/// Returns the inputs of a board and the parameters that this session has written. The inputs are the inputs that were set
/// last, or else the initial inputs of the board.
pub(super) fn settings(known: &Known, master: &Master) -> (Value, Value) {
    let parameter = |value: &ParValue| match value {
        ParValue::Assumed(word) => Some(*word),
        ParValue::Unknown => None,
    };
    let parameters: Vec<_> = master.parameters(known.board).iter().map(parameter).collect();
    (named(known, Kind::Ci, &master.inputs(known.board)), named(known, Kind::Par, &parameters))
}
