//! Procedures of a chain of boards. The functions call `ucom-host` in the same order as the command `ucom` does.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use host_kit::ErrorKind;
use serde_json::{Value, json};
use ucom::profile::OnLost;
use ucom::{Profile, Status};
use ucom_host::ProfileFile as _;
use ucom_host::files::{Image, ImageOptions, Inventory};
use ucom_host::master::conformance::ConformanceOptions;
use ucom_host::master::probe::ProbeOptions;
use ucom_host::master::{InitOptions, Outcome, Reports, Request};
use ucom_host::session::{Boards, Numbered, SessionError, nothing_shared};

use super::objects;
use super::worker_state::WorkerState;
use crate::error::Failure;

/// Time for which the diagnosis (`doctor`) listens to the bus before it sends queries.
const LISTEN: Duration = Duration::from_millis(1500);

/// Returns the profile in a file, or the default profile. `on_lost` replaces the reaction to a lost board.
pub(super) fn profile(path: Option<&Path>, on_lost: Option<&str>) -> Result<Profile, Failure> {
    let mut profile = match path {
        None => Profile::default(),
        Some(path) => {
            let wrong = |e: &dyn std::fmt::Display| {
                Failure::usage(format!("{}: {e}", path.display())).next("ucom help profile lists every key")
            };
            let text = std::fs::read_to_string(path).map_err(|e| wrong(&e))?;
            Profile::from_toml(&text).map_err(|e| wrong(&e))?
        }
    };
    profile.on_lost = match on_lost {
        None => profile.on_lost,
        Some("report") => OnLost::Report,
        Some("stop-board") => OnLost::StopBoard,
        Some("stop-all") => OnLost::StopAll,
        Some(other) => {
            return Err(Failure::usage(format!(
                "on_lost: {other:?} is not valid, expected report, stop-board or stop-all"
            )));
        }
    };
    Ok(profile)
}

/// Combines several findings into one failure.
fn findings(kind: ErrorKind, code: &'static str, texts: &[String], next: &'static str) -> Failure {
    Failure::new(kind, code, texts.join("; ")).next(next)
}

