//! Why something was not done: one object, whatever it was.
use std::borrow::Cow;

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use host_kit::{Diagnose, Diagnosis, ErrorKind};
use serde::Serialize;

use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::openapi::{Object, RefOr};
use utoipa::{PartialSchema, ToSchema};

use crate::cut::cut_middle;

/// Why something was not done, with the facts that an agent adds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProblemWith<F> {
    /// Short name, for programs.
    pub code: &'static str,
    /// What was wrong, for people.
    pub message: Box<str>,
    /// What an agent knows of it beside that.
    #[serde(flatten)]
    pub facts: F,
    /// What helps.
    pub next: Box<str>,
    #[serde(skip)]
    status: StatusCode,
}

/// Why something was not done.
pub type Problem = ProblemWith<Bounds>;

/// What every agent can say of an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, ToSchema)]
pub struct Bounds {
    /// What was found, in the unit of the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// What is allowed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
}

/// What an agent knows of an error beside what every agent does.
pub trait Facts: Default + From<Bounds> {
    /// The error of its library.
    type Error: Diagnose;

    /// What is known of it.
    fn of(error: &Self::Error) -> Self;
}

impl<F: Default> ProblemWith<F> {
    /// Something that was refused, with what helps.
    pub fn new(code: &'static str, message: impl Into<String>, next: impl Into<String>) -> Self {
        let (message, next) = (message.into().into(), next.into().into());
        Self { code, message, facts: F::default(), next, status: StatusCode::CONFLICT }
    }

    /// An error that knows what helps.
    pub fn diagnosed(error: &impl Diagnose) -> Self {
        let Diagnosis { kind, code, next } = error.diagnosis();
        // Marks of code in the texts for terminals.
        Self::new(code, error.to_string(), next.replace('`', "")).kind(kind)
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
        Self { next: next.into().into(), ..self }
    }

    /// With these facts.
    pub fn with(self, facts: impl Into<F>) -> Self {
        Self { facts: facts.into(), ..self }
    }

    /// Who asks may not ask for that, whatever goes on.
    pub fn forbidden(self) -> Self {
        Self { status: StatusCode::FORBIDDEN, ..self }
    }

    /// The request itself is wrong.
    pub fn unreadable(self) -> Self {
        Self { status: StatusCode::BAD_REQUEST, ..self }
    }
}

impl<F: Facts> ProblemWith<F> {
    /// An error of the agent's library, with all that it knows.
    pub fn of(error: &F::Error) -> Self {
        Self::diagnosed(error).with(F::of(error))
    }
}

impl<F: Facts> From<Problem> for ProblemWith<F> {
    fn from(problem: Problem) -> Self {
        let Problem { code, message, facts, next, status } = problem;
        Self { code, message, facts: F::from(facts), next, status }
    }
}

impl<F: Serialize> IntoResponse for ProblemWith<F> {
    fn into_response(self) -> Response {
        let denial = Denial { code: self.code, why: self.message.clone() };
        let mut response = (self.status, Json(self)).into_response();
        response.extensions_mut().insert(denial);
        response
    }
}

/// A response is a [`ProblemWith`]: for whoever writes down what was not done.
#[derive(Clone, Debug)]
pub(crate) struct Denial {
    pub code: &'static str,
    pub why: Box<str>,
}

impl<F: PartialSchema> PartialSchema for ProblemWith<F> {
    fn schema() -> RefOr<Schema> {
        let text = |what: &str| ObjectBuilder::new().schema_type(Type::String).description(Some(what));
        let mut object: Object = ObjectBuilder::new()
            .description(Some("Why something was not done."))
            .property("code", text("Short name, for programs."))
            .property("message", text("What was wrong, for people."))
            .property("next", text("What helps."))
            .required("code")
            .required("message")
            .required("next")
            .build();
        if let RefOr::T(Schema::Object(facts)) = F::schema() {
            object.properties.extend(facts.properties);
        }
        object.into()
    }
}

impl<F: PartialSchema> ToSchema for ProblemWith<F> {
    fn name() -> Cow<'static, str> {
        "ErrorObject".into()
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
