//! Assigns numbers to the boards of a chain, in the order of the init wire (section on initialisation: D-21, D-24).
//!
//! A board takes the number of PC_INIT(n) if it has no number and its incoming pin is active. When this PC has
//! confirmed the number, the PC switches on the outgoing pin of the board, so that the next board can take a number.
//! The PC sends PC_INFO before it repeats PC_INIT. Otherwise, if a board has taken the number and has switched on its
//! pin by itself, the next board would take the same number.

use crate::master::engine::Link;
use crate::master::error::{Error, IdentityError};
use crate::master::procedures::ask_reports::{REPORTS, ask_reports, collect_reports};
use crate::master::procedures::byte_order::{exchanged, flash_numbers};
use crate::master::procedures::exchange::{confirmed, info, set_status};
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::repair::given_back;
use crate::master::procedures::stop::stop_board;
use crate::master::procedures::take_number::take_number;
use crate::master::reports::{BoardSeen, InitFinding, InitOptions, InitReport, Outcome, Reports, StopLevel};
use std::collections::BTreeSet;
use ucom::{Sequence, Status, ToBoard};

/// Assigns numbers to all boards of the chain.
pub(crate) async fn init(link: Link, options: InitOptions) -> Result<Outcome, Error> {
    link.become_master(options.force).await?;
    let mut report = InitReport::default();
    reset_all(&link, &mut report.reports).await;
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    for number in numbers {
        match next_board(&link, number.number()).await {
            Ok(Some(seen)) => report.boards.push(seen),
            Ok(None) => break,
            Err(error @ Error::Identity(IdentityError::NumberShared { .. })) => {
                return Err(given_back(&link, number.number(), error).await?);
            }
            Err(error) => {
                report.findings.push(InitFinding::Refused { board: number.number(), error });
                break;
            }
        }
    }
    stop_unreset(&link, &mut report).await;
    verify(&link, &options, &mut report).await;
    Ok(Outcome::Init(report))
}

/// Stops boards that did not receive the reset. Such a board has kept its number and continues to run, but this PC no longer repeats the
/// inputs of the board.
async fn stop_unreset(link: &Link, report: &mut InitReport) {
    for seen in report.boards.iter_mut().filter(|seen| runs_on(seen.info.status)) {
        let stopped = stop_board(link, seen.number, StopLevel::Application).await;
        report.findings.push(InitFinding::NotReset { board: seen.number, stopped: stopped.is_ok() });
        if let Ok(info) = stopped {
            seen.info = info;
        }
    }
}

/// Returns `true` if the board has continued to run despite the reset. After a reset, a board with ASTART starts its application by itself,
/// but it never starts its control loop.
fn runs_on(status: Status) -> bool {
    status.has(Status::MCARUN) || (status.has(Status::MSTART) && !status.has(Status::ASTART))
}

/// Sends PC_RESET to all boards and collects their reports. If boards exist but no board has reported, the reset was lost and is repeated.
async fn reset_all(link: &Link, reports: &mut Reports) {
    for _ in 0..2 {
        link.listen(0, &REPORTS);
        link.ask(link.broadcast_number(), ToBoard::Reset).await;
        link.with(|core| {
            core.boards.clear();
            core.data.clear();
        });
        collect_reports(link, link.times().report_window, reports).await;
        if !reports.ids.is_empty() {
            return;
        }
        let mut asked = Reports::default();
        ask_reports(link, &mut asked).await;
        if asked.ids.is_empty() {
            return;
        }
        link.note("boards answer but did not report after PC_RESET: PC_RESET is repeated".into());
    }
}

/// Assigns a number to the next board of the chain; returns `None` if no board took the number.
async fn next_board(link: &Link, number: u8) -> Result<Option<BoardSeen>, Error> {
    if !take_number(link, number, false).await? {
        return Ok(None);
    }
    let seen = info(link, number).await?;
    one_board_each(link, &[number]).await?;
    // The PC sends this command even if the board reports that its outgoing pin is already on. The additional command
    // is harmless, and the status must be read back in both cases.
    let raised = set_status(link, number, Status::OPINIT, Status::OPINIT).await?;
    if raised.flash_number != seen.info.flash_number {
        // Either the answer of the board was damaged, or two boards have the same number.
        return confirmed(link, number).await.map(Some);
    }
    Ok(Some(BoardSeen { info: raised, ..seen }))
}

/// Compares the numbered boards with the reports of boards and with the inventory.
async fn verify(link: &Link, options: &InitOptions, report: &mut InitReport) {
    let low = |seen: &BoardSeen| seen.info.flash_number as u8;
    let reached: BTreeSet<u8> = report.boards.iter().map(low).collect();
    if reached != report.reports.ids {
        // A report of a board may have been lost, so the PC requests the reports again.
        ask_reports(link, &mut report.reports).await;
    }
    if exchanged(&report.reports, &flash_numbers(&report.boards)) {
        // The PC read the flash numbers in the wrong byte order, so further comparisons are not possible.
        report.findings.push(InitFinding::ByteOrder { endian: link.profile().endian });
        return;
    }
    let reports = &report.reports.ids;
    let mut findings = Vec::new();
    let unreached: Vec<u8> = reports.difference(&reached).copied().collect();
    let refused = report.findings.iter().any(|f| matches!(f, InitFinding::Refused { .. }));
    if report.boards.is_empty() && reports.is_empty() && !refused {
        findings.push(InitFinding::NoBoards);
    }
    if !unreached.is_empty() {
        let after = report.boards.last().map_or(0, |b| b.number);
        findings.push(InitFinding::NotReached { after, ids: unreached });
    }
    let (boards, seen) = (report.boards.len() as u32, reports.len() as u32);
    if reached.len() < report.boards.len() {
        findings.push(InitFinding::MoreBoardsThanReports { boards, reports: seen });
    }
    for board in report.boards.iter().filter(|b| !reports.contains(&low(b))) {
        findings.push(InitFinding::NotReported { board: board.number });
    }
    for (i, first) in report.boards.iter().enumerate() {
        let flash_number = first.info.flash_number;
        for second in report.boards.iter().skip(i + 1).filter(|b| b.info.flash_number == flash_number) {
            findings.push(InitFinding::DuplicateFlash {
                flash_number,
                first: first.number,
                second: second.number,
            });
        }
    }
    for &(board, expected) in &options.expected {
        match report.boards.iter().find(|b| b.number == board) {
            Some(seen) if seen.info.flash_number == expected => {}
            Some(seen) => {
                let found = seen.info.flash_number;
                findings.push(InitFinding::UnexpectedOrder { board, expected, found });
            }
            None => findings.push(InitFinding::Missing { board, expected }),
        }
    }
    findings.extend(
        report.reports.ambiguous().into_iter().map(|(low, high)| InitFinding::Ambiguous { low, high }),
    );
    report.findings.extend(findings);
}
