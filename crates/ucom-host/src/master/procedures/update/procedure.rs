//! Sequence of an update: the checks U-1 to U-3, and then the transfer to single boards or to a group. If an update ends early, the
//! procedure cleans up.

use crate::master::engine::Link;
use crate::master::error::{Error, IdentityError, MasterError, RunningError, TargetError};
use crate::master::procedures::byte_order::right_order;
use crate::master::procedures::exchange::{confirmed, numbers, set_status};
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::survey::board_states;
use crate::master::procedures::update::board::{one, start};
use crate::master::procedures::update::group::group;
use crate::master::procedures::update::session::{Stage, UpdateSession};
use crate::master::reports::Outcome;
use crate::master::reports::update::{UpdateFailure, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport};
use std::collections::BTreeSet;
use ucom::{BoardInfo, Status};

/// Updates all boards that need the program of the image.
pub(crate) async fn update(link: Link, options: UpdateOptions) -> Result<Outcome, Error> {
    let mut seen = BTreeSet::new();
    if options.targets.is_empty() {
        return Err(TargetError::None.into());
    }
    for target in &options.targets {
        link.board(target.board)?;
        if !seen.insert(target.board) {
            return Err(TargetError::Twice { board: target.board }.into());
        }
    }
    let mut session = UpdateSession::new(options);
    let plan = session.plan(&link, None)?;
    let mut end = link.or_cancel(all(&link, &mut session)).await;
    link.bear_shared_numbers(true);
    if let Err(
        error @ (Error::Master(MasterError::Cancelled) | Error::Identity(IdentityError::NumberShared { .. })),
    ) = end
    {
        end = link.or_cancel(broken_off(&link, &mut session, &error)).await;
    }
    if let Err(error) = &end {
        for board in core::mem::take(&mut session.programming) {
            leave_programming_to_user(&mut session, board, error);
        }
    }
    match end {
        Ok(()) => {}
        // After a second cancel, the procedure skips the remaining steps of the clean-up.
        Err(Error::Master(MasterError::Cancelled)) => {
            session.unfinished().into_iter().for_each(|board| session.cancel(board));
            session.cancel_starts();
        }
        // The PC can no longer send frames, but the report still contains the known state of the boards.
        Err(error @ Error::Master(MasterError::Bus { .. })) => {
            let waiting = core::mem::take(&mut session.to_start);
            for board in session.unfinished().into_iter().chain(waiting) {
                session.fail_with(board, error.clone());
            }
        }
        Err(e) => return Err(e),
    }
    let report = UpdateReport {
        dry_run: session.options.dry_run,
        program_id: plan.program_id(),
        date: session.options.date,
        bytes: plan.total_bytes(),
        images: plan.images,
        unverifiable: plan.unverifiable,
        accept_unverified: session.options.accept_unverified,
        boards: session.results,
    };
    Ok(Outcome::Update(report))
}

/// Commands the boards whose update is in progress to discard the transfer. A partly written image is never valid. `why` is the cause of
/// the early end: a cancel by the user, or two boards with the same number.
async fn broken_off(link: &Link, session: &mut UpdateSession, why: &Error) -> Result<(), Error> {
    for board in session.active.clone() {
        // The board may have received PC_START already. The update stops boards whose application it has started.
        if session.starting == Some(board) && set_status(link, board, Status::MSTART, Status(0)).await.is_ok()
        {
            session.starting = None;
        }
        // If the board does not execute this command, its own timeout and the next XRESET end the programming mode.
        if set_status(link, board, Status::PROG, Status(0)).await.is_err() {
            link.note(format!("board {board} did not confirm the end of programming mode"));
        }
        match why {
            Error::Master(MasterError::Cancelled) => session.cancel(board),
            why => session.fail_with(board, why.clone()),
        }
    }
    still_programming(link, session, why).await;
    if *why != Error::Master(MasterError::Cancelled) {
        session.refuse(why);
        let waiting = core::mem::take(&mut session.to_start);
        waiting
            .into_iter()
            .for_each(|board| session.fail(board, UpdateFailure::NotRunning(Box::new(why.clone()))));
    }
    session.open().into_iter().for_each(|board| session.cancel(board));
    session.cancel_starts();
    Ok(())
}

/// Ends the programming mode of boards that already report the program of the image. A board may still be in programming mode because an
/// earlier update tool was killed. In programming mode, the board would accept program data for other boards.
async fn end_programming(link: &Link, session: &mut UpdateSession) -> Result<(), Error> {
    while let Some(board) = session.programming.first().copied() {
        let ended = match link.become_master(session.options.force).await {
            Ok(()) => set_status(link, board, Status::PROG, Status(0)).await.map(drop),
            Err(error) => Err(error),
        };
        match ended {
            Ok(()) => link.note(format!("board {board} was in programming mode, which was ended")),
            Err(error) => {
                leave_programming_to_user(session, board, &error);
            }
        }
        session.programming.retain(|b| *b != board);
    }
    Ok(())
}

/// Handles boards that were found in programming mode, if the update ends early. If this PC is the master, the
/// function ends the programming mode of these boards. Otherwise, this PC must not send commands (D-08), so the
/// function only reports the boards.
async fn still_programming(link: &Link, session: &mut UpdateSession, why: &Error) {
    while let Some(board) = session.programming.first().copied() {
        let ended = link.is_master() && set_status(link, board, Status::PROG, Status(0)).await.is_ok();
        match ended {
            true => link.note(format!("board {board} was in programming mode, which was ended")),
            false => leave_programming_to_user(session, board, why),
        }
        session.programming.retain(|b| *b != board);
    }
}

