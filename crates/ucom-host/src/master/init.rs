//! Numbers for the boards of a chain, in the order of the wire (section on initialisation: D-21, D-24).
//!
//! PC_INIT(n) is taken by the one board without a number whose incoming pin is active; its outgoing pin, raised by this
//! PC after the number is confirmed, enables the next board. PC_INIT is never repeated without asking PC_INFO first:
//! a board that raises its pin by itself would otherwise let its neighbour take the same number.

use super::byte_order::{MEASURE_ORDER, exchanged, flash_numbers, other_order};
use super::holders::one_board_each;
use super::link::Link;
use super::repair::given_back;
pub(crate) use super::repair::{repair, repair_procedure};
use super::request::{Answer, TRIES, ask_info, confirmed, info, set_status};
use super::scan::{REPORTS, Reports, ask_reports, collect_reports};
use super::times::MS;
use super::{BoardSeen, Error, Outcome, counted};
use crate::master::ErrorKind;
use std::collections::BTreeSet;
use ucom::profile::Endian;
use ucom::{FromBoard, Function, Sequence, Status, ToBoard};

/// How to number a chain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InitOptions {
    /// Flash numbers by position, from an inventory: another order is a finding.
    pub expected: Vec<(u8, u16)>,
    /// Also when another PC is on the bus.
    pub force: bool,
}

/// What an init brought about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InitReport {
    /// Who reported after the reset.
    pub reports: Reports,
    /// Boards in the order of the chain.
    pub boards: Vec<BoardSeen>,
    /// What is wrong; empty: ok.
    pub findings: Vec<InitFinding>,
}

impl InitReport {
    /// Every board that is there has a number, and nothing is odd.
    pub fn is_ok(&self) -> bool {
        self.findings.is_empty()
    }

    /// What kind of failure it is; `None`: ok.
    pub fn failure(&self) -> Option<ErrorKind> {
        match self.findings.as_slice() {
            [] => None,
            [InitFinding::NoBoards] => Some(ErrorKind::NoLink),
            _ => Some(ErrorKind::Device),
        }
    }
}

/// A named outcome of an init other than ok.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InitFinding {
    /// Nobody reported and nobody took number 1.
    #[error(
        "no board reported and none took a number: is the bus connected, powered, and at this bit rate? `ucom doctor`"
    )]
    NoBoards,
    /// Boards reported but got no number.
    #[error(
        "board reported but not reached: UCoM id {} after position {after}; the init wire behind that board may be broken",
        hex(ids)
    )]
    NotReached {
        /// Position of the last board that was reached.
        after: u8,
        /// Low bytes of the flash numbers that reported and were not reached.
        ids: Vec<u8>,
    },
    /// The flash numbers fit the reports only with their bytes exchanged (D-10).
    #[error("{}: {MEASURE_ORDER}", other_order(*endian))]
    ByteOrder {
        /// The order that the profile has.
        endian: Endian,
    },
    /// More boards than reports: boards share the low byte of their flash number.
    #[error(
        "more boards than reports: {}, {}; flash ids must be unique in their low byte",
        counted(*boards as usize, "board"),
        counted(*reports as usize, "report")
    )]
    MoreBoardsThanReports {
        /// Boards with a number.
        boards: u32,
        /// Different reports.
        reports: u32,
    },
    /// A board that did not report.
    #[error("board {board} took a number but did not report")]
    NotReported {
        /// Its number.
        board: u8,
    },
    /// Two boards with one flash number.
    #[error("duplicate flash number 0x{flash_number:04X}: boards {first} and {second}")]
    DuplicateFlash {
        /// The number.
        flash_number: u16,
        /// One board.
        first: u8,
        /// The other.
        second: u8,
    },
    /// Another board than the inventory has at a position.
    #[error(
        "unexpected board order: position {board} has flash number 0x{found:04X}, the inventory has 0x{expected:04X}"
    )]
    UnexpectedOrder {
        /// The position.
        board: u8,
        /// By the inventory.
        expected: u16,
        /// On the wire.
        found: u16,
    },
    /// The inventory has a board where the chain has ended.
    #[error("board {board} (flash number 0x{expected:04X}) of the inventory is missing")]
    Missing {
        /// Its position.
        board: u8,
        /// Its flash number.
        expected: u16,
    },
    /// A board that was refused: the chain is numbered up to the one before it.
    #[error("position {board}: {error}")]
    Refused {
        /// Its position.
        board: u8,
        /// Why.
        error: Error,
    },
    /// Two flash ids that share an identifier.
    #[error("UCoM ids 0x{low:02X} and 0x{high:02X} differ in bit 7 only and share an identifier")]
    Ambiguous {
        /// The lower one.
        low: u8,
        /// The higher one.
        high: u8,
    },
}

