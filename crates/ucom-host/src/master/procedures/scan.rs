//! Scan that does not change any board: PC_REPORT to all boards and PC_INFO to each number, without a reset (5.4).

use crate::master::engine::Link;
use crate::master::error::{Error, IdentityError};
use crate::master::procedures::ask_reports::ask_reports;
use crate::master::procedures::byte_order::{exchanged, flash_numbers};
use crate::master::procedures::exchange::remember;
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::survey::ask_all;
use crate::master::reports::{BoardSeen, Outcome, Reports, ScanFinding, ScanReport};
use std::collections::BTreeSet;
use ucom::Sequence;
use ucom::profile::Endian;

/// Scans the bus. The scan sends only `PC_REPORT` and `PC_INFO` (P-1).
pub(crate) async fn scan(link: Link) -> Result<Outcome, Error> {
    let mut report = ScanReport::default();
    ask_reports(&link, &mut report.reports).await;
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    let slots = ask_all(&link, &numbers).await;
    // The scan sends another PC_INFO to each number that two boards possibly share. Numbers that two boards certainly
    // share are reported below.
    let doubtful = link.with(|core| core.holders.doubtful());
    let _ = one_board_each(&link, &doubtful).await;
    // Detects boards that answered PC_INFO but did not report. Their reports may have been lost.
    let missing = |boards: &[BoardSeen], reports: &Reports| {
        boards.iter().any(|b| !reports.ids.contains(&(b.info.flash_number as u8)))
    };
    for (number, slot) in &slots {
        let board = *number;
        if let Some(IdentityError::NumberShared { found, .. }) =
            link.with(|core| core.holders.shared(1 << board))
            && let [first, second, ..] = found[..]
        {
            report.findings.push(ScanFinding::NumberShared { board, first, second });
            continue;
        }
        match slot.seen(board) {
            Some(seen) if slot.confirmed => {
                remember(&link, board, &seen.info, seen.description.as_deref());
                if seen.description.is_none() {
                    report.findings.push(ScanFinding::NoDescription { board });
                }
                report.boards.push(seen);
            }
            _ if slot.contradicts || slot.answers.len() > 1 => {
                report.findings.push(ScanFinding::Contradicts { board });
            }
            Some(seen) => report.boards.push(seen),
            None => {
                if let Some(problem) = slot.status {
                    report.findings.push(ScanFinding::Status { board, problem });
                }
            }
        }
    }
    if missing(&report.boards, &report.reports) || report.reports.ids.is_empty() {
        ask_reports(&link, &mut report.reports).await;
    }
    judge(&mut report, link.profile().endian);
    Ok(Outcome::Scan(report))
}

fn judge(report: &mut ScanReport, endian: Endian) {
    if exchanged(&report.reports, &flash_numbers(&report.boards)) {
        // Findings that are caused by the wrong byte order are not problems of the chain.
        report.findings.retain(|finding| !matches!(finding, ScanFinding::NoDescription { .. }));
        report.findings.push(ScanFinding::ByteOrder { endian });
        return;
    }
    let mut numbered: BTreeSet<u8> = report.boards.iter().map(|b| b.info.flash_number as u8).collect();
    for finding in &report.findings {
        if let ScanFinding::NumberShared { first, second, .. } = finding {
            numbered.extend([*first as u8, *second as u8]);
        }
    }
    let reports = &report.reports;
    let findings = &mut report.findings;
    for ucom_id in reports.ids.difference(&numbered) {
        findings.push(ScanFinding::Unnumbered { ucom_id: *ucom_id });
    }
    for board in report.boards.iter().filter(|b| !reports.ids.contains(&(b.info.flash_number as u8))) {
        findings.push(ScanFinding::NotReported { board: board.number });
    }
    for (i, first) in report.boards.iter().enumerate() {
        let flash_number = first.info.flash_number;
        for second in report.boards.iter().skip(i + 1).filter(|b| b.info.flash_number == flash_number) {
            findings.push(ScanFinding::SameFlash {
                first: first.number,
                second: second.number,
                flash_number,
            });
        }
    }
    findings.extend(reports.ambiguous().into_iter().map(|(low, high)| ScanFinding::Ambiguous { low, high }));
    findings.extend(reports.disagree.iter().map(|id| ScanFinding::Disagrees { ucom_id: *id }));
}
