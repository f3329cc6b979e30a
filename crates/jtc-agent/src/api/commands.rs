//! Commands that are soon over, for who has the lease.
use agent_kit::api::{Body, Refusals};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::{Extension, Json};
use jtc_host::session::{Flow, ParameterSource, Payload};
use jtc_host::{Error, ErrorKind, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::error::Denials;
use super::objects::PayloadObject;
use super::runs::JobObject;
use super::{Agent, Caller, ErrorObject};
use crate::jobs::{Commander, Done, Turn};
use crate::owner::ClientPort;

/// Slowest speed, % (J-57).
const SPEED_MIN: u8 = 5;

/// % of the speed of the trajectory.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeedObject {
    /// 5 to 100.
    #[schema(minimum = 5, maximum = 100)]
    pub percent: u8,
}

/// On or off.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Switch {
    /// True: on.
    pub on: bool,
}

/// Rates of the joints.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct JogRequest {
    /// rad/s, base to wrist. They hold for 200 ms: send them again in time, and zeros at the end.
    #[schema(min_items = 6, max_items = 6)]
    pub rates_rad_s: [f64; 6],
}

/// The way back to a held arm.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecoverRequest {
    /// Where the controller has not been given its arm: let it use its defaults, the stored arm where there is one.
    #[serde(default)]
    pub defaults: bool,
}

impl Agent {
    /// Has the end of the line of the client that commands do something that moves nothing.
    async fn command<T, E>(
        &self,
        caller: &Caller,
        headers: &HeaderMap,
        what: &'static str,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, ErrorObject>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let commander = self.commander(caller, headers)?;
        let turn = commander.turn()?;
        self.act(&commander, turn, what, act).await
    }

    /// The same for what may move the arm.
    async fn motion<T, E>(
        &self,
        caller: &Caller,
        headers: &HeaderMap,
        what: &'static str,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, ErrorObject>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let (commander, turn) = self.mover(caller, headers)?;
        self.act(&commander, turn, what, act).await
    }

    /// Does it, and logs it whether or not somebody waits for the end of it.
    async fn act<T, E>(
        &self,
        commander: &Commander,
        turn: Turn,
        what: &'static str,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, ErrorObject>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let (agent, client) = (self.clone(), commander.client.0);
        let logged = move |session: &mut Session<ClientPort>| {
            let done = act(session).map_err(|error| ErrorObject::of(&error.into()));
            let why = done.as_ref().err().map(|error| error.message.clone());
            agent.note("command", json!({ "client": client, "command": what, "why_not": why }));
            done
        };
        commander.act(turn, logged).await?
    }

    /// Wishes something of the motion that is going on. `None`: no motion of this client is going on.
    async fn wish(&self, commander: &Commander, flow: Flow) -> Option<Result<(), ErrorObject>> {
        let done = commander.wish(flow)?;
        let ended = || {
            ErrorObject::new(
                "motion-ended",
                "the motion had ended before this was done",
                "GET /api/jobs shows how",
            )
        };
        Some(done.await.unwrap_or_else(|_| Err(ended())))
    }
}

