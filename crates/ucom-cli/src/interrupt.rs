//! Ctrl-C: the first one cancels the command, which completes the steps that it has started. The second one ends the
//! process at once, and prints the remaining steps and their command.

use std::io::Write;
use std::time::Duration;

use cli_kit::exit::FAULT;
use cli_kit::{Stop, print_within};
use ucom_host::session::CleanupList;

/// Longest wait for a blocked reader.
const PRINT_TIMEOUT: Duration = Duration::from_millis(300);

/// Starts to handle Ctrl-C.
pub(crate) fn listen(cleanup: &CleanupList) -> std::io::Result<Stop> {
    let cleanup = cleanup.clone();
    Stop::listen_with(move || {
        let words = cleanup.words();
        // Removes files that were created but not written.
        cli_kit::output_file::abandon();
        print_within(PRINT_TIMEOUT, move || {
            let _ = std::io::stderr().write_all(words.as_bytes());
        });
        FAULT
    })
}
