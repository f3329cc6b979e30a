//! The agent's API: what is asked by HTTP, and one socket for a client's end of the line.
mod objects;
mod socket;

use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::body::Body;
use axum::extract::{ConnectInfo, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json, Router};
use jtc_wire::ExecCommand;
use serde_json::json;
use tokio::sync::Semaphore;
use tower_http::limit::RequestBodyLimitLayer;
use tower_http::timeout::TimeoutLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::access::{Access, Refusal, Request as Asked};
use crate::line::{OWNER, Role};
use crate::log::CommandLog;
use crate::owner::Line;

pub use objects::{ControllerObject, ErrorObject, JointObject, LeaseObject, SentObject, StatusObject};
pub use socket::{CLOSE_PUT_OUT, Hello, Notice, logged};

/// Longest body that is read.
const BODY_MAX: usize = 64 << 10;
/// Longest that a request may take.
const REQUEST_TIME: Duration = Duration::from_secs(10);
/// Sockets at once of those who may look, and of those who may command: the first cannot keep the others out.
const VIEWERS_MAX: usize = 128;
const OPERATORS_MAX: usize = 32;

/// What every handler has.
#[derive(Clone)]
pub struct Agent {
    line: Line,
    access: Arc<Access>,
    log: Arc<Mutex<CommandLog>>,
    port: Arc<str>,
    simulated: bool,
    viewers: Arc<Semaphore>,
    operators: Arc<Semaphore>,
}

/// Who asks.
#[derive(Clone, Debug)]
struct Caller {
    role: Role,
    peer: SocketAddr,
}

impl Agent {
    /// An agent of a line. `port` is what people call it.
    pub fn new(line: Line, access: Access, log: Arc<Mutex<CommandLog>>, port: &str, simulated: bool) -> Self {
        let (viewers, operators) = (Semaphore::new(VIEWERS_MAX), Semaphore::new(OPERATORS_MAX));
        let (viewers, operators) = (Arc::new(viewers), Arc::new(operators));
        Self { line, access: Arc::new(access), log, port: port.into(), simulated, viewers, operators }
    }

    /// Everything that is served.
    pub fn router(self) -> Router {
        let (router, description) = described().split_for_parts();
        let description: Arc<str> = text(&description).into();
        let openapi =
            move || async move { ([(header::CONTENT_TYPE, "application/json")], description.to_string()) };
        router
            .route("/api/line", axum::routing::get(socket::line))
            .route("/openapi.json", axum::routing::get(openapi))
            .layer(TimeoutLayer::with_status_code(StatusCode::REQUEST_TIMEOUT, REQUEST_TIME))
            .layer(RequestBodyLimitLayer::new(BODY_MAX))
            .layer(from_fn_with_state(self.clone(), let_in))
            .with_state(self)
    }

    fn note(&self, what: &str, facts: serde_json::Value) {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).write(what, facts);
    }

    /// Stops or pauses for somebody who asked by HTTP.
    fn halt(
        &self,
        caller: &Caller,
        command: ExecCommand,
    ) -> Result<Json<SentObject>, (StatusCode, Json<ErrorObject>)> {
        let lost = self.line.lost();
        let facts = json!({
            "command": command.name(), "from": caller.peer.to_string(), "by": "http", "lost": lost,
        });
        self.note("halt", facts);
        if let Some(lost) = lost {
            let object = ErrorObject {
                code: "no-link".into(),
                message: format!("{lost}: nothing was sent; the arm may be moving"),
                next: "the emergency stop, if it is".into(),
            };
            return Err((StatusCode::SERVICE_UNAVAILABLE, Json(object)));
        }
        self.line.with(|line, now| line.halt(OWNER, &caller.peer.to_string(), command, now));
        Ok(Json(SentObject { sent: command.name().to_owned() }))
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
    components(schemas(ErrorObject))
)]
struct Description;

fn described() -> OpenApiRouter<Agent> {
    OpenApiRouter::with_openapi(Description::openapi())
        .routes(routes!(status))
        .routes(routes!(stop))
        .routes(routes!(pause))
}

