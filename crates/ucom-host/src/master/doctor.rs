//! Findings of `ucom doctor` about the bus, the chain and the boards. Each finding names the command that the user should run next.
use crate::master::engine::{Boards, Life, Statistics};
use crate::master::error::{SHARED_CAUSE, shared_remedy};
use crate::master::reports::{InitFinding, InitReport, ScanFinding, ScanReport};
use host_kit::{Action, Diagnose, Findings, Next, next};
pub use host_kit::{Finding, Severity};

use crate::master::counted::counted;
use ucom::{Function, Profile};

/// State that the CAN controller reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controller {
    /// `true` if the controller is bus-off.
    pub bus_off: bool,
    /// Number of times that the controller was bus-off during the observation. The controller may be on the bus again at the end of the
    /// observation.
    pub times_bus_off: u64,
    /// `true` if the controller is error passive.
    pub passive: bool,
    /// Transmit error counter of the controller.
    pub tec: Option<u16>,
    /// Receive error counter of the controller.
    pub rec: Option<u16>,
    /// Number of frames that no node acknowledged.
    pub no_acknowledge: u64,
    /// Number of stuff, form and CRC errors. Typical causes are a wrong bit rate and reflections.
    pub protocol_errors: u64,
}

/// Data about the bus from which the doctor derives its findings. Unknown values are `None` or empty.
#[derive(Clone, Debug, Default)]
pub struct Observation {
    /// Duration of the observation, µs.
    pub listened_us: u64,
    /// Time at which the observation ended, µs.
    pub now_us: u64,
    /// Counters of the frames on the bus.
    pub statistics: Statistics,
    /// Last known states of the boards.
    pub boards: Boards,
    /// State of the CAN adapter; `None` if the adapter does not report its state.
    pub controller: Option<Controller>,
    /// Report of a scan, which does not change any board.
    pub scan: Option<ScanReport>,
    /// Report of an init, if the user ran an init.
    pub init: Option<InitReport>,
    /// Another bit rate at which the PC received frames, in bit/s.
    pub other_bitrate: Option<u32>,
    /// Function and destination number of the last frame of another PC.
    pub competing_master: Option<(Function, u8)>,
    /// The profile in use.
    pub profile: Profile,
}

/// Returns all findings of the doctor, problems first.
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
        f.problem(format!("wrong bit rate: frames are received at {other} bit/s, not at {rate}"), "", next);
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
            let what = format!(
                "the adapter left the bus {times} while ucom listened (bus-off), and is on the bus again"
            );
            f.problem(what, off_why, next!("check rate, cable and termination, then {} again", ChainDoctor));
        } else if c.no_acknowledge > 0 && received == 0 {
            let why = "no board with power is connected, or all boards use another bit rate";
            f.problem(
                format!("no node acknowledges the frames of this PC ({} times)", c.no_acknowledge),
                why,
                "check power and cable of the boards; other rates: 500000, 250000, 125000 (`bitrate` in the profile)",
            );
        } else if c.protocol_errors > 0 && received == 0 {
            let why = "frames are on the bus but cannot be read: usually the bit rate is wrong";
            f.problem(
                format!("{} bus errors and no valid frame", c.protocol_errors),
                why,
                "try `bitrate` 500000, 250000, 125000",
            );
        } else if c.protocol_errors > 0 || c.passive || c.tec.max(c.rec).is_some_and(|n| n >= 96) {
            let why = "reflections: termination missing or doubled (120 Ω at both ends, 60 Ω measured \
                       across the bus), a stub that is too long, a missing ground";
            let what = format!("bus errors between valid frames: {} ({counters})", c.protocol_errors);
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
            "no board with power is connected to this bus, or the profile does not match the boards"
        } else {
            "boards may send nothing until a PC requests it"
        };
        f.problem(
            format!("no frame within {s:.1} s"),
            why,
            next!("{}; check that this is the right interface", ChainScan),
        );
    }
}

fn count(counter: Option<u16>) -> String {
    counter.map_or("unknown".into(), |n| n.to_string())
}

