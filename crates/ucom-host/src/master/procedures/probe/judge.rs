//! Derives a profile from the frames that a probe received. A profile key gets a new value if an observation
//! determines the value; the other keys keep their values.

use crate::master::counted::counted;
use crate::master::reports::{ProbeReport, ProbeRow};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use ucom::profile::{AliveMode, Broadcast, Endian, KEYS, ReportMode};
use ucom::{Checksum, Payload, Profile, Report, Sequence, Status, checksum};

/// Answers of one board to PC_INFO. Each answer is a list of frame payloads.
pub(super) type Answers = Vec<Vec<Payload>>;

/// Frames and answers that a probe received.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub before: Profile,
    pub image: Option<Arc<[u8]>>,
    pub reports: Vec<Report>,
    pub raised: Option<bool>,
    /// Number of boards that answered a PC_INFO to number 0, and to number 31.
    pub broadcast: [usize; 2],
    /// `true` if a board has number 0.
    pub zero_answers: bool,
    pub infos: BTreeMap<u8, Answers>,
    pub padded: Option<bool>,
    pub offsets: Vec<Vec<u16>>,
}

impl Seen {
    pub(super) fn first_board(&self) -> Option<Sequence> {
        self.infos.keys().find_map(|n| Sequence::new(*n))
    }

    pub(super) fn started_boards(&self) -> Vec<Sequence> {
        let started = |answers: &Answers| {
            let status = answers.iter().flatten().find(|p| p.len() == 8).and_then(status_of);
            status.is_some_and(|s| s.has(Status::MSTART))
        };
        self.infos.iter().filter(|(_, a)| started(a)).filter_map(|(n, _)| Sequence::new(*n)).collect()
    }

    /// Returns the first frames of the answers to PC_INFO.
    fn heads(&self) -> impl Iterator<Item = [u8; 8]> + '_ {
        let first = |a: &Vec<Payload>| a.first().filter(|p| p.len() == 8).map(Payload::padded);
        self.infos.values().flatten().filter_map(first)
    }

    /// Returns the headers of strings: the two count bytes, and the number of packages that followed the header.
    fn headers(&self) -> Vec<([u8; 2], usize)> {
        let header = |frames: &Vec<Payload>| match frames.as_slice() {
            [_, header, rest @ ..] => match header.bytes() {
                [a, b] => Some(([*a, *b], rest.len())),
                _ => None,
            },
            _ => None,
        };
        self.infos.values().flatten().filter_map(header).collect()
    }
}

struct Rows {
    rows: Vec<ProbeRow>,
    profile: Profile,
}

impl Rows {
    /// Adds a row to the table of the report. `value` is the measured value, or `None` if the probe has no measurement.
    fn add(
        &mut self,
        key: &'static str,
        (unknown, published): (&'static str, &'static str),
        observed: String,
        value: Option<&str>,
    ) {
        let measured = value.is_some_and(|value| self.profile.set(key, value).is_ok());
        let decision = KEYS.iter().find(|k| k.name == key).map(|k| k.value(&self.profile).to_string());
        let decision = decision.unwrap_or_default();
        self.rows.push(ProbeRow { key, unknown, published, observed, decision, measured });
    }
}

/// Returns the status byte of the first frame of DSP_INFO. The position of the status byte does not depend on the profile.
pub(super) fn status_of(payload: &Payload) -> Option<Status> {
    payload.bytes().get(3).filter(|_| payload.len() >= 8).map(|byte| Status(*byte))
}

/// Returns the report with the derived profile and the table.
pub(super) fn judge(seen: &Seen) -> ProbeReport {
    let mut rows = Rows { rows: Vec::new(), profile: seen.before };
    reports(&mut rows, seen);
    numbers(&mut rows, seen);
    strings(&mut rows, seen);
    lengths(&mut rows, seen);
    pins(&mut rows, seen);
    programs(&mut rows, seen);
    let reports = seen.reports.iter().map(|report| report.ucom_id).collect::<BTreeSet<_>>().len();
    let boards = seen.infos.keys().copied().collect();
    ProbeReport { profile: rows.profile, rows: rows.rows, boards, reports, init: None }
}

