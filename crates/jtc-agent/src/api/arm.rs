//! Requests about the complete arm of the controller: geometry, limits and parameters. The API returns the arm as an arm
//! file, and accepts only a complete arm.
use agent_kit::api::{Problem, Refusals};
use agent_kit::gate::{Asker, plain};
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use host_kit::{Severity, next};
use jtc_host::arm::ArmFinding;
use jtc_host::error::Facts;
use jtc_host::{Arm, ErrorKind, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::Agent;
use super::body::read;
use super::error::Denials;
use super::runs::JobObject;
use crate::jobs::{Given, Task, give};
use crate::owner::ClientPort;

/// Arm that the controller uses.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ArmObject {
    /// Name of the arm.
    pub name: String,
    /// Hash of all parameters that determine how the arm moves.
    pub hash: String,
    /// Arm file in TOML, as `jtc arm pull` writes it.
    pub text: String,
}

/// Arm to send to the controller.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ArmRequest {
    /// Text of an arm file (TOML), or of a robot description (URDF) in which only the arm has movable joints.
    pub text: String,
    /// `true`: store the arm in non-volatile memory. While the controller stores the arm, the arm has no torque.
    /// Afterwards, the controller stays in Init.
    #[serde(default)]
    pub store: bool,
}

/// Parameters that were sent to the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct GivenObject {
    /// Number of settings that have changed.
    pub settings: usize,
    /// `true` if the controller has confirmed the name of the arm.
    pub named: bool,
    /// Friction, gains and model, as far as the controller confirmed them.
    pub parts: Vec<PartObject>,
    /// Hash of the arm, if all parameters were read back without a difference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// Number of the arm in the non-volatile memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stored_number: Option<u32>,
}

/// Parameter frame that the controller confirmed.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct PartObject {
    /// Name of the parameter.
    pub parameter: String,
    /// Length of its frame, bytes.
    pub bytes: usize,
    /// Number of times that the frame must be sent: 2 for a friction table, otherwise 1.
    pub times: u32,
    /// Duration, s.
    pub time_s: f64,
}

impl From<Given> for GivenObject {
    fn from(Given { settings, named, parts, hash, stored }: Given) -> Self {
        let parts = parts.into_iter().map(|part| PartObject {
            parameter: part.parameter.name().to_owned(),
            bytes: part.bytes,
            times: part.times,
            time_s: part.time_s,
        });
        Self { settings, named, parts: parts.collect(), hash: hash.map(in_words), stored_number: stored }
    }
}

/// Returns the hash of an arm as text.
pub(super) fn in_words(hash: u64) -> String {
    format!("{hash:016x}")
}

/// Returns the arm that the controller uses, as a file.
#[utoipa::path(
    get,
    path = "/api/arm",
    operation_id = "get_arm",
    responses((status = 200, description = "Arm as read from the controller", body = ArmObject), Refusals, Denials)
)]
pub(super) async fn arm(State(agent): State<Agent>) -> Result<Json<ArmObject>, Problem> {
    let arm = agent.ask(Session::device_arm).await?;
    let hash = arm.hash().ok().flatten().unwrap_or_default();
    Ok(Json(ArmObject { name: arm.name.clone(), hash: in_words(hash), text: arm.to_toml() }))
}

/// Sends a complete arm to the controller, as a job.
///
/// The agent sends settings, name, friction, gains and model, reads them back and compares them. If settings differ, the
/// controller must be in Init or Error (`POST /api/disable`). In Init, the controller starts the position hold as soon as
/// it has the complete arm. With `store`, the controller stays in Init instead. If the arm has values that a controller
/// would refuse, the agent refuses the arm and sends nothing.
#[utoipa::path(
    put,
    path = "/api/arm",
    operation_id = "put_arm",
    params(LeaseKey, KnownHalt),
    request_body = ArmRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn put_arm(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    request: Request,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // The agent reads the request body only if the client holds the lease.
    agent.http_session(&asker)?;
    let (arm, store) = read(&agent, request, |ArmRequest { text, store }| Ok((taken(&text)?, store))).await?;
    let (http_session, turn) = agent.mover(&asker, after)?;
    let what = format!("arm {}{}", plain(&arm.name), if store { ", stored" } else { "" });
    let hash = arm.hash().ok().flatten().map(in_words);
    let give = move |task: &Task<'_>, session: &mut Session<ClientPort>| give(task, session, &arm, store);
    let job = agent.jobs.begin(&http_session, turn, what.clone(), give)?;
    agent.note(
        "job",
        json!({ "client": http_session.client.0, "job": job.number, "what": what, "hash": hash }),
    );
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}

/// Parses an arm from a text. Returns an error if a controller would not accept the arm.
pub(super) fn taken(text: &str) -> Result<Arm, Problem> {
    let arm = Arm::parse(text).map_err(|error| {
        let error = error.in_file("text".as_ref());
        Problem::of(&error)
    })?;
    let checked = arm.check();
    let worst = checked.findings.iter().find(|found| found.finding.severity == Severity::Problem);
    if let Some(ArmFinding { finding, joint, value, limit, .. }) = worst {
        let why = if finding.why.is_empty() { String::new() } else { format!(": {}", finding.why) };
        let next = if finding.next.is_empty() {
            next!("read all findings with {}", ArmCheck)
        } else {
            finding.next.clone()
        };
        let message = format!("{}{why}; nothing was sent", finding.what);
        let facts = Facts {
            joint: joint.map(|joint| joint.number()),
            value: *value,
            limit: *limit,
            ..Facts::default()
        };
        let object = Problem::new("arm", message, next);
        return Err(object.kind(ErrorKind::Usage).with(facts));
    }
    Ok(arm)
}
