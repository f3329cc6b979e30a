//! What later steps need, made at the lowest priority while the steps before them wait.
//!
//! Most tests wait: for a line as slow as a real one, for leases that lapse. What they leave of the processors builds the released programs,
//! the boards' and the emulator. A build that fails says so in the step that needs it, which asks for the same and finds it made or not.
use std::thread::JoinHandle;

use anyhow::Result;

use crate::{book, emulate, firmware, package, python, shell, web};

/// What is being made.
pub struct Ahead(Option<JoinHandle<()>>);

impl Ahead {
    /// Begins with what takes longest.
    pub fn begin() -> Self {
        let make = || shell::in_background(|| drop(make()));
        Self(Some(std::thread::spawn(make)))
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        if let Some(thread) = self.0.take() {
            // A panic of it is none of the checks'.
            let _ = thread.join();
        }
    }
}

fn make() -> Result<()> {
    python::environment("requirements.txt")?;
    // Without it the step that needs it is skipped.
    let _ = web::install_browser();
    python::programs()?;
    package::build()?;
    emulate::programs()?;
    firmware::lints()?;
    for board in firmware::BOARDS {
        firmware::build(board)?;
    }
    book::build()
}
