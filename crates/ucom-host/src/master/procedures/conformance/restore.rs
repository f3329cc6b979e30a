//! Returns boards to their state before the conformance tests, even if the tests end early.
use crate::master::engine::{Link, MS, Session};
use crate::master::error::{Error, ExchangeError, IdentityError, StatusError};
use crate::master::procedures::conformance::bench::Found;
use crate::master::procedures::control::{start_application, wait_status};
use crate::master::procedures::exchange::{confirmed, numbers, set_status};
use crate::master::procedures::init::init;
use crate::master::procedures::repair::repair;
use crate::master::reports::{BoardSeen, ConformanceOptions, InitOptions, Outcome};
use ucom::{Admin, BoardInfo, Status, ToBoard};

/// Assigns numbers to the chain again. Every board must get its previous number again.
pub(super) async fn renumber(link: &Link, found: &Found) -> Result<(), Error> {
    // The init needs no check for another master, because this PC is already the master of the bus.
    let outcome = init(link.clone(), InitOptions { force: true, ..Default::default() }).await?;
    let Outcome::Init(report) = outcome else { return Ok(()) };
    for before in &found.boards {
        let (board, wanted) = (before.number, before.info.flash_number);
        match report.boards.iter().find(|b| b.number == board).map(|b| b.info.flash_number) {
            Some(found) if found == wanted => {}
            Some(found) => return Err(IdentityError::WrongBoard { board, wanted, found }.into()),
            None => {
                numbers(link, board).await?;
            }
        }
    }
    Ok(())
}

/// Restores all boards after the tests. The function adds failures to `left`, and still restores the other boards. `at` is the board whose
/// test ended early.
pub(super) async fn put_all_back(
    link: &Link,
    found: &Found,
    options: &ConformanceOptions,
    unnumbered: bool,
    at: Option<u8>,
    left: &mut Vec<String>,
) -> Result<(), Error> {
    link.with(|core| {
        if core.session == Session::Quiet {
            core.start_session();
        }
    });
    if unnumbered && let Err(error) = renumber(link, found).await {
        left.push(format!("numbers: {error}: `ucom init`"));
    }
    for before in &found.boards {
        let in_work = at == Some(before.number);
        if let Err(error) = put_back(link, before, options, in_work, left).await {
            left.push(format!("board {}: {error}", before.number));
        }
    }
    Ok(())
}

/// Restores one board to its state before the tests. The function ends the control loop of the board, and then restores ASTART, PROG and
/// the application.
pub(super) async fn put_back(
    link: &Link,
    before: &BoardSeen,
    options: &ConformanceOptions,
    in_work: bool,
    left: &mut Vec<String>,
) -> Result<(), Error> {
    let (n, was) = (before.number, before.info.status);
    let mut now = answering(link, before, options).await?;
    if now.status.has(Status::MSTART) {
        halt(link, n).await?;
    }
    // An application may start soon: by itself (ASTART), or because the test ended just after PC_START was sent.
    let coming = now.status.has(Status::ASTART) || in_work;
    if now.status.has(Status::ASTART) != was.has(Status::ASTART) {
        now = set_status(link, n, Status::ASTART, was & Status::ASTART).await?;
    }
    if coming {
        now = coming_up(link, n, now, was).await?;
    }
    if before.info.has_application() && !now.has_application() {
        let text = format!("board {n} has no program any more: `ucom update {n} IMAGE`");
        if !left.contains(&text) {
            left.push(text);
        }
    }
    if was.has(Status::MSTART) && now.has_application() {
        if !now.status.has(Status::MSTART) {
            start_application(link, n).await?;
            link.note(format!(
                "board {n}: its application was started again, so its parameters have their initial values"
            ));
        }
        return Ok(());
    }
    // PROG is cleared even if it was set before the tests, so that the board discards a transfer in progress.
    set_status(link, n, Status::MSTART | Status::PROG, Status(0)).await?;
    if was.has(Status::PROG) {
        set_status(link, n, Status::PROG, Status::PROG).await?;
    }
    Ok(())
}

/// Checks that the board answers and is the same board as before. A board can be silent for a long time, because it
/// erases its memory, or because it has rebooted and lost its number.
async fn answering(
    link: &Link,
    before: &BoardSeen,
    options: &ConformanceOptions,
) -> Result<BoardInfo, Error> {
    let n = before.number;
    let programmed = options.program.as_ref().is_some_and(|p| p.board == n);
    let limit = if programmed { link.times().erase } else { 500 * MS };
    let what = "the board did not answer";
    let now = match wait_status(link, n, Status(0), Status(0), limit, what).await {
        Ok(info) => info,
        Err(Error::Exchange(ExchangeError::NoAnswer { .. })) => {
            // The control loop of the board may still be running.
            halt(link, n).await?;
            repair(link, n, before.info.flash_number).await?.info
        }
        Err(e) => return Err(e),
    };
    if now.flash_number == before.info.flash_number {
        return Ok(now);
    }
    let now = confirmed(link, n).await?.info;
    match now.flash_number == before.info.flash_number {
        true => Ok(now),
        false => Err(IdentityError::WrongBoard {
            board: n,
            wanted: before.info.flash_number,
            found: now.flash_number,
        }
        .into()),
    }
}

/// Ends the control loop of a board. The function sends the stop command three times, because a frame can be lost.
async fn halt(link: &Link, board: u8) -> Result<(), Error> {
    let to = link.board(board)?;
    for _ in 0..3 {
        link.send(to, ToBoard::Admin(Admin::default())).await;
        link.sleep(20 * MS).await;
    }
    Ok(())
}

/// Waits until the application has started, if it did not run before the tests and may be starting now.
async fn coming_up(link: &Link, board: u8, now: BoardInfo, was: Status) -> Result<BoardInfo, Error> {
    if now.status.has(Status::MSTART) || was.has(Status::MSTART) || !now.has_application() {
        return Ok(now);
    }
    let what = "the application did not start";
    let limit = u64::from(link.profile().autostart_holdoff) * MS + link.times().start;
    match wait_status(link, board, Status::MSTART, Status::MSTART, limit, what).await {
        Ok(up) => Ok(up),
        Err(Error::Status(StatusError::NotReached { .. })) => numbers(link, board).await,
        Err(e) => Err(e),
    }
}
