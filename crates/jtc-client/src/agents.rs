//! List of the agents of this user on this computer. With this list, a command finds the agent that owns its port.
//!
//! Each agent has a locked file in a folder to which no other user can write. If an agent is killed, its file
//! remains, but is unlocked. A command therefore checks the lock, because another program may now listen at the
//! address of that agent.
use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use jtc_host::port::runtime;

/// An agent on this computer.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Registered {
    /// Address of the agent, `http://HOST:PORT` or `https://HOST:PORT`.
    pub url: String,
    /// Port that the agent owns.
    pub port: String,
    /// Path of the file with the agent's tokens.
    pub token_file: PathBuf,
    /// Certificate of the agent, if it uses TLS.
    #[serde(default)]
    pub certificate: Option<PathBuf>,
}

/// File of an agent. The file is locked while the agent runs, and is removed when the agent ends.
#[derive(Debug)]
pub struct Registration {
    path: PathBuf,
    _lock: File,
}

impl Drop for Registration {
    fn drop(&mut self) {
        // If the file cannot be removed, readers ignore it, because it is unlocked.
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes the file of an agent. Returns `None` if other users can write to all possible folders.
///
/// # Errors
///
/// Returns an error if the file cannot be written.
pub fn register(agent: &Registered) -> io::Result<Option<Registration>> {
    let Some(folder) = runtime::create()? else { return Ok(None) };
    let path = folder.join(format!("{}.json", std::process::id()));
    let mut file = File::create(&path)?;
    // The file is locked before any content is written, because readers ignore unlocked files.
    file.try_lock().map_err(io::Error::other)?;
    file.write_all(serde_json::to_string(agent)?.as_bytes())?;
    Ok(Some(Registration { path, _lock: file }))
}

/// Returns the agents of this user that are running.
pub fn registered() -> Vec<Registered> {
    let files = runtime::folders().into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
    files.flatten().filter_map(|file| alive(&file.path())).collect()
}

/// Returns the agent of a file, or `None` if the file is unlocked, because the agent of an unlocked file has ended.
fn alive(path: &Path) -> Option<Registered> {
    let mut file = File::open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// Returns `true` if the two names belong to the same port.
pub fn is_same_port(one: &str, other: &str) -> bool {
    let real = |path: &str| fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path));
    real(one) == real(other)
}

/// Returns the agent that owns this port.
pub fn owner_of(port: &str) -> Option<Registered> {
    registered().into_iter().find(|agent| is_same_port(&agent.port, port))
}
