//! `cargo xtask size`: checks that the static memory of the controller and its trajectory does not exceed the limit. The
//! command also prints the memory use of each board by memory region.
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

use crate::shell;
use crate::{firmware, suite};

/// Largest size of the controller with its trajectory, bytes. The trajectory points need 432 000 bytes. All other data
/// (including the stored arm) may use 40 KiB of the fast memory of the board. The limit does not include the receive buffers
/// of 60 000 bytes.
pub(crate) const LIMIT: u64 = 432_000 + 40 * 1024;

/// Returns the size of the controller in the compiled program, bytes. The size includes the memory for 12 000 points.
pub(crate) fn controller_bytes() -> Result<u64> {
    let text = shell::read(&mut shell::command(suite::programs()?.join("examples/tick")))?;
    let line = text.lines().find_map(|line| line.strip_prefix("controller_bytes "));
    line.context("the example `tick` of jtc-core printed no controller_bytes")?
        .trim()
        .parse()
        .context("controller_bytes")
}

/// Returns an error if the size of the controller exceeds the limit.
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

/// Returns the memory use of a board's firmware, with one line for each memory region. The firmware must have been
/// built before.
pub(crate) fn regions(board: &str) -> Result<String> {
    let used = firmware::used(&firmware::elf(board))?;
    Ok(used.iter().map(|(name, bytes, size)| format!("  {name}: {bytes} of {size} B\n")).collect())
}

/// Runs `cargo xtask size`, which has no arguments.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    shell::nothing_left(arguments)?;
    check()?;
    for board in firmware::BOARDS {
        firmware::build(board)?;
        print!("{board}\n{}", regions(board)?);
    }
    Ok(ExitCode::SUCCESS)
}
