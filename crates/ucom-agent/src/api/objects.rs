//! What the API sends: one type for each object, from which its description is made.
use agent_kit::access::Role;
use agent_kit::api::Problem;
use host_kit::{Diagnose as _, Finding, Severity};
use serde_json::Value;
use ucom::{Profile, Status};
use ucom_host::date_text;
use ucom_host::files::Signal;
use ucom_host::master::io::{Kind, ParValue};
use ucom_host::master::update::{UpdateOutcome, UpdateReport, UpdateResult};
use ucom_host::master::{Board, BoardSeen, Life};
use utoipa::ToSchema;

use crate::jobs::{Done, Job};
use crate::picture::{Picture, Values};

/// Outputs that are older are not those of now, µs.
const OLD_US: u64 = 500_000;

/// The bus, and who commands.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct StatusObject {
    /// Nothing moves: the boards are simulated.
    pub simulated: bool,
    /// The bus.
    pub bus: String,
    /// Why the bus is gone; missing while it is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<String>,
    /// How old this is, ms.
    pub age_ms: u64,
    /// Boards that are known.
    pub boards: usize,
    /// Load of the bus over the last second, %.
    pub load_percent: f64,
    /// Frames that were received, and sent.
    pub received: u64,
    /// Frames that this agent has sent.
    pub sent: u64,
    /// Frames that are not of this protocol.
    pub foreign_frames: u64,
    /// This agent sends heartbeats: it has commanded something since its start.
    pub is_master: bool,
    /// Another PC commands on this bus.
    pub competing_master: bool,
    /// Numbers that two boards have, in words.
    pub shared_numbers: Vec<String>,
    /// What the CAN adapter reports; missing where it reports nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerObject>,
    /// Who commands; missing where nobody does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseObject>,
    /// What the caller may do.
    pub role: Role,
    /// Which agent this is, by a number that it was given at its start.
    pub agent: String,
    /// Number of the last event.
    pub last_event: u64,
}

/// Who commands.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseObject {
    /// Its name.
    pub holder: String,
    /// Since when, ms.
    pub age_ms: u64,
    /// Until it lapses, ms.
    pub left_ms: u64,
    /// Who asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// How the CAN controller of this computer gets on with the bus.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ControllerObject {
    /// It has left the bus.
    pub bus_off: bool,
    /// How often it has.
    pub times_bus_off: u64,
    /// It is error passive.
    pub passive: bool,
    /// Transmit error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tec: Option<u16>,
    /// Receive error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rec: Option<u16>,
}

impl StatusObject {
    /// What a picture shows; what it does not show is empty.
    pub(crate) fn of(picture: &Picture) -> Self {
        let (statistics, now_us) = (&picture.statistics, picture.now_us);
        Self {
            simulated: false,
            bus: String::new(),
            lost: None,
            age_ms: picture.at.elapsed().as_millis() as u64,
            boards: picture.boards.iter().count(),
            load_percent: statistics.load_percent(now_us),
            received: statistics.received,
            sent: statistics.sent,
            foreign_frames: statistics.foreign_count(),
            is_master: picture.is_master,
            competing_master: picture.competing_us.is_some(),
            shared_numbers: picture.shared.clone(),
            controller: picture.controller.map(|controller| ControllerObject {
                bus_off: controller.bus_off,
                times_bus_off: controller.times_bus_off,
                passive: controller.passive,
                tec: controller.tec,
                rec: controller.rec,
            }),
            lease: None,
            role: Role::Viewer,
            agent: String::new(),
            last_event: 0,
        }
    }
}

/// A board as last seen.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct BoardObject {
    /// Its number.
    pub number: u8,
    /// Number of its bootloader: who it is; missing before it has answered.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_number: Option<u16>,
    /// Its description of itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`.
    pub state: String,
    /// Its heartbeats: `alive`, `late`, `lost`, or `none` where none is expected.
    pub heartbeat: String,
    /// Since the last heartbeat, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heartbeat_age_s: Option<f64>,
    /// The bits of its status that are set.
    pub status: Vec<String>,
    /// Its outputs are enabled, as it last reported.
    pub active: bool,
    /// It has an application.
    pub application: bool,
    /// Program ID of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// When that was flashed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flash_date: Option<String>,
    /// Errors that it has reported.
    pub errors: u64,
    /// The last of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub last_error: Option<String>,
    /// Frames of it in the last second.
    pub frames_per_s: u64,
    /// What it offers; missing before its names are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offers: Option<OffersObject>,
}

/// Names of what a board's application has.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct OffersObject {
    /// The description of the application.
    pub description: String,
    /// Controller inputs.
    pub inputs: Vec<String>,
    /// Sensor outputs.
    pub outputs: Vec<String>,
    /// Parameters.
    pub parameters: Vec<String>,
}

fn bits(status: Status) -> Vec<String> {
    Status::NAMES.iter().filter(|(_, bit)| status.has(*bit)).map(|(name, _)| (*name).to_owned()).collect()
}

impl BoardObject {
    /// All boards of a picture.
    pub(crate) fn all(picture: &Picture) -> Vec<Self> {
        picture.boards.iter().map(|(number, board)| Self::of(picture, number, board)).collect()
    }

