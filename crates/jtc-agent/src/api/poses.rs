//! Named poses: those of the agent's arm file, and those that were saved through it.
use agent_kit::api::{Number, Problem, Refusals};
use agent_kit::gate::plain;
use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use jtc_host::arm::{PoseError, Poses, is_pose_name};
use jtc_host::error::Facts;
use jtc_host::{Arm, ErrorKind, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::body::{Perhaps, blocking};
use super::error::Denials;
use super::{Agent, Caller};

/// Where a pose is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, ToSchema)]
pub enum PoseFrom {
    /// In the arm file that the agent was given: it is changed there.
    #[serde(rename = "arm file")]
    ArmFile,
    /// By the agent.
    #[serde(rename = "agent")]
    Agent,
}

/// A named pose.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct PoseObject {
    /// Its name.
    pub name: String,
    /// Where the joints are, from the base, rad.
    #[schema(min_items = 6, max_items = 6)]
    pub positions_rad: [f64; 6],
    /// Where it is kept.
    pub from: PoseFrom,
    /// Why no motion leads there, in words; missing where one may.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// Where a pose is.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseRequest {
    /// rad, from the base; missing: where the arm stands now.
    #[serde(default)]
    #[schema(min_items = 6, max_items = 6)]
    pub positions_rad: Option<[f64; 6]>,
}

impl Agent {
    /// All poses that have a name, rad. One of the arm file stands before one of the same name that was saved.
    pub(super) fn poses(&self) -> Poses {
        let mut poses = self.jobs.store.poses.list();
        poses.extend(self.jobs.arm().poses.clone());
        poses
    }

    /// A pose as it is shown: with what the limits of the arm in use have to do with it.
    fn shown(&self, arm: &Arm, name: String, positions_rad: [f64; 6]) -> PoseObject {
        let from =
            if self.jobs.arm().poses.contains_key(&name) { PoseFrom::ArmFile } else { PoseFrom::Agent };
        let warning = arm.at_pose(&name, &positions_rad).err().map(|error| error.to_string());
        PoseObject { name, positions_rad, from, warning }
    }

    /// Nobody changes the arm file from here.
    fn of_agent(&self, name: &str) -> Result<(), Problem> {
        if !is_pose_name(name) {
            return Err(pose_error(&PoseError::Name { name: plain(name) }));
        }
        if self.jobs.arm().poses.contains_key(name) {
            let message =
                format!("pose \"{name}\" stands in the arm file of the agent, and is not changed from here");
            let next = "choose another name, or change the file and begin the agent anew";
            return Err(Problem::new("read-only", message, next));
        }
        Ok(())
    }
}

/// Why a pose is none, or leads nowhere.
pub(super) fn pose_error(error: &PoseError) -> Problem {
    let object = Problem::of(error);
    match error {
        PoseError::Unknown { .. } => {
            object.next("GET /api/poses lists them; PUT /api/poses/{name} saves where the arm stands")
        }
        _ => object,
    }
}

/// All named poses.
#[utoipa::path(
    get,
    path = "/api/poses",
    operation_id = "list_poses",
    responses((status = 200, description = "By name", body = Vec<PoseObject>), Refusals)
)]
pub(super) async fn list(State(agent): State<Agent>) -> Json<Vec<PoseObject>> {
    let arm = agent.identity().await.arm;
    Json(agent.poses().into_iter().map(|(name, position)| agent.shown(&arm, name, position)).collect())
}

/// Saves a pose, in place of what was saved under this name.
#[utoipa::path(
    put,
    path = "/api/poses/{name}",
    operation_id = "put_pose",
    params(("name" = String, Path, description = "A letter, then letters, digits, _, - and ., 64 at most")),
    request_body = Option<PoseRequest>,
    responses((status = 200, description = "The pose, to a millionth of a radian", body = PoseObject), Refusals, Denials)
)]
pub(super) async fn put(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(name): Number<String>,
    Perhaps(request): Perhaps<PoseRequest>,
) -> Result<Json<PoseObject>, Problem> {
    // Only operators change where others may move.
    caller.operator()?;
    let saved = save(&agent, &name, request.unwrap_or_default()).await;
    let why = saved.as_ref().err().map(|error| error.message.clone());
    agent.note("pose", json!({ "name": plain(&name), "from": caller.peer.to_string(), "why_not": why }));
    let position = saved?;
    let arm = agent.identity().await.arm;
    Ok(Json(agent.shown(&arm, name, position)))
}

async fn save(agent: &Agent, name: &str, request: PoseRequest) -> Result<[f64; 6], Problem> {
    agent.of_agent(name)?;
    let position = match request.positions_rad {
        Some(position) => position,
        None => agent.ask(Session::standing).await?.positions(),
    };
    if let Some(joint) = jtc_wire::Joint::ALL
        .into_iter()
        .find(|joint| !(-FARTHEST..=FARTHEST).contains(&position[joint.index()]))
    {
        let value = position[joint.index()];
        let facts = Facts::beyond(value, FARTHEST).at_joint(joint.number());
        let error = Problem::new("pose", format!("{joint}: {value} rad is nowhere"), "positions are in rad");
        return Err(error.kind(ErrorKind::Usage).with(facts));
    }
    let (jobs, name) = (agent.jobs.clone(), name.to_owned());
    let kept = blocking(move || jobs.store.poses.put(&name, &position)).await?;
    kept.map_err(|error| Problem::of(&error))
}

/// No joint turns further, rad.
const FARTHEST: f64 = 100.0;

/// Keeps a pose no more that was saved.
#[utoipa::path(
    delete,
    path = "/api/poses/{name}",
    operation_id = "delete_pose",
    params(("name" = String, Path, description = "Its name")),
    responses(
        (status = 204, description = "It is gone"),
        (status = 404, description = "There is none", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn delete(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(name): Number<String>,
) -> Result<StatusCode, Problem> {
    caller.operator()?;
    agent.of_agent(&name)?;
    let (jobs, own) = (agent.jobs.clone(), name.clone());
    let gone = blocking(move || jobs.store.poses.delete(&own)).await?;
    if !gone.map_err(|error| Problem::of(&error))? {
        return Err(Problem::nothing("pose", plain(&name), "/api/poses"));
    }
    agent.note("pose", json!({ "name": plain(&name), "deleted": true, "from": caller.peer.to_string() }));
    Ok(StatusCode::NO_CONTENT)
}
