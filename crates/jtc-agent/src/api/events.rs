//! Events of the arm. Clients request events by number, or receive them as a live stream together with the
//! controller's statuses.
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
use crate::jobs::ArmEvent;

/// Longest interval between two status messages of a stream.
const QUIET: Duration = Duration::from_millis(500);

/// Event with its number and time.
pub(super) type EventObject = Entry<ArmEvent>;
type EventsObject = events::EventsObject<EventObject>;

/// Returns the events after a number.
///
/// After a lost connection, continue with the number of the last event that you received.
#[utoipa::path(
    get,
    path = "/api/events",
    operation_id = "get_events",
    params(EventsRequest),
    responses((status = 200, description = "Events, oldest first, 500 at most", body = EventsObject), Refusals)
)]
pub(super) async fn events(
    State(agent): State<Agent>,
    Asked(request): Asked<EventsRequest>,
) -> Result<Json<EventsObject>, Problem> {
    agent.events.ask(&agent.jobs.journal, request).await
}

/// Message of an event stream that is not an event.
#[derive(serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage {
    /// Status of the controller; if the client reads slowly, older statuses are omitted.
    Status(Box<StatusObject>),
}

/// Serves `GET /api/stream`: events, and statuses at most 25 times a second.
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