    /// One of them.
    pub(crate) fn of(picture: &Picture, number: u8, board: &Board) -> Self {
        let now_us = picture.clock_us();
        let info = board.info;
        let program = info.filter(|info| info.has_application());
        let offers = picture.values.get(&number).map(|values| &values.known.names);
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
            flash_date: program.map(|info| date_text(&picture.profile, info.date)),
            errors: board.error_count,
            last_error: board.errors.last().map(|(_, code)| code.name().into()),
            frames_per_s: picture.statistics.frames_per_s(number, now_us),
            offers: offers.map(|names| OffersObject {
                description: names.description.clone(),
                inputs: names.ci.clone(),
                outputs: names.so.clone(),
                parameters: names.par.clone(),
            }),
        }
    }
}

/// Values of a board.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ValuesObject {
    /// Its number.
    pub board: u8,
    /// Since its outputs came, s; missing before the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub age_s: Option<f64>,
    /// These are not the outputs of now: they are older than half a second, or the board is late or lost, or has left its control loop.
    pub stale: bool,
    /// Sensor outputs; empty before the first.
    pub outputs: Vec<ValueObject>,
    /// Controller inputs as last set.
    pub inputs: Vec<ValueObject>,
    /// Parameters as this agent believes them to be: boards have no way to read them back.
    pub parameters: Vec<ValueObject>,
}

/// A value.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ValueObject {
    /// Its name.
    pub name: String,
    /// Its place in the buffer.
    pub index: usize,
    /// The number in its unit, true or false, or a word as text, by the signal table; missing where it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Value>)]
    pub value: Option<Value>,
    /// For people, with its unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// Its unit, where the signal table has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
}

impl ValueObject {
    /// A word of a signal.
    pub(crate) fn of(name: &str, index: usize, signal: Option<&Signal>, word: Option<u16>) -> Self {
        let value = |word: u16| signal.map_or_else(|| Value::from(word as i16), |signal| signal.json(word));
        let unit = signal.filter(|signal| signal.known && !signal.unit.is_empty());
        Self {
            name: name.to_owned(),
            index,
            value: word.map(value),
            text: word.map(|word| signal.map_or_else(|| word.to_string(), |s| s.text_with_unit(word))),
            unit: unit.map(|signal| signal.unit.clone()),
        }
    }
}

impl ValuesObject {
    pub(crate) fn of(picture: &Picture, values: &Values) -> Self {
        let (known, now_us) = (&values.known, picture.clock_us());
        let board = picture.boards.get(known.board);
        let list = |kind: Kind, words: Vec<Option<u16>>| {
            let (names, signals) = (known.names.names(kind), known.signals.all(kind));
            let value = |(index, word): (usize, Option<u16>)| {
                let name = names.get(index).map_or("", String::as_str);
                ValueObject::of(name, index, signals.get(index), word)
            };
            words.into_iter().enumerate().map(value).collect()
        };
        let outputs = values.outputs.as_ref();
        let age_us = outputs.map(|outputs| now_us.saturating_sub(outputs.time_us));
        let runs =
            board.is_some_and(|b| b.is_known() && b.life != Life::Late && b.admin.is_none_or(|a| a.run));
        let parameter = |value: &ParValue| match value {
            ParValue::Assumed(word) => Some(*word),
            ParValue::Unknown => None,
        };
        Self {
            board: known.board,
            age_s: age_us.map(|us| us as f64 * 1e-6),
            stale: !runs || age_us.is_none_or(|us| us > OLD_US),
            outputs: list(
                Kind::So,
                outputs.map(|o| o.words.iter().copied().map(Some).collect()).unwrap_or_default(),
            ),
            inputs: list(Kind::Ci, values.inputs.iter().copied().map(Some).collect()),
            parameters: list(Kind::Par, values.parameters.iter().map(parameter).collect()),
        }
    }
}

/// A board as it answered.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct FoundObject {
    /// Its number.
    pub number: u8,
    /// Number of its bootloader: who it is.
    pub flash_number: u16,
    /// Its description of itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// Program ID of its application.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub program_id: Option<u16>,
    /// The bits of its status that are set.
    pub status: Vec<String>,
}

impl FoundObject {
    fn of(seen: &BoardSeen) -> Self {
        Self {
            number: seen.number,
            flash_number: seen.info.flash_number,
            description: seen.description.clone(),
            program_id: seen.info.has_application().then_some(seen.info.program_id),
            status: bits(seen.info.status),
        }
    }
}

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
        let plain = |text: &str| text.replace('`', "");
        let Finding { what, why, next, .. } = finding;
        Self { severity: severity.into(), what: what.clone(), why: plain(why), next: plain(next) }
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
    /// `not-started`, `cancelled`, `up-to-date`, `incomplete`, `unknown`, `written`, `verified` or `running`.
    pub outcome: String,
    /// What the board showed when it was read back is what was sent.
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
            verified: match result.outcome {
                UpdateOutcome::Verified | UpdateOutcome::UpToDate => true,
                UpdateOutcome::Running => report.unverifiable.is_none(),
                _ => false,
            },
            program_id_before: result.before.filter(|i| i.has_application()).map(|info| info.program_id),
            program_id_after: result.after.filter(|i| i.has_application()).map(|info| info.program_id),
            attempts: result.attempts,
            time_s: result.time_us as f64 * 1e-6,
            error: result.failure.as_ref().map(|failure| {
                Problem::new("update", failure.to_string(), failure.hint().replace('`', ""))
                    .kind(failure.kind())
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

/// A board after a command, as it answered.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct AnswerObject {
    /// Its number.
    pub board: u8,
    /// What it does: `exloader`, `programming`, `started`, `running`.
    pub state: String,
    /// The bits of its status that are set.
    pub status: Vec<String>,
    /// When its application was flashed.
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
