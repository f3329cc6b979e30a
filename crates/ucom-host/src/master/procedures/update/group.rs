//! Update of several boards at once by broadcast PC_PROG frames. Every board with PROG = 1 accepts the program data, so all boards outside
//! the group must have PROG = 0.
use crate::master::engine::{Link, MS};
use crate::master::error::Error;
use crate::master::procedures::exchange::TRIES;
use crate::master::procedures::exchange::{confirmed, identity, set_status};
use crate::master::procedures::survey::statuses;
use crate::master::procedures::update::board::{enter, has, judge, one, verify};
use crate::master::procedures::update::session::{Stage, UpdateSession};
use crate::master::procedures::update::transfer::{Attempt, Broken, Transferred};
use crate::master::reports::update::UpdatePlan;
use ucom::{Sequence, Status, ToBoard};

/// Updates all boards whose update is not done yet by one broadcast transfer. A board that leaves the group is then
/// updated alone.
///
/// If a board outside the group keeps PROG = 1, the PC refuses the update. If a selected board fails before the
/// transfer, but possibly still accepts program data, the PC sends no broadcast and updates the other boards one by
/// one.
pub(super) async fn group(link: &Link, session: &mut UpdateSession) -> Result<(), Error> {
    let Some(broadcast) = link.profile().broadcast_number() else {
        link.note("the boards are updated one by one, because `addr.broadcast` is none".into());
        return Ok(());
    };
    let selected = session.open();
    if let Err(error) = silence_others(link, &selected).await {
        session.refuse(&error);
        return Ok(());
    }
    let plan = session.plan(link, None)?;
    let since = link.now();
    let (boards, stray) = gather(link, session, &selected).await;
    if stray {
        link.note(
            "a board that does not answer may receive a broadcast: the other boards are updated one by one"
                .into(),
        );
        // The boards in their exloaders stay listed as in progress, because a cancel must end their programming mode.
        return Ok(());
    }
    for board in &boards {
        if let Some(result) = session.result(*board) {
            result.attempts = 1;
        }
    }
    let gap_us = u64::from(link.profile().prog_frame_gap_us);
    let since_transfer = link.now();
    let attempt =
        Attempt { link, plan: &plan, to: broadcast, boards, number: 1, gap_us, since: since_transfer };
    let erasing = |boards: &[u8], left: &[(u8, Broken)]| {
        boards.iter().for_each(|board| session.reach(*board, Stage::Erased));
        let listening = left.iter().filter(|(_, why)| !why.ended_transfer());
        listening.for_each(|(board, _)| session.reach(*board, Stage::MaybeErased));
    };
    let Transferred { finished, broken } = attempt.run(erasing).await;
    for board in finished {
        judge(link, session, board, &plan, 1, None).await;
        if let Some(result) = session.result(board) {
            result.time_us = link.now().saturating_sub(since);
        }
    }
    for (board, why) in broken {
        if !why.ended_transfer() && is_done_after_all(link, session, board, &plan).await {
            continue;
        }
        if judge(link, session, board, &plan, 1, Some(why)).await.is_some()
            && link.profile().prog_attempts > 1
        {
            one(link, session, board, 2).await?;
        }
    }
    Ok(())
}

/// Checks a board whose DSP_READY was lost, because it may still have received the whole transfer. If the update of
/// the board is done, the function verifies the program. Otherwise, the session stores whether the flash was erased,
/// as far as the answer of the board shows this.
///
/// If the board already had this program before the update, its answer cannot show whether the update is done.
async fn is_done_after_all(link: &Link, session: &mut UpdateSession, board: u8, plan: &UpdatePlan) -> bool {
    let Ok(seen) = confirmed(link, board).await else { return false };
    let had = session.before(board).is_some_and(|before| has(&before, plan));
    if has(&seen.info, plan) && !had {
        verify(link, session, board, plan).await;
        return true;
    }
    let same = session.before(board).is_some_and(|before| identity(&before) == identity(&seen.info));
    if same && seen.info.has_application() {
        session.proved_untouched(board);
    } else if session.stage(board) == Stage::MaybeErased {
        session.reach(board, Stage::Erased);
    }
    false
}

/// Ends the programming mode of every board that is not selected, and reads the status back.
///
/// The function sends PC_SETSTATUS with PROG = 0 to each of these numbers three times, even if no board answers. Boards without a number
/// ignore PC_PROG.
async fn silence_others(link: &Link, selected: &[u8]) -> Result<(), Error> {
    let others: Vec<Sequence> =
        link.profile().board_numbers().filter(|n| !selected.contains(&n.number())).collect();
    for _ in 0..TRIES {
        for number in &others {
            link.send(*number, ToBoard::SetStatus { mask: Status::PROG.0, value: 0 }).await;
        }
        link.sleep(20 * MS).await;
    }
    for (board, status) in statuses(link, &others).await {
        if status?.has(Status::PROG) {
            // `set_status` makes three more attempts and reads the status back each time. If all attempts to clear PROG fail, the PC
            // refuses the update.
            set_status(link, board, Status::PROG, Status(0)).await?;
        }
    }
    Ok(())
}

/// Starts the exloaders of the selected boards, and returns the boards whose exloaders run. The second value is
/// `true` if a board failed and did not confirm the end of its programming mode. Frames to the group would erase such
/// a board without any report.
async fn gather(link: &Link, session: &mut UpdateSession, selected: &[u8]) -> (Vec<u8>, bool) {
    let (mut boards, mut stray) = (Vec::new(), false);
    for board in selected {
        session.active.push(*board);
        match enter(link, session, *board).await {
            Ok(()) => boards.push(*board),
            Err(error) => {
                stray |= set_status(link, *board, Status::PROG, Status(0)).await.is_err();
                session.fail_with(*board, error);
            }
        }
    }
    (boards, stray)
}
