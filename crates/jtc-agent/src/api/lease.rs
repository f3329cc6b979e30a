//! The lease of clients that have no connection of their own: who commands shows by each request that it is there.
use std::sync::Arc;
use std::time::Duration;

use agent_kit::access::random;
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, Halts};
use agent_kit::lease::{self, LeaseKey, LeaseState, default_lasts_s, lasts};
use axum::extract::State;
use axum::http::StatusCode;
use axum::{Extension, Json};
use serde_json::json;
use utoipa::ToSchema;

use super::error::Denials;
use super::{Agent, Caller};
use crate::jobs::{Commander, Turn, Unable};
use crate::line::{Denied, Introduction, Policy};

/// Who wants to command.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LeaseRequest {
    /// What people are to call it: the first 64 characters.
    pub name: String,
    /// How long the lease lasts without a request of this client, s.
    #[serde(default = "default_lasts_s")]
    #[schema(minimum = 1, maximum = 60)]
    pub lasts_s: f64,
    /// What becomes of a motion when it has lapsed.
    #[serde(default)]
    pub policy: Policy,
    /// Where another client commands: ask it for the lease, and wait for it. One waits at a time, which shows by PUT that it is there.
    #[serde(default)]
    pub ask: bool,
}

/// A client that may command, or waits for it.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseGrant {
    /// Goes with each request of this client, in the header `Lease-Key`. Nobody else is to know it.
    pub key: String,
    /// It commands; else it waits until the one who does lets it go.
    pub held: bool,
    /// How long it lasts without a request, s.
    pub lasts_s: f64,
    /// What becomes of a motion when it has lapsed.
    pub policy: Policy,
}

impl Halts for Agent {
    fn last_halt(&self) -> u64 {
        self.line.with(|line, _| line.last_halt())
    }
}

impl Agent {
    /// The client that asks with a key, with its lease renewed: it commands, or it is an error.
    pub(super) fn commander(&self, asker: &Asker) -> Result<Arc<Commander>, Problem> {
        let (commander, lasts) = self.client(asker)?;
        let held = self.line.with(|line, now| line.take_lease(commander.client, Some(lasts), now));
        held.map_err(Problem::from)?;
        Ok(commander)
    }

    /// The same, for what may move the arm: nothing that was asked for before this moves it any more where somebody has stopped it, and
    /// nothing at all for three seconds then. The turn is taken first: what still waits for its own is not let through by this.
    pub(super) fn mover(
        &self,
        asker: &Asker,
        AskedAfter(after): AskedAfter,
    ) -> Result<(Arc<Commander>, Turn), Problem> {
        let commander = self.commander(asker)?;
        let turn = commander.turn()?;
        self.line.with(|line, now| line.ask_to_move(commander.client, after, now))?;
        Ok((commander, turn))
    }

    /// The client that asks with a key, and how often it does at least.
    pub(super) fn client(&self, asker: &Asker) -> Result<(Arc<Commander>, Duration), Problem> {
        asker.caller.operator()?;
        let key = asker.key().ok_or(lease::Denied::NoKey)?;
        Ok(self.jobs.commander(key).ok_or(lease::Denied::Unknown)?)
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
    let introduction = Introduction { name: name.clone(), role: caller.role, policy };
    let commander = agent.jobs.admit(&key, introduction, lasts).ok_or(lease::Denied::Full)?;
    let client = commander.client;
    let taken = agent.line.with(|line, now| match line.take_lease(client, Some(lasts), now) {
        Err(Denied::Held { .. }) if ask => line.want_lease(client, now).map(|()| false),
        taken => taken.map(|()| true),
    });
    agent.line.wake();
    let held = taken.map_err(|denied| {
        agent.jobs.dismiss(&key);
        Problem::from(denied)
    })?;
    agent.note(
        "joined",
        json!({ "client": client.0, "name": name, "role": caller.role, "from": caller.peer.to_string() }),
    );
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
    let (commander, lasts) = agent.client(&asker)?;
    let state = agent.line.with(|line, now| {
        let held = line.take_lease(commander.client, Some(lasts), now).is_ok();
        let wanted = line.lease().filter(|_| held).and_then(|lease| lease.wanted_by);
        LeaseState {
            held,
            wanted_by: wanted.and_then(|client| line.introduction(client)).map(|c| c.name.clone()),
        }
    });
    Ok(Json(state))
}

/// Lets the lease go: to the client that has asked for it, if one has. Not while a job of this client goes on.
#[utoipa::path(
    delete,
    path = "/api/lease",
    operation_id = "release_lease",
    params(LeaseKey),
    responses((status = 204, description = "It is let go"), Refusals, Denials)
)]
pub(super) async fn release(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    let (commander, _) = agent.client(&asker)?;
    let turn = match commander.turn() {
        Ok(turn) => Some(turn),
        // Its thread is gone: it has nothing going on.
        Err(Unable::Gone) => None,
        Err(busy) => return Err(busy.into()),
    };
    // One that waits has none to give.
    let _ = agent.line.with(|line, now| line.release_lease(commander.client, now));
    agent.line.wake();
    agent.note("left", json!({ "client": commander.client.0, "name": commander.name }));
    if let Some(key) = asker.key() {
        agent.jobs.dismiss(key);
    }
    drop(turn);
    Ok(StatusCode::NO_CONTENT)
}