fn hex(ids: &[u8]) -> String {
    ids.iter().map(|id| format!("0x{id:02X}")).collect::<Vec<_>>().join(", ")
}

/// Numbers the whole chain.
pub(crate) async fn init(link: Link, options: InitOptions) -> Result<Outcome, Error> {
    link.become_master(options.force).await?;
    let mut report = InitReport::default();
    reset_all(&link, &mut report.reports).await;
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    for number in numbers {
        match next_board(&link, number.number()).await {
            Ok(Some(seen)) => report.boards.push(seen),
            Ok(None) => break,
            Err(error @ Error::NumberShared { .. }) => {
                return Err(given_back(&link, number.number(), error).await?);
            }
            Err(error) => {
                report.findings.push(InitFinding::Refused { board: number.number(), error });
                break;
            }
        }
    }
    verify(&link, &options, &mut report).await;
    Ok(Outcome::Init(report))
}

/// PC_RESET to all and their reports. When nobody reports although boards are there, the reset was lost: once more.
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
        link.note("boards are there but did not report after PC_RESET: once more".into());
    }
}

/// Gives a number to the next board of the chain; `None`: nobody took it.
async fn next_board(link: &Link, number: u8) -> Result<Option<BoardSeen>, Error> {
    if !take_number(link, number, false).await? {
        return Ok(None);
    }
    let seen = info(link, number).await?;
    one_board_each(link, &[number]).await?;
    // Raised also when the board reports that it did so itself: harmless, and the read-back is needed anyway.
    let raised = set_status(link, number, Status::OPINIT, Status::OPINIT).await?;
    if raised.flash_number != seen.info.flash_number {
        // One of the two answers was damaged, or two boards have this number.
        return confirmed(link, number).await.map(Some);
    }
    Ok(Some(BoardSeen { info: raised, ..seen }))
}

/// PC_INIT until the board acknowledges or answers PC_INFO, at most three times. `lower`: the board's own pin goes down
/// before it is repeated, as a board that raises it by itself would let its neighbour take the number as well.
pub(super) async fn take_number(link: &Link, number: u8, lower: bool) -> Result<bool, Error> {
    let to = link.board(number)?;
    let nobody = link.profile().unnumbered().number();
    for tried in 0..TRIES {
        if lower && tried > 0 {
            link.send(to, ToBoard::SetStatus { mask: Status::OPINIT.0, value: 0 }).await;
            link.sleep(20 * MS).await;
        }
        link.listen(u32::MAX, &[Function::InitAck, Function::DspInfo]);
        link.ask(to, ToBoard::Init).await;
        let mut until = link.now() + link.times().init_ack;
        let mut acknowledged = false;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::InitAck(data) if received.from == number || data == number => {
                    if received.from != data {
                        return Err(Error::AckMismatch { id: received.from, data });
                    }
                    acknowledged = true;
                    break;
                }
                // The acknowledge of before has not left the board yet (D-24): give it time.
                FromBoard::Error(ucom::ErrorCode::Reinit)
                    if received.from == nobody || received.from == number =>
                {
                    until = until.max(link.now() + 100 * MS);
                }
                _ => {}
            }
        }
        if acknowledged {
            return Ok(true);
        }
        // The acknowledge may have been lost: never repeat PC_INIT blindly. Half an answer is enough: somebody has this
        // number, and who it is will be asked again.
        link.listen(1 << number, &[Function::DspInfo]);
        if !matches!(ask_info(link, number).await?, Answer::Silence) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Compares what was numbered with what reported and with the inventory.
async fn verify(link: &Link, options: &InitOptions, report: &mut InitReport) {
    let low = |seen: &BoardSeen| seen.info.flash_number as u8;
    let reached: BTreeSet<u8> = report.boards.iter().map(low).collect();
    if reached != report.reports.ids {
        // A report may have been lost.
        ask_reports(link, &mut report.reports).await;
    }
    if exchanged(&report.reports, &flash_numbers(&report.boards)) {
        // Everything else would compare numbers that are read wrong.
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
