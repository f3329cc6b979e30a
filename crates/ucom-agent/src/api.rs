//! API of the agent: HTTP requests, and a stream of events.
mod boards;
mod commands;
mod events;
mod jobs;
mod lease;
mod line;
mod objects;
mod updates;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use agent_kit::access::{Access, Role, TokenError, random};
use agent_kit::api::{Problem, Refusals};
use agent_kit::events::Events;
use agent_kit::gate::{Asker, Caller, Gate, let_in, may_command};
use agent_kit::log::CommandLog;
use agent_kit::openapi::{Bearer, denials, served, text};
use agent_kit::pages::{Pages, show};
use agent_kit::socket::Sockets;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::{Extension, Json, Router};
use serde_json::json;
use tokio::sync::Semaphore;
use tower_http::timeout::TimeoutLayer;
use utoipa::openapi::{self, RefOr};
use utoipa::{IntoResponses, OpenApi, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::event::ChainEvent;
use crate::owner::{Owner, Shared};
use events::EventObject;
use objects::{LeaseObject, StatusObject};

/// Maximum length of a request body, in bytes.
const BODY_MAX: usize = 64 << 10;
/// Maximum length of a request body with firmware images, in bytes. The length is enough for 1 MiB per image, as text.
const IMAGES_MAX: usize = 6 << 20;
/// Maximum number of requests with firmware images that the agent reads at the same time.
const UPDATES_READ: usize = 2;
/// Maximum duration of a request.
const REQUEST_TIME: Duration = Duration::from_secs(10);

/// State that every handler receives.
#[derive(Clone)]
pub struct Agent {
    shared: Arc<Shared>,
    gate: Gate,
    /// Number that identifies this run of the agent; clients compare it to detect a restart.
    id: Arc<str>,
    bus: Arc<str>,
    simulated: bool,
    sockets: Sockets,
    events: Arc<Events>,
    /// Semaphore that limits how many requests with firmware images the agent reads at the same time.
    images: Arc<Semaphore>,
}

impl Agent {
    /// Creates the agent of one bus. `bus` is the name of the bus that users see.
    ///
    /// # Errors
    ///
    /// The operating system provides no random numbers.
    pub fn new(
        owner: &Owner,
        access: Access,
        log: Arc<Mutex<CommandLog>>,
        bus: &str,
        simulated: bool,
    ) -> Result<Self, TokenError> {
        let gate = Gate::new(access, log);
        owner.shared.journal.follow({
            let gate = gate.clone();
            move |event| {
                if let Some(what) = event.logged() {
                    gate.note(what, json!({ "event": event }));
                }
            }
        });
        let id: Arc<str> = random()?.get(..8).unwrap_or_default().into();
        Ok(Self {
            shared: owner.shared.clone(),
            gate,
            events: Arc::new(Events::new(id.clone())),
            id,
            bus: bus.into(),
            simulated,
            sockets: Sockets::default(),
            images: Arc::new(Semaphore::new(UPDATES_READ)),
        })
    }

    /// Returns the router for all HTTP requests.
    pub fn router(self) -> Router {
        let (router, description) = described().split_for_parts();
        router
            .route("/api/stream", axum::routing::get(events::stream))
            .route("/openapi.json", served(&description))
            .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, REQUEST_TIME))
            .route_layer(from_fn(may_command))
            .layer(from_fn_with_state(self.gate.clone(), let_in))
            .layer(from_fn_with_state(Pages::new(self.gate.clone(), "chain.html"), show))
            .with_state(self)
    }

    fn status(&self, caller: &Caller) -> StatusObject {
        let (lease, now) = {
            let (leases, now) = self.shared.leases();
            (leases.lease(), now)
        };
        let lease = lease.map(|lease| LeaseObject {
            holder: lease.holder,
            age_ms: now.saturating_sub(lease.since).as_millis() as u64,
            left_ms: lease.until.unwrap_or(now).saturating_sub(now).as_millis() as u64,
            wanted_by: lease.wanted_by,
        });
        StatusObject {
            simulated: self.simulated,
            bus: self.bus.to_string(),
            at_ms: now.as_millis() as u64,
            lost: self.shared.lost(),
            lease,
            role: caller.role,
            agent: self.id.to_string(),
            last_event: self.shared.journal.last(),
            last_halt: self.shared.halts(),
            ..StatusObject::of(&self.shared.snapshot())
        }
    }
}

