//! Programs that run beside each other: most of ours wait for what takes its time, and use little of a processor.
use std::collections::VecDeque;
use std::fs::File;
use std::io::{Read as _, Seek as _};
use std::num::NonZero;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use anyhow::Result;

use crate::shell::Scratch;

/// What a program printed, and how it ended.
pub struct Ended {
    /// On both of its outputs.
    pub output: String,
    /// With exit code 0.
    pub passed: bool,
    /// How long it took.
    pub seconds: f64,
}

/// Calls `run` with each of `items`, with one more at once than there are processors; `log` is a file for what that one prints. `ended` has
/// what came of each, as they end.
pub fn beside<T: Send, R>(
    items: Vec<T>,
    run: impl Fn(&T, &Path) -> R + Sync,
    ended: impl FnMut(T, R) + Send,
) -> Result<()> {
    let scratch = Scratch::new("beside")?;
    let at_once = std::thread::available_parallelism().map_or(1, NonZero::get) + 1;
    let (waiting, ended) = (Mutex::new(VecDeque::from(items)), Mutex::new(ended));
    let worker = |number: usize| {
        let log = scratch.path().join(number.to_string());
        loop {
            let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
            let Some(item) = next else { return };
            let came = run(&item, &log);
            ended.lock().unwrap_or_else(PoisonError::into_inner)(item, came);
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once).map(|number| scope.spawn(move || worker(number))).collect();
        workers.into_iter().for_each(|worker| {
            worker.join().unwrap_or_else(|e| std::panic::resume_unwind(e));
        });
    });
    Ok(())
}

/// Runs a command whose output goes to `log`.
pub fn run(command: &mut Command, log: &Path) -> Result<Ended> {
    let start = Instant::now();
    let mut file = File::options().create(true).truncate(true).read(true).write(true).open(log)?;
    let status = command.stdin(Stdio::null()).stdout(file.try_clone()?).stderr(file.try_clone()?).status()?;
    let mut output = Vec::new();
    file.rewind()?;
    file.read_to_end(&mut output)?;
    let mut output = String::from_utf8_lossy(&output).into_owned();
    if !status.success() {
        output.push_str(&format!("\n{status}"));
    }
    Ok(Ended { output, passed: status.success(), seconds: start.elapsed().as_secs_f64() })
}
