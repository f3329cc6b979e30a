//! Owner of a bus: one thread with a session on it, for all clients.
mod ask;
mod operator;
mod shared;
mod stop;
mod worker;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

use ucom::Profile;
use ucom_host::files::SignalTable;
use ucom_host::session::{Cache, CleanupList, Link, Prompt, SessionError};

pub(crate) use ask::fault;
pub(crate) use host_kit::owner::Kind;
pub(crate) use shared::Shared;
pub(crate) use worker::Worker;

/// Configuration of the boards that is known beforehand.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Profile of the protocol on these boards.
    pub profile: Profile,
    /// Meaning of their words.
    pub signals: SignalTable,
    /// Cache for the names of values.
    pub cache: Cache,
    /// List of clean-up steps that would remain if the process ended now. The code that ends the process prints them.
    pub cleanup: CleanupList,
    /// Inventory file with the images that updates wrote to boards; `None`: the agent keeps these records while it
    /// runs.
    pub inventory: Option<PathBuf>,
}

/// Thread that owns a bus.
pub struct Owner {
    pub(crate) shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Opens the bus of this URL. Scans for boards unless another PC is master of the bus.
    ///
    /// # Errors
    ///
    /// The URL is invalid, or the bus cannot be opened.
    pub fn open(url: &str, config: Config) -> Result<Self, SessionError> {
        // The thread sends heartbeats and Stops, so it must not wait for the disk.
        let config = Config { cache: config.cache.in_memory(), ..config };
        let bus = can_link::open(url).map_err(|e| SessionError::Open(Box::new(e)))?;
        let link = Link::on(Box::new(Prompt(bus)), url);
        let shared = Arc::new(Shared::new(config.profile));
        let own = shared.clone();
        let thread = std::thread::spawn(move || own_bus(&own, config, link));
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Returns a function that gives the reason why the bus was lost; `None` if it was not lost.
    pub fn lost(&self) -> impl Fn() -> Option<String> + Send + use<> {
        let shared = self.shared.clone();
        move || shared.lost()
    }

    /// Stops the running boards and releases the bus.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.shared.end();
        if let Some(thread) = self.thread.take() {
            // A panic of that thread has been printed.
            drop(thread.join());
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.join();
    }
}

/// Marks the bus as lost on drop, even after a panic of its thread.
struct Gone<'a>(&'a Shared, String);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        self.0.close(std::mem::take(&mut self.1));
    }
}

fn own_bus(shared: &Arc<Shared>, config: Config, link: Link) {
    let mut gone = Gone(shared, "the agent has a fault".into());
    let mut worker = Worker::new(shared.clone(), config, link);
    match worker.serve() {
        Ok(()) => {
            worker.leave();
            gone.1 = "the agent was ended".into();
        }
        Err(error) => gone.1 = error.to_string(),
    }
}
