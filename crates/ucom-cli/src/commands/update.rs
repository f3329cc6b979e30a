//! Command `ucom update`: checks firmware files, writes them to boards, and verifies the result.

use cli_kit::{ErrorKind, Failure, Output};
use ucom::Profile;
use ucom_host::files::Inventory;
use ucom_host::files::inventory::flash_number_of;
use ucom_host::master::update::{
    UpdateFailure, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport, UpdateResult, UpdateTarget,
};
use ucom_host::session::{FlashRecords, SessionError};

use super::update_bar::Bar;
use super::update_files::{Files, day};
use super::update_report::print;
use crate::args::{Boards, LinkArgs, UpdateArgs};

/// Programs the boards that the user has selected.
pub(super) fn update(args: &UpdateArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let profile = link.profile()?;
    let files = Files::read(args, &profile, out)?;
    let day = day(args.date.as_deref(), &profile)?;
    let mut driver = link.session_with(profile)?;
    let numbers = match driver.numbers(&args.boards) {
        Err(e) if e.is_cancelled() => return Err(cancelled(e, args, &profile, out)),
        answered => with_listed(answered?, args)?,
    };
    let targets = targets(args, &numbers)?;
    let several = targets.len() > 1;
    // The command shows the images and targets before it asks for a confirmation and before it sends a frame.
    files.notes.iter().for_each(|note| driver.note(note.clone()));
    driver.note(format!("onto {}", targets.iter().map(target).collect::<Vec<_>>().join(", ")));
    let options = UpdateOptions {
        dry_run: args.dry_run,
        force: args.force.force,
        rewrite: args.rewrite,
        any_date: args.date.is_none(),
        start: args.start,
        accept_unverified: args.unverified,
        mode: if args.group { UpdateMode::Group } else { UpdateMode::OneByOne },
        second: files.second,
        expect_program_id: args.expect_program_id,
        name_target: args.name_target,
        // In an update of several boards, the failure of one board does not affect the other boards.
        keep_going: several,
        ..UpdateOptions::new(targets, files.image, day)
    };
    let mut bar = Bar::new(out)?;
    let mut records = FlashRecords::new(Some(args.inventory.clone()));
    let report = driver.update(options, &mut records, &mut |event| bar.see(event));
    bar.end();
    let report = report?;
    print(&report, &files.names, &profile, out);
    match report.failure() {
        None => Ok(()),
        Some(kind) => Err(Failure::shown(kind)),
    }
}

/// Returns a text about a board and the identity that the board must have.
fn target(target: &UpdateTarget) -> String {
    let who =
        target.flash_number.map_or_else(|| "any flash number".into(), |f| format!("flash number 0x{f:04X}"));
    format!("board {} ({who})", target.board)
}

/// Returns the boards that the user has selected. `all` selects the boards that answer and the boards of the inventory. The command can
/// therefore report a missing board.
fn with_listed(mut numbers: Vec<u8>, args: &UpdateArgs) -> Result<Vec<u8>, Failure> {
    if args.boards == Boards::All && args.inventory.exists() {
        let inventory = Inventory::read(&args.inventory).map_err(Failure::usage)?;
        numbers.extend(inventory_numbers(&inventory));
        numbers.sort_unstable();
        numbers.dedup();
    }
    Ok(numbers)
}

fn inventory_numbers(inventory: &Inventory) -> impl Iterator<Item = u8> {
    (0..32).filter(|board| inventory.get(*board).is_some())
}

/// Reports that Ctrl-C during the identification of the boards has changed no board, and returns the failure.
fn cancelled(error: SessionError, args: &UpdateArgs, profile: &Profile, out: &Output) -> Failure {
    let inventory = Inventory::read(&args.inventory).ok();
    let left = UpdateOutcome::Cancelled;
    let board = |board| UpdateResult {
        board,
        flash_number: inventory.as_ref().and_then(|i| i.get(board)).map(|known| known.flash_number),
        before: None,
        after: None,
        outcome: left,
        verified: false,
        attempts: 0,
        failure: Some(UpdateFailure::Cancelled { left }),
        time_us: 0,
    };
    let boards = inventory.as_ref().map_or_else(Vec::new, |i| inventory_numbers(i).map(board).collect());
    if boards.is_empty() {
        return Failure { kind: ErrorKind::Refused, ..error.into() };
    }
    let report = UpdateReport { dry_run: args.dry_run, boards, ..UpdateReport::default() };
    print(&report, &[], profile, out);
    Failure::shown(report.failure().unwrap_or(ErrorKind::Refused))
}

/// Returns the required flash number of each board: the number on the command line, or else the number in the inventory.
fn targets(args: &UpdateArgs, numbers: &[u8]) -> Result<Vec<UpdateTarget>, Failure> {
    if let Some(flash) = args.flash_id {
        return match numbers {
            [board] => Ok(vec![UpdateTarget { board: *board, flash_number: Some(flash) }]),
            _ => Err(Failure::usage(format!(
                "--flash-id is for one board, but {} boards are selected",
                numbers.len()
            ))
            .next("for several boards, ucom reads the flash ids from the inventory that ucom init writes")),
        };
    }
    // A single board can be selected by its board number alone, without its identity. To update several boards, the command requires the
    // identity of each board.
    if let ([board], Boards::Some(_)) = (numbers, &args.boards)
        && !args.inventory.exists()
    {
        return Ok(vec![UpdateTarget { board: *board, flash_number: None }]);
    }
    let target = |board: &u8| {
        let flash_number = Some(flash_number_of(&args.inventory, *board)?);
        Ok(UpdateTarget { board: *board, flash_number })
    };
    numbers.iter().map(target).collect()
}
