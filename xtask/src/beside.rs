//! Runs programs in parallel: most of ours wait for a line or a bus in real time, and use little of a processor.
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

/// Items that wait for a worker, and the number of workers.
pub struct Lane<T> {
    /// Number of items that are run at once.
    pub at_once: usize,
    /// Items, in the order in which they begin.
    pub items: Vec<T>,
}

impl<T> Lane<T> {
    /// One worker more than there are processors.
    pub fn new(items: Vec<T>) -> Self {
        Self { at_once: std::thread::available_parallelism().map_or(1, NonZero::get) + 1, items }
    }
}

/// Calls `run` with each item of the lanes, which proceed in parallel; `log` is a file for what the item prints. Passes each result to `ended`
/// as soon as there is one.
pub fn beside<T: Send, R>(
    lanes: Vec<Lane<T>>,
    run: impl Fn(&T, &Path) -> R + Sync,
    ended: impl FnMut(T, R) + Send,
) -> Result<()> {
    let scratch = Scratch::new("beside")?;
    let lanes: Vec<_> = lanes
        .into_iter()
        .map(|Lane { at_once, items }| (at_once, Mutex::new(VecDeque::from(items))))
        .collect();
    let ended = Mutex::new(ended);
    let worker = |lane: usize, number: usize| {
        let log = scratch.path().join(format!("{lane}-{number}"));
        let Some((_, waiting)) = lanes.get(lane) else { return };
        loop {
            let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).pop_front();
            let Some(item) = next else { return };
            let came = run(&item, &log);
            ended.lock().unwrap_or_else(PoisonError::into_inner)(item, came);
        }
    };
    std::thread::scope(|scope| {
        let numbered =
            lanes.iter().enumerate().flat_map(|(lane, (at_once, _))| (0..*at_once).map(move |n| (lane, n)));
        let worker = &worker;
        let workers: Vec<_> =
            numbered.map(|(lane, number)| scope.spawn(move || worker(lane, number))).collect();
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
