//! The update as a whole: checks U-1 to U-3, then boards one by one or as a group; what is left when it is ended early.

use super::board::{has, one, start};
use super::campaign::{Campaign, Stage};
use super::group::group;
use super::{PlanError, UpdateFailure, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport};
use crate::master::byte_order::right_order;
use crate::master::holders::one_board_each;
use crate::master::link::Link;
use crate::master::request::{confirmed, numbers, set_status};
use crate::master::scan::board_states;
use crate::master::{Error, Outcome};
use std::collections::BTreeSet;
use ucom::Status;

/// Updates all boards that need it.
pub(crate) async fn update(link: Link, options: UpdateOptions) -> Result<Outcome, Error> {
    let mut seen = BTreeSet::new();
    if options.targets.is_empty() {
        return Err(PlanError::NoTarget.into());
    }
    for target in &options.targets {
        link.board(target.board)?;
        if !seen.insert(target.board) {
            return Err(PlanError::Twice { board: target.board }.into());
        }
    }
    let mut run = Campaign::new(options);
    let plan = run.plan(&link, None)?;
    let mut end = link.or_cancel(all(&link, &mut run)).await;
    link.bear_shared_numbers(true);
    if let Err(error @ (Error::Cancelled | Error::NumberShared { .. })) = end {
        end = link.or_cancel(broken_off(&link, &mut run, &error)).await;
    }
    if let Err(error) = &end {
        for board in core::mem::take(&mut run.programming) {
            leave_programming_to_user(&mut run, board, error);
        }
    }
    match end {
        Ok(()) => {}
        // Asked once more: what was still to be undone is not.
        Err(Error::Cancelled) => {
            run.unfinished().into_iter().for_each(|board| run.cancel(board));
            run.cancel_starts();
        }
        // Nothing can be sent any more, but what is known of the boards is still worth telling.
        Err(error @ Error::Bus { .. }) => {
            let waiting = core::mem::take(&mut run.to_start);
            for board in run.unfinished().into_iter().chain(waiting) {
                run.fail_with(board, error.clone());
            }
        }
        Err(e) => return Err(e),
    }
    let report = UpdateReport {
        dry_run: run.options.dry_run,
        program_id: plan.program_id(),
        date: run.options.date,
        bytes: plan.total_bytes(),
        images: plan.images,
        unverifiable: plan.unverifiable,
        accept_unverified: run.options.accept_unverified,
        boards: run.results,
    };
    Ok(Outcome::Update(report))
}

/// The boards at work are told to forget the transfer; nothing half written is ever valid. `why`: the user ended it, or two
/// boards have one number.
async fn broken_off(link: &Link, run: &mut Campaign, why: &Error) -> Result<(), Error> {
    for board in run.active.clone() {
        // PC_START may have been taken already: what this update has started it stops again.
        if run.starting == Some(board) && set_status(link, board, Status::MSTART, Status(0)).await.is_ok() {
            run.starting = None;
        }
        // Best effort: what the board does not take now, its own time limit and the next XRESET undo.
        if set_status(link, board, Status::PROG, Status(0)).await.is_err() {
            link.note(format!("board {board} did not confirm that it left programming"));
        }
        match why {
            Error::Cancelled => run.cancel(board),
            why => run.fail_with(board, why.clone()),
        }
    }
    still_programming(link, run, why).await;
    if *why != Error::Cancelled {
        refuse(run, why);
        let waiting = core::mem::take(&mut run.to_start);
        waiting
            .into_iter()
            .for_each(|board| run.fail(board, UpdateFailure::NotRunning(Box::new(why.clone()))));
    }
    run.open().into_iter().for_each(|board| run.cancel(board));
    run.cancel_starts();
    Ok(())
}

/// A board that has the image already may still be in programming mode, as after an update whose tool was killed: it would take
/// program data that are meant for others.
async fn end_programming(link: &Link, run: &mut Campaign) -> Result<(), Error> {
    while let Some(board) = run.programming.first().copied() {
        let ended = match link.become_master(run.options.force).await {
            Ok(()) => set_status(link, board, Status::PROG, Status(0)).await.map(drop),
            Err(error) => Err(error),
        };
        match ended {
            Ok(()) => link.note(format!("board {board} was in programming mode: ended")),
            Err(error) => {
                leave_programming_to_user(run, board, &error);
            }
        }
        run.programming.retain(|b| *b != board);
    }
    Ok(())
}

/// Boards that were found in programming mode and are still to be taken out of it when the update is ended early: they are, where
/// this PC is the master already; else they are named, as nothing may be sent to them (D-08).
async fn still_programming(link: &Link, run: &mut Campaign, why: &Error) {
    while let Some(board) = run.programming.first().copied() {
        let ended = link.is_master() && set_status(link, board, Status::PROG, Status(0)).await.is_ok();
        match ended {
            true => link.note(format!("board {board} was in programming mode: ended")),
            false => leave_programming_to_user(run, board, why),
        }
        run.programming.retain(|b| *b != board);
    }
}

