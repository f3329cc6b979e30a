//! Tables of docs/modbus.md, which are generated from the tables in the code.
use std::fmt::Write as _;

use jtc_host::held_stop;
use jtc_wire::StopKind;
use jtc_wire::words::{JOINT_INTERNAL, JTC_ERRORS};

use super::codes::{Command, ERRORS, OTHER_ERROR, Outcome};
use super::map::{COILS, DISCRETE_INPUTS, HOLDINGS, INPUTS, VERSION};

/// Returns all tables of the page as Markdown.
pub fn tables() -> String {
    let mut page = format!("Version {VERSION} of the map.\n\n");
    let mut table = |title: &str, head: &[&str], rows: Vec<Vec<String>>| {
        let _ = writeln!(page, "### {title}\n\n| {} |\n|{}", head.join(" | "), "---|".repeat(head.len()));
        for row in rows {
            let _ = writeln!(page, "| {} |", row.join(" | "));
        }
        page.push('\n');
    };
    let inputs = INPUTS.iter().map(|row| {
        let each = row.form.words();
        let last = row.at + row.count * each - 1;
        let at = if last == row.at { row.at.to_string() } else { format!("{} to {last}", row.at) };
        let form = if row.count == 1 {
            row.form.name().into()
        } else {
            format!("{} × {}", row.count, row.form.name())
        };
        vec![at, format!("`{}`", row.name), form, row.meaning.into()]
    });
    table("Input registers (function 4)", &["address", "name", "form", "meaning"], inputs.collect());
    for (name, list) in [("errors", &JTC_ERRORS[..]), ("joint_errors", &JOINT_INTERNAL)] {
        let named = list.iter().enumerate().filter(|(_, name)| !name.is_empty());
        let rows = named.map(|(bit, name)| vec![format!("{:#06x}", 1 << bit), (*name).into()]);
        table(&format!("Bits of `{name}`"), &["bit", "error"], rows.collect());
    }
    let causes = StopKind::ALL.iter().map(|kind| {
        let meaning = held_stop::page(*kind).map_or("", |page| page.meaning);
        let unit = if kind.unit().is_empty() { "–" } else { kind.unit() };
        vec![(*kind as u8).to_string(), kind.name().into(), unit.into(), meaning.into()]
    });
    let head = ["`held_stop_cause`", "cause", "unit", "meaning"];
    table("Causes of a held stop", &head, causes.collect());
    let bits =
        |(at, name, meaning): (usize, &str, &str)| vec![at.to_string(), format!("`{name}`"), meaning.into()];
    let discrete = DISCRETE_INPUTS.iter().enumerate().map(|(at, row)| bits((at, row.name, row.meaning)));
    table("Discrete inputs (function 2)", &["address", "name", "1 when"], discrete.collect());
    let holdings = HOLDINGS.iter().enumerate().map(|(at, row)| {
        let (low, high) = row.range;
        let default = if row.name == "sequence" { "`acknowledged`".into() } else { row.default.to_string() };
        vec![
            at.to_string(),
            format!("`{}`", row.name),
            format!("{low} to {high}"),
            default,
            row.meaning.into(),
        ]
    });
    let head = ["address", "name", "range", "default", "meaning"];
    table("Holding registers (functions 3, 6, 16)", &head, holdings.collect());
    let coils = COILS.iter().enumerate().map(|(at, (name, meaning))| bits((at, name, meaning)));
    table("Coils (functions 1, 5, 15)", &["address", "name", "meaning"], coils.collect());
    let commands = Command::ALL.iter().map(|one| vec![(*one as u16).to_string(), one.text().into()]);
    table("Commands", &["`command`", "action"], commands.collect());
    let results = Outcome::ALL.iter().map(|one| vec![(*one as u16).to_string(), one.text().into()]);
    table("Results", &["`result`", "meaning"], results.collect());
    let errors = ERRORS.iter().map(|(number, code, text)| (*number, format!("`{code}`"), *text));
    let other =
        (OTHER_ERROR, String::new(), "another error: the events and the log of the agent have its text");
    let errors = [(0, String::new(), "none")].into_iter().chain(errors).chain([other]);
    let errors = errors.map(|(number, code, text)| vec![number.to_string(), code, text.into()]);
    table("Errors", &["number", "code in the API", "meaning"], errors.collect());
    page
}
