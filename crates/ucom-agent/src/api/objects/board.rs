//! Boards in their last known state, boards that a scan has found, and boards that have answered a command.
use ucom::{Profile, Status};
use ucom_host::date_text;
use ucom_host::master::{Board, BoardSeen, Life};
use utoipa::ToSchema;

use crate::snapshot::BusSnapshot;

/// Last known state of a board.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct BoardObject {
    /// Number of the board.
    pub number: u8,
    /// Flash number of the bootloader, which identifies the board; missing before the first answer of the board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_number: Option<u16>,
    /// Description that the board reports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// State: `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`.
    pub state: String,
    /// State of its heartbeats: `alive`, `late`, `lost`, or `none` if no heartbeats are expected.
    pub heartbeat: String,
    /// Age of the last heartbeat, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heartbeat_age_s: Option<f64>,
    /// Names of the status bits that are set.
    pub status: Vec<String>,
    /// `true` if the outputs of the board were enabled in its last report.
    pub active: bool,
    /// `true` if it has an application.
    pub application: bool,
    /// Program ID of the application.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// Flash date of the application.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_date: Option<String>,
    /// Number of errors that it has reported.
    pub errors: u64,
    /// Last error that it has reported.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_error: Option<String>,
    /// Number of frames of this board in the last second.
    pub frames_per_s: u64,
    /// Names of its values; missing until they are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offers: Option<OffersObject>,
}

/// Names of the values of a board's application.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct OffersObject {
    /// Description of the application.
    pub description: String,
    /// Names of controller inputs.
    pub inputs: Vec<String>,
    /// Names of sensor outputs.
    pub outputs: Vec<String>,
    /// Names of parameters.
    pub parameters: Vec<String>,
}

fn bits(status: Status) -> Vec<String> {
    Status::NAMES.iter().filter(|(_, bit)| status.has(*bit)).map(|(name, _)| (*name).to_owned()).collect()
}

impl BoardObject {
    /// Returns all boards in a snapshot.
    pub(crate) fn all(snapshot: &BusSnapshot) -> Vec<Self> {
        snapshot.boards.iter().map(|(number, board)| Self::of(snapshot, number, board)).collect()
    }

    /// Returns one board in a snapshot.
    pub(crate) fn of(snapshot: &BusSnapshot, number: u8, board: &Board) -> Self {
        let now_us = snapshot.clock_us();
        let info = board.info;
        let program = info.filter(|info| info.has_application());
        let offers = snapshot.values.get(&number).map(|values| &values.known.names);
        Self {
            number,
            flash_number: info.map(|info| info.flash_number),
            description: board.description.clone(),
            state: board.state_name(now_us).into(),
            heartbeat: if board.life == Life::Unarmed { "none" } else { board.life.name() }.into(),
            heartbeat_age_s: board.alive_age_s(now_us),
            status: board.status().filter(|_| board.is_known()).map(bits).unwrap_or_default(),
            active: board.admin.is_some_and(|admin| admin.active),
            application: program.is_some(),
            program_id: program.map(|info| info.program_id),
            flash_date: program.map(|info| date_text(&snapshot.profile, info.date)),
            errors: board.error_count,
            last_error: board.errors.last().map(|(_, code)| code.name().into()),
            frames_per_s: snapshot.statistics.frames_per_s(number, now_us),
            offers: offers.map(|names| OffersObject {
                description: names.description.clone(),
                inputs: names.ci.clone(),
                outputs: names.so.clone(),
                parameters: names.par.clone(),
            }),
        }
    }
}

/// Board that has answered during a scan or a numbering.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct FoundObject {
    /// Number of the board.
    pub number: u8,
    /// Flash number of the bootloader, which identifies the board.
    pub flash_number: u16,
    /// Description that the board reports.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// Program ID of its application.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// Names of the status bits that are set.
    pub status: Vec<String>,
}

impl FoundObject {
    pub(super) fn of(seen: &BoardSeen) -> Self {
        Self {
            number: seen.number,
            flash_number: seen.info.flash_number,
            description: seen.description.clone(),
            program_id: seen.info.has_application().then_some(seen.info.program_id),
            status: bits(seen.info.status),
        }
    }
}

/// State of a board, as the board reports it after a command.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct AnswerObject {
    /// Number of the board.
    pub board: u8,
    /// State: `exloader`, `programming`, `started`, `running`.
    pub state: String,
    /// Names of the status bits that are set.
    pub status: Vec<String>,
    /// Flash date of its application.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_date: Option<String>,
}

impl AnswerObject {
    pub(crate) fn of((board, info): &ucom_host::session::Numbered, profile: &Profile) -> Self {
        Self {
            board: *board,
            state: ucom_host::master::state_name(info.status).into(),
            status: bits(info.status),
            flash_date: info.has_application().then(|| date_text(profile, info.date)),
        }
    }
}