fn leave_programming_to_user(run: &mut Campaign, board: u8, why: &Error) {
    let failure = UpdateFailure::StillProgramming(Box::new(why.clone()));
    run.end(board, UpdateOutcome::UpToDate, Some(failure));
    run.to_start.retain(|b| *b != board);
}

async fn all(link: &Link, run: &mut Campaign) -> Result<(), Error> {
    check(link, run).await;
    end_programming(link, run).await?;
    let failed = run.results.iter().find(|r| r.failure.is_some()).map(|r| r.board);
    if let Some(after) = failed.filter(|_| !run.options.keep_going) {
        skip_open(run, after);
    }
    if run.open().is_empty() {
        if run.to_start.is_empty() || failed.is_some_and(|_| !run.options.keep_going) {
            return Ok(());
        }
        link.become_master(run.options.force).await?;
        return start_rest(link, run).await;
    }
    // D-10: the numbers of the header would come out with their bytes exchanged.
    let flash_numbers: Vec<u16> = run.results.iter().filter_map(|result| result.flash_number).collect();
    if !run.options.force
        && let Err(error) = right_order(link, &flash_numbers).await
    {
        refuse(run, &error);
        return Ok(());
    }
    // U-2: program data outrank the process data of a running board.
    let states = board_states(link).await;
    let running: Vec<u8> = states.iter().filter(|(_, s)| s.has(Status::MCARUN)).map(|(b, _)| *b).collect();
    if !running.is_empty() && !run.options.force {
        refuse(run, &Error::Running { boards: running });
        return Ok(());
    }
    // D-08, in a dry run as well: what it says must be what would happen.
    if let Err(error) = link.look_for_master(run.options.force).await {
        refuse(run, &error);
        return Ok(());
    }
    if run.options.dry_run {
        return Ok(());
    }
    link.become_master(true).await?;
    if run.options.mode == UpdateMode::Group && run.open().len() > 1 {
        group(link, run).await?;
    }
    for board in run.open() {
        one(link, run, board, 1).await?;
        let failed = run.results.iter().any(|r| r.board == board && r.failure.is_some());
        if failed && !run.options.keep_going {
            skip_open(run, board);
            return Ok(());
        }
    }
    start_rest(link, run).await
}

/// Starts the boards that had the image already.
async fn start_rest(link: &Link, run: &mut Campaign) -> Result<(), Error> {
    while let Some(board) = run.to_start.first().copied() {
        // PC_INFO has shown the program.
        run.reach(board, Stage::Verified);
        run.begin(board);
        run.to_start.retain(|b| *b != board);
        match numbers(link, board).await {
            Ok(known) => start(link, run, board, &known).await,
            Err(error) => run.fail(board, UpdateFailure::NotRunning(Box::new(error))),
        }
    }
    Ok(())
}

/// No board is begun.
pub(super) fn refuse(run: &mut Campaign, error: &Error) {
    for board in run.open() {
        run.fail(board, UpdateFailure::Refused(Box::new(error.clone())));
    }
}

fn skip_open(run: &mut Campaign, after: u8) {
    for board in run.open() {
        run.fail(board, UpdateFailure::Skipped { after });
    }
}

/// U-1 and U-3, by questions only.
async fn check(link: &Link, run: &mut Campaign) {
    for target in run.options.targets.clone() {
        let board = target.board;
        let known = match confirmed(link, board).await {
            Ok(seen) => seen.info,
            Err(e) => {
                run.fail(board, UpdateFailure::Refused(Box::new(e)));
                continue;
            }
        };
        if let Err(error) = one_board_each(link, &[board]).await {
            run.fail(board, UpdateFailure::Refused(Box::new(error)));
            continue;
        }
        let found = known.flash_number;
        if let Some(result) = run.result(board) {
            result.flash_number = Some(found);
            result.before = Some(known);
        }
        if let Some(wanted) = target.flash_number.filter(|wanted| *wanted != found) {
            let error = Error::WrongBoard { board, wanted, found };
            run.fail(board, UpdateFailure::Refused(Box::new(error)));
            continue;
        }
        let there = run.plan(link, Some(board)).is_ok_and(|plan| has(&known, &plan));
        if there && !run.options.force {
            run.end(board, UpdateOutcome::UpToDate, None);
            if known.status.has(Status::PROG) && !run.options.dry_run {
                run.programming.push(board);
            }
            if run.options.start && !run.options.dry_run {
                run.to_start.push(board);
            }
        }
    }
}
