//! The agent's API: what is asked by HTTP, and one socket for a client's end of the line.
mod commands;
mod error;
mod events;
mod foxglove;
mod identity;
mod lease;
mod metrics;
mod objects;
mod questions;
mod runs;
mod socket;
mod trajectories;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use agent_kit::access::{Access, TokenError, random};
use agent_kit::api::Refusals;
use agent_kit::gate::{Caller, Gate, let_in};
use agent_kit::log::CommandLog;
use axum::body::Body;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::handler::Handler as _;
use axum::http::{HeaderMap, Method, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::Response;
use axum::{Extension, Json, Router};
use jtc_host::ErrorKind;
use jtc_wire::ExecCommand;
use serde_json::json;
use tokio::sync::Semaphore;
use tower_http::timeout::TimeoutLayer;
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa::{Modify, OpenApi};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::jobs::Jobs;
use crate::owner::Line;

pub use error::ErrorObject;
pub use objects::{ControllerObject, JointObject, LeaseObject, PayloadObject, SentObject, StatusObject};
pub use socket::{CLOSE_PUT_OUT, Hello, Notice};

use identity::Identity;

/// Longest body that is read.
const BODY_MAX: usize = 64 << 10;
/// Longest of a trajectory: 12,000 points as text, with room to spare. So many of them are read at once.
const TRAJECTORY_MAX: usize = 16 << 20;
const TRAJECTORIES_AT_ONCE: usize = 4;
const CHECKS_AT_ONCE: usize = 2;
/// Requests that wait for an event, at once: more are answered at once. They leave room for the connections of others.
const WAITING_MAX: usize = 64;
/// Longest that a request may take.
const REQUEST_TIME: Duration = Duration::from_secs(15);
/// Sockets at once of those who may look, and of those who may command: the first cannot keep the others out.
const VIEWERS_MAX: usize = 128;
const OPERATORS_MAX: usize = 32;

/// What every handler has.
#[derive(Clone)]
pub struct Agent {
    line: Line,
    jobs: Arc<Jobs>,
    gate: Gate,
    /// A number of its own, by which clients know that it is another one.
    id: Arc<str>,
    port: Arc<str>,
    simulated: bool,
    viewers: Arc<Semaphore>,
    operators: Arc<Semaphore>,
    bodies: Arc<Semaphore>,
    /// Checks of trajectories at once, and requests that wait for an event.
    checks: Arc<Semaphore>,
    waiting: Arc<Semaphore>,
    identity: Arc<tokio::sync::Mutex<Identity>>,
}

impl Agent {
    /// An agent of a line. `port` is what people call it.
    ///
    /// # Errors
    ///
    /// The system has no random numbers.
    pub fn new(
        line: Line,
        jobs: Arc<Jobs>,
        access: Access,
        log: Arc<Mutex<CommandLog>>,
        port: &str,
        simulated: bool,
    ) -> Result<Self, TokenError> {
        let room = |most| Arc::new(Semaphore::new(most));
        let identity = Arc::new(tokio::sync::Mutex::new(Identity::of(jobs.arm())));
        Ok(Self {
            line,
            jobs,
            gate: Gate::new(access, log),
            id: random()?.get(..8).unwrap_or_default().into(),
            port: port.into(),
            simulated,
            viewers: room(VIEWERS_MAX),
            operators: room(OPERATORS_MAX),
            bodies: room(TRAJECTORIES_AT_ONCE),
            checks: room(CHECKS_AT_ONCE),
            waiting: room(WAITING_MAX),
            identity,
        })
    }

    /// Everything that is served.
    pub fn router(self) -> Router {
        let (router, description) = described().split_for_parts();
        let description: Arc<str> = text(&description).into();
        let openapi =
            move || async move { ([(header::CONTENT_TYPE, "application/json")], description.to_string()) };
        router
            .route("/api/line", axum::routing::get(socket::line))
            .route("/api/stream", axum::routing::get(events::stream))
            .route("/api/foxglove", axum::routing::get(foxglove::foxglove))
            .route("/openapi.json", axum::routing::get(openapi))
            .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, REQUEST_TIME))
            .layer(from_fn_with_state(self.clone(), at_root))
            .layer(from_fn_with_state(self.gate.clone(), let_in))
            .with_state(self)
    }

    fn note(&self, what: &str, facts: serde_json::Value) {
        self.gate.note(what, facts);
    }

    /// Lines that the log of commands lost.
    fn lost_lines(&self) -> u64 {
        self.gate.lost_lines()
    }

    /// Stops or pauses for somebody who asked by HTTP. For the line it is somebody else than who commands, whoever it is: what is on its
    /// way from there may have been sent before.
    fn halt(
        &self,
        caller: &Caller,
        headers: &HeaderMap,
        command: ExecCommand,
    ) -> Result<Json<SentObject>, ErrorObject> {
        // Who it is does not matter, but for going on later.
        let client = self.client(caller, headers).ok().map(|(client, _)| client);
        let name = client.as_ref().map_or_else(|| caller.peer.to_string(), |client| client.name.clone());
        let lost = self.line.lost();
        let facts = json!({
            "command": command.name(), "from": caller.peer.to_string(), "by": name, "lost": lost,
        });
        self.note("halt", facts);
        if let Some(lost) = lost {
            let message = format!("{lost}: nothing was sent; the arm may be moving");
            let object = ErrorObject::new("no-link", message, "the emergency stop, if it is");
            return Err(object.kind(ErrorKind::NoLink));
        }
        let client = client.map(|client| client.client);
        self.line.with(|line, now| line.halt_for(client, &name, command, now));
        Ok(Json(SentObject { sent: command.name().to_owned() }))
    }

    /// The controller, as its last status has it, and who commands.
    fn status(&self, caller: &Caller) -> StatusObject {
        let lost = self.line.lost();
        let (status, lease, clients) = self.line.with(|line, now| {
            let name = |client| line.introduction(client).map(|client| client.name.clone());
            let lease = line.lease().map(|lease| LeaseObject {
                holder: name(lease.holder).unwrap_or_default(),
                age_ms: now.saturating_sub(lease.since).as_millis() as u64,
                left_ms: lease.until.map(|until| until.saturating_sub(now).as_millis() as u64),
                wanted_by: lease.wanted_by.and_then(name),
            });
            let status = line.status().map(|(at, status)| (now.saturating_sub(*at), *status));
            (status, lease, line.clients())
        });
        StatusObject {
            simulated: self.simulated,
            port: self.port.to_string(),
            lost,
            age_ms: status.as_ref().map(|(age, _)| age.as_millis() as u64),
            controller: status.as_ref().map(|(_, status)| status.into()),
            lease,
            clients,
            role: caller.role,
            agent: self.id.to_string(),
            last_event: self.jobs.journal.last(),
        }
    }
}

