//! What the APIs of agents share: errors, what is read of a request, and who is in front of every handler.
use axum::Json;
use axum::extract::rejection::{JsonRejection, PathRejection, QueryRejection};
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::StatusCode;
use axum::http::request::Parts;
use axum::response::{IntoResponse, Response};
use host_kit::{Diagnose, Diagnosis, ErrorKind};
use utoipa::{IntoResponses, ToSchema};

/// Why something was not done.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
#[schema(as = ErrorObject)]
pub struct Problem {
    /// Short name, for programs.
    #[schema(value_type = String)]
    pub code: &'static str,
    /// What was wrong, for people.
    #[schema(value_type = String)]
    pub message: Box<str>,
    /// What helps.
    pub next: String,
    #[serde(skip)]
    #[schema(ignore)]
    status: StatusCode,
}

impl Problem {
    /// Something that was refused, with what helps.
    pub fn new(code: &'static str, message: impl Into<String>, next: impl Into<String>) -> Self {
        Self { code, message: message.into().into(), next: next.into(), status: StatusCode::CONFLICT }
    }

    /// An error that knows what helps.
    pub fn diagnosed(error: &impl Diagnose) -> Self {
        let Diagnosis { kind, code, next } = error.diagnosis();
        // Marks of code in the texts for terminals.
        Self::new(code, error.to_string(), next.replace('`', "")).kind(kind)
    }

    /// Of this kind.
    pub fn kind(self, kind: ErrorKind) -> Self {
        Self { status: status(kind), ..self }
    }

    /// Who asks may not ask for that, whatever goes on.
    pub fn forbidden(self) -> Self {
        Self { status: StatusCode::FORBIDDEN, ..self }
    }

    /// The request itself is wrong.
    pub fn unreadable(self) -> Self {
        Self { status: StatusCode::BAD_REQUEST, ..self }
    }

    /// There is nothing of this number.
    pub fn nothing(what: &str, number: impl std::fmt::Display, list: &str) -> Self {
        let next = format!("GET {list} lists what there is");
        Self {
            status: StatusCode::NOT_FOUND,
            ..Self::new("not-found", format!("there is no {what} {number}"), next)
        }
    }

    /// The status of the response that it is.
    pub fn status(&self) -> StatusCode {
        self.status
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        (self.status, Json(self)).into_response()
    }
}

/// The status of a response about an error of this kind.
pub fn status(kind: ErrorKind) -> StatusCode {
    match kind {
        ErrorKind::Usage => StatusCode::UNPROCESSABLE_ENTITY,
        ErrorKind::Refused | ErrorKind::Device => StatusCode::CONFLICT,
        ErrorKind::NoLink => StatusCode::SERVICE_UNAVAILABLE,
        ErrorKind::Fault => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

/// What every request may be refused with.
#[derive(IntoResponses)]
pub enum Refusals {
    /// What was asked cannot be read
    #[response(status = 400)]
    Unreadable(Problem),
    /// The token is missing or none of this agent's
    #[response(status = 401)]
    Token(Problem),
    /// The request comes from a page of another site, asks for another name, or has neither token nor lease for what it asks
    #[response(status = 403)]
    Elsewhere(Problem),
    /// The request takes too long, or more than it may
    #[response(status = 408)]
    Slow,
    /// Too many wrong tokens came
    #[response(status = 429)]
    Wrong(Problem),
}

fn unreadable(status: StatusCode, message: String) -> Problem {
    Problem { status, ..Problem::new("request", message, "GET /openapi.json describes each request") }
}

/// A body of JSON.
pub struct Body<T>(pub T);

impl<T, S: Send + Sync> FromRequest<S> for Body<T>
where
    Json<T>: FromRequest<S, Rejection = JsonRejection>,
{
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<Self, Problem> {
        let Json(body) =
            Json::from_request(request, state).await.map_err(|e| unreadable(e.status(), e.body_text()))?;
        Ok(Self(body))
    }
}

/// What stands behind the question mark.
pub struct Asked<T>(pub T);

impl<T, S: Send + Sync> FromRequestParts<S> for Asked<T>
where
    Query<T>: FromRequestParts<S, Rejection = QueryRejection>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let asked = Query::from_request_parts(parts, state).await;
        let Query(asked) = asked.map_err(|e| unreadable(e.status(), e.body_text()))?;
        Ok(Self(asked))
    }
}

/// A number in the path.
pub struct Number<T>(pub T);

impl<T, S: Send + Sync> FromRequestParts<S> for Number<T>
where
    Path<T>: FromRequestParts<S, Rejection = PathRejection>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path = Path::from_request_parts(parts, state).await;
        let Path(number) = path.map_err(|e| unreadable(e.status(), e.body_text()))?;
        Ok(Self(number))
    }
}
