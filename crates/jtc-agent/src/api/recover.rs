//! Requests that recover the arm to position hold.
use std::sync::Arc;

use agent_kit::api::{Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use jtc_host::session::RecoverParameters;
use jtc_host::{ErrorKind, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::Agent;
use super::arm::{in_words, taken};
use super::body::read;
use super::error::Denials;
use super::runs::JobObject;
use crate::jobs::{Task, recover};
use crate::owner::ClientPort;

/// Options of a recovery.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RecoverRequest {
    /// `true`: a controller without arm parameters uses its defaults. These are the parameters of the stored arm, or of
    /// the built-in arm if no arm is stored.
    #[serde(default)]
    pub defaults: bool,
    /// Text of an arm file or a robot description. The agent sends its friction, gains and model to the controller. Not
    /// possible together with `defaults`.
    #[serde(default)]
    pub arm: Option<String>,
    /// `true`: the limits of the controller are safe for this arm, although they differ from the limits of the file.
    #[serde(default)]
    pub accept_device_limits: bool,
}

impl RecoverRequest {
    /// Returns the source of the arm parameters, for a controller that lacks some of them.
    fn parameters(self) -> Result<RecoverParameters, Problem> {
        let Self { defaults, arm, accept_device_limits } = self;
        match arm {
            Some(_) if defaults => {
                let message =
                    "arm and defaults cannot be combined: each selects a set of parameters; nothing was sent";
                Err(Problem::new("request", message, "use only one of the two").kind(ErrorKind::Usage))
            }
            Some(text) => {
                let parameters =
                    RecoverParameters::Arm { arm: Arc::new(taken(&text)?), accept_device_limits };
                parameters.check().map_err(|error| Problem::of(&error))?;
                Ok(parameters)
            }
            None if defaults => Ok(RecoverParameters::ControllerDefaults),
            None => Ok(RecoverParameters::None),
        }
    }
}

/// Recovers the controller to position hold from any state, as a job.
#[utoipa::path(
    post,
    path = "/api/recover",
    operation_id = "recover",
    params(LeaseKey, KnownHalt),
    request_body = RecoverRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn begin(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    request: Request,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // The agent reads the request body only if the client holds the lease.
    agent.http_session(&asker)?;
    let parameters = read(&agent, request, RecoverRequest::parameters).await?;
    let (http_session, turn) = agent.mover(&asker, after)?;
    let (what, hash) = match &parameters {
        RecoverParameters::Arm { arm, .. } => {
            (format!("recover with the arm {}", agent_kit::gate::plain(&arm.name)), arm.hash().ok().flatten())
        }
        RecoverParameters::None | RecoverParameters::ControllerDefaults => ("recover".to_owned(), None),
    };
    let recover =
        move |task: &Task<'_>, session: &mut Session<ClientPort>| recover(task, session, &parameters);
    let job = agent.jobs.begin(&http_session, turn, what.clone(), recover)?;
    let hash = hash.map(in_words);
    agent.note(
        "job",
        json!({ "client": http_session.client.0, "job": job.number, "what": what, "hash": hash }),
    );
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}
