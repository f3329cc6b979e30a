//! The way back to a held arm.
use agent_kit::api::{Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use jtc_host::{Arm, ErrorKind, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::Agent;
use super::arm::{in_words, taken};
use super::body::read;
use super::error::Denials;
use super::runs::JobObject;
use crate::jobs::{Numbers, Task, recover};
use crate::owner::ClientPort;

/// The way back to a held arm.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecoverRequest {
    /// Where the controller has not been given its arm: let it use its defaults, the stored arm where there is one.
    #[serde(default)]
    pub defaults: bool,
    /// The text of an arm file, or of a robot description: the controller is given its friction, gains and model. Not beside `defaults`.
    #[serde(default)]
    pub arm: Option<String>,
    /// The controller uses other limits than this arm has, and they are safe for it.
    #[serde(default)]
    pub accept_device_limits: bool,
}

impl RecoverRequest {
    /// Whose numbers a controller is given that misses some.
    fn numbers(self) -> Result<Numbers, Problem> {
        let Self { defaults, arm, accept_device_limits } = self;
        match arm {
            Some(_) if defaults => {
                let message = "arm and defaults name two sets of numbers; nothing was sent";
                Err(Problem::new("request", message, "name one").kind(ErrorKind::Usage))
            }
            Some(text) => Ok(Numbers::Arm(Box::new(whole(&text)?), accept_device_limits)),
            None if defaults => Ok(Numbers::Defaults),
            None => Ok(Numbers::None),
        }
    }
}

/// An arm that has all that a controller is given.
fn whole(text: &str) -> Result<Arm, Problem> {
    let arm = taken(text)?;
    let set = arm.parameter_set();
    let source = jtc_host::session::ParameterSource::Arm { name: &arm.name, set: &set };
    source.check().map_err(|error| Problem::of(&error))?;
    Ok(arm)
}

/// Leads the controller back to a held arm, whatever its state is: a job.
#[utoipa::path(
    post,
    path = "/api/recover",
    operation_id = "recover",
    params(LeaseKey, KnownHalt),
    request_body = RecoverRequest,
    responses((status = 202, description = "The job that does it", body = JobObject), Refusals, Denials)
)]
pub(super) async fn begin(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    request: Request,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // Nobody else's text is read.
    agent.commander(&asker)?;
    let numbers = read(&agent, request, RecoverRequest::numbers).await?;
    let (commander, turn) = agent.mover(&asker, after)?;
    let (what, hash) = match &numbers {
        Numbers::Arm(arm, _) => {
            (format!("recover with the arm {}", agent_kit::gate::plain(&arm.name)), arm.hash().ok().flatten())
        }
        Numbers::None | Numbers::Defaults => ("recover".to_owned(), None),
    };
    let recover = move |task: &Task<'_>, session: &mut Session<ClientPort>| recover(task, session, &numbers);
    let job = agent.jobs.begin(&commander, turn, what.clone(), recover)?;
    let hash = hash.map(in_words);
    agent.note("job", json!({ "client": commander.client.0, "job": job.number, "what": what, "hash": hash }));
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}
