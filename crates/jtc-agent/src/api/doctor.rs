//! Diagnosis of the connection, the bus and the set-up, like `jtc doctor`.
use std::time::Duration;

use agent_kit::api::{FindingObject, Problem, Refusals};
use axum::Json;
use axum::extract::State;
use jtc_host::doctor::{Observation, Severity, findings};
use jtc_host::{Session, labels};
use jtc_wire::{JOINTS, Joint, STATUS_LEN, Status, error};
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;

/// Time for which the agent receives statuses: the duration of 50 statuses.
const LISTEN: Duration = Duration::from_secs(2);

/// Result of a diagnosis.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct DoctorObject {
    /// `true` if no finding is a problem.
    pub healthy: bool,
    /// Listening time, s.
    pub listened_s: f64,
    /// Number of statuses received during the listening time.
    pub statuses: u64,
    /// Findings, worst first.
    pub findings: Vec<FindingObject>,
}

/// Diagnoses link, joint bus and set-up.
///
/// The diagnosis takes two seconds and changes nothing. For the link, it evaluates all bytes that the controller
/// sends in this time. The agent does not try other bit rates, because the serial line is in use.
#[utoipa::path(
    get,
    path = "/api/doctor",
    operation_id = "examine",
    responses((status = 200, description = "Findings of the diagnosis", body = DoctorObject), Refusals, Denials)
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
    // Held stops and encoder jumps are possible only while joints have torque, so the agent requests the reactions
    // only in this case.
    let reactions = match &status {
        Some(status) if labels::has_torque(status) => agent.ask(|session| Ok(session.reactions())).await?,
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
    let findings = found.iter().map(FindingObject::from).collect();
    Ok(Json(DoctorObject { healthy, listened_s: time_s, statuses, findings }))
}

/// Returns the joints that the user has declared absent. If the status shows an external joint error, requests the
/// list from the controller, because the status does not show an absent joint whose drive answers (J-53).
async fn absent(agent: &Agent, status: &Status) -> Result<Vec<Joint>, Problem> {
    if status.errors & error::EXTERNAL_JOINTS == 0 {
        return Ok(labels::absent(status));
    }
    let positions = agent.ask(|session| Ok(Session::absent(session).unwrap_or([None; JOINTS]))).await?;
    Ok(Joint::ALL.into_iter().filter(|joint| positions[joint.index()].is_some()).collect())
}
