//! Commands that are soon over, for who has the lease.
use agent_kit::api::{Asked, Body, Number, Problem, Refusals};
use agent_kit::gate::Caller;
use axum::extract::State;
use axum::http::HeaderMap;
use axum::{Extension, Json};
use serde_json::json;
use ucom_host::files::SignalValue;
use ucom_host::master::io::Kind as Buffer;
use ucom_host::master::{AdminChange, Error, Outcome, Request, StopLevel};
use ucom_host::session::{
    Assignment, Boards, SessionError, arrived, become_master, note_rounded, with_names, words,
};
use utoipa::{IntoParams, ToSchema};

use super::boards::numbers;
use super::objects::{AnswerObject, ValueObject};
use super::{Agent, Denials};
use crate::owner::Hands;
use crate::work::Kind;

/// A value as it is given.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(untagged)]
pub(super) enum GivenValue {
    /// On or off.
    Switch(bool),
    /// A number, where the signal has no unit.
    Number(f64),
    /// As `ucom ci` takes it: a number with its unit (`20.5 deg`), a word (`0x05DC`), `on`, `off`.
    Text(String),
}

/// What an input or a parameter is to be.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueRequest {
    /// The value.
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

/// Whether outputs are enabled.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OutputsRequest {
    /// True: enabled, where the control loop runs.
    active: bool,
}

/// How far a board is stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Level {
    /// The control loop ends, the application stays.
    Loop,
    /// The application ends, too.
    #[default]
    Application,
}

/// How far a board is stopped.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct StopRequest {
    /// `application`, unless it is asked for otherwise.
    #[serde(default)]
    #[param(inline)]
    level: Level,
}

/// Who reported after a reset.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ResetObject {
    /// Low bytes of the boards' flash numbers. Their numbers are gone: `POST /api/init` gives new ones.
    reports: Vec<u8>,
}

impl Agent {
    /// Has the owner do something for the client that commands, and logs that it was asked for.
    async fn command<T: Send + 'static>(
        &self,
        (caller, headers): (&Caller, &HeaderMap),
        (what, board, moves): (&'static str, u8, bool),
        act: impl FnOnce(&mut Hands) -> Result<T, SessionError> + Send + 'static,
    ) -> Result<T, Problem> {
        let client = self.commander(caller, headers)?;
        numbers([board])?;
        if moves {
            self.shared.may_move(client.id)?;
        }
        let act = move |hands: &mut Hands| act(hands).map_err(|error| hands.problem(&error));
        let done = self.shared.call(Kind::Command, act).await;
        let why = done.as_ref().err().map(|error| error.message.clone());
        self.gate
            .note("command", json!({ "client": client.id, "command": what, "board": board, "why_not": why }));
        done
    }
}

/// Sets an input or a parameter of a board.
fn set(
    hands: &mut Hands,
    buffer: Buffer,
    board: u8,
    name: &str,
    value: &SignalValue,
) -> Result<ValueObject, SessionError> {
    let known = hands.known(board)?;
    let assignment = Assignment { board: Some(board), name: name.to_owned(), value: value.clone() };
    let Some(word) = words(&known, buffer, &[assignment])?.into_iter().next() else {
        return Err(SessionError::NoBoards);
    };
    note_rounded(&hands.driver, board, buffer, std::slice::from_ref(&word));
    let now_us = hands.driver.now_us();
    let boards = hands.driver.master.boards();
    // Of a board that runs inputs are repeated: one that is lost is followed by others.
    let runs =
        hands.driver.master.is_master() && boards.get(board).is_some_and(|board| board.running(now_us));
    let quick = runs && buffer == Buffer::Ci;
    if !quick {
        become_master(&mut hands.driver, board, false)?;
    }
    let (now, setting) = (hands.driver.now_us(), known.setting(buffer, &word));
    let master = &mut hands.driver.master;
    match buffer {
        Buffer::Par => master.set_parameter(now, board, &setting.name, setting.value),
        _ => master.set_input(now, board, &setting.name, setting.value),
    }
    .map_err(Error::from)?;
    if !quick {
        arrived(&mut hands.driver, board)?;
    }
    let index = usize::from(word.index);
    Ok(ValueObject::of(&word.name, index, known.signals.get(buffer, index), Some(word.word)))
}

impl Agent {
    async fn set(
        &self,
        asker: (&Caller, &HeaderMap),
        (what, buffer): (&'static str, Buffer),
        (board, name): (u8, String),
        request: &ValueRequest,
    ) -> Result<Json<ValueObject>, Problem> {
        let value = request.value.parsed(&name)?;
        let set = move |hands: &mut Hands| set(hands, buffer, board, &name, &value);
        Ok(Json(self.command(asker, (what, board, true), set).await?))
    }
}

/// Sets a controller input by its name; sent at once, and repeated while the board runs.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/inputs/{name}",
    operation_id = "set_input",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("name" = String, Path, description = "Name of the input, with or without its unit in brackets; or its place"),
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    request_body = ValueRequest,
    responses((status = 200, description = "What was sent", body = ValueObject), Refusals, Denials)
)]
pub(super) async fn set_input(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(place): Number<(u8, String)>,
    headers: HeaderMap,
    Body(request): Body<ValueRequest>,
) -> Result<Json<ValueObject>, Problem> {
    agent.set((&caller, &headers), ("input", Buffer::Ci), place, &request).await
}

