//! `cargo xtask soak`: runs hours of virtual time with random commands and faults, and checks the invariants in each
//! tick.
use std::process::ExitCode;

use anyhow::{Result, ensure};

use crate::shell::{self, cargo, run};

/// Runs `cargo xtask soak`. `arguments` may contain `--hours H` and `--seed N`.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let hours = shell::option(&mut arguments, "--hours")?.unwrap_or_else(|| "24".into());
    let seed = shell::option(&mut arguments, "--seed")?.unwrap_or_else(|| "1".into());
    shell::nothing_left(&arguments)?;
    ensure!(hours.parse::<f64>().is_ok_and(|h| h > 0.0), "--hours needs a positive number, not `{hours}`");
    ensure!(seed.parse::<u64>().is_ok(), "--seed needs a whole number, not `{seed}`");
    let program = ["run", "--profile", "dist", "--package", "sim-checks", "--example", "soak", "--"];
    run(cargo(&program).args(["--hours", &hours, "--seed", &seed]))?;
    Ok(ExitCode::SUCCESS)
}
