//! The flight recorder of the controller: what it does, its log as a file, and beginning anew.
use std::io::Cursor;
use std::path::Path;

use agent_kit::api::Refusals;
use agent_kit::gate::Asker;
use agent_kit::lease::LeaseKey;
use axum::extract::State;
use axum::http::{HeaderName, StatusCode, header};
use axum::{Extension, Json};
use jtc_host::log::Account;
use jtc_host::{ErrorKind, LinkError, Session};
use serde_json::json;
use utoipa::ToSchema;

use super::body::blocking;
use super::error::Denials;
use super::{Agent, Caller, ErrorObject};
use crate::jobs::Commander;
use crate::line::{Introduction, Policy};
use crate::owner::ClientPort;

/// What the file is called.
const FILE: &str = "flight-recorder.mcap";

/// What the flight recorder does.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LogStatusObject {
    /// In words: it records, or why it has stopped.
    pub state: String,
    /// Blocks of 1 KiB that it has begun since the start of the controller, those counted that are gone.
    pub blocks: u32,
}

/// A recording in MCAP with the log in it, as `jtc log fetch` writes it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "describes a body")]
pub struct LogFile(Vec<u8>);

/// What the flight recorder does. It goes on with it.
#[utoipa::path(
    get,
    path = "/api/log/status",
    operation_id = "get_log_status",
    responses((status = 200, description = "Whether it records", body = LogStatusObject), Refusals, Denials)
)]
pub(super) async fn status(State(agent): State<Agent>) -> Result<Json<LogStatusObject>, ErrorObject> {
    let status = agent.ask(|session| Ok(session.log_status()?)).await?;
    Ok(Json(LogStatusObject { state: status.state.name().to_owned(), blocks: status.end }))
}

/// The log of the flight recorder, as a recording. One at a time.
///
/// It takes as long as the line takes for up to 160 kB, at 115,200 Bd some 40 s; recording rests meanwhile, and the
/// arm may move.
#[utoipa::path(
    get,
    path = "/api/log",
    operation_id = "get_log",
    responses(
        (status = 200, description = "A recording in MCAP, for `jtc report`, `jtc log replay` and Foxglove", body = LogFile, content_type = "application/octet-stream"),
        Refusals, Denials
    )
)]
pub(super) async fn fetch(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
) -> Result<([(HeaderName, String); 2], Vec<u8>), ErrorObject> {
    // Reading it holds up what it records.
    caller.operator()?;
    agent.note("log", json!({ "from": caller.peer.to_string() }));
    let room = agent.logs.clone().try_acquire_owned().map_err(|_| {
        let next = "ask again in some seconds: a log is read by one at a time";
        ErrorObject::new("busy", "somebody reads the log of the flight recorder", next)
    })?;
    // A client of its own: whoever asks something else meanwhile does not wait for it.
    let name = format!("{}: log", caller.peer);
    let introduction = Introduction { name, role: caller.role, policy: Policy::Continue };
    let reader = Commander::new(&agent.line, introduction);
    let fetched = reader.call_in_turn(move |session| {
        let log = session.fetch_log(|_, _| {});
        log.map(|log| (log, room)).map_err(|error| ErrorObject::of(&error))
    });
    let (log, room) = fetched.await??;
    drop(reader);
    let source = agent.port.clone();
    let file = blocking(move || {
        let account = Account::of(log, None, &source);
        let file = if account.replayed.ticks.is_empty() { Err(empty()) } else { written(&account) };
        drop(room);
        file
    });
    let attached = format!("attachment; filename=\"{FILE}\"");
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, attached),
    ];
    Ok((headers, file.await??))
}

/// The recording as bytes.
fn written(account: &Account) -> Result<Vec<u8>, ErrorObject> {
    let mut file = Cursor::new(Vec::new());
    account.write(&mut file, Path::new(FILE)).map_err(|error| ErrorObject::diagnosed(&error))?;
    Ok(file.into_inner())
}

fn empty() -> ErrorObject {
    let message = "the flight recorder holds nothing yet: it was cleared, or the controller has just started";
    ErrorObject::new("empty-log", message, "ask again after a second").kind(ErrorKind::Device)
}

/// Forgets the log: the flight recorder begins anew, also one that has stopped at an error.
#[utoipa::path(
    delete,
    path = "/api/log",
    operation_id = "clear_log",
    params(LeaseKey),
    responses((status = 204, description = "It records anew"), Refusals, Denials)
)]
pub(super) async fn clear(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, ErrorObject> {
    let clear = |session: &mut Session<ClientPort>| -> Result<(), LinkError> { session.clear_log() };
    agent.command(&asker, "clear log", clear).await?;
    Ok(StatusCode::NO_CONTENT)
}
