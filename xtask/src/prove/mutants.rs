//! `cargo xtask prove mutants`: mutation testing of the crates that run on a board. cargo-gamma finds the mutants and
//! compiles all of them into the sources of a crate. This module then runs the tests for one mutant at a time.
mod build;
mod cases;
mod judge;
mod outcomes;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Result, ensure};

use super::evidence::{self, Named};
use crate::shell::{self, command, target};
use outcomes::{Judged, Outcome, Outcomes};

/// Crates that run on a board, each with the packages whose tests run on its mutants.
const PACKAGES: [(&str, &[&str]); 5] = [
    ("jtc-bus", &["jtc-bus"]),
    ("jtc-dynamics", &["jtc-dynamics"]),
    ("jtc-wire", &["jtc-wire"]),
    // Tests of the PC side also test the board side of `ucom`.
    ("ucom", &["ucom", "ucom-sim", "ucom-host"]),
    ("jtc-core", &["jtc-core"]),
];
/// Largest share of the mutants of a crate that may survive, including explained mutants.
const SURVIVING_MAX: f64 = 0.03;
/// Default limit for the duration of the tests that run on a mutant, s. Short tests should find mistakes, and running
/// the longer tests on all mutants would take days.
const LONGEST: f64 = 0.2;

/// Results of the mutation test of a crate.
#[derive(Default)]
struct Tally {
    killed: usize,
    /// Number of mutants for which a test did not end. Such a test counts as failed.
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

/// Runs `cargo xtask prove mutants`. `arguments` may contain `--package NAME`, `--left`, `--longest SECONDS` and
/// `--report`.
pub(super) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let package = shell::option(&mut arguments, "--package")?;
    let longest = shell::option(&mut arguments, "--longest")?;
    let longest = longest.map_or(Ok(LONGEST), |text| text.parse())?;
    let left = shell::flag(&mut arguments, "--left");
    let report_only = shell::flag(&mut arguments, "--report");
    shell::nothing_left(&arguments)?;
    let names = PACKAGES.map(|(name, _)| name);
    let wanted = |name: &str| package.as_deref().is_none_or(|package| package == name);
    ensure!(names.into_iter().any(wanted), "--package needs one of {}", names.join(", "));

    if !report_only {
        build::install()?;
        for (name, judges) in PACKAGES.into_iter().filter(|(name, _)| wanted(name)) {
            println!("== {name}");
            let tested = commit()?;
            let build = build::build(name, judges, &results(name))?;
            let cases = cases::measure(&build, longest)?;
            judge::judge(&build, &cases, Outcomes::open(&results(name), left, &tested)?)?;
        }
    }
    let page = evidence::read()?;
    let mut tallies = BTreeMap::new();
    for name in names {
        if let Some((outcomes, commit)) = outcomes::read(&results(name))? {
            tallies.insert(name, (tally(&outcomes, &page), commit));
        }
    }
    for mutant in tallies.values().flat_map(|(tally, _)| &tally.unexplained) {
        println!("survived: {mutant}");
    }
    evidence::replace("mutants", &table(&tallies, &evidence::table(&page, "mutants")?))?;
    println!("wrote the table of mutants of docs/evidence.md");
    let missing: Vec<&str> = names.into_iter().filter(|name| !tallies.contains_key(name)).collect();
    if let Some(first) = missing.first() {
        println!("no results here of {}: cargo xtask prove mutants --package {first}", missing.join(", "));
        return Ok(ExitCode::FAILURE);
    }
    let met =
        tallies.values().all(|(tally, _)| tally.unexplained.is_empty() && tally.share() <= SURVIVING_MAX);
    Ok(if met { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Returns the folder with the results of a crate.
fn results(package: &str) -> PathBuf {
    target().join("mutants").join(package)
}

/// Counts the outcomes of the mutants of a crate.
fn tally(outcomes: &[Judged], page: &str) -> Tally {
    let explained = evidence::explained(page);
    let mut tally = Tally::default();
    for (named, at, outcome) in outcomes {
        match outcome {
            Outcome::Killed => tally.killed += 1,
            Outcome::Endless => tally.endless += 1,
            Outcome::Survived if explained.contains(named) => tally.equivalent += 1,
            Outcome::Survived => {
                let Named { file, line, change } = named;
                tally.unexplained.push(format!("{file}:{at}\n- `{line}` → `{change}`:"));
            }
        }
    }
    tally
}

/// Returns the table with a row for each crate. If this computer has no results of a crate, the row of the crate does
/// not change.
fn table(tallies: &BTreeMap<&str, (Tally, String)>, before: &str) -> String {
    let mut table = String::from(
        "| crate | mutants | killed | never ended | equivalent | unexplained | alive | commit |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for (name, _) in PACKAGES {
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
    use super::*;

    #[test]
    fn survivors_are_told_unless_the_page_explains_them() {
        let named = |line: &str| Named {
            file: "crates/jtc-bus/src/a.rs".into(),
            line: line.into(),
            change: "replace < with <=".into(),
        };
        let outcomes = [
            (named("a < b"), 2, Outcome::Killed),
            (named("a < b"), 2, Outcome::Survived),
            (named("c < d"), 3, Outcome::Survived),
            (named("c < d"), 3, Outcome::Endless),
        ];
        let page = "### crates/jtc-bus/src/a.rs\n- `a < b` → `replace < with <=`: they are never equal.\n";
        let bus = tally(&outcomes, page);
        assert_eq!((bus.count(), bus.killed, bus.endless, bus.equivalent), (4, 1, 1, 1));
        assert_eq!(bus.unexplained, ["crates/jtc-bus/src/a.rs:3\n- `c < d` → `replace < with <=`:"]);
        let tallies = BTreeMap::from([("jtc-bus", (bus, "abc".to_owned()))]);
        let before = "| `jtc-wire` | 9 |\n| `jtc-bus` | 8 |\n";
        let table = table(&tallies, before);
        let rows: Vec<&str> = table.lines().skip(2).collect();
        assert_eq!(rows, ["| `jtc-bus` | 4 | 1 | 1 | 1 | 1 | 50.0 % | abc |", "| `jtc-wire` | 9 |"]);
    }
}
