//! Access check that every request passes before its handler runs.
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};

use axum::body::Body;
use axum::extract::rejection::ExtensionRejection;
use axum::extract::{ConnectInfo, FromRequestParts, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde_json::json;

use crate::access::{self, Access, Entry, Refusal, Role, halts, looks};
use crate::api::Problem;
use crate::cut::cut;
use crate::lease::key_of;
use crate::log::CommandLog;
use crate::pages::SHOWN_TO;
use crate::problem::Denial;

/// Prefix of the token in the protocol list of a WebSocket.
const BEARER: &str = "bearer.";
/// Header in which a browser states the relation of a page to the address of the page's request.
const SITE: HeaderName = HeaderName::from_static("sec-fetch-site");
/// Longest name of a client, in characters.
const NAME_MAX: usize = 64;

/// Access rules, with the log of refused requests.
#[derive(Clone)]
pub struct Gate {
    access: Arc<Access>,
    log: Arc<Mutex<CommandLog>>,
}

impl Gate {
    /// Creates a gate with the access rules `access`.
    pub fn new(access: Access, log: Arc<Mutex<CommandLog>>) -> Self {
        Self { access: Arc::new(access), log }
    }

    /// Checks that a request uses a name of this agent and that no page of another site sent the request. Does not
    /// check the permissions of the client.
    ///
    /// # Errors
    ///
    /// [`Refusal::Host`] or [`Refusal::Origin`].
    pub fn is_own(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let (host, origin) = (text_of(headers, header::HOST), text_of(headers, header::ORIGIN));
        self.access.is_own(host, origin)
    }

    /// Writes a line to the command log.
    pub fn note(&self, what: &str, facts: serde_json::Value) {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).write(what, facts);
    }

    /// Writes a line to the command log about a client address that can cause many lines. The first lines of an
    /// address are written in full; its later lines are only counted.
    pub fn note_repeated(&self, what: &'static str, from: SocketAddr, facts: serde_json::Value) {
        let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        log.write_repeated(what, &from.ip().to_string(), facts);
    }

    /// Returns the number of lines that the command log has lost.
    pub fn lost_lines(&self) -> u64 {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).lost_in_all()
    }
}

/// Client that sends a request.
#[derive(Clone, Debug)]
pub struct Caller {
    /// Role of the client.
    pub role: Role,
    /// `true` for a page of an origin with read-only access.
    pub looks_only: bool,
    /// Network address of the client.
    pub peer: SocketAddr,
}

/// Client that sends a request, and the lease key in the request, if any.
#[derive(Clone, Debug)]
pub struct Asker {
    /// Client that sends the request.
    pub caller: Caller,
    key: Option<Box<str>>,
}

impl Asker {
    /// Returns the lease key that the request contains.
    pub fn key(&self) -> Option<&str> {
        self.key.as_deref()
    }
}

