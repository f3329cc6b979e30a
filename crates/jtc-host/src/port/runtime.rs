//! The folder of this user for sockets and locks of running programs. No other user can write to it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The folder that this program uses, if the system has one for this user alone.
pub fn folder() -> Option<PathBuf> {
    by_environment().or_else(by_user)
}

/// The folders that a program of this user may use, best first.
#[cfg(unix)]
pub(super) fn candidates() -> Vec<PathBuf> {
    by_environment().into_iter().chain(by_user()).collect()
}

/// All folders of this user: another program may have started without `XDG_RUNTIME_DIR`, or found its path too long for a socket.
#[cfg(unix)]
pub(super) fn folders() -> Vec<PathBuf> {
    candidates().into_iter().filter(|folder| is_own(folder)).collect()
}

fn by_environment() -> Option<PathBuf> {
    let dir = std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| !dir.is_empty())?;
    Some(PathBuf::from(dir).join("openjtc"))
}

fn by_user() -> Option<PathBuf> {
    own_name().map(|name| std::env::temp_dir().join(name))
}

#[cfg(unix)]
fn own_name() -> Option<String> {
    Some(format!("openjtc-{}", rustix::process::geteuid().as_raw()))
}

#[cfg(not(unix))]
fn own_name() -> Option<String> {
    None
}

/// The folder belongs to this user, and no other user can write to it.
#[cfg(unix)]
pub fn is_own(folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    fs::symlink_metadata(folder).is_ok_and(|found| {
        found.is_dir() && found.uid() == rustix::process::geteuid().as_raw() && found.mode() & 0o022 == 0
    })
}

/// The folder belongs to this user, and no other user can write to it.
#[cfg(not(unix))]
pub fn is_own(folder: &Path) -> bool {
    folder.is_dir()
}

/// Creates the folder. `None`: no place is there that only this user can write to.
///
/// # Errors
///
/// It cannot be created.
pub fn create() -> io::Result<Option<PathBuf>> {
    folder().map_or(Ok(None), create_at)
}

/// Creates this folder, for this user alone.
pub(super) fn create_at(folder: PathBuf) -> io::Result<Option<PathBuf>> {
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    match builder.create(&folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    Ok(is_own(&folder).then_some(folder))
}
