//! Simulated chain of boards in this process. Other programs can join the bus of the chain through a socketcand server on
//! this computer.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use pyo3::prelude::*;
use ucom::Profile;
use ucom_sim::{ChainConfig, ChainServer, ChainSim, Fault};

use crate::error::Failure;
use crate::threads::{Process, lock};

/// Maximum wait between two checks for requests of other programs.
const LOOK: Duration = Duration::from_millis(10);

/// Options of a simulation.
#[derive(Default)]
pub(super) struct Simulation {
    pub profile: Profile,
    pub chain: Option<PathBuf>,
    pub boards: Option<u8>,
    pub faults: Option<PathBuf>,
    pub seed: u64,
}

/// Simulated chain in a separate thread. The thread runs until the last owner of the chain is dropped.
pub(super) struct Simulated {
    url: String,
    boards: usize,
    faults: Mutex<Sender<String>>,
    ended: Arc<AtomicBool>,
    thread: Mutex<Option<JoinHandle<()>>>,
    process: Process,
}

impl Simulated {
    /// Starts the chain on a free port of this computer.
    pub(super) fn start(simulation: Simulation) -> Result<Self, Failure> {
        let Simulation { profile, chain, boards, faults, seed } = simulation;
        let config = match &chain {
            Some(path) => ChainConfig::read(path, &profile).map_err(|e| {
                Failure::usage(e.to_string()).next("ucom help sim shows the format of chain files")
            })?,
            None => ChainConfig::head(&profile),
        };
        let config = match boards {
            Some(boards) => config.with_boards(boards.into(), &profile),
            None => config,
        };
        let faults = match &faults {
            None => Vec::new(),
            Some(path) => {
                let wrong = |e: &dyn std::fmt::Display| {
                    Failure::usage(format!("{}: {e}", path.display()))
                        .next("ucom help faults shows the format")
                };
                let text = std::fs::read_to_string(path).map_err(|e| wrong(&e))?;
                Fault::from_toml(&text).map_err(|e| wrong(&e))?
            }
        };
        let boards = config.boards.len();
        let (ready, url) = mpsc::channel();
        let (sender, lines) = mpsc::channel::<String>();
        let ended: Arc<AtomicBool> = Arc::default();
        let end = ended.clone();
        let thread = std::thread::spawn(move || {
            let chain = ChainSim::new(&config, faults, seed, &profile);
            let mut server = match ChainServer::bind("127.0.0.1:0", chain, profile.bitrate, seed, drop) {
                Ok(server) => server,
                Err(error) => return drop(ready.send(Err(error.to_string()))),
            };
            // The receiver still exists, so sending the URL cannot fail.
            let _ = ready.send(Ok(server.url()));
            while !end.load(Ordering::Relaxed) {
                lines.try_iter().for_each(|line| server.fault(&line));
                server.turn(LOOK);
            }
        });
        let url = url.recv().unwrap_or_else(|_| Err("internal error of the simulated chain".into()));
        let url = url.map_err(|e| Failure::usage(e).next("check if a port of 127.0.0.1 is free"))?;
        let (faults, thread) = (Mutex::new(sender), Mutex::new(Some(thread)));
        Ok(Self { url, boards, faults, ended, thread, process: Process::this() })
    }

    /// Returns the URL of the bus of the chain.
    pub(super) fn url(&self) -> &str {
        &self.url
    }

    /// Ends the chain and waits until its thread has ended.
    fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
        let thread = lock(&self.thread).take();
        if let Some(thread) = thread.filter(|_| self.process.is_this()) {
            // A panic of that thread was already printed.
            drop(thread.join());
        }
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.end();
    }
}

/// A simulated chain.
#[pyclass(frozen, module = "openjtc._native")]
pub(super) struct SimulatedChain {
    pub inner: Arc<Simulated>,
}

#[pymethods]
impl SimulatedChain {
    #[new]
    #[pyo3(signature = (chain=None, boards=None, faults=None, seed=1, profile=None))]
    fn new(
        py: Python<'_>,
        chain: Option<PathBuf>,
        boards: Option<u8>,
        faults: Option<PathBuf>,
        seed: u64,
        profile: Option<PathBuf>,
    ) -> Result<Self, Failure> {
        let profile = super::procedures::profile(profile.as_deref(), None)?;
        if boards.is_some_and(|boards| boards > 31) {
            return Err(Failure::usage("too many boards: a chain has at most 31"));
        }
        let simulation = Simulation { profile, chain, boards, faults, seed };
        let inner = py.detach(|| Simulated::start(simulation))?;
        Ok(Self { inner: Arc::new(inner) })
    }

    #[getter]
    fn url(&self) -> &str {
        self.inner.url()
    }

    #[getter]
    fn board_count(&self) -> usize {
        self.inner.boards
    }

    fn fault(&self, line: &str) -> Result<(), Failure> {
        Fault::from_line(line)
            .map_err(|e| Failure::usage(e.to_string()).next("ucom help faults lists the faults"))?;
        let sender = lock(&self.inner.faults);
        sender.send(line.into()).map_err(|_| Failure::usage("the simulated chain has ended"))
    }

    fn end(&self, py: Python<'_>) {
        py.detach(|| self.inner.end());
    }
}
