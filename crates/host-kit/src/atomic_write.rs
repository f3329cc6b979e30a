//! Atomic file writes.
use std::fs::{File, OpenOptions, metadata, read_link};
use std::io::{Result, Write};
use std::path::{Path, PathBuf};

/// Writes a file completely, or leaves the old file unchanged. If the path is a link, the function writes the target of
/// the link. The permissions of an existing file stay the same. If the path is a pipe or a terminal, the data is
/// written to it directly.
///
/// # Errors
///
/// Returns the error of the operating system. After an error, no temporary file remains.
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<()> {
    let path = end_of_links(path);
    let before = metadata(&path).ok();
    if before.as_ref().is_some_and(|before| !before.is_file()) {
        return OpenOptions::new().write(true).open(&path)?.write_all(content);
    }
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let builder = tempfile::Builder::new();
    let mut beside = match before.as_ref().map(std::fs::Metadata::permissions) {
        Some(mode) => {
            let beside = builder.tempfile_in(directory)?;
            beside.as_file().set_permissions(mode)?;
            beside
        }
        // A file that does not exist yet gets the default permissions of the system.
        None => builder.make_in(directory, |path| File::options().write(true).create_new(true).open(path))?,
    };
    beside.write_all(content)?;
    beside.as_file().sync_all()?;
    beside.persist(&path)?;
    Ok(())
}

/// Returns the final target of a chain of symbolic links, even if this file does not exist yet.
fn end_of_links(path: &Path) -> PathBuf {
    let mut at = path.to_path_buf();
    for _ in 0..40 {
        let Ok(next) = read_link(&at) else { break };
        at = at.parent().map_or(next.clone(), |parent| parent.join(&next));
    }
    at
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs::{
        Permissions, create_dir, read_dir, read_to_string, set_permissions, symlink_metadata, write,
    };
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_file_keeps_its_mode_and_links_stay_links() {
        let directory = tempfile::tempdir().unwrap();
        let (file, link) = (directory.path().join("head.yaml"), directory.path().join("link.yaml"));
        write(&file, "old").unwrap();
        set_permissions(&file, Permissions::from_mode(0o640)).unwrap();
        symlink("head.yaml", &link).unwrap();
        write_atomically(&link, b"new").unwrap();
        assert!(symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(read_to_string(&file).unwrap(), "new");
        assert_eq!(metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(read_dir(directory.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_new_file_has_the_mode_of_other_new_files() {
        let directory = tempfile::tempdir().unwrap();
        let (ours, other) = (directory.path().join("ours"), directory.path().join("other"));
        write_atomically(&ours, b"1").unwrap();
        write(&other, "1").unwrap();
        let mode = |path: &Path| metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&other));
    }

    #[test]
    fn nothing_is_left_beside_a_file_that_cannot_be_replaced() {
        let directory = tempfile::tempdir().unwrap();
        let there = directory.path().join("there");
        create_dir(&there).unwrap();
        assert!(write_atomically(&there, b"new").is_err());
        let closed = directory.path().join("nowhere").join("file");
        assert!(write_atomically(&closed, b"new").is_err());
        assert_eq!(read_dir(directory.path()).unwrap().count(), 1);
    }
}
