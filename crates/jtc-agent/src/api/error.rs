//! What the API sends where something is not done: one object, whatever it was.
use std::collections::BTreeMap;

use agent_kit::api::{self, Bounds, ProblemWith};
use agent_kit::openapi::denials;
use jtc_host::error::Facts;
use jtc_host::{Error, ErrorKind};
use utoipa::openapi::{RefOr, Response};
use utoipa::{IntoResponses, ToSchema};

use crate::jobs::Unable;
use crate::line::Denied;

/// Why something was not done.
pub type ErrorObject = ProblemWith<FactsObject>;

/// What is known of an error of the arm or its line.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, ToSchema)]
pub struct FactsObject {
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
}

impl From<&Facts> for FactsObject {
    fn from(facts: &Facts) -> Self {
        // JSON has no word for what is no number.
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        Self {
            joint: facts.joint.map(|joint| joint.number()),
            point: facts.point,
            value: finite(facts.value),
            limit: finite(facts.limit),
            cause: facts.cause,
        }
    }
}

impl From<Bounds> for FactsObject {
    fn from(bounds: Bounds) -> Self {
        let Bounds { value, limit } = bounds;
        Self { value, limit, ..Self::default() }
    }
}

impl api::Facts for FactsObject {
    type Error = Error;

    fn of(error: &Error) -> Self {
        Self::from(&error.facts())
    }
}

impl From<Denied> for ErrorObject {
    fn from(denied: Denied) -> Self {
        let next = match &denied {
            Denied::Held { .. } => {
                "GET /api/status shows who commands; ask for the lease with POST /api/lease and ask: true"
            }
            Denied::Awaited { .. } => "ask again when that one has had the lease: GET /api/status shows it",
            Denied::Viewer => "use the operator's token",
            Denied::Stopped { .. } => "wait three seconds, and ask again when the arm may move",
            Denied::Unattended { .. } => {
                "ask again when the arm stands; a Stop or a Pause is always passed on"
            }
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

/// What a command may be refused with beside what every request may.
pub(super) struct Denials;

impl IntoResponses for Denials {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        denials(
            "Refused: another client commands, something else is going on, a check or the controller forbids it",
            "The port is gone, or the controller is silent",
        )
    }
}
