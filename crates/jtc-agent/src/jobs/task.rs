//! What a job has beside its client's end of the line.
use std::sync::mpsc::Receiver;

use agent_kit::api::Problem;
use jtc_host::Arm;

use super::{Commander, Happening, Journal, Wish};
use crate::line::ClientId;
use crate::owner::Line;

/// The code of what somebody stopped before it moved the arm.
pub const STOPPED: &str = "stopped";

/// A job on its way.
pub struct Task<'a> {
    /// Its number.
    pub job: u64,
    /// What it does.
    pub what: &'a str,
    /// What is wished on the way.
    pub wishes: &'a Receiver<Wish>,
    /// Where each step is reported.
    pub journal: &'a Journal,
    /// Where a Stop of somebody else shows.
    pub line: &'a Line,
    /// Whose it is.
    pub commander: &'a Commander,
    /// The arm of controllers that cannot be asked for theirs.
    pub arm: &'a Arm,
}

impl Task<'_> {
    /// Reports something in words.
    pub fn note(&self, text: String) {
        self.journal.write(Happening::Note { job: self.job, text });
    }

    /// Somebody has stopped or paused the arm since this was asked for, or was gone on with.
    pub fn is_halted(&self) -> bool {
        self.line.with(|line, _| line.is_halted(self.commander.client))
    }

    /// Who stopped or paused it.
    pub fn halted_by(&self) -> String {
        self.line.with(|line, _| line.halted_by(self.commander.client).to_owned())
    }

    /// Somebody stopped the arm before this moved it.
    pub fn stopped(&self) -> Problem {
        stopped(self.line, self.commander.client)
    }
}

/// Somebody stopped the arm before what was asked for moved it.
pub fn stopped(line: &Line, client: ClientId) -> Problem {
    let by = line.with(|line, _| line.halted_by(client).to_owned());
    Problem::new(
        STOPPED,
        format!("{by} stopped or paused the arm before this moved it: nothing is begun behind that"),
        "ask for it again when the arm may move",
    )
}
