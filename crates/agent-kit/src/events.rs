//! Events of an agent. Clients request events by number, or receive them as a live stream together with the agent's
//! state.
use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::ws::WebSocket;
use serde::Serialize;
use tokio::sync::{Semaphore, watch};
use tokio::time::{Instant, MissedTickBehavior};
use utoipa::{IntoParams, ToSchema};

use crate::api::Problem;
use crate::journal::{Entry, Excerpt, Journal, JournalEvent};
use crate::socket::{ended, pass};

/// Longest wait of a request for an event, in seconds.
const WAIT_MAX_S: f64 = 8.0;
/// Largest number of events in one answer.
const EVENTS_MAX: usize = 500;
/// Number of requests that can wait for an event at the same time. Further requests wait only [`NO_PLACE_S`], so that
/// connections remain free for other clients.
const WAITING_MAX: usize = 64;
/// Longest wait of a request for an event, in seconds, if [`WAITING_MAX`] requests are already waiting. This wait
/// limits the load from clients that repeat their requests immediately.
const NO_PLACE_S: f64 = 0.25;
/// Shortest interval between two stream messages that contain no events.
const PERIOD: Duration = Duration::from_millis(40);

/// Selection of events.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct EventsRequest {
    /// Number of the last event that the client has; 0: from the first event.
    #[serde(default)]
    after: u64,
    /// Number of a job: only its events are returned.
    job: Option<u64>,
    /// Longest wait for an event if the list is empty, s; 0 to 8.
    #[serde(default)]
    #[param(minimum = 0, maximum = 8)]
    wait_s: f64,
}

/// Events, each an [`Entry`]. The description of an API must list this type and its event types by name, because
/// utoipa does not find them automatically.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(description = "Events.")]
pub struct EventsObject<E> {
    /// Number that identifies this run of the agent. Each run counts its events from 1.
    agent: String,
    /// Events, oldest first.
    events: Vec<E>,
    /// Number to use as `after` in the next request.
    last: u64,
    /// `true` if some requested events were dropped from the journal.
    missed: bool,
}

/// First message of a client that starts a stream of events.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamRequest {
    /// Token of the client, which the access gate has already checked.
    #[serde(default, rename = "token")]
    _token: Option<serde::de::IgnoredAny>,
    /// Number of the last event that the client has received; if missing, the stream contains only new events.
    after: Option<u64>,
}

/// Message in the event stream of every kind of agent.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage<E> {
    /// Events of the journal in order. If events were dropped from the journal, the message reports them as missed.
    Events(EventsObject<Entry<E>>),
}

/// Requests for events of an agent.
pub struct Events {
    agent: Arc<str>,
    waiting: Semaphore,
}

impl Events {
    /// Creates the event service for one run of the agent, with the run number `agent`.
    pub fn new(agent: Arc<str>) -> Self {
        Self { agent, waiting: Semaphore::new(WAITING_MAX) }
    }

    fn object<E>(&self, excerpt: Excerpt<E>) -> EventsObject<Entry<E>> {
        let Excerpt { events, last, missed } = excerpt;
        EventsObject { agent: self.agent.to_string(), events, last, missed }
    }

    /// Returns the events that the client requests. If no such event exists yet, waits for the first event. The number
    /// of requests that wait at the same time is limited.
    ///
    /// # Errors
    ///
    /// The requested wait is outside 0 to 8 s.
    pub async fn ask<E: JournalEvent>(
        &self,
        journal: &Journal<E>,
        request: EventsRequest,
    ) -> Result<Json<EventsObject<Entry<E>>>, Problem> {
        let EventsRequest { after, job, wait_s } = request;
        if !(0.0..=WAIT_MAX_S).contains(&wait_s) {
            let message = format!("wait_s is out of range: {wait_s}, expected 0 to {WAIT_MAX_S} s");
            let next = "to wait longer, send the request again with `after` set to `last` of the answer";
            return Err(Problem::new("request", message, next).unreadable());
        }
        let place = self.waiting.try_acquire();
        let wait_s = if place.is_ok() { wait_s } else { wait_s.min(NO_PLACE_S) };
        let end = Instant::now() + Duration::from_secs_f64(wait_s);
        let mut changes = journal.changes();
        loop {
            let excerpt = journal.after(after, job, EVENTS_MAX);
            if !excerpt.events.is_empty() || excerpt.missed {
                return Ok(Json(self.object(excerpt)));
            }
            if !matches!(tokio::time::timeout_at(end, changes.changed()).await, Ok(Ok(()))) {
                return Ok(Json(self.object(excerpt)));
            }
        }
    }

    /// Sends events on a WebSocket as they occur, and also the messages that `show` returns. `show` also returns the
    /// time of its next call; a change that `changes` announces causes an earlier call. Ends when the client
    /// disconnects, does not read, or sends an unexpected message.
    pub async fn stream<E: JournalEvent + Serialize, M: Serialize>(
        &self,
        (journal, request): (&Journal<E>, StreamRequest),
        mut socket: WebSocket,
        mut changes: watch::Receiver<()>,
        mut show: impl FnMut() -> (Vec<M>, Instant),
    ) {
        let mut after = request.after.unwrap_or_else(|| journal.last());
        let mut events = journal.changes();
        let mut period = tokio::time::interval(PERIOD);
        period.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let excerpt = journal.after(after, None, EVENTS_MAX);
            if !excerpt.events.is_empty() || (excerpt.missed && excerpt.last != after) {
                after = excerpt.last;
                if !pass(&mut socket, &StreamMessage::Events(self.object(excerpt))).await {
                    return;
                }
                continue;
            }
            let (messages, due) = show();
            for message in &messages {
                if !pass(&mut socket, message).await {
                    return;
                }
            }
            // The interval limits the rate of messages. While the server waits, the client may only close the
            // connection.
            let next = async {
                period.tick().await;
                tokio::select! {
                    changed = changes.changed() => changed.is_ok(),
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
}
