//! Builds for later steps, made at the lowest priority while earlier steps wait.
//!
//! Most tests wait: for a line as slow as a real one, for leases that lapse. The free processor time is used to build the boards'
//! programs, the emulator and the Python package. A failed build is reported in the step that needs it, because that step runs the same
//! build.
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;

use anyhow::Result;

use crate::{book, emulate, firmware, package, python, shell, web};

/// Build in the background.
pub struct Ahead {
    workspace_is_built: Option<Sender<()>>,
    making: Option<JoinHandle<()>>,
}

impl Ahead {
    /// Begins with the slowest builds.
    pub fn begin() -> Self {
        let (sender, receiver) = mpsc::channel();
        let make = move || shell::in_background(|| drop(make(&receiver)));
        Self { workspace_is_built: Some(sender), making: Some(std::thread::spawn(make)) }
    }

    /// Allows the build of the Python package. Cargo lets one build at a time use a target folder: begun earlier, this one would hold up
    /// the steps at the lowest priority.
    pub fn workspace_is_built(&self) {
        if let Some(sender) = &self.workspace_is_built {
            // An error means that an earlier build has failed and the thread has ended.
            let _ = sender.send(());
        }
    }
}

impl Drop for Ahead {
    fn drop(&mut self) {
        // If the workspace was not built, this ends the thread's wait for it.
        self.workspace_is_built = None;
        if let Some(thread) = self.making.take() {
            // A panic of the thread does not concern the checks.
            let _ = thread.join();
        }
    }
}

fn make(workspace_is_built: &Receiver<()>) -> Result<()> {
    python::environment("requirements.txt")?;
    // Without it the step that needs it is skipped.
    let _ = web::install_browser();
    emulate::programs()?;
    firmware::lints()?;
    for board in firmware::BOARDS {
        firmware::build(board)?;
    }
    book::build()?;
    workspace_is_built.recv()?;
    package::build().map(drop)
}
