//! Findings about bus, chain and boards, each with the next command.
use crate::master::engine::{Boards, Life, Statistics};
use crate::master::error::SHARED_CAUSE;
use crate::master::reports::{InitFinding, InitReport, ScanFinding, ScanReport};
use host_kit::{Diagnose, Findings};
pub use host_kit::{Finding, Severity};

use crate::master::counted::counted;
use ucom::{Function, Profile};

/// State reported by the CAN controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controller {
    /// `true` if the controller is bus-off.
    pub bus_off: bool,
    /// Number of times that the controller was bus-off during the observation. The controller may be active again.
    pub times_bus_off: u64,
    /// `true` if the controller is error passive.
    pub passive: bool,
    /// Transmit error counter.
    pub tec: Option<u16>,
    /// Receive error counter.
    pub rec: Option<u16>,
    /// Frames without an acknowledgement.
    pub no_acknowledge: u64,
    /// Stuff, form and CRC errors. Typical causes are a wrong bit rate and reflections.
    pub protocol_errors: u64,
}

/// Data for the diagnosis. Unknown values are `None` or empty.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// Time of listening, µs.
    pub listened_us: u64,
    /// Time at which the observation ended, µs.
    pub now_us: u64,
    /// Counters of the bus.
    pub statistics: Statistics,
    /// Boards as last seen.
    pub boards: Boards,
    /// State of the adapter, if it reports one.
    pub controller: Option<Controller>,
    /// Report of a scan, which changes nothing.
    pub scan: Option<ScanReport>,
    /// Report of an init, if one was run.
    pub init: Option<InitReport>,
    /// Another bit rate at which frames were received, in bit/s.
    pub other_bitrate: Option<u32>,
    /// Last frame of another PC.
    pub competing_master: Option<(Function, u8)>,
    /// The profile in use.
    pub profile: Profile,
}

/// Returns all findings, problems first.
pub fn findings(o: &Observation) -> Vec<Finding> {
    let mut f = Findings::default();
    bus(o, &mut f);
    traffic(o, &mut f);
    chain(o, &mut f);
    boards(o, &mut f);
    f.worst_first()
}

fn bus(o: &Observation, f: &mut Findings) {
    let received = o.statistics.received + o.statistics.foreign_count();
    let rate = o.profile.bitrate;
    if let Some(other) = o.other_bitrate.filter(|other| *other != rate) {
        let next = format!("set `bitrate = {other}` in the profile and the adapter to the same rate");
        f.problem(format!("wrong bit rate: frames come at {other} bit/s, not at {rate}"), "", next);
    }
    if let Some(c) = &o.controller {
        let counters = format!("TEC {}, REC {}", count(c.tec), count(c.rec));
        let off_why = "too many of its frames failed: wrong bit rate, no termination, or CAN_H and CAN_L swapped or shorted";
        if c.bus_off {
            let next = "check rate and cable, then restart the interface";
            f.problem(format!("the adapter is bus-off ({counters})"), off_why, next);
        } else if c.times_bus_off > 0 {
            let times =
                if c.times_bus_off == 1 { "once".into() } else { format!("{} times", c.times_bus_off) };
            let what = format!("the adapter has left the bus {times} meanwhile (bus-off) and is back");
            f.problem(what, off_why, "check rate, cable and termination, then ucom doctor again");
        } else if c.no_acknowledge > 0 && received == 0 {
            let why = "no powered board is connected, or all of them listen at another bit rate";
            f.problem(
                format!("nobody acknowledges our frames ({} times)", c.no_acknowledge),
                why,
                "check power and cable of the boards; other rates: 500000, 250000, 125000 (`bitrate` in the profile)",
            );
        } else if c.protocol_errors > 0 && received == 0 {
            let why = "frames are there but none can be read: usually another bit rate";
            f.problem(
                format!("{} bus errors and no frame", c.protocol_errors),
                why,
                "try `bitrate` 500000, 250000, 125000",
            );
        } else if c.protocol_errors > 0 || c.passive || c.tec.max(c.rec).is_some_and(|n| n >= 96) {
            let why = "reflections: termination missing or doubled (120 Ω at both ends, 60 Ω measured across the bus), a stub too long, a ground missing";
            let what = format!("bus errors beside good frames: {} ({counters})", c.protocol_errors);
            f.warn(what, why, "measure the resistance between CAN_H and CAN_L with the power off");
        } else {
            f.good(format!("the adapter is error active ({counters})"));
        }
    }
    if received == 0
        && o.controller.is_none_or(|c| c.no_acknowledge == 0 && c.protocol_errors == 0 && !c.bus_off)
    {
        let s = o.listened_us as f64 * 1e-6;
        let why = if o.scan.is_some() {
            "no board is powered or connected to this bus, or none reads the protocol as the profile does"
        } else {
            "nobody talks without being asked"
        };
        f.problem(format!("no frame within {s:.1} s"), why, "`ucom scan`; is it the right interface?");
    }
}

