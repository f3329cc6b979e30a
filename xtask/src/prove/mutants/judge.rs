//! Runs the tests on one mutant at a time, until a test fails. Tests that found other mutants of the same file run
//! first.
use std::collections::BTreeMap;
use std::process::Stdio;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Result, ensure};

use super::build::{Build, Mutant};
use super::cases::{Case, End, run, wait};
use super::outcomes::{Outcome, Outcomes};
use crate::parallel::{process, processors};

/// Largest number of tests that run first, because they found other mutants of the same file.
const FIRST: usize = 8;
/// Largest total duration (s) and largest number of the tests that run in one program.
const GROUP_SECONDS: f64 = 1.2;
const GROUP_COUNT: usize = 60;
/// Time limit of a program: this duration, plus a multiple of the duration without a mutant. A program that does not
/// end runs again with [`PATIENCE`] times the limit, because other programs may have slowed it down.
const LIMIT_SECONDS: f64 = 6.0;
const LIMIT_FACTOR: f64 = 8.0;
const PATIENCE: f64 = 4.0;

/// Tests that have found mutants.
#[derive(Default)]
struct Finders {
    /// Indices of the tests that found mutants of a file, with the latest test last.
    of_file: BTreeMap<String, Vec<usize>>,
    /// Number of mutants that each test has found.
    counts: BTreeMap<usize, usize>,
}

/// Runs the tests on each mutant that has no outcome yet or has survived.
///
/// # Errors
///
/// Returns an error if the tests fail without a mutant.
pub(super) fn judge(build: &Build, cases: &[Case], outcomes: Outcomes) -> Result<()> {
    outcomes.list(&build.mutants)?;
    // Checks that the tests, which passed alone, also pass in groups without a mutant.
    let all: Vec<usize> = (0..cases.len()).collect();
    for group in split(cases, &all) {
        ensure!(
            run_group(build, cases, &group, None)?.is_none(),
            "tests fail together: {}",
            names(cases, &group)
        );
    }
    let left: Vec<&Mutant> = build.mutants.iter().filter(|mutant| outcomes.is_left(&mutant.id)).collect();
    println!("testing {} of {} mutants", left.len(), build.mutants.len());
    let shared = Mutex::new((Finders::default(), outcomes, 0_usize));
    let results = process(left, processors(), |_, mutant| {
        let fit: Vec<usize> =
            (0..cases.len()).filter(|&n| cases[n].reached.contains(&mutant.ordinal)).collect();
        let lock = || shared.lock().unwrap_or_else(PoisonError::into_inner);
        let groups = groups(cases, fit, mutant, &lock().0);
        let (outcome, finders) = outcome(build, cases, mutant, &groups)?;
        let mut shared = lock();
        let (known, outcomes, count) = &mut *shared;
        for finder in finders {
            known.of_file.entry(mutant.named.file.clone()).or_default().push(finder);
            *known.counts.entry(finder).or_default() += 1;
        }
        *count += 1;
        if count.is_multiple_of(500) {
            println!("{count} mutants tested");
        }
        outcomes.add(&mutant.id, outcome)
    });
    results.into_iter().collect()
}

/// Returns the tests in groups in the order in which they run. All tests of a group belong to the same program.
fn groups(cases: &[Case], fit: Vec<usize>, mutant: &Mutant, finders: &Finders) -> Vec<Vec<usize>> {
    let mut latest: Vec<usize> = Vec::new();
    for finder in finders.of_file.get(&mutant.named.file).into_iter().flatten().rev() {
        if latest.len() < FIRST && !latest.contains(finder) && fit.contains(finder) {
            latest.push(*finder);
        }
    }
    let module = module(&mutant.named.file);
    let in_module =
        |n: &usize| cases[*n].name.strip_prefix(&*module).is_some_and(|rest| rest.starts_with("::"));
    let rest = fit.into_iter().filter(|n| !latest.contains(n));
    let (own, mut others): (Vec<usize>, Vec<usize>) = rest.partition(in_module);
    // Tests that have found many mutants, relative to their duration, come first.
    let value = |n: usize| {
        let found = finders.counts.get(&n).copied().unwrap_or_default();
        (found as f64 + 0.5) / (cases[n].seconds + 0.02)
    };
    others.sort_by(|&a, &b| value(b).total_cmp(&value(a)));
    [latest, own, others].into_iter().flat_map(|tests| split(cases, &tests)).collect()
}

