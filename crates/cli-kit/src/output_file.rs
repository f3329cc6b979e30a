//! Output files of a command. The command opens each output file before it sends any frame, and overwrites existing
//! files only on request.

use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use host_kit::{Diagnose, Diagnosis, ErrorKind};

/// Reason why a command does not write an output file.
#[derive(Debug)]
pub enum OutputError {
    /// The output file exists, and overwriting was not requested.
    Exists {
        /// Path of the output file.
        path: PathBuf,
    },
    /// The output file is also an input of the command, or another output of the command.
    SameFile {
        /// Path of the output file.
        path: PathBuf,
        /// Other name of the same file.
        other: PathBuf,
    },
    /// The operating system cannot open or write the output file.
    Io {
        /// Path of the output file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl fmt::Display for OutputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exists { path } => write!(f, "{} already exists", path.display()),
            Self::SameFile { path, other } => {
                write!(
                    f,
                    "{} is the same file as {}, which this command already uses",
                    path.display(),
                    other.display()
                )
            }
            Self::Io { path, source } => write!(f, "{}: {source}", path.display()),
        }
    }
}

impl std::error::Error for OutputError {}

impl Diagnose for OutputError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::Exists { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "exists",
                "choose another file; --overwrite writes over it",
            ),
            Self::SameFile { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "same-file",
                "choose another file; --overwrite does not replace this one",
            ),
            Self::Io { source, .. } => source.diagnosis(),
        }
    }
}

/// Paths of output files that this process has created but not written yet.
static UNWRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes output files that were created and never written. Must be called before the process ends at once, because
/// no destructor (`Drop`) runs in this case.
pub fn abandon() {
    for path in UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        let _ = std::fs::remove_file(path);
    }
}

/// Removes `path` from the list of unwritten output files.
fn settled(path: &Path) {
    UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).retain(|p| p != path);
}

/// Open output file that is still empty or unchanged. If the `OutputFile` is dropped before it is written, a new file
/// is removed.
pub struct OutputFile {
    path: PathBuf,
    file: File,
    /// `true` if the file did not exist before.
    made: bool,
    written: bool,
}

impl OutputFile {
    /// Opens `path` for writing. Rejects an existing file if `overwrite` is `false`. Always rejects a file of `others`
    /// (inputs of the command, and its other outputs). If a command that sends frames gets this error, the command must
    /// report that it sent no frames.
    pub fn open(path: &Path, overwrite: bool, others: &[&Path]) -> Result<Self, OutputError> {
        if let Some(other) = others.iter().find(|other| same(path, other)) {
            return Err(OutputError::SameFile { path: path.to_owned(), other: other.to_path_buf() });
        }
        let io = |source| OutputError::Io { path: path.to_owned(), source };
        match OpenOptions::new().write(true).create_new(true).open(path) {
            Ok(file) => {
                UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
                return Ok(Self { path: path.to_owned(), file, made: true, written: false });
            }
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(io(e)),
        }
        // A pipe or a device contains no data that could be lost, so only an existing regular file is rejected.
        if !overwrite && path.is_file() {
            return Err(OutputError::Exists { path: path.to_owned() });
        }
        let file = OpenOptions::new().write(true).open(path).map_err(io)?;
        Ok(Self { path: path.to_owned(), file, made: false, written: false })
    }

    /// Returns the name of the output file for users.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// Returns the path of the output file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the complete output file.
    pub fn write(mut self, bytes: impl AsRef<[u8]>) -> Result<(), OutputError> {
        let mut file = self.begin()?;
        let done = file.write_all(bytes.as_ref()).and_then(|()| settle(&file));
        done.map_err(|e| self.failure(e))
    }

    /// Returns a handle for writing, and discards the old content of the file. The caller must call [`settle`] after
    /// the last write.
    pub fn begin(&mut self) -> Result<File, OutputError> {
        self.written = true;
        settled(&self.path);
        self.emptied().map_err(|e| self.failure(e))
    }

