//! Reads small text files with a size limit, writes them atomically, and quotes texts.

use std::io::Read;
use std::path::{Path, PathBuf};

use host_kit::write_atomically;

/// Size limit of a text file in bytes.
pub(crate) const MAX_BYTES: u64 = 1 << 20;

/// Reasons why a text file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error that the system reported.
        source: std::io::Error,
    },
    /// The file is larger than the limit for files of its kind.
    #[error("{}: the file is too large, expected at most {MAX_BYTES} bytes", path.display())]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
    },
}

/// Reads a text file. The function also accepts sources without a known length, such as a pipe.
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

/// Writes a text file atomically. If the path is a symbolic link, the function writes the target of the link. An existing file keeps its
/// access mode.
///
/// # Errors
///
/// Returns an error if the file cannot be written. In this case, the file is unchanged.
pub fn write_text(path: &Path, text: &str) -> Result<(), TextError> {
    write_atomically(path, text.as_bytes()).map_err(|source| TextError::Io { path: path.into(), source })
}

/// Returns a text as a TOML basic string. The result is also a double-quoted scalar of YAML.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            // YAML reads these characters as line ends or does not allow them.
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
