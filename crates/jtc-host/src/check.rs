//! Verdicts on a trajectory.

/// Result of a check.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Verdict {}

impl Verdict {
    /// The next command or act that helps.
    pub fn hint(&self) -> String {
        String::new()
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "refused")
    }
}