fn traffic(o: &Observation, f: &mut Findings) {
    let load = o.statistics.load_percent(o.now_us);
    if load > f64::from(o.profile.load_limit) {
        let why = "heartbeats have a lower priority than all process data and are delayed first";
        f.warn(
            format!("bus load {load:.0} %, limit {} %", o.profile.load_limit),
            why,
            "increase `so.period` or `ci.period`, or use fewer boards on this bus",
        );
    }
    if o.statistics.foreign_count() > 0 {
        let kinds: Vec<String> =
            o.statistics.foreign.iter().map(|(kind, n)| format!("{n} × {kind}")).collect();
        let why = "another protocol uses this bus, or the boards use the identifiers differently";
        f.warn(
            format!("frames that are not of this protocol: {}", kinds.join(", ")),
            why,
            "`ucom monitor` shows them",
        );
    }
    if let Some((function, to)) = o.competing_master {
        let why = "exactly one PC may be master";
        f.warn(
            format!("another PC sends on this bus ({} to {to})", function.name()),
            why,
            "end the other program before you change boards",
        );
    }
    if o.statistics.undecodable > 0 {
        let why = "the frames are too short or have impossible values: the profile does not match the \
                   boards, or two boards share a number";
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

/// Returns the command that the user should run next after a finding of an init.
fn after_init(finding: &InitFinding) -> Next {
    match finding {
        InitFinding::NoBoards => next!("check power, cable and bit rate, then {} again", ChainDoctor),
        InitFinding::NotReached { after: 0, .. } => {
            "the first board does not take number 1: check that its incoming init pin is strapped active"
                .into()
        }
        InitFinding::NotReached { after, .. } => {
            Next::from(format!("check the init wire from board {after} to the next one, then "))
                .then(Action::ChainInit)
        }
        InitFinding::MoreBoardsThanReports { .. } | InitFinding::DuplicateFlash { .. } => {
            "give one of the boards another flash number".into()
        }
        InitFinding::UnexpectedOrder { .. } | InitFinding::Missing { .. } => {
            "if boards were swapped, `ucom init --inventory FILE` writes the new order".into()
        }
        InitFinding::Refused { error, .. } => error.diagnosis().next,
        InitFinding::ByteOrder { .. } => BYTE_ORDER.into(),
        _ => next!("{} again", ChainInit),
    }
}

/// Adds the findings of a scan.
fn scanned(scan: &ScanReport, f: &mut Findings) {
    for shared in scan.findings.iter().filter_map(ScanFinding::error) {
        f.problem(shared.to_string(), SHARED_CAUSE, shared_remedy());
    }
    if let Some(order) = scan.findings.iter().find(|x| matches!(x, ScanFinding::ByteOrder { .. })) {
        // The PC also read the other values of these boards in the wrong byte order, so the doctor derives no
        // findings from them.
        f.problem(order.to_string(), "", BYTE_ORDER);
        return;
    }
    numbers(scan, f);
    let reported = |x: &&ScanFinding| matches!(x, ScanFinding::Unnumbered { .. }) || x.error().is_some();
    for finding in scan.findings.iter().filter(|x| !reported(x)) {
        let next = match finding {
            ScanFinding::SameFlash { .. } | ScanFinding::Ambiguous { .. } => {
                "give one of them another flash number".into()
            }
            ScanFinding::Disagrees { .. } => "`ucom probe`".into(),
            ScanFinding::Status { .. } => next!("`ucom probe`; then {} and {}", BoardReset, ChainInit),
            ScanFinding::Contradicts { .. } => next!("{} numbers the boards again", ChainInit),
            _ => next!("{} again", ChainScan),
        };
        f.warn(finding.to_string(), "", next);
    }
    for board in &scan.boards {
        let n = board.number;
        if !board.info.has_application() {
            f.warn(
                format!("board {n} has no valid application"),
                "never programmed, or an update was interrupted",
                Next::from(Action::BoardUpdate).of_board(n),
            );
        }
    }
}

/// Adds a finding about how many boards have a number and how many do not.
fn numbers(scan: &ScanReport, f: &mut Findings) {
    let unnumbered = scan.findings.iter().filter(|x| matches!(x, ScanFinding::Unnumbered { .. })).count();
    if unnumbered > 0 && scan.boards.is_empty() {
        f.warn(
            match unnumbered {
                1 => "1 board, without a number".into(),
                n => format!("{n} boards, none has a number"),
            },
            "the boards were powered up or reset after they got numbers",
            Action::ChainInit,
        );
    } else if unnumbered > 0 {
        let after = scan.boards.last().map_or(0, |b| b.number);
        let why = format!("a board rebooted, or the init wire after board {after} is broken");
        f.problem(
            match (unnumbered, scan.boards.len()) {
                (1, numbered) => format!("1 of {} boards has no number", numbered + 1),
                (n, numbered) => format!("{n} of {} boards have no number", n + numbered),
            },
            why,
            next!("{} shows the position", ChainInit),
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
                "a power loss, a watchdog reset or a crash of its application",
                Action::ChainInit,
            );
        }
        match board.life {
            Life::Lost => f.problem(
                format!("board {n} gives no heartbeat"),
                "the board lost power or its connection to the bus",
                next!("{}, cable and power of this board", BoardInfo).of_board(n),
            ),
            Life::Late => f.warn(
                format!("board {n} is late with its heartbeats"),
                "the bus is overloaded or frames are lost",
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
