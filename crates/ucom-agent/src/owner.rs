//! Owner of a bus: the single thread that runs a session on the bus for all clients.
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

/// Configuration for the boards, which must be known before the bus is opened.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// Protocol profile of the boards.
    pub profile: Profile,
    /// Signal table, which describes the words of the boards.
    pub signals: SignalTable,
    /// Cache for the signal names of the boards.
    pub cache: Cache,
    /// Clean-up steps that would remain undone if the process ended now. The code that ends the process prints these
    /// steps.
    pub cleanup: CleanupList,
    /// Inventory file that contains records of the images that updates wrote. If `None`, the agent keeps records of written images
    /// only while it runs.
    pub inventory: Option<PathBuf>,
}

/// Thread that owns a bus.
pub struct Owner {
    pub(crate) shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Opens the bus at this URL. Scans the bus for boards, unless another PC is the master of the bus.
    ///
    /// # Errors
    ///
    /// The URL is invalid, or the bus cannot be opened.
    pub fn open(url: &str, config: Config) -> Result<Self, SessionError> {
        // The thread that owns the bus sends heartbeats and Stops, so it must not wait for the disk.
        let config = Config { cache: config.cache.in_memory(), ..config };
        let bus = can_link::open(url).map_err(|e| SessionError::Open(Box::new(e)))?;
        let link = Link::on(Box::new(Prompt(bus)), url);
        let shared = Arc::new(Shared::new(config.profile));
        let own = shared.clone();
        let thread = std::thread::spawn(move || own_bus(&own, config, link));
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Returns a function that reports why the bus was lost. The returned function returns `None` while the bus is available.
    pub fn lost(&self) -> impl Fn() -> Option<String> + Send + use<> {
        let shared = self.shared.clone();
        move || shared.lost()
    }

    /// Stops the boards that this agent has started, and releases the bus.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.shared.end();
        if let Some(thread) = self.thread.take() {
            // If the owner's thread has panicked, the panic was already printed.
            drop(thread.join());
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.join();
    }
}

/// Guard that marks the bus as lost when the guard is dropped, even after a panic of the thread.
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
