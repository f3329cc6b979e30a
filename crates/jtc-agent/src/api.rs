//! API of the agent: HTTP requests, and a WebSocket that connects a client to the serial line.
mod absent;
mod arm;
mod body;
mod commands;
mod doctor;
mod error;
mod events;
mod explain;
mod foxglove;
mod held_stop;
mod identity;
mod jog;
mod lease;
mod log;
mod maintain;
mod metrics;
mod model;
mod objects;
mod plans;
mod poses;
mod questions;
mod recover;
mod report;
mod runs;
mod settings;
mod socket;
mod trajectories;

use std::sync::{Arc, Mutex};
use std::time::Duration;

use agent_kit::access::{Access, TokenError, random};
use agent_kit::api::{Problem, Refusals};
use agent_kit::events::Events;
use agent_kit::gate::{Asker, Caller, Gate, let_in, may_command};
use agent_kit::log::CommandLog;
use agent_kit::openapi::{Bearer, served, text};
use agent_kit::pages::{Pages, show};
use agent_kit::socket::Sockets;
use axum::body::Body;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::handler::Handler as _;
use axum::http::{Method, StatusCode};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::Response;
use axum::{Extension, Json, Router};
use jtc_host::ErrorKind;
use jtc_wire::ExecCommand;
use serde_json::json;
use tokio::sync::Semaphore;
use tower_http::timeout::TimeoutLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::jobs::{ArmEvent, Jobs};
use crate::owner::Line;

pub use held_stop::{HeldStopObject, ReactionsObject};
pub use objects::{ControllerObject, JointObject, LeaseObject, PayloadObject, SentObject, StatusObject};
pub use socket::{CLOSE_PUT_OUT, Hello, Notice};

use events::EventObject;
use identity::Identity;
use objects::Found;

/// Longest request body, bytes.
const BODY_MAX: usize = 64 << 10;
/// Longest request body that contains a trajectory, bytes. 16 MiB are enough for a trajectory of 12,000 points as
/// text, with a margin. The agent reads only a limited number of bodies with trajectories at the same time.
const TRAJECTORY_MAX: usize = 16 << 20;
/// Longest request body that contains an arm, bytes. 1 MiB is enough for a robot description, with a margin.
const ARM_MAX: usize = 1 << 20;
/// Longest request body that contains waypoints, bytes.
const PLAN_MAX: usize = 1 << 18;
const TRAJECTORIES_AT_ONCE: usize = 4;
const CHECKS_AT_ONCE: usize = 2;
/// Longest duration of an ordinary request.
const REQUEST_TIME: Duration = Duration::from_secs(15);

/// Longest duration of a request that plans a motion or reads the flight recorder log. Reading this log takes about
/// 40 s at 115,200 Bd.
const LONG_TIME: Duration = Duration::from_secs(120);

/// State that every handler receives.
#[derive(Clone)]
pub struct Agent {
    line: Line,
    jobs: Arc<Jobs>,
    gate: Gate,
    /// Number that identifies this run of the agent to clients.
    id: Arc<str>,
    port: Arc<str>,
    simulated: bool,
    sockets: Sockets,
    bodies: Arc<Semaphore>,
    /// Limit for the number of trajectory checks that run at the same time.
    checks: Arc<Semaphore>,
    /// Limit for the number of plans that are computed at the same time.
    plans: Arc<Semaphore>,
    /// Limit for the number of reports that are generated at the same time.
    reports: Arc<Semaphore>,
    /// Limit for the number of flight recorder logs that are read at the same time.
    logs: Arc<Semaphore>,
    events: Arc<Events>,
    identity: Arc<tokio::sync::Mutex<Identity>>,
}

impl Agent {
    /// Creates the agent of one serial line. `port` is the name of the port, which users see.
    ///
    /// # Errors
    ///
    /// The operating system provides no random numbers.
    pub fn new(
        line: Line,
        jobs: Arc<Jobs>,
        access: Access,
        log: Arc<Mutex<CommandLog>>,
        port: &str,
        simulated: bool,
    ) -> Result<Self, TokenError> {
        let room = |most| Arc::new(Semaphore::new(most));
        let id: Arc<str> = random()?.get(..8).unwrap_or_default().into();
        let identity = Arc::new(tokio::sync::Mutex::new(Identity::of(jobs.arm())));
        Ok(Self {
            line,
            jobs,
            gate: Gate::new(access, log),
            events: Arc::new(Events::new(id.clone())),
            id,
            port: port.into(),
            simulated,
            sockets: Sockets::default(),
            bodies: room(TRAJECTORIES_AT_ONCE),
            checks: room(CHECKS_AT_ONCE),
            plans: room(1),
            reports: room(1),
            logs: room(1),
            identity,
        })
    }

