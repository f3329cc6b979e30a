//! Assigns a lost number to its board again while the other boards keep their numbers (section on initialisation:
//! D-21, D-24).
//!
//! PC_INIT(n) assigns the number to *every* board without a number whose incoming pin is active. Therefore, when
//! PC_INIT(n) is sent, no outgoing pin may be on except the pin of the board before n. The incoming pin of the first
//! board is always active, so the first board must have its number. The other outgoing pins can also be off at other
//! times, for example after a cancel. This does no harm: only PC_INIT depends on the pins, and each repair switches
//! on the pin that it needs.

use crate::master::engine::{Link, MS, head};
use crate::master::error::{AddressError, Error, IdentityError};
use crate::master::procedures::exchange::{TRIES, confirmed, set_status};
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::survey::statuses;
use crate::master::procedures::take_number::take_number;
use crate::master::reports::{BoardSeen, Outcome};
use std::collections::BTreeMap;
use ucom::{FromBoard, Function, Sequence, Status, ToBoard};

/// Limit of rounds in which PC_INFO is sent to find the boards with a number.
const ROUNDS: u32 = 6;

/// Assigns `number` to its board again if the board no longer answers. The function returns an error if the board has another flash number,
/// or if another board has also taken the number.
pub(crate) async fn repair(link: &Link, number: u8, flash_number: u16) -> Result<BoardSeen, Error> {
    link.board(number)?;
    let mut lowered = Vec::new();
    // If two boards take the number, the steps below detect this and remove the number from both boards.
    link.bear_shared_numbers(true);
    let given = give(link, number, flash_number, &mut lowered).await;
    for board in lowered {
        if set_status(link, board, Status::OPINIT, Status::OPINIT).await.is_err() {
            link.note(format!("board {board} did not confirm that its outgoing init pin is on again"));
        }
    }
    link.bear_shared_numbers(false);
    let seen = given?;
    let raised = set_status(link, number, Status::OPINIT, Status::OPINIT).await?;
    Ok(BoardSeen { info: raised, ..seen })
}

/// Assigns the number to the intended board only. The function adds a board to `lowered` if it switches off the outgoing pin of the board.
async fn give(link: &Link, number: u8, flash_number: u16, lowered: &mut Vec<u8>) -> Result<BoardSeen, Error> {
    let since = link.now();
    only_its_pin(link, number, lowered).await?;
    if !take_number(link, number, true).await? {
        return Err(link.no_answer(number, Function::Init, TRIES, since).into());
    }
    let found: Vec<u16> = holders(link, number).await?;
    match found.as_slice() {
        [found] if *found == flash_number => match one_board_each(link, &[number]).await {
            Ok(()) => confirmed(link, number).await,
            Err(shared) => Err(given_back(link, number, shared.into()).await?),
        },
        [] => Err(link.no_answer(number, Function::Info, ROUNDS, since).into()),
        // A board with another flash number must lose the number. Otherwise, the next command would reach that board.
        [other] => {
            if !take_back(link, number).await? {
                link.note(format!("board 0x{other:04X} does not give up number {number}"));
            }
            Err(IdentityError::WrongBoard { board: number, wanted: flash_number, found: *other }.into())
        }
        _ => {
            let shared =
                Error::Identity(IdentityError::NumberShared { board: number, found, given_back: false });
            Err(given_back(link, number, shared).await?)
        }
    }
}

/// Switches off the outgoing pins of all boards except the board before `number`, whose pin must be on.
///
/// The function sends PC_SETSTATUS to every other number three times, even if no board answers: a board can execute
/// the command although its answers are lost. The function reads the status of each board that answers.
async fn only_its_pin(link: &Link, number: u8, lowered: &mut Vec<u8>) -> Result<(), Error> {
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    let before = statuses(link, &numbers).await;
    let first = numbers.first().map_or(number, |n| n.number());
    let feeder = (number > first).then(|| number - 1);
    if let Some(feeder) = feeder {
        // No board can take `number` while the outgoing pin of the board before it is off, and this pin stays on only
        // while its board has a number.
        set_status(link, feeder, Status::OPINIT, Status::OPINIT).await?;
        if !before.contains_key(&first) && feeder != first {
            return Err(AddressError::MayTakeNumber { board: number, other: first }.into());
        }
    }
    let others: Vec<Sequence> = numbers.into_iter().filter(|n| Some(n.number()) != feeder).collect();
    let on = |board: &u8| before.get(board).is_some_and(|s| s.as_ref().is_ok_and(|s| s.has(Status::OPINIT)));
    lowered.extend(others.iter().map(|n| n.number()).filter(|n| *n != number && on(n)));
    for _ in 0..TRIES {
        for other in &others {
            link.send(*other, ToBoard::SetStatus { mask: Status::OPINIT.0, value: 0 }).await;
        }
        link.sleep(20 * MS).await;
    }
    for (board, status) in statuses(link, &others).await {
        if !status.is_ok_and(|status| !status.has(Status::OPINIT)) {
            // `set_status` makes three more attempts and reads the status back each time. If all attempts to switch off the pin fail, the
            // repair ends.
            set_status(link, board, Status::OPINIT, Status(0)).await?;
        }
    }
    Ok(())
}

