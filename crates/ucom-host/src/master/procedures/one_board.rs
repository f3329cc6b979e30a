//! Checks, before a procedure changes a board, that each number belongs to only one board (D-24).
use std::collections::BTreeMap;

use crate::master::engine::{Link, MS, Open};
use crate::master::error::IdentityError;
use crate::master::procedures::exchange::TRIES;
use ucom::{Function, ToBoard};

/// Maximum age of a PC_INFO whose answers still show which board has a number, µs.
const FRESH: u64 = 2_000 * MS;
/// Time between two PC_INFO requests in µs. Because of this pause, the answers of 31 boards do not arrive as one burst.
const SPACING: u64 = 2 * MS;

/// Checks that each of the given board numbers belongs to only one board: no other board answers PC_INFO within the
/// allowed time. A number to which no board answers is not an error.
pub(crate) async fn one_board_each(link: &Link, boards: &[u8]) -> Result<(), IdentityError> {
    let mask = boards.iter().fold(0, |mask, board| mask | 1_u32.checked_shl((*board).into()).unwrap_or(0));
    let (mut silent, mut round) = (BTreeMap::<u8, u32>::new(), 0);
    loop {
        let patience = link.times().info;
        // In later rounds, a PC_INFO of any age counts. The PC_INFO was recent in the first round, or was sent after
        // that round, so it can look old only because the driver is late.
        let oldest = if round == 0 { FRESH } else { u64::MAX };
        let mut until = None;
        let mut ask = Vec::new();
        for board in boards {
            // The check skips numbers that a board cannot have.
            let Ok(to) = link.board(*board) else { continue };
            match link.with(|core| core.holders.open(*board, core.fired, patience, oldest)) {
                Open::Nothing => {}
                Open::Wait(end) => until = until.max(Some(end)),
                Open::AskAgain => ask.push(to),
                Open::Ask => {
                    let times = silent.entry(*board).or_default();
                    *times += 1;
                    if *times < TRIES {
                        ask.push(to);
                    }
                }
            }
        }
        if let Some(error) = link.with(|core| core.holders.shared(mask)) {
            return Err(error);
        }
        if (ask.is_empty() && until.is_none()) || round > 2 * TRIES {
            return Ok(());
        }
        round += 1;
        link.listen(mask, &[Function::DspInfo]);
        for board in ask {
            link.send(board, ToBoard::Info).await;
            until = until.max(Some(link.now() + patience));
            link.sleep(SPACING).await;
        }
        out_of_words(link, until.unwrap_or_default()).await;
    }
}

/// Checks every number that a board can have.
pub(crate) async fn one_board_for_each_number(link: &Link) -> Result<(), IdentityError> {
    link.listen(u32::MAX, &[Function::DspInfo]);
    let asked = match link.profile().broadcast_number() {
        Some(broadcast) => vec![broadcast],
        None => link.profile().board_numbers().collect(),
    };
    for number in asked {
        link.send(number, ToBoard::Info).await;
        link.sleep(SPACING).await;
    }
    out_of_words(link, link.now() + link.times().info).await;
    let doubtful = link.with(|core| core.holders.doubtful());
    one_board_each(link, &doubtful).await?;
    link.with(|core| core.holders.shared(u32::MAX)).map_or(Ok(()), Err)
}

/// Waits until the last PC_INFO to these boards can no longer be answered, because a board that shares a number can
/// answer late. Each bit of `boards` is a board.
pub(crate) async fn last_answers(link: &Link, boards: u32) {
    let patience = link.times().info;
    if let Some(asked_at) = link.with(|core| core.holders.last_asked(boards)) {
        link.sleep_until(asked_at + patience).await;
    }
}

/// Waits until the time `until`, and then until the boards have finished an answer that is still being received.
async fn out_of_words(link: &Link, mut until: u64) {
    let (gap, limit) = (link.times().gap, until + 20 * link.times().gap);
    while link.next(until).await.is_some() && link.now() < limit {
        until = until.max(link.now() + gap).min(limit);
    }
}