    /// Returns the router for all HTTP requests.
    pub fn router(self) -> Router {
        let (router, mut description) = described().split_for_parts();
        let (slow, of_slow) = slow().split_for_parts();
        description.merge(of_slow);
        let in_time = |time| TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, time);
        router
            .route("/api/line", axum::routing::get(socket::line))
            .route("/api/stream", axum::routing::get(events::stream))
            .route("/api/foxglove", axum::routing::get(foxglove::foxglove))
            .route("/openapi.json", served(&description))
            .layer(in_time(REQUEST_TIME))
            .merge(slow.layer(in_time(LONG_TIME)))
            .route_layer(from_fn(may_command))
            .layer(from_fn_with_state(self.clone(), at_root))
            .layer(from_fn_with_state(self.gate.clone(), let_in))
            .layer(from_fn_with_state(Pages::new(self.gate.clone(), "index.html"), show))
            .with_state(self)
    }

    fn note(&self, what: &str, facts: serde_json::Value) {
        self.gate.note(what, facts);
    }

    /// Returns the number of lines that the command log has lost.
    fn lost_lines(&self) -> u64 {
        self.gate.lost_lines()
    }

    /// Sends a Stop or a Pause of an HTTP client. The Stop also cancels earlier requests of this client itself, even
    /// if the client holds the lease, because such requests may arrive after the Stop.
    fn halt(&self, asker: &Asker, command: ExecCommand) -> Result<Json<SentObject>, Problem> {
        let caller = &asker.caller;
        // The identity of the client sets the name that is reported. The identity also determines the client to which
        // the hold-off after this Stop or Pause does not apply.
        let client = self.client(asker).ok().map(|(client, _)| client);
        let name = client.as_ref().map_or_else(|| caller.peer.to_string(), |client| client.name.clone());
        let lost = self.line.lost();
        let facts = json!({
            "command": command.name(), "from": caller.peer.to_string(), "by": name, "lost": lost,
        });
        match client {
            Some(_) => self.note("halt", facts),
            // A client without a lease can send any number of Stops and Pauses. The log contains only the first of
            // them in full and counts the others.
            None => self.gate.note_repeated("halt", caller.peer, facts),
        }
        if let Some(lost) = lost {
            let message = format!("{lost}: nothing was sent; the arm may be moving");
            let object = Problem::new("no-link", message, "if the arm moves, press the emergency stop");
            return Err(object.kind(ErrorKind::NoLink));
        }
        let client = client.map(|client| client.client);
        let halt = self.line.with(|line, now| {
            line.halt_for(client, &name, command, now);
            line.last_halt()
        });
        Ok(Json(SentObject { sent: command.name().to_owned(), halt }))
    }

    /// Returns the time since the start of this agent, ms.
    fn now_ms(&self) -> u64 {
        self.line.now().as_millis() as u64
    }

    /// Returns the last status of the controller, and the lease.
    fn status(&self, caller: &Caller) -> StatusObject {
        let lost = self.line.lost();
        let (status, lease, clients, last_halt, at) = self.line.with(|line, now| {
            let name = |client| line.introduction(client).map(|client| client.name.clone());
            let lease = line.lease().map(|lease| LeaseObject {
                holder: name(lease.holder).unwrap_or_default(),
                age_ms: now.saturating_sub(lease.since).as_millis() as u64,
                left_ms: lease.until.map(|until| until.saturating_sub(now).as_millis() as u64),
                wanted_by: lease.wanted_by.and_then(name),
            });
            let status = line.status().map(|(at, status)| (now.saturating_sub(*at), *status));
            (status, lease, line.clients(), line.last_halt(), now)
        });
        StatusObject {
            simulated: self.simulated,
            port: self.port.to_string(),
            at_ms: at.as_millis() as u64,
            lost,
            age_ms: status.as_ref().map(|(age, _)| age.as_millis() as u64),
            controller: status.map(|(_, status)| {
                let stops = &self.jobs.stops;
                let found = Found { stop: stops.cause(&status, at), jumped: stops.jumped(&status) };
                ControllerObject::new(&status, self.line.commanded(&status), &found)
            }),
            lease,
            clients,
            role: caller.role,
            agent: self.id.to_string(),
            last_event: self.jobs.journal.last(),
            last_halt,
        }
    }
}

/// Returns the description of the API, OpenAPI 3.1, as JSON.
pub fn description() -> String {
    text(&described().merge(slow()).into_openapi())
}

#[derive(OpenApi)]
#[openapi(
    info(
        title = "openjtc agent",
        description = "Agent that owns the port of one controller. On the computer of the agent, reading needs no token. On other \
                       computers, reading needs the token of a viewer or of an operator. The same clients can request a \
                       Stop or a Pause. Web pages of an allowed origin can only read.",
        license(name = "MIT OR Apache-2.0")
    ),
    components(schemas(Problem, EventObject, ArmEvent)),
    modifiers(&Bearer),
    security((), ("token" = []))
)]
struct Description;

