//! The flight recorder of the controller: what it does, its log as a file, and beginning anew.
use std::io::Cursor;
use std::path::Path;

use agent_kit::api::{Asked, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::lease::LeaseKey;
use axum::extract::State;
use axum::http::{HeaderName, StatusCode, header};
use axum::{Extension, Json};
use jtc_host::error::Facts;
use jtc_host::log::Account;
use jtc_host::{ErrorKind, JointSample, LinkError, Sample, Session};
use jtc_wire::JOINTS;
use serde_json::json;
use utoipa::{IntoParams, ToSchema};

use super::body::blocking;
use super::error::Denials;
use super::{Agent, Caller};
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

/// What the log holds, tick by tick: 1000 rows a second, in columns of the same length. A value that is not known is null.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LogValues {
    /// Time of each row, s, 0 at the last one.
    pub times_s: Vec<f64>,
    /// State of the controller in the last row.
    pub state: String,
    /// Base to wrist.
    pub joints: Vec<LogJoint>,
}

/// A joint in the log.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LogJoint {
    /// Measured, rad.
    pub position_rad: Vec<Option<f64>>,
    /// Commanded, rad.
    pub commanded_rad: Vec<Option<f64>>,
    /// Commanded minus measured, of the same time, rad.
    pub error_rad: Vec<Option<f64>>,
    /// Measured, rad/s.
    pub velocity_rad_s: Vec<Option<f64>>,
    /// Commanded on the bus, N·m.
    pub torque_nm: Vec<Option<f64>>,
}

impl LogValues {
    /// The samples of the last start of the controller that lie within `last_s` of the last one.
    fn of(samples: &[Sample], last_s: f64) -> Self {
        let end = samples.last().map_or(0.0, |sample| sample.time_s);
        // Half a tick more: the difference of two times in seconds is not exact.
        let from = end - last_s - 0.5e-3;
        let rows: Vec<&Sample> =
            samples.iter().filter(|sample| (from..=end).contains(&sample.time_s)).collect();
        let joint = |j: usize| {
            // Seven digits are more than an encoder has.
            let column = |value: fn(&JointSample) -> f64| {
                let known = |sample: &&Sample| {
                    sample.joints.get(j).map(value).filter(|x| x.is_finite()).map(|x| (x * 1e7).round() / 1e7)
                };
                rows.iter().map(known).collect()
            };
            LogJoint {
                position_rad: column(|joint| joint.position),
                commanded_rad: column(|joint| joint.set_position),
                error_rad: column(JointSample::position_error),
                velocity_rad_s: column(|joint| joint.velocity),
                torque_nm: column(|joint| joint.torque),
            }
        };
        Self {
            times_s: rows.iter().map(|sample| ((sample.time_s - end) * 1e6).round() / 1e6).collect(),
            state: samples.last().map_or_else(String::new, |sample| sample.state.name().to_owned()),
            joints: (0..JOINTS).map(joint).collect(),
        }
    }
}

/// How much of the log is wanted.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct LogWindow {
    /// The last seconds of it.
    #[serde(default = "window_default_s")]
    #[param(minimum = 0.01, maximum = 60)]
    last_s: f64,
}

fn window_default_s() -> f64 {
    2.0
}

/// What the flight recorder does. It goes on with it.
#[utoipa::path(
    get,
    path = "/api/log/status",
    operation_id = "get_log_status",
    responses((status = 200, description = "Whether it records", body = LogStatusObject), Refusals, Denials)
)]
pub(super) async fn status(State(agent): State<Agent>) -> Result<Json<LogStatusObject>, Problem> {
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
) -> Result<([(HeaderName, String); 2], Vec<u8>), Problem> {
    let file = from_log(&agent, &caller, written).await?;
    let attached = format!("attachment; filename=\"{FILE}\"");
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, attached),
    ];
    Ok((headers, file))
}

/// The last of what the log holds, as numbers: what a plot of a moment needs, at 1 kHz. It takes as long as the whole log; one at a time.
#[utoipa::path(
    get,
    path = "/api/log/values",
    operation_id = "get_log_values",
    params(LogWindow),
    responses((status = 200, description = "Columns of the same length", body = LogValues), Refusals, Denials)
)]
pub(super) async fn values(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Asked(LogWindow { last_s }): Asked<LogWindow>,
) -> Result<Json<LogValues>, Problem> {
    if !(0.01..=60.0).contains(&last_s) {
        let object =
            Problem::new("request", format!("last_s {last_s}: from 0.01 to 60"), "leave it out for 2 s");
        let limit = if last_s > 60.0 { 60.0 } else { 0.01 };
        return Err(object.with(Facts::beyond(last_s, limit)).unreadable());
    }
    let last = move |account: &Account| Ok(LogValues::of(&account.replayed.samples(), last_s));
    from_log(&agent, &caller, last).await.map(Json)
}

/// Reads the log, and makes of it what is asked for: for operators, one at a time.
async fn from_log<T: Send + 'static>(
    agent: &Agent,
    caller: &Caller,
    make: impl FnOnce(&Account) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    // Reading it holds up what it records.
    caller.operator()?;
    agent.note("log", json!({ "from": caller.peer.to_string() }));
    let room = agent.logs.clone().try_acquire_owned().map_err(|_| {
        let next = "ask again in some seconds: a log is read by one at a time";
        Problem::new("busy", "somebody reads the log of the flight recorder", next)
    })?;
    // A client of its own: whoever asks something else meanwhile does not wait for it.
    let name = format!("{}: log", caller.peer);
    let introduction = Introduction { name, role: caller.role, policy: Policy::Continue };
    let reader = Commander::new(&agent.line, introduction);
    let fetched = reader.call_in_turn(move |session| {
        let log = session.fetch_log(|_, _| {});
        log.map(|log| (log, room)).map_err(|error| Problem::of(&error))
    });
    let (log, room) = fetched.await??;
    drop(reader);
    let source = agent.port.clone();
    let made = blocking(move || {
        let account = Account::of(log, None, &source);
        let made = if account.replayed.ticks.is_empty() { Err(empty()) } else { make(&account) };
        drop(room);
        made
    });
    made.await?
}

/// The recording as bytes.
fn written(account: &Account) -> Result<Vec<u8>, Problem> {
    let mut file = Cursor::new(Vec::new());
    account.write(&mut file, Path::new(FILE)).map_err(|error| Problem::of(&error))?;
    Ok(file.into_inner())
}

fn empty() -> Problem {
    let message = "the flight recorder holds nothing yet: it was cleared, or the controller has just started";
    Problem::new("empty-log", message, "ask again after a second").kind(ErrorKind::Device)
}

/// Forgets the log: the flight recorder begins anew, also one that has stopped at an error.
#[utoipa::path(
    delete,
    path = "/api/log",
    operation_id = "clear_log",
    params(LeaseKey),
    responses((status = 204, description = "It records anew"), Refusals, Denials)
)]
pub(super) async fn clear(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    let clear = |session: &mut Session<ClientPort>| -> Result<(), LinkError> { session.clear_log() };
    agent.command(&asker, "clear log", clear).await?;
    Ok(StatusCode::NO_CONTENT)
}
