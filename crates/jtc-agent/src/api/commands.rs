//! Commands that are soon over, for who has the lease.
use std::borrow::Cow;
use std::time::Duration;

use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::extract::State;
use axum::http::StatusCode;
use jtc_host::session::{Flow, Payload};
use jtc_host::{Error, ErrorKind, MotionError, Session};
use jtc_wire::{Status, TrajectoryState};
use serde_json::json;
use utoipa::ToSchema;

use super::Agent;
use super::error::Denials;
use super::objects::PayloadObject;
use crate::jobs::{Commander, Turn, stopped};
use crate::owner::ClientPort;

/// The lease of a client that waits for an answer is renewed so often.
const RENEWED: Duration = Duration::from_millis(300);
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

impl Agent {
    /// Has the end of the line of the client that commands do something that moves nothing.
    pub(super) async fn command<T, E>(
        &self,
        asker: &Asker,
        what: impl Into<Cow<'static, str>>,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Problem>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let commander = self.commander(asker)?;
        let turn = commander.turn()?;
        self.act(&commander, turn, what, act).await
    }

    /// The same for what may move the arm.
    pub(super) async fn motion<T, E>(
        &self,
        asker: &Asker,
        after: AskedAfter,
        what: impl Into<Cow<'static, str>>,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Problem>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let (commander, turn) = self.mover(asker, after)?;
        self.act(&commander, turn, what, act).await
    }

    /// Does it, and logs it whether or not somebody waits for the end of it.
    pub(super) async fn act<T, E>(
        &self,
        commander: &Commander,
        turn: Turn,
        what: impl Into<Cow<'static, str>>,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Problem>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let (agent, client, what) = (self.clone(), commander.client, what.into());
        let logged = move |session: &mut Session<ClientPort>| {
            let done = act(session).map_err(|error| match error.into() {
                Error::Cancelled => stopped(&agent.line, client),
                error => Problem::of(&error),
            });
            let why = done.as_ref().err().map(|error| error.message.clone());
            agent.note("command", json!({ "client": client.0, "command": what, "why_not": why }));
            done
        };
        let acting = commander.act(turn, logged);
        tokio::pin!(acting);
        loop {
            tokio::select! {
                done = &mut acting => return done?,
                // Whoever waits for an answer is there.
                () = tokio::time::sleep(RENEWED) => self.line.with(|line, now| line.renew(client, now)),
            }
        }
    }
}

/// Goes on after a pause.
#[utoipa::path(
    post,
    path = "/api/resume",
    params(LeaseKey, KnownHalt),
    responses((status = 204, description = "The motion goes on, or will in a moment"), Refusals, Denials)
)]
pub(super) async fn resume(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
) -> Result<StatusCode, Problem> {
    let commander = agent.commander(&asker)?;
    if commander.is_moving() {
        // A motion that somebody stopped before it began is not what is gone on with.
        agent.line.with(|line, now| {
            line.could_ask(commander.client, now)?;
            match line.status() {
                Some((_, status)) if status.trajectory != TrajectoryState::Pause => Err(not_paused(status)),
                _ => Ok(line.ask_to_move(commander.client, after.0, now)?),
            }
        })?;
        if let Some(done) = commander.wish(Flow::Resume).await {
            return done.map(|()| StatusCode::NO_CONTENT);
        }
    }
    agent.motion(&asker, after, "resume", Session::resume).await?;
    Ok(StatusCode::NO_CONTENT)
}

fn not_paused(status: &Status) -> Problem {
    let (state, trajectory) = (status.state, status.trajectory);
    Problem::of(&MotionError::NotPaused { state, trajectory })
}

/// Another speed on the path, now.
#[utoipa::path(
    put,
    path = "/api/speed",
    operation_id = "set_speed",
    params(LeaseKey),
    request_body = SpeedObject,
    responses((status = 204, description = "The controller changes to that speed"), Refusals, Denials)
)]
pub(super) async fn speed(
    State(agent): State<Agent>,
    asker: Asker,
    Body(SpeedObject { percent }): Body<SpeedObject>,
) -> Result<StatusCode, Problem> {
    if !(SPEED_MIN..=100).contains(&percent) {
        let message = format!("{percent} % is no speed: {SPEED_MIN} to 100 are possible");
        return Err(
            Problem::new("speed", message, "100 is the speed of the trajectory").kind(ErrorKind::Usage)
        );
    }
    let commander = agent.commander(&asker)?;
    if let Some(done) = commander.wish(Flow::Speed(percent)).await {
        return done.map(|()| StatusCode::NO_CONTENT);
    }
    let set = move |session: &mut Session<ClientPort>| session.set_speed(f64::from(percent) / 100.0);
    agent.command(&asker, "speed", set).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Teaching: the arm is led by hand. Or ends it.
#[utoipa::path(
    post,
    path = "/api/teach",
    params(LeaseKey, KnownHalt),
    request_body = Switch,
    responses((status = 204, description = "Teaching has begun, or ended"), Refusals, Denials)
)]
pub(super) async fn teach(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, Problem> {
    if on {
        let commander = agent.commander(&asker)?;
        let (line, client) = (agent.line.clone(), commander.client);
        let halted = move || line.with(|line, _| line.is_halted(client));
        agent.motion(&asker, after, "teach", move |session| session.teach_until(halted)).await?;
    } else {
        agent.command(&asker, "teach", |session| session.teach(false)).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}

/// Switches the pump of the gripper.
#[utoipa::path(
    post,
    path = "/api/gripper",
    params(LeaseKey),
    request_body = Switch,
    responses((status = 204, description = "It is switched"), Refusals, Denials)
)]
pub(super) async fn gripper(
    State(agent): State<Agent>,
    asker: Asker,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, Problem> {
    agent.command(&asker, "gripper", move |session| session.gripper(on)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Takes the torque off all joints, at rest. An arm without brakes falls.
#[utoipa::path(
    post,
    path = "/api/disable",
    params(LeaseKey),
    responses((status = 204, description = "The drives are being disabled"), Refusals, Denials)
)]
pub(super) async fn disable(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    agent.command(&asker, "disable", Session::disable).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// What the arm carries at its flange from now on.
#[utoipa::path(
    put,
    path = "/api/payload",
    params(LeaseKey),
    request_body = PayloadObject,
    responses((status = 204, description = "It comes into the torque over 0.5 s"), Refusals, Denials)
)]
pub(super) async fn set_payload(
    State(agent): State<Agent>,
    asker: Asker,
    Body(payload): Body<PayloadObject>,
) -> Result<StatusCode, Problem> {
    let payload = body(payload)?;
    agent.command(&asker, "payload", move |session| session.set_payload(&payload)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// A payload that is one of a body.
pub(super) fn body(payload: PayloadObject) -> Result<Payload, Problem> {
    let payload = Payload::from(payload);
    payload.check().map_err(|e| {
        Problem::new("payload", e.to_string(), "no body has such numbers").kind(ErrorKind::Usage)
    })?;
    Ok(payload)
}
