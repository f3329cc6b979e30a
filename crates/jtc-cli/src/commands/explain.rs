//! `jtc explain`: prints the page about a code or about fault files.

use cli_kit::{Failure, Output, table};
use jtc_host::explain::{Page, find, pages};
use serde_json::{Value, json};

use crate::args::ExplainArgs;

/// Prints the pages that match the words of the user, or the list of all pages.
pub(super) fn explain(args: &ExplainArgs, out: &Output) -> Result<(), Failure> {
    let code = &args.code.join(" ");
    if code.is_empty() {
        list(out);
        return Ok(());
    }
    if code == "faults" {
        let text = jtc_sim::FAULT_FILE_HELP;
        out.result(&json!({ "text": text }), || text.trim_end().to_owned());
        return Ok(());
    }
    let found = find(code);
    if found.is_empty() {
        return Err(Failure::usage(format!("no page explains \"{code}\"")).next(
            "`jtc explain` lists every code; a number can have its family in front, for example data:7 or \
             can:0x100",
        ));
    }
    let value = json!({ "pages": found.iter().map(|p| as_json(p)).collect::<Vec<_>>() });
    out.result(&value, || found.iter().map(|p| format!("{p}\n")).collect::<Vec<_>>().join("\n"));
    Ok(())
}

fn as_json(page: &Page) -> Value {
    let mut value = serde_json::to_value(page).unwrap_or_default();
    value["number"] = page.number().into();
    value
}

fn list(out: &Output) {
    let value = json!({ "pages": pages().map(as_json).collect::<Vec<_>>() });
    out.result(&value, || {
        let row = |p: &Page| {
            let number =
                if p.family.is_bits() { format!("0x{:02X}", p.number()) } else { p.code.to_string() };
            vec![p.name.to_owned(), format!("{}:{number}", p.family.key())]
        };
        let rows: Vec<Vec<String>> = pages().map(row).collect();
        format!(
            "{}\njtc explain CODE shows the meaning of a code, its cause and the remedy",
            table(&["name", ">code"], &rows)
        )
    });
}
