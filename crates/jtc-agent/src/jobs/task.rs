//! Data that a job uses in addition to its session.
use std::sync::mpsc::Receiver;

use agent_kit::api::Problem;
use jtc_host::Arm;

use super::{ArmEvent, HttpSession, Journal, Wish};
use crate::line::ClientId;
use crate::owner::Line;

/// Error code of a request that a Stop ended before it moved the arm.
pub const STOPPED: &str = "stopped";

/// Job that is running, with the data that it uses.
pub struct Task<'a> {
    /// Number of the job.
    pub job: u64,
    /// Description of the job.
    pub what: &'a str,
    /// Requests of the client to the running job.
    pub wishes: &'a Receiver<Wish>,
    /// Journal into which the job writes its steps.
    pub journal: &'a Journal,
    /// Serial line, which informs the job about a Stop of another client.
    pub line: &'a Line,
    /// Session of the client that requested the job.
    pub http_session: &'a HttpSession,
    /// Arm that the job uses if the controller cannot return its arm.
    pub arm: &'a Arm,
}

impl Task<'_> {
    /// Writes a note to the journal.
    pub fn note(&self, text: String) {
        self.journal.write(ArmEvent::Note { job: self.job, text });
    }

    /// Returns `true` if a client stopped or paused the arm after this motion was requested or
    /// resumed.
    pub fn is_halted(&self) -> bool {
        self.line.with(|line, _| line.is_halted(self.http_session.client))
    }

    /// Returns the name of the client that stopped or paused the arm.
    pub fn halted_by(&self) -> String {
        self.line.with(|line, _| line.halted_by(self.http_session.client).to_owned())
    }

    /// Returns the error for a job that a Stop ended before it moved the arm.
    pub fn stopped(&self) -> Problem {
        stopped(self.line, self.http_session.client)
    }
}

/// Returns the error for a request that a Stop ended before it moved the arm.
pub fn stopped(line: &Line, client: ClientId) -> Problem {
    let by = line.with(|line, _| line.halted_by(client).to_owned());
    Problem::new(
        STOPPED,
        format!("{by} stopped or paused the arm before this request moved it: the request was discarded"),
        "send the request again when the arm may move",
    )
}
