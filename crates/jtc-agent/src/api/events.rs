//! What happens, as it happens: events by number, and a stream of them with what the controller reports.
use std::time::Duration;

use agent_kit::api::{Asked, Problem, Refusals};
use agent_kit::events::{self, EventsRequest, StreamRequest};
use agent_kit::journal::Entry;
use agent_kit::socket::{MESSAGE_MAX, PROTOCOL};
use axum::Extension;
use axum::Json;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::response::Response;
use tokio::time::Instant;

use super::{Agent, Caller, StatusObject};
use crate::jobs::Happening;

/// How often the controller is reported on a stream, at least.
const QUIET: Duration = Duration::from_millis(500);

/// An event.
pub(super) type EventObject = Entry<Happening>;
type EventsObject = events::EventsObject<EventObject>;

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
    agent.events.ask(&agent.jobs.journal, request).await
}

/// The message of the stream that is no event.
#[derive(serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage {
    /// What the controller reports; old ones are left out for one who reads slowly.
    Status(Box<StatusObject>),
}

/// `GET /api/stream`: what the controller reports, at most 25 times a second, and what happens.
pub(super) async fn stream(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Asked(request): Asked<StreamRequest>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let sockets = agent.sockets.clone();
    sockets.serve(
        caller.role,
        upgrade.max_message_size(MESSAGE_MAX).protocols([PROTOCOL]),
        async move |socket| {
            let (mut last, mut due) = (None, Instant::now());
            let show = || {
                let mut messages = Vec::new();
                let at = agent.line.with(|line, _| line.status().map(|(at, _)| *at));
                if at != last || Instant::now() >= due {
                    (last, due) = (at, Instant::now() + QUIET);
                    messages.push(StreamMessage::Status(Box::new(agent.status(&caller))));
                }
                (messages, due)
            };
            let (journal, statuses) = (&agent.jobs.journal, agent.line.changes());
            agent.events.stream((journal, request), socket, statuses, show).await;
        },
    )
}
