//! Update of the firmware of one board. Each attempt begins in the exloader of the board and ends with the read-back (U-4 to U-10).
use crate::master::engine::{Event, Link};
use crate::master::error::{Error, IdentityError, StatusError};
use crate::master::procedures::control::{enter_exloader, start_application};
use crate::master::procedures::exchange::{confirmed, identity, info, numbers};
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::update::session::{Stage, UpdateSession};
use crate::master::procedures::update::transfer::{Attempt, Broken, Transferred};
use crate::master::reports::update::{UpdateFailure, UpdateOutcome, UpdatePlan};
use ucom::{BoardInfo, ErrorCode, Status, ToBoard};

/// Returns `true` if the board reports the program of the plan in its answer to PC_INFO.
pub(super) fn has(known: &BoardInfo, plan: &UpdatePlan) -> bool {
    known.has_application() && plan.expected.is_some_and(|expected| expected.is(known))
}

pub(super) async fn shows(link: &Link, board: u8, plan: &UpdatePlan) -> bool {
    confirmed(link, board).await.is_ok_and(|seen| has(&seen.info, plan))
}

/// Updates the firmware of one board. The number of the first attempt is `first`.
pub(super) async fn one(
    link: &Link,
    session: &mut UpdateSession,
    board: u8,
    first: u32,
) -> Result<(), Error> {
    let plan = session.plan(link, Some(board))?;
    let profile = link.profile();
    let mut gap_us = u64::from(profile.prog_frame_gap_us);
    let since = link.now();
    for number in first..=profile.prog_attempts.max(first) {
        session.begin(board);
        if let Some(result) = session.result(board) {
            result.attempts = number;
        }
        let again = attempt(link, session, board, &plan, number, gap_us).await;
        if let Some(result) = session.result(board) {
            result.time_us = link.now().saturating_sub(since);
        }
        match again {
            None => break,
            // After an overrun on the board, the pause between frames is increased.
            Some(Broken::Device { code: ErrorCode::Overrun | ErrorCode::CanOverrun, .. }) => {
                gap_us = (gap_us * 2).max(500);
            }
            Some(_) => {}
        }
        if number < profile.prog_attempts {
            link.note(format!("board {board}: attempt {number} failed, next attempt"));
        }
    }
    session.active.retain(|b| *b != board);
    Ok(())
}

/// Puts a checked board into its exloader, with programming enabled.
///
/// The function reads the board before each XRESET, because another board may have taken its number since the check or since the previous
/// attempt.
pub(super) async fn enter(link: &Link, session: &UpdateSession, board: u8) -> Result<(), Error> {
    let flash_number = session.flash_number(board);
    if let (Some(wanted), Ok(seen)) = (flash_number, numbers(link, board).await)
        && seen.flash_number != wanted
    {
        // The function reads the flash number twice, because a single damaged answer must not be interpreted as another board.
        let found = confirmed(link, board).await?.info.flash_number;
        if found != wanted {
            return Err(IdentityError::WrongBoard { board, wanted, found }.into());
        }
    }
    one_board_each(link, &[board]).await?;
    if let Some(flash_number) = flash_number {
        link.with(|core| core.event(Event::FlashBegins { id: link.id, flash_number }));
    }
    let entered = enter_exloader(link, board, flash_number).await;
    if entered.is_err() {
        // If the board has executed the XRESET, it must not accept program data that are for another board.
        leave_programming(link, board).await;
    }
    entered.map(drop)
}

async fn leave_programming(link: &Link, board: u8) {
    if let Ok(to) = link.board(board) {
        link.send(to, ToBoard::SetStatus { mask: Status::PROG.0, value: 0 }).await;
    }
}

/// Makes one attempt to update one board. The function returns `Some` if another attempt may succeed. The result of the board contains the
/// reason of the failure.
async fn attempt(
    link: &Link,
    session: &mut UpdateSession,
    board: u8,
    plan: &UpdatePlan,
    number: u32,
    gap_us: u64,
) -> Option<Broken> {
    if let Err(error) = enter(link, session, board).await {
        session.fail_with(board, error);
        return None;
    }
    let to = link.board(board).ok()?;
    let since = link.now();
    let boards = vec![board];
    let attempt = Attempt { link, plan, to, boards, number, gap_us, since };
    let Transferred { broken, .. } = attempt.run(|_, _| session.reach(board, Stage::Erased)).await;
    judge(link, session, board, plan, number, broken.first().map(|(_, b)| *b)).await
}

