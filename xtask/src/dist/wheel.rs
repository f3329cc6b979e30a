//! The wheel of the Python package, which Maturin builds.
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use super::packages::Made;
use super::programs::{self, Platform};
use crate::shell::{self, Scratch, run};

/// Returns the folder with the source of the Python package. Returns `None` if the checkout does not contain the
/// folder.
pub(super) fn folder() -> Option<PathBuf> {
    Some(shell::root().join("crates/openjtc-py")).filter(|folder| folder.join("pyproject.toml").exists())
}

/// File that lists the third-party parts of the package. `license-files` in pyproject.toml contains the path of this
/// file.
const THIRD_PARTY: &str = "LICENSE-THIRD-PARTY.txt";

/// Builds the wheel, which works with every glibc from 2.17 on.
pub(super) fn build(platform: Platform, time: u64, third_party: &str) -> Result<Made> {
    let folder = folder().context("crates/openjtc-py is not there")?;
    programs::add_target(platform.library)?;
    let tools = programs::tools()?;
    let scratch = Scratch::new(&format!("wheel-{}", platform.machine))?;
    let mut build = shell::command(tools.join("maturin"));
    build.args([
        "build",
        "--locked",
        "--profile",
        "dist",
        "--strip",
        "--zig",
        "--compatibility",
        "manylinux2014",
    ]);
    build.args(["--target", platform.library, "--out"]).arg(scratch.path());
    build.arg("--manifest-path").arg(folder.join("Cargo.toml"));
    programs::without_paths(&mut build, platform.library)?;
    programs::with_tools(&mut build, &tools, time)?;
    build.env("CARGO_PROFILE_DIST_DEBUG", "false").env("CARGO_TARGET_DIR", shell::target());
    let texts = folder.join(THIRD_PARTY);
    std::fs::write(&texts, third_party)?;
    let built = run(&mut build);
    std::fs::remove_file(&texts)?;
    built?;
    let mut wheels = std::fs::read_dir(scratch.path())?.collect::<std::io::Result<Vec<_>>>()?;
    wheels.retain(|entry| entry.path().extension().is_some_and(|ending| ending == "whl"));
    let [wheel] = &*wheels else { bail!("Maturin left {} wheels, not one", wheels.len()) };
    look_into(&tools, &wheel.path(), &scratch.path().join("unpacked"))?;
    Ok(Made { name: wheel.file_name().to_string_lossy().into_owned(), bytes: std::fs::read(wheel.path())? })
}

/// Checks that no file of a wheel contains a path of this computer, and that the wheel contains the licences.
fn look_into(tools: &Path, wheel: &Path, unpacked: &Path) -> Result<()> {
    let mut unpack = shell::command(tools.join("python"));
    run(unpack.args(["-m", "zipfile", "-e"]).arg(wheel).arg(unpacked))?;
    let (mut waiting, mut licences) = (vec![unpacked.to_owned()], BTreeSet::new());
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            let name = path.strip_prefix(unpacked)?.display().to_string();
            if path.is_dir() {
                waiting.push(path);
                continue;
            }
            programs::has_no_paths(&name, &std::fs::read(&path)?)?;
            if name.contains(".dist-info/licenses/") {
                licences.extend(path.file_name().map(|name| name.to_string_lossy().into_owned()));
            }
        }
    }
    for name in ["LICENSE-APACHE", "LICENSE-MIT", THIRD_PARTY] {
        ensure!(licences.contains(name), "the wheel has no {name} among its licences, only {licences:?}");
    }
    Ok(())
}