fn leave_programming_to_user(session: &mut UpdateSession, board: u8, why: &Error) {
    let failure = UpdateFailure::StillProgramming(Box::new(why.clone()));
    session.end(board, session.outcome(board), Some(failure));
    session.to_start.retain(|b| *b != board);
}

async fn all(link: &Link, session: &mut UpdateSession) -> Result<(), Error> {
    check(link, session).await;
    end_programming(link, session).await?;
    let failed = session.results.iter().find(|r| r.failure.is_some()).map(|r| r.board);
    if let Some(after) = failed.filter(|_| !session.options.keep_going) {
        session.skip_open(after);
    }
    if session.open().is_empty() {
        if session.to_start.is_empty() || failed.is_some_and(|_| !session.options.keep_going) {
            return Ok(());
        }
        link.become_master(session.options.force).await?;
        return start_rest(link, session).await;
    }
    // D-10: with the wrong byte order, the bytes of the flash numbers in the header would be swapped.
    let flash_numbers: Vec<u16> = session.results.iter().filter_map(|result| result.flash_number).collect();
    if !session.options.force
        && let Err(error) = right_order(link, &flash_numbers).await
    {
        session.refuse(&error.into());
        return Ok(());
    }
    // U-2: program data have a higher priority on the bus than process data. Therefore the update is refused while
    // boards run, unless `force` is set.
    let states = board_states(link).await;
    let running: Vec<u8> = states.iter().filter(|(_, s)| s.has(Status::MCARUN)).map(|(b, _)| *b).collect();
    if !running.is_empty() && !session.options.force {
        session.refuse(&Error::Running(RunningError::Running { boards: running }));
        return Ok(());
    }
    // D-08: a dry run also checks for another PC, because its report must show the result that a real update would
    // have.
    if let Err(error) = link.look_for_master(session.options.force).await {
        session.refuse(&error);
        return Ok(());
    }
    if session.options.dry_run {
        return Ok(());
    }
    link.become_master(true).await?;
    if session.options.mode == UpdateMode::Group && session.open().len() > 1 {
        group(link, session).await?;
    }
    for board in session.open() {
        one(link, session, board, 1).await?;
        let failed = session.results.iter().any(|r| r.board == board && r.failure.is_some());
        if failed && !session.options.keep_going {
            session.skip_open(board);
            return Ok(());
        }
    }
    start_rest(link, session).await
}

/// Starts the boards that already reported the program before the update.
async fn start_rest(link: &Link, session: &mut UpdateSession) -> Result<(), Error> {
    while let Some(board) = session.to_start.first().copied() {
        // The board has already reported the program in its answer to PC_INFO.
        session.reach(board, Stage::Verified);
        session.begin(board);
        session.to_start.retain(|b| *b != board);
        match numbers(link, board).await {
            Ok(known) => start(link, session, board, &known).await,
            Err(error) => session.fail(board, UpdateFailure::NotRunning(Box::new(error))),
        }
    }
    Ok(())
}

/// Returns the outcome of a board that needs no transfer (U-3 and D-62); returns `None` if the board must be written.
///
/// PC_INFO returns only the Program ID and the date of program memory. The answer to PC_INFO does not contain the load address or data
/// about a second image.
fn already(link: &Link, session: &UpdateSession, known: &BoardInfo) -> Option<UpdateOutcome> {
    let options = &session.options;
    let expected = session.plan(link, None).ok()?.expected?;
    let other_date = expected.date.is_some_and(|date| date != known.date);
    let shown = known.has_application() && known.program_id == expected.program_id;
    if options.force || options.rewrite || !shown || options.second.is_some() {
        return None;
    }
    let record = options.records.get(&known.flash_number);
    let image = &options.image;
    if record.is_some_and(|record| !record.is_of(&image.bytes, image.address_words)) {
        return None;
    }
    if other_date && !options.any_date {
        return None;
    }
    // The flash record is valid only if the board still reports the recorded Program ID and date. Otherwise, the
    // board has received another program since the recorded update.
    let holds = record.is_some_and(|r| (r.program_id, r.date) == (known.program_id, known.date));
    Some(if holds { UpdateOutcome::UpToDate } else { UpdateOutcome::ProgramUpToDate })
}

/// Performs the checks U-1 and U-3. The function sends only queries.
async fn check(link: &Link, session: &mut UpdateSession) {
    for target in session.options.targets.clone() {
        let board = target.board;
        let known = match confirmed(link, board).await {
            Ok(seen) => seen.info,
            Err(e) => {
                session.fail(board, UpdateFailure::Refused(Box::new(e)));
                continue;
            }
        };
        if let Err(error) = one_board_each(link, &[board]).await {
            session.fail(board, UpdateFailure::Refused(Box::new(error.into())));
            continue;
        }
        let found = known.flash_number;
        if let Some(result) = session.result(board) {
            result.flash_number = Some(found);
            result.before = Some(known);
        }
        if let Some(wanted) = target.flash_number.filter(|wanted| *wanted != found) {
            let error = Error::Identity(IdentityError::WrongBoard { board, wanted, found });
            session.fail(board, UpdateFailure::Refused(Box::new(error)));
            continue;
        }
        if let Some(outcome) = already(link, session, &known) {
            session.end(board, outcome, None);
            let proven = outcome == UpdateOutcome::UpToDate;
            if proven {
                session.prove(board);
            }
            if known.status.has(Status::PROG) && !session.options.dry_run {
                session.programming.push(board);
            }
            // A program without a valid flash record is started only if the user accepts this.
            let trusted = proven || session.options.accept_unverified;
            if session.options.start && trusted && !session.options.dry_run {
                session.to_start.push(board);
            }
        }
    }
}
