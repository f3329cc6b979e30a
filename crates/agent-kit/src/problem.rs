//! Error object that the APIs of all agents return.
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

/// Error in the form in which an agent returns it.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    failure: Failure,
    status: StatusCode,
}

impl Problem {
    /// Creates a refusal with the next step for the user.
    pub fn new(code: &'static str, message: impl Into<String>, next: impl Into<Next>) -> Self {
        let failure = Failure::new(ErrorKind::Refused, code, message.into()).next(next);
        Self { failure, status: StatusCode::CONFLICT }
    }

    /// Creates a problem with all details of a library's error.
    pub fn of(error: &impl Diagnose) -> Self {
        Failure::of(error).into()
    }

    /// Creates a problem for a request that cannot be read; the message may contain parts of the request.
    pub fn rejected(status: StatusCode, message: impl AsRef<str>) -> Self {
        let message = cut_middle(message.as_ref());
        Self { status, ..Self::new("request", message, "GET /openapi.json describes each request") }
    }

    /// Creates a problem for an object that does not exist; the message contains the number of the
    /// object.
    pub fn nothing(what: &str, number: impl std::fmt::Display, list: &str) -> Self {
        let next = format!("list the existing entries with GET {list}");
        let problem = Self::new("not-found", format!("there is no {what} {number}"), next);
        Self { status: StatusCode::NOT_FOUND, ..problem }
    }

    /// Sets the kind of the error, and the HTTP status that belongs to this kind.
    pub fn kind(self, kind: ErrorKind) -> Self {
        Failure { kind, ..self.failure }.into()
    }

    /// Sets the message of the problem.
    pub fn message(self, message: impl Into<String>) -> Self {
        Self { failure: Failure { message: message.into(), ..self.failure }, ..self }
    }

    /// Sets the next step for the user.
    pub fn next(self, next: impl Into<Next>) -> Self {
        Self { failure: self.failure.next(next), ..self }
    }

    /// Sets the details of the problem: joint, board or point, value and limit.
    pub fn with(self, facts: Facts) -> Self {
        Self { failure: self.failure.with(facts), ..self }
    }

    /// Sets the HTTP status 403: the client has no permission for this request.
    pub fn forbidden(self) -> Self {
        Self { status: StatusCode::FORBIDDEN, ..self }
    }

    /// Sets the HTTP status 400: the request itself is wrong.
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

/// Reason why a request was refused or failed.
#[derive(Serialize, ToSchema)]
struct ErrorObject<'a> {
    /// Short name of the error, for programs.
    code: &'a str,
    /// Message for people. As far as they apply, it contains the request, the joint, board or point, the value and
    /// the limit.
    message: &'a str,
    /// Number of a board of a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<u8>,
    /// Number of a joint of an arm, 1 to 6 from the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint: Option<u8>,
    /// Index of a point of the trajectory, from 0; during a motion, index of the 1 ms point.
    #[serde(skip_serializing_if = "Option::is_none")]
    point: Option<u32>,
    /// Measured or requested value, in the unit of the message.
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
        // JSON cannot represent infinite numbers or NaN.
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
            // Backticks mark code in terminal texts; the next step in the API does not contain them.
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

/// Marks a response that is a [`Problem`], so that refused commands can be logged.
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

/// Returns the HTTP status for an error of this kind.
fn status(kind: ErrorKind) -> StatusCode {
    match kind {
        ErrorKind::Usage => StatusCode::UNPROCESSABLE_ENTITY,
        ErrorKind::Refused | ErrorKind::Device => StatusCode::CONFLICT,
        ErrorKind::NoLink => StatusCode::SERVICE_UNAVAILABLE,
        ErrorKind::Fault => StatusCode::INTERNAL_SERVER_ERROR,
    }
}
