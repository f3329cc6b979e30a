//! `cargo xtask prove mutants`: uses cargo-gamma for mutation testing of the crates that run on a board. cargo-gamma
//! builds all mutants into one set of test programs. The file gamma.toml defines the changes that create mutants.
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{create_dir_all, read_to_string, write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use super::changes::{changes, complete};
use super::evidence::{self, Named};
use crate::shell::{self, cargo, command, run, target, works};

/// Version of cargo-gamma that the command installs. The report format of other versions may differ.
const VERSION: &str = "0.4.0";
const REPORT: &str = "gamma-report.json";
/// Name of the file with the commit that was tested for the report.
const COMMIT: &str = "commit";
/// Crates that run on a board. The crates with the fastest tests are first in the list.
const PACKAGES: [&str; 5] = ["jtc-bus", "jtc-dynamics", "jtc-wire", "ucom", "jtc-core"];
/// Crates whose tests run on the mutants of `ucom`. Tests of the PC side also test the board side of `ucom`.
const JUDGES_OF_UCOM: [&str; 3] = ["ucom", "ucom-sim", "ucom-host"];
/// Largest share of the mutants of a crate that may survive, including explained mutants.
const SURVIVING_MAX: f64 = 0.03;

/// Results of the mutation test of a crate.
#[derive(Default)]
struct Tally {
    killed: usize,
    /// Number of mutants for which a test did not end. Such a test counts as a failed test.
    endless: usize,
    equivalent: usize,
    unexplained: Vec<String>,
}

impl Tally {
    fn count(&self) -> usize {
        self.killed + self.endless + self.survived()
    }

    fn survived(&self) -> usize {
        self.equivalent + self.unexplained.len()
    }

    fn share(&self) -> f64 {
        self.survived() as f64 / self.count().max(1) as f64
    }
}

/// Selection of the mutants of a crate that the command tests.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Which {
    /// All mutants of the crate.
    All,
    /// Mutants that survived the last mutation test.
    Survivors,
    /// Mutants on lines that have changed since the last mutation test.
    Changed,
    /// Mutants that an interrupted mutation test has not tested.
    Left,
}

