//! Who is there, without changing anything: PC_REPORT to all and PC_INFO to each number, no reset (5.4).

use super::byte_order::{MEASURE_ORDER, exchanged, flash_numbers, other_order};
use super::holders::one_board_each;
use super::link::Link;
use super::request::{Answer, InfoCollector, TRIES, identity, remember};
use super::{BoardSeen, Error, Outcome};
use std::collections::{BTreeMap, BTreeSet};
use ucom::profile::Endian;
use ucom::{BoardInfo, FromBoard, Function, Report, Sequence, Status, ToBoard};

/// Between two requests of a round, µs: the answers of 31 boards do not come as one burst.
const SPACING: u64 = 2_000;

/// The four functions of reports.
pub(crate) const REPORTS: [Function; 4] =
    [Function::Report0, Function::Report1, Function::Report2, Function::Report3];

/// Reports of boards after PC_RESET or PC_REPORT.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Reports {
    /// Low bytes of the flash numbers: what distinguishes boards.
    pub ids: BTreeSet<u8>,
    /// How many frames each sent.
    pub frames: BTreeMap<u8, u32>,
    /// Those whose identifier has another id than the data, under `report.mode = flash7`.
    pub disagree: BTreeSet<u8>,
}

impl Reports {
    pub(crate) fn add(&mut self, report: &Report) {
        self.ids.insert(report.ucom_id);
        *self.frames.entry(report.ucom_id).or_default() += 1;
        if !report.agrees() {
            self.disagree.insert(report.ucom_id);
        }
    }

    /// Flash ids that differ only in bit 7: they share an identifier (D-07).
    pub fn ambiguous(&self) -> Vec<(u8, u8)> {
        self.ids
            .iter()
            .filter(|id| **id < 128 && self.ids.contains(&(**id | 128)))
            .map(|id| (*id, id | 128))
            .collect()
    }
}

/// What a scan found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScanReport {
    /// Who reported.
    pub reports: Reports,
    /// Boards with a number.
    pub boards: Vec<BoardSeen>,
    /// What is worth a word.
    pub findings: Vec<ScanFinding>,
}

/// Something about the chain that its user should know.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ScanFinding {
    /// Boards without a number.
    #[error("board with UCoM id 0x{ucom_id:02X} has no number: `ucom init`")]
    Unnumbered {
        /// Low byte of its flash number.
        ucom_id: u8,
    },
    /// A board with a number that did not report.
    #[error("board {board} has a number but did not report")]
    NotReported {
        /// Its number.
        board: u8,
    },
    /// Two numbers, one flash number.
    #[error("boards {first} and {second} have the same flash number 0x{flash_number:04X}")]
    SameFlash {
        /// One board.
        first: u8,
        /// The other.
        second: u8,
        /// The number.
        flash_number: u16,
    },
    /// Two flash ids that share an identifier.
    #[error("UCoM ids 0x{low:02X} and 0x{high:02X} differ in bit 7 only and share an identifier")]
    Ambiguous {
        /// The lower one.
        low: u8,
        /// The higher one.
        high: u8,
    },
    /// Identifier and data of a report disagree.
    #[error("the report of UCoM id 0x{ucom_id:02X} came with another identifier: `ucom probe` may show why")]
    Disagrees {
        /// By the data.
        ucom_id: u8,
    },
    /// The flash numbers fit the reports only with their bytes exchanged (D-10).
    #[error("{}: {MEASURE_ORDER}", other_order(*endian))]
    ByteOrder {
        /// The order that the profile has.
        endian: Endian,
    },
    /// Answers that contradict each other.
    #[error("the answers of board {board} contradict each other: two boards may have this number")]
    Contradicts {
        /// Its number.
        board: u8,
    },
    /// Two boards have one number (D-24).
    #[error("{}", shared(*board, [*first, *second]))]
    NumberShared {
        /// The number.
        board: u8,
        /// Flash number of one.
        first: u16,
        /// Flash number of another; the same when they cannot be distinguished.
        second: u16,
    },
    /// A status that cannot be.
    #[error("board {board}: {problem}")]
    Status {
        /// Its number.
        board: u8,
        /// Why not.
        problem: &'static str,
    },
    /// The description never came whole.
    #[error("the description of board {board} never came whole")]
    NoDescription {
        /// Its number.
        board: u8,
    },
}

