//! Snapshot of the bus for all clients, with the last known state of each board.
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use ucom::Profile;
use ucom_host::master::doctor::Controller;
use ucom_host::master::io::{ParValue, Snapshot};
use ucom_host::master::{Boards, Statistics};
use ucom_host::session::Known;

/// Last known values of a board.
#[derive(Clone)]
pub(crate) struct Values {
    /// Names, types, scales and units of the values.
    pub known: Arc<Known>,
    /// Outputs that the board sent last.
    pub outputs: Option<Snapshot>,
    /// Inputs of the board that were last set or read.
    pub inputs: Vec<Option<u16>>,
    /// Parameters of the board that this agent wrote last.
    pub parameters: Vec<ParValue>,
}

/// State of the bus and the boards at one time.
#[derive(Clone)]
pub(crate) struct BusSnapshot {
    /// Time of the snapshot by the clock of the bus session, in µs. `at` is the same time by the clock of the agent.
    pub now_us: u64,
    pub at: Instant,
    pub profile: Profile,
    pub boards: Boards,
    pub statistics: Statistics,
    pub controller: Option<Controller>,
    /// `true` if the agent is the master of the bus and sends heartbeats.
    pub is_master: bool,
    /// Time of the last frame from another PC, in µs.
    pub competing_us: Option<u64>,
    /// Messages about board numbers that two boards share.
    pub shared: Vec<String>,
    pub values: BTreeMap<u8, Values>,
}

impl BusSnapshot {
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

    /// Returns the current time of the bus session, in µs.
    pub(crate) fn clock_us(&self) -> u64 {
        self.now_us + self.at.elapsed().as_micros() as u64
    }
}
