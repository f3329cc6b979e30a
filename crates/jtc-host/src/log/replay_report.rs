//! Report of a replayed log: the log, its ticks, its timeline and the header of the recording that is created from the log.

use std::io::{Seek, Write};
use std::path::Path;

use super::{FlightLog, Replayed, Timeline};
use crate::arm::Arm;
use crate::recording::{Ending, RecordingError, RecordingInfo, write_with_log};
use crate::report::RunFailure;

/// Log with its replay, its timeline and the header of its recording.
#[derive(Debug)]
pub struct Account {
    /// Log that was replayed.
    pub log: FlightLog,
    /// Result of the replay, with all ticks of the log.
    pub replayed: Replayed,
    /// Events of the log in order.
    pub story: Timeline,
    /// Header of the recording.
    pub info: RecordingInfo,
    /// First error and its consequences; `None` if the log contains no error.
    pub failure: Option<RunFailure>,
}

impl Account {
    /// Replays a log. `other` is an arm with its image. If `other` is set, the replay uses this arm instead of the arm that is stored with
    /// the log. `source` is the file or device from which the log was read.
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

    /// Writes the recording with the log as MCAP. Error messages use `path` as the name of the recording file.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`write_with_log`].
    pub fn write(&self, file: impl Write + Seek + Send, path: &Path) -> Result<(), RecordingError> {
        write_with_log(file, path, &self.info, &self.replayed.samples(), &self.log.to_bytes())
    }
}
