//! Recording of a run. The recording file is opened before the arm moves, and is written during the
//! motion.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::path::PathBuf;

use jtc_host::recording::{Format, LiveRecorder, RecordingInfo, SampleSink};

use super::motion::Ran;
use crate::error::Failure;

/// Recording of one run.
pub(super) struct Recording {
    path: PathBuf,
    /// Temporary file that replaces `path` only at the end. An existing file therefore remains until the new file is complete.
    aside: Option<PathBuf>,
    file: Option<File>,
    live: Option<LiveRecorder>,
}

impl Recording {
    /// Opens the file before the arm moves. If `overwrite` is set, an existing file is replaced.
    pub(super) fn open(path: &PathBuf, overwrite: bool) -> Result<Self, Failure> {
        Format::of(path).map_err(|error| Failure::of(&error))?;
        let mut options = OpenOptions::new();
        options.write(true);
        let aside = (overwrite && path.exists()).then(|| {
            let mut name = OsString::from(".");
            name.push(path.file_name().unwrap_or_default());
            name.push(format!(".{}", std::process::id()));
            path.with_file_name(name)
        });
        match aside {
            Some(_) => options.create(true).truncate(true),
            None => options.create_new(true),
        };
        let opened = if path.is_dir() {
            Err(std::io::Error::from(std::io::ErrorKind::IsADirectory))
        } else {
            options.open(aside.as_ref().unwrap_or(path))
        };
        let file = opened.map_err(|error| {
            let exists = error.kind() == std::io::ErrorKind::AlreadyExists;
            let failure = Failure::usage(format!("{}: {error}; nothing was sent", path.display()));
            if exists { failure.next("choose another file, or pass overwrite=True") } else { failure }
        })?;
        Ok(Self { path: path.clone(), aside, file: Some(file), live: None })
    }

    /// Returns the sink for the samples of a motion.
    pub(super) fn sink(&mut self, info: &RecordingInfo) -> Result<Option<SampleSink>, Failure> {
        if let Some(file) = self.file.take() {
            let live = LiveRecorder::begin(file, &self.path, info, |_| {});
            self.live = Some(live.map_err(|error| Failure::of(&error))?);
        }
        Ok(self.live.as_ref().map(LiveRecorder::sink))
    }

    /// Completes the file if the arm moved along its trajectory. If the arm did not move, removes the file. If the file cannot be
    /// written, adds a note to the finished run.
    pub(super) fn end(self, ran: Result<Ran, Failure>) -> Result<Ran, Failure> {
        let Self { path, aside, file, live } = self;
        let written = aside.as_ref().unwrap_or(&path);
        match (ran, live) {
            (Ok(mut ran), Some(live)) => {
                let done = live.finish(&ran.info.ending).map_err(|error| error.to_string());
                let done = done.and_then(|_| match &aside {
                    Some(aside) => std::fs::rename(aside, &path).map_err(|error| error.to_string()),
                    None => Ok(()),
                });
                if let Err(error) = done {
                    let file = written.display();
                    ran.notes.push(format!("{file}: the recording is incomplete: {error}"));
                }
                Ok(ran)
            }
            (ran, live) => {
                // The arm did not move, so the empty file is removed.
                live.into_iter().for_each(LiveRecorder::abandon);
                drop(file);
                let _ = std::fs::remove_file(written);
                ran
            }
        }
    }
}