fn described() -> OpenApiRouter<Agent> {
    let trajectories = OpenApiRouter::new()
        .routes(routes!(trajectories::put, trajectories::delete))
        .layer(DefaultBodyLimit::max(TRAJECTORY_MAX));
    let arms = OpenApiRouter::new()
        .routes(routes!(arm::arm, arm::put_arm))
        .routes(routes!(recover::begin))
        .layer(DefaultBodyLimit::max(ARM_MAX));
    let others = OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(status))
        .routes(routes!(metrics::metrics))
        .routes(routes!(model::model))
        .routes(routes!(explain::list))
        .routes(routes!(explain::explain))
        .routes(routes!(stop))
        .routes(routes!(pause))
        .routes(routes!(events::events))
        .routes(routes!(questions::info))
        .routes(routes!(lease::take, lease::renew, lease::release))
        .routes(routes!(trajectories::list))
        .routes(routes!(trajectories::check))
        .routes(routes!(trajectories::points))
        .routes(routes!(runs::begin_run))
        .routes(routes!(runs::begin_move))
        .routes(routes!(runs::jobs))
        .routes(routes!(runs::job))
        .routes(routes!(report::report))
        .routes(routes!(poses::list))
        .routes(routes!(poses::put, poses::delete))
        .routes(routes!(commands::resume))
        .routes(routes!(maintain::speed, commands::speed))
        .routes(routes!(jog::jog))
        .routes(routes!(commands::teach))
        .routes(routes!(commands::gripper))
        .routes(routes!(maintain::clear))
        .routes(routes!(maintain::reset))
        .routes(routes!(maintain::defaults))
        .routes(routes!(doctor::doctor))
        .routes(routes!(commands::disable))
        .routes(routes!(questions::payload, commands::set_payload))
        .routes(routes!(settings::list, settings::change))
        .routes(routes!(absent::absent, absent::set_absent))
        .routes(routes!(log::status))
        .routes(routes!(log::clear))
        .layer(DefaultBodyLimit::max(BODY_MAX));
    others.merge(trajectories).merge(arms)
}

/// Returns the routes of the requests that have a longer time limit.
fn slow() -> OpenApiRouter<Agent> {
    let plans = OpenApiRouter::new().routes(routes!(plans::plan)).layer(DefaultBodyLimit::max(PLAN_MAX));
    plans.merge(OpenApiRouter::new().routes(routes!(log::fetch)).routes(routes!(log::values)))
}

/// Returns the last status of the controller, and the lease.
#[utoipa::path(
    get,
    path = "/api/status",
    operation_id = "get_status",
    responses((status = 200, description = "Last status of the controller, and the lease", body = StatusObject), Refusals)
)]
async fn status(State(agent): State<Agent>, Extension(caller): Extension<Caller>) -> Json<StatusObject> {
    Json(agent.status(&caller))
}

/// Stops the arm on its path, ahead of all other requests.
///
/// No lease is needed.
#[utoipa::path(
    post,
    path = "/api/stop",
    params(("Lease-Key" = Option<String>, Header, description = "Key of the client's lease: the hold-off of 3 s after this request then does not apply to the client itself")),
    responses(
        (status = 200, description = "The agent sends the Stop; the status shows the resulting state", body = SentObject),
        (status = 503, description = "The port is lost; nothing was sent", body = Problem),
        Refusals
    )
)]
async fn stop(State(agent): State<Agent>, asker: Asker) -> Result<Json<SentObject>, Problem> {
    agent.halt(&asker, ExecCommand::Stop)
}

/// Pauses the motion on its path, ahead of all other requests.
///
/// No lease is needed.
#[utoipa::path(
    post,
    path = "/api/pause",
    params(("Lease-Key" = Option<String>, Header, description = "Key of the client's lease: the hold-off of 3 s after this request then does not apply to the client itself")),
    responses(
        (status = 200, description = "The agent sends the Pause; the status shows the resulting state", body = SentObject),
        (status = 503, description = "The port is lost; nothing was sent", body = Problem),
        Refusals
    )
)]
async fn pause(State(agent): State<Agent>, asker: Asker) -> Result<Json<SentObject>, Problem> {
    agent.halt(&asker, ExecCommand::Pause)
}

/// Serves the WebSocket for programs that know only the agent's address and connect to `/`.
async fn at_root(State(agent): State<Agent>, request: Request<Body>, next: Next) -> Response {
    if request.uri().path() == "/" && request.method() == Method::GET && foxglove::is_asked(request.headers())
    {
        return foxglove::foxglove.call(request, agent).await;
    }
    next.run(request).await
}
