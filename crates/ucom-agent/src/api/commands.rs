//! Short commands of the lease holder. Their requests wait for the result, in contrast to jobs.
use std::sync::Arc;

use agent_kit::api::{Asked, Body, Number, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use serde_json::json;
use ucom_host::files::SignalValue;
use ucom_host::master::io::Kind as Buffer;
use ucom_host::master::{AdminChange, Error, Outcome, Request, StopLevel};
use ucom_host::session::{Assignment, Boards, SessionError, arrived, become_master, note_rounded, words};
use utoipa::{IntoParams, ToSchema};

use super::boards::numbers;
use super::line::Line;
use super::objects::{AnswerObject, ValueObject};
use super::{Agent, Denials};
use crate::owner::Worker;

/// Value in a request.
#[derive(Clone, Debug, serde::Deserialize, serde::Serialize, ToSchema)]
#[serde(untagged)]
pub(super) enum GivenValue {
    /// `true` for on, `false` for off.
    Switch(bool),
    /// Number of a signal without a unit.
    Number(f64),
    /// Text as `ucom ci` accepts it: a number with its unit (`20.5 deg`), a word (`0x05DC`), `on`, `off`.
    Text(String),
}

/// New value of an input or a parameter.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ValueRequest {
    /// New value.
    value: GivenValue,
}

impl GivenValue {
    pub(super) fn parsed(&self, name: &str) -> Result<SignalValue, Problem> {
        match self {
            Self::Switch(on) => Ok(SignalValue::Switch(*on)),
            Self::Number(value) => Ok(SignalValue::Number { value: *value, unit: String::new() }),
            Self::Text(text) => text.parse().map_err(|e| {
                Problem::new(
                    "value",
                    format!("{name}: {e}"),
                    "GET /api/boards/NUMBER/values shows names and units",
                )
                .kind(host_kit::ErrorKind::Usage)
            }),
        }
    }
}

/// State of the outputs.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct OutputsRequest {
    /// `true`: enable the outputs. The control loop of the board must run.
    active: bool,
}

/// Extent of a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Level {
    /// Control loop; the application keeps running.
    Loop,
    /// Control loop and application.
    #[default]
    Application,
}

/// Extent of a stop.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct StopRequest {
    /// Extent; default: `application`.
    #[serde(default)]
    #[param(inline)]
    level: Level,
}

/// Boards that reported after a reset.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct ResetObject {
    /// Low bytes of the flash numbers of these boards. The boards now have no board numbers: `POST /api/init` assigns new
    /// ones.
    reports: Vec<u8>,
}

impl Agent {
    /// Runs a command of the lease holder in the thread that owns the bus, and logs the command.
    async fn command<T: Send + 'static>(
        &self,
        asker: &Asker,
        what: (&'static str, u8, Option<AskedAfter>),
        act: impl FnOnce(&mut Worker) -> Result<T, SessionError> + Send + 'static,
    ) -> Result<T, Problem> {
        self.command_with(asker, what, json!({}), act).await
    }

    /// Like [`command`](Self::command), but adds facts to the log line.
    async fn command_with<T: Send + 'static>(
        &self,
        asker: &Asker,
        (what, board, after): (&'static str, u8, Option<AskedAfter>),
        asked: serde_json::Value,
        act: impl FnOnce(&mut Worker) -> Result<T, SessionError> + Send + 'static,
    ) -> Result<T, Problem> {
        let client = self.commander(asker)?;
        numbers([board])?;
        let turn = self.shared.asked(client.id, after)?;
        let facts = json!({ "client": client.id, "command": what, "board": board, "asked": asked });
        let line = Arc::new(Line::new(&self.gate, facts));
        let own = line.clone();
        let act = move |worker: &mut Worker| {
            let done = act(worker).map_err(|error| worker.problem(&error));
            // The result is logged in this thread, because the client may have disconnected.
            own.end(&done);
            done
        };
        let done = self.shared.call(Some(turn), act).await;
        line.end(&done);
        done
    }
}

