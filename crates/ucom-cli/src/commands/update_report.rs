//! Result of a firmware update as text and as JSON.

use std::path::PathBuf;

use cli_kit::{Diagnose, Failure, Output, exit, table};
use serde_json::{Value, json};
use ucom::{BoardInfo, Memory, Profile};
use ucom_host::date_text;
use ucom_host::master::update::{PlannedImage, UpdateOutcome, UpdateReport, UpdateResult, has_header};

/// Prints the report of an update; `names` are the paths of its image files.
pub(super) fn print(report: &UpdateReport, names: &[PathBuf], profile: &Profile, out: &Output) {
    let images = report.images.iter().zip(names);
    let value = json!({
        "dry_run": report.dry_run,
        "program_id": report.program_id,
        "flash_date": has_header(profile).then(|| date_text(profile, report.date)),
        "bytes": report.bytes,
        "images": images.clone().map(|(image, name)| image_value(image, name)).collect::<Vec<_>>(),
        "unverifiable": report.unverifiable.map(|why| json!({ "reason": why.to_string(), "hint": why.hint() })),
        // Most scripts read a single outcome. The field `outcome` contains the outcome of one board, or of several boards
        // if their outcomes are equal.
        "outcome": match report.boards.as_slice() {
            [first, rest @ ..] if rest.iter().all(|b| b.outcome == first.outcome) => json!(first.outcome.name()),
            _ => Value::Null,
        },
        "boards": report.boards.iter().map(|b| result(b, report, profile)).collect::<Vec<_>>(),
        "exit": report.failure().map_or(0, exit::of),
    });
    out.result(&value, || {
        let mut text = String::new();
        if report.dry_run {
            text += "dry run: nothing was changed\n";
        }
        text += &images.map(|(image, name)| image_line(image, name)).collect::<String>();
        if let Some(id) = report.program_id.filter(|_| !report.dry_run) {
            let day = if has_header(profile) {
                format!(", {}", date_text(profile, report.date))
            } else {
                String::new()
            };
            text += &format!("program 0x{id:04X}{day}\n");
        }
        text += &boards(report, profile);
        let failed = report.boards.iter().filter_map(|b| b.failure.as_ref().map(|f| (b.board, f)));
        text += &failed.map(|(board, f)| format!("board {board}: {}\n", f.hint())).collect::<String>();
        text + &unverified(report, profile) + &not_known(report)
    });
}

fn boards(report: &UpdateReport, profile: &Profile) -> String {
    let row = |b: &UpdateResult| {
        let shown = report.shown_already(b, profile);
        let why = b.failure.as_ref().map(ToString::to_string).or(shown).unwrap_or_default();
        let flash = b.flash_number.map_or_else(|| "?".into(), |f| format!("0x{f:04X}"));
        let time = if b.time_us > 0 { format!("{:.1} s", b.time_us as f64 * 1e-6) } else { "-".into() };
        vec![b.board.to_string(), flash, report.outcome_words(b, profile), b.attempts.to_string(), time, why]
    };
    let rows: Vec<Vec<String>> = report.boards.iter().map(row).collect();
    table(&[">board", "flash id", "outcome", ">attempts", ">time", ""], &rows)
}

/// Returns `true` if the update of a board is complete but could not be verified, so that only the answer of the
/// board shows that it is complete.
fn taken_on_trust(b: &UpdateResult, report: &UpdateReport) -> bool {
    let done = matches!(b.outcome, UpdateOutcome::Written | UpdateOutcome::Running);
    report.unverifiable.is_some() && done && b.failure.is_none()
}

/// Returns the next step if only the answer of a board shows which program it has.
fn not_known(report: &UpdateReport) -> String {
    match report.boards.iter().any(|b| b.outcome == UpdateOutcome::ProgramUpToDate) {
        true if report.accept_unverified => "program-up-to-date is accepted, NOT verified\n".into(),
        true => "nothing was sent: a board cannot show load address and content, and the inventory has no \
                 record of this image; write it with --rewrite, or accept it with --unverified\n"
            .into(),
        false => String::new(),
    }
}

/// Returns a text that says which property could not be verified, for what reason, and how the user can verify it.
fn unverified(report: &UpdateReport, profile: &Profile) -> String {
    let Some(why) = report.unverifiable else { return String::new() };
    let line = |b: &UpdateResult| {
        let shown = |info: Option<BoardInfo>| match info {
            Some(i) if i.has_application() => {
                format!("0x{:04X}, {}", i.program_id, date_text(profile, i.date))
            }
            Some(_) => "no application".into(),
            None => "?".into(),
        };
        let same = match changed(b) {
            Some(false) => ": the same program, or nothing was written",
            _ => "",
        };
        let (before, after) = (shown(b.before), shown(b.after));
        format!("board {}: written, NOT verified; PC_INFO before: {before}; now: {after}{same}\n", b.board)
    };
    let lines: String = report.boards.iter().filter(|b| taken_on_trust(b, report)).map(line).collect();
    if lines.is_empty() {
        return lines;
    }
    let accept = if report.accept_unverified {
        ""
    } else {
        "; or accept the program without verification: --unverified"
    };
    format!("{lines}{why};\n{}{accept}\n", why.hint())
}

/// Returns `true` if PC_INFO reports another program after the update than before. Returns `None` if one of the two
/// reports is missing.
fn changed(b: &UpdateResult) -> Option<bool> {
    let program = |info: BoardInfo| (info.program_id, info.date);
    Some(program(b.before?) != program(b.after?))
}

fn memory(image: &PlannedImage) -> Option<&'static str> {
    image.memory.map(|memory| match memory {
        Memory::Program => "program",
        Memory::Data => "data",
        Memory::Ram => "ram",
    })
}

fn image_value(image: &PlannedImage, name: &std::path::Path) -> Value {
    let (first, last) = image.cycles;
    json!({
        "file": name.display().to_string(),
        "cycles": (first..=last).collect::<Vec<u32>>(),
        "memory": memory(image),
        "address_words": image.address_words,
        "bytes": image.bytes,
        "program_id": image.program_id,
    })
}

fn image_line(image: &PlannedImage, name: &std::path::Path) -> String {
    let place = match (memory(image), image.address_words) {
        (Some(memory), Some(address)) => format!(" for {memory} memory at word 0x{address:X}"),
        (Some(memory), None) => format!(" for {memory} memory"),
        (None, _) => String::new(),
    };
    let id = image.program_id.map_or_else(String::new, |id| format!(", Program ID 0x{id:04X}"));
    let cycles = match image.cycles {
        (first, last) if first == last => format!("cycle {first}"),
        _ => "both cycles".into(),
    };
    format!("{}: {} bytes{place}{id}, {cycles}\n", name.display(), image.bytes)
}

fn result(b: &UpdateResult, report: &UpdateReport, profile: &Profile) -> Value {
    let shown = |info: Option<BoardInfo>| {
        info.map(|i| {
            let application = i.has_application();
            json!({
                "program_id": application.then_some(i.program_id),
                "flash_date": application.then(|| date_text(profile, i.date)),
            })
        })
    };
    json!({
        "board": b.board,
        "flash_number": b.flash_number,
        "outcome": b.outcome.name(),
        "note": report.shown_already(b, profile),
        "verified": b.verified,
        "before": shown(b.before),
        "after": shown(b.after),
        "changed": changed(b),
        "attempts": b.attempts,
        "time_s": b.time_us as f64 * 1e-6,
        "error": b.failure.as_ref().map(|f| cli_kit::error_object(&Failure::of(f))),
    })
}
