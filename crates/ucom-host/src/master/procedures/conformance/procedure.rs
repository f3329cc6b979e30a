//! Sequence of the conformance tests: identify the boards, run every allowed test, and restore the boards.
use crate::master::engine::Link;
use crate::master::error::{AddressError, Error, ExchangeError, IdentityError, MasterError, RunningError};
use crate::master::procedures::ask_reports::ask_reports;
use crate::master::procedures::conformance::bench::Found;
use crate::master::procedures::conformance::restore::put_all_back;
use crate::master::procedures::conformance::runner::Runner;
use crate::master::procedures::exchange::confirmed;
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::survey::board_states;
use crate::master::reports::{BoardSeen, ConformanceOptions, Outcome, Reports};
use std::collections::BTreeSet;
use ucom::{Function, Status};

pub(crate) async fn conformance(link: Link, options: ConformanceOptions) -> Result<Outcome, Error> {
    let found = link.or_cancel(look(&link, &options)).await?;
    link.tap(true);
    let mut tests = Runner::new(&link, &options, &found);
    let result = link.or_cancel(tests.all()).await;
    link.tap(false);
    link.bear_shared_numbers(true);
    if let Err(error) = result {
        let why = match &error {
            Error::Master(MasterError::Cancelled) => "cancelled".to_owned(),
            Error::Exchange(ExchangeError::NoAnswer { board, .. }) => {
                format!("board {board} does not answer")
            }
            other => other.to_string(),
        };
        tests.skip_rest(&why);
        tests.report.error = Some(error);
    }
    let Runner { mut report, unnumbered, at, .. } = tests;
    if options.changes() && !matches!(report.error, Some(Error::Master(MasterError::Bus { .. }))) {
        let at = at.filter(|_| report.error.is_some());
        let back = put_all_back(&link, &found, &options, unnumbered, at, &mut report.left);
        if let Err(error) = link.or_cancel(back).await {
            report.left.push(format!("not all boards have their earlier state again ({error}): `ucom scan`"));
        }
    } else if options.changes() {
        report
            .left
            .push("the boards still have the state after the last test: `ucom scan`, `ucom init`".into());
    }
    Ok(Outcome::Conformance(report))
}

/// Identifies the boards, and checks that the tests are allowed with these boards. This step does not change any board.
async fn look(link: &Link, options: &ConformanceOptions) -> Result<Found, Error> {
    let mut boards = Vec::new();
    let asked: Vec<u8> = match options.boards.is_empty() {
        true => link.profile().board_numbers().map(|n| n.number()).collect(),
        false => options.boards.clone(),
    };
    for board in asked {
        link.board(board)?;
        match confirmed(link, board).await {
            Ok(seen) => boards.push(seen),
            Err(Error::Exchange(ExchangeError::NoAnswer { .. })) if options.boards.is_empty() => {}
            Err(e) => return Err(e),
        }
    }
    one_board_each(link, &boards.iter().map(|b| b.number).collect::<Vec<_>>()).await?;
    let mut running: Vec<u8> =
        boards.iter().filter(|b| b.info.status.has(Status::MCARUN)).map(|b| b.number).collect();
    if let Some(program) = &options.program {
        let board = program.board;
        let seen = match boards.iter().find(|b| b.number == board) {
            Some(seen) => seen.clone(),
            None => return Err(link.no_answer(board, Function::Info, 3, link.now()).into()),
        };
        if seen.info.flash_number != program.flash_number {
            let (wanted, found) = (program.flash_number, seen.info.flash_number);
            return Err(IdentityError::WrongBoard { board, wanted, found }.into());
        }
        // U-2: program data have a higher priority on the bus than process data. Therefore tests that change boards
        // are refused while any board runs, even a board that is not tested.
        let states = board_states(link).await;
        running.extend(states.iter().filter(|(_, s)| s.has(Status::MCARUN)).map(|(b, _)| *b));
        running.sort_unstable();
        running.dedup();
    }
    if options.changes() && !running.is_empty() {
        return Err(RunningError::LoopRuns { boards: running }.into());
    }
    let (reports, all) = who_reports(link, &boards).await;
    if options.init && !all {
        return Err(AddressError::NotNumbered { reports: reports as u32, boards: boards.len() as u32 }.into());
    }
    if options.changes() {
        link.become_master(options.force).await?;
    }
    Ok(Found { boards, strangers: !all })
}

/// Returns the number of different reports. The second value is `true` if the reports match the numbered boards and
/// if the low byte of each flash number is unique.
async fn who_reports(link: &Link, boards: &[BoardSeen]) -> (usize, bool) {
    let mut reports = Reports::default();
    for _ in 0..2 {
        ask_reports(link, &mut reports).await;
    }
    let low = boards.iter().map(|b| b.info.flash_number as u8);
    let all = reports.ids.len() == boards.len() && low.collect::<BTreeSet<_>>() == reports.ids;
    (reports.ids.len(), all)
}
