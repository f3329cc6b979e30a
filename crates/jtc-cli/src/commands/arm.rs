//! `jtc arm`: commands for arm files and for the arm of a controller.

mod device;
mod import;
mod show;

use std::path::Path;

use cli_kit::{ErrorKind, Failure, Output};
use host_kit::FrontEnd;
use jtc_host::arm::{Arm, ArmFinding};
use jtc_host::doctor::Finding;
use serde_json::json;

use crate::args::ArmCommand;
pub(super) use show::poses as poses_table;

/// Runs a `jtc arm` command.
pub(super) fn arm(command: &ArmCommand, out: &Output) -> Result<(), Failure> {
    match command {
        ArmCommand::Import(args) => import::import(args, out),
        ArmCommand::Check { file } => check(file, out),
        ArmCommand::Show { file: Some(file), deg, .. } => {
            show::show(&Arm::load_unchecked(file)?, &file.display().to_string(), *deg, out)
        }
        ArmCommand::Show { file: None, deg, link } => {
            show::show(&link.session()?.device_arm()?, "the controller", *deg, out)
        }
        ArmCommand::Push { file, store, accept, link } => device::push(file, *store, *accept, link, out),
        ArmCommand::Pull { out: file, overwrite, link } => device::pull(file, *overwrite, link, out),
        ArmCommand::Diff { file, link } => device::diff(file, link, out),
    }
}

fn check(file: &Path, out: &Output) -> Result<(), Failure> {
    let arm = Arm::load_unchecked(file)?;
    let checked = arm.check();
    let refused = checked.is_refused();
    let name = file.display();
    let value = json!({
        "file": name.to_string(),
        "arm": arm.name,
        "ok": !refused,
        "findings": checked.findings,
        "holding": checked.holding,
        "rotor_margins": checked.rotor_margins,
    });
    out.result(&value, || {
        format!("{name}: arm {}\n{}", arm.name, as_text(&checked.findings))
            + if refused {
                "refused: a controller does not accept this arm"
            } else {
                "a controller accepts this arm"
            }
    });
    if refused { Err(Failure::shown(ErrorKind::Refused)) } else { Ok(()) }
}

/// Formats each finding as a line. If several findings suggest the same next step, the next step is printed once, after the last of
/// these findings.
fn as_text(findings: &[ArmFinding]) -> String {
    let mut text = String::new();
    for (i, f) in findings.iter().enumerate() {
        let Finding { severity, what, why, next } = &f.finding;
        text += &format!("{} {what}{}{why}\n", severity.mark(), if why.is_empty() { "" } else { ": " });
        let same = findings.get(i + 1).is_some_and(|after| &after.finding.next == next);
        if !next.is_empty() && !same {
            text += &format!("    next: {}\n", next.plain(FrontEnd::Command));
        }
    }
    text
}