fn shared(board: u8, found: [u16; 2]) -> Error {
    Error::NumberShared { board, found: found.to_vec(), given_back: false }
}

impl ScanFinding {
    /// As the error that other commands end with, where they refuse to work with such a chain.
    pub fn error(&self) -> Option<Error> {
        match self {
            Self::NumberShared { board, first, second } => Some(shared(*board, [*first, *second])),
            _ => None,
        }
    }
}

/// PC_REPORT, and who answers within the window.
pub(crate) async fn ask_reports(link: &Link, reports: &mut Reports) {
    link.listen(0, &REPORTS);
    link.ask(link.broadcast_number(), ToBoard::Report).await;
    collect_reports(link, link.times().report_ask, reports).await;
}

/// Who reports within `window` µs.
pub(crate) async fn collect_reports(link: &Link, window: u64, reports: &mut Reports) {
    let until = link.now() + window;
    while let Some(received) = link.next(until).await {
        if let FromBoard::Report(report) = received.message {
            reports.add(&report);
        }
        if link.now() > until {
            break;
        }
    }
}

/// What is known of one number.
#[derive(Default)]
struct Slot {
    /// Answers with the same identity so far.
    answers: Vec<(BoardInfo, Option<String>)>,
    confirmed: bool,
    contradicts: bool,
    status: Option<&'static str>,
}

impl Slot {
    fn take(&mut self, number: u8, info: BoardInfo, text: Option<String>) {
        if info.sequence != number {
            self.contradicts = true;
            return;
        }
        if let Some(problem) = info.status.contradiction() {
            self.status = Some(problem);
            return;
        }
        self.confirmed |= self.answers.iter().any(|(old, _)| identity(old) == identity(&info));
        self.answers.push((info, text));
    }

    fn settled(&self) -> bool {
        self.confirmed && self.answers.iter().any(|(_, text)| text.is_some())
    }

    fn seen(&self, number: u8) -> Option<BoardSeen> {
        let (info, _) = self.answers.last()?;
        // The newest status of the answers that agree.
        let agreed =
            |i: &BoardInfo| self.answers.iter().filter(|(o, _)| identity(o) == identity(i)).count() > 1;
        let info = self.answers.iter().rev().map(|(i, _)| i).find(|i| agreed(i)).unwrap_or(info);
        let texts = self.answers.iter().filter(|(i, _)| identity(i) == identity(info));
        let description = texts.filter_map(|(_, text)| text.clone()).next_back();
        Some(BoardSeen { number, info: *info, description })
    }
}

/// PC_INFO to all numbers, in rounds, until each board gave two answers that agree or stayed silent three times.
async fn ask_all(link: &Link, numbers: &[Sequence]) -> BTreeMap<u8, Slot> {
    let mask = numbers.iter().fold(0, |mask, n| mask | 1 << n.number());
    let times = link.times();
    let mut slots: BTreeMap<u8, Slot> = BTreeMap::new();
    for round in 0..=TRIES {
        let open: Vec<Sequence> = numbers
            .iter()
            .copied()
            .filter(|n| match slots.get(&n.number()) {
                None => round < TRIES,
                Some(slot) => !slot.settled(),
            })
            .collect();
        if open.is_empty() {
            break;
        }
        link.listen(mask, &[Function::DspInfo]);
        let mut collectors: BTreeMap<u8, InfoCollector> = BTreeMap::new();
        for number in open {
            link.send(number, ToBoard::Info).await;
            let until = link.now() + SPACING;
            while let Some(received) = link.next(until).await {
                collect(link, &mut collectors, &received);
            }
        }
        let mut until = link.now() + times.info;
        let limit = until + 20 * times.gap;
        while let Some(received) = link.next(until).await {
            collect(link, &mut collectors, &received);
            until = (link.now() + times.gap).min(limit);
            if link.now() >= limit {
                break;
            }
        }
        for (number, collector) in collectors {
            if let Answer::Info(info, text) = collector.answer() {
                slots.entry(number).or_default().take(number, info, text);
            }
        }
    }
    slots
}

