//! Errors that the API returns, all as objects of one type.
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
                "find the lease holder with GET /api/status, and request the lease with POST /api/lease and \
                 ask: true"
            }
            Denied::Awaited { .. } => {
                "request the lease again after that client has had it: GET /api/status shows the lease holder"
            }
            Denied::Viewer => "use the operator's token",
            Denied::Stopped { .. } => "wait 3 s, and send the request again when the arm may move",
            Denied::Unattended { .. } => {
                "send the request again when the arm is at rest; the agent always sends a Stop or a Pause"
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
                let message = format!("{what} of this client is still running: only one can run at a time");
                Self::new(
                    "busy",
                    message,
                    "wait until it has ended; a Stop ends a motion, and speed and resume apply to the \
                     running motion",
                )
            }
            Unable::Gone => Self::new(
                "gone",
                "the connection to the controller is lost, or the agent disconnected this client",
                "check with GET /api/status that the controller answers, then take the lease again",
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
