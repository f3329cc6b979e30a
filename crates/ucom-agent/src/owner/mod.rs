//! The owner of a bus: one thread with a session on it, for all clients.
mod ask;
mod hands;
mod operator;
mod shared;
mod stop;

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

use ucom::Profile;
use ucom_host::files::SignalTable;
use ucom_host::session::{Cache, CleanupList, Link, Prompt, SessionError};

pub(crate) use ask::fault;
pub(crate) use hands::Hands;
pub(crate) use shared::Shared;

/// What is known of the boards beforehand.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// How they read the protocol.
    pub profile: Profile,
    /// What their words mean.
    pub signals: SignalTable,
    /// Where names are remembered.
    pub cache: Cache,
    /// What would be left undone if the process ended now, for those who end it.
    pub cleanup: CleanupList,
    /// The inventory file, which has what updates wrote to boards; `None`: the agent remembers it for as long as it runs.
    pub inventory: Option<PathBuf>,
}

/// The thread that owns a bus.
pub struct Owner {
    pub(crate) shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Opens the bus of this URL, and asks who is there unless another PC is its master.
    ///
    /// # Errors
    ///
    /// The URL is none, or the bus cannot be opened.
    pub fn open(url: &str, config: Config) -> Result<Self, SessionError> {
        // Heartbeats and Stops of its thread wait for no disk.
        let config = Config { cache: config.cache.in_memory(), ..config };
        let bus = can_link::open(url).map_err(|e| SessionError::Open(Box::new(e)))?;
        let link = Link::on(Box::new(Prompt(bus)), url);
        let shared = Arc::new(Shared::new(config.profile));
        let own = shared.clone();
        let thread = std::thread::spawn(move || own_bus(&own, config, link));
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Looks whether the bus is gone, and why.
    pub fn lost(&self) -> impl Fn() -> Option<String> + Send + use<> {
        let shared = self.shared.clone();
        move || shared.lost()
    }

    /// Stops what runs, and lets the bus go.
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

/// The bus is gone when this is, also where its thread has panicked.
struct Gone<'a>(&'a Shared, String);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        self.0.close(std::mem::take(&mut self.1));
    }
}

fn own_bus(shared: &Arc<Shared>, config: Config, link: Link) {
    let mut gone = Gone(shared, "the agent has a fault".into());
    let mut hands = Hands::new(shared.clone(), config, link);
    match hands.serve() {
        Ok(()) => {
            hands.leave();
            gone.1 = "the agent was ended".into();
        }
        Err(error) => gone.1 = error.to_string(),
    }
}
