//! `cargo xtask test`: runs every check of the project. The checks that find an error with the least effort run first.
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::prebuild::Prebuild;
use crate::shell::{self, Scratch, cargo, run};
use crate::tally::{Outcome, Tally};
use crate::{
    book, deny, dependencies, dist, emulate, firmware, links, package, parallel, plain_words, python, rules,
    size, suite, test_files, web, worked_bytes,
};

/// Crates that run on the board.
const BOARD_CRATES: [&str; 5] = ["jtc-dynamics", "jtc-wire", "jtc-bus", "jtc-core", "ucom"];
/// Largest permitted tracking error of each joint in the demo, mrad RMS.
const RMS_LIMIT_MRAD: f64 = 2.0;

/// Runs `cargo xtask test`. `arguments` may contain `--quick` and `--only TEXT`.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let quick = shell::flag(&mut arguments, "--quick");
    let only = shell::option(&mut arguments, "--only")?;
    shell::nothing_left(&arguments)?;

    let before = tree();
    let prebuild = (!quick && only.is_none()).then(Prebuild::begin);
    let built = || prebuild.iter().for_each(Prebuild::workspace_is_built);
    let mut tally = Tally::new(only);
    tally.step("formatting", || passed(run(&mut cargo(&["fmt", "--all", "--", "--check"]))));
    tally.step("every rule has a test that names it", || passed(rules::check()));
    tally.step("every file with tests is in a program", || passed(test_files::check()));
    tally.step("worked bytes of the protocol page", || passed(worked_bytes::check()));
    tally.step("plain words", || passed(plain_words::check()));
    tally.step("links between documents", || passed(links::check()));
    tally.step("the book has every page", || passed(book::check()));
    tally.step("every dependency is documented", || passed(dependencies::check()));
    tally.step("licences, sources and bans of dependencies", || passed(deny::check()));
    tally.step("lints, and the build of all programs", || passed(suite::lints()));
    web::steps(&mut tally);
    tally.step("tests, properties and fuzz regressions", || suite::run(built));
    if !quick {
        tally.step("builds for the board (no_std)", || passed(board_builds()));
        tally.step("memory of the controller", || passed(size::check()));
        tally.step("documentation", || {
            let mut doc = cargo(&["doc", "--release", "--workspace", "--no-deps"]);
            passed(run(doc.env("RUSTDOCFLAGS", "-D warnings")))
        });
        // Waits for the builds in the background, because the next steps run their programs.
        drop(prebuild);
        tally.step("book: made, every link leads somewhere", || passed(book::made()));
        let scratch = Scratch::new("demo")?;
        tally.step("demo", || passed(demo(scratch.path())));
        let references = python::checks(&mut tally, scratch.path());
        // The check that takes longest is first in the list. The other checks run in parallel while it waits for
        // simulated arms and browsers.
        let all = [web::browser()].into_iter().chain(references);
        parallel::steps(&mut tally, all.collect());
        package::steps(&mut tally);
        emulate::steps(&mut tally, false);
        dist::steps(&mut tally);
    }
    tally.step("the working tree is as it was", || {
        let (Some(before), Some(after)) = (before, tree()) else {
            return Ok(Outcome::Skipped("not a git checkout".into()));
        };
        ensure!(
            before == after,
            "the run left changes behind; `git status` was\n{before}and is now\n{after}"
        );
        Ok(Outcome::Passed)
    });
    Ok(tally.finish())
}

fn passed(result: Result<()>) -> Result<Outcome> {
    result.map(|()| Outcome::Passed)
}

/// Returns the list of changed files from git. Returns `None` if the folder is not a checkout of the repository.
fn tree() -> Option<String> {
    shell::read(shell::command("git").args(["status", "--porcelain"])).ok()
}

fn board_builds() -> Result<()> {
    firmware::add_target()?;
    for name in BOARD_CRATES {
        run(&mut cargo(&[
            "build",
            "--no-default-features",
            "--package",
            name,
            "--target",
            firmware::TARGET,
        ]))?;
    }
    Ok(())
}

/// Runs `jtc demo`, which writes to the folder `out`, and checks the files of the demo.
fn demo(out: &Path) -> Result<()> {
    let mut demo = shell::command(suite::programs()?.join("jtc"));
    let text = shell::read(demo.args(["demo", "--speed", "max", "--json", "--out"]).arg(out))?;
    let last = text.lines().rev().find(|line| line.starts_with('{')).unwrap_or(&text);
    let report: Value = serde_json::from_str(last).context("the demo's --json output is no JSON object")?;
    check_demo_figures(&report)?;
    check_demo_files(out)
}

fn check_demo_figures(report: &Value) -> Result<()> {
    let joints = report["joints"].as_array().context("the demo's JSON has no list `joints`")?;
    ensure!(joints.len() == 6, "the demo reports {} joints, not 6", joints.len());
    for (number, joint) in (1..).zip(joints) {
        let rms = joint["rms_error_mrad"].as_f64().context("a joint without `rms_error_mrad`")?;
        println!("joint {number}: {rms:.3} mrad RMS");
        ensure!(
            rms <= RMS_LIMIT_MRAD,
            "joint {number} follows to {rms} mrad RMS; the limit is {RMS_LIMIT_MRAD}"
        );
    }
    Ok(())
}

fn check_demo_files(out: &Path) -> Result<()> {
    let read = |name: &str| {
        std::fs::read(out.join(name))
            .with_context(|| format!("the demo did not write {name} into {}", out.display()))
    };
    let html = String::from_utf8(read("report.html")?).context("report.html is not UTF-8")?;
    ensure!(html.trim_start().to_lowercase().starts_with("<!doctype html"), "report.html is no HTML page");
    for outside in ["src=\"http", "href=\"http", "@import", "fetch("] {
        ensure!(!html.contains(outside), "report.html needs something from outside: {outside}");
    }
    let mcap = read("recording.mcap")?;
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    ensure!(mcap.starts_with(MAGIC) && mcap.ends_with(MAGIC), "recording.mcap is not a complete MCAP file");
    let csv = String::from_utf8(read("recording.csv")?).context("recording.csv is not UTF-8")?;
    check_csv(&csv)?;
    let svg = String::from_utf8(read("picture.svg")?).context("picture.svg is not UTF-8")?;
    ensure!(svg.contains("<svg") && svg.trim_end().ends_with("</svg>"), "picture.svg is no complete SVG");
    println!("report.html {} B, recording.mcap {} B, recording.csv {} B", html.len(), mcap.len(), csv.len());
    Ok(())
}

/// Checks that the file contains a header and at least one second of rows. Each row must have as many columns as the
/// header, and every number must be finite.
fn check_csv(csv: &str) -> Result<()> {
    let mut lines = csv.lines();
    let header = lines.next().context("recording.csv is empty")?;
    let columns = header.split(',').count();
    let mut rows = 0;
    for line in lines {
        rows += 1;
        ensure!(line.split(',').count() == columns, "recording.csv, row {rows}: not {columns} columns");
        for (name, cell) in header.split(',').zip(line.split(',')) {
            if let Ok(number) = cell.parse::<f64>()
                && !number.is_finite()
            {
                bail!("recording.csv, row {rows}: {name} is {number}");
            }
        }
    }
    ensure!(rows >= 1000, "recording.csv has {rows} rows; a demo has thousands");
    Ok(())
}
