//! Small text files: reading with a limit, atomic writing, quoting.

use std::io::Read;
use std::path::{Path, PathBuf};

use host_kit::write_atomically;

/// Size limit of a file in bytes.
pub(crate) const MAX_BYTES: u64 = 1 << 20;

/// Text file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// System error.
        source: std::io::Error,
    },
    /// The file is larger than the limit for files of its kind.
    #[error("{}: the file is too large, expected at most {MAX_BYTES} bytes", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a text file. Sources without a known length, such as a pipe, are also accepted.
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

/// Writes a file atomically. If the path is a link, its target is written. An existing file keeps its mode.
///
/// # Errors
///
/// The system returned an error. In this case the file is unchanged.
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
