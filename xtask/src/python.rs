//! Independent references in Python: a virtual environment made by itself, and the checks that run in it.
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};

use crate::shell::{self, apt_install, cargo, command, root, run, works};
use crate::tally::{Outcome, Tally};

/// The interpreter of a virtual environment with the packages of references/`requirements`, made when it is not there yet.
pub fn environment(requirements: &str) -> Result<PathBuf> {
    let list = root().join("references").join(requirements);
    let text = std::fs::read_to_string(&list).with_context(|| list.display().to_string())?;
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    let directory = shell::target().join(format!("python-{:016x}", hasher.finish()));
    let python = directory.join("bin/python");
    let stamp = directory.join("complete");
    if stamp.exists() {
        return Ok(python);
    }
    println!("making a virtual environment for {requirements} (a few minutes, once)");
    let _ = std::fs::remove_dir_all(&directory);
    let make = || {
        let mut make = command("python3");
        make.args(["-m", "venv"]).arg(&directory);
        make
    };
    if !works(&mut make()) {
        apt_install(&["python3", "python3-venv"])?;
        run(&mut make())?;
    }
    let mut install = command(&python);
    install.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--only-binary",
        ":all:",
        "-r",
    ]);
    run(install.arg(&list)).context("the packages could not be installed; is the network there?")?;
    std::fs::write(&stamp, "")?;
    Ok(python)
}

/// A step for each references/*/check_*.py.
pub fn checks(tally: &mut Tally) {
    let mut python = None;
    tally.step("Python environment of the references", || {
        python = Some(environment("requirements.txt")?);
        Ok(Outcome::Passed)
    });
    let mut built = false;
    tally.step("programs for the references", || {
        run(&mut cargo(&["build", "--release", "--workspace", "--bins", "--examples"]))?;
        built = true;
        Ok(Outcome::Passed)
    });
    for script in shell::files(&root().join("references"), &["py"]) {
        let name = script.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if !name.starts_with("check_") {
            continue;
        }
        let title = script.strip_prefix(root()).unwrap_or(&script).display().to_string();
        tally.step(&title, || {
            let python = python.as_ref().context("no Python environment")?;
            ensure!(built, "the programs it needs were not built");
            let mut check = command(python);
            check.arg(&script);
            check.env("JTC_BIN", shell::target().join("release/jtc"));
            check.env("JTC_EXAMPLES", shell::target().join("release/examples"));
            check.env("PYTHONDONTWRITEBYTECODE", "1");
            run(&mut check).map(|()| Outcome::Passed)
        });
    }
}
