//! `cargo xtask bench`: figures beside their anchors, all measured in the same run.
use std::process::ExitCode;

use anyhow::{Result, bail};

/// `arguments`: `--json FILE`, `--quick`.
pub fn main(_arguments: &[String]) -> Result<ExitCode> {
    bail!("the figures are not wired up yet")
}
