//! Files that a command writes: opened before anything is sent or moved, never written over unless that was asked for.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use cli_kit::Output;
use jtc_host::recording::{Ending, LiveRecorder, RecordingInfo, SampleSink};

use crate::failure::{Failure, REFUSED};

/// Outputs that this process made and has not written yet.
static UNWRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes outputs that were made and never written, before the process is ended without any `Drop`.
pub fn abandon() {
    for path in UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
        let _ = std::fs::remove_file(path);
    }
}

/// The output at `path` is written or gone.
fn settled(path: &Path) {
    UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).retain(|p| p != path);
}

/// An output that is open and still empty, or still what it was. Dropped before it was written, it leaves no trace.
pub struct OutputFile {
    path: PathBuf,
    file: File,
    /// It was not there before.
    made: bool,
    written: bool,
}

impl OutputFile {
    /// Opens `path` for writing. A file that is there is refused without `force`, and one of `others` (what the command reads, and
    /// its other outputs) always. A command that has a port says that [nothing was sent](Failure::nothing_sent).
    pub fn open(path: &Path, force: bool, others: &[&Path]) -> Result<Self, Failure> {
        if let Some(other) = others.iter().find(|other| same(path, other)) {
            let message =
                format!("{} is {}, which this command uses itself", path.display(), other.display());
            return Err(refused("same-file", message).hint("name another file; --force does not cover this"));
        }
        let io = |e| Failure { code: "io".into(), ..Failure::usage(format!("{}: {e}", path.display())) };
        match OpenOptions::new().write(true).create_new(true).open(path) {
            Ok(file) => {
                UNWRITTEN.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
                return Ok(Self { path: path.to_owned(), file, made: true, written: false });
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(io(e)),
        }
        // A pipe or a device holds nothing that could be lost.
        if !force && path.is_file() {
            let message = format!("{} is there already", path.display());
            return Err(refused("exists", message).hint("name another file; --force writes over it"));
        }
        let file = OpenOptions::new().write(true).open(path).map_err(io)?;
        Ok(Self { path: path.to_owned(), file, made: false, written: false })
    }

    /// As people name it.
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// Writes all of the file.
    pub fn write(mut self, text: &str) -> Result<(), Failure> {
        let done = self.begin().and_then(|mut file| {
            file.write_all(text.as_bytes())?;
            settle(&file)
        });
        done.map_err(|e| self.failure(&e))
    }

    /// Begins a recording, in the form that the ending of the name says; what it began before is gone. Writing that fails later is said
    /// at once, and `goes_on` what happens then.
    pub fn record(
        &mut self,
        info: &RecordingInfo,
        goes_on: &'static str,
        out: &Output,
    ) -> Result<Tape, Failure> {
        let file = self.begin().map_err(|e| self.failure(&e))?;
        let on_disk = file.try_clone().map_err(|e| self.failure(&e))?;
        let out = *out;
        let live = LiveRecorder::begin(file, &self.path, info, move |e| {
            out.note(format!("jtc: {e}; nothing more is recorded, {goes_on}"));
        });
        // Without its beginning the file is as good as none.
        self.written = live.is_ok();
        let live = live?;
        Ok(Tape { name: self.name(), live, on_disk })
    }

    /// The open file, for a command that writes it piece by piece.
    pub fn pieces(mut self) -> Result<File, Failure> {
        self.begin().map_err(|e| self.failure(&e))
    }

    /// What was in the file goes only now.
    fn begin(&mut self) -> std::io::Result<File> {
        self.written = true;
        settled(&self.path);
        let mut file = self.file.try_clone()?;
        if file.metadata()?.is_file() {
            file.set_len(0)?;
            file.rewind()?;
        }
        Ok(file)
    }

    fn failure(&self, e: &std::io::Error) -> Failure {
        Failure { code: "io".into(), ..Failure::usage(format!("{}: {e}", self.name())) }
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

/// A recording in the making.
pub struct Tape {
    name: String,
    live: LiveRecorder,
    on_disk: File,
}

impl Tape {
    /// As people name it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where samples go.
    pub fn sink(&self) -> SampleSink {
        self.live.sink()
    }

    /// Completes it with how the run ended.
    pub fn finish(self, ending: &Ending) -> Result<(), Failure> {
        let Self { name, live, on_disk } = self;
        live.finish(ending).map_err(|e| Failure::from(e).recording_broken_off())?;
        settle(&on_disk).map_err(|e| Failure::usage(format!("{name}: {e}")).recording_broken_off())
    }

    /// Ends it without completing the file, which is about to be begun again.
    pub fn abandon(self) {
        self.live.abandon();
    }
}

/// A full disk may show only when the bytes really go there.
fn settle(file: &File) -> std::io::Result<()> {
    if file.metadata()?.is_file() { file.sync_all() } else { Ok(()) }
}

fn refused(code: &str, message: String) -> Failure {
    Failure { exit: REFUSED, code: code.into(), ..Failure::usage(message) }
}

/// Both names lead to the same file that is there.
fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b) || one_inode(a, b)
}

/// A file of two names (a hard link) is one file.
#[cfg(unix)]
fn one_inode(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let number = |path: &Path| path.metadata().ok().map(|m| (m.dev(), m.ino()));
    number(a).is_some_and(|n| number(b) == Some(n))
}

/// Only Unix has numbers for files that the standard library shows.
#[cfg(not(unix))]
fn one_inode(_: &Path, _: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_opened_at_once_and_nothing_is_lost_before_it_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let (old, new, input) = (dir.path().join("old"), dir.path().join("new"), dir.path().join("input"));
        std::fs::write(&old, "precious").unwrap();
        std::fs::write(&input, "read").unwrap();
        // Commands without a port send nothing whatever happens.
        let there = OutputFile::open(&old, false, &[]).err().unwrap();
        assert!(there.message.ends_with("is there already"), "{}", there.message);
        assert!(there.nothing_sent().message.ends_with("is there already; nothing was sent"));
        let code = |result: Result<OutputFile, Failure>| result.err().map(|f| (f.exit, f.code));
        assert_eq!(code(OutputFile::open(&old, false, &[])), Some((4, "exists".into())));
        assert_eq!(code(OutputFile::open(&input, true, &[&input])), Some((4, "same-file".into())));
        let around = dir.path().join(".").join("input");
        assert_eq!(code(OutputFile::open(&around, true, &[&input])), Some((4, "same-file".into())));
        assert_eq!(code(OutputFile::open(&dir.path().join("no/where"), false, &[])), Some((2, "io".into())));
        #[cfg(unix)]
        {
            let link = dir.path().join("link");
            std::fs::hard_link(&input, &link).unwrap();
            assert_eq!(code(OutputFile::open(&link, true, &[&input])), Some((4, "same-file".into())));
        }
        drop(OutputFile::open(&old, true, &[]).unwrap());
        assert_eq!(std::fs::read_to_string(&old).unwrap(), "precious");
        let opened = OutputFile::open(&new, false, &[]).unwrap();
        assert!(new.exists());
        drop(opened);
        assert!(!new.exists());
        OutputFile::open(&old, true, &[]).unwrap().write("short").unwrap();
        OutputFile::open(&new, false, &[]).unwrap().write("text").unwrap();
        let read = |path| std::fs::read_to_string(path).unwrap();
        assert_eq!((read(&old).as_str(), read(&new).as_str()), ("short", "text"));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_an_error_that_says_so() {
        let failure =
            OutputFile::open(Path::new("/dev/full"), false, &[]).unwrap().write("text").unwrap_err();
        assert!(failure.message.contains("No space left"), "{}", failure.message);
    }
}
