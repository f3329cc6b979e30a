//! What the owner of the bus shows to everyone: the boards as last seen.
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use ucom::Profile;
use ucom_host::master::doctor::Controller;
use ucom_host::master::io::{ParValue, Snapshot};
use ucom_host::master::{Boards, Statistics};
use ucom_host::session::Known;

/// What is known of the values of a board.
#[derive(Clone)]
pub(crate) struct Values {
    /// Names, types, scales and units.
    pub known: Arc<Known>,
    /// Outputs as they came last.
    pub outputs: Option<Snapshot>,
    /// Inputs as last set, or read.
    pub inputs: Vec<Option<u16>>,
    /// Parameters as this agent believes them to be.
    pub parameters: Vec<ParValue>,
}

/// The bus and its boards at one time.
#[derive(Clone)]
pub(crate) struct Picture {
    /// When, by the clock of the session, µs, and by that of the agent.
    pub now_us: u64,
    pub at: Instant,
    pub profile: Profile,
    pub boards: Boards,
    pub statistics: Statistics,
    pub controller: Option<Controller>,
    /// Heartbeats go out.
    pub is_master: bool,
    /// When another PC was last seen on the bus, µs.
    pub competing_us: Option<u64>,
    /// Numbers that two boards have, in words.
    pub shared: Vec<String>,
    pub values: BTreeMap<u8, Values>,
}

impl Picture {
    pub(crate) fn new(profile: Profile) -> Self {
        Self {
            now_us: 0,
            at: Instant::now(),
            profile,
            boards: Boards::default(),
            statistics: Statistics::default(),
            controller: None,
            is_master: false,
            competing_us: None,
            shared: Vec::new(),
            values: BTreeMap::new(),
        }
    }

    /// The time of the session now, µs.
    pub(crate) fn clock_us(&self) -> u64 {
        self.now_us + self.at.elapsed().as_micros() as u64
    }
}