/// The controller, as its last status has it, and who commands.
#[utoipa::path(
    get,
    path = "/api/status",
    responses(
        (status = 200, description = "What the controller reports", body = StatusObject),
        (status = 401, description = "The token is missing or none of this agent's", body = ErrorObject),
        (status = 403, description = "The request comes from a page of another site, or asks for another name", body = ErrorObject),
        (status = 429, description = "Too many wrong tokens came", body = ErrorObject),
    )
)]
async fn status(State(agent): State<Agent>, Extension(caller): Extension<Caller>) -> Json<StatusObject> {
    let lost = agent.line.lost();
    let (status, lease, clients) = agent.line.with(|line, now| {
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
    Json(StatusObject {
        simulated: agent.simulated,
        port: agent.port.to_string(),
        lost,
        age_ms: status.as_ref().map(|(age, _)| age.as_millis() as u64),
        controller: status.as_ref().map(|(_, status)| status.into()),
        lease,
        clients,
        role: caller.role,
    })
}

/// Ends the motion on its path, ahead of all else. No lease is needed.
#[utoipa::path(
    post,
    path = "/api/stop",
    responses(
        (status = 200, description = "The Stop is on its way; the state that it leads to is in the status", body = SentObject),
        (status = 401, description = "The token is missing or none of this agent's", body = ErrorObject),
        (status = 403, description = "The request comes from a page of another site, or asks for another name", body = ErrorObject),
        (status = 503, description = "The port is gone: nothing was sent", body = ErrorObject),
    )
)]
async fn stop(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<SentObject>, (StatusCode, Json<ErrorObject>)> {
    agent.halt(&caller, ExecCommand::Stop)
}

/// Pauses the motion on its path, ahead of all else. No lease is needed.
#[utoipa::path(
    post,
    path = "/api/pause",
    responses(
        (status = 200, description = "The Pause is on its way; the state that it leads to is in the status", body = SentObject),
        (status = 401, description = "The token is missing or none of this agent's", body = ErrorObject),
        (status = 403, description = "The request comes from a page of another site, or asks for another name", body = ErrorObject),
        (status = 503, description = "The port is gone: nothing was sent", body = ErrorObject),
    )
)]
async fn pause(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
) -> Result<Json<SentObject>, (StatusCode, Json<ErrorObject>)> {
    agent.halt(&caller, ExecCommand::Pause)
}

/// In front of every handler: who is it, and may it come in?
async fn let_in(
    State(agent): State<Agent>,
    ConnectInfo(peer): ConnectInfo<SocketAddr>,
    mut request: Request<Body>,
    next: Next,
) -> Response {
    let headers = request.headers();
    let asked = Asked {
        peer: peer.ip(),
        host: text_of(headers, header::HOST),
        origin: text_of(headers, header::ORIGIN),
        token: text_of(headers, header::AUTHORIZATION)
            .map(|value| value.strip_prefix("Bearer ").unwrap_or("")),
    };
    match agent.access.role(&asked) {
        Ok(role) => {
            request.extensions_mut().insert(Caller { role, peer });
            let mut response = next.run(request).await;
            let headers = response.headers_mut();
            headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
            headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
            headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
            response
        }
        Err(refusal) => {
            let path = request.uri().path().to_owned();
            agent.note(
                "refused",
                json!({ "from": peer.to_string(), "path": path, "why": refusal.to_string() }),
            );
            refusal.into_response()
        }
    }
}

fn text_of(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    // One that is no text is there, and is nobody's.
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let (status, next) = match &self {
            Self::Host(_) => (StatusCode::FORBIDDEN, "use the address that the agent printed"),
            Self::Origin(_) => (StatusCode::FORBIDDEN, "open the agent's own page"),
            Self::WrongToken => (StatusCode::UNAUTHORIZED, "take the token from the agent's token file"),
            Self::NoToken => (StatusCode::UNAUTHORIZED, "take a token from the agent's token file"),
            Self::TooManyWrong => (StatusCode::TOO_MANY_REQUESTS, "wait a minute"),
        };
        let object =
            ErrorObject { code: "not-let-in".into(), message: self.to_string(), next: next.to_owned() };
        (status, Json(object)).into_response()
    }
}
