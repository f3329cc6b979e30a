//! Jobs, and what they brought about.
use agent_kit::api::Problem;
use host_kit::{Diagnose as _, Facts, Finding, FrontEnd, Severity};
use ucom_host::master::update::{UpdateReport, UpdateResult};
use utoipa::ToSchema;

use super::FoundObject;
use crate::jobs::{Done, Job};

/// Who is there.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ChainObject {
    /// Boards with a number.
    pub boards: Vec<FoundObject>,
    /// What is worth a word; empty: nothing is odd.
    pub findings: Vec<String>,
}

/// What a doctor found.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct FindingObject {
    /// `problem`, `warning` or `good`.
    pub severity: String,
    /// What was found.
    pub what: String,
    /// What probably is the cause; may be empty.
    pub why: String,
    /// What helps; may be empty.
    pub next: String,
}

impl From<&Finding> for FindingObject {
    fn from(finding: &Finding) -> Self {
        let severity = match finding.severity {
            Severity::Problem => "problem",
            Severity::Warning => "warning",
            Severity::Good => "good",
        };
        let Finding { what, why, next, .. } = finding;
        let (why, next) = (why.replace('`', ""), next.plain(FrontEnd::Agent));
        Self { severity: severity.into(), what: what.clone(), why, next }
    }
}

/// What became of a board in an update.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct UpdatedObject {
    /// Its number.
    pub board: u8,
    /// Who it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_number: Option<u16>,
    /// `not-started`, `cancelled`, `up-to-date`, `program-up-to-date`, `incomplete`, `unknown`, `written`, `verified` or `running`.
    pub outcome: String,
    /// The board shows the Program ID and date of the image, and the agent or its inventory has it that exactly this image was
    /// written to this address: now, or before.
    pub verified: bool,
    /// Program ID that it had, and that was read back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id_before: Option<u16>,
    /// Program ID that was read back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id_after: Option<u16>,
    /// How often it was tried.
    pub attempts: u32,
    /// s.
    pub time_s: f64,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Problem>,
}

/// What became of an update.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct UpdateObject {
    /// Nothing was sent but questions.
    pub dry_run: bool,
    /// Program ID that the boards must show; missing: nobody knows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// Why nobody knows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unverifiable: Option<String>,
    /// Bytes of both cycles.
    pub bytes: u64,
    /// Each board.
    pub boards: Vec<UpdatedObject>,
}

impl UpdateObject {
    fn of(report: &UpdateReport) -> Self {
        let board = |result: &UpdateResult| UpdatedObject {
            board: result.board,
            flash_number: result.flash_number,
            outcome: result.outcome.name().into(),
            verified: result.verified,
            program_id_before: result.before.filter(|i| i.has_application()).map(|info| info.program_id),
            program_id_after: result.after.filter(|i| i.has_application()).map(|info| info.program_id),
            attempts: result.attempts,
            time_s: result.time_us as f64 * 1e-6,
            error: result.failure.as_ref().map(|failure| {
                Problem::new("update", failure.to_string(), failure.hint())
                    .kind(failure.kind())
                    .with(Facts::default().at_board(result.board))
            }),
        };
        Self {
            dry_run: report.dry_run,
            program_id: report.program_id,
            unverifiable: report.unverifiable.map(|why| why.to_string().replace('`', "")),
            bytes: report.bytes,
            boards: report.boards.iter().map(board).collect(),
        }
    }
}

/// A board that runs.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct RunningObject {
    /// Its number.
    pub board: u8,
    /// Its outputs are enabled.
    pub active: bool,
}

/// What runs.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct RunObject {
    /// The boards.
    pub boards: Vec<RunningObject>,
    /// Load that they make on the bus, by forecast, %.
    pub load_percent: f64,
}

/// A job, while it goes on and afterwards.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct JobObject {
    /// Its number.
    pub number: u64,
    /// What it does.
    pub what: String,
    /// Who asked for it.
    pub client: String,
    /// `running`, `finished`, `cancelled` or `failed`.
    pub stage: String,
    /// Of a scan or of numbering: who is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chain: Option<ChainObject>,
    /// Of a doctor: what was found, the worst first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub findings: Option<Vec<FindingObject>>,
    /// Of an update: what became of each board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub update: Option<UpdateObject>,
    /// Of a start of control loops: what runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunObject>,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Problem>,
}

impl From<Job> for JobObject {
    fn from(job: Job) -> Self {
        let Job { number, what, client, stage, done, error } = job;
        let stage = stage.name().to_owned();
        let mut object =
            Self { number, what, client, stage, chain: None, findings: None, update: None, run: None, error };
        match done {
            Some(Done::Chain(boards, findings)) => {
                object.chain =
                    Some(ChainObject { boards: boards.iter().map(FoundObject::of).collect(), findings });
            }
            Some(Done::Findings(all)) => {
                object.findings = Some(all.iter().map(FindingObject::from).collect());
            }
            Some(Done::Update(report)) => object.update = Some(UpdateObject::of(&report)),
            Some(Done::Running(boards, load)) => {
                let running = |(board, admin): &(u8, ucom::Admin)| RunningObject {
                    board: *board,
                    active: admin.active,
                };
                object.run = Some(RunObject {
                    boards: boards.iter().map(running).collect(),
                    load_percent: load.percent(),
                });
            }
            None => {}
        }
        object
    }
}
