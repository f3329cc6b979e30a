//! Flight recorder of the controller: its state, its log as a file, and its restart.
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
use crate::jobs::HttpSession;
use crate::line::{Introduction, Policy};
use crate::owner::ClientPort;

/// Name of the flight recorder log file.
const FILE: &str = "flight-recorder.mcap";

/// State of the flight recorder.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct LogStatusObject {
    /// State in words: recording, or the reason why the recorder has stopped.
    pub state: String,
    /// Number of blocks of 1 KiB begun since the start of the controller, including overwritten ones.
    pub blocks: u32,
}

/// MCAP recording with the log, as `jtc log fetch` writes it.
#[derive(ToSchema)]
#[schema(value_type = String, format = Binary)]
#[expect(dead_code, reason = "describes a body")]
pub(super) struct LogFile(Vec<u8>);

/// Values of the log in columns of the same length. Each row is one tick of the controller, at 1000 rows per second.
/// An unknown value is null.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct LogValues {
    /// Time of each row, s; 0 at the last row.
    pub times_s: Vec<f64>,
    /// State of the controller in the last row.
    pub state: String,
    /// Joints, base to wrist.
    pub joints: Vec<LogJoint>,
}

/// Values of a joint in the log.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct LogJoint {
    /// Measured position, rad.
    pub position_rad: Vec<Option<f64>>,
    /// Commanded position, rad.
    pub commanded_rad: Vec<Option<f64>>,
    /// Commanded minus measured position at the same time, rad.
    pub error_rad: Vec<Option<f64>>,
    /// Measured velocity, rad/s.
    pub velocity_rad_s: Vec<Option<f64>>,
    /// Torque commanded on the bus, N·m.
    pub torque_nm: Vec<Option<f64>>,
}

impl LogValues {
    /// Returns the samples of the last `last_s` seconds before the last sample. Samples before the last start of the
    /// controller are not included.
    fn of(samples: &[Sample], last_s: f64) -> Self {
        let end = samples.last().map_or(0.0, |sample| sample.time_s);
        // A margin of half a tick is added because the difference of two times in seconds is not exact.
        let from = end - last_s - 0.5e-3;
        let rows: Vec<&Sample> =
            samples.iter().filter(|sample| (from..=end).contains(&sample.time_s)).collect();
        let joint = |j: usize| {
            // Seven decimal places are finer than the resolution of an encoder.
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

/// Part of the log to return.
#[derive(Clone, Copy, Debug, serde::Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct LogWindow {
    /// Duration of the part, s. The part ends at the end of the log.
    #[serde(default = "window_default_s")]
    #[param(minimum = 0.01, maximum = 60)]
    last_s: f64,
}

fn window_default_s() -> f64 {
    2.0
}

/// Returns the state of the flight recorder, without a pause of the recording.
#[utoipa::path(
    get,
    path = "/api/log/status",
    operation_id = "get_log_status",
    responses((status = 200, description = "State of the flight recorder", body = LogStatusObject), Refusals, Denials)
)]
pub(super) async fn status(State(agent): State<Agent>) -> Result<Json<LogStatusObject>, Problem> {
    let status = agent.ask(|session| Ok(session.log_status()?)).await?;
    Ok(Json(LogStatusObject { state: status.state.name().to_owned(), blocks: status.end }))
}

/// Returns the log of the flight recorder as a recording.
///
/// The agent accepts one request for the log at a time.
///
/// The log has up to 160 kB, and its transfer takes about 40 s at 115,200 Bd. During the transfer, the flight
/// recorder does not record, but the arm can move.
#[utoipa::path(
    get,
    path = "/api/log",
    operation_id = "get_log",
    responses(
        (status = 200, description = "MCAP recording for `jtc report`, `jtc log replay` and Foxglove", body = LogFile, content_type = "application/octet-stream"),
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

/// Returns the last part of the log as numbers at 1 kHz, for a plot.
///
/// The request takes as long as for the complete log. The agent accepts one request for the log at a time.
#[utoipa::path(
    get,
    path = "/api/log/values",
    operation_id = "get_log_values",
    params(LogWindow),
    responses((status = 200, description = "Values of the log, in columns of the same length", body = LogValues), Refusals, Denials)
)]
pub(super) async fn values(
    State(agent): State<Agent>,
    Extension(caller): Extension<Caller>,
    Asked(LogWindow { last_s }): Asked<LogWindow>,
) -> Result<Json<LogValues>, Problem> {
    if !(0.01..=60.0).contains(&last_s) {
        let object = Problem::new(
            "request",
            format!("last_s is out of range: {last_s}, expected 0.01 to 60 s"),
            "correct last_s, or leave it out for 2 s",
        );
        let limit = if last_s > 60.0 { 60.0 } else { 0.01 };
        return Err(object.with(Facts::beyond(last_s, limit)).unreadable());
    }
    let last = move |account: &Account| Ok(LogValues::of(&account.replayed.samples(), last_s));
    from_log(&agent, &caller, last).await.map(Json)
}

/// Reads the flight recorder log and converts it with `make`. Only an operator may read the log, and only one request
/// is served at a time.
async fn from_log<T: Send + 'static>(
    agent: &Agent,
    caller: &Caller,
    make: impl FnOnce(&Account) -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    // Only operators may read the log, because the flight recorder does not record while its log is read.
    caller.operator()?;
    agent.note("log", json!({ "from": caller.peer.to_string() }));
    let room = agent.logs.clone().try_acquire_owned().map_err(|_| {
        let next = "send the request again after some seconds";
        Problem::new("busy", "another client is reading the log of the flight recorder", next)
    })?;
    // A separate client of the serial line reads the log, so that other queries to the controller do not wait for it.
    let name = format!("{}: log", caller.peer);
    let introduction = Introduction { name, role: caller.role, policy: Policy::Continue };
    let reader = HttpSession::new(&agent.line, introduction);
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

/// Returns the recording as the bytes of a file.
fn written(account: &Account) -> Result<Vec<u8>, Problem> {
    let mut file = Cursor::new(Vec::new());
    account.write(&mut file, Path::new(FILE)).map_err(|error| Problem::of(&error))?;
    Ok(file.into_inner())
}

fn empty() -> Problem {
    let message = "the flight recorder is still empty: it was cleared, or the controller has just started";
    Problem::new("empty-log", message, "send the request again after 1 s").kind(ErrorKind::Device)
}

/// Deletes the log and restarts the flight recorder, also after it has stopped at an error.
#[utoipa::path(
    delete,
    path = "/api/log",
    operation_id = "clear_log",
    params(LeaseKey),
    responses((status = 204, description = "The flight recorder records again"), Refusals, Denials)
)]
pub(super) async fn clear(State(agent): State<Agent>, asker: Asker) -> Result<StatusCode, Problem> {
    let clear = |session: &mut Session<ClientPort>| -> Result<(), LinkError> { session.clear_log() };
    agent.command(&asker, "clear log", clear).await?;
    Ok(StatusCode::NO_CONTENT)
}
