//! Runs work in parallel, mostly programs. Most checks of a test run spend their time waiting and use little
//! processor time.
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
    let ended = Mutex::new(ended);
    let failed = Mutex::new(Vec::new());
    process(items, processors() + 1, |thread, item| {
        let came = run(&item, &scratch.path().join(thread.to_string()));
        if let Some(output) = came.failure() {
            println!("\n{}\n-- it failed and will run again, alone", output.trim());
            failed.lock().unwrap_or_else(PoisonError::into_inner).push(item);
        } else {
            ended.lock().unwrap_or_else(PoisonError::into_inner)(item, came);
        }
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

/// Returns the number of processors.
pub(crate) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, NonZero::get)
}

/// Calls `work` for each item, in this number of threads. The first argument of `work` is the index of the thread. The results
/// have any order.
pub(crate) fn process<T: Send, R: Send>(
    items: Vec<T>,
    threads: usize,
    work: impl Fn(usize, T) -> R + Sync,
) -> Vec<R> {
    let waiting = Mutex::new(VecDeque::from(items));
    let next = || waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
    let worker = |thread| std::iter::from_fn(next).map(|item| work(thread, item)).collect::<Vec<R>>();
    std::thread::scope(|scope| {
        let worker = &worker;
        let workers: Vec<_> = (0..threads).map(|thread| scope.spawn(move || worker(thread))).collect();
        let results = |worker: std::thread::ScopedJoinHandle<'_, Vec<R>>| {
            worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e))
        };
        workers.into_iter().flat_map(results).collect()
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_is_processed_once() {
        let mut results = process((0..100).collect(), 3, |thread, n: u32| {
            assert!(thread < 3);
            n * 2
        });
        results.sort_unstable();
        assert_eq!(results, (0..100).map(|n| n * 2).collect::<Vec<u32>>());
    }

    #[test]
    fn what_failed_runs_again_alone_and_its_second_result_counts() {
        let tries = Mutex::new(Vec::new());
        let mut results = Vec::new();
        let run = |item: &u32, _: &Path| -> Result<Ended> {
            let mut tries = tries.lock().unwrap();
            let again = tries.contains(item);
            tries.push(*item);
            let passed = *item != 9 && (*item != 7 || again);
            Ok(Ended { output: item.to_string(), passed, seconds: 0.0 })
        };
        let passed_alone = run_all((0..20).collect(), run, |item, came| results.push((item, came.passed())));
        results.sort_unstable();
        assert_eq!(results, (0..20).map(|n| (n, n != 9)).collect::<Vec<_>>());
        assert_eq!(passed_alone.unwrap(), 1);
        assert_eq!(tries.into_inner().unwrap().len(), 22);
    }
}
