//! File of the command log, which is renamed when it is full.
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Output to which log lines are written.
pub(super) trait Target: Write {
    /// Ensures that a log line of `_line` bytes fits into the file. Returns `true` if this log line begins a new file.
    ///
    /// # Errors
    ///
    /// The log line does not fit into the file.
    fn make_room(&mut self, _line: usize) -> io::Result<bool> {
        Ok(false)
    }
}

/// Current and previous log file, which together stay within a limit.
pub(super) struct Rotated {
    file: File,
    /// Paths of the current and the previous log file. `None` if the output is not an ordinary file, because only
    /// ordinary files are renamed.
    names: Option<(PathBuf, PathBuf)>,
    length: u64,
    limit: u64,
}

impl Rotated {
    /// Opens or creates the log file `path`.
    pub(super) fn open(path: &Path, limit: u64) -> io::Result<Self> {
        let file = append(path)?;
        let metadata = file.metadata()?;
        let names = if metadata.is_file() {
            // If the path is a symbolic link, the target of the link is renamed, not the link.
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
        // A previous log file from an earlier version or another program may be larger than the limit. Such a file
        // gets another name, so that its lines are not lost.
        if std::fs::metadata(before).is_ok_and(|found| found.is_file() && found.len() > self.limit) {
            let mut kept = before.clone().into_os_string();
            kept.push(format!(".kept-{}", host_kit::unix_time().as_secs()));
            std::fs::rename(before, kept)?;
        }
        match std::fs::rename(path, before) {
            // Another program has moved or removed the log file, so the next line begins a new file.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            renamed => renamed.map_err(|error| {
                let (path, before) = (path.display(), before.display());
                io::Error::new(
                    error.kind(),
                    format!("log file {path} is full and cannot be renamed to {before}: {error}"),
                )
            })?,
        }
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

/// Returns the name of the previous log file: `commands.jsonl.1`.
fn before(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".1");
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(log: &mut Rotated, line: &str) {
        log.make_room(line.len()).expect("there is room");
        log.write_all(line.as_bytes()).expect("it is written");
    }

    #[test]
    fn a_log_that_was_removed_or_moved_begins_anew() {
        for moved in [false, true] {
            let dir = tempfile::tempdir().expect("a directory");
            let path = dir.path().join("commands.jsonl");
            let mut log = Rotated::open(&path, 200).expect("it opens");
            write(&mut log, &"a".repeat(90));
            let gone = if moved {
                std::fs::rename(&path, dir.path().join("away"))
            } else {
                std::fs::remove_file(&path)
            };
            gone.expect("it is there");
            for line in ["b", "c"] {
                write(&mut log, &line.repeat(60));
            }
            let (now, earlier) = (std::fs::read(&path), std::fs::read(before(&path)));
            assert_eq!(now.expect("it is there"), b"c".repeat(60), "moved: {moved}");
            assert_eq!(earlier.expect("it is there"), b"b".repeat(60), "moved: {moved}");
        }
    }

    #[test]
    fn a_longer_log_of_an_earlier_version_is_not_replaced() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("commands.jsonl");
        std::fs::write(&path, "e".repeat(5000)).expect("it is written");
        let mut log = Rotated::open(&path, 200).expect("it opens");
        for line in ["a", "b", "c", "d"] {
            write(&mut log, &line.repeat(90));
        }
        let kept = std::fs::read_dir(dir.path()).expect("a directory").flatten();
        let lengths: Vec<u64> = kept.filter_map(|file| Some(file.metadata().ok()?.len())).collect();
        assert!(lengths.contains(&5000), "{lengths:?}");
        assert_eq!(lengths.iter().filter(|length| **length == 90).count(), 2, "{lengths:?}");
    }
}
