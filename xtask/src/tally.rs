//! Runs the steps of a command. The module prints a heading for each step, collects the failures, and prints a closing
//! line.
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Result;

use crate::shell;

/// Outcome of a step of a command.
pub(crate) enum Outcome {
    /// A single check that passed.
    Passed,
    /// Counts of several tests, and the output of the failed tests.
    Counted(Counts, String),
    /// The step was not run. The text is the reason why the step was skipped.
    Skipped(String),
}

/// Counts of test results.
#[derive(Clone, Copy, Default)]
pub(crate) struct Counts {
    /// Number of passed tests.
    pub passed: u64,
    /// Number of failed tests.
    pub failed: u64,
    /// Number of skipped tests.
    pub skipped: u64,
    /// Number of test programs that failed in the first run, and passed in a second run without other programs.
    pub passed_alone: u64,
}

/// Steps of a command that have finished.
#[derive(Default)]
pub(crate) struct Tally {
    only: Option<String>,
    counts: Counts,
    failures: Vec<String>,
    skips: Vec<String>,
}

impl Tally {
    /// Creates a tally that runs only the steps with `only` in their title. With `None`, the tally runs all steps.
    pub(crate) fn new(only: Option<String>) -> Self {
        Self { only, ..Self::default() }
    }

    /// Returns `true` if the step with this title is selected.
    pub(crate) fn wants(&self, title: &str) -> bool {
        self.only.as_ref().is_none_or(|only| title.contains(only))
    }

    /// Prints the heading of a step and runs the step. If the step fails, the function prints and counts the error, and
    /// the next step still runs.
    pub(crate) fn step(&mut self, title: &str, body: impl FnOnce() -> Result<Outcome>) {
        if !self.wants(title) {
            return;
        }
        println!("\n== {title}");
        let (start, before) = (Instant::now(), shell::processor_seconds());
        let result = body();
        let time = match (before, shell::processor_seconds()) {
            (Some(before), Some(after)) => {
                format!("{:.1} s, processors {:.0} s", start.elapsed().as_secs_f64(), after - before)
            }
            _ => format!("{:.1} s", start.elapsed().as_secs_f64()),
        };
        match result {
            Ok(Outcome::Passed) => {
                self.counts.passed += 1;
                println!("-- {title}: ok ({time})");
            }
            Ok(Outcome::Counted(counts, printed)) => {
                self.counts.passed += counts.passed;
                self.counts.failed += counts.failed;
                self.counts.skipped += counts.skipped;
                self.passed_alone(counts.passed_alone);
                if counts.failed > 0 {
                    // The command prints the failures again at the end, so that the last part of a long log shows the
                    // reason.
                    let failure = format!("{title}: {} failed\n{}", counts.failed, printed.trim());
                    self.failures.push(failure.trim_end().to_owned());
                }
                println!(
                    "-- {title}: {} passed, {} failed, {} skipped ({time})",
                    counts.passed, counts.failed, counts.skipped
                );
            }
            Ok(Outcome::Skipped(why)) => {
                self.counts.skipped += 1;
                println!("-- {title}: skipped: {why}");
                self.skips.push(format!("{title}: {why}"));
            }
            Err(error) => {
                self.counts.failed += 1;
                println!("-- {title}: FAILED ({time}): {error:#}");
                self.failures.push(format!("{title}: {error:#}"));
            }
        }
    }

    /// Adds the number of test programs that failed in the first run, and passed in a second run without other
    /// programs.
    pub(crate) fn passed_alone(&mut self, programs: u64) {
        self.counts.passed_alone += programs;
    }

    /// Prints the failed steps and the skipped steps again, and then the closing line.
    pub(crate) fn finish(self) -> ExitCode {
        println!();
        for skip in &self.skips {
            println!("skipped: {skip}");
        }
        for failure in &self.failures {
            println!("failed: {failure}");
        }
        let Counts { passed, failed, skipped, passed_alone } = self.counts;
        if passed_alone > 0 {
            println!("programs that failed at first and passed when they ran again, alone: {passed_alone}");
        }
        println!("{passed} passed, {failed} failed, {skipped} skipped");
        if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
    }
}

/// Returns the output from the first line that begins with `heading`. Test runners describe the failures after this
/// line.
pub(crate) fn failures<'a>(output: &'a str, heading: &str) -> &'a str {
    let starts = |line: &str| line.trim_start_matches(['=', '_', ' ']).starts_with(heading);
    let before = output.split_inclusive('\n').take_while(|line| !starts(line)).map(str::len).sum();
    &output[before..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_the_text_from_their_heading_on() {
        let output = "test a ... FAILED\n\nfailures:\n\n---- a ----\nleft: 1\n\nfailures:\n    a\n";
        assert_eq!(failures(output, "failures:"), "failures:\n\n---- a ----\nleft: 1\n\nfailures:\n    a\n");
        assert_eq!(failures("..F\n=== FAILURES ===\n__ a __\n", "FAILURES"), "=== FAILURES ===\n__ a __\n");
        assert_eq!(failures("all is well\n", "failures:"), "");
    }
}