    fn emptied(&self) -> io::Result<File> {
        let mut file = self.file.try_clone()?;
        if file.metadata()?.is_file() {
            file.set_len(0)?;
            file.rewind()?;
        }
        Ok(file)
    }

    /// Marks the output file as written. The caller uses this function if other code has created the file at this
    /// path, for example by renaming a complete file.
    pub fn is_written(mut self) {
        self.written = true;
        settled(&self.path);
    }

    /// Marks the content of the output file as useless. If the `OutputFile` is dropped in this state, its file is
    /// removed, unless the file existed before.
    pub fn is_worthless(&mut self) {
        self.written = false;
    }

    /// Returns the error that explains why writing failed.
    pub fn failure(&self, source: io::Error) -> OutputError {
        OutputError::Io { path: self.path.clone(), source }
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if self.made && !self.written {
            settled(&self.path);
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Waits until the bytes of the file are on the disk. Some systems report a full disk only at this point.
pub fn settle(file: &File) -> io::Result<()> {
    if file.metadata()?.is_file() { file.sync_all() } else { Ok(()) }
}

/// Returns `true` if both paths refer to the same existing file.
fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b) || one_inode(a, b)
}

/// Returns `true` if two paths are hard links of one file.
#[cfg(unix)]
fn one_inode(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let number = |path: &Path| path.metadata().ok().map(|m| (m.dev(), m.ino()));
    number(a).is_some_and(|n| number(b) == Some(n))
}

/// Always returns `false`, because the standard library provides file numbers only on Unix.
#[cfg(not(unix))]
fn one_inode(_: &Path, _: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit;

    #[test]
    fn an_output_is_opened_at_once_and_nothing_is_lost_before_it_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let (old, new, input) = (dir.path().join("old"), dir.path().join("new"), dir.path().join("input"));
        std::fs::write(&old, "precious").unwrap();
        std::fs::write(&input, "read").unwrap();
        let code =
            |result: Result<OutputFile, OutputError>| result.err().map(|e| (exit::of(e.kind()), e.code()));
        // Commands without a port or bus send no frames, so the message does not mention frames.
        let there = OutputFile::open(&old, false, &[]).err().unwrap();
        assert!(there.to_string().ends_with("already exists"), "{there}");
        assert_eq!(code(OutputFile::open(&old, false, &[])), Some((4, "exists")));
        assert_eq!(code(OutputFile::open(&input, true, &[&input])), Some((4, "same-file")));
        let around = dir.path().join(".").join("input");
        assert_eq!(code(OutputFile::open(&around, true, &[&input])), Some((4, "same-file")));
        assert_eq!(code(OutputFile::open(&dir.path().join("no/where"), false, &[])), Some((2, "io")));
        #[cfg(unix)]
        {
            let link = dir.path().join("link");
            std::fs::hard_link(&input, &link).unwrap();
            assert_eq!(code(OutputFile::open(&link, true, &[&input])), Some((4, "same-file")));
        }
        drop(OutputFile::open(&old, true, &[]).unwrap());
        assert_eq!(std::fs::read_to_string(&old).unwrap(), "precious");
        let opened = OutputFile::open(&new, false, &[]).unwrap();
        assert!(new.exists());
        drop(opened);
        assert!(!new.exists());
        OutputFile::open(&old, true, &[]).unwrap().write("short").unwrap();
        OutputFile::open(&new, false, &[]).unwrap().write("text").unwrap();
        let renamed = dir.path().join("renamed");
        OutputFile::open(&renamed, false, &[]).unwrap().is_written();
        assert!(renamed.exists());
        let read = |path| std::fs::read_to_string(path).unwrap();
        assert_eq!((read(&old).as_str(), read(&new).as_str()), ("short", "text"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error_of_its_own() {
        let failure =
            OutputFile::open(Path::new("/dev/full"), false, &[]).unwrap().write("text").unwrap_err();
        assert!(failure.to_string().contains("No space left"), "{failure}");
    }
}
