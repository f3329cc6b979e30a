//! Boards as text and as JSON, alike for all commands.

use cli_kit::table;
use serde_json::{Value, json};
use ucom::{BoardInfo, Profile, Status};
use ucom_host::date_text;
use ucom_host::master::{Board, BoardSeen, Life};

/// The names of the bits that are set.
pub fn bits(status: Status) -> Vec<&'static str> {
    Status::NAMES.iter().filter(|(_, bit)| status.has(*bit)).map(|(name, _)| *name).collect()
}

/// What a board does, in one word.
pub fn state(status: Status) -> &'static str {
    if status.has(Status::MCARUN) {
        "running"
    } else if status.has(Status::MSTART) {
        "started"
    } else if status.has(Status::PROG) {
        "programming"
    } else {
        "exloader"
    }
}

/// The numbers of DSP_INFO.
pub fn info_value(number: u8, info: &BoardInfo, profile: &Profile) -> Value {
    let application = info.has_application();
    json!({
        "number": number,
        "flash_number": info.flash_number,
        "status": bits(info.status),
        "status_byte": info.status.0,
        "state": state(info.status),
        "application": application,
        "program_id": application.then_some(info.program_id),
        "flash_date": application.then(|| date_text(profile, info.date)),
    })
}

/// A board with its description.
pub fn board_value(board: &BoardSeen, profile: &Profile) -> Value {
    let mut value = info_value(board.number, &board.info, profile);
    value["description"] = json!(board.description);
    value
}

/// Boards as a table.
pub fn board_table(boards: &[BoardSeen], profile: &Profile) -> String {
    let row = |b: &BoardSeen| {
        let (program, day) = match b.info.has_application() {
            true => (format!("0x{:04X}", b.info.program_id), date_text(profile, b.info.date)),
            false => ("none".into(), "-".into()),
        };
        vec![
            b.number.to_string(),
            format!("0x{:04X}", b.info.flash_number),
            state(b.info.status).into(),
            program,
            day,
            bits(b.info.status).join(" "),
            b.description.clone().unwrap_or_else(|| "?".into()),
        ]
    };
    let rows: Vec<Vec<String>> = boards.iter().map(row).collect();
    table(&[">board", "flash id", "state", "program", "flashed", "status", "description"], &rows)
}

/// What was last received of a board still holds: it is not lost, and has not begun anew.
pub fn is_known(board: &Board) -> bool {
    board.life != Life::Lost && !board.rebooted
}

/// What a board does, in one word: what comes by itself counts more than an old answer.
pub fn doing(board: &Board, now_us: u64) -> &'static str {
    if board.rebooted {
        return "rebooted";
    }
    if board.life == Life::Lost {
        return "lost";
    }
    if board.running(now_us) {
        return "running";
    }
    match (board.life, board.status()) {
        (Life::Alive, _) => "started",
        (_, Some(status)) => state(status),
        (_, None) => "?",
    }
}

/// Heartbeats in a word.
pub fn life(board: &Board) -> &'static str {
    match board.life {
        Life::Unarmed => "-",
        Life::Alive => "alive",
        Life::Late => "late",
        Life::Lost => "lost",
    }
}

/// Since the last heartbeat, s.
pub fn age_s(board: &Board, now_us: u64) -> Option<f64> {
    board.alive_at.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
}
