//! Error answers of the API. All errors use one type of object.
use std::collections::BTreeMap;

use agent_kit::api::Problem;
use agent_kit::openapi::denials;
use jtc_host::ErrorKind;
use utoipa::IntoResponses;
use utoipa::openapi::{RefOr, Response};

use crate::jobs::Unable;
use crate::line::Denied;

impl From<Denied> for Problem {
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

impl From<Unable> for Problem {
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

/// Refusals of commands, in addition to the refusals that every request can receive.
pub(super) struct Denials;

impl IntoResponses for Denials {
    fn responses() -> BTreeMap<String, RefOr<Response>> {
        denials(
            "The request is refused: another client holds the lease, another request is running, or a check or \
             the controller refuses the request",
            "The port is lost, or the controller does not answer",
        )
    }
}