fn reports(rows: &mut Rows, seen: &Seen) {
    let texts = ("reports of a board", "answers with DSP_REPORT0 to DSP_REPORT3");
    let mut boards: BTreeMap<u8, BTreeSet<u8>> = BTreeMap::new();
    for report in &seen.reports {
        boards.entry(report.ucom_id).or_default().insert(report.k);
    }
    let most = boards.values().map(BTreeSet::len).max();
    let agree = seen.reports.iter().all(Report::agrees);
    let mode = match most {
        None => None,
        Some(1) if agree => Some(ReportMode::Flash7),
        Some(4) if boards.values().all(|k| k.len() > 1) => Some(ReportMode::All4),
        Some(1) if seen.reports.iter().all(|r| r.k == 0) => Some(ReportMode::Seq),
        Some(_) => None,
    };
    let observed = match most {
        None => "no report".into(),
        Some(n) => format!(
            "{}, up to {} each; identifier and data {}",
            counted(boards.len(), "board"),
            counted(n, "function"),
            if agree { "agree" } else { "disagree" }
        ),
    };
    let value = mode.map(|m| m.to_string());
    rows.add("report.mode", texts, observed, value.as_deref());
}

fn numbers(rows: &mut Rows, seen: &Seen) {
    let [zero, top] = seen.broadcast;
    let broadcast = match (zero, top) {
        (1.., _) => Some(Broadcast::Zero),
        (0, 1..) => Some(Broadcast::ThirtyOne),
        // Silence on the broadcast number is evidence only if boards have answered on their own numbers.
        (0, 0) if !seen.infos.is_empty() => Some(Broadcast::None),
        _ => None,
    };
    let observed = format!(
        "boards that answer PC_INFO: {zero} to 0, {top} to 31, {} to their own number",
        seen.infos.len()
    );
    let value = broadcast.map(|b| b.to_string());
    // 0 cannot be both the broadcast number and the number of the first board, so the broadcast number is determined
    // before `addr.first`.
    let first = if seen.zero_answers {
        Some("0")
    } else {
        seen.infos.keys().next().filter(|n| **n == 1).map(|_| "1")
    };
    rows.add("addr.broadcast", ("broadcast number", "nothing"), observed, value.as_deref());
    let lowest = if seen.zero_answers { Some(0) } else { seen.infos.keys().next().copied() };
    let observed =
        lowest.map_or("no board has a number".into(), |n| format!("lowest number that answers: {n}"));
    rows.add("addr.first", ("number of the first board", "position in the chain"), observed, first);
}

fn strings(rows: &mut Rows, seen: &Seen) {
    let headers = seen.headers();
    // Number of string headers that match this byte order and a count that includes (`inclusive`) or excludes the
    // header. The best combination must match more headers than each of the others.
    let fits = |endian: Endian, inclusive: bool| {
        let fit = |(count, packages): &&([u8; 2], usize)| {
            usize::from(endian.word(*count)) == packages + usize::from(inclusive) && (count[0] != count[1])
        };
        headers.iter().filter(fit).count()
    };
    let readings =
        [(Endian::Little, false), (Endian::Little, true), (Endian::Big, false), (Endian::Big, true)];
    let best = readings.into_iter().max_by_key(|(e, i)| fits(*e, *i)).filter(|(e, i)| {
        let n = fits(*e, *i);
        n > 0 && readings.iter().filter(|(oe, oi)| fits(*oe, *oi) == n).count() == 1
    });
    // The second package of an MCA_DUMP_CI answer has offset 3. If the PC reads 0x0300, the board uses the other byte
    // order.
    let second = |offsets: &Vec<u16>| offsets.get(1).copied();
    let read = seen.before.endian;
    let other = if read == Endian::Little { Endian::Big } else { Endian::Little };
    let by_offset = seen.offsets.iter().filter_map(second).find_map(|offset| match offset {
        3 => Some(read),
        0x0300 => Some(other),
        _ => None,
    });
    let offsets =
        by_offset.map_or("no dump has two packages".into(), |e| format!("second offset of a dump: {e}"));
    let words = best.map_or("no string was conclusive".into(), |(e, _)| format!("count of strings: {e}"));
    let endian = by_offset.or(best.map(|(e, _)| e)).map(|e| e.to_string());
    let texts = ("byte order of 16-bit fields", "first byte, second byte");
    rows.add("endian", texts, format!("{words}; {offsets}"), endian.as_deref());
    let observed = match headers.first() {
        None => "no string".into(),
        Some((count, packages)) => {
            format!("header {:02X} {:02X}, {packages} packages follow", count[0], count[1])
        }
    };
    let inclusive = best.map(|(_, inclusive)| if inclusive { "yes" } else { "no" });
    let texts = ("does the count of a string include its header", "number of messages");
    rows.add("string.count_includes_header", texts, observed, inclusive);
}

