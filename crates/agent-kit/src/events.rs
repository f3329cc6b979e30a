//! What happens, as it happens: events by number, and a stream of them with what else an agent shows.
use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::ws::WebSocket;
use serde::Serialize;
use tokio::sync::{Semaphore, watch};
use tokio::time::{Instant, MissedTickBehavior};
use utoipa::{IntoParams, ToSchema};

use crate::api::Problem;
use crate::journal::{Entry, Excerpt, Happening, Journal};
use crate::socket::{ended, pass};

/// Longest that a request waits for an event, s.
const WAIT_MAX_S: f64 = 8.0;
/// Events in one answer.
const EVENTS_MAX: usize = 500;
/// Requests that wait for an event, at once: more are answered soon. They leave room for the connections of others.
const WAITING_MAX: usize = 64;
/// What soon is, s: who asks on at once does not keep the agent busy with that.
const NO_PLACE_S: f64 = 0.25;
/// Messages of a stream that are not events come so far apart at least.
const PERIOD: Duration = Duration::from_millis(40);

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

/// Events, each an [`Entry`]. The description of an API is to list these, and what can happen, by name: it does not find them itself.
#[derive(Clone, Debug, Serialize, ToSchema)]
#[schema(description = "Events.")]
pub struct EventsObject<E> {
    /// Which agent this is, by a number that it was given at its start: another one counts its events anew.
    agent: String,
    /// Oldest first.
    events: Vec<E>,
    /// The number to ask on from.
    last: u64,
    /// Some that were asked for are not kept any more.
    missed: bool,
}

/// Which events a stream begins with.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StreamRequest {
    /// Was looked at when it was let in.
    #[serde(default, rename = "token")]
    _token: Option<serde::de::IgnoredAny>,
    /// Those behind this number; missing: those from now on.
    after: Option<u64>,
}

/// The message of a stream that every agent sends.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum StreamMessage<E> {
    /// What has happened; none is left out but those that are missed.
    Events(EventsObject<Entry<E>>),
}

/// What an agent answers about its events.
pub struct Events {
    agent: Arc<str>,
    waiting: Semaphore,
}

impl Events {
    /// Those of the agent with this number of its own.
    pub fn new(agent: Arc<str>) -> Self {
        Self { agent, waiting: Semaphore::new(WAITING_MAX) }
    }

    fn object<E>(&self, excerpt: Excerpt<E>) -> EventsObject<Entry<E>> {
        let Excerpt { events, last, missed } = excerpt;
        EventsObject { agent: self.agent.to_string(), events, last, missed }
    }

    /// What is asked for; where there is none yet, it is waited for, by so many requests at once as have a place.
    ///
    /// # Errors
    ///
    /// It is to be waited for longer than is possible.
    pub async fn ask<E: Happening>(
        &self,
        journal: &Journal<E>,
        request: EventsRequest,
    ) -> Result<Json<EventsObject<Entry<E>>>, Problem> {
        let EventsRequest { after, job, wait_s } = request;
        if !(0.0..=WAIT_MAX_S).contains(&wait_s) {
            let message = format!("wait_s is {wait_s}: 0 to {WAIT_MAX_S} s are possible");
            let next = "ask again from `last` on to wait longer";
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

    /// Sends events on a socket as they come, and what `show` returns: messages, and when to look for the next ones where `changes` announces
    /// none before. Ends when the client has gone, does not read, or sends what it has no business to.
    pub async fn stream<E: Happening + Serialize, M: Serialize>(
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
            // At most so often; and what comes from the client is nothing but its end.
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
