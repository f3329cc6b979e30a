//! Single actions on a board: status, reset, start, stop, flags.
use crate::master::engine::{Link, MS};
use crate::master::error::{Error, ExchangeError, IdentityError, MEASURE_ORDER, SignalError, StatusError};
use crate::master::procedures::ask_reports::{REPORTS, ask_reports, collect_reports};
use crate::master::procedures::byte_order::right_order;
use crate::master::procedures::exchange::{TRIES, admin, confirmed, info, numbers, set_status};
use crate::master::procedures::one_board::{one_board_each, one_board_for_each_number};
use crate::master::procedures::repair::repair;
use crate::master::reports::{AdminChange, BoardSeen, Outcome, Reports, expected_status};
use ucom::{Admin, BoardInfo, ErrorCode, FromBoard, Function, Sequence, Status, ToBoard};

pub(crate) async fn info_procedure(link: Link, board: u8) -> Result<Outcome, Error> {
    let seen = info(&link, board).await?;
    one_board_each(&link, &[board]).await?;
    if let Err(error) = right_order(&link, &[seen.info.flash_number]).await {
        link.note(format!("{error}: {MEASURE_ORDER}"));
    }
    Ok(Outcome::Info(seen))
}

/// Sends PC_SETSTATUS and reads the status of the board back. If the board needs longer for a change than for an answer, the procedure
/// waits for the change.
pub(crate) async fn set_status_procedure(
    link: Link,
    board: u8,
    mask: Status,
    value: Status,
    force: bool,
) -> Result<Outcome, Error> {
    let to = link.board(board)?;
    link.become_master(force).await?;
    one_board_each(&link, &[board]).await?;
    let value = value & mask;
    if mask.has(Status::INIT) && !value.has(Status::INIT) {
        return forget_number(&link, board, mask, value).await;
    }
    if mask.has(Status::MSTART) && value.has(Status::MSTART) {
        // Setting MSTART starts the application, which takes as long as a start by PC_START. Therefore the PC waits
        // for MSTART before it reads the status back.
        let before = numbers(&link, board).await?;
        link.send(to, ToBoard::SetStatus { mask: mask.0, value: value.0 }).await;
        if !before.status.has(Status::MSTART) {
            let what = "the application did not start";
            wait_status(&link, board, Status::MSTART, Status::MSTART, link.times().start, what).await?;
            link.with(|core| core.forget_parameters(board));
        }
    }
    let now = set_status(&link, board, mask, value).await?;
    Ok(Outcome::Status { board, info: now })
}

/// Clears the INIT bit of a board. The board then forgets its number and no longer answers, so its silence confirms
/// the change.
async fn forget_number(link: &Link, board: u8, mask: Status, value: Status) -> Result<Outcome, Error> {
    let to = link.board(board)?;
    let before = numbers(link, board).await?;
    for _ in 0..TRIES {
        link.send(to, ToBoard::SetStatus { mask: mask.0, value: value.0 }).await;
        match numbers(link, board).await {
            Err(Error::Exchange(ExchangeError::NoAnswer { .. })) => {
                link.with(|core| *core.boards.of(board) = Default::default());
                // A board without a number can no longer answer. Therefore the function returns the status that D-22 requires.
                let status = expected_status(&before, mask.0, value.0);
                return Ok(Outcome::Status { board, info: BoardInfo { status, ..before } });
            }
            Err(e) => return Err(e),
            Ok(_) => {}
        }
    }
    let status = before.status;
    Err(StatusError::StatusNotTaken { board, mask, wanted: value, status, tries: TRIES }.into())
}

/// Sends PC_INFO every 200 ms until the selected status bits have the requested values.
pub(crate) async fn wait_status(
    link: &Link,
    board: u8,
    mask: Status,
    value: Status,
    limit: u64,
    what: &'static str,
) -> Result<BoardInfo, Error> {
    let since = link.now();
    let mut last = None;
    loop {
        match numbers(link, board).await {
            Ok(info) if info.status & mask == value => return Ok(info),
            Ok(info) => last = Some(info.status),
            Err(Error::Exchange(ExchangeError::NoAnswer { .. } | ExchangeError::Incomplete { .. })) => {}
            Err(e) => return Err(e),
        }
        let waited = link.now().saturating_sub(since);
        if waited >= limit {
            let waited_ms = waited / MS;
            return Err(match last {
                Some(status) => Error::Status(StatusError::NotReached { board, what, waited_ms, status }),
                None => link.no_answer(board, Function::Info, TRIES, since).into(),
            });
        }
        link.sleep(200 * MS).await;
    }
}

