//! Commands for the chain of boards, `ucom scan` and `init`: they find the connected boards and
//! assign their numbers.

use cli_kit::{ErrorKind, Failure, Output, OutputFile, error_object};
use serde_json::json;
use ucom_host::files::Inventory;
use ucom_host::master::{InitOptions, Outcome, Request, ScanFinding, counted};
use ucom_host::session::{SessionError, nothing_shared};

use crate::args::{InitArgs, LinkArgs};
use crate::shape::{board_table, board_value};

/// Lists the connected boards without changing them.
pub(super) fn scan(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let report = match driver.run(Request::Scan)? {
        Outcome::Scan(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    let mut value = json!({
        "reports": report.reports.ids,
        "boards": report.boards.iter().map(|b| board_value(b, &profile)).collect::<Vec<_>>(),
        "findings": texts(&report.findings),
    });
    let shared = nothing_shared(&driver.master).err().map(Failure::from);
    if let Some(f) = &shared {
        value["error"] = error_object(f);
    }
    if report.boards.is_empty() && report.reports.ids.is_empty() {
        let failure = Failure::new(ErrorKind::NoLink, "no-boards", "no board answers")
            .next("find the cause with ucom doctor");
        return Err(failure);
    }
    out.result(&value, || {
        let mut text = String::new();
        if !report.boards.is_empty() {
            text += &board_table(&report.boards, &profile);
        }
        let (numbered, there) = (report.boards.len(), report.reports.ids.len());
        let are = if there == 1 { "is" } else { "are" };
        text += &format!("{} {are} connected, {numbered} with a number\n", counted(there, "board"));
        let unnumbered = report.findings.iter().filter(|f| is_unnumbered(f)).count();
        if unnumbered > 0 {
            text += &format!("without a number: {}\nnext: ucom init\n", unnumbered_ids(&report.findings));
        }
        // The command reports boards without a number, and errors, elsewhere in its output, so this list omits them.
        let reported = |f: &&ScanFinding| is_unnumbered(f) || f.error().is_some();
        text + &lines(&report.findings.iter().filter(|f| !reported(f)).collect::<Vec<_>>())
    });
    match shared {
        // The result on stdout already contains the failure, so only a note is printed.
        Some(failure) => {
            out.note(format!("{}\n  {}", failure.message, failure.next));
            Err(Failure::shown(failure.kind))
        }
        None => Ok(()),
    }
}

fn is_unnumbered(finding: &ScanFinding) -> bool {
    matches!(finding, ScanFinding::Unnumbered { .. })
}

fn unnumbered_ids(findings: &[ScanFinding]) -> String {
    let id = |finding: &ScanFinding| match finding {
        ScanFinding::Unnumbered { ucom_id } => Some(format!("0x{ucom_id:02X}")),
        _ => None,
    };
    findings.iter().filter_map(id).collect::<Vec<_>>().join(" ")
}

fn texts(findings: &[impl ToString]) -> Vec<String> {
    findings.iter().map(ToString::to_string).collect()
}

fn lines(findings: &[impl ToString]) -> String {
    texts(findings).iter().map(|text| format!("! {text}\n")).collect()
}

/// Resets the whole chain, assigns board numbers, and writes an inventory.
pub(super) fn init(args: &InitArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let known = match args.inventory.exists() {
        true => Some(Inventory::read(&args.inventory).map_err(Failure::usage)?),
        false => None,
    };
    let compared = known.as_ref().filter(|_| !args.renew);
    let expected =
        compared.map(|i| i.boards().map(|b| (b.number, b.flash_number)).collect()).unwrap_or_default();
    // The command checks that it can write the file before the chain gets new numbers.
    let file = OutputFile::open(&args.inventory, true, &[]).map_err(Failure::nothing_sent)?;
    let mut driver = link.session()?;
    let profile = driver.master.profile();
    let options = InitOptions { expected, force: args.force.force };
    let report = match driver.run(Request::Init(options))? {
        Outcome::Init(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    let written = report.is_ok();
    if written {
        let made = Inventory::of_init(&report, known.as_ref()).map_err(Failure::usage)?;
        made.write(&args.inventory).map_err(Failure::usage)?;
    }
    let name = file.name();
    if written {
        file.is_written();
    }
    let value = json!({
        "ok": report.is_ok(),
        "boards": report.boards.iter().map(|b| board_value(b, &profile)).collect::<Vec<_>>(),
        "reports": report.reports.ids,
        "findings": texts(&report.findings),
        "inventory": written.then_some(&name),
    });
    out.result(&value, || {
        let end = match (written, report.boards.len()) {
            (true, n) => format!("{} numbered; inventory: {name}\n", counted(n, "board")),
            (false, n) => format!("{} numbered; the inventory {name} was not changed\n", counted(n, "board")),
        };
        let renew = match compared {
            Some(_) if !written => "if you changed the chain: ucom init --renew\n",
            _ => "",
        };
        board_table(&report.boards, &profile) + &lines(&report.findings) + &end + renew
    });
    match report.failure() {
        None => Ok(()),
        Some(kind) => Err(Failure::shown(kind)),
    }
}
