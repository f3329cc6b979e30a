//! The tests of the workspace. Cargo builds the test programs, and this module runs the test programs in parallel.
//!
//! Cargo runs one test program after the other. Many tests of this project wait in real time, for example for the end of a lease or
//! for the timeout of a silent board. These programs use little processor time, so this module runs several programs in parallel.
//! The tests of a crate are linked into one program, `suite`, which runs once for each test file. Therefore a process runs only the
//! tests of one file.
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::parallel::{self, Ended};
use crate::shell::{self, cargo, run_lines};
use crate::tally::{self, Counts, Outcome};

/// Tests of one file of a crate, or all tests of a program other than `suite`.
struct Program {
    package: PathBuf,
    executable: PathBuf,
    /// Name of the test program and, for `suite`, of the test file.
    name: String,
    /// Selected tests; empty if all tests are selected.
    tests: Vec<String>,
}

/// Runs all tests of the workspace and all documentation tests, and adds up the test counts. Calls `built` when cargo has built
/// the workspace.
pub(crate) fn run(built: impl FnOnce()) -> Result<Outcome> {
    let tests = build()?;
    programs()?;
    built();
    let mut counts = Counts::default();
    let mut printed = String::new();
    let failures = run_all(tests, &mut counts, &mut printed)?;
    let mut documentation = cargo(&["test", "--release", "--workspace", "--no-fail-fast", "--doc"]);
    let documented = run_lines(shell::lint(&mut documentation)?, |line| count_results(line, &mut counts));
    for failure in &failures {
        println!("failed: {failure}");
    }
    if counts.failed == 0 {
        // A test program that ended too early has not reported its test counts.
        ensure!(failures.is_empty(), "a test program broke off: {}", failures.join(", "));
        documented?;
        ensure!(counts.passed > 0, "no test was run at all");
    }
    Ok(Outcome::Counted(counts, printed))
}

/// Builds the commands and the examples with the same dependencies as the tests. Returns the folder of these programs.
///
/// Cargo selects features for all packages of a command together. If the command named a single package, cargo would
/// build half of the dependencies a second time.
pub(crate) fn programs() -> Result<PathBuf> {
    compile(&["build", "--bins", "--examples"], |_| {})?;
    Ok(shell::target().join("release"))
}

/// Builds the whole workspace. Each warning of the compiler or of Clippy is an error.
pub(crate) fn lints() -> Result<()> {
    let mut warnings = 0;
    for build in [&["test", "--tests", "--no-run"], &["build", "--bins", "--examples"]] {
        compile(build, |message| {
            warnings += u32::from(message["reason"] == "compiler-message");
        })?;
    }
    ensure!(warnings == 0, "{warnings} warnings");
    Ok(())
}

/// Builds a part of the workspace, prints the messages of the compiler and Clippy, and passes each message of cargo
/// to `each`.
fn compile(arguments: &[&str], mut each: impl FnMut(&Value)) -> Result<()> {
    let mut build = cargo(arguments);
    build.args(["--release", "--workspace", "--message-format=json"]);
    shell::read_lines(shell::lint(&mut build)?, |line| {
        let Ok(message) = serde_json::from_str::<Value>(line) else { return };
        if let Some(text) = message["message"]["rendered"].as_str() {
            println!("{text}");
        }
        each(&message);
    })
}

/// Builds the test programs of the workspace.
fn build() -> Result<Vec<Program>> {
    let mut messages = Vec::new();
    compile(&["test", "--tests", "--no-run"], |message| messages.push(message.clone()))?;
    let mut programs = Vec::new();
    for message in messages {
        let executable = message["executable"].as_str();
        if let (Some(executable), true) = (executable, message["profile"]["test"] == true) {
            let manifest = message["manifest_path"].as_str().context("cargo names no manifest of a test")?;
            let package = Path::new(manifest).parent().context("a manifest in no directory")?;
            let name =
                message["target"]["name"].as_str().context("cargo names no target of a test")?.to_owned();
            let (package, executable) = (package.into(), executable.into());
            programs.extend(Program { package, executable, name, tests: Vec::new() }.by_file()?);
        }
    }
    programs.sort_by(|a, b| (&a.name, &a.package).cmp(&(&b.name, &b.package)));
    ensure!(!programs.is_empty(), "cargo has built no test at all");
    Ok(programs)
}

