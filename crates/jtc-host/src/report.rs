//! Report of a run: figures per joint, an HTML page with interactive plots that needs no other files, and a small picture.
//!
//! [`Digest`] receives the samples one after the other, and keeps the data that a report needs. [`Summary`] contains the
//! figures. [`html`] creates the page. The page can be opened offline, because it contains the plot library, the styles
//! and the data. [`picture_svg`] draws the commanded and measured positions and the tracking error as one SVG.

mod curves;
mod digest;
mod failure;
mod link;
mod pack;
mod page;
mod picture;
#[cfg(test)]
mod stream_tests;
mod summary;
#[cfg(test)]
mod tests;
mod watch;

pub use digest::Digest;
pub use failure::{Moment, RunFailure};
pub use page::html;
pub use picture::picture_svg;
pub use summary::{JointSummary, Summary};

use crate::plan::Bound;
use crate::recording::RecordingInfo;

/// Facts with a title, which the page shows as a table: link statistics, settings of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Heading of the table.
    pub title: String,
    /// Names and values, including units.
    pub rows: Vec<(String, String)>,
}

/// Input of a report.
#[derive(Clone, Copy, Debug)]
pub struct ReportInput<'a> {
    /// Arm, limits and origin of the samples.
    pub info: &'a RecordingInfo,
    /// Digest of the samples, oldest first.
    pub digest: &'a Digest,
    /// Tables to show next to the plots.
    pub facts: &'a [Facts],
    /// First error if the run failed. The error is shown at the top of the page.
    pub failure: Option<&'a RunFailure>,
    /// Binding limits of a motion that was planned but not run. `None` for a run.
    pub plan: Option<&'a [Bound]>,
}

impl<'a> ReportInput<'a> {
    /// Creates the input for a run that did not fail, without tables.
    pub fn new(info: &'a RecordingInfo, digest: &'a Digest) -> Self {
        Self { info, digest, facts: &[], failure: None, plan: None }
    }
}

/// Escapes text for markup.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