/// Runs `cargo xtask prove mutants`. `arguments` may contain `--package NAME`, `--survivors`, `--changed`, `--resume`
/// and `--report`.
pub(super) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let package = shell::option(&mut arguments, "--package")?;
    let mut which = Which::All;
    for (flag, meaning) in
        [("--survivors", Which::Survivors), ("--changed", Which::Changed), ("--resume", Which::Left)]
    {
        if shell::flag(&mut arguments, flag) {
            ensure!(which == Which::All, "{flag} does not go with another choice of mutants");
            which = meaning;
        }
    }
    let report_only = shell::flag(&mut arguments, "--report");
    shell::nothing_left(&arguments)?;
    let chosen: Vec<&str> =
        PACKAGES.into_iter().filter(|name| package.as_deref().is_none_or(|wanted| wanted == *name)).collect();
    ensure!(!chosen.is_empty(), "--package needs one of {}", PACKAGES.join(", "));
    ensure!(
        which != Which::Left || chosen.len() == 1,
        "--resume needs --package: the one that was interrupted"
    );

    if !report_only {
        install()?;
        for package in chosen {
            campaign(package, which)?;
        }
    }
    let page = evidence::read()?;
    let mut tallies = BTreeMap::new();
    for package in PACKAGES {
        let path = results(package).join(REPORT);
        if path.is_file() {
            let commit = read_to_string(results(package).join(COMMIT)).unwrap_or_default();
            tallies.insert(package, (tally(&read_report(&path)?, &page)?, commit));
        }
    }
    for mutant in tallies.values().flat_map(|(tally, _)| &tally.unexplained) {
        println!("survived: {mutant}");
    }
    evidence::replace("mutants", &table(&tallies, &evidence::table(&page, "mutants")?))?;
    println!("wrote the table of mutants of docs/evidence.md");
    let missing: Vec<&str> = PACKAGES.into_iter().filter(|name| !tallies.contains_key(name)).collect();
    if let Some(first) = missing.first() {
        println!("no results here of {}: cargo xtask prove mutants --package {first}", missing.join(", "));
        return Ok(ExitCode::FAILURE);
    }
    let met =
        tallies.values().all(|(tally, _)| tally.unexplained.is_empty() && tally.share() <= SURVIVING_MAX);
    Ok(if met { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Installs cargo-gamma if it is missing.
fn install() -> Result<()> {
    if !works(command(program()).args(["gamma", "--version"])) {
        let mut install = cargo(&["install", "cargo-gamma", "--locked", "--version", VERSION, "--root"]);
        run(install.arg(target().join("tools")))?;
    }
    // cargo-gamma calls cargo offline, and needs the dependencies of every platform.
    run(&mut cargo(&["fetch", "--locked"]))
}

fn program() -> PathBuf {
    target().join("tools/bin/cargo-gamma")
}

/// Returns the folder with the results of a crate.
fn results(package: &str) -> PathBuf {
    target().join("mutants").join(package)
}

/// Runs cargo-gamma for one crate. The exit code of cargo-gamma depends on the mutants, so the function reads the
/// result from the report.
fn campaign(package: &str, which: Which) -> Result<()> {
    let results = results(package);
    create_dir_all(&results).with_context(|| format!("cannot create {}", results.display()))?;
    // The report covers only the mutants of this run, so the command keeps and updates the complete report.
    let whole = results.join(REPORT);
    let in_part = matches!(which, Which::Survivors | Which::Changed);
    let before = if in_part { Some(read_report(&whole)?) } else { None };
    let commit = commit()?;
    let mut gamma: Command = command(program());
    gamma.args(["gamma", "run", "--color", "never", "--progress", "never"]);
    // The profile contains all assertions and optimises the crates that do calculations, because simulated arms need
    // most of the time.
    gamma.args(["--profile", "release"]);
    gamma.arg("--artifact-dir").arg(&results);
    if which == Which::Left {
        gamma.arg("--resume-testing");
    } else {
        gamma.args(["--package", package]);
        if package == "ucom" {
            gamma.args(JUDGES_OF_UCOM.iter().flat_map(|judge| ["--test-package", judge]));
        }
    }
    if which == Which::Survivors {
        gamma.arg("--only-survivors");
    }
    let mut changed = BTreeMap::new();
    if let Some(before) = before.as_ref().filter(|_| which == Which::Changed) {
        changed = changes(&results, before)?;
        let path = results.join("changes.diff");
        write(&path, changed.values().map(|changes| changes.diff.as_str()).collect::<String>())
            .with_context(|| format!("cannot write {}", path.display()))?;
        gamma.arg("--in-diff").arg(path);
    }
    println!("== {package}");
    let status = gamma.status().context("cannot start cargo-gamma")?;
    // Exit code 2 means that too many mutants survived. This code does not treat exit code 2 as an error.
    ensure!(
        matches!(status.code(), Some(0 | 2)),
        "cargo-gamma ended with {status}; go on with `cargo xtask prove mutants --package {package} --resume`"
    );
    if let Some(mut before) = before {
        let mut part = read_report(&whole)?;
        let report = if which == Which::Changed {
            complete(&mut part, before, &changed)?;
            part
        } else {
            update(&mut before, &part);
            before
        };
        write(&whole, report.to_string()).with_context(|| format!("cannot write {}", whole.display()))?;
    }
    let path = results.join(COMMIT);
    write(&path, commit).with_context(|| format!("cannot write {}", path.display()))
}

/// Copies the outcomes of the mutants that were run again into the complete report.
fn update(whole: &mut Value, part: &Value) {
    let mut statuses = BTreeMap::new();
    for mutant in part["files"].as_object().into_iter().flatten().flat_map(|(_, file)| mutants(file)) {
        if let Some(id) = mutant["id"].as_str() {
            statuses.insert(id, outcome(mutant));
        }
    }
    for file in whole["files"].as_object_mut().into_iter().flat_map(|files| files.values_mut()) {
        for mutant in file["mutants"].as_array_mut().into_iter().flatten() {
            let status = mutant["id"].as_str().and_then(|id| statuses.get(id));
            if let Some(&status) = status.filter(|status| ["Killed", "Timeout"].contains(*status)) {
                mutant["status"] = status.into();
            }
        }
    }
}

fn mutants(file: &Value) -> impl Iterator<Item = &Value> {
    file["mutants"].as_array().into_iter().flatten()
}

/// Returns the outcome of a mutant. The report lists a mutant whose test did not end as a survivor, together with the
/// reason.
fn outcome(mutant: &Value) -> &str {
    let text = |key: &str| mutant[key].as_str().unwrap_or_default();
    match text("status") {
        "Survived" if text("statusReason").starts_with("timed out") => "Timeout",
        status => status,
    }
}

fn read_report(path: &Path) -> Result<Value> {
    let text = read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(serde_json::from_str(&text)?)
}

/// Counts the outcomes of the mutants in a report.
fn tally(report: &Value, page: &str) -> Result<Tally> {
    let explained = evidence::explained(page);
    let mut tally = Tally::default();
    for (file, content) in report["files"].as_object().context("the report has no files")? {
        let lines: Vec<&str> = content["source"].as_str().unwrap_or_default().lines().collect();
        for mutant in mutants(content) {
            match outcome(mutant) {
                "Killed" => tally.killed += 1,
                "Timeout" => tally.endless += 1,
                "Survived" | "NoCoverage" => {
                    let at = mutant["location"]["start"]["line"].as_u64().unwrap_or(1) as usize;
                    let named = Named {
                        file: file.clone(),
                        line: lines.get(at.wrapping_sub(1)).map_or("", |line| line.trim()).into(),
                        change: mutant["description"].as_str().unwrap_or_default().into(),
                    };
                    if explained.contains(&named) {
                        tally.equivalent += 1;
                    } else {
                        let Named { line, change, .. } = named;
                        tally.unexplained.push(format!("{file}:{at}\n- `{line}` → `{change}`:"));
                    }
                }
                // The mutant does not compile, or this run has not tested the mutant.
                _ => {}
            }
        }
    }
    Ok(tally)
}

/// Returns the table with a row for each crate. If this computer has no results of a crate, the row of the crate does
/// not change.
fn table(tallies: &BTreeMap<&str, (Tally, String)>, before: &str) -> String {
    let mut table = String::from(
        "| crate | mutants | killed | never ended | equivalent | unexplained | alive | commit |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for name in PACKAGES {
        let head = format!("| `{name}` | ");
        if let Some((tally, commit)) = tallies.get(name) {
            let _ = writeln!(
                table,
                "{head}{} | {} | {} | {} | {} | {:.1} % | {commit} |",
                tally.count(),
                tally.killed,
                tally.endless,
                tally.equivalent,
                tally.unexplained.len(),
                100.0 * tally.share()
            );
        } else if let Some(row) = before.lines().find(|row| row.starts_with(&head)) {
            let _ = writeln!(table, "{row}");
        }
    }
    table
}

/// Returns the abbreviated hash of the commit that is checked out.
pub(super) fn commit() -> Result<String> {
    Ok(shell::read(command("git").args(["rev-parse", "--short=9", "HEAD"]))?.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn survivors_are_told_unless_the_page_explains_them() {
        let mutant = |status: &str, line: u64| json!({"status": status, "description": "replace < with <=", "location": {"start": {"line": line}}});
        let mut endless = mutant("Survived", 3);
        endless["statusReason"] = "timed out: the test run exceeded its budget".into();
        let report = json!({"files": {"crates/jtc-bus/src/a.rs": {
            "source": "fn f() {\n    a < b\n    c < d\n}\n",
            "mutants": [mutant("Killed", 2), mutant("Survived", 2), mutant("NoCoverage", 3), endless, mutant("CompileError", 3)],
        }}});
        let page = "### crates/jtc-bus/src/a.rs\n- `a < b` → `replace < with <=`: they are never equal.\n";
        let bus = tally(&report, page).unwrap();
        assert_eq!((bus.count(), bus.killed, bus.endless, bus.equivalent), (4, 1, 1, 1));
        assert_eq!(bus.unexplained, ["crates/jtc-bus/src/a.rs:3\n- `c < d` → `replace < with <=`:"]);
        let tallies = BTreeMap::from([("jtc-bus", (bus, "abc".to_owned()))]);
        let before = "| `jtc-wire` | 9 |\n| `jtc-bus` | 8 |\n";
        let table = table(&tallies, before);
        let rows: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(rows, ["| `jtc-bus` | 4 | 1 | 1 | 1 | 1 | 50.0 % | abc |", "| `jtc-wire` | 9 |"]);
    }

    #[test]
    fn a_survivor_that_a_new_test_kills_is_killed_in_the_whole_report() {
        let report = |statuses: &[(&str, &str)]| {
            let mutants: Vec<Value> =
                statuses.iter().map(|(id, status)| json!({"id": id, "status": status})).collect();
            json!({"files": {"a.rs": {"source": "", "mutants": mutants}}})
        };
        let mut whole = report(&[("a", "Killed"), ("b", "Survived"), ("c", "Survived")]);
        update(&mut whole, &report(&[("a", "Pending"), ("b", "Killed"), ("c", "Survived")]));
        assert_eq!(whole, report(&[("a", "Killed"), ("b", "Killed"), ("c", "Survived")]));
    }
}
