//! Options and results of a probe of board properties.
use std::sync::Arc;

use serde::Serialize;
use ucom::Profile;

use crate::master::reports::init::InitReport;

/// Permissions that a probe has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProbeOptions {
    /// Permission to reset and renumber the chain. With this permission, the probe also determines if boards switch on their outgoing pin
    /// by themselves.
    pub init: bool,
    /// Permission to start a control loop with inactive outputs. With this permission, the probe also determines which heartbeats keep the
    /// control loop running.
    pub alive: bool,
    /// Image that a board contains, in the form in which it was sent to the board. With this image, the probe also determines how the
    /// Program ID is computed.
    pub image: Option<Arc<[u8]>>,
    /// Permission to probe while another PC is on the bus. With `init` and `alive`, the probe may also end running control loops.
    pub force: bool,
}

/// Property that the published description does not define, and the measurement of this property.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ProbeRow {
    /// Key of the profile.
    pub key: &'static str,
    /// Property in words.
    pub unknown: &'static str,
    /// Statement of the published description about the property.
    pub published: &'static str,
    /// Observation of the probe in words.
    pub observed: String,
    /// Value of the key in the resulting profile.
    pub decision: String,
    /// `true` if the observation determines the value; `false` if the previous value is kept.
    pub measured: bool,
}

/// Result of a probe.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeReport {
    /// Profile that contains the measured values. The master does not apply this profile automatically.
    pub profile: Profile,
    /// Table with one row per property.
    pub rows: Vec<ProbeRow>,
    /// Numbers of the boards that answered.
    pub boards: Vec<u8>,
    /// Number of different UCoM ids in the reports. Boards without a number are included.
    pub reports: usize,
    /// Report of the address assignment, if the probe has assigned numbers.
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
