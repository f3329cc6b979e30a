//! `ucom conformance`: the acceptance tests of the board side, against boards that are there.

use cli_kit::Output;
use serde_json::json;
use ucom::files::{Image, ImageOptions};
use ucom::master::conformance::{ConformanceOptions, ConformanceTest, Verdict, test_names};
use ucom::master::{Outcome, Request};

use crate::args::{Boards, ConformanceArgs, LinkArgs};
use crate::driver::{Driver, unexpected};
use crate::failure::{DEVICE, Failure};

/// 2026-01-01 as a FAT date: what a test programs has a date of its own, and none of the boards' own time.
const DATE: u16 = 0x5C21;

/// Runs the tests that are allowed and says how each ended.
pub fn conformance(args: &ConformanceArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if let Some(wrong) = args.only.iter().find(|o| !test_names().any(|id| id.eq_ignore_ascii_case(o))) {
        let all: Vec<&str> = test_names().collect();
        return Err(Failure::usage(format!("there is no test {wrong}; there are {}", all.join(" "))));
    }
    let program = match &args.program {
        Some(path) => {
            let image = Image::read(path, &ImageOptions::default()).map_err(Failure::usage)?;
            Some((image.bytes().to_vec(), DATE))
        }
        None => None,
    };
    let mut driver = Driver::open(link, out)?;
    let boards = driver.numbers(&args.boards)?;
    let all = args.boards == Boards::All;
    if args.init && !all {
        return Err(Failure::usage("--init numbers the whole chain: it goes with all boards only"));
    }
    let options = ConformanceOptions {
        boards,
        init: args.init,
        run: args.run,
        program,
        only: args.only.clone(),
        force: args.force.force,
    };
    let report = match driver.run(Request::Conformance(options))? {
        Outcome::Conformance(report) => report,
        other => return Err(unexpected(&other)),
    };
    driver.master.end_session();
    let (passed, failed) = (report.passed(), report.failed());
    let skipped = report.tests.len() - passed - failed;
    let value = json!({ "passed": passed, "failed": failed, "skipped": skipped, "tests": report.tests });
    out.result(&value, || {
        let lines: String = report.tests.iter().map(line).collect();
        format!("{lines}{passed} passed, {failed} failed, {skipped} skipped\n")
    });
    if failed > 0 { Err(Failure::printed(DEVICE)) } else { Ok(()) }
}

fn line(test: &ConformanceTest) -> String {
    let who = test.board.map_or_else(|| "chain".into(), |n| format!("board {n}"));
    let head = |mark: &str| format!("{mark} {:6} {who:9} {}\n", test.id, test.expected);
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
                    "    came: {came}\n    sent: {}\n    all that came: {}\n",
                    tail(&test.sent),
                    tail(&test.came)
                )
        }
    }
}
