//! What is wrong with link, bus and set-up, as `jtc doctor` finds it.
use std::time::Duration;

use agent_kit::api::{Problem, Refusals};
use axum::Json;
use axum::extract::State;
use host_kit::FrontEnd;
use jtc_host::doctor::{Finding, Observation, Severity, findings};
use jtc_host::{Session, words};
use jtc_wire::{JOINTS, Joint, STATUS_LEN, Status, error};
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;

/// How long is listened: 50 statuses.
const LISTEN: Duration = Duration::from_secs(2);

/// What was found.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct DoctorObject {
    /// Nothing is a problem.
    pub healthy: bool,
    /// How long was listened, s.
    pub listened_s: f64,
    /// Statuses that came meanwhile.
    pub statuses: u64,
    /// Worst first.
    pub findings: Vec<FindingObject>,
}

/// A finding.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct FindingObject {
    /// `problem`, `warning` or `good`.
    pub severity: String,
    /// What it is.
    pub what: String,
    /// What usually causes it; empty where nothing is known.
    pub why: String,
    /// What helps; empty where nothing is to be done.
    pub next: String,
}

impl From<Finding> for FindingObject {
    fn from(Finding { severity, what, why, next }: Finding) -> Self {
        let severity = match severity {
            Severity::Problem => "problem",
            Severity::Warning => "warning",
            Severity::Good => "good",
        };
        let (why, next) = (why.replace('`', ""), next.plain(FrontEnd::Agent));
        Self { severity: severity.to_owned(), what, why, next }
    }
}

/// Looks for what is wrong with link, joint bus and set-up, which takes two seconds. Nothing is changed.
///
/// The link is judged by all that came from the controller. Other rates are not tried: the line is in use.
#[utoipa::path(
    get,
    path = "/api/doctor",
    operation_id = "examine",
    responses((status = 200, description = "What was found", body = DoctorObject), Refusals, Denials)
)]
pub(super) async fn doctor(State(agent): State<Agent>) -> Result<Json<DoctorObject>, Problem> {
    let look = || agent.line.with(|line, now| (now, line.received()));
    let (began, before) = look();
    tokio::time::sleep(LISTEN).await;
    let (ended, after) = look();
    let (statuses, skipped) = (after.frames - before.frames, after.skipped_bytes - before.skipped_bytes);
    let last = agent.line.with(|line, _| line.status().copied());
    let status = last.filter(|(at, _)| *at >= began).map(|(_, status)| status);
    let absent = match &status {
        Some(status) => absent(&agent, status).await?,
        None => Vec::new(),
    };
    // A stop and a jump of an encoder are under torque only.
    let reactions = match &status {
        Some(status) if words::has_torque(status) => agent.ask(|session| Ok(session.reactions())).await?,
        _ => None,
    };
    let time_s = (ended - began).as_secs_f64();
    let seen = Observation {
        baud: agent.line.baud(),
        time_s,
        bytes: statuses * STATUS_LEN as u64 + skipped,
        bad_bytes: skipped,
        statuses,
        status,
        absent,
        reactions,
        ..Observation::default()
    };
    let found = findings(&seen);
    let healthy = found.iter().all(|finding| finding.severity != Severity::Problem);
    let findings = found.into_iter().map(FindingObject::from).collect();
    Ok(Json(DoctorObject { healthy, listened_s: time_s, statuses, findings }))
}

/// The joints that are set absent. A drive that answers although its joint is has no bit of its own (J-53): the controller is asked.
async fn absent(agent: &Agent, status: &Status) -> Result<Vec<Joint>, Problem> {
    if status.errors & error::EXTERNAL_JOINTS == 0 {
        return Ok(words::absent(status));
    }
    let positions = agent.ask(|session| Ok(Session::absent(session).unwrap_or([None; JOINTS]))).await?;
    Ok(Joint::ALL.into_iter().filter(|joint| positions[joint.index()].is_some()).collect())
}
