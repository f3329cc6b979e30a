//! Small text files: reading with a limit, writing whole or not at all, quoting.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
/// Longest file that is read, bytes.
pub(crate) const MAX_BYTES: u64 = 1 << 20;

/// A text file that cannot be used at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Larger than any file of its kind.
    #[error("{}: more than {MAX_BYTES} bytes are too many", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a text; also from what has no length beforehand, as a pipe.
pub(crate) fn read_text(path: &Path) -> Result<String, TextError> {
    let io = |source| TextError::Io { path: path.into(), source };
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(io)?;
    file.take(MAX_BYTES + 1).read_to_string(&mut text).map_err(io)?;
    if text.len() as u64 > MAX_BYTES {
        return Err(TextError::TooLarge { path: path.into() });
    }
    Ok(text)
}

/// Writes a file whole or not at all. Behind a link the file it leads to is written, and a file keeps its mode.
pub fn write_text(path: &Path, text: &str) -> Result<(), TextError> {
    let io = |source| TextError::Io { path: path.into(), source };
    let path = end_of_links(path);
    let before = std::fs::metadata(&path).ok();
    // Pipes and terminals are written to, not replaced.
    if before.as_ref().is_some_and(|b| !b.is_file()) {
        let mut file = std::fs::OpenOptions::new().write(true).open(&path).map_err(io)?;
        return file.write_all(text.as_bytes()).map_err(io);
    }
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.new", std::process::id()));
    let beside = PathBuf::from(beside);
    replace(&path, &beside, text, before.map(|b| b.permissions())).map_err(io)
}

/// Writes `beside`, then puts it in the place of `path`; nothing stays beside it when that fails.
fn replace(
    path: &Path,
    beside: &Path,
    text: &str,
    mode: Option<std::fs::Permissions>,
) -> std::io::Result<()> {
    let mut file = std::fs::OpenOptions::new().write(true).create_new(true).open(beside)?;
    let written = file.write_all(text.as_bytes());
    let kept = written.and_then(|()| mode.map_or(Ok(()), |mode| file.set_permissions(mode)));
    let done = kept.and_then(|()| file.sync_all()).and_then(|()| std::fs::rename(beside, path));
    done.inspect_err(|_| drop(std::fs::remove_file(beside)))
}

/// Where a chain of links ends; also when nothing is there yet.
fn end_of_links(path: &Path) -> PathBuf {
    let mut at = path.to_path_buf();
    for _ in 0..40 {
        let Ok(next) = std::fs::read_link(&at) else { break };
        at = at.parent().map_or(next.clone(), |parent| parent.join(&next));
    }
    at
}

/// A basic string of TOML, and a double-quoted scalar of YAML.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            // YAML takes these for line ends or for no character at all.
            c if c.is_control()
                || matches!(c, '\u{2028}' | '\u{2029}' | '\u{FEFF}' | '\u{FFFE}' | '\u{FFFF}') =>
            {
                out += &format!("\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out + "\""
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_file_keeps_its_mode_and_links_stay_links() {
        let dir = tempfile::tempdir().unwrap();
        let (file, link) = (dir.path().join("head.yaml"), dir.path().join("link.yaml"));
        std::fs::write(&file, "old").unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o640)).unwrap();
        symlink("head.yaml", &link).unwrap();
        write_text(&link, "new").unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "new");
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn nothing_is_left_beside_a_file_that_cannot_be_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let (there, beside) = (dir.path().join("there"), dir.path().join("there.new"));
        std::fs::create_dir(&there).unwrap();
        assert!(replace(&there, &beside, "new", None).is_err());
        assert!(!beside.exists() && write_text(&there, "new").is_err());
    }
}
