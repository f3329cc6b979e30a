//! Updates the firmware of boards: checks the image, writes it, and reads back its Program ID and date.

use std::path::PathBuf;

use host_kit::{Diagnose as _, ErrorKind};
use serde_json::{Value, json};
use ucom::{BoardInfo, Profile};
use ucom_host::date_text;
use ucom_host::files::image::{AddressUnit, Format, Gaps, ImageAdvice};
use ucom_host::files::inventory::IdentifyError;
use ucom_host::files::{Image, ImageError, ImageOptions};
use ucom_host::master::Event;
use ucom_host::master::update::{
    Progress, UpdateImage, UpdateMode, UpdateOptions, UpdateReport, UpdateResult, UpdateTarget, has_header,
};
use ucom_host::session::Boards;

use super::shared::UPDATED;
use super::worker_state::WorkerState;
use crate::error::Failure;

/// Source of an update image.
pub(super) enum Source {
    File(PathBuf),
    Bytes(Vec<u8>),
}

/// Options for reading image files.
pub(super) struct Read {
    pub raw: bool,
    pub addresses: Option<String>,
    pub fill_gaps: bool,
    pub name_target: bool,
    /// Requested year, month and day; `None` means the current date.
    pub date: Option<(u16, u8, u8)>,
    pub today: (u16, u8, u8),
}

/// Update job: boards, image and options.
pub(super) struct Update {
    pub boards: Boards,
    pub image: UpdateImage,
    pub second: Option<UpdateImage>,
    /// Flash date in the format of the profile.
    pub date: u16,
    /// `true` if the caller did not pass a date.
    pub any_date: bool,
    pub flash_number: Option<u16>,
    pub expect_program_id: Option<u16>,
    pub name_target: bool,
    pub group: bool,
    pub start: bool,
    pub dry_run: bool,
    pub unverified: bool,
    pub force: bool,
    pub rewrite: bool,
    pub check: bool,
}

impl Read {
    /// Reads the image. If the two cycles of an update send different images, reads both images. Also returns the
    /// flash date in the format of the profile.
    pub(super) fn read(
        &self,
        first: &Source,
        second: Option<&Source>,
        profile: &Profile,
    ) -> Result<(UpdateImage, Option<UpdateImage>, u16), Failure> {
        let address_unit = match self.addresses.as_deref() {
            None => None,
            Some("byte") => Some(AddressUnit::Byte),
            Some("word") => Some(AddressUnit::Word),
            Some(other) => {
                return Err(Failure::usage(format!(
                    "addresses: {other:?} is not valid, expected \"byte\" or \"word\""
                )));
            }
        };
        let gaps = if self.fill_gaps { Gaps::Fill(0xFF) } else { Gaps::Refuse };
        let format = self.raw.then_some(Format::Bin);
        let options = ImageOptions { format, address_unit, gaps, ..Default::default() };
        if self.name_target && !has_header(profile) {
            let text = "name_target: the name is part of the header, but the profile sends no header";
            return Err(Failure::usage(text));
        }
        let second = second.map(|source| image(source, &options)).transpose()?;
        Ok((image(first, &options)?, second, self.day(profile)?))
    }

    /// Returns the flash date in the format of the profile, or 0 if the profile sends no header.
    fn day(&self, profile: &Profile) -> Result<u16, Failure> {
        if !has_header(profile) {
            let text = "date: the date is part of the header, but the profile sends no header";
            return self.date.map_or(Ok(0), |_| Err(Failure::usage(text)));
        }
        let (year, month, day) = self.date.unwrap_or(self.today);
        let form = profile.prog_date;
        form.encode(year, month, day).ok_or_else(|| {
            let text = format!("{year:04}-{month:02}-{day:02} is not a valid date for prog.date = {form}");
            Failure::usage(text)
        })
    }
}

