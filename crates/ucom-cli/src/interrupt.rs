//! Ctrl-C: the first one cancels, and what is begun is brought to an end; the second one ends the process at once, and prints
//! what is left undone and the command that does it.

use std::io::Write;
use std::time::Duration;

use cli_kit::exit::FAULT;
use cli_kit::{Stop, print_within};
use ucom_host::session::CleanupList;

/// A reader that does not take what is printed is not waited for longer.
const PRINT_TIMEOUT: Duration = Duration::from_millis(300);

/// Handles Ctrl-C from now on.
pub fn listen(cleanup: &CleanupList) -> std::io::Result<Stop> {
    let cleanup = cleanup.clone();
    Stop::listen_with(move || {
        let words = cleanup.words();
        // Files that were made and not written.
        cli_kit::output_file::abandon();
        print_within(PRINT_TIMEOUT, move || {
            let _ = std::io::stderr().write_all(words.as_bytes());
        });
        FAULT
    })
}
