//! The lease: who commands shows by each request that it is there.
use std::sync::{MutexGuard, PoisonError};
use std::time::Duration;

use agent_kit::access::random;
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Caller;
use agent_kit::lease::{Client, LASTS_S, Leases, key_of};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::{Extension, Json};
use host_kit::ErrorKind;
use serde_json::json;
use utoipa::ToSchema;

use super::{Agent, Denials};
use crate::happening::Policy;

/// Who wants to command.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// What people are to call it: the first 64 characters.
    name: String,
    /// How long the lease lasts without a request of this client, s.
    #[serde(default = "ten")]
    #[schema(minimum = 1, maximum = 3600)]
    lasts_s: f64,
    /// What becomes of running boards when it has lapsed.
    #[serde(default)]
    policy: Policy,
    /// Where another client commands: ask it for the lease, and wait for it.
    #[serde(default)]
    ask: bool,
}

fn ten() -> f64 {
    10.0
}

/// A client that may command, or waits for it.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseGrant {
    /// Goes with each request of this client, in the header `Lease-Key`. Nobody else is to know it.
    key: String,
    /// It commands; else it waits until the one who does lets it go.
    held: bool,
    /// How long it lasts without a request, s.
    lasts_s: f64,
    /// What becomes of running boards when it has lapsed.
    policy: Policy,
}

/// How a lease is.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseState {
    /// This client commands.
    held: bool,
    /// Who asks for the lease.
    #[serde(skip_serializing_if = "Option::is_none")]
    wanted_by: Option<String>,
}

impl Agent {
    fn leases(&self) -> MutexGuard<'_, Leases<Policy>> {
        // What one that has lapsed leaves behind comes first.
        self.shared.look_at_lease();
        self.shared.leases.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The client that asks with a key.
    pub(super) fn client(&self, headers: &HeaderMap) -> Result<Client<Policy>, Problem> {
        Ok(self.leases().client(key_of(headers), self.shared.now())?)
    }

    /// The client that asks, with its lease renewed: it commands, or it is an error.
    pub(super) fn commander(&self, caller: &Caller, headers: &HeaderMap) -> Result<Client<Policy>, Problem> {
        caller.operator()?;
        Ok(self.leases().command(key_of(headers), self.shared.now())?)
    }
}

/// Takes the lease: one client commands at a time. It is renewed by every command.
#[utoipa::path(
    post,
    path = "/api/lease",
    operation_id = "take_lease",
    request_body = LeaseRequest,
    responses(
        (status = 200, description = "This client commands, or waits for it", body = LeaseGrant),
        Refusals, Denials
    )
)]
pub(super) async fn take(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Body(request): Body<LeaseRequest>,
) -> Result<Json<LeaseGrant>, Problem> {
    caller.operator()?;
    let LeaseRequest { name, lasts_s, policy, ask } = request;
    if !LASTS_S.contains(&lasts_s) {
        let message = format!("lasts_s is {lasts_s}: 1 to 3600 s are possible");
        return Err(Problem::new("lease", message, "choose how long it may last without a request")
            .kind(ErrorKind::Usage));
    }
    let name = caller.named(&name);
    let key = random().map_err(|e| Problem::diagnosed(&e))?;
    let terms = (name.as_str(), Duration::from_secs_f64(lasts_s), policy);
    let (client, held) = agent.leases().admit(&key, terms, ask, agent.shared.now())?;
    let from = caller.peer.to_string();
    agent.gate.note("joined", json!({ "client": client, "name": name, "held": held, "from": from }));
    Ok(Json(LeaseGrant { key, held, lasts_s, policy }))
}

/// Renews the lease, or takes it again where nobody else has.
#[utoipa::path(
    put,
    path = "/api/lease",
    operation_id = "renew_lease",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    responses(
        (status = 200, description = "Whether this client commands", body = LeaseState),
        Refusals, Denials
    )
)]
pub(super) async fn renew(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<Json<LeaseState>, Problem> {
    caller.operator()?;
    agent.client(&headers)?;
    let mut leases = agent.leases();
    let held = leases.command(key_of(&headers), agent.shared.now()).is_ok();
    let wanted_by = leases.lease().filter(|_| held).and_then(|lease| lease.wanted_by);
    Ok(Json(LeaseState { held, wanted_by }))
}

/// Lets the lease go: to the client that has asked for it, if one has. What runs goes on.
#[utoipa::path(
    delete,
    path = "/api/lease",
    operation_id = "release_lease",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    responses((status = 204, description = "It is let go"), Refusals, Denials)
)]
pub(super) async fn release(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<StatusCode, Problem> {
    caller.operator()?;
    let client = agent.client(&headers)?;
    agent.leases().release(key_of(&headers).unwrap_or_default(), agent.shared.now());
    agent.gate.note("left", json!({ "client": client.id, "name": client.name }));
    Ok(StatusCode::NO_CONTENT)
}
