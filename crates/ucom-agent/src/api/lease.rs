//! Lease: each request of the lease holder shows that the holder still runs.
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
use crate::event::Policy;

/// Request for the lease.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LeaseRequest {
    /// Name of the client for users. The agent uses the first 64 characters.
    name: String,
    /// Time without a request of this client after which the lease lapses, s.
    #[serde(default = "default_lasts_s")]
    #[schema(minimum = 1, maximum = 60)]
    lasts_s: f64,
    /// Policy for running boards after the lease has lapsed.
    #[serde(default)]
    policy: Policy,
    /// `true`: if another client holds the lease, ask that client for the lease, and wait.
    #[serde(default)]
    ask: bool,
}

/// Client that holds the lease or waits for it.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct LeaseGrant {
    /// Secret key, which this client sends with each request in the header `Lease-Key`.
    key: String,
    /// `true` if the client holds the lease; `false` if it waits until the lease holder releases the lease.
    held: bool,
    /// Time without a request after which the lease lapses, s.
    lasts_s: f64,
    /// Policy for running boards after the lease has lapsed.
    policy: Policy,
}

impl Halts for Agent {
    fn last_halt(&self) -> u64 {
        self.shared.halts()
    }
}

impl Agent {
    /// Returns the client that has this lease key.
    pub(super) fn client(&self, asker: &Asker) -> Result<Client<Policy>, Problem> {
        let (mut leases, now) = self.shared.leases();
        Ok(leases.client(asker.key(), now)?)
    }

    /// Returns the client that has this lease key. Renews its lease, or takes the lease for this client if it is free.
    /// Returns an error if another client holds the lease.
    pub(super) fn commander(&self, asker: &Asker) -> Result<Client<Policy>, Problem> {
        asker.caller.operator()?;
        let (mut leases, now) = self.shared.leases();
        Ok(leases.command(asker.key(), now)?)
    }
}

/// Takes the lease.
///
/// Only one client holds the lease at a time. Every command renews the lease.
#[utoipa::path(
    post,
    path = "/api/lease",
    operation_id = "take_lease",
    request_body = LeaseRequest,
    responses(
        (status = 200, description = "The client holds the lease, or waits for it", body = LeaseGrant),
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

/// Renews the lease, or takes a free lease again.
#[utoipa::path(
    put,
    path = "/api/lease",
    operation_id = "renew_lease",
    params(LeaseKey),
    responses(
        (status = 200, description = "State of the lease", body = LeaseState),
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

/// Releases the lease; a client that waits for the lease receives it.
///
/// Running boards continue to run. The agent refuses the request while another request of this client that may move
/// boards is running or waiting.
#[utoipa::path(
    delete,
    path = "/api/lease",
    operation_id = "release_lease",
    params(LeaseKey),
    responses((status = 204, description = "The client has released the lease"), Refusals, Denials)
)]
pub(super) async fn release(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    asker.caller.operator()?;
    let client = agent.client(&asker)?;
    {
        let (mut leases, now) = agent.shared.leases();
        // If the client released the lease now, the agent could enable outputs later, when no client holds the lease.
        if leases.holds(client.id, now) && agent.shared.moves_for(client.id) {
            return Err(Problem::new(
                "busy",
                "a job of this client may still move boards, and without the lease no client could control \
                 them",
                "wait until the job has ended, or cancel it with DELETE /api/jobs/NUMBER",
            ));
        }
        leases.release(asker.key().unwrap_or_default(), now);
    }
    agent.gate.note("left", json!({ "client": client.id, "name": client.name }));
    Ok(StatusCode::NO_CONTENT)
}