fn image(source: &Source, options: &ImageOptions) -> Result<UpdateImage, Failure> {
    let read = match source {
        Source::File(path) => Image::read(path, options),
        Source::Bytes(bytes) => Image::parse(bytes, options),
    };
    let image = read.map_err(|e| {
        let text = e.to_string();
        let name = match source {
            Source::File(path) => path.display().to_string(),
            Source::Bytes(_) => "image".into(),
        };
        // The file name is added only if the error text does not contain it.
        Failure::usage(if text.contains(&name) { text.clone() } else { format!("{name}: {text}") })
            .next(advice(&e))
    })?;
    Ok(image.into())
}

/// Returns the advice for an invalid image file. The advice never suggests that a check of the file content can be omitted.
fn advice(error: &ImageError) -> &'static str {
    match error.advice() {
        ImageAdvice::None => "",
        ImageAdvice::NameRaw => {
            "if these are the raw bytes of a program, rename the file to .bin or pass raw=True"
        }
        ImageAdvice::Rename => "if these are the raw bytes of a program, rename the file to .bin",
        ImageAdvice::FillGaps => "if the board may get FF there, fill the gaps with fill_gaps=True",
        ImageAdvice::OtherUnit(AddressUnit::Byte) => {
            "pass addresses=\"byte\" if the tool chain counts bytes, or fill_gaps=True if the gap is intended"
        }
        ImageAdvice::OtherUnit(AddressUnit::Word) => {
            "pass addresses=\"word\" if the tool chain counts words, or fill_gaps=True if the gap is intended"
        }
        ImageAdvice::MakeAgain | ImageAdvice::Addresses => {
            "build the file again with the tool chain; supported images are Intel HEX, S-record, and raw \
             bytes in a .bin"
        }
    }
}

/// Returns the selected boards, each with the flash number that it must have. The flash number is passed by the
/// caller or read from the inventory.
fn targets(state: &WorkerState, update: &Update, numbers: &[u8]) -> Result<Vec<UpdateTarget>, Failure> {
    if let Some(flash) = update.flash_number {
        return match numbers {
            [board] => Ok(vec![UpdateTarget { board: *board, flash_number: Some(flash) }]),
            _ => {
                let text =
                    format!("flash_number selects one board, but {} boards are selected", numbers.len());
                Err(Failure::usage(text).next("for several boards, use the inventory of init()"))
            }
        };
    }
    // Without an inventory, the board number alone selects a single board. An update of several boards requires an
    // inventory.
    if let ([board], Boards::Some(_), None) = (numbers, &update.boards, &state.inventory) {
        return Ok(vec![UpdateTarget { board: *board, flash_number: None }]);
    }
    let target = |board: &u8| {
        let listed = state.inventory.as_ref().and_then(|inventory| inventory.get(*board));
        let flash_number = listed.map(|known| known.flash_number).ok_or_else(|| not_listed(state, *board))?;
        Ok(UpdateTarget { board: *board, flash_number: Some(flash_number) })
    };
    numbers.iter().map(target).collect()
}

/// Returns the failure for a board that the inventory does not list.
fn not_listed(state: &WorkerState, board: u8) -> Failure {
    let path = state.inventory_file.clone().unwrap_or_else(|| "of this chain".into());
    let error = match state.inventory {
        Some(_) => IdentifyError::NotListed { board, path },
        None => IdentifyError::NoInventory { board, path },
    };
    let mut own = Failure::of(&error);
    own.next = "create an inventory with init(), or update one board with its flash_number".into();
    own
}

/// Returns the selected boards. `all` selects the boards that answer and the boards of the inventory. A missing board is therefore
/// reported.
fn numbers(state: &mut WorkerState, boards: &Boards) -> Result<Vec<u8>, Failure> {
    let mut numbers = state.driver.numbers(boards)?;
    if let (Boards::All, Some(inventory)) = (boards, &state.inventory) {
        numbers.extend(inventory.boards().map(|board| board.number));
        numbers.sort_unstable();
        numbers.dedup();
    }
    Ok(numbers)
}

