//! What happens, as it happens: events by number, and a stream of them with what the controller reports.
use std::time::Duration;

use agent_kit::api::{Asked, Refusals};
use agent_kit::journal::Excerpt;
use axum::Extension;
use axum::Json;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse as _, Response};
use tokio::time::{Instant, MissedTickBehavior};
use utoipa::{IntoParams, ToSchema};

use super::{Agent, Caller, ErrorObject, StatusObject};
use crate::jobs::{EventObject, Happening};
use crate::line::Role;

/// Longest that a request waits for an event, s.
const WAIT_MAX_S: f64 = 8.0;
/// Events in one answer.
const EVENTS_MAX: usize = 500;
/// How often the controller is reported on a stream, at most.
const PERIOD: Duration = Duration::from_millis(40);
/// And at least.
const QUIET: Duration = Duration::from_millis(500);
/// Pings of a client between two messages to it.
const NOISE_MAX: u32 = 100;
/// How long a client may leave a message untaken.
const SEND_TIME: Duration = Duration::from_secs(5);

/// Which events.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct EventsRequest {
    /// Those behind this number; 0: from the beginning.
    #[serde(default)]
    after: u64,
    /// Those of this job alone.
    job: Option<u64>,
    /// Where there is none yet: wait so long for one, s; 8 at most.
    #[serde(default)]
    #[param(minimum = 0, maximum = 8)]
    wait_s: f64,
}

/// Events.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct EventsObject {
    /// Which agent this is, by a number that it was given at its start: another one counts its events anew.
    pub agent: String,
    /// Oldest first.
    pub events: Vec<EventObject>,
    /// The number to ask on from.
    pub last: u64,
    /// Some that were asked for are not kept any more.
    pub missed: bool,
}

impl Agent {
    fn events(&self, excerpt: Excerpt<Happening>) -> EventsObject {
        let Excerpt { events, last, missed } = excerpt;
        let events = events.into_iter().map(EventObject::from).collect();
        EventsObject { agent: self.id.to_string(), events, last, missed }
    }
}

/// What has happened behind a number: after a lost connection, ask on from the last one.
#[utoipa::path(
    get,
    path = "/api/events",
    operation_id = "get_events",
    params(EventsRequest),
    responses((status = 200, description = "Oldest first, 500 at most", body = EventsObject), Refusals)
)]
pub(super) async fn events(
    State(agent): State<Agent>,
    Asked(request): Asked<EventsRequest>,
) -> Result<Json<EventsObject>, ErrorObject> {
    let EventsRequest { after, job, wait_s } = request;
    if !(0.0..=WAIT_MAX_S).contains(&wait_s) {
        let message = format!("wait_s is {wait_s}: 0 to {WAIT_MAX_S} s are possible");
        return Err(
            ErrorObject::new("request", message, "ask again from `last` on to wait longer").unreadable()
        );
    }
    let place = agent.waiting.try_acquire();
    let wait_s = if place.is_ok() { wait_s } else { 0.0 };
    let end = Instant::now() + Duration::from_secs_f64(wait_s);
    let mut changes = agent.jobs.journal.changes();
    loop {
        let excerpt = agent.jobs.journal.after(after, job, EVENTS_MAX);
        if !excerpt.events.is_empty() || excerpt.missed {
            return Ok(Json(agent.events(excerpt)));
        }
        if !matches!(tokio::time::timeout_at(end, changes.changed()).await, Ok(Ok(()))) {
            return Ok(Json(agent.events(excerpt)));
        }
    }
}

/// Which events a stream begins with.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StreamRequest {
    /// Was looked at when it was let in.
    #[serde(default, rename = "token")]
    _token: Option<serde::de::IgnoredAny>,
    /// Those behind this number; missing: those from now on.
    after: Option<u64>,
}

/// A message of the stream.
#[derive(serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage {
    /// What the controller reports; old ones are left out for one who reads slowly.
    Status(Box<StatusObject>),
    /// What has happened; none is left out but those that are missed.
    Events(EventsObject),
}

/// `GET /api/stream`: what the controller reports, at most 25 times a second, and what happens.
pub(super) async fn stream(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Asked(request): Asked<StreamRequest>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let sockets = if caller.role == Role::Operator { &agent.operators } else { &agent.viewers };
    let Ok(permit) = sockets.clone().try_acquire_owned() else {
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    };
    upgrade.max_message_size(1024).on_upgrade(async move |socket| {
        send(&agent, &caller, request.after, socket).await;
        drop(permit);
    })
}

async fn send(agent: &Agent, caller: &Caller, after: Option<u64>, mut socket: WebSocket) {
    let mut after = after.unwrap_or_else(|| agent.jobs.journal.last());
    let (mut events, mut statuses) = (agent.jobs.journal.changes(), agent.line.changes());
    let mut period = tokio::time::interval(PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut last, mut due) = (None, Instant::now());
    loop {
        let excerpt = agent.jobs.journal.after(after, None, EVENTS_MAX);
        if !excerpt.events.is_empty() || (excerpt.missed && excerpt.last != after) {
            after = excerpt.last;
            if !pass(&mut socket, &StreamMessage::Events(agent.events(excerpt))).await {
                return;
            }
            continue;
        }
        let at = agent.line.with(|line, _| line.status().map(|(at, _)| *at));
        if at != last || Instant::now() >= due {
            (last, due) = (at, Instant::now() + QUIET);
            if !pass(&mut socket, &StreamMessage::Status(Box::new(agent.status(caller)))).await {
                return;
            }
        }
        // At most so often; and what comes from the client is nothing but its end.
        let next = async {
            period.tick().await;
            tokio::select! {
                changed = statuses.changed() => changed.is_ok(),
                changed = events.changed() => changed.is_ok(),
                () = tokio::time::sleep_until(due) => true,
            }
        };
        tokio::select! {
            there = next => if !there { return },
            () = ended(&mut socket) => return,
        }
    }
}

/// The client has gone, or sends what it has no business to.
async fn ended(socket: &mut WebSocket) {
    let mut noise = 0;
    while let Some(Ok(Message::Ping(_) | Message::Pong(_))) = socket.recv().await {
        noise += 1;
        if noise > NOISE_MAX {
            return;
        }
    }
}

/// False when the client does not take it.
async fn pass(socket: &mut WebSocket, message: &StreamMessage) -> bool {
    // Made of strings and numbers.
    let text = serde_json::to_string(message).unwrap_or_default();
    matches!(tokio::time::timeout(SEND_TIME, socket.send(Message::Text(text.into()))).await, Ok(Ok(())))
}
