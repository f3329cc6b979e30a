//! Checks against independent references in Python. The checks run in a virtual environment, which this module creates
//! automatically.
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, bail, ensure};

use crate::parallel::{self, Ended};
use crate::shell::{self, apt_install, command, root, run, works};
use crate::suite;
use crate::tally::{Outcome, Tally};

/// Returns the interpreter of a virtual environment with the packages of references/`requirements`. Creates the
/// environment if it does not exist.
pub(crate) fn environment(requirements: &str) -> Result<PathBuf> {
    // A second caller waits while the first caller creates the environment.
    static MAKING: Mutex<()> = Mutex::new(());
    let _making = MAKING.lock().unwrap_or_else(PoisonError::into_inner);
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
    let mut install = pip_install(&python);
    install.args(["--only-binary", ":all:", "-r"]);
    run(install.arg(&list)).context("the packages could not be installed; is the network there?")?;
    std::fs::write(&stamp, "")?;
    Ok(python)
}

/// Returns a `pip install` command for the environment of this interpreter; the caller adds the packages.
pub(crate) fn pip_install(python: &Path) -> Command {
    let mut install = command(python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    install
}

/// Returns the folder of third-party robot descriptions, which all environments share.
pub(crate) fn robots() -> PathBuf {
    shell::target().join("robots")
}

/// Arguments of a check.
struct Check {
    /// Path of the script below references/.
    script: &'static str,
    /// Path of the program that the check runs, below the release folder. This path is the first argument of the
    /// script.
    program: Option<&'static str>,
    /// Files of the demo that the check reads. The names of these files are the next arguments of the script.
    demo_files: &'static [&'static str],
}

static CHECKS: [Check; 25] = [
    Check { script: "dynamics/check_codegen.py", program: None, demo_files: &[] },
    Check { script: "dynamics/check_pinocchio.py", program: Some("examples/reference"), demo_files: &[] },
    Check { script: "plan/check_plan.py", program: Some("examples/plans"), demo_files: &[] },
    Check { script: "plan/check_kinematics.py", program: Some("examples/poses"), demo_files: &[] },
    Check { script: "arms/check_import.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "arms/check_driving.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "mujoco/check_free_fall.py", program: Some("examples/free_fall"), demo_files: &[] },
    Check { script: "can/check_multicast.py", program: None, demo_files: &[] },
    Check { script: "can/check_socketcand.py", program: None, demo_files: &[] },
    Check { script: "can/check_slcan.py", program: None, demo_files: &[] },
    Check {
        script: "recording/check_mcap.py",
        program: None,
        demo_files: &["recording.mcap", "recording.csv"],
    },
    Check { script: "agent/check_api.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "recording/check_standalone.py", program: None, demo_files: &["recording.mcap"] },
    Check { script: "recording/check_readers.py", program: Some("jtc"), demo_files: &["recording.mcap"] },
    Check { script: "agent/check_metrics.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "agent/check_foxglove.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "agent/check_ucom_api.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "host/check_serial_host.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "agent/check_modbus.py", program: Some("jtc"), demo_files: &[] },
    Check { script: "ucom/check_boards.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "ucom/check_codec.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "ucom/check_pc.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "ucom/check_pc_update.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "ucom/check_pc_running.py", program: Some("ucom"), demo_files: &[] },
    Check { script: "ucom/check_pc_probe.py", program: Some("ucom"), demo_files: &[] },
];

/// Runs the preparation steps, and returns a check for each independent reference. `demo` is the folder with the files
/// of the demo.
pub(crate) fn checks<'a>(tally: &mut Tally, demo: &'a Path) -> Vec<parallel::Check<'a>> {
    let mut python = None;
    tally.step("Python environment of the references", || {
        python = Some(environment("requirements.txt")?);
        Ok(Outcome::Passed)
    });
    let mut built = false;
    tally.step("programs for the references", || {
        suite::programs()?;
        built = true;
        Ok(Outcome::Passed)
    });
    tally.step("every reference is run", || {
        for script in shell::files(&root().join("references"), &["py"]) {
            let name =
                script.strip_prefix(root().join("references")).unwrap_or(&script).display().to_string();
            ensure!(
                !name.contains("check_") || CHECKS.iter().any(|check| check.script == name),
                "xtask/src/python.rs does not know references/{name}"
            );
        }
        Ok(Outcome::Passed)
    });
    let Some(python) = python.filter(|_| built) else {
        tally.step("references", || bail!("there is no Python environment, or the programs were not built"));
        return Vec::new();
    };
    let check = |check: &'static Check| {
        let python = python.clone();
        parallel::Check {
            title: format!("references/{}", check.script),
            run: Box::new(move |log| check.run((&python, demo), log)),
            outcome: parallel::whole,
            missing: "the demo left no file for it".into(),
        }
    };
    CHECKS.iter().map(check).collect()
}

impl Check {
    /// Runs the Python script of the check. Returns `None` if the demo did not write its files to `demo`.
    fn run(&self, (python, demo): (&Path, &Path), log: &Path) -> Result<Option<Ended>> {
        if !self.demo_files.iter().all(|name| demo.join(name).exists()) {
            return Ok(None);
        }
        let release = shell::target().join("release");
        let mut script = command(python);
        script.arg(Path::new("references").join(self.script));
        script.args(self.program.map(|name| release.join(name)));
        script.args(self.demo_files.iter().map(|name| demo.join(name)));
        script.env("JTC_EXAMPLES", release.join("examples")).env("OPENJTC_ROBOTS", robots());
        script.env("PYTHONDONTWRITEBYTECODE", "1");
        parallel::run(&mut script, log).map(Some)
    }
}