impl From<Caller> for Asker {
    /// Returns the client without a lease key.
    fn from(caller: Caller) -> Self {
        Self { caller, key: None }
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Asker {
    type Rejection = ExtensionRejection;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ExtensionRejection> {
        let Extension(caller) = Extension::from_request_parts(parts, state).await?;
        Ok(Self { caller, key: key_of(&parts.headers).map(Into::into) })
    }
}

/// Returns a client's name without control characters and marks of the text direction, at most 64 characters long.
pub fn plain(name: &str) -> String {
    name.chars().filter(|c| !host_kit::is_hidden(*c)).take(NAME_MAX).collect()
}

impl Caller {
    /// Checks that the client has the role operator. An operator can send commands while it holds the lease.
    ///
    /// # Errors
    ///
    /// The client is a viewer: it may only read and stop.
    pub fn operator(&self) -> Result<(), Problem> {
        match self.role {
            Role::Operator => Ok(()),
            Role::Viewer => Err(Problem::new(
                "denied",
                "this client can only read and stop: commands need the operator's token",
                "use the operator's token",
            )
            .forbidden()),
        }
    }

    /// Returns the name to display for a client, or its address if the name is empty.
    pub fn named(&self, name: &str) -> String {
        let name = plain(name);
        if name.is_empty() { self.peer.to_string() } else { name }
    }
}

/// Middleware in front of every handler: identifies the client and refuses requests that the access rules do not
/// allow.
pub async fn let_in(
    State(gate): State<Gate>,
    ConnectInfo(peer): ConnectInfo<SocketAddr>,
    mut request: Request<Body>,
    next: Next,
) -> Response {
    let headers = request.headers();
    let preflight = request.method() == Method::OPTIONS;
    let method = if preflight { headers.get(header::ACCESS_CONTROL_REQUEST_METHOD) } else { None };
    let method = method.and_then(|method| method.to_str().ok()).unwrap_or(request.method().as_str());
    let address_token = address_token(headers, request.uri());
    let asked = access::Request {
        peer: peer.ip(),
        host: text_of(headers, header::HOST),
        origin: text_of(headers, header::ORIGIN),
        site: text_of(headers, SITE),
        token: text_of(headers, header::AUTHORIZATION).map(bearer_token).or_else(|| protocol_token(headers)),
        address_token: address_token.as_deref(),
        looks: looks(method, request.uri().path()),
        halts: halts(method, request.uri().path()),
    };
    // A browser sends a preflight request without a token, to check whether its page may send the actual request.
    let origin = headers.get(header::ORIGIN).cloned();
    if preflight && gate.access.is_foreign(&asked) == Ok(true) {
        return may_read(StatusCode::NO_CONTENT.into_response(), origin);
    }
    match gate.access.enter(&asked) {
        Ok(Entry { role, looks_only }) => {
            request.extensions_mut().insert(Caller { role, looks_only, peer });
            let command = (!request.method().is_safe()).then(|| line_of(&request));
            let response = next.run(request).await;
            if let Some((asked, Denial { code, why })) = command.zip(response.extensions().get()) {
                let facts = json!({ "from": peer.to_string(), "asked": asked, "code": code, "why": why });
                match role {
                    Role::Operator => gate.note("denied", facts),
                    Role::Viewer => gate.note_repeated("denied", peer, facts),
                }
            }
            let mut response = if looks_only { may_read(response, origin) } else { response };
            let headers = response.headers_mut();
            let shown_to = if looks_only { "cross-origin" } else { "same-origin" };
            headers.insert(SHOWN_TO, HeaderValue::from_static(shown_to));
            headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
            headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
            headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
            response
        }
        Err(refusal) => {
            let path = cut(request.uri().path());
            let facts = json!({ "from": peer.to_string(), "path": path, "why": refusal.to_string() });
            gate.note_repeated("refused", peer, facts);
            refusal.into_response()
        }
    }
}

/// Returns the method and the path of a request, without the query.
fn line_of(request: &Request<Body>) -> String {
    format!("{} {}", cut(request.method().as_str()), cut(request.uri().path()))
}

/// Middleware after [`let_in`]: refuses commands of clients without permission to send commands. The command is
/// refused before its body is read, so that a client that sends its body slowly does not keep the agent busy.
pub async fn may_command(request: Request<Body>, next: Next) -> Response {
    let (method, path) = (request.method(), request.uri().path());
    let commands = !method.is_safe() && !halts(method.as_str(), path);
    let refused = request.extensions().get::<Caller>().filter(|_| commands).map(Caller::operator);
    match refused {
        Some(Err(problem)) => problem.into_response(),
        _ => next.run(request).await,
    }
}

/// Returns the token of the header `Authorization: Bearer TOKEN`; the scheme is not case-sensitive (RFC 9110, 11.1).
/// Returns an empty text for a header of any other form; an empty text is never a valid token.
fn bearer_token(value: &str) -> &str {
    match value.split_once(' ') {
        Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => token.trim(),
        _ => "",
    }
}

/// Adds the headers that permit a page of `origin` to read the response.
fn may_read(mut response: Response, origin: Option<HeaderValue>) -> Response {
    let headers = response.headers_mut();
    if let Some(origin) = origin {
        headers.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
    }
    headers.insert(header::ACCESS_CONTROL_ALLOW_METHODS, HeaderValue::from_static("GET"));
    headers.insert(header::ACCESS_CONTROL_ALLOW_HEADERS, HeaderValue::from_static("Authorization"));
    headers.insert(header::VARY, HeaderValue::from_static("Origin"));
    response
}

/// Token in the query of a URL.
#[derive(serde::Deserialize)]
struct InAddress {
    token: Option<String>,
}

/// Returns the token in the URL of a WebSocket request, for clients that cannot send headers.
fn address_token(headers: &HeaderMap, uri: &Uri) -> Option<String> {
    let socket = headers.contains_key(header::SEC_WEBSOCKET_KEY);
    let looks = ["/", "/api/foxglove", "/api/stream"].contains(&uri.path());
    let asked = Query::<InAddress>::try_from_uri(uri).ok().filter(|_| socket && looks);
    asked.and_then(|Query(asked)| asked.token)
}

/// Returns the token in the protocol list of a WebSocket that a web page opens. A page in a browser can set only
/// this header of a WebSocket, and browsers do not store the header in a history.
fn protocol_token(headers: &HeaderMap) -> Option<&str> {
    let protocols = text_of(headers, header::SEC_WEBSOCKET_PROTOCOL)?;
    protocols.split(',').find_map(|name| name.trim().strip_prefix(BEARER))
}

fn text_of(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    // If a header exists but is not valid text, its value is read as "?", which is never a valid value. The header is
    // therefore not treated as missing.
    headers.get(name).map(|value| value.to_str().unwrap_or("?"))
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let (status, next) = match &self {
            Self::Host(_) => (StatusCode::FORBIDDEN, "use the address that the agent printed"),
            Self::Origin(_) => (StatusCode::FORBIDDEN, "open the page at the agent's own address"),
            Self::InAddress => (
                StatusCode::FORBIDDEN,
                "use the viewer's token in the address, or send the operator's token in the header \
                 Authorization",
            ),
            Self::WrongToken => (StatusCode::UNAUTHORIZED, "send the token from the agent's token file"),
            Self::NoToken => (StatusCode::UNAUTHORIZED, "send a token from the agent's token file"),
            Self::TooManyWrong => (StatusCode::TOO_MANY_REQUESTS, "wait a minute"),
        };
        (status, Json(Problem::new("not-let-in", self.to_string(), next))).into_response()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scheme_of_a_token_has_no_case() {
        for scheme in ["Bearer", "bearer", "BEARER", "bEaReR"] {
            assert_eq!(bearer_token(&format!("{scheme} abc")), "abc");
            assert_eq!(bearer_token(&format!("{scheme}   abc ")), "abc");
            assert_eq!(bearer_token(scheme), "");
            assert_eq!(bearer_token(&format!("{scheme} ")), "");
        }
        for value in
            ["", "abc", "Basic abc", "Bearerabc", "Bearer\tabc", "bearer.abc", "Token abc", " Bearer abc"]
        {
            assert_eq!(bearer_token(value), "", "{value:?}");
        }
    }
}
