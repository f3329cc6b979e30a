//! Runs programs in parallel. Most of these programs wait and use little processor time.
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::num::NonZero;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Result, ensure};

use crate::shell::Scratch;
use crate::tally::{Outcome, Tally};

/// Output and result of a program that has ended.
pub(crate) struct Ended {
    /// Text on standard output and standard error of the program.
    pub output: String,
    /// `true` if the exit code was 0.
    pub passed: bool,
    /// Duration of the program, s.
    pub seconds: f64,
}

/// Result of a program that ran in parallel with other programs.
pub(crate) trait Ran {
    /// Returns the output and the result of the program. Returns `None` if the program did not run.
    fn ended(&self) -> Option<&Ended>;

    /// Returns the output of the program if the program failed.
    fn failure(&self) -> Option<&str> {
        self.ended().filter(|ended| !ended.passed).map(|ended| &*ended.output)
    }

    /// Returns `true` if the program ran and passed.
    fn passed(&self) -> bool {
        self.ended().is_some_and(|ended| ended.passed)
    }
}

impl Ran for Result<Ended> {
    fn ended(&self) -> Option<&Ended> {
        self.as_ref().ok()
    }
}

impl Ran for Result<Option<Ended>> {
    fn ended(&self) -> Option<&Ended> {
        self.as_ref().ok()?.as_ref()
    }
}

/// Function that runs a program and writes its output to this file. Returns `None` if the program cannot run.
type Run<'a> = Box<dyn Fn(&Path) -> Result<Option<Ended>> + Send + Sync + 'a>;

/// Check that runs in parallel with other checks. The result is reported as a separate step.
pub(crate) struct Check<'a> {
    /// Title of the step for this check.
    pub title: String,
    /// Function that runs the check.
    pub run: Run<'a>,
    /// Function that returns the outcome of the step.
    pub outcome: fn(&Ended) -> Result<Outcome>,
    /// Reason why the check cannot run, if any.
    pub missing: String,
}

/// Returns the outcome of a check that counts as a single test.
pub(crate) fn whole(ended: &Ended) -> Result<Outcome> {
    ensure!(ended.passed, "it ended with an error");
    Ok(Outcome::Passed)
}

/// Runs the checks whose steps are selected, each as a separate step. The longest check should be the first in the
/// list.
pub(crate) fn steps(tally: &mut Tally, mut checks: Vec<Check>) {
    checks.retain(|check| tally.wants(&check.title));
    let ran = run_all(
        checks,
        |check, log| (check.run)(log),
        |check, ended| {
            tally.step(&check.title, || match ended? {
                None => Ok(Outcome::Skipped(check.missing)),
                Some(ended) => {
                    println!("{}\n({:.1} s, in parallel)", ended.output.trim_end(), ended.seconds);
                    (check.outcome)(&ended)
                }
            });
        },
    );
    match ran {
        Ok(passed_alone) => tally.passed_alone(passed_alone),
        Err(error) => tally.step("checks in parallel", || Err(error)),
    }
}

/// Calls `run` for each of `items`, in parallel. The number of parallel calls is the number of processors plus one. `log` is a file for
/// the output of a program. Calls `ended` for each result.
///
/// Tests with simulated arms and browsers depend on real time, so they can fail on a busy computer. Therefore, if a program
/// failed, it runs again when all other programs have ended, and its second result counts. Returns the number of `items` that
/// passed only in the second run.
pub(crate) fn run_all<T: Send, R: Ran + Send>(
    items: Vec<T>,
    run: impl Fn(&T, &Path) -> R + Sync,
    ended: impl FnMut(T, R) + Send,
) -> Result<u64> {
    let scratch = Scratch::new("parallel")?;
    let at_once = std::thread::available_parallelism().map_or(1, NonZero::get) + 1;
    let (waiting, ended) = (Mutex::new(VecDeque::from(items)), Mutex::new(ended));
    let failed = Mutex::new(Vec::new());
    let worker = |number: usize| {
        let log = scratch.path().join(number.to_string());
        loop {
            let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
            let Some(item) = next else { return };
            let came = run(&item, &log);
            if let Some(output) = came.failure() {
                println!("\n{}\n-- it failed and will run again, alone", output.trim());
                failed.lock().unwrap_or_else(PoisonError::into_inner).push(item);
            } else {
                ended.lock().unwrap_or_else(PoisonError::into_inner)(item, came);
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once).map(|number| scope.spawn(move || worker(number))).collect();
        workers.into_iter().for_each(|worker| {
            worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e));
        });
    });
    let log = scratch.path().join("alone");
    let mut passed_alone = 0;
    for item in failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        let came = run(&item, &log);
        println!("\n-- the result of the second run:");
        passed_alone += u64::from(came.passed());
        ended.lock().unwrap_or_else(PoisonError::into_inner)(item, came);
    }
    Ok(passed_alone)
}

/// Runs a command and writes its output to `log`.
pub(crate) fn run(command: &mut Command, log: &Path) -> Result<Ended> {
    let start = Instant::now();
    let mut file = File::options().create(true).truncate(true).read(true).write(true).open(log)?;
    let status = command.stdin(Stdio::null()).stdout(file.try_clone()?).stderr(file.try_clone()?).status()?;
    let mut output = Vec::new();
    file.rewind()?;
    file.read_to_end(&mut output)?;
    let mut output = String::from_utf8_lossy(&output).into_owned();
    if !status.success() {
        output.push_str(&format!("\n{status}"));
    }
    Ok(Ended { output, passed: status.success(), seconds: start.elapsed().as_secs_f64() })
}