/// Sets an input or a parameter of a board.
fn set(
    worker: &mut Worker,
    buffer: Buffer,
    board: u8,
    name: &str,
    value: &SignalValue,
) -> Result<ValueObject, SessionError> {
    let known = worker.known(board)?;
    let assignment = Assignment { board: Some(board), name: name.to_owned(), value: value.clone() };
    let Some(word) = words(&known, buffer, &[assignment])?.into_iter().next() else {
        return Err(SessionError::NoBoards);
    };
    note_rounded(&worker.driver, board, buffer, std::slice::from_ref(&word));
    let now_us = worker.driver.now_us();
    let boards = worker.driver.master.boards();
    // The agent repeats the inputs of a running board, so a lost frame has no lasting effect and needs no check. A
    // board that sends no outputs may be without power, and does not count as running.
    let runs = worker.driver.master.repeats_inputs(board)
        && boards.get(board).is_some_and(|board| board.sends_outputs(now_us));
    let quick = runs && buffer == Buffer::Ci;
    if !quick {
        become_master(&mut worker.driver, board, false)?;
    }
    let (now, setting) = (worker.driver.now_us(), known.setting(buffer, &word));
    let master = &mut worker.driver.master;
    match buffer {
        Buffer::Par => master.set_parameter(now, board, &setting.name, setting.value),
        _ => master.set_input(now, board, &setting.name, setting.value),
    }
    .map_err(Error::from)?;
    if !quick {
        arrived(&mut worker.driver, board)?;
    }
    let index = usize::from(word.index);
    Ok(ValueObject::of(&word.name, index, known.signals.get(buffer, index), Some(word.word)))
}

impl Agent {
    async fn set(
        &self,
        (asker, after): (&Asker, AskedAfter),
        (what, buffer): (&'static str, Buffer),
        (board, name): (u8, String),
        request: &ValueRequest,
    ) -> Result<Json<ValueObject>, Problem> {
        let value = request.value.parsed(&name)?;
        let asked = json!({ "name": name, "value": request.value });
        let set = move |worker: &mut Worker| set(worker, buffer, board, &name, &value);
        Ok(Json(self.command_with(asker, (what, board, Some(after)), asked, set).await?))
    }
}

/// Sets a controller input by its name.
///
/// The agent sends the input at once, and repeats it while the board runs.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/inputs/{name}",
    operation_id = "set_input",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("name" = String, Path, description = "Name of the input, with or without its unit in brackets, or index of the input"),
        LeaseKey,
        KnownHalt
    ),
    request_body = ValueRequest,
    responses((status = 200, description = "Value that the agent has sent", body = ValueObject), Refusals, Denials)
)]
pub(super) async fn set_input(
    State(agent): State<Agent>,
    Number(place): Number<(u8, String)>,
    asker: Asker,
    after: AskedAfter,
    Body(request): Body<ValueRequest>,
) -> Result<Json<ValueObject>, Problem> {
    agent.set((&asker, after), ("input", Buffer::Ci), place, &request).await
}

/// Writes a parameter by its name.
///
/// The agent cannot read the parameter back, because boards do not report their parameters.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/parameters/{name}",
    operation_id = "set_parameter",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("name" = String, Path, description = "Name of the parameter, with or without its unit in brackets, or index of the parameter"),
        LeaseKey,
        KnownHalt
    ),
    request_body = ValueRequest,
    responses((status = 200, description = "Value that the agent has sent", body = ValueObject), Refusals, Denials)
)]
pub(super) async fn set_parameter(
    State(agent): State<Agent>,
    Number(place): Number<(u8, String)>,
    asker: Asker,
    after: AskedAfter,
    Body(request): Body<ValueRequest>,
) -> Result<Json<ValueObject>, Problem> {
    agent.set((&asker, after), ("parameter", Buffer::Par), place, &request).await
}

