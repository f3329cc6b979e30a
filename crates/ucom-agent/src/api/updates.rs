//! Firmware updates: the client uploads images; the agent checks the images, writes them and reads them back.
use agent_kit::api::{Body, Problem, Refusals};
use agent_kit::gate::Asker;
use agent_kit::halt::{AskedAfter, KnownHalt};
use agent_kit::lease::LeaseKey;
use axum::Json;
use axum::body::Bytes;
use axum::extract::{FromRequest as _, Request, State};
use axum::http::StatusCode;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use host_kit::{ErrorKind, Facts};
use time::{Date, Month, OffsetDateTime};
use ucom::Profile;
use ucom_host::files::image::{AddressUnit, Format, Gaps, ImageAdvice};
use ucom_host::files::{Image, ImageError, ImageOptions};
use ucom_host::master::update::{
    UpdateImage, UpdateMode, UpdateOptions, UpdateReport, UpdateTarget, has_header,
};
use utoipa::ToSchema;

use super::boards::numbers;
use super::objects::JobObject;
use super::{Agent, Denials};
use crate::jobs::Done;
use crate::owner::{Kind, fault};

/// Board to update.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object with the field board, and optionally flash_number")]
pub(super) struct TargetRequest {
    /// Number of the board.
    board: u8,
    /// Flash number that the board must have; missing: any flash number.
    flash_number: Option<u16>,
}

/// Format of an image.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum ImageFormat {
    /// Raw bytes in wire order.
    Bin,
    /// Intel HEX.
    Hex,
    /// Motorola S-record.
    Srec,
}

/// Unit of the addresses in records.
#[derive(Clone, Copy, Debug, serde::Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Unit {
    /// Bytes.
    Byte,
    /// Words of 16 bits.
    Word,
}

/// Update of boards.
#[derive(Clone, Debug, serde::Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct UpdateRequest {
    /// Boards to update.
    #[schema(min_items = 1, max_items = 31)]
    boards: Vec<TargetRequest>,
    /// Image, as base64.
    image: String,
    /// Second image, as base64; needed only if the plan of the profile sends a different image in each cycle.
    second: Option<String>,
    /// Format of the images; missing: detected from their content. A text or a file with records is never accepted as
    /// raw bytes.
    format: Option<ImageFormat>,
    /// Unit of the addresses in the images; missing: detected from their records.
    addresses: Option<Unit>,
    /// Byte that fills gaps between records, for example 255, the erased state of flash; missing: an image with a gap
    /// is refused.
    fill_gaps: Option<u8>,
    /// Flash date, as `2009-06-01`; missing: today, but a board that already shows the program keeps its date.
    date: Option<String>,
    /// Program ID that the boards must show at the end.
    expect_program_id: Option<u16>,
    /// `true`: update all boards at once, by broadcast.
    #[serde(default)]
    group: bool,
    /// `true`: start the application at the end.
    #[serde(default)]
    start: bool,
    /// `true`: run only the checks.
    #[serde(default)]
    dry_run: bool,
    /// `true`: update even if boards run, another PC is on the bus, or the board already shows the program.
    #[serde(default)]
    force: bool,
    /// `true`: update even if the board already shows the program; all checks still apply.
    #[serde(default)]
    rewrite: bool,
    /// `true`: accept a result that cannot be verified. This includes a board that already shows the program, but whose
    /// flash contents are not known.
    #[serde(default)]
    accept_unverified: bool,
}

fn usage(message: impl Into<String>, next: &'static str) -> Problem {
    Problem::new("image", message, next).kind(ErrorKind::Usage)
}

/// Reads an image. Adds its notes, such as a gap that was filled, to `notes`.
fn image(text: &str, request: &UpdateRequest, notes: &mut Vec<String>) -> Result<UpdateImage, Problem> {
    let bytes = STANDARD
        .decode(text)
        .map_err(|e| usage(format!("the image is not valid base64: {e}"), "encode the file as base64"))?;
    let format = request.format.map(|format| match format {
        ImageFormat::Bin => Format::Bin,
        ImageFormat::Hex => Format::IntelHex,
        ImageFormat::Srec => Format::SRecord,
    });
    let address_unit = request.addresses.map(|unit| match unit {
        Unit::Byte => AddressUnit::Byte,
        Unit::Word => AddressUnit::Word,
    });
    let gaps = request.fill_gaps.map_or(Gaps::Refuse, Gaps::Fill);
    let options = ImageOptions { format, address_unit, gaps, ..ImageOptions::default() };
    let image = Image::parse(&bytes, &options).map_err(|e| usage(e.to_string(), advice(&e)))?;
    notes.extend(image.notes().iter().map(ToString::to_string));
    Ok(image.into())
}

/// Returns the next step for a file that is not a valid image. The next step never suggests skipping a check of the
/// file contents.
fn advice(error: &ImageError) -> &'static str {
    match error.advice() {
        ImageAdvice::None => "",
        ImageAdvice::FillGaps => "if nothing belongs there, set fill_gaps to 255 (the erased state of flash)",
        ImageAdvice::OtherUnit(AddressUnit::Byte) => {
            "set addresses to byte if the tool chain counts bytes, or set fill_gaps to 255 if the gap is intended"
        }
        ImageAdvice::OtherUnit(AddressUnit::Word) => {
            "set addresses to word if the tool chain counts words, or set fill_gaps to 255 if the gap is intended"
        }
        ImageAdvice::MakeAgain | ImageAdvice::NameRaw | ImageAdvice::Rename | ImageAdvice::Addresses => {
            "make the file again with the tool chain; valid formats are hex, srec and bin"
        }
    }
}