/// Queries all boards and changes nothing.
pub(super) fn scan(state: &mut WorkerState) -> Result<Value, Failure> {
    let report = match state.driver.run(Request::Scan)? {
        Outcome::Scan(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    if report.boards.is_empty() && report.reports.ids.is_empty() {
        return Err(SessionError::NoBoards.into());
    }
    nothing_shared(&state.driver.master)?;
    let profile = state.driver.master.profile();
    Ok(json!({
        "boards": objects::boards(&report.boards, &profile, state.inventory.as_ref()),
        "reports": report.reports.ids,
        "findings": objects::texts(&report.findings),
    }))
}

/// Resets and numbers the whole chain. `listed` is the current content of the inventory file. Returns the new inventory. The caller writes
/// the new inventory to the file, because a slow disk would delay the heartbeats here.
pub(super) fn init(
    state: &mut WorkerState,
    listed: Option<Inventory>,
    (renew, force, check): (bool, bool, bool),
) -> Result<(Value, Option<Inventory>), Failure> {
    // The content of the inventory file takes precedence, because another program can have changed the file.
    state.inventory = listed.or_else(|| state.inventory.take().map(Inventory::without_records));
    let compared = state.inventory.as_ref().filter(|_| state.inventory_file.is_some() && !renew);
    let expected = compared.map(|i| i.boards().map(|b| (b.number, b.flash_number)).collect());
    let options = InitOptions { expected: expected.unwrap_or_default(), force };
    let outcome = state.driver.run(Request::Init(options));
    state.renumbered(match &outcome {
        Ok(Outcome::Init(report)) => Some(report),
        _ => None,
    });
    let report = match outcome? {
        Outcome::Init(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    if report.is_ok() {
        let made = Inventory::of_init(&report, state.inventory.as_ref());
        state.inventory = Some(made.map_err(|e| Failure::usage(e.to_string()))?);
    }
    let texts = objects::texts(&report.findings);
    if let Some(kind) = report.failure().filter(|_| check) {
        return Err(findings(kind, "init", &texts, "find the reason with doctor()"));
    }
    let profile = state.driver.master.profile();
    let value = json!({
        "boards": objects::boards(&report.boards, &profile, state.inventory.as_ref()),
        "reports": report.reports.ids,
        "findings": texts,
    });
    Ok((value, state.inventory.clone().filter(|_| report.is_ok())))
}

/// Reads the information that boards report about themselves.
pub(super) fn info(state: &mut WorkerState, boards: &Boards) -> Result<Value, Failure> {
    let mut all = Vec::new();
    for board in state.driver.numbers(boards)? {
        all.push(state.driver.seen(board)?);
    }
    let profile = state.driver.master.profile();
    Ok(objects::boards(&all, &profile, state.inventory.as_ref()))
}

/// Converts boards and their status.
pub(super) fn numbered(state: &WorkerState, all: &[Numbered]) -> Value {
    let profile = state.driver.master.profile();
    all.iter().map(|(n, info)| objects::info(*n, info, &profile, state.inventory.as_ref())).collect()
}

/// Converts names of status bits to bits.
fn bits(names: &[String]) -> Result<Status, Failure> {
    let bit = |name: &String| {
        Status::bit(name).ok_or_else(|| {
            let names: Vec<&str> = Status::NAMES.iter().map(|(name, _)| *name).collect();
            Failure::usage(format!("status bit {name:?} does not exist; the bits are {}", names.join(" ")))
        })
    };
    names.iter().try_fold(Status(0), |all, name| Ok(all | bit(name)?))
}

/// Sets and clears status bits, then returns the status.
pub(super) fn status(
    state: &mut WorkerState,
    boards: &Boards,
    (set, clear): (&[String], &[String]),
    force: bool,
) -> Result<Value, Failure> {
    let (set, clear) = (bits(set)?, bits(clear)?);
    let (both, mirrors) = (set & clear, (set | clear) & Status::MIRRORS);
    if both != Status(0) {
        return Err(Failure::usage(format!("{both}: a bit cannot be set and cleared in the same call")));
    }
    if mirrors != Status(0) {
        let text = format!("{mirrors}: this bit shows a state of the board and cannot be written");
        return Err(Failure::usage(text).next("use start(), stop() or init() to change this state"));
    }
    let numbers = state.driver.numbers(boards)?;
    let all = match set | clear {
        Status(0) => state.driver.statuses(&numbers)?,
        mask => {
            let request = |board| Request::SetStatus { board, mask, value: set, force };
            let all = match set.has(Status::MSTART) {
                true => state.starting(&numbers, |session| session.driver.change_each(&numbers, request))?,
                false => state.driver.change_each(&numbers, request)?,
            };
            for (board, info) in &all {
                match (info.status.has(Status::INIT), info.status.has(Status::MSTART)) {
                    (false, _) => state.forget(*board),
                    (true, false) => state.runs_no_more(Some(*board)),
                    (true, true) => {}
                }
            }
            all
        }
    };
    Ok(numbered(state, &all))
}

/// Resets boards so that they enter the exloader with programming enabled (PC_XRESET).
pub(super) fn xreset(state: &mut WorkerState, boards: &Boards, force: bool) -> Result<Value, Failure> {
    let numbers = state.driver.numbers(boards)?;
    let all = state.driver.change_each(&numbers, |board| Request::XReset { board, force })?;
    numbers.iter().for_each(|board| state.forget(*board));
    Ok(numbered(state, &all))
}

/// Resets boards (PC_RESET), either all boards at once or one board after the other. Returns the low byte of the flash number of each
/// board that sent a report.
pub(super) fn reset(state: &mut WorkerState, boards: &Boards, force: bool) -> Result<Vec<u8>, Failure> {
    let targets: Vec<Option<u8>> = match boards {
        Boards::All => vec![None],
        Boards::None => Vec::new(),
        Boards::Some(numbers) => numbers.iter().copied().map(Some).collect(),
    };
    let mut reports = Reports::default();
    for board in targets {
        match state.driver.run(Request::Reset { board, force })? {
            Outcome::Reset(some) => reports.ids.extend(some.ids),
            other => return Err(SessionError::from(other).into()),
        }
        match board {
            Some(board) => state.forget(board),
            None => {
                state.runs_no_more(None);
                state.held.borrow_mut().known.clear();
            }
        }
    }
    if reports.ids.is_empty() {
        let text = ["no board reported after the reset".to_owned()];
        return Err(findings(ErrorKind::NoLink, "no-boards", &text, "find the reason with doctor()"));
    }
    Ok(reports.ids.into_iter().collect())
}

/// Restores the number of one board.
pub(super) fn repair(
    state: &mut WorkerState,
    board: u8,
    flash_number: Option<u16>,
    force: bool,
) -> Result<Value, Failure> {
    let listed = state.inventory.as_ref().and_then(|i| i.get(board)).map(|known| known.flash_number);
    let flash_number = flash_number.or(listed).ok_or_else(|| {
        Failure::usage(format!("the flash number of board {board} is missing: no inventory has this board"))
            .next("pass its flash_number, or an inventory to connect()")
    })?;
    match state.driver.run(Request::Repair { board, flash_number, force })? {
        Outcome::Repaired(seen) => {
            state.forget(board);
            Ok(objects::board(&seen, &state.driver.master.profile(), state.inventory.as_ref()))
        }
        other => Err(SessionError::from(other).into()),
    }
}

/// Listens to the bus, queries the boards if queries cannot disturb the bus, and reports the findings.
pub(super) fn doctor(state: &mut WorkerState) -> Result<Value, Failure> {
    let seen = state.driver.examine(LISTEN)?;
    let profile = state.driver.master.profile();
    Ok(json!({
        "healthy": seen.failure().is_none(),
        "findings": seen.findings,
        "boards": objects::boards(&seen.boards, &profile, state.inventory.as_ref()),
    }))
}

/// Reads the image file of a board's application. Returns the bytes that would be sent to the board.
pub(super) fn probed_image(path: &Path) -> Result<Arc<[u8]>, Failure> {
    let image = Image::read(path, &ImageOptions::default()).map_err(|e| Failure::usage(e.to_string()))?;
    Ok(image.into_bytes().into())
}

/// Measures how boards interpret the protocol.
pub(super) fn probe(state: &mut WorkerState, options: ProbeOptions) -> Result<Value, Failure> {
    let init = options.init;
    let outcome = state.driver.run(Request::Probe(options));
    if init {
        state.renumbered(match &outcome {
            Ok(Outcome::Probe(report)) => report.init.as_ref(),
            _ => None,
        });
    }
    match outcome? {
        Outcome::Probe(report) if report.boards.is_empty() && report.reports == 0 => {
            Err(SessionError::NoBoards.into())
        }
        Outcome::Probe(report) => Ok(json!({
            "boards": report.boards,
            "rows": report.rows,
            "profile": report.profile.to_toml(),
        })),
        other => Err(SessionError::from(other).into()),
    }
}

/// Tests boards against the protocol.
pub(super) fn conformance(
    state: &mut WorkerState,
    boards: &Boards,
    (init, run, force): (bool, bool, bool),
    only: Vec<String>,
) -> Result<Value, Failure> {
    let boards = match boards {
        Boards::All => Vec::new(),
        boards => state.driver.numbers(boards)?,
    };
    let options = ConformanceOptions { boards, init, run, program: None, only, force };
    match state.driver.run(Request::Conformance(options))? {
        Outcome::Conformance(report) => {
            if let Some(error) = report.error {
                return Err(error.into());
            }
            Ok(json!({ "tests": report.tests, "left": report.left }))
        }
        other => Err(SessionError::from(other).into()),
    }
}