/// Splits tests into groups. All tests of a group belong to the same program and keep their order.
fn split(cases: &[Case], tests: &[usize]) -> Vec<Vec<usize>> {
    let mut programs: BTreeMap<usize, Vec<Vec<usize>>> = BTreeMap::new();
    for &n in tests {
        let groups = programs.entry(cases[n].program).or_default();
        let has_room = groups.last().is_some_and(|group| {
            group.len() < GROUP_COUNT && group.iter().map(|&n| cases[n].seconds).sum::<f64>() < GROUP_SECONDS
        });
        match groups.last_mut().filter(|_| has_room) {
            Some(group) => group.push(n),
            None => groups.push(vec![n]),
        }
    }
    programs.into_values().flatten().collect()
}

/// Returns the module of a source file, for example `motion::jog` for `crates/jtc-core/src/motion/jog.rs`.
fn module(file: &str) -> String {
    let path = file.split_once("/src/").map_or(file, |(_, path)| path);
    path.trim_end_matches(".rs").replace('/', "::")
}

/// Runs the groups until a test fails. Returns the outcome and the tests that failed.
fn outcome(
    build: &Build,
    cases: &[Case],
    mutant: &Mutant,
    groups: &[Vec<usize>],
) -> Result<(Outcome, Vec<usize>)> {
    for group in groups {
        if let Some(outcome) = run_group(build, cases, group, Some(mutant.ordinal))? {
            return Ok(outcome);
        }
    }
    Ok((Outcome::Survived, Vec::new()))
}

/// Runs the tests of a group in one program, with the mutant `ordinal` enabled. Returns `None` if all tests pass.
fn run_group(
    build: &Build,
    cases: &[Case],
    group: &[usize],
    ordinal: Option<u32>,
) -> Result<Option<(Outcome, Vec<usize>)>> {
    let Some(&first) = group.first() else { return Ok(None) };
    let mut arguments = vec!["-Z", "unstable-options", "--fail-fast", "--test-threads", "1", "--exact"];
    arguments.extend(group.iter().map(|&n| &*cases[n].name));
    let seconds: f64 = group.iter().map(|&n| cases[n].seconds).sum();
    let limit = LIMIT_SECONDS + LIMIT_FACTOR * seconds;
    for limit in [limit, PATIENCE * limit] {
        let mut command = run(&build.programs[cases[first].program], &arguments, ordinal);
        command.stdout(Stdio::piped()).stderr(Stdio::null());
        let (end, output) = wait(&mut command, Duration::from_secs_f64(limit))?;
        match end {
            End::Passed => return Ok(None),
            End::Late => {}
            End::Failed => {
                let failed: Vec<usize> =
                    group.iter().copied().filter(|&n| has_failed(&output, &cases[n].name)).collect();
                // If the program crashed, it has printed the name of a test but no result. The mutant then counts as
                // found.
                let began = group.iter().any(|&n| output.contains(&format!("test {} ", cases[n].name)));
                ensure!(began, "no test of {} ran:\n{output}", names(cases, group));
                return Ok(Some((Outcome::Killed, failed)));
            }
        }
    }
    Ok(Some((Outcome::Endless, Vec::new())))
}

/// Returns `true` if the output of a test program contains the failure of this test.
fn has_failed(output: &str, name: &str) -> bool {
    let line = format!("test {name} ");
    output.lines().any(|text| text.starts_with(&line) && text.ends_with("FAILED"))
}

/// Returns the names of the tests of a group.
fn names(cases: &[Case], group: &[usize]) -> String {
    group.iter().map(|&n| &*cases[n].name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::prove::evidence::Named;

    #[test]
    fn tests_that_found_a_neighbour_run_first_and_then_those_of_the_module() {
        let case = |program, name: &str, seconds| Case {
            program,
            name: name.into(),
            seconds,
            reached: BTreeSet::new(),
        };
        let cases = [
            case(0, "motion::jog::tests::a", 0.1),
            case(0, "motion::jogger::tests::b", 0.1),
            case(1, "jogging::c", 1.1),
            case(1, "jogging::d", 0.2),
            case(1, "jogging::e", 0.15),
        ];
        let file = "crates/jtc-core/src/motion/jog.rs".to_owned();
        let mutant = Mutant {
            id: String::new(),
            ordinal: 1,
            named: Named { file: file.clone(), line: String::new(), change: String::new() },
            at: 1,
        };
        let mut finders = Finders::default();
        finders.of_file.insert(file, vec![4, 0, 4, 9]);
        finders.counts.insert(2, 9);
        let groups = groups(&cases, vec![0, 1, 2, 3, 4], &mutant, &finders);
        assert_eq!(groups, [vec![0], vec![4], vec![1], vec![2, 3]]);
        finders = Finders::default();
        let groups = super::groups(&cases, vec![0, 1, 2, 3], &mutant, &finders);
        assert_eq!(groups, [vec![0], vec![1], vec![3, 2]]);
    }
}
