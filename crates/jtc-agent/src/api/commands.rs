//! Short commands of the lease holder, which end before the agent answers the request, in contrast to jobs.
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
use crate::jobs::{HttpSession, Turn, stopped};
use crate::owner::ClientPort;

/// Interval at which the agent renews the lease of a client that waits for an answer.
const RENEWED: Duration = Duration::from_millis(300);
/// Slowest speed that a client can set, % (J-57).
const SPEED_MIN: u8 = 5;

/// Speed, % of the speed of the trajectory.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpeedObject {
    /// Speed, 5 to 100 %.
    #[schema(minimum = 5, maximum = 100)]
    pub percent: u8,
}

/// On or off.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Switch {
    /// `true`: on.
    pub on: bool,
}

impl Agent {
    /// Runs a command in the session of the lease holder; the command cannot move the arm.
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
        let http_session = self.http_session(asker)?;
        let turn = http_session.turn()?;
        self.act(&http_session, turn, what, act).await
    }

    /// Runs a command in the session of the lease holder; the command may move the arm.
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
        let (http_session, turn) = self.mover(asker, after)?;
        self.act(&http_session, turn, what, act).await
    }

    /// Runs a command and logs its result, even if the client disconnects.
    pub(super) async fn act<T, E>(
        &self,
        http_session: &HttpSession,
        turn: Turn,
        what: impl Into<Cow<'static, str>>,
        act: impl FnOnce(&mut Session<ClientPort>) -> Result<T, E> + Send + 'static,
    ) -> Result<T, Problem>
    where
        T: Send + 'static,
        E: Into<Error> + Send + 'static,
    {
        let (agent, client, what) = (self.clone(), http_session.client, what.into());
        let logged = move |session: &mut Session<ClientPort>| {
            let done = act(session).map_err(|error| match error.into() {
                Error::Cancelled => stopped(&agent.line, client),
                error => Problem::of(&error),
            });
            let why = done.as_ref().err().map(|error| error.message.clone());
            agent.note("command", json!({ "client": client.0, "command": what, "why_not": why }));
            done
        };
        let acting = http_session.act(turn, logged);
        tokio::pin!(acting);
        loop {
            tokio::select! {
                done = &mut acting => return done?,
                // A client that waits for an answer is still connected, so the agent renews its
                // lease.
                () = tokio::time::sleep(RENEWED) => self.line.with(|line, now| line.renew(client, now)),
            }
        }
    }
}

/// Resumes a paused motion.
#[utoipa::path(
    post,
    path = "/api/resume",
    params(LeaseKey, KnownHalt),
    responses((status = 204, description = "The controller resumes the motion"), Refusals, Denials)
)]
pub(super) async fn resume(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
) -> Result<StatusCode, Problem> {
    let http_session = agent.http_session(&asker)?;
    if http_session.is_moving() {
        // If another client stopped a motion before the motion began, the motion must not be
        // resumed.
        agent.line.with(|line, now| {
            line.could_ask(http_session.client, now)?;
            match line.status() {
                Some((_, status)) if status.trajectory != TrajectoryState::Pause => Err(not_paused(status)),
                _ => Ok(line.ask_to_move(http_session.client, after.0, now)?),
            }
        })?;
        if let Some(done) = http_session.wish(Flow::Resume).await {
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

/// Changes the speed on the path immediately.
#[utoipa::path(
    put,
    path = "/api/speed",
    operation_id = "set_speed",
    params(LeaseKey),
    request_body = SpeedObject,
    responses((status = 204, description = "The controller changes to this speed"), Refusals, Denials)
)]
pub(super) async fn speed(
    State(agent): State<Agent>,
    asker: Asker,
    Body(SpeedObject { percent }): Body<SpeedObject>,
) -> Result<StatusCode, Problem> {
    if !(SPEED_MIN..=100).contains(&percent) {
        let message = format!("speed {percent} % is out of range ({SPEED_MIN} to 100 %)");
        return Err(Problem::new(
            "speed",
            message,
            "choose a speed in this range; 100 % is the speed of the trajectory",
        )
        .kind(ErrorKind::Usage));
    }
    let http_session = agent.http_session(&asker)?;
    if let Some(done) = http_session.wish(Flow::Speed(percent)).await {
        return done.map(|()| StatusCode::NO_CONTENT);
    }
    let set = move |session: &mut Session<ClientPort>| session.set_speed(f64::from(percent) / 100.0);
    agent.command(&asker, "speed", set).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Starts or ends Teaching, in which a person moves the arm by hand.
#[utoipa::path(
    post,
    path = "/api/teach",
    params(LeaseKey, KnownHalt),
    request_body = Switch,
    responses((status = 204, description = "Teaching has started, or ended"), Refusals, Denials)
)]
pub(super) async fn teach(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, Problem> {
    if on {
        let http_session = agent.http_session(&asker)?;
        let (line, client) = (agent.line.clone(), http_session.client);
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
    responses((status = 204, description = "The pump is switched"), Refusals, Denials)
)]
pub(super) async fn gripper(
    State(agent): State<Agent>,
    asker: Asker,
    Body(Switch { on }): Body<Switch>,
) -> Result<StatusCode, Problem> {
    agent.command(&asker, "gripper", move |session| session.gripper(on)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Takes the torque off all joints, at rest.
///
/// An arm without brakes falls.
#[utoipa::path(
    post,
    path = "/api/disable",
    params(LeaseKey),
    responses((status = 204, description = "The controller disables the drives"), Refusals, Denials)
)]
pub(super) async fn disable(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    agent.command(&asker, "disable", Session::disable).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Sets the payload at the flange.
#[utoipa::path(
    put,
    path = "/api/payload",
    params(LeaseKey),
    request_body = PayloadObject,
    responses((status = 204, description = "The controller adds the torque of the payload over 0.5 s"), Refusals, Denials)
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

/// Returns the payload if it is physically possible.
pub(super) fn body(payload: PayloadObject) -> Result<Payload, Problem> {
    let payload = Payload::from(payload);
    payload.check().map_err(|e| {
        Problem::new(
            "payload",
            e.to_string(),
            "correct mass, centre of mass and inertia: no real payload has these values",
        )
        .kind(ErrorKind::Usage)
    })?;
    Ok(payload)
}
