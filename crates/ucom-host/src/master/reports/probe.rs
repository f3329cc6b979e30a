//! What a probe may do, and what it measured.
use std::sync::Arc;

use serde::Serialize;
use ucom::Profile;

use crate::master::reports::init::InitReport;

/// What a probe may do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProbeOptions {
    /// Reset and number the chain anew: shows whether boards raise their pin by themselves.
    pub init: bool,
    /// Start a control loop, outputs inactive: shows which heartbeats count.
    pub alive: bool,
    /// An image that some board has, as sent: shows how the Program ID is computed.
    pub image: Option<Arc<[u8]>>,
    /// Also when another PC is on the bus; `init` and `alive` also when control loops run, which end by that.
    pub force: bool,
}

/// One unknown and what was found out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ProbeRow {
    /// Key of the profile.
    pub key: &'static str,
    /// What is unknown.
    pub unknown: &'static str,
    /// What the published description has about it.
    pub published: &'static str,
    /// What was observed.
    pub observed: String,
    /// The value in the profile.
    pub decision: String,
    /// The observation decides; else the value is the one from before.
    pub measured: bool,
}

/// What a probe found.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbeReport {
    /// The profile with what was measured; the master goes on with the one that it had.
    pub profile: Profile,
    /// Statement, observation and decision.
    pub rows: Vec<ProbeRow>,
    /// Boards that answered.
    pub boards: Vec<u8>,
    /// Different UCoM ids in reports: boards with and without a number.
    pub reports: usize,
    /// The new numbers, where it was to give some.
    pub init: Option<InitReport>,
}

impl ProbeReport {
    /// The table as text for people.
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
