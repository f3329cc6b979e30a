//! Checks of the dashboard. The checks examine its source, build it again, compare the result with the built files in
//! web/dist, and test the dashboard in a browser.
//!
//! A build of the programs needs none of these steps, because the built dashboard files are in the repository.
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::parallel::{self, Ended};
use crate::python;
use crate::shell::{self, Scratch, run};
use crate::tally::{self, Counts, Outcome, Tally};

/// Path of the browser that Debian installs.
pub(crate) const BROWSER: &str = "/usr/bin/chromium";

/// Returns a command for `program` of Node.js in `web/`. Node.js is installed in the Python environment of the
/// reference checks, so the system does not need Node.js.
fn command(program: &str) -> Result<Command> {
    let python = python::environment("requirements.txt")?;
    let programs = python.parent().context("an interpreter in no folder")?;
    let mut command = shell::command(programs.join(program));
    let others = std::env::var_os("PATH").unwrap_or_default();
    let all = [programs.to_owned()].into_iter().chain(std::env::split_paths(&others));
    command.current_dir(shell::root().join("web")).env("PATH", std::env::join_paths(all)?);
    Ok(command)
}

/// Installs the packages of the lock file from the package registry.
fn install() -> Result<()> {
    let stamp = shell::root().join("web/node_modules/.package-lock.json");
    let lock = shell::root().join("web/package-lock.json");
    let time = |path: &Path| path.metadata().and_then(|data| data.modified()).ok();
    if time(&stamp).is_some_and(|installed| time(&lock).is_some_and(|wanted| installed >= wanted)) {
        return Ok(());
    }
    run(command("npm")?.args(["ci", "--no-audit", "--no-fund", "--ignore-scripts", "--loglevel=error"]))
        .context("the packages could not be installed; is the network there?")
}

/// Runs the steps that check the dashboard source.
pub(crate) fn steps(tally: &mut Tally) {
    tally.step("dashboard: types and tests of its source", || {
        install()?;
        run(command("npm")?.args(["run", "--silent", "check"]))?;
        let scratch = Scratch::new("web")?;
        let mut test = command("npm")?;
        let ended = parallel::run(test.args(["run", "--silent", "test"]), &scratch.path().join("log"))?;
        println!("{}", ended.output.trim_end());
        counted(&ended)
    });
    tally.step("dashboard: the built files are those of its source", || {
        install().and_then(|()| same_build()).map(|()| Outcome::Passed)
    });
}

/// Builds the dashboard in a temporary folder, and compares the built files with the files in web/dist.
fn same_build() -> Result<()> {
    let (kept, scratch) = (shell::root().join("web/dist"), Scratch::new("web-dist")?);
    let built = scratch.path().join("dist");
    run(command("npx")?
        .args(["--no-install", "vite", "build", "--logLevel", "error", "--outDir"])
        .arg(&built))?;
    run(command("node")?.arg("tests/sizes.mjs"))?;
    let (old, new) = (files(&kept)?, files(&built)?);
    let help = "(cd web && npm ci && npm run build), and commit web/dist";
    ensure!(old == new, "web/dist holds other files than its source makes: {help}");
    for name in old {
        let read = |folder: &Path| std::fs::read(folder.join(&name));
        ensure!(
            read(&kept)? == read(&built)?,
            "web/dist/{} is not what its source makes: {help}",
            name.display()
        );
    }
    Ok(())
}

/// Returns all files in a folder, with their paths relative to the folder.
fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let (mut found, mut waiting) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(directory) = waiting.pop() {
        for entry in std::fs::read_dir(&directory).with_context(|| directory.display().to_string())? {
            let path = entry?.path();
            if path.is_dir() {
                waiting.push(path);
            } else {
                found.push(path.strip_prefix(folder)?.to_owned());
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Installs the browser of Debian if the browser is missing and the user is permitted to install it.
pub(crate) fn install_browser() -> Result<()> {
    if Path::new(BROWSER).exists() { Ok(()) } else { shell::apt_install(&["chromium"]) }
}

/// Returns the check that tests the dashboard in a browser.
pub(crate) fn browser<'a>() -> parallel::Check<'a> {
    parallel::Check {
        title: "dashboard: used in a browser".into(),
        run: Box::new(use_in_browser),
        outcome: counted,
        missing: format!("there is no {BROWSER}; install it by hand: sudo apt-get install chromium"),
    }
}

/// Tests the dashboard in a browser, with the built programs, and returns the output of the tests. Returns `None` if no
/// browser is installed and none can be installed.
fn use_in_browser(log: &Path) -> Result<Option<Ended>> {
    if install_browser().is_err() {
        return Ok(None);
    }
    install()?;
    let release = shell::target().join("release");
    let mut npm = command("npm")?;
    npm.args(["run", "--silent", "e2e"]);
    npm.env("JTC", release.join("jtc")).env("UCOM", release.join("ucom")).env("CHROMIUM", BROWSER);
    // The browser draws 3D without hardware support and needs much processor time. Therefore, parallel programs that
    // depend on real time get priority.
    parallel::run(&mut shell::nice(&npm, 5), log).map(Some)
}

/// Returns the test counts that the test runner of Node.js prints.
fn counted(Ended { output, passed, .. }: &Ended) -> Result<Outcome> {
    let number = |word: &str| {
        let lines = output.lines().map(|line| line.trim_start_matches(['#', 'ℹ', ' ']));
        lines.filter_map(|line| line.strip_prefix(word)?.trim().parse::<u64>().ok()).sum::<u64>()
    };
    let counts = Counts {
        passed: number("pass "),
        failed: number("fail "),
        skipped: number("skipped "),
        ..Counts::default()
    };
    ensure!(*passed || counts.failed > 0, "the tests broke off");
    ensure!(counts.passed > 0, "no test was run at all");
    Ok(Outcome::Counted(counts, tally::failures(output, "✖ failing tests:").to_owned()))
}
