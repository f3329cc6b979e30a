//! Line about a command in the command log. The line is written even if the client disconnects.
use std::sync::{Mutex, PoisonError};

use agent_kit::api::Problem;
use agent_kit::gate::Gate;
use serde_json::Value;

/// Command whose result is not logged yet.
pub(super) struct Line {
    gate: Gate,
    /// Facts about the command; `None` after the line was written.
    facts: Mutex<Option<Value>>,
}

impl Line {
    /// Creates the log line for a command that a client requests now.
    pub(super) fn new(gate: &Gate, facts: Value) -> Self {
        Self { gate: gate.clone(), facts: Mutex::new(Some(facts)) }
    }

    /// Logs the result of the command: success, or the reason for its failure.
    pub(super) fn end<T>(&self, done: &Result<T, Problem>) {
        self.write(done.as_ref().err().map(|error| &*error.message));
    }

    fn write(&self, why_not: Option<&str>) {
        let facts = self.facts.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(mut facts) = facts {
            facts["why_not"] = why_not.into();
            self.gate.note("command", facts);
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.write(Some("the client disconnected before the agent carried out its request"));
    }
}