/// Writes a parameter by its name. Boards have no way to read it back.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/parameters/{name}",
    operation_id = "set_parameter",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("name" = String, Path, description = "Name of the parameter, with or without its unit in brackets; or its place"),
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    request_body = ValueRequest,
    responses((status = 200, description = "What was sent", body = ValueObject), Refusals, Denials)
)]
pub(super) async fn set_parameter(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(place): Number<(u8, String)>,
    headers: HeaderMap,
    Body(request): Body<ValueRequest>,
) -> Result<Json<ValueObject>, Problem> {
    agent.set((&caller, &headers), ("parameter", Buffer::Par), place, &request).await
}

/// Enables or disables the outputs of a running board.
#[utoipa::path(
    put,
    path = "/api/boards/{number}/outputs",
    operation_id = "set_outputs",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    request_body = OutputsRequest,
    responses((status = 204, description = "The board has confirmed it"), Refusals, Denials)
)]
pub(super) async fn set_outputs(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(board): Number<u8>,
    headers: HeaderMap,
    Body(OutputsRequest { active }): Body<OutputsRequest>,
) -> Result<axum::http::StatusCode, Problem> {
    let change = AdminChange { active: Some(active), ..AdminChange::default() };
    let request = Request::Admin { board, change, force: false };
    let act = move |hands: &mut Hands| hands.driver.run(request).map(drop);
    agent.command((&caller, &headers), ("outputs", board, active), act).await?;
    Ok(axum::http::StatusCode::NO_CONTENT)
}

/// Starts the application of a board; nothing moves by that.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/start",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    responses((status = 200, description = "The application is up", body = AnswerObject), Refusals, Denials)
)]
pub(super) async fn start_board(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(board): Number<u8>,
    headers: HeaderMap,
) -> Result<Json<AnswerObject>, Problem> {
    let act = move |hands: &mut Hands| {
        hands.has_started(board);
        let all = hands.driver.change_each(&[board], |board| Request::Start { board, force: false })?;
        // Its names are there from now on; without them it is started all the same.
        let _ = hands.known(board);
        all.first()
            .map(|one| AnswerObject::of(one, &hands.driver.master.profile()))
            .ok_or(SessionError::NoBoards)
    };
    Ok(Json(agent.command((&caller, &headers), ("start", board, true), act).await?))
}

/// Stops the control loop of a board, and its application.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/stop",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        StopRequest,
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    responses((status = 200, description = "The board has confirmed it", body = AnswerObject), Refusals, Denials)
)]
pub(super) async fn stop_board(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(board): Number<u8>,
    Asked(StopRequest { level }): Asked<StopRequest>,
    headers: HeaderMap,
) -> Result<Json<AnswerObject>, Problem> {
    let act = move |hands: &mut Hands| {
        let to = match level {
            Level::Loop => StopLevel::Loop,
            Level::Application => StopLevel::Application,
        };
        let stopped = hands.driver.stop_each(&Boards::Some(vec![board]), to)?;
        if let Some((_, error)) = stopped.failed.into_iter().next() {
            return Err(error);
        }
        hands.runs_no_more(Some(board));
        if level == Level::Loop {
            hands.has_started(board);
        }
        let profile = hands.driver.master.profile();
        stopped.boards.first().map(|one| AnswerObject::of(one, &profile)).ok_or(SessionError::NoBoards)
    };
    Ok(Json(agent.command((&caller, &headers), ("stop", board, false), act).await?))
}

/// Resets a board: its outputs become safe, and its number is gone.
#[utoipa::path(
    post,
    path = "/api/boards/{number}/reset",
    params(
        ("number" = u8, Path, description = "Number of the board"),
        ("Lease-Key" = String, Header, description = "Key of the lease")
    ),
    responses((status = 200, description = "Who reported", body = ResetObject), Refusals, Denials)
)]
pub(super) async fn reset_board(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Number(board): Number<u8>,
    headers: HeaderMap,
) -> Result<Json<ResetObject>, Problem> {
    let act = move |hands: &mut Hands| match hands
        .driver
        .run(Request::Reset { board: Some(board), force: false })?
    {
        Outcome::Reset(reports) => {
            hands.forget(board);
            Ok(ResetObject { reports: reports.ids.into_iter().collect() })
        }
        other => Err(other.into()),
    };
    Ok(Json(agent.command((&caller, &headers), ("reset", board, false), act).await?))
}

/// Does something by names; where a board turns out to have others than were kept, once more by those that it sends.
pub(super) fn by_names<T>(
    hands: &mut Hands,
    mut act: impl FnMut(&mut Hands, &ucom_host::session::Cache) -> Result<T, SessionError>,
) -> Result<T, SessionError> {
    let cache = hands.cache.clone();
    with_names(&cache, |cache| act(hands, cache))
}
