//! Folders of this computer whose paths the compiler would put into compiled programs, and the names that replace these
//! paths.
use std::path::PathBuf;

use anyhow::{Result, ensure};

use crate::shell;

/// Returns the folder in which cargo keeps the sources of dependencies.
fn cargo_home() -> PathBuf {
    std::env::var_os("CARGO_HOME")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(std::env::var_os("HOME").unwrap_or_default()).join(".cargo"))
}

/// Returns the folders, each with its replacement name. If two entries match a path, the later entry has priority.
pub(crate) fn folders() -> Result<Vec<(PathBuf, &'static str)>> {
    let mut folders = vec![
        (shell::root().to_owned(), "openjtc"),
        (cargo_home(), "cargo"),
        (shell::target(), "openjtc/target"),
    ];
    for (path, _) in folders.clone() {
        ensure!(
            !path.to_string_lossy().contains([' ', '"', '=']),
            "{}: what is made would name this folder; it cannot be made in one with a space, a quote or `=` in its name",
            path.display()
        );
    }
    // If the checkout was opened through a symbolic link, a folder has two paths. The list then also contains the
    // real path.
    for at in 0..folders.len() {
        let (path, name) = folders[at].clone();
        if let Ok(real) = path.canonicalize()
            && real != path
        {
            folders.push((real, name));
        }
    }
    Ok(folders)
}

/// Returns options for cargo's `--config`. With these options, the compiler output for `triple` does not contain paths
/// of this computer.
pub(crate) fn remapped(triple: &str) -> Result<String> {
    let flags = folders()?.into_iter();
    let flags: Vec<String> =
        flags.map(|(path, name)| format!("\"--remap-path-prefix={}={name}\"", path.display())).collect();
    Ok(format!("target.{triple}.rustflags=[{}]", flags.join(",")))
}
