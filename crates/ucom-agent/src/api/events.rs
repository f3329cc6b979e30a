//! What happens, as it happens: events by number, and a stream of them with the values of running boards.
use std::time::Duration;

use agent_kit::access::Role;
use agent_kit::api::{Asked, Problem, Refusals};
use agent_kit::gate::Caller;
use agent_kit::journal::{Entry, Excerpt};
use axum::Extension;
use axum::Json;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse as _, Response};
use tokio::time::{Instant, MissedTickBehavior};
use utoipa::{IntoParams, ToSchema};

use super::Agent;
use super::objects::{BoardObject, StatusObject, ValuesObject};
use crate::happening::Happening;
use crate::picture::Values;

/// Longest that a request waits for an event, s.
const WAIT_MAX_S: f64 = 8.0;
/// Events in one answer.
const EVENTS_MAX: usize = 500;
/// How often values are sent on a stream, at most.
const PERIOD: Duration = Duration::from_millis(40);
/// How often status and boards are.
const SLOWLY: Duration = Duration::from_secs(1);
/// Pings of a client between two messages to it.
const NOISE_MAX: u32 = 100;
/// How long a client may leave a message untaken.
const SEND_TIME: Duration = Duration::from_secs(5);

/// An event.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct EventObject {
    /// Counts up from 1 as long as this agent runs.
    number: u64,
    /// When, s since 1970 by the agent's clock.
    unix_s: f64,
    /// What has happened.
    event: Happening,
}

impl From<Entry<Happening>> for EventObject {
    fn from(Entry { number, unix_s, event }: Entry<Happening>) -> Self {
        Self { number, unix_s, event }
    }
}

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
    agent: String,
    /// Oldest first.
    events: Vec<EventObject>,
    /// The number to ask on from.
    last: u64,
    /// Some that were asked for are not kept any more.
    missed: bool,
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
) -> Result<Json<EventsObject>, Problem> {
    let EventsRequest { after, job, wait_s } = request;
    if !(0.0..=WAIT_MAX_S).contains(&wait_s) {
        let message = format!("wait_s is {wait_s}: 0 to {WAIT_MAX_S} s are possible");
        return Err(Problem::new("request", message, "ask again from `last` on to wait longer").unreadable());
    }
    let end = Instant::now() + Duration::from_secs_f64(wait_s);
    let journal = &agent.shared.journal;
    let mut changes = journal.changes();
    loop {
        let excerpt = journal.after(after, job, EVENTS_MAX);
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
    /// Those behind this number; missing: those from now on.
    after: Option<u64>,
}

/// A message of the stream.
#[derive(serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage {
    /// The bus, once a second.
    Status(Box<StatusObject>),
    /// The boards, once a second.
    Boards { boards: Vec<BoardObject> },
    /// Outputs that have come; old ones are left out for one who reads slowly.
    Values { values: Vec<ValuesObject> },
    /// What has happened; none is left out but those that are missed.
    Events(EventsObject),
}

/// `GET /api/stream`: what happens, the values of running boards at most 25 times a second, bus and boards once a second.
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
    let journal = &agent.shared.journal;
    let mut after = after.unwrap_or_else(|| journal.last());
    let (mut events, mut pictures) = (journal.changes(), agent.shared.changes());
    let mut period = tokio::time::interval(PERIOD);
    period.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let (mut shown_us, mut due) = (0, Instant::now());
    loop {
        let excerpt = journal.after(after, None, EVENTS_MAX);
        let more = !excerpt.events.is_empty() || excerpt.missed;
        let mut messages = Vec::new();
        if more {
            after = excerpt.last;
            messages.push(StreamMessage::Events(agent.events(excerpt)));
        }
        if Instant::now() >= due {
            due = Instant::now() + SLOWLY;
            messages.push(StreamMessage::Status(Box::new(agent.status(caller))));
            messages.push(StreamMessage::Boards { boards: BoardObject::all(&agent.shared.picture()) });
        }
        if let Some((values, newest_us)) = new_values(agent, shown_us) {
            shown_us = newest_us;
            messages.push(StreamMessage::Values { values });
        }
        for message in &messages {
            if !pass(&mut socket, message).await {
                return;
            }
        }
        // At most so often; and what comes from the client is nothing but its end.
        let next = async {
            period.tick().await;
            if more {
                return true;
            }
            tokio::select! {
                changed = pictures.changed() => changed.is_ok(),
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

/// The values that have come behind this time, and that of the newest, µs.
fn new_values(agent: &Agent, shown_us: u64) -> Option<(Vec<ValuesObject>, u64)> {
    let picture = agent.shared.picture();
    let time_us = |values: &Values| values.outputs.as_ref().map_or(0, |outputs| outputs.time_us);
    let new = picture.values.values().filter(|values| time_us(values) > shown_us);
    let objects: Vec<ValuesObject> = new.map(|values| ValuesObject::of(&picture, values)).collect();
    let newest_us = picture.values.values().map(time_us).max()?;
    (!objects.is_empty()).then_some((objects, newest_us))
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
