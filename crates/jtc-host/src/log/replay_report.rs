//! A replayed log with its timeline and the recording that is created from it.

use std::io::{Seek, Write};
use std::path::Path;

use super::{FlightLog, Replayed, Timeline};
use crate::arm::Arm;
use crate::recording::{Ending, RecordingError, RecordingInfo, write_with_log};
use crate::report::RunFailure;

/// A log with its replay, timeline and recording information.
#[derive(Debug)]
pub struct Account {
    /// The log.
    pub log: FlightLog,
    /// All ticks of the log after the replay.
    pub replayed: Replayed,
    /// Events of the log in order.
    pub story: Timeline,
    /// Header of the recording.
    pub info: RecordingInfo,
    /// First error with its consequences. `None` if the log contains no error.
    pub failure: Option<RunFailure>,
}

impl Account {
    /// Replays a log. `other` is an arm together with its image. The replay uses this arm instead of the arm that is stored with the log.
    /// `source` is the location from which the log was read.
    pub fn of(log: FlightLog, other: Option<(Arm, Vec<u8>)>, source: &str) -> Self {
        let (arm, image) = other.unzip();
        let replayed = log.replay(image.as_deref());
        let story = Timeline::of(&replayed);
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

    /// Writes the recording with the log as MCAP. Error messages use `path` as the name of the file.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`write_with_log`].
    pub fn write(&self, file: impl Write + Seek + Send, path: &Path) -> Result<(), RecordingError> {
        write_with_log(file, path, &self.info, &self.replayed.samples(), &self.log.to_bytes())
    }
}
