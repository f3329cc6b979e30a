//! Folder in which programs of this user store sockets and locks while they run. Other users cannot write to this folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Returns the folder that this program uses. Returns `None` if the operating system provides no folder that belongs to only this user.
pub fn folder() -> Option<PathBuf> {
    by_environment().or_else(by_user)
}

/// Returns the folders that a program of this user may use, in order of preference.
#[cfg(unix)]
pub(super) fn candidates() -> Vec<PathBuf> {
    by_environment().into_iter().chain(by_user()).collect()
}

/// Returns all folders that programs of this user may use. Programs may use different folders, because their environment variables differ
/// (`su`, `cron`) or because a path was too long for a socket.
pub fn folders() -> Vec<PathBuf> {
    let given = std::env::var_os("XDG_RUNTIME_DIR").filter(|dir| !dir.is_empty()).map(PathBuf::from);
    let all = own_name().map_or(Vec::new(), |name| all_of(given, &std::env::temp_dir(), &name));
    all.into_iter().filter(|folder| is_own(folder)).collect()
}

/// Returns the folders for these values of the environment variables. With an unusual runtime folder, the list
/// contains only this folder and the folder for temporary files. A program can be isolated from other programs in
/// this way.
fn all_of(given: Option<PathBuf>, temporary: &Path, name: &str) -> Vec<PathBuf> {
    let user = name.trim_start_matches("openjtc-");
    let usual = Path::new("/run/user").join(user);
    let is_apart = given.as_ref().is_some_and(|given| *given != usual);
    let mut all: Vec<PathBuf> = given.into_iter().map(|given| given.join("openjtc")).collect();
    all.push(temporary.join(name));
    if !is_apart {
        all.extend([usual.join("openjtc"), Path::new("/tmp").join(name)]);
    }
    let mut seen = std::collections::HashSet::new();
    all.retain(|folder| seen.insert(folder.clone()));
    all
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

/// Returns `true` if the folder belongs to this user and no other user can write to it.
#[cfg(unix)]
pub fn is_own(folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    fs::symlink_metadata(folder).is_ok_and(|found| {
        found.is_dir() && found.uid() == rustix::process::geteuid().as_raw() && found.mode() & 0o022 == 0
    })
}

/// Returns `true` if the folder exists; the owner is not checked on this operating system.
#[cfg(not(unix))]
pub fn is_own(folder: &Path) -> bool {
    folder.is_dir()
}

/// Creates the folder of this program. Returns `None` if no location exists to which only this user can write.
///
/// # Errors
///
/// Returns an error if the folder cannot be created.
pub fn create() -> io::Result<Option<PathBuf>> {
    folder().map_or(Ok(None), create_at)
}

/// Creates `folder` with access only for this user.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A client finds the folder of a program that was started with other environment variables.
    #[test]
    fn the_folders_of_programs_with_other_variables_are_found() {
        let all = |given: Option<&str>, temporary: &str| -> Vec<String> {
            let all = all_of(given.map(PathBuf::from), Path::new(temporary), "openjtc-1000");
            all.iter().map(|folder| folder.display().to_string()).collect()
        };
        let (runtime, tmp) = ("/run/user/1000/openjtc", "/tmp/openjtc-1000");
        // `su` and `cron` do not set these environment variables.
        assert_eq!(all(None, "/tmp"), [tmp, runtime]);
        assert_eq!(all(None, "/var/x"), ["/var/x/openjtc-1000", runtime, tmp]);
        assert_eq!(all(Some("/run/user/1000"), "/tmp"), [runtime, tmp]);
        assert_eq!(all(Some("/run/user/1000/"), "/tmp"), [runtime, tmp]);
        assert_eq!(all(Some("/run/user/1000"), "/y"), [runtime, "/y/openjtc-1000", tmp]);
        // With an unusual runtime folder, the usual runtime folder is not searched.
        assert_eq!(all(Some("/z"), "/y"), ["/z/openjtc", "/y/openjtc-1000"]);
        assert_eq!(all(Some("/run/user/0"), "/tmp"), ["/run/user/0/openjtc", tmp]);
    }
}