/// Goes on after a pause.
#[utoipa::path(
    post,
    path = "/api/resume",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    responses((status = 204, description = "The motion goes on, or will in a moment"), Refusals, Denials)
)]
pub(super) async fn resume(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<StatusCode, ErrorObject> {
    let commander = agent.commander(&caller, &headers)?;
    if commander.is_moving() {
        // The job that is going on is what goes on, and nothing else of this client can be waiting.
        agent.line.with(|line, now| line.ask_to_move(commander.client, now))?;
        if let Some(done) = agent.wish(&commander, Flow::Resume).await {
            return done.map(|()| StatusCode::NO_CONTENT);
        }
    }
    agent.motion(&caller, &headers, "resume", Session::resume).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Another speed on the path, now.
#[utoipa::path(
    put,
    path = "/api/speed",
    operation_id = "set_speed",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = SpeedObject,
    responses((status = 204, description = "The controller changes to that speed"), Refusals, Denials)
)]
pub(super) async fn speed(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(SpeedObject { percent }): Body<SpeedObject>,
) -> Result<StatusCode, ErrorObject> {
    if !(SPEED_MIN..=100).contains(&percent) {
        let message = format!("{percent} % is no speed: {SPEED_MIN} to 100 are possible");
        return Err(
            ErrorObject::new("speed", message, "100 is the speed of the trajectory").kind(ErrorKind::Usage)
        );
    }
    let commander = agent.commander(&caller, &headers)?;
    if let Some(done) = agent.wish(&commander, Flow::Speed(percent)).await {
        return done.map(|()| StatusCode::NO_CONTENT);
    }
    let set = move |session: &mut Session<ClientPort>| session.set_speed(f64::from(percent) / 100.0);
    agent.command(&caller, &headers, "speed", set).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Moves single joints as long as it is asked again and again.
#[utoipa::path(
    post,
    path = "/api/jog",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = JogRequest,
    responses((status = 204, description = "The joints move so for 200 ms"), Refusals, Denials)
)]
pub(super) async fn jog(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(JogRequest { rates_rad_s }): Body<JogRequest>,
) -> Result<StatusCode, ErrorObject> {
    agent.motion(&caller, &headers, "jog", move |session| session.jog(&rates_rad_s)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Teaching: the arm is led by hand. Or ends it.
#[utoipa::path(
    post,
    path = "/api/teach",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = Switch,
    responses((status = 204, description = "Teaching has begun, or ended"), Refusals, Denials)
)]
pub(super) async fn teach(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, ErrorObject> {
    let act = move |session: &mut Session<ClientPort>| session.teach(on);
    if on {
        agent.motion(&caller, &headers, "teach", act).await?;
    } else {
        agent.command(&caller, &headers, "teach", act).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}

/// Switches the pump of the gripper.
#[utoipa::path(
    post,
    path = "/api/gripper",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = Switch,
    responses((status = 204, description = "It is switched"), Refusals, Denials)
)]
pub(super) async fn gripper(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, ErrorObject> {
    agent.command(&caller, &headers, "gripper", move |session| session.gripper(on)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Clears the errors of the controller and of all drives.
#[utoipa::path(
    post,
    path = "/api/clear",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    responses((status = 204, description = "They are cleared; those that last come again"), Refusals, Denials)
)]
pub(super) async fn clear(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<StatusCode, ErrorObject> {
    let act =
        |session: &mut Session<ClientPort>| session.clear(true, ALL).and_then(|()| session.clear_occurred());
    agent.command(&caller, &headers, "clear", act).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// All nodes of the joint bus, as bits.
const ALL: u8 = 0x7F;

/// Takes the torque off all joints, at rest. An arm without brakes falls.
#[utoipa::path(
    post,
    path = "/api/disable",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    responses((status = 204, description = "The drives are being disabled"), Refusals, Denials)
)]
pub(super) async fn disable(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
) -> Result<StatusCode, ErrorObject> {
    agent.command(&caller, &headers, "disable", Session::disable).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// What the arm carries at its flange from now on.
#[utoipa::path(
    put,
    path = "/api/payload",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = PayloadObject,
    responses((status = 204, description = "It comes into the torque over 0.5 s"), Refusals, Denials)
)]
pub(super) async fn set_payload(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(payload): Body<PayloadObject>,
) -> Result<StatusCode, ErrorObject> {
    let payload = Payload::from(payload);
    payload.check().map_err(|e| {
        ErrorObject::new("payload", e.to_string(), "no body has such numbers").kind(ErrorKind::Usage)
    })?;
    agent.command(&caller, &headers, "payload", move |session| session.set_payload(&payload)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Leads the controller back to a held arm, whatever its state is: a job.
#[utoipa::path(
    post,
    path = "/api/recover",
    params(("Lease-Key" = String, Header, description = "Key of the lease")),
    request_body = RecoverRequest,
    responses((status = 202, description = "The job that does it", body = JobObject), Refusals, Denials)
)]
pub(super) async fn recover(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    headers: HeaderMap,
    Body(RecoverRequest { defaults }): Body<RecoverRequest>,
) -> Result<(StatusCode, Json<JobObject>), ErrorObject> {
    let (commander, turn) = agent.mover(&caller, &headers)?;
    let job = agent.jobs.begin(&commander, turn, "recover".into(), move |task, session| {
        let source = if defaults { ParameterSource::ControllerDefaults } else { ParameterSource::None };
        let recovered =
            session.recover_until(source, || task.is_halted(), |step| task.note(step.to_string()));
        let error = match recovered {
            Ok(_) => None,
            Err(Error::Cancelled) => Some(task.stopped()),
            Err(error) => Some(ErrorObject::of(&error)),
        };
        (Done { finished: error.is_none(), ..Done::default() }, error)
    })?;
    Ok((StatusCode::ACCEPTED, Json(job.into())))
}
