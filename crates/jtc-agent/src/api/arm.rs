//! The arm of the controller as one thing: read as an arm file, and given whole.
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

/// The arm that the controller has in use.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ArmObject {
    /// Its name.
    pub name: String,
    /// Hash of all that decides how the arm moves.
    pub hash: String,
    /// As an arm file, TOML: what `jtc arm pull` writes.
    pub text: String,
}

/// An arm for the controller.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ArmRequest {
    /// The text of an arm file (TOML), or of a robot description (URDF) in which nothing but the arm moves.
    pub text: String,
    /// Keep it over a loss of power: the arm has no torque then, and the controller is in Init behind it.
    #[serde(default)]
    pub store: bool,
}

/// What the controller was given.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct GivenObject {
    /// So many settings have changed.
    pub settings: usize,
    /// The controller has the arm's name.
    pub named: bool,
    /// Friction, gains and model, as far as they were confirmed.
    pub parts: Vec<PartObject>,
    /// Hash of the arm, where all of it was read back and nothing differs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// Its number in the memory that lasts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stored_number: Option<u32>,
}

/// A part that the controller confirmed.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct PartObject {
    /// Which.
    pub parameter: String,
    /// Bytes of its frame.
    pub bytes: usize,
    /// How often it was sent on purpose: a friction table twice.
    pub times: u32,
    /// s.
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

/// A hash as it is written everywhere.
pub(super) fn in_words(hash: u64) -> String {
    format!("{hash:016x}")
}

/// The arm that the controller has in use, as a file.
#[utoipa::path(
    get,
    path = "/api/arm",
    operation_id = "get_arm",
    responses((status = 200, description = "As it was read from the controller", body = ArmObject), Refusals, Denials)
)]
pub(super) async fn arm(State(agent): State<Agent>) -> Result<Json<ArmObject>, Problem> {
    let arm = agent.ask(Session::device_arm).await?;
    let hash = arm.hash().ok().flatten().unwrap_or_default();
    Ok(Json(ArmObject { name: arm.name.clone(), hash: in_words(hash), text: arm.to_toml() }))
}

/// Gives the controller a whole arm: a job. Its settings, name, friction, gains and model are sent, read back and compared.
///
/// Where settings differ the controller has to be in Init or Error (`POST /api/disable`); in Init it holds the arm as soon as it has all of it, and
/// stays in Init where the arm is stored. What a controller would not take of it is refused before anything is sent.
#[utoipa::path(
    put,
    path = "/api/arm",
    operation_id = "put_arm",
    params(LeaseKey, KnownHalt),
    request_body = ArmRequest,
    responses((status = 202, description = "The job that does it", body = JobObject), Refusals, Denials)
)]
pub(super) async fn put_arm(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    request: Request,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // Nobody else's text is read.
    agent.commander(&asker)?;
    let (arm, store) = read(&agent, request, |ArmRequest { text, store }| Ok((taken(&text)?, store))).await?;
    let (commander, turn) = agent.mover(&asker, after)?;
    let what = format!("arm {}{}", plain(&arm.name), if store { ", stored" } else { "" });
    let hash = arm.hash().ok().flatten().map(in_words);
    let give = move |task: &Task<'_>, session: &mut Session<ClientPort>| give(task, session, &arm, store);
    let job = agent.jobs.begin(&commander, turn, what.clone(), give)?;
    agent.note("job", json!({ "client": commander.client.0, "job": job.number, "what": what, "hash": hash }));
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}

/// An arm that a controller takes.
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
            next!("{} lists all of it", ArmCheck)
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
