//! Queries to the controller, which any client may request.
use agent_kit::api::{Problem, Refusals};
use axum::Json;
use axum::extract::State;
use jtc_host::held_stop::Reacting;
use jtc_host::{Error, Session, labels};
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;
use super::held_stop::ReactionsObject;
use super::objects::PayloadObject;
use crate::owner::ClientPort;

/// Identity of the controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct InfoObject {
    /// Version of the protocol extensions. 0: the controller has no extensions, and all other values are unknown.
    pub extension: u8,
    /// Version of the firmware.
    pub firmware: String,
    /// Git revision of the firmware.
    pub revision: String,
    /// Board of the controller.
    pub board: String,
    /// Name of the arm in use.
    pub arm: String,
    /// Hash of all parameters that determine how the arm moves.
    pub hash: String,
    /// Parameters that the controller has not received.
    pub missing: Vec<String>,
    /// `true` if its defaults are the parameters of a stored arm, not of the built-in arm.
    pub defaults_stored: bool,
    /// Number of starts.
    pub boots: u32,
    /// Cause of the last start.
    pub boot_cause: String,
    /// Time since the last start, s.
    pub uptime_s: f64,
    /// Number of response records that were lost because too many records waited.
    pub lost_records: u32,
    /// Reactions to disturbances; missing if the controller does not report them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reactions: Option<ReactionsObject>,
}

impl Agent {
    /// Sends a query to the controller on behalf of a client.
    pub(super) async fn ask<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, Error> + Send + 'static,
    ) -> Result<T, Problem> {
        self.jobs.asker().call_in_turn(act).await?.map_err(|error| Problem::of(&error))
    }
}

/// Returns the identity of the controller.
#[utoipa::path(
    get,
    path = "/api/info",
    operation_id = "get_info",
    responses((status = 200, description = "Identity of the controller", body = InfoObject), Refusals, Denials)
)]
pub(super) async fn info(State(agent): State<Agent>) -> Result<Json<InfoObject>, Problem> {
    let info = agent.ask(|session| Ok(session.info()?)).await?.unwrap_or_default();
    Ok(Json(InfoObject {
        extension: info.version,
        firmware: info.firmware().to_owned(),
        revision: info.revision().to_owned(),
        board: info.board.as_str().to_owned(),
        arm: info.arm.as_str().to_owned(),
        hash: format!("{:016x}", info.hash),
        missing: labels::missing_parameters(info.missing).into_iter().map(str::to_owned).collect(),
        defaults_stored: info.defaults_stored,
        boots: info.boots,
        boot_cause: info.boot_cause.name().to_owned(),
        uptime_s: info.uptime_ms as f64 / 1000.0,
        lost_records: info.lost_records,
        reactions: Reacting::of(&info).map(ReactionsObject::from),
    }))
}

/// Returns the payload at the flange that the controller uses.
#[utoipa::path(
    get,
    path = "/api/payload",
    operation_id = "get_payload",
    responses((status = 200, description = "Payload at the flange; mass 0: no payload", body = PayloadObject), Refusals, Denials)
)]
pub(super) async fn payload(State(agent): State<Agent>) -> Result<Json<PayloadObject>, Problem> {
    Ok(Json(agent.ask(Session::payload).await?.into()))
}