fn lengths(rows: &mut Rows, seen: &Seen) {
    let observed = match seen.padded {
        None => "no board to ask".into(),
        Some(true) => "PC_INFO with 8 bytes is answered".into(),
        Some(false) => "PC_INFO with 8 bytes is not answered".into(),
    };
    let value = seen.padded.map(|answered| if answered { "no" } else { "yes" });
    rows.add("dlc.strict", ("does a board reject surplus bytes", "no data"), observed, value);
}

fn pins(rows: &mut Rows, seen: &Seen) {
    let observed = match seen.raised {
        None => "not measured: needs PC_INIT".into(),
        Some(true) => "OPINIT is on right after DSP_INITACK".into(),
        Some(false) => "OPINIT is off after DSP_INITACK".into(),
    };
    let value = seen.raised.map(|raised| if raised { "yes" } else { "no" });
    rows.add(
        "chain.auto_opinit",
        ("does a board raise its outgoing pin by itself", "nothing"),
        observed,
        value,
    );
}

fn programs(rows: &mut Rows, seen: &Seen) {
    let texts = ("checksum of the Program ID", "checksum of the firmware");
    let Some(image) = &seen.image else {
        return rows.add(
            "prog.checksum",
            texts,
            "not measured: needs the image of a board's program".into(),
            None,
        );
    };
    let endian = rows.profile.endian;
    let ids: BTreeSet<u16> = seen.heads().map(|h| endian.word([h[4], h[5]])).collect();
    let mut found = Vec::new();
    for (form, order) in [
        (Checksum::Crc16, rows.profile.prog_endian),
        (Checksum::Sum16, Endian::Little),
        (Checksum::Sum16, Endian::Big),
        (Checksum::Xor16, Endian::Little),
        (Checksum::Xor16, Endian::Big),
    ] {
        if ids.contains(&checksum(form, order, image)) {
            found.push((form, order));
        }
    }
    let shown: Vec<String> = ids.iter().map(|id| format!("0x{id:04X}")).collect();
    let fits: Vec<String> = found.iter().map(|(form, order)| format!("{form} ({order})")).collect();
    let observed = format!(
        "boards show {}; {} matches",
        shown.join(", "),
        if fits.is_empty() { "none".into() } else { fits.join(", ") }
    );
    let form = found.first().filter(|(first, _)| found.iter().all(|(form, _)| form == first));
    let value = form.map(|(form, _)| form.to_string());
    rows.add("prog.checksum", texts, observed, value.as_deref());
    if let [(Checksum::Sum16 | Checksum::Xor16, order)] = found.as_slice() {
        let (order, observed) =
            (order.to_string(), "the checksum of the words matches in one byte order only".into());
        rows.add("prog.endian", ("byte order of program words", "nothing"), observed, Some(&order));
    }
}

/// Determines which heartbeats keep a control loop running: broadcast heartbeats, or heartbeats to the board's own number.
pub(super) fn alive(report: &mut ProbeReport, [broadcast, unicast]: [bool; 2]) {
    let mut rows = Rows { rows: core::mem::take(&mut report.rows), profile: report.profile };
    let mode = match (broadcast, unicast) {
        (true, _) => Some(AliveMode::Broadcast),
        (false, true) => Some(AliveMode::Unicast),
        (false, false) => None,
    };
    let word = |held| if held { "runs on" } else { "stops" };
    let observed = format!(
        "with heartbeats to all boards it {}, with heartbeats to its own number it {}",
        word(broadcast),
        word(unicast)
    );
    let value = mode.map(|m| m.to_string());
    rows.add(
        "alive.mode",
        ("receivers of heartbeats", "to all boards, every 500 ms"),
        observed,
        value.as_deref(),
    );
    (report.rows, report.profile) = (rows.rows, rows.profile);
}
