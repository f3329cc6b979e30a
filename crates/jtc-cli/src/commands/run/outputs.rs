//! Output files of a run (recording and report page).

use std::path::Path;

use cli_kit::{Failure, Output, OutputFile};
use jtc_host::recording::RecordingInfo;
use jtc_host::report::{self, ReportInput};

use super::Course;
use crate::failure::output_lost;
use crate::tape::Tape;

/// Output files of a run, which the command opens before the run.
pub(super) struct Outputs {
    record: Option<OutputFile>,
    report: Option<OutputFile>,
}

impl Outputs {
    pub(super) fn open(course: &Course) -> Result<Self, Failure> {
        let mut others: Vec<&Path> = course.inputs.iter().map(|path| path.as_path()).collect();
        let files = &course.execute.files;
        let open = |path: Option<&Path>, others: &[&Path]| {
            path.map(|path| OutputFile::open(path, files.overwrite.overwrite, others)).transpose()
        };
        let record = open(files.record.as_deref(), &others)?;
        others.extend(files.record.as_deref());
        let report = open(files.report.as_deref(), &others)?;
        Ok(Self { record, report })
    }

    /// Begins the recording. If the recording has already begun, it starts again with an empty file.
    pub(super) fn begin(&mut self, info: &RecordingInfo, out: &Output) -> Result<Option<Tape>, Failure> {
        self.record.as_mut().map(|file| Tape::begin(file, info, "the motion continues", out)).transpose()
    }

    /// Completes all output files. If the command cannot write one output file, it still completes the other output file. Returns the
    /// names of the complete files, and the failures for the incomplete files.
    pub(super) fn write(self, tape: Option<Tape>, input: &ReportInput<'_>) -> (Vec<String>, Vec<Failure>) {
        let record = tape.map(|tape| (tape.name().to_owned(), tape.finish(&input.info.ending)));
        let report =
            self.report.map(|file| (file.name(), file.write(report::html(input)).map_err(output_lost)));
        let (mut files, mut lost) = (Vec::new(), Vec::new());
        for (name, done) in record.into_iter().chain(report) {
            match done {
                Ok(()) => files.push(name),
                Err(e) => lost.push(e),
            }
        }
        (files, lost)
    }
}
