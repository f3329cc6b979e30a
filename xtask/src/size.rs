//! `cargo xtask size`: checks that the static memory of the controller and its trajectory is below the limit. Prints the memory of
//! each board by region.
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

use crate::shell;
use crate::{firmware, suite};

/// Largest size of the controller with its trajectory, bytes. The points need 432 000 bytes, and the other data (including the
/// stored arm) may use 40 KiB of the board's fast memory. The receive buffers of 60 000 bytes are not included.
pub(crate) const LIMIT: u64 = 432_000 + 40 * 1024;

/// Returns the size of the controller with memory for 12 000 points in the compiled program, bytes.
pub(crate) fn controller_bytes() -> Result<u64> {
    let text = shell::read(&mut shell::command(suite::programs()?.join("examples/tick")))?;
    let line = text.lines().find_map(|line| line.strip_prefix("controller_bytes "));
    line.context("the example `tick` of jtc-core printed no controller_bytes")?
        .trim()
        .parse()
        .context("controller_bytes")
}

/// Returns an error if the size is above the limit.
pub(crate) fn check() -> Result<()> {
    let bytes = controller_bytes()?;
    println!(
        "controller with its trajectory: {bytes} B = {:.1} KiB of {} KiB",
        bytes as f64 / 1024.0,
        LIMIT / 1024
    );
    ensure!(bytes <= LIMIT, "the controller takes {bytes} B; the limit is {LIMIT} B");
    Ok(())
}

/// Returns the memory use of a board's program, with one line for each region. The program must have been built.
pub(crate) fn regions(board: &str) -> Result<String> {
    let used = firmware::used(&firmware::elf(board))?;
    Ok(used.iter().map(|(name, bytes, size)| format!("  {name}: {bytes} of {size} B\n")).collect())
}

/// No arguments.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    shell::nothing_left(arguments)?;
    check()?;
    for board in firmware::BOARDS {
        firmware::build(board)?;
        print!("{board}\n{}", regions(board)?);
    }
    Ok(ExitCode::SUCCESS)
}
