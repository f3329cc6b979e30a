//! Jobs of the agent and their results.
use agent_kit::api::{FindingObject, Problem};
use host_kit::{Diagnose as _, Facts};
use ucom_host::master::update::{UpdateReport, UpdateResult};
use utoipa::ToSchema;

use super::FoundObject;
use crate::jobs::{Done, Job};

/// Boards of the chain.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct ChainObject {
    /// Boards with a number.
    pub boards: Vec<FoundObject>,
    /// Unusual observations; empty: none.
    pub findings: Vec<String>,
}

/// Result of an update for one board.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct UpdatedObject {
    /// Number of the board.
    pub board: u8,
    /// Flash number of the bootloader, which identifies the board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_number: Option<u16>,
    /// Outcome: `not-started`, `cancelled`, `up-to-date`, `program-up-to-date`, `incomplete`, `unknown`, `written`,
    /// `verified` or `running`.
    pub outcome: String,
    /// `true` if the result is verified: the board reports the Program ID and date of the image. In addition, the
    /// records show that exactly this image was written to this address, in this update or in an earlier one.
    pub verified: bool,
    /// Program ID read back before the update.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id_before: Option<u16>,
    /// Program ID read back after the update.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id_after: Option<u16>,
    /// Number of attempts.
    pub attempts: u32,
    /// Duration, s.
    pub time_s: f64,
    /// Reason of a failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Problem>,
}

/// Result of an update.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct UpdateObject {
    /// `true` if the agent sent only requests that change nothing.
    pub dry_run: bool,
    /// Program ID that the boards must show; missing: not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// Reason why the Program ID is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unverifiable: Option<String>,
    /// Number of bytes that the agent sends in both cycles of the update.
    pub bytes: u64,
    /// Changes that the agent made to the images, such as a gap that it filled.
    pub notes: Vec<String>,
    /// Results for each board.
    pub boards: Vec<UpdatedObject>,
}

impl UpdateObject {
    fn of(report: &UpdateReport, notes: Vec<String>) -> Self {
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
                Problem::new("update", failure.to_string(), failure.diagnosis().next.of_board(result.board))
                    .kind(failure.kind())
                    .with(Facts::default().at_board(result.board))
            }),
        };
        Self {
            dry_run: report.dry_run,
            program_id: report.program_id,
            unverifiable: report.unverifiable.map(|why| why.to_string().replace('`', "")),
            bytes: report.bytes,
            notes,
            boards: report.boards.iter().map(board).collect(),
        }
    }
}

/// Running board.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct RunningObject {
    /// Number of the board.
    pub board: u8,
    /// `true` if its outputs are enabled.
    pub active: bool,
}

/// Running boards.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct RunObject {
    /// Boards that run.
    pub boards: Vec<RunningObject>,
    /// Predicted bus load of these boards, %.
    pub load_percent: f64,
}

/// Job, while it runs and afterwards.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct JobObject {
    /// Number of the job.
    pub number: u64,
    /// Description of the job.
    pub what: String,
    /// Name of the client that requested it.
    pub client: String,
    /// Stage: `running`, `finished`, `cancelled` or `failed`.
    pub stage: String,
    /// Boards of the chain, after a scan or a numbering.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chain: Option<ChainObject>,
    /// Findings of a doctor, worst first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub findings: Option<Vec<FindingObject>>,
    /// Result of an update for each board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub update: Option<UpdateObject>,
    /// Running boards, after a start of control loops.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<RunObject>,
    /// Reason of a failure.
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
            Some(Done::Update(report, notes)) => object.update = Some(UpdateObject::of(&report, notes)),
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
