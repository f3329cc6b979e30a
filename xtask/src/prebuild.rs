//! Builds that later steps of the tests need. The builds run at the lowest priority while earlier steps wait.
//!
//! Most tests spend their time waiting, for example for a serial line with a realistic speed, or for the end of a lease. The free
//! processor time is used to build the firmware, the emulator and the Python package. If a build fails, the step that needs the
//! build reports the failure, because that step repeats the build.
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;

use anyhow::Result;

use crate::{book, emulate, firmware, package, python, shell, web};

/// Build that runs in the background.
pub(crate) struct Prebuild {
    workspace_is_built: Option<Sender<()>>,
    making: Option<JoinHandle<()>>,
}

impl Prebuild {
    /// Starts the builds in the background. The slowest builds are first in the list.
    pub(crate) fn begin() -> Self {
        let (sender, receiver) = mpsc::channel();
        let make = move || {
            if let Err(error) = shell::in_background(|| make(&receiver)) {
                // Without background builds, the steps build the programs themselves, so the tests take longer.
                println!("-- the builds in advance ended: {error:#}");
            }
        };
        Self { workspace_is_built: Some(sender), making: Some(std::thread::spawn(make)) }
    }

    /// Tells the background thread that the workspace is built, so that it builds the Python package. Cargo allows
    /// only one build at a time in a target folder. An earlier start of this low-priority build would delay the
    /// steps.
    pub(crate) fn workspace_is_built(&self) {
        if let Some(sender) = &self.workspace_is_built {
            // This call fails only if an earlier build has failed and the thread has ended.
            let _ = sender.send(());
        }
    }
}

impl Drop for Prebuild {
    fn drop(&mut self) {
        // If the workspace was not built, this assignment makes the background thread stop waiting.
        self.workspace_is_built = None;
        if let Some(thread) = self.making.take() {
            // A panic of the background thread has no effect on the checks, so the code ignores it.
            let _ = thread.join();
        }
    }
}

fn make(workspace_is_built: &Receiver<()>) -> Result<()> {
    python::environment("requirements.txt")?;
    // The code ignores an error: without the browser, the step that needs the browser is skipped.
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
