//! The file of the log of commands, which is put aside when it is long.
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where lines are written.
pub(super) trait Target: Write {
    /// Makes room for a line of so many bytes. True: it begins another file.
    ///
    /// # Errors
    ///
    /// There is no room.
    fn make_room(&mut self, _line: usize) -> io::Result<bool> {
        Ok(false)
    }
}

/// A file, and the one before it: both together take no more than a limit.
pub(super) struct Rotated {
    file: File,
    /// Name of the file and of the one before; none: it is no ordinary file, and is never put aside.
    names: Option<(PathBuf, PathBuf)>,
    length: u64,
    limit: u64,
}

impl Rotated {
    /// Goes on with this file, or begins it.
    pub(super) fn open(path: &Path, limit: u64) -> io::Result<Self> {
        let file = append(path)?;
        let metadata = file.metadata()?;
        let names = if metadata.is_file() {
            // Where the name is a link, what it leads to is put aside.
            let path = path.canonicalize()?;
            let before = before(&path);
            Some((path, before))
        } else {
            None
        };
        Ok(Self { file, names, length: metadata.len(), limit })
    }
}

impl Target for Rotated {
    fn make_room(&mut self, line: usize) -> io::Result<bool> {
        let Some((path, before)) = &self.names else { return Ok(false) };
        if self.length == 0 || self.length.saturating_add(line as u64) <= self.limit / 2 {
            return Ok(false);
        }
        std::fs::rename(path, before).map_err(|error| {
            let (path, before) = (path.display(), before.display());
            io::Error::new(
                error.kind(),
                format!("{path} is full, and cannot be renamed to {before}: {error}"),
            )
        })?;
        self.file = append(path)?;
        self.length = self.file.metadata()?.len();
        Ok(true)
    }
}

impl Write for Rotated {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.file.write(bytes)?;
        self.length += taken as u64;
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

fn append(path: &Path) -> io::Result<File> {
    OpenOptions::new().append(true).create(true).open(path)
}

/// Name of the file before this one: `commands.jsonl.1`.
fn before(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".1");
    name.into()
}
