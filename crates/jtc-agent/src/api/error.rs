//! What the API sends where something is not done: one object, whatever it was.
use agent_kit::api::{Problem, status};
use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use jtc_host::error::Facts;
use jtc_host::{Diagnose, Diagnosis, Error, ErrorKind};
use utoipa::{IntoResponses, ToSchema};

use crate::jobs::Unable;
use crate::line::Denied;

/// Why something was not done.
#[derive(Clone, Debug, PartialEq, serde::Serialize, ToSchema)]
pub struct ErrorObject {
    /// Short name, for programs.
    #[schema(value_type = String)]
    pub code: &'static str,
    /// What was wrong, for people.
    #[schema(value_type = String)]
    pub message: Box<str>,
    /// Which joint, 1 to 6 from the base.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub joint: Option<u8>,
    /// Which point of the trajectory, from 0; in motion the 1 ms point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<u32>,
    /// What was found, in the unit of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// What is allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// What usually causes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<String>)]
    pub cause: Option<&'static str>,
    /// What helps.
    pub next: String,
    #[serde(skip)]
    #[schema(ignore)]
    status: StatusCode,
}

impl ErrorObject {
    /// Something that was refused, with what helps.
    pub fn new(code: &'static str, message: impl Into<String>, next: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into().into(),
            joint: None,
            point: None,
            value: None,
            limit: None,
            cause: None,
            next: next.into(),
            status: StatusCode::CONFLICT,
        }
    }

    /// Of this kind.
    pub fn kind(self, kind: ErrorKind) -> Self {
        Self { status: status(kind), ..self }
    }

    /// In these words.
    pub fn message(self, message: impl Into<String>) -> Self {
        Self { message: message.into().into(), ..self }
    }

    /// With this that helps.
    pub fn next(self, next: impl Into<String>) -> Self {
        Self { next: next.into(), ..self }
    }

    /// An error that knows what helps.
    pub fn diagnosed(error: &impl Diagnose) -> Self {
        let Diagnosis { kind, code, next } = error.diagnosis();
        // Marks of code in the texts for terminals.
        Self::new(code, error.to_string(), next.replace('`', "")).kind(kind)
    }

    /// An error of the library, with all that it knows.
    pub fn of(error: &Error) -> Self {
        Self::diagnosed(error).with(&error.facts())
    }

    /// Who asks may not ask for that, whatever goes on.
    pub(super) fn forbidden(self) -> Self {
        Self { status: StatusCode::FORBIDDEN, ..self }
    }

    /// What was sent cannot be read.
    pub(super) fn rejected(status: StatusCode, message: String) -> Self {
        Self { status, ..Self::new("request", message, "GET /openapi.json describes each request") }
    }

    /// The request itself is wrong.
    pub(super) fn unreadable(self) -> Self {
        Self { status: StatusCode::BAD_REQUEST, ..self }
    }

    /// With joint, point, value, limit and cause.
    pub fn with(self, facts: &Facts) -> Self {
        // JSON has no word for what is no number.
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        Self {
            joint: facts.joint.map(|joint| joint.number()),
            point: facts.point,
            value: finite(facts.value),
            limit: finite(facts.limit),
            cause: facts.cause,
            ..self
        }
    }

    /// There is nothing of this number.
    pub(super) fn nothing(what: &str, number: impl std::fmt::Display, list: &str) -> Self {
        let next = format!("GET {list} lists what there is");
        let object = Self::new("not-found", format!("there is no {what} {number}"), next);
        Self { status: StatusCode::NOT_FOUND, ..object }
    }
}

impl IntoResponse for ErrorObject {
    fn into_response(self) -> Response {
        (self.status, Json(self)).into_response()
    }
}

impl From<Error> for ErrorObject {
    fn from(error: Error) -> Self {
        Self::of(&error)
    }
}

impl From<Problem> for ErrorObject {
    fn from(problem: Problem) -> Self {
        let status = problem.status();
        Self { status, ..Self::new(problem.code, problem.message, problem.next) }
    }
}

impl From<Denied> for ErrorObject {
    fn from(denied: Denied) -> Self {
        let next = match &denied {
            Denied::Held { .. } => {
                "GET /api/status shows who commands; ask for the lease with POST /api/lease and ask: true"
            }
            Denied::Viewer => "use the operator's token",
            Denied::Stopped { .. } => "wait three seconds, and ask again when the arm may move",
            Denied::Gone => "take the lease with POST /api/lease",
            Denied::NotHolder => "take the lease with POST /api/lease",
        };
        let object = Self::new("denied", denied.to_string(), next);
        if denied == Denied::Viewer { object.forbidden() } else { object }
    }
}

impl From<Unable> for ErrorObject {
    fn from(unable: Unable) -> Self {
        match unable {
            Unable::Busy(job) => {
                let what = job.map_or("another command".into(), |job| format!("job {job}"));
                let message = format!("{what} of this client is going on: one thing at a time");
                Self::new(
                    "busy",
                    message,
                    "wait until it is over; a Stop ends a motion, and speed and resume are for the one that goes on",
                )
            }
            Unable::Gone => Self::new(
                "gone",
                "the line is gone, or this client was put out",
                "GET /api/status shows whether the controller is there; take the lease again",
            )
            .kind(ErrorKind::NoLink),
        }
    }
}

/// What a command may be refused with beside that.
#[derive(IntoResponses)]
#[expect(dead_code, reason = "describes responses")]
pub(super) enum Denials {
    /// Refused: another client commands, something else is going on, a check or the controller forbids it
    #[response(status = 409)]
    Denied(ErrorObject),
    /// More than may be sent at once
    #[response(status = 413)]
    TooLarge(ErrorObject),
    /// The body is no JSON
    #[response(status = 415)]
    NoJson(ErrorObject),
    /// What was asked for is none
    #[response(status = 422)]
    Invalid(ErrorObject),
    /// Something went wrong on the way
    #[response(status = 500)]
    Fault(ErrorObject),
    /// The port is gone, or the controller is silent
    #[response(status = 503)]
    Lost(ErrorObject),
}
