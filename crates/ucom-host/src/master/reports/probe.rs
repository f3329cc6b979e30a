//! Options and results of a probe.
use std::sync::Arc;

use serde::Serialize;
use ucom::Profile;

use crate::master::reports::init::InitReport;

/// Permissions of a probe.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProbeOptions {
    /// Permission to reset and renumber the chain. The probe then also determines if boards switch on their pin by themselves.
    pub init: bool,
    /// Permission to start a control loop with inactive outputs. The probe then also determines which heartbeats keep the loop running.
    pub alive: bool,
    /// Image that a board contains, as it was sent. The probe then also determines how the Program ID is computed.
    pub image: Option<Arc<[u8]>>,
    /// Permission to probe while another PC is on the bus. With `init` and `alive`, also permission to end running control loops.
    pub force: bool,
}

/// Property that the published description does not define, and its measurement.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ProbeRow {
    /// Key of the profile.
    pub key: &'static str,
    /// The property.
    pub unknown: &'static str,
    /// Statement about the property in the published description.
    pub published: &'static str,
    /// The observation.
    pub observed: String,
    /// Value in the resulting profile.
    pub decision: String,
    /// `true` if the observation determines the value; otherwise the previous value is kept.
    pub measured: bool,
}

/// Result of a probe.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeReport {
    /// Profile with the measured values. The master does not apply this profile automatically.
    pub profile: Profile,
    /// Table with one row per property.
    pub rows: Vec<ProbeRow>,
    /// Boards that answered.
    pub boards: Vec<u8>,
    /// Number of different UCoM ids in the reports. The number includes boards without a number.
    pub reports: usize,
    /// Report of the new numbers, if the probe has assigned numbers.
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
