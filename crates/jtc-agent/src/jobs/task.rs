//! Data that a job uses in addition to its session.
use std::sync::mpsc::Receiver;

use agent_kit::api::Problem;
use jtc_host::Arm;

use super::{ArmEvent, HttpSession, Journal, Wish};
use crate::line::ClientId;
use crate::owner::Line;

/// Error code of a request that was stopped before it moved the arm.
pub const STOPPED: &str = "stopped";

/// Running job.
pub struct Task<'a> {
    /// Number of the job.
    pub job: u64,
    /// Description of the job.
    pub what: &'a str,
    /// Requests while the job runs.
    pub wishes: &'a Receiver<Wish>,
    /// Journal for the steps of the job.
    pub journal: &'a Journal,
    /// Serial line, which reports a Stop of another client to the job.
    pub line: &'a Line,
    /// Session of the job's client.
    pub http_session: &'a HttpSession,
    /// Arm that is used if the controller cannot return an arm.
    pub arm: &'a Arm,
}

impl Task<'_> {
    /// Writes a note to the journal.
    pub fn note(&self, text: String) {
        self.journal.write(ArmEvent::Note { job: self.job, text });
    }

    /// Returns `true` if the arm was stopped or paused after this motion was requested or resumed.
    pub fn is_halted(&self) -> bool {
        self.line.with(|line, _| line.is_halted(self.http_session.client))
    }

    /// Returns the name of the client that stopped or paused the arm.
    pub fn halted_by(&self) -> String {
        self.line.with(|line, _| line.halted_by(self.http_session.client).to_owned())
    }

    /// Returns the error for a job that was stopped before it moved the arm.
    pub fn stopped(&self) -> Problem {
        stopped(self.line, self.http_session.client)
    }
}

/// Returns the error for a request that was stopped before it moved the arm.
pub fn stopped(line: &Line, client: ClientId) -> Problem {
    let by = line.with(|line, _| line.halted_by(client).to_owned());
    Problem::new(
        STOPPED,
        format!("{by} stopped or paused the arm before this request moved it: the request was discarded"),
        "send the request again when the arm may move",
    )
}
