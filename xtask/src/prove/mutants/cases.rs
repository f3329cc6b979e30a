//! Measures each test: its duration, and the mutants that it reaches. A test that does not reach a mutant cannot find
//! it.
use std::collections::BTreeSet;
use std::io::Read as _;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use super::build::{Build, Program};
use crate::parallel::{process, processors};
use crate::shell;

/// Time limit of a test program without a mutant, in addition to the longest duration of a test.
const START: Duration = Duration::from_secs(5);
/// Interval at which the function checks if a running test program has ended.
const POLL: Duration = Duration::from_millis(1);

/// A test of a test program.
pub(super) struct Case {
    /// Index of the test program.
    pub program: usize,
    /// Name of the test, with its modules.
    pub name: String,
    /// Duration of the program that ran only this test, s.
    pub seconds: f64,
    /// Numbers of the mutants that the test reaches.
    pub reached: BTreeSet<u32>,
}

/// Result of a test program.
pub(super) enum End {
    Passed,
    Failed,
    /// The test program reached its time limit and was stopped.
    Late,
}

/// Runs each test of the programs alone: once for its duration, and once for the mutants that it reaches. Returns the
/// tests that take at most `longest` seconds.
///
/// # Errors
///
/// Returns an error if a test fails without a mutant.
pub(super) fn measure(build: &Build, longest: f64) -> Result<Vec<Case>> {
    let mut tests = Vec::new();
    for (index, program) in build.programs.iter().enumerate() {
        let list = shell::read(run(program, &["--list", "--format", "terse"], None).stderr(Stdio::null()))?;
        let names = list.lines().filter_map(|line| line.strip_suffix(": test"));
        tests.extend(names.map(|name| (index, name.to_owned())));
    }
    println!("measuring {} tests", tests.len());
    let measured = process(tests, processors(), |_, (index, name)| {
        let start = Instant::now();
        let limit = Duration::from_secs_f64(longest) + START;
        if alone(&build.programs[index], &name, limit)?.is_none() {
            return Ok(None);
        }
        let seconds = start.elapsed().as_secs_f64();
        if seconds > longest {
            return Ok(None);
        }
        // The recording programs take about twice as long, so their time limit is four times as long.
        let output = alone(&build.recording[index], &name, 4 * limit)?;
        Ok(output.map(|output| Case { program: index, name, seconds, reached: reached(&output) }))
    });
    let cases: Vec<Case> = measured.into_iter().filter_map(Result::transpose).collect::<Result<_>>()?;
    println!("{} tests take at most {longest} s", cases.len());
    Ok(cases)
}

/// Runs a single test without a mutant. Returns its standard error, or `None` at the time limit.
fn alone(program: &Program, name: &str, limit: Duration) -> Result<Option<String>> {
    let mut command = run(program, &["--exact", name, "--test-threads", "1"], None);
    match wait(command.stdout(Stdio::null()).stderr(Stdio::piped()), limit)? {
        (End::Passed, output) => Ok(Some(output)),
        (End::Late, _) => Ok(None),
        (End::Failed, output) => bail!("the test {name} fails without a mutant\n{output}"),
    }
}

/// Returns the numbers of the mutants in the standard error of a test program.
fn reached(output: &str) -> BTreeSet<u32> {
    let numbers = output.split('\u{1}').skip(1).filter_map(|rest| rest.get(..5));
    numbers.filter_map(|number| number.parse().ok()).collect()
}

/// Returns a command that runs a test program, with the mutant `ordinal` enabled.
pub(super) fn run(program: &Program, arguments: &[&str], ordinal: Option<u32>) -> Command {
    let mut command = Command::new(&program.path);
    command.current_dir(&program.folder).args(arguments);
    // This variable permits test options that are not stable yet, such as --fail-fast.
    command.env("RUSTC_BOOTSTRAP", "1");
    // After a failed property test, proptest does not search for a smaller example, and writes no file.
    command.env("PROPTEST_MAX_SHRINK_ITERS", "0").env("PROPTEST_DISABLE_FAILURE_PERSISTENCE", "true");
    match ordinal {
        Some(ordinal) => command.env("GAMMA_ACTIVE", ordinal.to_string()),
        None => command.env_remove("GAMMA_ACTIVE"),
    };
    command
}

/// Runs a command until it ends or its time limit has passed. Returns how the command ended, and the output that the
/// caller has redirected to a pipe.
pub(super) fn wait(command: &mut Command, limit: Duration) -> Result<(End, String)> {
    let start = Instant::now();
    let mut child = command.stdin(Stdio::null()).spawn().context("cannot start a test program")?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut bytes = Vec::new();
            if let Some(mut stdout) = stdout {
                let _ = stdout.read_to_end(&mut bytes);
            }
            if let Some(mut stderr) = stderr {
                let _ = stderr.read_to_end(&mut bytes);
            }
            bytes
        });
        let end = loop {
            if let Some(status) = child.try_wait()? {
                break if status.success() { End::Passed } else { End::Failed };
            }
            if start.elapsed() > limit {
                child.kill()?;
                child.wait()?;
                break End::Late;
            }
            thread::sleep(POLL);
        };
        let bytes = reader.join().unwrap_or_default();
        Ok((end, String::from_utf8_lossy(&bytes).into_owned()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reached_mutants_are_read_between_other_output() {
        let output = "thread 'a' panicked\n\u{1}00007\nmore\u{1}01234\n\u{1}00007\n\u{1}x";
        assert_eq!(reached(output), BTreeSet::from([7, 1234]));
    }

    #[test]
    fn a_program_that_does_not_end_is_late() {
        let (end, _) = wait(Command::new("sleep").arg("60"), Duration::from_millis(20)).unwrap();
        assert!(matches!(end, End::Late));
        let (end, output) =
            wait(Command::new("echo").arg("words").stdout(Stdio::piped()), Duration::from_secs(60)).unwrap();
        assert!(matches!(end, End::Passed));
        assert_eq!(output, "words\n");
    }
}
