//! Findings of a doctor, the command that finds the cause of a problem.
use std::fmt;

use serde::Serialize;

use crate::Next;

/// Severity of a finding. The most severe variant is first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Problem that prevents any operation of the system.
    Problem,
    /// Deviation that does not prevent operation.
    Warning,
    /// Correct state of the system.
    Good,
}

impl Severity {
    /// Returns the mark that is printed before a finding: `✗`, `!` or `✓`.
    pub const fn mark(self) -> char {
        match self {
            Self::Problem => '✗',
            Self::Warning => '!',
            Self::Good => '✓',
        }
    }
}

/// Finding of a doctor: severity, description, probable cause and next step.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Severity of the finding.
    pub severity: Severity,
    /// Description of the finding.
    pub what: String,
    /// Probable cause of the finding; may be empty.
    pub why: String,
    /// Next step for the user; empty if no step is needed.
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

/// List of findings.
#[derive(Clone, Debug, Default)]
pub struct Findings(Vec<Finding>);

impl Findings {
    /// Adds a finding.
    pub fn add(
        &mut self,
        severity: Severity,
        what: impl Into<String>,
        why: impl Into<String>,
        next: impl Into<Next>,
    ) {
        self.0.push(Finding { severity, what: what.into(), why: why.into(), next: next.into() });
    }

    /// Adds a problem that prevents any operation.
    pub fn problem(&mut self, what: impl Into<String>, why: impl Into<String>, next: impl Into<Next>) {
        self.add(Severity::Problem, what, why, next);
    }

    /// Adds a deviation that does not prevent operation.
    pub fn warn(&mut self, what: impl Into<String>, why: impl Into<String>, next: impl Into<Next>) {
        self.add(Severity::Warning, what, why, next);
    }

    /// Adds a finding about a correct state.
    pub fn good(&mut self, what: impl Into<String>) {
        self.add(Severity::Good, what, "", "");
    }

    /// Returns `true` if a finding prevents any operation.
    pub fn has_problem(&self) -> bool {
        self.0.iter().any(|finding| finding.severity == Severity::Problem)
    }

    /// Returns all findings, the most severe first. Findings of equal severity stay in the order in which they were
    /// added.
    pub fn worst_first(mut self) -> Vec<Finding> {
        self.0.sort_by_key(|finding| finding.severity);
        self.0
    }
}