/// Returns the flash date: the requested date, or else the current date (UTC). Returns 0 if updates with this profile
/// send no header, because only the header contains the date.
fn day(asked: Option<&str>, profile: &Profile) -> Result<u16, Problem> {
    let wrong = |text: &str| {
        usage(
            format!("{text} is not a valid date, expected a date YYYY-MM-DD that boards can store"),
            "omit date to use today's date",
        )
    };
    let date = match asked {
        _ if !has_header(profile) => return Ok(0),
        Some(text) => parsed(text).ok_or_else(|| wrong(text))?,
        None => OffsetDateTime::now_utc().date(),
    };
    let year = u16::try_from(date.year()).ok();
    let encoded = year.and_then(|year| profile.prog_date.encode(year, date.month().into(), date.day()));
    encoded.ok_or_else(|| wrong(&date.to_string()))
}

fn parsed(text: &str) -> Option<Date> {
    let mut parts = text.split('-');
    let (year, month) = (parts.next()?.parse().ok()?, parts.next()?.parse::<u8>().ok()?);
    let day = parts.next()?.parse().ok()?;
    let date = Date::from_calendar_date(year, Month::try_from(month).ok()?, day).ok()?;
    parts.next().is_none().then_some(date)
}

/// Returns the options of an update, and the notes about its images.
fn options(request: &UpdateRequest, profile: &Profile) -> Result<(UpdateOptions, Vec<String>), Problem> {
    if request.boards.is_empty() {
        return Err(usage(
            "no board is selected",
            "list the boards in the field boards, each with its number",
        ));
    }
    numbers(request.boards.iter().map(|target| target.board))?;
    let target = |t: &TargetRequest| UpdateTarget { board: t.board, flash_number: t.flash_number };
    let targets = request.boards.iter().map(target).collect();
    let mut notes = Vec::new();
    let main = image(&request.image, request, &mut notes)?;
    let second = request.second.as_deref().map(|text| image(text, request, &mut notes)).transpose()?;
    let date = day(request.date.as_deref(), profile)?;
    let options = UpdateOptions {
        second,
        expect_program_id: request.expect_program_id,
        mode: if request.group { UpdateMode::Group } else { UpdateMode::OneByOne },
        dry_run: request.dry_run,
        force: request.force,
        rewrite: request.rewrite,
        any_date: request.date.is_none(),
        start: request.start,
        accept_unverified: request.accept_unverified,
        keep_going: request.boards.len() > 1,
        ..UpdateOptions::new(targets, main, date)
    };
    Ok((options, notes))
}

/// Reads the body of an update request. A separate thread parses long images, so that other requests are served at the
/// same time.
async fn read(request: Request, profile: Profile) -> Result<(UpdateOptions, Vec<String>), Problem> {
    let (parts, body) = request.into_parts();
    let body = Bytes::from_request(Request::from_parts(parts.clone(), body), &()).await;
    let body = body.map_err(|e| Problem::rejected(e.status(), e.body_text()))?;
    let request = Request::from_parts(parts, body.into());
    let runtime = tokio::runtime::Handle::current();
    let parsed = tokio::task::spawn_blocking(move || {
        let Body(request) = runtime.block_on(Body::<UpdateRequest>::from_request(request, &()))?;
        options(&request, &profile)
    });
    parsed.await.unwrap_or_else(|_| Err(fault()))
}

/// Returns the error response for an update that failed.
fn failed(report: &UpdateReport) -> Option<Problem> {
    let kind = report.failure()?;
    let failures: Vec<_> =
        report.boards.iter().filter_map(|b| Some((b.board, b.failure.as_ref()?))).collect();
    let texts: Vec<String> =
        failures.iter().map(|(board, failure)| format!("board {board}: {failure}")).collect();
    let board = match *failures {
        [(board, _)] => Some(board),
        _ => None,
    };
    let cancelled = report
        .boards
        .iter()
        .any(|b| matches!(b.failure, Some(ucom_host::master::update::UpdateFailure::Cancelled { .. })));
    let code = if cancelled { "cancelled" } else { "update" };
    let (message, next) = match texts.is_empty() {
        true => report.unproven(),
        false => (texts.join("; "), "the field update of the job shows the result of each board"),
    };
    let facts = Facts { board, ..Facts::default() };
    Some(Problem::new(code, message, next).kind(kind).with(facts))
}

/// Programs boards, as a job.
///
/// The agent checks the image, transfers it twice, and verifies it by reading back. Only one update runs at a time.
#[utoipa::path(
    post,
    path = "/api/updates",
    params(LeaseKey, KnownHalt),
    request_body = UpdateRequest,
    responses((status = 202, description = "Job that was started", body = JobObject), Refusals, Denials)
)]
pub(super) async fn update(
    State(agent): State<Agent>,
    asker: Asker,
    after: AskedAfter,
    request: Request,
) -> Result<(StatusCode, Json<JobObject>), Problem> {
    // The permission of the client is checked before the images are read.
    agent.commander(&asker)?;
    let Ok(room) = agent.images.clone().acquire_owned().await else { return Err(fault()) };
    let profile = agent.shared.snapshot().profile;
    let (options, notes) = read(request, profile).await?;
    drop(room);
    agent.begin((&asker, Some(after)), (Kind::Update, "update"), |worker| {
        let start = options.start;
        let report = worker.session.driver.update(options, &mut worker.records, &mut |_| {})?;
        worker.updated(&report, start);
        let error = failed(&report);
        Ok((Done::Update(report, notes), error))
    })
}