/// Enables or disables the outputs of a running board.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/outputs",
    operation_id = "set_outputs",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        LeaseKey,
        KnownHalt
    ),
    request_body = OutputsRequest,
    responses((status = 204, description = "The board has confirmed the command"), Refusals, Denials)
)]
pub(super) async fn set_outputs(
    State(agent): State<Agent>,
    Number(board): Number<u8>,
    asker: Asker,
    after: AskedAfter,
    Body(OutputsRequest { active }): Body<OutputsRequest>,
) -> Result<axum::http::StatusCode, Problem> {
    let change = AdminChange { active: Some(active), ..AdminChange::default() };
    let request = Request::Admin { board, change, force: false };
    let act = move |worker: &mut Worker| match active {
        true => worker.starting(&[board], |worker| worker.driver.run(request).map(drop)),
        false => worker.driver.run(request).map(drop),
    };
    let asked = json!({ "active": active });
    agent.command_with(&asker, ("outputs", board, active.then_some(after)), asked, act).await?;
    Ok(axum::http::StatusCode::NO_CONTENT)
}

/// Starts the application of a board; nothing moves.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/start",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        LeaseKey,
        KnownHalt
    ),
    responses((status = 200, description = "The application has started", body = AnswerObject), Refusals, Denials)
)]
pub(super) async fn start_board(
    State(agent): State<Agent>,
    Number(board): Number<u8>,
    asker: Asker,
    after: AskedAfter,
) -> Result<Json<AnswerObject>, Problem> {
    let act = move |worker: &mut Worker| {
        let all = worker.starting(&[board], |worker| {
            worker.driver.change_each(&[board], |board| Request::Start { board, force: false })
        })?;
        // The names of the values are also loaded now. A failure does not affect the application, which has already
        // started.
        let _ = worker.known(board);
        all.first()
            .map(|one| AnswerObject::of(one, &worker.driver.master.profile()))
            .ok_or(SessionError::NoBoards)
    };
    Ok(Json(agent.command(&asker, ("start", board, Some(after)), act).await?))
}

/// Stops the control loop of a board, and by default also its application.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/stop",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        StopRequest,
        LeaseKey
    ),
    responses((status = 200, description = "The board has confirmed the command", body = AnswerObject), Refusals, Denials)
)]
pub(super) async fn stop_board(
    State(agent): State<Agent>,
    Number(board): Number<u8>,
    Asked(StopRequest { level }): Asked<StopRequest>,
    asker: Asker,
) -> Result<Json<AnswerObject>, Problem> {
    let act = move |worker: &mut Worker| {
        let to = match level {
            Level::Loop => StopLevel::Loop,
            Level::Application => StopLevel::Application,
        };
        let stopped = worker.driver.stop_each(&Boards::Some(vec![board]), to)?;
        if let Some((_, error)) = stopped.failed.into_iter().next() {
            return Err(error);
        }
        match level {
            Level::Loop => worker.only_started(board),
            Level::Application => worker.runs_no_more(Some(board)),
        }
        let profile = worker.driver.master.profile();
        stopped.boards.first().map(|one| AnswerObject::of(one, &profile)).ok_or(SessionError::NoBoards)
    };
    Ok(Json(agent.command(&asker, ("stop", board, None), act).await?))
}

/// Resets a board: its outputs become safe, and it loses its number.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/reset",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        LeaseKey,
        KnownHalt
    ),
    responses((status = 200, description = "Boards that reported after the reset", body = ResetObject), Refusals, Denials)
)]
pub(super) async fn reset_board(
    State(agent): State<Agent>,
    Number(board): Number<u8>,
    asker: Asker,
    after: AskedAfter,
) -> Result<Json<ResetObject>, Problem> {
    let act = move |worker: &mut Worker| match worker
        .driver
        .run(Request::Reset { board: Some(board), force: false })?
    {
        Outcome::Reset(reports) => {
            worker.forget(board);
            Ok(ResetObject { reports: reports.ids.into_iter().collect() })
        }
        other => Err(other.into()),
    };
    Ok(Json(agent.command(&asker, ("reset", board, Some(after)), act).await?))
}
