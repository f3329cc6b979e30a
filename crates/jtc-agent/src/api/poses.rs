//! Named poses: the poses of the agent's arm file, and the poses that clients have saved through the agent.
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

/// Place where a pose is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, ToSchema)]
pub(super) enum PoseFrom {
    /// Arm file of the agent; change the pose there.
    #[serde(rename = "arm file")]
    ArmFile,
    /// Store of the agent.
    #[serde(rename = "agent")]
    Agent,
}

/// Named pose.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct PoseObject {
    /// Name of the pose.
    pub name: String,
    /// Joint positions, from the base, rad.
    #[schema(min_items = 6, max_items = 6)]
    pub positions_rad: [f64; 6],
    /// Place where the pose is kept.
    pub from: PoseFrom,
    /// Reason why the arm cannot move to the pose, in words; missing if a motion is possible.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// Position of a pose.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseRequest {
    /// Joint positions, rad, from the base; missing: the current position of the arm.
    #[serde(default)]
    #[schema(min_items = 6, max_items = 6)]
    pub positions_rad: Option<[f64; 6]>,
}

impl Agent {
    /// Returns all named poses, rad. A pose of the arm file takes precedence over a saved pose of the same name.
    pub(super) fn poses(&self) -> Poses {
        let mut poses = self.jobs.store.poses.list();
        poses.extend(self.jobs.arm().poses.clone());
        poses
    }

    /// Returns a pose for display. Adds the limits of the controller's arm that the pose violates.
    fn shown(&self, arm: &Arm, name: String, positions_rad: [f64; 6]) -> PoseObject {
        let from =
            if self.jobs.arm().poses.contains_key(&name) { PoseFrom::ArmFile } else { PoseFrom::Agent };
        let warning = arm.at_pose(&name, &positions_rad).err().map(|error| error.to_string());
        PoseObject { name, positions_rad, from, warning }
    }

    /// Returns an error if the pose belongs to the arm file, because such a pose cannot be changed through the
    /// API.
    fn of_agent(&self, name: &str) -> Result<(), Problem> {
        if !is_pose_name(name) {
            return Err(pose_error(&PoseError::Name { name: plain(name) }));
        }
        if self.jobs.arm().poses.contains_key(name) {
            let message = format!(
                "pose \"{name}\" belongs to the arm file of the agent and cannot be changed by a request"
            );
            let next = "choose another name, or edit the file and restart the agent";
            return Err(Problem::new("read-only", message, next));
        }
        Ok(())
    }
}

/// Returns the problem that the API reports for an invalid pose.
pub(super) fn pose_error(error: &PoseError) -> Problem {
    let object = Problem::of(error);
    match error {
        PoseError::Unknown { .. } => object
            .next("list the poses with GET /api/poses; save the present pose with PUT /api/poses/{name}"),
        _ => object,
    }
}

/// Returns all named poses.
#[utoipa::path(
    get,
    path = "/api/poses",
    operation_id = "list_poses",
    responses((status = 200, description = "Named poses, ordered by name", body = Vec<PoseObject>), Refusals)
)]
pub(super) async fn list(State(agent): State<Agent>) -> Json<Vec<PoseObject>> {
    let arm = agent.identity().await.arm;
    Json(agent.poses().into_iter().map(|(name, position)| agent.shown(&arm, name, position)).collect())
}

/// Saves a pose and replaces a saved pose of this name.
#[utoipa::path(
    put,
    path = "/api/poses/{name}",
    operation_id = "put_pose",
    params(("name" = String, Path, description = "Name of the pose: a letter, then letters, digits and the characters _ - . (64 characters at most)")),
    request_body = Option<PoseRequest>,
    responses((status = 200, description = "Saved pose, rounded to a millionth of a radian", body = PoseObject), Refusals, Denials)
)]
pub(super) async fn put(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(name): Number<String>,
    Perhaps(request): Perhaps<PoseRequest>,
) -> Result<Json<PoseObject>, Problem> {
    // Only operators may change poses, because other clients use these poses as targets.
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
        let error = Problem::new(
            "pose",
            format!("{joint}: {value} rad is out of range (±{FARTHEST} rad)"),
            "give the positions in rad",
        );
        return Err(error.kind(ErrorKind::Usage).with(facts));
    }
    let (jobs, name) = (agent.jobs.clone(), name.to_owned());
    let kept = blocking(move || jobs.store.poses.put(&name, &position)).await?;
    kept.map_err(|error| Problem::of(&error))
}

/// Largest joint position, rad.
const FARTHEST: f64 = 100.0;

/// Deletes a saved pose.
#[utoipa::path(
    delete,
    path = "/api/poses/{name}",
    operation_id = "delete_pose",
    params(("name" = String, Path, description = "Name of the pose")),
    responses(
        (status = 204, description = "The pose is deleted"),
        (status = 404, description = "No saved pose has this name", body = Problem),
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
