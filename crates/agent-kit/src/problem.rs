//! Why something was not done: one object, whatever it was.
use std::borrow::Cow;
use std::ops::Deref;

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use host_kit::{Diagnose, ErrorKind, Facts, Failure, FrontEnd, Next};
use serde::{Serialize, Serializer};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::Schema;
use utoipa::{PartialSchema, ToSchema};

use crate::cut::cut_middle;

/// Why something was not done, as an agent answers it.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    failure: Failure,
    status: StatusCode,
}

impl Problem {
    /// Something that was refused, with what helps.
    pub fn new(code: &'static str, message: impl Into<String>, next: impl Into<Next>) -> Self {
        let failure = Failure::new(ErrorKind::Refused, code, message.into()).next(next);
        Self { failure, status: StatusCode::CONFLICT }
    }

    /// An error of a library, with all that it knows.
    pub fn of(error: &impl Diagnose) -> Self {
        Failure::of(error).into()
    }

    /// What was sent cannot be read; the message may have parts of it.
    pub fn rejected(status: StatusCode, message: impl AsRef<str>) -> Self {
        let message = cut_middle(message.as_ref());
        Self { status, ..Self::new("request", message, "GET /openapi.json describes each request") }
    }

    /// There is nothing of this number.
    pub fn nothing(what: &str, number: impl std::fmt::Display, list: &str) -> Self {
        let next = format!("GET {list} lists what there is");
        let problem = Self::new("not-found", format!("there is no {what} {number}"), next);
        Self { status: StatusCode::NOT_FOUND, ..problem }
    }

    /// Sets the kind, and the status that belongs to it.
    pub fn kind(self, kind: ErrorKind) -> Self {
        Failure { kind, ..self.failure }.into()
    }

    /// In these words.
    pub fn message(self, message: impl Into<String>) -> Self {
        Self { failure: Failure { message: message.into(), ..self.failure }, ..self }
    }

    /// With this that helps.
    pub fn next(self, next: impl Into<Next>) -> Self {
        Self { failure: self.failure.next(next), ..self }
    }

    /// With these facts.
    pub fn with(self, facts: Facts) -> Self {
        Self { failure: self.failure.with(facts), ..self }
    }

    /// Sets the status 403: the client may never do that.
    pub fn forbidden(self) -> Self {
        Self { status: StatusCode::FORBIDDEN, ..self }
    }

    /// Sets the status 400: the request itself is wrong.
    pub fn unreadable(self) -> Self {
        Self { status: StatusCode::BAD_REQUEST, ..self }
    }
}

impl Deref for Problem {
    type Target = Failure;

    fn deref(&self) -> &Failure {
        &self.failure
    }
}

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        Self { status: status(failure.kind), failure }
    }
}

impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        ErrorObject::from(&self.failure).serialize(serializer)
    }
}

/// Why something was not done.
#[derive(Serialize, ToSchema)]
struct ErrorObject<'a> {
    /// Short name, for programs.
    code: &'a str,
    /// Sentence for people: request, place, value and limit.
    message: &'a str,
    /// Board of a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<u8>,
    /// Joint of an arm, 1 to 6 from the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint: Option<u8>,
    /// Point of the trajectory, from 0; in motion the 1 ms point.
    #[serde(skip_serializing_if = "Option::is_none")]
    point: Option<u32>,
    /// Value that was found, in the unit of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
    /// Limit of the value.
    #[serde(skip_serializing_if = "Option::is_none")]
    limit: Option<f64>,
    /// Usual cause.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    cause: Option<&'static str>,
    /// Next step.
    next: String,
}

impl<'a> From<&'a Failure> for ErrorObject<'a> {
    fn from(failure: &'a Failure) -> Self {
        // JSON has no word for what is no number.
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let Facts { board, joint, point, value, limit, cause, .. } = *failure.facts;
        Self {
            code: failure.code,
            message: &failure.message,
            board,
            joint,
            point,
            value: finite(value),
            limit: finite(limit),
            cause,
            // Marks of code in the texts for terminals.
            next: failure.next.plain(FrontEnd::Agent),
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let denial = Denial { code: self.code, why: self.message.as_str().into() };
        let mut response = (self.status, Json(self)).into_response();
        response.extensions_mut().insert(denial);
        response
    }
}

/// A response is a [`Problem`]: for whoever writes down what was not done.
#[derive(Clone, Debug)]
pub(crate) struct Denial {
    pub code: &'static str,
    pub why: Box<str>,
}

impl PartialSchema for Problem {
    fn schema() -> RefOr<Schema> {
        ErrorObject::schema()
    }
}

impl ToSchema for Problem {
    fn name() -> Cow<'static, str> {
        ErrorObject::name()
    }
}

/// The status of a response about an error of this kind.
fn status(kind: ErrorKind) -> StatusCode {
    match kind {
        ErrorKind::Usage => StatusCode::UNPROCESSABLE_ENTITY,
        ErrorKind::Refused | ErrorKind::Device => StatusCode::CONFLICT,
        ErrorKind::NoLink => StatusCode::SERVICE_UNAVAILABLE,
        ErrorKind::Fault => StatusCode::INTERNAL_SERVER_ERROR,
    }
}