/// Sends PC_RESET to one board or to all boards, and returns the reports of the boards. The procedure never repeats PC_RESET automatically;
/// only the user may repeat it.
pub(crate) async fn reset(link: Link, board: Option<u8>, force: bool) -> Result<Outcome, Error> {
    let to = match board {
        Some(board) => link.board(board)?,
        None => link.broadcast_number(),
    };
    link.become_master(force).await?;
    // Checks that the board exists before the reset. Without this check, the reset of a missing board would look like a reset that no board
    // confirmed.
    let before = match board {
        Some(board) => {
            let before = confirmed(&link, board).await?.info;
            one_board_each(&link, &[board]).await?;
            Some(before)
        }
        None => {
            one_board_for_each_number(&link).await?;
            None
        }
    };
    link.listen(0, &REPORTS);
    link.ask(to, ToBoard::Reset).await;
    link.with(|core| match board {
        Some(board) => {
            *core.boards.of(board) = Default::default();
            core.data.remove(&board);
        }
        None => {
            core.boards.clear();
            core.data.clear();
        }
    });
    let mut reports = Reports::default();
    collect_reports(&link, link.times().report_window, &mut reports).await;
    if let (Some(board), Some(before)) = (board, before) {
        was_reset(&link, board, before, &mut reports).await?;
    }
    Ok(Outcome::Reset(reports))
}

/// Checks that a board was reset: the board has reported and no longer has a number. If the report of the board was lost, the function
/// requests another report.
async fn was_reset(link: &Link, board: u8, before: BoardInfo, reports: &mut Reports) -> Result<(), Error> {
    let since = link.now().saturating_sub(link.times().report_window);
    let ucom_id = before.flash_number as u8;
    for _ in 1..TRIES {
        if !reports.ids.contains(&ucom_id) {
            let mut all = Reports::default();
            ask_reports(link, &mut all).await;
            reports.ids.extend(all.ids.contains(&ucom_id).then_some(ucom_id));
        }
    }
    match numbers(link, board).await {
        Err(Error::Exchange(ExchangeError::NoAnswer { .. })) if reports.ids.contains(&ucom_id) => {
            link.with(|core| *core.boards.of(board) = Default::default());
            Ok(())
        }
        Err(Error::Exchange(ExchangeError::NoAnswer { .. })) => {
            Err(link.no_answer(board, Function::Reset, 1, since).into())
        }
        Err(error) => Err(error),
        Ok(info) => {
            let waited_ms = link.now().saturating_sub(since) / MS;
            Err(StatusError::NotReached {
                board,
                what: "the board did not give up its number",
                waited_ms,
                status: info.status,
            }
            .into())
        }
    }
}

/// Sends PC_XRESET to a board. At the end of this procedure, the board runs its exloader with programming enabled (D-23).
pub(crate) async fn xreset(link: Link, board: u8, force: bool) -> Result<Outcome, Error> {
    link.board(board)?;
    link.become_master(force).await?;
    one_board_each(&link, &[board]).await?;
    let info = enter_exloader(&link, board, None).await?;
    Ok(Outcome::Status { board, info })
}

/// Sends PC_XRESET, waits, and sends PC_INFO until the exloader runs. If PROG is still not set, the function sets PROG with PC_SETSTATUS
/// (U-4).
///
/// If the board no longer answers and its flash number is known, the function repairs the board's number. If another board answers instead,
/// the function returns an error.
pub(crate) async fn enter_exloader(
    link: &Link,
    board: u8,
    flash_number: Option<u16>,
) -> Result<BoardInfo, Error> {
    let info = match (xreset_taken(link, board).await, flash_number) {
        (Err(Error::Exchange(ExchangeError::NoAnswer { .. })), Some(flash_number)) => {
            link.note(format!("board {board} lost its number: it gets the number again"));
            repair(link, board, flash_number).await?;
            exloader_runs(link, board, EXLOADER_WAIT).await?
        }
        (result, _) => result?,
    };
    if let Some(wanted) = flash_number.filter(|wanted| *wanted != info.flash_number) {
        // The function reads the flash number twice, because a single damaged answer must not be interpreted as another board.
        let found = confirmed(link, board).await?.info.flash_number;
        if found != wanted {
            return Err(IdentityError::WrongBoard { board, wanted, found }.into());
        }
    }
    if info.status.has(Status::PROG) {
        return Ok(info);
    }
    set_status(link, board, Status::PROG, Status::PROG).await
}

/// Longest time that an exloader needs to start.
const EXLOADER_WAIT: u64 = 3_000 * MS;

async fn exloader_runs(link: &Link, board: u8, limit: u64) -> Result<BoardInfo, Error> {
    let what = "the exloader did not start";
    wait_status(link, board, Status::EXLRUN, Status::EXLRUN, limit, what).await
}

