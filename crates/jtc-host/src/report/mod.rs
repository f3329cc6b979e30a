//! The report of a run: figures per joint, one self-contained HTML page with interactive plots, and a small picture.
//!
//! [`Digest`] takes in samples one after the other, of a minute or of a day, and keeps what a report needs of them: [`Summary`] has the
//! figures that matter, [`html`] makes the page (it opens offline: plots, styles and
//! data are inside), [`picture_svg`] draws commanded and measured positions and the tracking error as one SVG.

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

/// A titled list of facts that the page shows as a table: link statistics, settings of the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Heading of the table.
    pub title: String,
    /// Name and value, units included.
    pub rows: Vec<(String, String)>,
}

/// What a report is made from.
#[derive(Clone, Copy, Debug)]
pub struct ReportInput<'a> {
    /// Arm, limits and origin of the samples.
    pub info: &'a RecordingInfo,
    /// The samples, oldest first.
    pub digest: &'a Digest,
    /// Tables to show beside the plots.
    pub facts: &'a [Facts],
    /// What broke first, where the run failed: it leads the page.
    pub failure: Option<&'a RunFailure>,
    /// Of a motion that was planned and not run: what binds when. `None`: of a run.
    pub plan: Option<&'a [Bound]>,
}

impl<'a> ReportInput<'a> {
    /// Of a run that did not fail, without tables.
    pub fn new(info: &'a RecordingInfo, digest: &'a Digest) -> Self {
        Self { info, digest, facts: &[], failure: None, plan: None }
    }
}

/// Text inside of markup.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
