//! Handling of Ctrl-C. The first Ctrl-C cancels the command, but the command completes the steps that it has started.
//! The second Ctrl-C ends the process at once, and prints the remaining steps and the command for them.

use std::io::Write;
use std::time::Duration;

use cli_kit::exit::FAULT;
use cli_kit::{Stop, print_within};
use ucom_host::session::CleanupList;

/// Maximum wait for a blocked reader of stderr.
const PRINT_TIMEOUT: Duration = Duration::from_millis(300);

/// Starts the handling of Ctrl-C.
pub(crate) fn listen(cleanup: &CleanupList) -> std::io::Result<Stop> {
    let cleanup = cleanup.clone();
    Stop::listen_with(move || {
        let words = cleanup.words();
        // Removes output files that the command has created but not written.
        cli_kit::output_file::abandon();
        print_within(PRINT_TIMEOUT, move || {
            let _ = std::io::stderr().write_all(words.as_bytes());
        });
        FAULT
    })
}
