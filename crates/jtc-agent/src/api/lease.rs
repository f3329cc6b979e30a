//! Lease of clients without a permanent connection. Each request of the lease holder renews the lease.
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
use crate::jobs::{HttpSession, Turn, Unable};
use crate::line::{Denied, Introduction, Policy};

/// Request for the lease.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct LeaseRequest {
    /// Name of the client for users. The agent uses the first 64 characters.
    pub name: String,
    /// Time without a request of this client after which the lease lapses, s.
    #[serde(default = "default_lasts_s")]
    #[schema(minimum = 1, maximum = 60)]
    pub lasts_s: f64,
    /// Policy for a motion after the lease has lapsed.
    #[serde(default)]
    pub policy: Policy,
    /// `true`: if another client holds the lease, ask that client for the lease, and wait. Only one client can wait at a
    /// time. The waiting client must repeat `PUT /api/lease` within `lasts_s`.
    #[serde(default)]
    pub ask: bool,
}

/// Client that holds the lease or waits for it.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct LeaseGrant {
    /// Secret key, which this client sends with each request in the header `Lease-Key`.
    pub key: String,
    /// `true` if the client holds the lease; `false` if it waits until the lease holder releases the lease.
    pub held: bool,
    /// Time without a request after which the lease lapses, s.
    pub lasts_s: f64,
    /// Policy for a motion after the lease has lapsed.
    pub policy: Policy,
}

impl Halts for Agent {
    fn last_halt(&self) -> u64 {
        self.line.with(|line, _| line.last_halt())
    }
}

impl Agent {
    /// Returns the client that uses a lease key. Renews the client's lease, or takes the lease for the client if it
    /// is free. Returns an error if another client holds the lease.
    pub(super) fn http_session(&self, asker: &Asker) -> Result<Arc<HttpSession>, Problem> {
        let (http_session, lasts) = self.client(asker)?;
        let held = self.line.with(|line, now| line.take_lease(http_session.client, Some(lasts), now));
        held.map_err(Problem::from)?;
        Ok(http_session)
    }

    /// Like [`http_session`](Self::http_session), for requests that may move the arm. Refuses a request that the
    /// client made before the last Stop or Pause. Also refuses all requests within three seconds after a Stop or
    /// Pause of another client. Reserves the client's session before it permits the motion, so a request that is
    /// refused because the session is busy never gets the permission.
    pub(super) fn mover(
        &self,
        asker: &Asker,
        AskedAfter(after): AskedAfter,
    ) -> Result<(Arc<HttpSession>, Turn), Problem> {
        let http_session = self.http_session(asker)?;
        let turn = http_session.turn()?;
        self.line.with(|line, now| line.ask_to_move(http_session.client, after, now))?;
        Ok((http_session, turn))
    }

    /// Returns the client that uses a lease key. Also returns the time without a request after which the client's lease
    /// lapses.
    pub(super) fn client(&self, asker: &Asker) -> Result<(Arc<HttpSession>, Duration), Problem> {
        asker.caller.operator()?;
        let key = asker.key().ok_or(lease::Denied::NoKey)?;
        Ok(self.jobs.http_session(key).ok_or(lease::Denied::Unknown)?)
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
    let introduction = Introduction { name: name.clone(), role: caller.role, policy };
    let http_session = agent.jobs.admit(&key, introduction, lasts).ok_or(lease::Denied::Full)?;
    let client = http_session.client;
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
    let (http_session, lasts) = agent.client(&asker)?;
    let state = agent.line.with(|line, now| {
        let held = line.take_lease(http_session.client, Some(lasts), now).is_ok();
        let wanted = line.lease().filter(|_| held).and_then(|lease| lease.wanted_by);
        LeaseState {
            held,
            wanted_by: wanted.and_then(|client| line.introduction(client)).map(|c| c.name.clone()),
        }
    });
    Ok(Json(state))
}

/// Releases the lease; a client that waits for the lease receives it.
///
/// The agent refuses the request while a job of this client runs.
#[utoipa::path(
    delete,
    path = "/api/lease",
    operation_id = "release_lease",
    params(LeaseKey),
    responses((status = 204, description = "The client has released the lease"), Refusals, Denials)
)]
pub(super) async fn release(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    let (http_session, _) = agent.client(&asker)?;
    let turn = match http_session.turn() {
        Ok(turn) => Some(turn),
        // The client's thread has ended, so the client has no running job.
        Err(Unable::Gone) => None,
        Err(busy) => return Err(busy.into()),
    };
    // If the client does not hold the lease but only waits for it, this call has no effect.
    let _ = agent.line.with(|line, now| line.release_lease(http_session.client, now));
    agent.line.wake();
    agent.note("left", json!({ "client": http_session.client.0, "name": http_session.name }));
    if let Some(key) = asker.key() {
        agent.jobs.dismiss(key);
    }
    drop(turn);
    Ok(StatusCode::NO_CONTENT)
}
