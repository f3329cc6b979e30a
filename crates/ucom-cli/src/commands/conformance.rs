//! Command `ucom conformance`: runs the acceptance tests on the connected boards.

use std::path::Path;

use cli_kit::{Diagnose, Failure, Output};
use serde_json::json;
use ucom::Profile;
use ucom_host::files::inventory::flash_number_of;
use ucom_host::files::{Image, ImageOptions};
use ucom_host::master::conformance::{
    ConformanceOptions, ConformanceProgram, ConformanceReport, ConformanceTest, Verdict, test_names,
};
use ucom_host::master::{Error, Outcome, Request, RunningError};
use ucom_host::session::SessionError;

use crate::args::{Boards, ConformanceArgs, LinkArgs};

/// Returns the date of the test programs, 2026-01-01, which differs from the dates of the programs on the boards.
fn date(profile: &Profile) -> u16 {
    // If the profile treats the date as a plain number, any number is valid.
    profile.prog_date.encode(2026, 1, 1).unwrap_or(0x5C21)
}

/// Runs the acceptance tests that the options allow, and shows their results.
pub(crate) fn conformance(args: &ConformanceArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if let Some(wrong) = args.only.iter().find(|o| !test_names().any(|id| id.eq_ignore_ascii_case(o))) {
        let all: Vec<&str> = test_names().collect();
        return Err(Failure::usage(format!("unknown test {wrong}, expected one of {}", all.join(" "))));
    }
    if args.init && args.boards != Boards::All {
        return Err(Failure::usage("--init numbers the whole chain and needs `all` as the boards"));
    }
    let profile = link.profile()?;
    let program = match &args.program {
        Some(path) => Some(program(args, path, date(&profile), out)?),
        None => None,
    };
    let mut driver = link.session_with(profile)?;
    let boards = driver.numbers(&args.boards)?;
    let options = ConformanceOptions {
        boards,
        init: args.init,
        run: args.run,
        program,
        only: args.only.clone(),
        force: args.force,
    };
    let outcome = driver.run(Request::Conformance(options)).map_err(|e| match e {
        SessionError::Procedure(Error::Running(
            RunningError::Running { .. } | RunningError::LoopRuns { .. },
        )) => Failure::from(e).next("`ucom stop all` first; --force does not override this check"),
        e => e.into(),
    });
    let report = match outcome? {
        Outcome::Conformance(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    driver.master.end_session();
    print(&report, out);
    match report.failure() {
        None => Ok(()),
        Some(kind) => Err(Failure::shown(kind)),
    }
}

/// Checks that the board is the intended board, and returns the test image for this board.
fn program(
    args: &ConformanceArgs,
    path: &Path,
    date: u16,
    out: &Output,
) -> Result<ConformanceProgram, Failure> {
    let board = match &args.boards {
        Boards::Some(numbers) if numbers.len() == 1 => numbers.first().copied().unwrap_or_default(),
        _ => {
            return Err(Failure::usage(
                "--program IMAGE programs one board, but no single board is selected",
            )
            .next("ucom conformance 1 --flash-id 0x21 --program IMAGE"));
        }
    };
    let flash_number = match args.flash_id {
        Some(flash) => flash,
        None => flash_number_of(&args.inventory, board)?,
    };
    let image = Image::read(path, &ImageOptions::default())
        .map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
    for note in image.notes() {
        out.note(format!("note: {}: {note}", path.display()));
    }
    Ok(ConformanceProgram { board, flash_number, image: image.into(), date })
}

fn print(report: &ConformanceReport, out: &Output) {
    let (passed, failed) = (report.passed(), report.failed());
    let skipped = report.skipped();
    let ended = report.error.as_ref().map(|e| json!({ "code": e.code(), "message": e.to_string() }));
    let value = json!({
        "passed": passed, "failed": failed, "skipped": skipped,
        "ended": ended, "left": report.left, "tests": report.tests,
    });
    out.result(&value, || {
        let mut text: String = report.tests.iter().filter(|t| t.needs.is_none()).map(line).collect();
        for (option, ids) in report.not_allowed() {
            text += &format!("- not allowed without {option}: {}\n", ids.join(", "));
        }
        if let Some(error) = &report.error {
            text += &format!("ended before the last test: {error}\n");
        }
        for left in &report.left {
            text += &format!("not restored: {left}\n");
        }
        text + &format!("{passed} passed, {failed} failed, {skipped} skipped\n")
    });
}

fn line(test: &ConformanceTest) -> String {
    let head = |mark: &str| format!("{mark} {:6} {:9} {}\n", test.id, test.subject(), test.expected);
    match &test.verdict {
        Verdict::Pass => head("✓"),
        Verdict::Skipped(why) => head("-") + &format!("    skipped: {why}\n"),
        Verdict::Fail(came) => {
            let tail = |frames: &[String]| {
                let from = frames.len().saturating_sub(12);
                frames.get(from..).unwrap_or_default().join(" ")
            };
            head("✗")
                + &format!(
                    "    result: {came}\n    sent: {}\n    received: {}\n",
                    tail(&test.sent),
                    tail(&test.came)
                )
        }
    }
}
