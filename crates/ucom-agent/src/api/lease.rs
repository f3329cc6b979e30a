//! The lease: who commands shows by each request that it is there.
use agent_kit::access::random;
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::{Asker, Caller};
use agent_kit::halt::Halts;
use agent_kit::lease::{Client, LeaseKey, LeaseState, default_lasts_s, lasts};
use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
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
    #[serde(default = "default_lasts_s")]
    #[schema(minimum = 1, maximum = 60)]
    lasts_s: f64,
    /// What becomes of running boards when it has lapsed.
    #[serde(default)]
    policy: Policy,
    /// Where another client commands: ask it for the lease, and wait for it.
    #[serde(default)]
    ask: bool,
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

impl Halts for Agent {
    fn last_halt(&self) -> u64 {
        self.shared.halts()
    }
}

impl Agent {
    /// The client that asks with a key.
    pub(super) fn client(&self, asker: &Asker) -> Result<Client<Policy>, Problem> {
        let (mut leases, now) = self.shared.leases();
        Ok(leases.client(asker.key(), now)?)
    }

    /// The client that asks, with its lease renewed: it commands, or it is an error.
    pub(super) fn commander(&self, asker: &Asker) -> Result<Client<Policy>, Problem> {
        asker.caller.operator()?;
        let (mut leases, now) = self.shared.leases();
        Ok(leases.command(asker.key(), now)?)
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
    let lasts = lasts(lasts_s)?;
    let name = caller.named(&name);
    let key = random().map_err(|e| Problem::of(&e))?;
    let terms = (name.as_str(), lasts, policy);
    let (client, held) = {
        let (mut leases, now) = agent.shared.leases();
        leases.admit(&key, terms, ask, now)?
    };
    let from = caller.peer.to_string();
    agent.gate.note("joined", json!({ "client": client, "name": name, "held": held, "from": from }));
    Ok(Json(LeaseGrant { key, held, lasts_s, policy }))
}

/// Renews the lease, or takes it again where nobody else has.
#[utoipa::path(
    put,
    path = "/api/lease",
    operation_id = "renew_lease",
    params(LeaseKey),
    responses(
        (status = 200, description = "Whether this client commands", body = LeaseState),
        Refusals, Denials
    )
)]
pub(super) async fn renew(State(agent): State<Agent>, asker: Asker) -> Result<Json<LeaseState>, Problem> {
    asker.caller.operator()?;
    agent.client(&asker)?;
    let (mut leases, now) = agent.shared.leases();
    let held = leases.command(asker.key(), now).is_ok();
    let wanted_by = leases.lease().filter(|_| held).and_then(|lease| lease.wanted_by);
    Ok(Json(LeaseState { held, wanted_by }))
}

/// Lets the lease go: to the client that has asked for it, if one has. What runs goes on. Refused while something goes on or waits for
/// this client that may move boards.
#[utoipa::path(
    delete,
    path = "/api/lease",
    operation_id = "release_lease",
    params(LeaseKey),
    responses((status = 204, description = "It is let go"), Refusals, Denials)
)]
pub(super) async fn release(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    asker.caller.operator()?;
    let client = agent.client(&asker)?;
    {
        let (mut leases, now) = agent.shared.leases();
        // Outputs would be enabled later, for nobody.
        if leases.holds(client.id, now) && agent.shared.moves_for(client.id) {
            return Err(Problem::new(
                "busy",
                "something goes on for this client that may move boards: nobody would command them",
                "wait until it is over, or cancel it with DELETE /api/jobs/NUMBER",
            ));
        }
        leases.release(asker.key().unwrap_or_default(), now);
    }
    agent.gate.note("left", json!({ "client": client.id, "name": client.name }));
    Ok(StatusCode::NO_CONTENT)
}
