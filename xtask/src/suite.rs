//! The tests of the workspace: cargo builds them, and their programs run beside each other.
//!
//! Cargo runs one test program after the other, and many of ours wait for what takes its time on a real line: leases that lapse, boards
//! that are silent. They use little of a processor, so several run at once.
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{self, Scratch, cargo, run_lines};
use crate::tally::{Counts, Outcome};

/// A test program that cargo has built.
struct Program {
    package: PathBuf,
    executable: PathBuf,
}

/// What a program printed, and how it ended.
struct Ended {
    output: String,
    passed: bool,
}

/// Every test of the workspace, and those in its documentation; their own counts are summed up.
pub fn run() -> Result<Outcome> {
    let programs = build()?;
    let mut counts = Counts::default();
    let failures = run_all(programs, &mut counts)?;
    let mut documentation = cargo(&["test", "--workspace", "--no-fail-fast", "--doc"]);
    let documented = run_lines(&mut documentation, |line| count_results(line, &mut counts));
    for failure in &failures {
        println!("failed: {failure}");
    }
    if counts.failed == 0 {
        // A program that broke off has counted nothing.
        ensure!(failures.is_empty(), "a test program broke off: {}", failures.join(", "));
        documented?;
        ensure!(counts.passed > 0, "no test was run at all");
    }
    Ok(Outcome::Counted(counts))
}

/// Builds the test programs, in cargo's order.
fn build() -> Result<Vec<Program>> {
    let mut build = cargo(&["test", "--workspace", "--no-run", "--message-format=json-render-diagnostics"]);
    let messages = shell::read(&mut build)?;
    let mut programs = Vec::new();
    for message in messages.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok()) {
        let executable = message["executable"].as_str();
        if let (Some(executable), true) = (executable, message["profile"]["test"] == true) {
            let manifest = message["manifest_path"].as_str().context("cargo names no manifest of a test")?;
            let package = Path::new(manifest).parent().context("a manifest in no directory")?;
            programs.push(Program { package: package.into(), executable: executable.into() });
        }
    }
    programs.sort_by(|a, b| a.executable.cmp(&b.executable));
    ensure!(!programs.is_empty(), "cargo has built no test at all");
    Ok(programs)
}

/// Runs all of them, and prints of each what it printed once it has ended. Names those that failed.
fn run_all(programs: Vec<Program>, counts: &mut Counts) -> Result<Vec<String>> {
    let scratch = Scratch::new("tests")?;
    let at_once = std::thread::available_parallelism().map_or(1, NonZero::get) + 1;
    let waiting = Mutex::new(VecDeque::from(programs));
    let summed = Mutex::new((Counts::default(), Vec::new()));
    let worker = |number: usize| -> Result<()> {
        let log = scratch.path().join(number.to_string());
        loop {
            let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
            let Some(program) = next else { return Ok(()) };
            let name = program.executable.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let start = Instant::now();
            let ended = run_one(&program, &log).with_context(|| format!("the test program {name}"))?;
            let mut summed = summed.lock().unwrap_or_else(PoisonError::into_inner);
            let seconds = start.elapsed().as_secs_f64();
            println!("\n$ {name} in {} ({seconds:.1} s)\n{}", program.package.display(), ended.output.trim());
            ended.output.lines().for_each(|line| count_results(line, &mut summed.0));
            if !ended.passed {
                summed.1.push(name);
            }
            // Whoever reads this through a pipe sees how far it is.
            std::io::stdout().flush().ok();
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once).map(|number| scope.spawn(move || worker(number))).collect();
        workers
            .into_iter()
            .try_for_each(|worker| worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e)))
    })?;
    let (sum, failures) = summed.into_inner().unwrap_or_else(PoisonError::into_inner);
    *counts = sum;
    Ok(failures)
}

/// Runs one, in the directory of its package as cargo does; `log` is for what it prints.
fn run_one(program: &Program, log: &Path) -> Result<Ended> {
    let mut file = File::options().create(true).truncate(true).read(true).write(true).open(log)?;
    let status = shell::command(&program.executable)
        .current_dir(&program.package)
        .env("CARGO_MANIFEST_DIR", &program.package)
        .stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file.try_clone()?)
        .status()?;
    let mut output = Vec::new();
    file.rewind()?;
    file.read_to_end(&mut output)?;
    let mut output = String::from_utf8_lossy(&output).into_owned();
    if !status.success() {
        output.push_str(&format!("\n{status}"));
    }
    Ok(Ended { output, passed: status.success() })
}

/// Adds the numbers of a line of results, if it is one.
pub fn count_results(line: &str, counts: &mut Counts) {
    let Some(rest) = line.strip_prefix("test result: ") else { return };
    counts.passed += count(rest, "passed");
    counts.failed += count(rest, "failed");
    counts.skipped += count(rest, "ignored");
}

/// The number before `word` in a result line.
fn count(line: &str, word: &str) -> u64 {
    let Some((before, _)) = line.split_once(&format!(" {word}")) else { return 0 };
    before.rsplit(' ').next().and_then(|number| number.parse().ok()).unwrap_or(0)
}
