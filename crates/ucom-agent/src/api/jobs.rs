//! Jobs: requests that take longer than their HTTP answer.
use std::time::Duration;

use agent_kit::api::{Body, Number, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use host_kit::ErrorKind;
use serde_json::json;
use ucom_host::master::{InitOptions, Outcome, Request, RunOptions, RunReport};
use ucom_host::session::{Assignment, Boards, Cache, Prepared, Session, SessionError, only, plans, remember};
use utoipa::ToSchema;

use super::boards::numbers;
use super::commands::GivenValue;
use super::objects::JobObject;
use super::{Agent, Denials};
use crate::jobs::Done;
use crate::owner::{Kind, Worker};

/// Time for which the doctor job listens to the bus before it sends queries.
const LISTEN: Duration = Duration::from_millis(1500);

impl Agent {
    /// Starts a job of the lease holder. If the job may move a board, it starts only if no Stop came after `after`.
    pub(super) fn begin(
        &self,
        (asker, after): (&Asker, Option<AskedAfter>),
        (kind, what): (Kind, &'static str),
        act: impl FnOnce(&mut Worker) -> Result<(Done, Option<Problem>), SessionError> + Send + 'static,
    ) -> Result<(StatusCode, Json<JobObject>), Problem> {
        let client = self.commander(asker)?;
        let asked = self.shared.asked(client.id, after)?;
        let act = move |worker: &mut Worker| act(worker).map_err(|error| worker.problem(&error));
        let job = self.shared.begin((kind, asked), (what, &client.name), act);
        let why = job.as_ref().err().map(|error| error.message.clone());
        let number = job.as_ref().ok().map(|job| job.number);
        self.gate
            .note("command", json!({ "client": client.id, "command": what, "job": number, "why_not": why }));
        Ok((StatusCode::ACCEPTED, Json(job?.into())))
    }
}

fn texts(findings: &[impl ToString]) -> Vec<String> {
    findings.iter().map(|finding| finding.to_string().replace('`', "")).collect()
}

/// Scans for boards, as a job, and changes nothing.
#[utoipa::path(
    post,
    path = "/api/scan",
    params(LeaseKey),
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn scan(
    State(agent): State<Agent>,
    asker: Asker,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    agent.begin((&asker, None), (Kind::Command, "scan"), |worker| match worker.driver.run(Request::Scan)? {
        Outcome::Scan(report) => Ok((Done::Chain(report.boards, texts(&report.findings)), None)),
        other => Err(other.into()),
    })
}

/// Expected board at a position of the chain.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object with the fields board and flash_number")]
pub(super) struct ExpectedBoard {
    /// Position of the board in the chain. The board receives this number.
    board: u8,
    /// Flash number of the bootloader, which identifies the board.
    flash_number: u16,
}

/// Options of the numbering.
#[derive(Clone, Debug, Default, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct InitRequest {
    /// Expected boards at their positions; other boards are an error. Empty: any boards.
    #[serde(default)]
    expected: Vec<ExpectedBoard>,
}

/// Resets all boards and numbers them along the chain, as a job.
#[utoipa::path(
    post,
    path = "/api/init",
    params(LeaseKey, KnownHalt),
    request_body = InitRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn init(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(InitRequest { expected }): Body<InitRequest>,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    numbers(expected.iter().map(|board| board.board))?;
    let expected = expected.iter().map(|board| (board.board, board.flash_number)).collect();
    let options = InitOptions { expected, force: false };
    agent.begin((&asker, Some(after)), (Kind::Command, "init"), |worker| {
        let outcome = worker.driver.run(Request::Init(options));
        worker.renumbered(match &outcome {
            Ok(Outcome::Init(report)) => Some(report),
            _ => None,
        });
        let Outcome::Init(report) = outcome? else { return Err(SessionError::NoBoards) };
        let findings = texts(&report.findings);
        let error = report.failure().map(|kind| {
            Problem::new("init", findings.join("; "), "find the cause with POST /api/doctor").kind(kind)
        });
        Ok((Done::Chain(report.boards, findings), error))
    })
}

/// Diagnoses bus, chain and boards, as a job.
///
/// The agent listens to the bus, and asks the boards only if this cannot do harm.
#[utoipa::path(
    post,
    path = "/api/doctor",
    params(LeaseKey),
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn doctor(
    State(agent): State<Agent>,
    asker: Asker,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    agent.begin((&asker, None), (Kind::Command, "doctor"), |worker| {
        let seen = worker.driver.examine(LISTEN)?;
        Ok((Done::Findings(seen.findings), None))
    })
}

/// Value of an input or a parameter.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object with the fields name and value, and optionally board")]
pub(super) struct NamedValue {
    /// Number of the board; missing: the value is for each board of the request.
    board: Option<u8>,
    /// Name of the input or parameter.
    name: String,
    /// New value.
    value: GivenValue,
}

/// Boards to run, with their values.
#[derive(Clone, Debug, Default, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RunRequest {
    /// Numbers of the boards; empty: all boards that answer.
    #[serde(default)]
    boards: Vec<u8>,
    /// `true`: enable the outputs at the end.
    #[serde(default)]
    active: bool,
    /// Inputs that differ from the boards' initial values.
    #[serde(default)]
    inputs: Vec<NamedValue>,
    /// Parameters to write.
    #[serde(default)]
    parameters: Vec<NamedValue>,
}

