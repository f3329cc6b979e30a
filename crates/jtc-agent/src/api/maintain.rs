//! Maintenance: clears and resets single nodes, and switches to the built-in arm.
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use jtc_host::error::Facts;
use jtc_host::{Error, ErrorKind, LinkError, Session, labels};
use jtc_wire::{ALL_NODES, Joint};
use utoipa::ToSchema;

use super::Agent;
use super::body::Perhaps;
use super::commands::SpeedObject;
use super::error::Denials;
use crate::owner::ClientPort;

/// Nodes whose errors are to be cleared.
#[derive(Clone, Debug, Default, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ClearRequest {
    /// Joints, 1 to 6 from the base.
    #[serde(default)]
    #[schema(max_items = 6)]
    pub joints: Vec<u8>,
    /// `true` for the gripper.
    #[serde(default)]
    pub gripper: bool,
}

/// Nodes to restart.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ResetRequest {
    /// Joints, 1 to 6 from the base.
    #[serde(default)]
    #[schema(max_items = 6)]
    pub joints: Vec<u8>,
    /// `true` for the gripper.
    #[serde(default)]
    pub gripper: bool,
    /// `true` for all joints and the gripper.
    #[serde(default)]
    pub all: bool,
    /// `true`: restart also under torque. Support the arm first: it may fall.
    #[serde(default)]
    pub arm_may_fall: bool,
}

/// Returns a bit mask of nodes: bits 0 to 5 for joints 1 to 6, and bit 6 for the gripper.
fn nodes(joints: &[u8], gripper: bool) -> Result<u8, Problem> {
    let mut mask = if gripper { 1 << labels::GRIPPER } else { 0 };
    for number in joints {
        let Some(joint) = Joint::from_number((*number).into()) else {
            let facts = Facts::beyond((*number).into(), 6.0);
            let message = format!("joint {number} does not exist; nothing was sent");
            let error = Problem::new("joint", message, "give joints as 1 to 6, from the base");
            return Err(error.kind(ErrorKind::Usage).with(facts));
        };
        mask |= 1 << joint.index();
    }
    Ok(mask)
}

/// Clears the errors of the controller and of all drives, or of selected nodes.
///
/// Without selected nodes, the agent also clears the list of occurred errors. With selected nodes, it clears only the
/// current errors of these nodes and of the controller itself.
#[utoipa::path(
    post,
    path = "/api/clear",
    operation_id = "clear",
    params(LeaseKey),
    request_body = Option<ClearRequest>,
    responses((status = 204, description = "The errors are cleared; an error whose cause is still present occurs again"), Refusals, Denials)
)]
pub(super) async fn clear(
    State(agent): State<Agent>,
    asker: Asker,
    Perhaps(request): Perhaps<ClearRequest>,
) -> Result<StatusCode, Problem> {
    let ClearRequest { joints, gripper } = request.unwrap_or_default();
    let named = nodes(&joints, gripper)?;
    if named == 0 {
        agent.command(&asker, "clear", Session::clear_all).await?;
        return Ok(StatusCode::NO_CONTENT);
    }
    let what = format!("clear {}", labels::node_names(named).join(", "));
    let clear =
        move |session: &mut Session<ClientPort>| -> Result<(), LinkError> { session.clear(true, named) };
    agent.command(&asker, what, clear).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Restarts nodes of the joint bus.
///
/// The agent and the controller refuse to restart joints while the arm moves.
#[utoipa::path(
    post,
    path = "/api/reset",
    operation_id = "reset",
    params(LeaseKey),
    request_body = ResetRequest,
    responses((status = 204, description = "The nodes restart, and the controller initialises them again"), Refusals, Denials)
)]
pub(super) async fn reset(
    State(agent): State<Agent>,
    asker: Asker,
    Body(request): Body<ResetRequest>,
) -> Result<StatusCode, Problem> {
    let ResetRequest { joints, gripper, all, arm_may_fall } = request;
    let named = nodes(&joints, gripper)? | if all { ALL_NODES } else { 0 };
    if named == 0 {
        let next = "list joints, or set gripper or all";
        return Err(
            Problem::new("request", "no node selected; nothing was sent", next).kind(ErrorKind::Usage)
        );
    }
    let what = format!("reset {}", labels::node_names(named).join(", "));
    let reset = move |session: &mut Session<ClientPort>| -> Result<(), Error> {
        session.reset_held(named, arm_may_fall)
    };
    agent.command(&asker, what, reset).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Makes the controller use its stored or built-in friction, gains and model.
///
/// In Init, the controller then starts the position hold.
#[utoipa::path(
    post,
    path = "/api/arm/defaults",
    operation_id = "use_default_arm",
    params(LeaseKey, KnownHalt),
    responses((status = 204, description = "The controller uses its default parameters"), Refusals, Denials)
)]
pub(super) async fn defaults(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
) -> Result<StatusCode, Problem> {
    agent.motion(&asker, after, "default arm", Session::use_defaults).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Returns the speed on the path that the controller uses.
#[utoipa::path(
    get,
    path = "/api/speed",
    operation_id = "get_speed",
    responses((status = 200, description = "Speed on the path; 100 also if the controller has no speed override", body = SpeedObject), Refusals, Denials)
)]
pub(super) async fn speed(State(agent): State<Agent>) -> Result<Json<SpeedObject>, Problem> {
    let speed = agent.ask(|session| Ok(session.speed()?)).await?;
    // The controller receives the speed in whole percent.
    Ok(Json(SpeedObject { percent: (speed * 100.0).round().clamp(0.0, 100.0) as u8 }))
}