/// Returns the description of the API, OpenAPI 3.1, as JSON.
pub fn description() -> String {
    text(&described().into_openapi())
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "openjtc UCoM agent",
        description = "Agent that owns one bus of UCoM boards. On the computer of the agent, reading needs no token. On other \
                       computers, reading needs the token of a viewer or of an operator. The same clients can request a \
                       Stop.",
        license(name = "MIT OR Apache-2.0")
    ),
    components(schemas(Problem, EventObject, ChainEvent)),
    modifiers(&Bearer),
    security((), ("token" = []))
)]
struct Description;

fn described() -> OpenApiRouter<Agent> {
    let images =
        OpenApiRouter::new().routes(routes!(updates::update)).layer(DefaultBodyLimit::max(IMAGES_MAX));
    let others = OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(status))
        .routes(routes!(stop))
        .routes(routes!(events::events))
        .routes(routes!(lease::take, lease::renew, lease::release))
        .routes(routes!(boards::boards))
        .routes(routes!(boards::board))
        .routes(routes!(boards::values))
        .routes(routes!(commands::set_input))
        .routes(routes!(commands::set_parameter))
        .routes(routes!(commands::set_outputs))
        .routes(routes!(commands::start_board))
        .routes(routes!(commands::stop_board))
        .routes(routes!(commands::reset_board))
        .routes(routes!(jobs::scan))
        .routes(routes!(jobs::init))
        .routes(routes!(jobs::doctor))
        .routes(routes!(jobs::run))
        .routes(routes!(jobs::list))
        .routes(routes!(jobs::get, jobs::cancel))
        .layer(DefaultBodyLimit::max(BODY_MAX));
    others.merge(images)
}

/// Error responses of commands, in addition to the error responses that every request can receive.
struct Denials;

impl IntoResponses for Denials {
    fn responses() -> BTreeMap<String, RefOr<openapi::Response>> {
        denials(
            "The request is refused: another client holds the lease, another request is running, a check or a \
             board refuses the request, or a board does not answer",
            "The bus is lost",
        )
    }
}

/// Returns the status of the bus, and the lease.
#[utoipa::path(
    get,
    path = "/api/status",
    operation_id = "get_status",
    responses((status = 200, description = "Status of the bus, and the lease", body = StatusObject), Refusals)
)]
async fn status(State(agent): State<Agent>, Extension(caller): Extension<Caller>) -> Json<StatusObject> {
    Json(agent.status(&caller))
}

/// Command that was sent.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
struct SentObject {
    /// Command: `stop`.
    sent: String,
    /// Number of the last event before the Stop. Later events report the results of the Stop.
    last_event: u64,
    /// Number of the Stop; `last_halt` has this value until the next Stop.
    halt: u64,
}

/// Stops the control loops of all boards, then their applications. The frames of the Stop are sent before all other
/// frames.
///
/// No lease is needed.
///
/// A running update continues, because a board with partly written flash would not work afterwards. All other
/// requests end.
#[utoipa::path(
    post,
    path = "/api/stop",
    params(("Lease-Key" = Option<String>, Header, description = "Key of the client's lease: the hold-off of 3 s after this request then does not apply to the client itself")),
    responses(
        (status = 200, description = "The agent sends the Stop; an event names the boards that have confirmed it", body = SentObject),
        (status = 503, description = "The bus is lost; nothing was sent", body = Problem),
        Refusals
    )
)]
async fn stop(State(agent): State<Agent>, asker: Asker) -> Result<Json<SentObject>, Problem> {
    // The identity of the client sets the name that is reported. The identity also determines the client to which the
    // hold-off after this Stop does not apply.
    let client = match asker.caller.role {
        Role::Operator => agent.client(&asker).ok(),
        Role::Viewer => None,
    };
    let by = client.as_ref().map_or_else(|| asker.caller.peer.to_string(), |client| client.name.clone());
    let lost = agent.shared.lost();
    let facts = json!({ "command": "stop", "from": asker.caller.peer.to_string(), "by": by, "lost": lost });
    match client {
        Some(_) => agent.gate.note("halt", facts),
        // A client without a lease can send any number of Stops. The log contains only the first of them in full and
        // counts the others.
        None => agent.gate.note_repeated("halt", asker.caller.peer, facts),
    }
    if let Some(lost) = lost {
        let message = format!("{lost}: nothing was sent; running boards become safe without heartbeats");
        return Err(Problem::new("no-link", message, "cut the power of the outputs if a board still moves")
            .kind(host_kit::ErrorKind::NoLink));
    }
    let last_event = agent.shared.journal.last();
    let halt = agent.shared.halt(&by, client.map(|client| client.id));
    Ok(Json(SentObject { sent: "stop".into(), last_event, halt }))
}
