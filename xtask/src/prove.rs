//! `cargo xtask prove`: checks that take hours and are therefore not part of `cargo xtask test`. The results of these
//! checks are in docs/evidence.md.
mod evidence;
mod fuzz;
mod mutants;

use std::process::ExitCode;

use anyhow::{Result, bail};

/// Runs `cargo xtask prove`. `arguments` is `mutants` or `fuzz`, followed by the arguments of the selected check.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    match arguments.split_first() {
        Some((what, rest)) if what == "mutants" => mutants::main(rest),
        Some((what, rest)) if what == "fuzz" => fuzz::main(rest),
        _ => bail!("prove needs `mutants` or `fuzz`; see `cargo xtask help`"),
    }
}
