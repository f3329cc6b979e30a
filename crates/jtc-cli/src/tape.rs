//! Recordings that are written while the arm moves.

use crate::failure::recording_broken_off;
use std::fs::File;

use cli_kit::output_file::{OutputFile, settle};
use cli_kit::{Failure, Output};
use jtc_host::recording::{Ending, LiveRecorder, RecordingInfo, SampleSink};

/// A recording in the making.
pub struct Tape {
    name: String,
    live: LiveRecorder,
    on_disk: File,
}

impl Tape {
    /// Begins a recording in `output`, in the form of the ending of its name; what it began before is gone. Writing that fails
    /// later is reported at once, and `goes_on` what happens then.
    pub fn begin(
        output: &mut OutputFile,
        info: &RecordingInfo,
        goes_on: &'static str,
        out: &Output,
    ) -> Result<Self, Failure> {
        let file = output.begin()?;
        let on_disk = file.try_clone().map_err(|e| output.failure(e))?;
        let out = *out;
        let live = LiveRecorder::begin(file, output.path(), info, move |e| {
            out.note(format!("jtc: {e}; nothing more is recorded, {goes_on}"));
        });
        match live {
            Ok(live) => Ok(Self { name: output.name(), live, on_disk }),
            Err(e) => {
                // Without its beginning the file is as good as none.
                output.is_worthless();
                Err(e.into())
            }
        }
    }

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
        live.finish(ending).map_err(recording_broken_off)?;
        settle(&on_disk).map_err(|e| recording_broken_off(Failure::usage(format!("{name}: {e}"))))
    }

    /// Ends it without completing the file, which is about to be begun again.
    pub fn abandon(self) {
        self.live.abandon();
    }
}