fn count(counter: Option<u16>) -> String {
    counter.map_or("unknown".into(), |n| n.to_string())
}

fn traffic(o: &Observation, f: &mut Findings) {
    let load = o.statistics.load_percent(o.now_us);
    if load > f64::from(o.profile.load_limit) {
        let why = "heartbeats rank behind all process data and starve first";
        f.warn(
            format!("bus load {load:.0} %, limit {} %", o.profile.load_limit),
            why,
            "longer `so.period` or `ci.period`, fewer boards on this bus",
        );
    }
    if o.statistics.foreign_count() > 0 {
        let kinds: Vec<String> =
            o.statistics.foreign.iter().map(|(kind, n)| format!("{n} × {kind}")).collect();
        let why = "another protocol shares the bus, or the identifiers are read otherwise";
        f.warn(
            format!("frames that are not of this protocol: {}", kinds.join(", ")),
            why,
            "`ucom monitor` shows them",
        );
    }
    if let Some((function, to)) = o.competing_master {
        let why = "exactly one PC may be master";
        f.warn(
            format!("another PC talks on this bus ({} to {to})", function.name()),
            why,
            "end the other program before anything that changes boards",
        );
    }
    if o.statistics.undecodable > 0 {
        let why =
            "too short or impossible values: another reading of the protocol, or two boards with one number";
        f.warn(
            format!("{} of boards cannot be read", counted(o.statistics.undecodable as usize, "frame")),
            why,
            "`ucom probe`",
        );
    }
}

const BYTE_ORDER: &str = "`ucom probe --out FILE`, then `--profile FILE` with every command";

fn chain(o: &Observation, f: &mut Findings) {
    if let Some(init) = &o.init {
        initialised(init, f);
    }
    if let Some(scan) = &o.scan {
        scanned(scan, f);
    }
}

/// Adds the findings of an init.
fn initialised(init: &InitReport, f: &mut Findings) {
    for finding in &init.findings {
        f.problem(finding.to_string(), "", after_init(finding));
    }
    if init.is_ok() {
        f.good(match init.boards.len() {
            1 => "1 board has its number".into(),
            n => format!("{n} boards have their numbers"),
        });
    }
}

/// Returns the next command after a finding of an init.
fn after_init(finding: &InitFinding) -> String {
    match finding {
        InitFinding::NoBoards => "check power, cable and bit rate, then `ucom doctor` again".to_owned(),
        InitFinding::NotReached { after: 0, .. } => {
            "the first board does not take number 1: is its incoming init pin strapped active?".into()
        }
        InitFinding::NotReached { after, .. } => {
            format!("check the init wire from board {after} to the next one, then `ucom init`")
        }
        InitFinding::MoreBoardsThanReports { .. } | InitFinding::DuplicateFlash { .. } => {
            "give one of the boards another flash number".into()
        }
        InitFinding::UnexpectedOrder { .. } | InitFinding::Missing { .. } => {
            "were boards swapped? `ucom init --inventory FILE` writes the new order".into()
        }
        InitFinding::Refused { error, .. } => error.hint(),
        InitFinding::ByteOrder { .. } => BYTE_ORDER.into(),
        _ => "`ucom init` again".into(),
    }
}

