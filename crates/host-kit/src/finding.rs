//! What a doctor finds: how bad it is, what it is, the likely cause, and the next command.
use std::fmt;

use serde::Serialize;

use crate::Next;

/// How bad a finding is, the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Nothing works until it is gone.
    Problem,
    /// It works, but not as it should.
    Warning,
    /// As it should be.
    Good,
}

impl Severity {
    /// The mark before a line of a list: `✗`, `!` or `✓`.
    pub const fn mark(self) -> char {
        match self {
            Self::Problem => '✗',
            Self::Warning => '!',
            Self::Good => '✓',
        }
    }
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What was found.
    pub what: String,
    /// What probably is the cause; may be empty.
    pub why: String,
    /// The next command or act; empty when there is nothing to do.
    pub next: Next,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)?;
        if !self.why.is_empty() {
            write!(f, ": {}", self.why)?;
        }
        if !self.next.is_empty() {
            write!(f, "\n    next: {}", self.next)?;
        }
        Ok(())
    }
}

/// Findings in the making.
#[derive(Clone, Debug, Default)]
pub struct Findings(Vec<Finding>);

impl Findings {
    /// Adds one.
    pub fn add(
        &mut self,
        severity: Severity,
        what: impl Into<String>,
        why: impl Into<String>,
        next: impl Into<Next>,
    ) {
        self.0.push(Finding { severity, what: what.into(), why: why.into(), next: next.into() });
    }

    /// Adds what has to be gone before anything works.
    pub fn problem(&mut self, what: impl Into<String>, why: impl Into<String>, next: impl Into<Next>) {
        self.add(Severity::Problem, what, why, next);
    }

    /// Adds what is not as it should be.
    pub fn warn(&mut self, what: impl Into<String>, why: impl Into<String>, next: impl Into<Next>) {
        self.add(Severity::Warning, what, why, next);
    }

    /// Adds what is as it should be.
    pub fn good(&mut self, what: impl Into<String>) {
        self.add(Severity::Good, what, "", "");
    }

    /// Whether one of them has to be gone before anything works.
    pub fn has_problem(&self) -> bool {
        self.0.iter().any(|finding| finding.severity == Severity::Problem)
    }

    /// All of them, the worst first and else in the order in which they were added.
    pub fn worst_first(mut self) -> Vec<Finding> {
        self.0.sort_by_key(|finding| finding.severity);
        self.0
    }
}
