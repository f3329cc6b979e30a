//! Tests the Python package: builds its wheel, installs the wheel in an empty environment, and tests the wheel there. The source tree
//! is not tested, because it does not contain the compiled part of the package.
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::parallel;
use crate::python;
use crate::shell::{self, Scratch, root, run};
use crate::suite;
use crate::tally::{self, Counts, Outcome, Tally};

/// File that lists the Python packages for the build and the tests of the Python package.
const REQUIREMENTS: &str = "requirements-package.txt";

/// Program that runs in a new environment, with the lines of the README that need only the package.
const FIRST_LINES: &str = "import openjtc\n\
    with openjtc.connect('sim:', speed=None) as robot:\n    \
        run = robot.move([0, 30, -60, 0, 30, 0], degrees=True)\n    \
        print(run)\n    \
        assert run.outcome == 'finished' and run._repr_html_().startswith('<iframe')\n";

/// Returns the folder that contains the wheel.
fn wheels() -> PathBuf {
    shell::target().join("wheels")
}

fn is_own(path: &Path) -> bool {
    path.file_name().is_some_and(|name| {
        let name = name.to_string_lossy();
        name.starts_with("openjtc-") && name.ends_with(".whl")
    })
}

/// Builds the wheel for this computer from the files that the tests have compiled. `cargo xtask dist` builds the wheels of a
/// release.
pub(crate) fn build() -> Result<PathBuf> {
    let python = python::environment(REQUIREMENTS)?;
    let programs = python.parent().context("an interpreter in no folder")?;
    let folder = wheels();
    for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
        if is_own(&entry.path()) {
            std::fs::remove_file(entry.path())?;
        }
    }
    let mut build = shell::command(programs.join("maturin"));
    build
        .args(["build", "--release", "--locked", "--quiet", "--compatibility", "linux", "--interpreter"])
        .arg(&python);
    build.arg("--out").arg(&folder).arg("--manifest-path").arg("crates/openjtc-py/Cargo.toml");
    run(shell::lint(build.env("CARGO_TARGET_DIR", shell::target()))?)?;
    let mut made =
        std::fs::read_dir(&folder)?.flatten().map(|entry| entry.path()).filter(|path| is_own(path));
    made.next().context("Maturin left no wheel")
}

/// Runs the package steps of `cargo xtask test`. No other check runs at the same time, because many tests of the
/// package run simulated arms in real time.
pub(crate) fn steps(tally: &mut Tally) {
    let mut wheel = None;
    tally.step("Python package: wheel", || {
        wheel = Some(build()?);
        Ok(Outcome::Passed)
    });
    tally.step("Python package: in a fresh environment, the first lines", || {
        let wheel = wheel.as_deref().context("there is no wheel")?;
        fresh(wheel).map(|()| Outcome::Passed)
    });
    tally.step("Python package: types and tests", || {
        let wheel = wheel.as_deref().context("there is no wheel")?;
        tested(wheel)
    });
}

/// Tests the wheel in an environment without tools other than Python.
fn fresh(wheel: &Path) -> Result<()> {
    let scratch = Scratch::new("fresh-python")?;
    let environment = scratch.path().join("environment");
    run(shell::command("python3").args(["-m", "venv"]).arg(&environment))?;
    let python = environment.join("bin/python");
    run(python::pip_install(&python).arg(wheel))?;
    run(shell::command(&python).args(["-c", FIRST_LINES]).current_dir(scratch.path()))
}

/// Checks the types of the installed wheel and runs the tests of the package.
fn tested(wheel: &Path) -> Result<Outcome> {
    let python = python::environment(REQUIREMENTS)?;
    run(python::pip_install(&python).args(["--force-reinstall", "--no-deps"]).arg(wheel))?;
    let programs = suite::programs()?;
    let scratch = Scratch::new("package")?;
    let mypy = |arguments: &[&str]| {
        let mut mypy = shell::command(&python);
        mypy.args(["-m"]).args(arguments).current_dir(scratch.path());
        run(&mut mypy)
    };
    mypy(&["mypy", "--strict", "--package", "openjtc", "--cache-dir", "cache"])?;
    mypy(&["mypy.stubtest", "openjtc._native"])?;
    let mut tests = shell::command(&python);
    tests
        .args(["-m", "pytest", "-q", "-rs", "-p", "no:cacheprovider", "-n", "3"])
        .arg(root().join("crates/openjtc-py/tests"));
    tests.env("JTC", programs.join("jtc")).env("UCOM", programs.join("ucom"));
    tests.env("OPENJTC_ROBOTS", python::robots());
    tests.env("PYTHONDONTWRITEBYTECODE", "1").env("MPLBACKEND", "agg").current_dir(scratch.path());
    let ended = parallel::run(&mut tests, &scratch.path().join("log"))?;
    println!("{}\n({:.1} s)", ended.output.trim_end(), ended.seconds);
    let counts = counted(&ended.output);
    ensure!(ended.passed || counts.failed > 0, "the tests broke off");
    ensure!(counts.passed > 0, "no test was run at all");
    Ok(Outcome::Counted(counts, tally::failures(&ended.output, "FAILURES").to_owned()))
}

/// Returns the test counts in the last line that pytest prints.
fn counted(output: &str) -> Counts {
    let line = output.lines().rev().find(|line| line.contains(" in ")).unwrap_or_default();
    let words: Vec<&str> = line.split([' ', ',', '=']).filter(|word| !word.is_empty()).collect();
    let number = |names: &[&str]| {
        let of = |pair: &[&str]| names.contains(&pair[1]).then(|| pair[0].parse::<u64>().ok()).flatten();
        words.windows(2).filter_map(of).sum()
    };
    Counts {
        passed: number(&["passed"]),
        failed: number(&["failed", "error", "errors"]),
        skipped: number(&["skipped"]),
        ..Counts::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_of_pytest_is_counted() {
        let counts = counted("x in y\n1 failed, 20 passed, 3 skipped, 2 errors in 10.00s\n");
        assert_eq!((counts.passed, counts.failed, counts.skipped), (20, 3, 3));
        assert_eq!(counted("=== 7 passed in 0.10s (0:00:01) ===").passed, 7);
        assert_eq!(counted("").passed, 0);
    }
}
