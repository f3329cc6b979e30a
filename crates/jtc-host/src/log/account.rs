//! A log that was run again, with what it says and the recording that is made of it.

use std::io::{Seek, Write};
use std::path::Path;

use super::{FlightLog, Replayed, Story};
use crate::arm::Arm;
use crate::recording::{Ending, RecordingError, RecordingInfo, write_with_log};
use crate::report::RunFailure;

/// A log, and what it says.
#[derive(Debug)]
pub struct Account {
    /// The log.
    pub log: FlightLog,
    /// Every tick of it.
    pub replayed: Replayed,
    /// What happened.
    pub story: Story,
    /// What the recording is of.
    pub info: RecordingInfo,
    /// What broke first, where something did.
    pub failure: Option<RunFailure>,
}

impl Account {
    /// Runs a log again. `other` is the arm that it is of, with its image, where that is not the one that came with it; `source` is where
    /// it was read.
    pub fn of(log: FlightLog, other: Option<(Arm, Vec<u8>)>, source: &str) -> Self {
        let (arm, image) = other.unzip();
        let replayed = log.replay(image.as_deref());
        let story = Story::of(&replayed);
        let arm = arm.or_else(|| Arm::from_image(&log.arm).ok()).unwrap_or_else(Arm::avena);
        let mut info = RecordingInfo {
            source: source.to_owned(),
            trajectory: "flight recorder".to_owned(),
            start_unix_ns: 0,
            ..RecordingInfo::of(&arm)
        };
        let failure = story.failure(&info, &replayed.samples());
        if let Some(failure) = &failure {
            info.ending =
                Ending { outcome: "fault".into(), reason: failure.causes.join(", "), ..Ending::default() };
        }
        Self { log, replayed, story, info, failure }
    }

    /// Writes the recording, with the log in it, as MCAP; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// Those of [`write_with_log`].
    pub fn write(&self, file: impl Write + Seek + Send, path: &Path) -> Result<(), RecordingError> {
        write_with_log(file, path, &self.info, &self.replayed.samples(), &self.log.to_bytes())
    }
}