fn assignments(values: &[NamedValue]) -> Result<Vec<Assignment>, Problem> {
    let one = |NamedValue { board, name, value }: &NamedValue| {
        Ok(Assignment { board: *board, name: name.clone(), value: value.parsed(name)? })
    };
    values.iter().map(one).collect()
}

/// Starts applications and control loops, as a job.
///
/// The job ends when the boards run. Events report later changes.
#[utoipa::path(
    post,
    path = "/api/run",
    params(LeaseKey, KnownHalt),
    request_body = RunRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn run(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    Body(mut request): Body<RunRequest>,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // Each board is used only once, even if the request lists the board several times.
    request.boards.sort_unstable();
    request.boards.dedup();
    numbers(request.boards.iter().copied())?;
    let (ci, par) = (assignments(&request.inputs)?, assignments(&request.parameters)?);
    agent.begin((&asker, Some(after)), (Kind::Command, "run"), move |worker| {
        let boards = match request.boards.is_empty() {
            true => Boards::All,
            false => Boards::Some(request.boards.clone()),
        };
        let numbers = worker.driver.numbers(&boards)?;
        only(&numbers, &ci, "run")?;
        only(&numbers, &par, "run")?;
        let begin = |session: &mut Session, cache: &Cache| {
            let mut prepared = Prepared::default();
            let started = start(session, cache, &numbers, (&ci, &par), request.active, &mut prepared);
            // The failed procedure has already undone its own steps.
            let report = started.inspect_err(|_| prepared.undo(&mut session.driver))?;
            Ok((report, prepared))
        };
        let (report, prepared) = worker.starting(&numbers, |session| session.by_names(begin))?;
        for known in prepared.known.into_values() {
            worker.knows(known);
        }
        worker.runs(&numbers);
        Ok((Done::Running(report.boards, report.load), None))
    })
}

/// Reads the signal names, prepares the inputs, and starts all boards.
fn start(
    session: &mut Session,
    cache: &Cache,
    numbers: &[u8],
    (ci, par): (&[Assignment], &[Assignment]),
    active: bool,
    prepared: &mut Prepared,
) -> Result<RunReport, SessionError> {
    for board in numbers {
        prepared.add(&mut session.driver, cache, &session.signals, *board, false)?;
    }
    let plans = plans(&session.driver, prepared, None, ci, par)?;
    match session.driver.run(Request::Run(RunOptions { boards: plans.clone(), active, force: false }))? {
        Outcome::Running(report) => {
            remember(cache, prepared, &plans);
            Ok(report)
        }
        other => Err(other.into()),
    }
}

/// Returns the kept jobs, oldest first.
#[utoipa::path(
    get,
    path = "/api/jobs",
    operation_id = "list_jobs",
    responses((status = 200, description = "Kept jobs, oldest first", body = Vec<JobObject>), Refusals)
)]
pub(super) async fn list(State(agent): State<Agent>) -> Json<Vec<JobObject>> {
    Json(agent.shared.jobs.list().into_iter().map(JobObject::from).collect())
}

/// Returns a job, while it runs and afterwards.
#[utoipa::path(
    get,
    path = "/api/jobs/{number}",
    operation_id = "get_job",
    params(("number" = u64, Path, description = "Number of the job")),
    responses(
        (status = 200, description = "State and results of the job", body = JobObject),
        (status = 404, description = "No kept job has this number", body = Problem),
        Refusals
    )
)]
pub(super) async fn get(
    State(agent): State<Agent>,
    Number(number): Number<u64>,
) -> Result<Json<JobObject>, Problem> {
    let job = agent.shared.jobs.get(number);
    Ok(Json(job.ok_or_else(|| Problem::nothing("job", number, "/api/jobs"))?.into()))
}

/// Cancels a job.
///
/// Before the job ends, it undoes its steps on the boards.
#[utoipa::path(
    delete,
    path = "/api/jobs/{number}",
    operation_id = "cancel_job",
    params(
        ("number" = u64, Path, description = "Number of the job"),
        LeaseKey
    ),
    responses(
        (status = 204, description = "The job will end"),
        (status = 404, description = "No kept job has this number", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn cancel(
    State(agent): State<Agent>,
    Number(number): Number<u64>,
    asker: Asker,
) -> Result<StatusCode, Problem> {
    let client = agent.commander(&asker)?;
    if agent.shared.jobs.get(number).is_none() {
        return Err(Problem::nothing("job", number, "/api/jobs"));
    }
    agent.gate.note("command", json!({ "client": client.id, "command": "cancel", "job": number }));
    if agent.shared.cancel_job(number) {
        return Ok(StatusCode::NO_CONTENT);
    }
    let message = format!("job {number} has already ended");
    Err(Problem::new("over", message, "GET /api/jobs shows the result of each job").kind(ErrorKind::Refused))
}
