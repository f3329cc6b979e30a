//! `cargo xtask fuzz`: runs the fuzz targets with cargo-fuzz on the nightly toolchain, both installed when missing.
use std::process::{Command, ExitCode};

use anyhow::{Result, ensure};

use crate::shell::{self, command, root, run, works};

const RUNS: &str = "20000000";

/// A command of the nightly toolchain; the pinned toolchain's variables are taken away.
fn nightly(arguments: &[&str]) -> Command {
    let mut rustup = command("rustup");
    rustup.args(["run", "nightly"]).args(arguments).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
    rustup
}

/// `arguments`: a target, `--runs N`.
pub fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let runs = shell::option(&mut arguments, "--runs")?.unwrap_or_else(|| RUNS.into());
    ensure!(runs.parse::<u64>().is_ok(), "--runs needs a number, not `{runs}`");
    let only = if arguments.is_empty() { None } else { Some(arguments.remove(0)) };
    shell::nothing_left(&arguments)?;

    if !works(&mut nightly(&["rustc", "--version"])) {
        run(command("rustup").args(["toolchain", "install", "nightly", "--profile", "minimal"]))?;
    }
    if !works(&mut nightly(&["cargo", "fuzz", "--version"])) {
        run(&mut nightly(&["cargo", "install", "cargo-fuzz", "--locked"]))?;
    }
    let mut targets: Vec<String> = shell::files(&root().join("fuzz/fuzz_targets"), &["rs"])
        .iter()
        .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
        .collect();
    if let Some(only) = only {
        ensure!(targets.contains(&only), "no fuzz target `{only}`; there are: {}", targets.join(", "));
        targets = vec![only];
    }
    ensure!(!targets.is_empty(), "there is no fuzz target in fuzz/fuzz_targets");
    for target in targets {
        println!("\n== {target}: {runs} executions");
        // Without address sanitizer: there is no unsafe code, and it is several times as fast.
        let limit = format!("-runs={runs}");
        run(&mut nightly(&["cargo", "fuzz", "run", "-s", "none", &target, "--", &limit, "-max_len=16384"]))?;
    }
    Ok(ExitCode::SUCCESS)
}
