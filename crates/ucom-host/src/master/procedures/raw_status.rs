//! Sends PC_SETSTATUS exactly as the formula `new = (old & ~mask) | value` defines it, including value bits outside
//! the mask (D-22). This procedure is for experts.
use crate::master::engine::{Link, MS};
use crate::master::error::{Error, ExchangeError, RunningError};
use crate::master::procedures::exchange::numbers;
use crate::master::procedures::one_board::one_board_each;
use crate::master::reports::{Outcome, RawStatus, expected_status};
use ucom::{Status, ToBoard};

/// Sends one PC_SETSTATUS to one board or to all boards, and reports the effect. `seen` lists the boards whose status is read.
pub(crate) async fn raw_status(
    link: Link,
    to: Option<u8>,
    seen: Vec<u8>,
    (mask, value): (u8, u8),
    force: bool,
) -> Result<Outcome, Error> {
    let address = match to {
        Some(board) => link.board(board)?,
        None => link.broadcast_number(),
    };
    let mut before = Vec::new();
    for board in &seen {
        before.push((*board, numbers(&link, *board).await?));
    }
    let running: Vec<u8> =
        before.iter().filter(|(_, info)| info.status.has(Status::MCARUN)).map(|(board, _)| *board).collect();
    if !running.is_empty() && !force {
        return Err(RunningError::LoopRuns { boards: running }.into());
    }
    link.become_master(force).await?;
    one_board_each(&link, &seen).await?;
    // The PC never repeats this PC_SETSTATUS, because the command must take effect only once.
    link.send(address, ToBoard::SetStatus { mask, value }).await;
    let limit = link.now() + link.times().start;
    let mut boards = Vec::new();
    for (board, before) in before {
        let expected = expected_status(&before, mask, value);
        let mut result = RawStatus { board, before, expected, after: None };
        loop {
            result.after = match numbers(&link, board).await {
                Ok(info) => Some(info),
                Err(Error::Exchange(ExchangeError::NoAnswer { .. })) => None,
                Err(e) => return Err(e),
            };
            // Applications need time to start, so the PC reads the status again.
            if result.as_expected() || link.now() >= limit {
                break;
            }
            link.sleep(100 * MS).await;
        }
        if expected.has(Status::MSTART) != before.status.has(Status::MSTART) || !expected.has(Status::INIT) {
            link.with(|core| core.forget_parameters(board));
        }
        if result.after.is_none() {
            link.with(|core| *core.boards.of(board) = Default::default());
        }
        boards.push(result);
    }
    Ok(Outcome::RawStatus(boards))
}
