//! Conversion of boards to text and JSON. All `ucom` commands use the same format for boards.

use cli_kit::table;
use serde_json::{Value, json};
use ucom::{BoardInfo, Profile, Status};
use ucom_host::date_text;
use ucom_host::master::{BoardSeen, state_name};

/// Returns the names of the status bits that are set.
pub(crate) fn bits(status: Status) -> Vec<&'static str> {
    Status::NAMES.iter().filter(|(_, bit)| status.has(*bit)).map(|(name, _)| *name).collect()
}

/// Returns the values of DSP_INFO in the format for `--json`.
pub(crate) fn info_value(number: u8, info: &BoardInfo, profile: &Profile) -> Value {
    let application = info.has_application();
    json!({
        "number": number,
        "flash_number": info.flash_number,
        "status": bits(info.status),
        "status_byte": info.status.0,
        "state": state_name(info.status),
        "application": application,
        "program_id": application.then_some(info.program_id),
        "flash_date": application.then(|| date_text(profile, info.date)),
    })
}

/// Returns a board and its description in the format for `--json`.
pub(crate) fn board_value(board: &BoardSeen, profile: &Profile) -> Value {
    let mut value = info_value(board.number, &board.info, profile);
    value["description"] = json!(board.description);
    value
}

/// Returns boards as a table of text.
pub(crate) fn board_table(boards: &[BoardSeen], profile: &Profile) -> String {
    let row = |b: &BoardSeen| {
        let (program, day) = match b.info.has_application() {
            true => (format!("0x{:04X}", b.info.program_id), date_text(profile, b.info.date)),
            false => ("none".into(), "-".into()),
        };
        vec![
            b.number.to_string(),
            format!("0x{:04X}", b.info.flash_number),
            state_name(b.info.status).into(),
            program,
            day,
            bits(b.info.status).join(" "),
            b.description.clone().unwrap_or_else(|| "?".into()),
        ]
    };
    let rows: Vec<Vec<String>> = boards.iter().map(row).collect();
    table(&[">board", "flash id", "state", "program", "flashed", "status", "description"], &rows)
}
