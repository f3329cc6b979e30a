//! The agents of this user on this computer, so that a command whose port an agent owns finds it by itself.
//!
//! Each agent has a file in a folder that nobody else can write to, and holds a lock on it. One that was killed leaves the file behind and
//! the lock not: who listens at its address now may be anybody.
use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use jtc_host::port::runtime;

/// An agent of this computer.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Registered {
    /// Its address, `http://HOST:PORT` or `https://HOST:PORT`.
    pub url: String,
    /// The port that it owns.
    pub port: String,
    /// Where its tokens are.
    pub token_file: PathBuf,
    /// Its certificate, where it speaks TLS.
    #[serde(default)]
    pub certificate: Option<PathBuf>,
}

/// The file of an agent, locked while the agent is there; it goes with it.
#[derive(Debug)]
pub struct Registration {
    path: PathBuf,
    _lock: File,
}

impl Drop for Registration {
    fn drop(&mut self) {
        // Whoever finds it without its lock passes it over.
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes the file of an agent. `None`: there is no place for it that nobody else can write to.
///
/// # Errors
///
/// It cannot be written.
pub fn register(agent: &Registered) -> io::Result<Option<Registration>> {
    let Some(folder) = runtime::create()? else { return Ok(None) };
    let path = folder.join(format!("{}.json", std::process::id()));
    let mut file = File::create(&path)?;
    // Before anything is in it: an agent that has no lock is none.
    file.try_lock().map_err(io::Error::other)?;
    file.write_all(serde_json::to_string(agent)?.as_bytes())?;
    Ok(Some(Registration { path, _lock: file }))
}

/// The agents that are there.
pub fn registered() -> Vec<Registered> {
    let files = runtime::folders().into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
    files.flatten().filter_map(|file| alive(&file.path())).collect()
}

/// The agent of this file, if it holds the lock; one that was killed does not any more.
fn alive(path: &Path) -> Option<Registered> {
    let mut file = File::open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// The two names are those of one port.
pub fn is_same_port(one: &str, other: &str) -> bool {
    let real = |path: &str| fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path));
    real(one) == real(other)
}

/// The agent that owns this port.
pub fn owner_of(port: &str) -> Option<Registered> {
    registered().into_iter().find(|agent| is_same_port(&agent.port, port))
}
