//! The Python package, which is built with Maturin.
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use super::programs::{self, Platform};
use crate::shell::{self, Scratch, run};

/// Where its source is; `None` in a checkout without it.
pub fn folder() -> Option<PathBuf> {
    Some(shell::root().join("crates/openjtc-py")).filter(|folder| folder.join("pyproject.toml").exists())
}

/// Builds the wheel into `out`; it runs with every glibc from 2.17 on.
pub fn build(platform: Platform, time: u64, out: &Path) -> Result<()> {
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
    run(&mut build)?;
    let mut wheels = 0;
    for entry in std::fs::read_dir(scratch.path())? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == "whl") {
            std::fs::copy(&path, out.join(path.file_name().unwrap_or_default()))?;
            wheels += 1;
        }
    }
    ensure!(wheels == 1, "Maturin left {wheels} wheels, not one");
    Ok(())
}
