//! Events of the chain. Clients request events by number, or receive them as a live stream together with the values
//! of running boards.
use std::time::Duration;

use agent_kit::api::{Asked, Problem, Refusals};
use agent_kit::events::{self, EventsRequest, StreamRequest};
use agent_kit::gate::Caller;
use agent_kit::journal::Entry;
use agent_kit::socket::{MESSAGE_MAX, PROTOCOL};
use axum::Extension;
use axum::Json;
use axum::extract::State;
use axum::extract::ws::WebSocketUpgrade;
use axum::response::Response;
use tokio::time::Instant;

use super::Agent;
use super::objects::{BoardObject, StatusObject, ValuesObject};
use crate::event::ChainEvent;
use crate::snapshot::Values;

/// Interval at which the stream sends the bus status and the list of boards.
const SLOWLY: Duration = Duration::from_secs(1);

/// Event with its number and time.
pub(super) type EventObject = Entry<ChainEvent>;
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
    agent.events.ask(&agent.shared.journal, request).await
}

/// Message of the event stream that is not an event.
#[derive(serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage {
    /// Status of the bus, once a second.
    Status(Box<StatusObject>),
    /// List of boards, once a second.
    Boards { boards: Vec<BoardObject> },
    /// New outputs of boards; if the client reads slowly, older outputs are omitted.
    Values { values: Vec<ValuesObject> },
}

/// Serves `GET /api/stream`: events, values of running boards at most 25 times a second, and bus status and boards
/// once a second.
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
            let (mut shown_us, mut due) = (0, Instant::now());
            let show = || {
                let mut messages = Vec::new();
                if Instant::now() >= due {
                    due = Instant::now() + SLOWLY;
                    messages.push(StreamMessage::Status(Box::new(agent.status(&caller))));
                    messages
                        .push(StreamMessage::Boards { boards: BoardObject::all(&agent.shared.snapshot()) });
                }
                if let Some((values, newest_us)) = new_values(&agent, shown_us) {
                    shown_us = newest_us;
                    messages.push(StreamMessage::Values { values });
                }
                (messages, due)
            };
            let (journal, pictures) = (&agent.shared.journal, agent.shared.changes());
            agent.events.stream((journal, request), socket, pictures, show).await;
        },
    )
}

/// Returns the values that arrived after the time `shown_us`, and the time of the newest value, in µs.
fn new_values(agent: &Agent, shown_us: u64) -> Option<(Vec<ValuesObject>, u64)> {
    let snapshot = agent.shared.snapshot();
    let time_us = |values: &Values| values.outputs.as_ref().map_or(0, |outputs| outputs.time_us);
    let new = snapshot.values.values().filter(|values| time_us(values) > shown_us);
    let objects: Vec<ValuesObject> = new.map(|values| ValuesObject::of(&snapshot, values)).collect();
    let newest_us = snapshot.values.values().map(time_us).max()?;
    (!objects.is_empty()).then_some((objects, newest_us))
}