/// Adds the findings of a scan.
fn scanned(scan: &ScanReport, f: &mut Findings) {
    for shared in scan.findings.iter().filter_map(ScanFinding::error) {
        let (why, next) = SHARED_CAUSE;
        f.problem(shared.to_string(), why, next);
    }
    if let Some(order) = scan.findings.iter().find(|x| matches!(x, ScanFinding::ByteOrder { .. })) {
        // The other values of these boards were read in the wrong byte order, so they give no findings.
        f.problem(order.to_string(), "", BYTE_ORDER);
        return;
    }
    numbers(scan, f);
    let reported = |x: &&ScanFinding| matches!(x, ScanFinding::Unnumbered { .. }) || x.error().is_some();
    for finding in scan.findings.iter().filter(|x| !reported(x)) {
        let next = match finding {
            ScanFinding::SameFlash { .. } | ScanFinding::Ambiguous { .. } => {
                "give one of them another flash number"
            }
            ScanFinding::Disagrees { .. } => "`ucom probe`",
            ScanFinding::Status { .. } => "`ucom probe`; then `ucom reset` and `ucom init`",
            ScanFinding::Contradicts { .. } => "`ucom init` numbers them anew",
            _ => "`ucom scan` again",
        };
        f.warn(finding.to_string(), "", next);
    }
    for board in &scan.boards {
        let n = board.number;
        if !board.info.has_application() {
            f.warn(
                format!("board {n} has no valid application"),
                "never programmed, or an update was interrupted",
                format!("`ucom update {n} IMAGE`"),
            );
        }
    }
}

/// Adds a finding about how many boards have a number.
fn numbers(scan: &ScanReport, f: &mut Findings) {
    let unnumbered = scan.findings.iter().filter(|x| matches!(x, ScanFinding::Unnumbered { .. })).count();
    if unnumbered > 0 && scan.boards.is_empty() {
        f.warn(
            match unnumbered {
                1 => "1 board, without a number".into(),
                n => format!("{n} boards, none has a number"),
            },
            "powered up or reset since they were numbered",
            "`ucom init`",
        );
    } else if unnumbered > 0 {
        let after = scan.boards.last().map_or(0, |b| b.number);
        let why = format!("a reboot, or the init wire behind board {after} is broken");
        f.problem(
            match (unnumbered, scan.boards.len()) {
                (n, numbered) if n + numbered == 2 => "1 board has no number beside 1 that has one".into(),
                (n, 1) => format!("{n} boards have no number beside 1 that has one"),
                (1, numbered) => format!("1 board has no number beside {numbered} that have one"),
                (n, numbered) => format!("{n} boards have no number beside {numbered} that have one"),
            },
            why,
            "`ucom init` names the place",
        );
    } else if !scan.boards.is_empty() {
        f.good(match scan.boards.len() {
            1 => "1 board already has a number".into(),
            n => format!("{n} boards already have numbers"),
        });
    }
}

fn boards(o: &Observation, f: &mut Findings) {
    for (n, board) in o.boards.iter() {
        if board.rebooted {
            f.problem(
                format!("board {n} rebooted and lost its number"),
                "power, watchdog or a crash of its application",
                "`ucom init`",
            );
        }
        match board.life {
            Life::Lost => f.problem(
                format!("board {n} gives no heartbeat"),
                "it lost power or the bus",
                format!("`ucom info {n}`, cable and power of this board"),
            ),
            Life::Late => f.warn(
                format!("board {n} is late with its heartbeats"),
                "the bus is overloaded or frames get lost",
                "`ucom monitor`",
            ),
            Life::Unarmed | Life::Alive => {}
        }
        if let Some((_, code)) = board.errors.last() {
            let what = format!("board {n} reported {} errors, the last {code}", board.error_count);
            f.warn(what, code.meaning(), code.reaction());
        }
    }
}