impl Program {
    /// Splits the test program `suite` into one part for each of its test files.
    fn by_file(self) -> Result<Vec<Self>> {
        if self.name != "suite" {
            return Ok(vec![self]);
        }
        let list = shell::read(shell::command(&self.executable).args(["--list", "--format", "terse"]))?;
        let part = |(file, tests): (&str, Vec<String>)| Self {
            package: self.package.clone(),
            executable: self.executable.clone(),
            name: format!("{file} of {}", self.name),
            tests,
        };
        Ok(files(&list).into_iter().map(part).collect())
    }
}

/// Returns the names of the tests in a list that libtest has printed, grouped by top-level module.
fn files(list: &str) -> BTreeMap<&str, Vec<String>> {
    let mut files = BTreeMap::<&str, Vec<String>>::new();
    for test in list.lines().filter_map(|line| line.strip_suffix(": test")) {
        files.entry(test.split("::").next().unwrap_or(test)).or_default().push(test.to_owned());
    }
    files
}

/// Number of tests per processor that one UCoM program runs in parallel. Tests of UCoM boards spend nearly all of
/// their time waiting. Other programs use the default of one test per processor, because a simulated controller must
/// run in real time and needs much processor time.
const BOARD_TESTS_FOR_A_PROCESSOR: usize = 2;
/// Argument of the GNU program `env` that sets these signals to their default handling.
const HEEDING: &str = "--default-signal=HUP,INT,QUIT";

/// Runs all test programs, and prints the output of each program when it has ended. Returns the names of the failed programs,
/// and adds their failure messages to `printed`.
fn run_all(programs: Vec<Program>, counts: &mut Counts, printed: &mut String) -> Result<Vec<String>> {
    let mut failures = Vec::new();
    let ended = |program: Program, ended: Result<Ended>| {
        let package = program.package.file_name().unwrap_or_default().to_string_lossy();
        let name = format!("{} in {package}", program.name);
        match ended {
            Ok(Ended { output, passed, seconds }) => {
                println!("\n$ {name} ({seconds:.1} s)\n{}", output.trim());
                output.lines().for_each(|line| count_results(line, counts));
                if !passed {
                    printed.push_str(tally::failures(&output, "failures:"));
                    failures.push(name);
                }
            }
            Err(error) => failures.push(format!("{name}, which cannot be run: {error:#}")),
        }
        // The code flushes the output so that a reader of a pipe sees the progress.
        std::io::stdout().flush().ok();
    };
    // If xtask runs under `nohup` or in the background of a script, it ignores some signals. The test programs would
    // inherit this setting, and would ignore the signals that tests send.
    let heeds_signals = shell::works(shell::command("env").args([HEEDING, "true"]));
    let threads = (BOARD_TESTS_FOR_A_PROCESSOR * parallel::processors()).to_string();
    // Each test program runs in the folder of its package, as with cargo.
    let run = |program: &Program, log: &Path| {
        let mut command = if heeds_signals {
            let mut env = shell::command("env");
            env.arg(HEEDING).arg(&program.executable);
            env
        } else {
            shell::command(&program.executable)
        };
        if !program.tests.is_empty() {
            command.arg("--exact").args(&program.tests);
        }
        command.current_dir(&program.package).env("CARGO_MANIFEST_DIR", &program.package);
        if program.package.file_name().is_some_and(|name| name.to_string_lossy().starts_with("ucom")) {
            command.env("RUST_TEST_THREADS", &threads);
        }
        parallel::run(&mut command, log)
    };
    let passed_alone = parallel::run_all(programs, run, ended)?;
    counts.passed_alone += passed_alone;
    Ok(failures)
}

/// Adds the numbers of a result line to the counts. Ignores all other lines.
pub(crate) fn count_results(line: &str, counts: &mut Counts) {
    let Some(rest) = line.strip_prefix("test result: ") else { return };
    counts.passed += count(rest, "passed");
    counts.failed += count(rest, "failed");
    counts.skipped += count(rest, "ignored");
}

/// Returns the number before `word` in a result line.
fn count(line: &str, word: &str) -> u64 {
    let Some((before, _)) = line.split_once(&format!(" {word}")) else { return 0 };
    before.rsplit(' ').next().and_then(|number| number.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_listed_by_file() {
        let list = "delay::a: test\nrecords::b: test\ndelay::inner::c: test\nat_the_root: test\n\n4 tests, 0 benchmarks\n";
        let files: Vec<_> = files(list).into_iter().map(|(file, tests)| (file, tests.join(" "))).collect();
        assert_eq!(
            files,
            [
                ("at_the_root", "at_the_root"),
                ("delay", "delay::a delay::inner::c"),
                ("records", "records::b")
            ]
            .map(|(file, tests)| (file, tests.to_owned()))
        );
    }
}
