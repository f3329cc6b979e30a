//! Agents of this user on this computer, so that a command finds the agent that owns its port.
//!
//! Each agent has a file in a folder that no other user can write to, and holds a lock on it. A killed agent leaves the
//! file without the lock: any program may listen at its address by then.
use std::fs::{self, File, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use jtc_host::port::runtime;

/// Agent of this computer.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Registered {
    /// Its address, `http://HOST:PORT` or `https://HOST:PORT`.
    pub url: String,
    /// The port that it owns.
    pub port: String,
    /// Path of its tokens.
    pub token_file: PathBuf,
    /// Its certificate, if it uses TLS.
    #[serde(default)]
    pub certificate: Option<PathBuf>,
}

/// File of an agent, locked while the agent runs; removed with it.
#[derive(Debug)]
pub struct Registration {
    path: PathBuf,
    _lock: File,
}

impl Drop for Registration {
    fn drop(&mut self) {
        // Readers skip a file without its lock.
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes the file of an agent. `None`: every folder is writable for other users.
///
/// # Errors
///
/// The file cannot be written.
pub fn register(agent: &Registered) -> io::Result<Option<Registration>> {
    let Some(folder) = runtime::create()? else { return Ok(None) };
    let path = folder.join(format!("{}.json", std::process::id()));
    let mut file = File::create(&path)?;
    // Before any content is written: an agent without a lock does not count.
    file.try_lock().map_err(io::Error::other)?;
    file.write_all(serde_json::to_string(agent)?.as_bytes())?;
    Ok(Some(Registration { path, _lock: file }))
}

/// Returns the running agents.
pub fn registered() -> Vec<Registered> {
    let files = runtime::folders().into_iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
    files.flatten().filter_map(|file| alive(&file.path())).collect()
}

/// Returns the agent of this file, if it holds the lock; a killed agent does not.
fn alive(path: &Path) -> Option<Registered> {
    let mut file = File::open(path).ok()?;
    if !matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock)) {
        return None;
    }
    let mut text = String::new();
    file.read_to_string(&mut text).ok()?;
    serde_json::from_str(&text).ok()
}

/// Returns `true` if the two names belong to one port.
pub fn is_same_port(one: &str, other: &str) -> bool {
    let real = |path: &str| fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path));
    real(one) == real(other)
}

/// Returns the agent that owns this port.
pub fn owner_of(port: &str) -> Option<Registered> {
    registered().into_iter().find(|agent| is_same_port(&agent.port, port))
}