/// Programs the selected boards. `report` receives the progress.
pub(super) fn update(
    state: &mut WorkerState,
    update: Update,
    report: &dyn Fn(Value),
) -> Result<Value, Failure> {
    let profile = state.driver.master.profile();
    let numbers = numbers(state, &update.boards)?;
    let targets = targets(state, &update, &numbers)?;
    let several = targets.len() > 1;
    let options = UpdateOptions {
        dry_run: update.dry_run,
        force: update.force,
        rewrite: update.rewrite,
        any_date: update.any_date,
        start: update.start,
        accept_unverified: update.unverified,
        mode: if update.group { UpdateMode::Group } else { UpdateMode::OneByOne },
        second: update.second,
        expect_program_id: update.expect_program_id,
        name_target: update.name_target,
        // If a board fails, the update of the other boards continues.
        keep_going: several,
        ..UpdateOptions::new(targets, update.image, update.date)
    };
    let mut see = |event: &Event| {
        if let Event::Progress { progress, .. } = event {
            report(step(progress));
        }
    };
    let done = state.session.driver.update(options, &mut state.records, &mut see)?;
    state.updated(&done, update.start);
    note_outcomes(state, &done);
    match done.failure().filter(|_| update.check) {
        Some(kind) => Err(failed(&done, kind)),
        None => Ok(object(&done, &profile)),
    }
}

/// Adds an event with the result of each board, because the report does not always reach a caller.
fn note_outcomes(state: &WorkerState, report: &UpdateReport) {
    let time_s = state.driver.now_us() as f64 * 1e-6;
    for one in report.boards.iter().filter(|_| !report.dry_run) {
        let (board, outcome) = (one.board, one.outcome.name());
        let why = one.failure.as_ref().map_or_else(String::new, |failure| format!(": {failure}"));
        state.shared.event(time_s, UPDATED, Some(board), format!("board {board}: {outcome}{why}"));
    }
}

fn step(progress: &Progress) -> Value {
    json!({
        "boards": progress.boards,
        "attempt": progress.attempt,
        "cycle": progress.cycle,
        "bytes": progress.bytes,
        "total_bytes": progress.total,
        "rate": progress.rate,
        "remaining_s": progress.remaining_us as f64 * 1e-6,
    })
}

/// Returns the failure of an unsuccessful update.
fn failed(report: &UpdateReport, kind: ErrorKind) -> Failure {
    let failures: Vec<_> =
        report.boards.iter().filter_map(|b| Some((b.board, b.failure.as_ref()?))).collect();
    let texts: Vec<String> =
        failures.iter().map(|(board, failure)| format!("board {board}: {failure}")).collect();
    let gravest = failures.iter().find(|(_, failure)| failure.kind() == kind);
    let Some((board, failure)) = gravest else {
        let (message, next) = report.unproven();
        let next =
            [next.replace("`rewrite`", "rewrite=True"), "or accept the result with unverified=True".into()]
                .join("; ");
        return Failure::new(kind, "not-verified", message).next(next);
    };
    let mut own = Failure::of(*failure).message(texts.join("; "));
    own.kind = kind;
    own.facts.board = Some(*board).filter(|_| failures.len() == 1);
    own
}

fn object(report: &UpdateReport, profile: &Profile) -> Value {
    json!({
        "dry_run": report.dry_run,
        "program_id": report.program_id,
        "flash_date": has_header(profile).then(|| date_text(profile, report.date)),
        "bytes": report.bytes,
        "unverifiable": report.unverifiable.map(|why| why.to_string()),
        "boards": report.boards.iter().map(|one| result(one, report, profile)).collect::<Vec<_>>(),
    })
}

fn result(one: &UpdateResult, report: &UpdateReport, profile: &Profile) -> Value {
    let shown = |info: Option<BoardInfo>| {
        let info = info.filter(BoardInfo::has_application);
        json!([info.map(|i| i.program_id), info.map(|i| date_text(profile, i.date))])
    };
    json!({
        "board": one.board,
        "flash_number": one.flash_number,
        "outcome": one.outcome.name(),
        "note": report.shown_already(one, profile).unwrap_or_default(),
        "verified": one.verified,
        "before": shown(one.before),
        "after": shown(one.after),
        "attempts": one.attempts,
        "time_s": one.time_us as f64 * 1e-6,
        "error": one.failure.as_ref().map(ToString::to_string).unwrap_or_default(),
    })
}