/// The description of the API, OpenAPI 3.1, as JSON.
pub fn description() -> String {
    text(&described().into_openapi())
}

fn text(description: &utoipa::openapi::OpenApi) -> String {
    // It is made of strings.
    description.to_pretty_json().unwrap_or_default()
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "openjtc agent",
        description = "Owner of one controller. Reading needs no token on the computer that the agent runs on, and the viewer's or the \
                       operator's from elsewhere. A Stop or a Pause is taken from everyone who was let in.",
        license(name = "MIT OR Apache-2.0")
    ),
    components(schemas(ErrorObject)),
    modifiers(&Bearer),
    security((), ("token" = []))
)]
struct Description;

/// A token, which those on the same computer need for commands alone.
struct Bearer;

impl Modify for Bearer {
    fn modify(&self, description: &mut utoipa::openapi::OpenApi) {
        let scheme = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
        description.components.get_or_insert_default().add_security_scheme("token", scheme);
    }
}

fn described() -> OpenApiRouter<Agent> {
    let trajectories = OpenApiRouter::new()
        .routes(routes!(trajectories::put, trajectories::delete))
        .layer(DefaultBodyLimit::max(TRAJECTORY_MAX));
    let others = OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(status))
        .routes(routes!(metrics::metrics))
        .routes(routes!(stop))
        .routes(routes!(pause))
        .routes(routes!(events::events))
        .routes(routes!(questions::info))
        .routes(routes!(lease::take, lease::renew, lease::release))
        .routes(routes!(trajectories::list))
        .routes(routes!(trajectories::check))
        .routes(routes!(runs::begin_run))
        .routes(routes!(runs::begin_move))
        .routes(routes!(runs::jobs))
        .routes(routes!(runs::job))
        .routes(routes!(commands::resume))
        .routes(routes!(commands::speed))
        .routes(routes!(commands::jog))
        .routes(routes!(commands::teach))
        .routes(routes!(commands::gripper))
        .routes(routes!(commands::clear))
        .routes(routes!(commands::disable))
        .routes(routes!(commands::recover))
        .routes(routes!(questions::payload, commands::set_payload))
        .layer(DefaultBodyLimit::max(BODY_MAX));
    others.merge(trajectories)
}

/// The controller, as its last status has it, and who commands.
#[utoipa::path(
    get,
    path = "/api/status",
    operation_id = "get_status",
    responses((status = 200, description = "What the controller reports", body = StatusObject), Refusals)
)]
async fn status(State(agent): State<Agent>, Extension(caller): Extension<Caller>) -> Json<StatusObject> {
    Json(agent.status(&caller))
}

/// Ends the motion on its path, ahead of all else. No lease is needed.
#[utoipa::path(
    post,
    path = "/api/stop",
    params(("Lease-Key" = Option<String>, Header, description = "Key of a lease, where it is the client's own motion")),
    responses(
        (status = 200, description = "The Stop is on its way; the state that it leads to is in the status", body = SentObject),
        (status = 503, description = "The port is gone: nothing was sent", body = ErrorObject),
        Refusals
    )
)]
async fn stop(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<Json<SentObject>, ErrorObject> {
    agent.halt(&caller, &headers, ExecCommand::Stop)
}

/// Pauses the motion on its path, ahead of all else. No lease is needed.
#[utoipa::path(
    post,
    path = "/api/pause",
    params(("Lease-Key" = Option<String>, Header, description = "Key of a lease, where it is the client's own motion")),
    responses(
        (status = 200, description = "The Pause is on its way; the state that it leads to is in the status", body = SentObject),
        (status = 503, description = "The port is gone: nothing was sent", body = ErrorObject),
        Refusals
    )
)]
async fn pause(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<Json<SentObject>, ErrorObject> {
    agent.halt(&caller, &headers, ExecCommand::Pause)
}

/// Programs that are given nothing but the agent's address ask there for what they show.
async fn at_root(State(agent): State<Agent>, request: Request<Body>, next: Next) -> Response {
    if request.uri().path() == "/" && request.method() == Method::GET && foxglove::is_asked(request.headers())
    {
        return foxglove::foxglove.call(request, agent).await;
    }
    next.run(request).await
}
