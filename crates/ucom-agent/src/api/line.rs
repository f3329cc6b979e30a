//! A line of the log of commands, which is written whatever becomes of who has asked.
use std::sync::{Mutex, PoisonError};

use agent_kit::api::Problem;
use agent_kit::gate::Gate;
use serde_json::Value;

/// A command, until what came of it is written down.
pub(super) struct Line {
    gate: Gate,
    /// What it was; `None`: it is written.
    facts: Mutex<Option<Value>>,
}

impl Line {
    /// Of a command that is asked for now.
    pub fn new(gate: &Gate, facts: Value) -> Self {
        Self { gate: gate.clone(), facts: Mutex::new(Some(facts)) }
    }

    /// It was done, or why it was not.
    pub fn end<T>(&self, done: &Result<T, Problem>) {
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
        self.write(Some("who had asked for it was gone before its turn came"));
    }
}