fn collect(link: &Link, collectors: &mut BTreeMap<u8, InfoCollector>, received: &super::shared::Received) {
    if let FromBoard::Info(payload) = received.message {
        let collector = collectors.entry(received.from).or_default();
        // What is no first frame leaves the collector empty: the next round asks again.
        let _ = collector.push(received.at, &payload, link);
    }
}

/// The status that each of these numbers shows last; an error where its answers contradict each other.
pub(crate) async fn statuses(link: &Link, numbers: &[Sequence]) -> BTreeMap<u8, Result<Status, Error>> {
    let slots = ask_all(link, numbers).await;
    let status = |(board, slot): (u8, Slot)| {
        let contradiction = Error::Contradiction { board, tries: TRIES + 1 };
        match slot.answers.last() {
            Some((info, _)) if !slot.contradicts => (board, Ok(info.status)),
            _ => (board, Err(contradiction)),
        }
    };
    slots.into_iter().map(status).collect()
}

/// The whole scan. Nothing but `PC_REPORT` and `PC_INFO` is sent (P-1).
pub(crate) async fn scan(link: Link) -> Result<Outcome, Error> {
    let mut report = ScanReport::default();
    ask_reports(&link, &mut report.reports).await;
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    let slots = ask_all(&link, &numbers).await;
    // What is in doubt is asked again; what is certain is found below.
    let doubtful = link.with(|core| core.holders.doubtful());
    let _ = one_board_each(&link, &doubtful).await;
    // Who answered but did not report may have been missed.
    let missing = |boards: &[BoardSeen], reports: &Reports| {
        boards.iter().any(|b| !reports.ids.contains(&(b.info.flash_number as u8)))
    };
    for (number, slot) in &slots {
        let board = *number;
        if let Some(Error::NumberShared { found, .. }) = link.with(|core| core.holders.shared(1 << board))
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
        // What would follow from it is none of the chain's faults.
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

/// Status of every board that answers, all asked at once, and twice, because one frame can be lost; a board that sends sensor outputs runs, whatever its status is.
pub(crate) async fn board_states(link: &Link) -> BTreeMap<u8, Status> {
    let numbers: Vec<Sequence> = link.profile().board_numbers().collect();
    let mask = numbers.iter().fold(0, |mask, n| mask | 1 << n.number());
    link.listen(mask, &[Function::DspInfo, Function::So]);
    let mut states: BTreeMap<u8, Status> = BTreeMap::new();
    let mut outputs = BTreeSet::new();
    let asked = link.profile().broadcast_number().map_or(numbers, |broadcast| vec![broadcast]);
    for _ in 0..2 {
        let mut collectors: BTreeMap<u8, InfoCollector> = BTreeMap::new();
        for number in &asked {
            link.send(*number, ToBoard::Info).await;
        }
        let times = link.times();
        let until = link.now() + times.info.max(3 * times.so) + times.gap;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::So(_) => {
                    outputs.insert(received.from);
                }
                FromBoard::Info(payload) => {
                    let collector = collectors.entry(received.from).or_default();
                    let _ = collector.push(received.at, &payload, link);
                }
                _ => {}
            }
            if link.now() >= until {
                break;
            }
        }
        for (number, collector) in collectors {
            if let Answer::Info(info, _) = collector.answer()
                && info.sequence == number
                && info.status.contradiction().is_none()
            {
                states.insert(number, info.status);
            }
        }
    }
    for number in outputs {
        let status = states.entry(number).or_default();
        *status = status.with(Status::MCARUN, true);
    }
    states
}