/// Determines the result of an attempt from a read-back, or from the reason why the attempt ended early.
pub(super) async fn judge(
    link: &Link,
    session: &mut UpdateSession,
    board: u8,
    plan: &UpdatePlan,
    attempts: u32,
    broken: Option<Broken>,
) -> Option<Broken> {
    let erased = session.may_be_erased(board);
    let failure = match broken {
        None => {
            verify(link, session, board, plan).await;
            return None;
        }
        Some(Broken::NoFinish { .. }) if shows(link, board, plan).await => {
            // U-9: the board has written the program, and only the frame DSP_PROGFINISHED was lost.
            verify(link, session, board, plan).await;
            return None;
        }
        Some(Broken::NoFinish { waited_ms }) => {
            let block = plan.frames(1).saturating_sub(1) / 8;
            UpdateFailure::Timeout { cycle: 2, block, waited_ms, attempts, erased }
        }
        Some(Broken::Timeout { cycle, block, waited_ms }) => {
            UpdateFailure::Timeout { cycle, block, waited_ms, attempts, erased }
        }
        Some(Broken::Device { code, cycle, block }) => {
            UpdateFailure::Device { code, cycle, block, attempts, erased }
        }
    };
    // The board must not interpret the next program data as the remainder of this transfer. The PC sends the command
    // while the board is still listed as in progress, so the command is also sent if the user cancels the update at
    // this moment.
    leave_programming(link, board).await;
    // The cause of the failure can be that another board has taken the number since the transfer began. That board
    // reports errors about program data, or receives the data in the wrong order.
    if let Err(error) = one_board_each(link, &[board]).await {
        session.fail_with(board, error.into());
        return None;
    }
    session.fail(board, failure);
    // U-7: the error means that the image or the board is wrong, so another attempt would fail in the same way.
    let hopeless = |code| matches!(code, ErrorCode::MemProtected | ErrorCode::Data);
    broken.filter(|b| !matches!(b, Broken::Device { code, .. } if hopeless(*code)))
}

/// U-10: checks that the board reports the new program in its answer to PC_INFO. The function starts the program if the options require
/// this.
pub(super) async fn verify(link: &Link, session: &mut UpdateSession, board: u8, plan: &UpdatePlan) {
    session.reach(board, Stage::Written);
    let known = match confirmed(link, board).await {
        Ok(seen) => seen.info,
        // The board reported that the program is written. Only the read-back of the program failed.
        Err(e) => return session.fail_with(board, e),
    };
    // If another board shares the number, that other board was also written, or may have sent the last answer.
    if let Err(error) = one_board_each(link, &[board]).await {
        return session.fail_with(board, error.into());
    }
    if let Some(result) = session.result(board) {
        result.after = Some(known);
    }
    let BoardInfo { program_id, date, status, .. } = known;
    let outcome = match plan.expected {
        Some(_) if has(&known, plan) => {
            session.reach(board, Stage::Verified);
            session.prove(board);
            link.with(|core| core.event(Event::FlashVerified { id: link.id, info: known }));
            UpdateOutcome::Verified
        }
        Some(wanted) => {
            let (wanted_id, wanted_date) = (wanted.program_id, wanted.date);
            let failure = UpdateFailure::NotVerified { program_id, date, wanted_id, wanted_date };
            return session.fail(board, failure);
        }
        // The program that the board must report is not known. The board must at least report an application and must be in its exloader.
        None if known.has_application() && status.has(Status::EXLRUN) => UpdateOutcome::Written,
        None => return session.fail(board, UpdateFailure::NotValid { program_id, date, status }),
    };
    session.end(board, outcome, None);
    if session.options.start {
        start(link, session, board, &known).await;
    }
}

/// Starts the application of a board that reported `known`, and checks that the application runs.
pub(super) async fn start(link: &Link, session: &mut UpdateSession, board: u8, known: &BoardInfo) {
    session.begin(board);
    session.starting = Some(board);
    let started = match start_application(link, board).await {
        Ok(_) => info(link, board).await,
        Err(e) => Err(e),
    };
    match started {
        Ok(seen) if identity(&seen.info) == identity(known) && seen.info.status.has(Status::MSTART) => {
            session.end(board, UpdateOutcome::Running, None);
        }
        Ok(seen) => {
            let what = "the application did not run";
            let error = Error::Status(StatusError::NotReached {
                board,
                what,
                waited_ms: 0,
                status: seen.info.status,
            });
            session.fail(board, UpdateFailure::NotRunning(Box::new(error)));
        }
        Err(e) => session.fail(board, UpdateFailure::NotRunning(Box::new(e))),
    }
    session.starting = None;
}
