//! Report of a run, with values for each joint, an HTML page with interactive plots in a single file, and a small picture.
//!
//! [`Digest`] receives the samples one after the other, and stores the data that a report needs. [`Summary`] contains the values for each
//! joint. [`html`] creates the page. The page can be opened offline, because it contains the plot library, the styles and the data.
//! [`picture_svg`] draws the commanded and measured positions and the tracking error as one SVG.

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

/// Facts with a title that the page shows as a table, for example link statistics or settings of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Heading of the table.
    pub title: String,
    /// Names and values of the facts; the values include the units.
    pub rows: Vec<(String, String)>,
}

/// Input data for a report.
#[derive(Clone, Copy, Debug)]
pub struct ReportInput<'a> {
    /// Arm, limits and origin of the samples.
    pub info: &'a RecordingInfo,
    /// Digest of the samples.
    pub digest: &'a Digest,
    /// Tables that are shown next to the plots.
    pub facts: &'a [Facts],
    /// First error, if the run failed. The error is shown at the top of the page.
    pub failure: Option<&'a RunFailure>,
    /// Limits that determine the speed of a motion that was planned but not executed. `None` for an executed motion.
    pub plan: Option<&'a [Bound]>,
}

impl<'a> ReportInput<'a> {
    /// Creates the input for a run without a failure and without tables.
    pub fn new(info: &'a RecordingInfo, digest: &'a Digest) -> Self {
        Self { info, digest, facts: &[], failure: None, plan: None }
    }
}

/// Escapes special characters in text for HTML and SVG.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
