//! Finding of a diagnosis, as the APIs of all agents return it.
use host_kit::{Finding, FrontEnd, Severity};
use utoipa::ToSchema;

/// Finding of a diagnosis.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct FindingObject {
    /// Severity: `problem`, `warning` or `good`.
    pub severity: String,
    /// Text of the finding.
    pub what: String,
    /// Probable cause; empty if no cause is known.
    pub why: String,
    /// Next step; empty if no action is needed.
    pub next: String,
}

impl From<&Finding> for FindingObject {
    fn from(Finding { severity, what, why, next }: &Finding) -> Self {
        let severity = match severity {
            Severity::Problem => "problem",
            Severity::Warning => "warning",
            Severity::Good => "good",
        };
        let (why, next) = (why.replace('`', ""), next.plain(FrontEnd::Agent));
        Self { severity: severity.into(), what: what.clone(), why, next }
    }
}
