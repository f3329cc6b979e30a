//! Options and results of a probe.
use std::sync::Arc;

use serde::Serialize;
use ucom::Profile;

use crate::master::reports::init::InitReport;

/// Permissions of a probe.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProbeOptions {
    /// Permission to reset and renumber the chain; shows whether boards raise their pin by themselves.
    pub init: bool,
    /// Permission to start a control loop with inactive outputs; shows which heartbeats count.
    pub alive: bool,
    /// An image that some board has, as sent; shows how the Program ID is computed.
    pub image: Option<Arc<[u8]>>,
    /// Permission to probe although another PC is on the bus; with `init` and `alive` also although control loops run, which this ends.
    pub force: bool,
}

/// Unknown property and its measurement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ProbeRow {
    /// Key of the profile.
    pub key: &'static str,
    /// Unknown property.
    pub unknown: &'static str,
    /// Statement of the published description.
    pub published: &'static str,
    /// Observation.
    pub observed: String,
    /// The value in the profile.
    pub decision: String,
    /// `true` if the observation decided; otherwise the previous value stays.
    pub measured: bool,
}

/// Result of a probe.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeReport {
    /// Profile with the measured values; the master keeps its own profile.
    pub profile: Profile,
    /// Statement, observation and decision.
    pub rows: Vec<ProbeRow>,
    /// Boards that answered.
    pub boards: Vec<u8>,
    /// Different UCoM ids in reports: boards with and without a number.
    pub reports: usize,
    /// New numbers, if the probe assigned any.
    pub init: Option<InitReport>,
}

impl ProbeReport {
    /// Returns the table as text for display.
    pub fn table(&self) -> String {
        let mut text = String::new();
        for row in &self.rows {
            let sure = if row.measured { "measured" } else { "kept" };
            text += &format!(
                "{}\n  key        {} = {} ({sure})\n  published  {}\n  observed   {}\n",
                row.unknown, row.key, row.decision, row.published, row.observed
            );
        }
        text
    }
}
