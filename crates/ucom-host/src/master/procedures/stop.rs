//! Stops a board, even if the board does not answer. A stop can end the outputs, the control loop and the application of the board.
use crate::master::engine::{Link, MS};
use crate::master::error::Error;
use crate::master::procedures::control::change_flags;
use crate::master::procedures::exchange::TRIES;
use crate::master::procedures::exchange::{admin, info, set_status};
use crate::master::procedures::one_board::one_board_each;
use crate::master::reports::{AdminChange, Outcome, StopLevel};
use ucom::{Admin, BoardInfo, Status, ToBoard};

pub(crate) async fn stop(link: Link, board: u8, level: StopLevel, force: bool) -> Result<Outcome, Error> {
    link.board(board)?;
    link.become_master(force).await?;
    let info = stop_board(&link, board, level).await;
    // The stop does not fail if two boards share the number, because both boards have received the stop command. The
    // shared number is only reported as an event.
    let _ = one_board_each(&link, &[board]).await;
    Ok(Outcome::Status { board, info: info? })
}

/// Switches off the outputs, then stops the control loop, then the application. The order of these steps is the reverse of a start. If a
/// board does not answer a step, the function still performs the next steps. The function returns the first failure.
pub(crate) async fn stop_board(link: &Link, board: u8, level: StopLevel) -> Result<BoardInfo, Error> {
    let mut known = match info(link, board).await {
        Ok(seen) => seen.info,
        Err(error) => {
            stop_silent(link, board, level).await?;
            return Err(error);
        }
    };
    if !known.status.has(Status::MSTART) && level == StopLevel::Application {
        known = stop_starting(link, board, known).await?;
    }
    if !known.status.has(Status::MSTART) {
        return Ok(known);
    }
    let off = AdminChange { active: Some(false), ..Default::default() };
    let mut done = change_flags(link, board, off).await.map(drop);
    if level != StopLevel::Outputs {
        link.with(|core| core.stop_inputs(board));
        let ended = change_flags(link, board, AdminChange { run: Some(false), ..off }).await;
        done = done.and(ended.map(drop));
    }
    if level == StopLevel::Application {
        link.with(|core| core.boards.of(board).application_ended());
        done = done.and(set_status(link, board, Status::MSTART, Status(0)).await.map(drop));
    }
    done?;
    Ok(info(link, board).await?.info)
}

/// Stops a board to which a start command was sent, but which has not reported the start yet. Such a board can start
/// at any time until `start.timeout` has passed. Therefore it gets the stop command in any state, and the function
/// reads its state again after that time.
async fn stop_starting(link: &Link, board: u8, known: BoardInfo) -> Result<BoardInfo, Error> {
    let Some(since) = link.with(|core| core.boards.of(board).starting_since) else { return Ok(known) };
    let answer = set_status(link, board, Status::MSTART, Status(0)).await;
    let up = since + link.times().start;
    if link.now() < up {
        link.sleep_until(up).await;
    }
    let now = info(link, board).await.map(|seen| seen.info).or(answer)?;
    link.with(|core| core.boards.of(board).starting_since = None);
    Ok(now)
}

/// Stops a board that does not answer PC_INFO, because it may still be running. The function does not read the flags of the board first.
async fn stop_silent(link: &Link, board: u8, level: StopLevel) -> Result<(), Error> {
    let to = link.board(board)?;
    let flags = link.with(|core| core.boards.get(board).and_then(|b| b.admin)).unwrap_or_default();
    let run = flags.run && level == StopLevel::Outputs;
    link.with(|core| core.stop_inputs(board));
    // The board may be silent, so the result of this command is ignored.
    let _ = admin(link, board, Admin { run, active: false, ..flags }).await;
    for _ in 0..TRIES {
        link.send(to, ToBoard::Admin(Admin { run, active: false, ..flags })).await;
        if level == StopLevel::Application {
            link.send(to, ToBoard::SetStatus { mask: Status::MSTART.0, value: 0 }).await;
        }
        link.sleep(20 * MS).await;
    }
    Ok(())
}