/// Sends PC_XRESET until the board executes the command. A board does not answer PC_XRESET. If the application of a board answers PC_INFO,
/// the board did not receive PC_XRESET. A silent board is rebooting or has lost its number, so it gets no further PC_XRESET.
async fn xreset_taken(link: &Link, board: u8) -> Result<BoardInfo, Error> {
    let to = link.board(board)?;
    let soon = EXLOADER_WAIT / 3;
    for _ in 1..TRIES {
        send_xreset(link, to).await;
        match exloader_runs(link, board, soon).await {
            Err(Error::Status(StatusError::NotReached { .. })) => {}
            Err(Error::Exchange(ExchangeError::NoAnswer { .. })) => {
                return exloader_runs(link, board, EXLOADER_WAIT - soon).await;
            }
            other => return other,
        }
    }
    send_xreset(link, to).await;
    exloader_runs(link, board, EXLOADER_WAIT).await
}

async fn send_xreset(link: &Link, to: Sequence) {
    link.send(to, ToBoard::XReset).await;
    link.with(|core| {
        core.boards.of(to.number()).application_ended();
        core.forget_parameters(to.number());
    });
    link.sleep(link.times().xreset_wait).await;
}

/// Sends PC_START and waits until the application runs. MCA_DSP_READY, or MSTART in the answer to PC_INFO, shows that the application runs
/// (D-30).
pub(crate) async fn start_application(link: &Link, board: u8) -> Result<BoardSeen, Error> {
    let before = info(link, board).await?;
    start_from(link, before).await
}

/// Starts the application of a board whose identity has just been read.
pub(crate) async fn start_from(link: &Link, before: BoardSeen) -> Result<BoardSeen, Error> {
    let board = before.number;
    let to = link.board(board)?;
    let mut last = before.info.status;
    one_board_each(link, &[board]).await?;
    if last.has(Status::MSTART) {
        return Ok(before);
    }
    let since = link.now();
    let mut error = None;
    for _ in 0..TRIES {
        link.listen(1 << board, &[Function::McaReady]);
        // The start is recorded before PC_START leaves the queue. If the procedure is cancelled during the start, a
        // later stop therefore knows that the board may still start.
        link.with(|core| core.boards.of(board).starting_since = Some(core.now));
        link.ask(to, ToBoard::Start).await;
        let until = link.now() + link.times().start;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::McaReady => break,
                FromBoard::Error(ErrorCode::AutostartForbidden) => {
                    link.with(|core| core.boards.of(board).starting_since = None);
                    return Err(ExchangeError::Device {
                        board,
                        code: ErrorCode::AutostartForbidden,
                        during: "PC_START",
                    }
                    .into());
                }
                // Errors that a bad bus causes do not end the start. If all attempts to start the board fail, the function returns the last
                // error.
                message => error = Link::device(board, &message, "PC_START").or(error),
            }
        }
        let now = info(link, board).await?;
        last = now.info.status;
        if last.has(Status::MSTART) {
            link.with(|core| {
                core.boards.of(board).starting_since = None;
                core.forget_parameters(board);
            });
            return Ok(now);
        }
    }
    if let Some(error) = error {
        return Err(error.into());
    }
    let waited_ms = link.now().saturating_sub(since) / MS;
    Err(StatusError::NotReached { board, what: "the application did not start", waited_ms, status: last }
        .into())
}

pub(crate) async fn start(link: Link, board: u8, force: bool) -> Result<Outcome, Error> {
    link.board(board)?;
    link.become_master(force).await?;
    start_application(&link, board).await.map(Outcome::Started)
}

/// Returns the flags of a board before a change: the last flags that the board has sent. If the board has sent no
/// flags, the function derives them from the status, with the outputs off (D-37).
async fn flags(link: &Link, board: u8, ends: bool) -> Result<Admin, Error> {
    let known = info(link, board).await?.info;
    // A command that only ends motion must not wait for answers of boards.
    if !ends {
        one_board_each(link, &[board]).await?;
    }
    if !known.status.has(Status::MSTART) {
        return Err(SignalError::NoApplication { board, valid: known.has_application() }.into());
    }
    let flags = link.with(|core| core.boards.get(board).and_then(|b| b.admin));
    let run = known.status.has(Status::MCARUN);
    // The frame with the last flags of the board may have been lost, so the control loop bit is taken from the status
    // byte.
    Ok(flags.map_or(Admin { run, ..Admin::default() }, |flags| Admin {
        run,
        active: flags.active && run,
        ..flags
    }))
}

/// Reads the flags of a board, changes them and writes them.
pub(crate) async fn change_flags(link: &Link, board: u8, change: AdminChange) -> Result<Admin, Error> {
    let wanted = change.apply(flags(link, board, change.only_ends()).await?);
    admin(link, board, wanted).await
}

pub(crate) async fn admin_procedure(
    link: Link,
    board: u8,
    change: AdminChange,
    force: bool,
) -> Result<Outcome, Error> {
    link.board(board)?;
    link.become_master(force).await?;
    let admin = change_flags(&link, board, change).await?;
    Ok(Outcome::Admin { board, admin })
}