/// Returns the flash numbers of all boards that answer to `number`. A flash number that is received only once is considered to be a damaged
/// answer.
async fn holders(link: &Link, number: u8) -> Result<Vec<u16>, Error> {
    let mut seen: BTreeMap<u16, u32> = BTreeMap::new();
    for round in 1..=ROUNDS {
        for flash_number in answers(link, number).await? {
            *seen.entry(flash_number).or_default() += 1;
        }
        let clear = seen.is_empty() || (seen.len() == 1 && seen.values().all(|times| *times > 1));
        if round >= TRIES && clear {
            break;
        }
    }
    Ok(seen.into_iter().filter(|(_, times)| *times > 1).map(|(flash_number, _)| flash_number).collect())
}

/// Sends one PC_INFO. The function returns the flash numbers in all answers to this PC_INFO, not only in the first answer.
async fn answers(link: &Link, number: u8) -> Result<Vec<u16>, Error> {
    let (to, times, profile) = (link.board(number)?, link.times(), link.profile());
    link.listen(1 << number, &[Function::DspInfo]);
    link.ask(to, ToBoard::Info).await;
    let mut until = link.now() + times.info;
    let limit = until + 20 * times.gap;
    let mut found = Vec::new();
    while let Some(received) = link.next(until).await {
        if let (FromBoard::Info(payload), true) = (&received.message, received.from == number) {
            found.extend(head(number, payload, &profile).map(|info| info.flash_number));
        }
        until = (link.now() + times.gap).min(limit);
        if link.now() >= limit {
            break;
        }
    }
    found.sort_unstable();
    found.dedup();
    Ok(found)
}

/// Removes a number from both boards that share it.
pub(crate) async fn given_back(link: &Link, number: u8, error: Error) -> Result<Error, Error> {
    let Error::Identity(IdentityError::NumberShared { board, found, .. }) = error else { return Ok(error) };
    let given_back = take_back(link, number).await?;
    Ok(Error::Identity(IdentityError::NumberShared { board, found, given_back }))
}

/// Removes a number from its board. The function returns `true` if no board answers to the number after the removal.
async fn take_back(link: &Link, number: u8) -> Result<bool, Error> {
    let to = link.board(number)?;
    for _ in 0..TRIES {
        link.send(to, ToBoard::SetStatus { mask: Status::INIT.0, value: 0 }).await;
        link.sleep(20 * MS).await;
    }
    link.with(|core| *core.boards.of(number) = Default::default());
    for _ in 0..TRIES {
        if !answers(link, number).await?.is_empty() {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Runs the repair of a number as a separate procedure.
pub(crate) async fn repair_procedure(
    link: Link,
    number: u8,
    flash_number: u16,
    force: bool,
) -> Result<Outcome, Error> {
    link.board(number)?;
    link.become_master(force).await?;
    match holders(&link, number).await?.as_slice() {
        [] => repair(&link, number, flash_number).await.map(Outcome::Repaired),
        // The right board already has the number. Its outgoing pin can be off, so the repair only switches on this
        // pin.
        [found] if *found == flash_number => {
            one_board_each(&link, &[number]).await?;
            let seen = confirmed(&link, number).await?;
            let info = set_status(&link, number, Status::OPINIT, Status::OPINIT).await?;
            Ok(Outcome::Repaired(BoardSeen { info, ..seen }))
        }
        [found] => {
            Err(IdentityError::WrongBoard { board: number, wanted: flash_number, found: *found }.into())
        }
        found => {
            Err(IdentityError::NumberShared { board: number, found: found.to_vec(), given_back: false }
                .into())
        }
    }
}
