//! Recordings that the command writes during a motion.

use crate::failure::recording_interrupted;
use std::fs::File;

use cli_kit::output_file::{OutputFile, settle};
use cli_kit::{Failure, Output};
use jtc_host::recording::{Ending, LiveRecorder, RecordingInfo, SampleSink};

/// Recording in progress.
pub(crate) struct Tape {
    name: String,
    live: LiveRecorder,
    on_disk: File,
}

impl Tape {
    /// Begins a recording in `output`, and discards an earlier recording in the file. The file name extension selects
    /// the format. A later write error is reported at once; `goes_on` is the part of this message that describes the
    /// consequence.
    pub(crate) fn begin(
        output: &mut OutputFile,
        info: &RecordingInfo,
        goes_on: &'static str,
        out: &Output,
    ) -> Result<Self, Failure> {
        let file = output.begin()?;
        let on_disk = file.try_clone().map_err(|e| output.failure(e))?;
        let out = *out;
        let live = LiveRecorder::begin(file, output.path(), info, move |e| {
            out.note(format!("jtc: {e}; no more data are recorded, {goes_on}"));
        });
        match live {
            Ok(live) => Ok(Self { name: output.name(), live, on_disk }),
            Err(e) => {
                // The recording is useless without its header, so a new file is removed.
                output.is_worthless();
                Err(e.into())
            }
        }
    }

    /// Returns the name of the recording for messages to the user.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the sink for the samples of the recording.
    pub(crate) fn sink(&self) -> SampleSink {
        self.live.sink()
    }

    /// Completes the recording with the result of the run.
    pub(crate) fn finish(self, ending: &Ending) -> Result<(), Failure> {
        let Self { name, live, on_disk } = self;
        live.finish(ending).map_err(recording_interrupted)?;
        settle(&on_disk).map_err(|e| recording_interrupted(Failure::usage(format!("{name}: {e}"))))
    }

    /// Ends the recording without completing the file. The caller must start the file again.
    pub(crate) fn abandon(self) {
        self.live.abandon();
    }
}
