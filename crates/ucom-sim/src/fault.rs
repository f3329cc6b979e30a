//! Faults of a simulated chain, each with its kind, trigger and duration.
use serde::Deserialize;

/// Text of `ucom help faults`.
pub const FAULT_HELP: &str = include_str!("fault.txt");

/// Kinds of faults of a simulated chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The board has no power.
    PowerLoss,
    /// No frame of the board reaches the bus.
    Silent,
    /// The board receives no frames.
    Deaf,
    /// The application crashes, and the watchdog reboots the board (D-26).
    Crash,
    /// The init wire after a board is broken.
    WireBroken,
    /// A board takes the number of the previous board, as after PC_INIT was repeated without a PC_INFO (D-24).
    SameNumber,
    /// The board does not send the acknowledgement of its number (D-24).
    AckHeld,
    /// The flash memory of a board cannot be written.
    FlashBroken,
    /// Another PC is the master of the bus (D-08).
    CompetingMaster,
    /// Frames of other protocols are on the bus (D-02).
    ForeignFrames,
    /// A share of the frames between the chain and its clients is lost.
    Lost(f64),
    /// A bit is flipped in a share of the frames between the chain and its clients.
    Corrupted(f64),
    /// A share of the frames between the chain and its clients is doubled.
    Doubled(f64),
    /// A share of the frames is destroyed on the wire. The error counters of the CAN controllers increase, up to bus-off.
    Disturbed(f64),
}

/// Trigger that begins a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trigger {
    /// The fault begins at this time after the start, µs.
    At(u64),
    /// The fault begins with the n-th frame that has this identifier on the bus.
    Frame {
        /// Identifier of the frame.
        id: u16,
        /// Number of the frame with this identifier, from 1.
        count: u64,
    },
}

/// Fault of the simulated chain or of its bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Position of the board in the chain, from 1; 0 for faults of the bus.
    pub board: usize,
    /// Trigger of the fault.
    pub trigger: Trigger,
    /// Duration of the fault in µs; `None` if the fault does not end.
    pub duration_us: Option<u64>,
}

/// Reasons why a fault file cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FaultError {
    /// The text is not TOML in the form of a fault file; the message contains the position and the reason.
    #[error("{0}")]
    Form(String),
    /// The simulation has no fault of this kind.
    #[error("fault {fault}: unknown kind `{kind}`, expected one of {}", kinds().join(", "))]
    Kind {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault in the file.
        kind: String,
    },
    /// A key that this kind of fault needs is missing.
    #[error("fault {fault}: {kind} needs {key}")]
    Missing {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault.
        kind: String,
        /// Name of the missing key.
        key: &'static str,
    },
    /// A key has no meaning for this kind of fault.
    #[error("fault {fault}: {key} has no effect for {kind}; remove the key")]
    Superfluous {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Kind of the fault.
        kind: String,
        /// Name of the key that has no meaning.
        key: &'static str,
    },
    /// The value of a key is out of range.
    #[error("fault {fault}: {key} must be {range}")]
    Range {
        /// Number of the fault in the file, from 1.
        fault: usize,
        /// Name of the key.
        key: &'static str,
        /// Allowed values of the key.
        range: &'static str,
    },
}

/// Kinds of faults that concern one board.
const OF_A_BOARD: [(&str, FaultKind); 8] = [
    ("power-loss", FaultKind::PowerLoss),
    ("silent", FaultKind::Silent),
    ("deaf", FaultKind::Deaf),
    ("crash", FaultKind::Crash),
    ("wire-broken", FaultKind::WireBroken),
    ("same-number", FaultKind::SameNumber),
    ("ack-held", FaultKind::AckHeld),
    ("flash-broken", FaultKind::FlashBroken),
];

/// Kinds of faults that concern the bus.
const OF_THE_BUS: [(&str, FaultKind); 2] =
    [("foreign-master", FaultKind::CompetingMaster), ("foreign-frames", FaultKind::ForeignFrames)];

/// Function that creates a fault kind from the share of affected frames, 0 to 1.
type OfAShare = fn(f64) -> FaultKind;

/// Kinds of faults that concern a share of the frames.
const OF_A_SHARE: [(&str, OfAShare); 4] = [
    ("lost", FaultKind::Lost),
    ("corrupted", FaultKind::Corrupted),
    ("doubled", FaultKind::Doubled),
    ("disturbed", FaultKind::Disturbed),
];

/// Returns the names of all kinds of faults.
fn kinds() -> Vec<&'static str> {
    let whole = OF_A_BOARD.iter().chain(&OF_THE_BUS).map(|(name, _)| *name);
    whole.chain(OF_A_SHARE.map(|(name, _)| name)).collect()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    fault: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: String,
    board: Option<usize>,
    at_s: Option<f64>,
    on_id: Option<u16>,
    on_count: Option<u64>,
    for_s: Option<f64>,
    share: Option<f64>,
}

impl Fault {
    /// Reads the faults in a fault file.
    pub fn from_toml(text: &str) -> Result<Vec<Self>, FaultError> {
        let file: File = toml::from_str(text).map_err(|e| FaultError::Form(e.to_string()))?;
        file.fault.into_iter().enumerate().map(|(i, entry)| entry.checked(i + 1)).collect()
    }

    /// Reads a fault that begins now from a line such as `power-loss board=2 for_s=1`.
    pub fn from_line(line: &str) -> Result<Self, FaultError> {
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let mut text = format!("[[fault]]\nkind = '{}'\n", kind.replace('\'', ""));
        for word in words {
            text += word;
            text.push('\n');
        }
        let faults = Self::from_toml(&text)?;
        faults.first().copied().ok_or_else(|| FaultError::Form(line.into()))
    }
}

impl Entry {
    fn checked(self, fault: usize) -> Result<Fault, FaultError> {
        let missing = |key| FaultError::Missing { fault, kind: self.kind.clone(), key };
        let superfluous = |key| FaultError::Superfluous { fault, kind: self.kind.clone(), key };
        let range = |key, range| FaultError::Range { fault, key, range };
        let whole = OF_A_BOARD.iter().chain(&OF_THE_BUS).find(|(name, _)| *name == self.kind);
        let shared = OF_A_SHARE.iter().find(|(name, _)| *name == self.kind);
        let kind = match (whole, shared, self.share) {
            (Some(_), _, Some(_)) => return Err(superfluous("share")),
            (Some((_, kind)), ..) => *kind,
            (_, Some(_), None) => return Err(missing("share")),
            (_, Some((_, kind)), Some(share)) if (0.0..=1.0).contains(&share) => kind(share),
            (_, Some(_), _) => return Err(range("share", "0 to 1")),
            _ => return Err(FaultError::Kind { fault, kind: self.kind }),
        };
        let of_a_board = kind.of_a_board();
        let board = match self.board {
            Some(_) if !of_a_board => return Err(superfluous("board")),
            None if of_a_board => return Err(missing("board")),
            Some(board) if !(1..=31).contains(&board) => return Err(range("board", "1 to 31")),
            board => board.unwrap_or(0),
        };
        let time = |key, value: f64| {
            let allowed = (0.0..=1e6).contains(&value);
            if allowed { Ok((value * 1e6) as u64) } else { Err(range(key, "0 to 1000000 seconds")) }
        };
        let trigger = match (self.at_s, self.on_id, self.on_count) {
            (Some(_), Some(_), _) => return Err(superfluous("on_id")),
            (at, None, None) => Trigger::At(time("at_s", at.unwrap_or(0.0))?),
            (None, Some(id), count) if id <= 0x7FF => Trigger::Frame { id, count: count.unwrap_or(1).max(1) },
            (_, Some(_), _) => return Err(range("on_id", "an identifier, 0 to 0x7FF")),
            (_, None, Some(_)) => return Err(superfluous("on_count")),
        };
        if kind == FaultKind::SameNumber && board < 2 {
            return Err(range("board", "2 to 31, because the board takes the number of the board before it"));
        }
        if matches!(kind, FaultKind::Crash | FaultKind::SameNumber) && self.for_s.is_some() {
            return Err(superfluous("for_s"));
        }
        let duration_us = self.for_s.map(|s| time("for_s", s)).transpose()?;
        Ok(Fault { kind, board, trigger, duration_us })
    }
}

impl FaultKind {
    /// Returns `true` if faults of this kind concern one board.
    pub fn of_a_board(self) -> bool {
        OF_A_BOARD.iter().any(|(_, kind)| *kind == self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_the_help_can_be_written() {
        for kind in kinds() {
            assert!(FAULT_HELP.contains(&format!("\n{kind} ")), "{kind} is not in the help");
            let mut text = format!("[[fault]]\nkind = '{kind}'\nat_s = 1.5\n");
            if matches!(kind, "lost" | "corrupted" | "doubled" | "disturbed") {
                text += "share = 0.5\n";
            } else if !kind.starts_with("foreign") {
                text += "board = 2\n";
            }
            let fault = Fault::from_toml(&text).unwrap()[0];
            assert_eq!(fault.trigger, Trigger::At(1_500_000));
        }
    }

    #[test]
    fn a_line_is_a_fault_that_begins_now() {
        let fault = Fault::from_line("power-loss board=2 for_s=1").unwrap();
        let now = Trigger::At(0);
        let want = Fault { kind: FaultKind::PowerLoss, board: 2, trigger: now, duration_us: Some(1_000_000) };
        assert_eq!(fault, want);
        let fault = Fault::from_line("crash board=1 on_id=0x2C1 on_count=500").unwrap();
        assert_eq!(fault.trigger, Trigger::Frame { id: 0x2C1, count: 500 });
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_place() {
        for (line, part) in [
            ("fire board=1", "expected one of power-loss"),
            ("silent", "needs board"),
            ("silent board=32", "1 to 31"),
            ("lost", "needs share"),
            ("lost share=2", "0 to 1"),
            ("lost share=0.1 board=1", "board has no effect"),
            ("silent board=1 share=0.1", "share has no effect"),
            ("wire-broken board=1 share=0.1", "share has no effect"),
            ("same-number board=2 for_s=1", "for_s has no effect"),
            ("same-number board=1", "2 to 31"),
            ("crash board=1 for_s=1", "for_s has no effect"),
            ("silent board=1 at_s=-1", "seconds"),
            ("silent board=1 at_s=1 on_id=1", "on_id has no effect"),
            ("silent board=1 on_id=0x800", "identifier"),
            ("silent board=1 on_count=2", "on_count has no effect"),
            ("silent bord=1", "bord"),
            ("", "unknown kind"),
        ] {
            let text = Fault::from_line(line).unwrap_err().to_string();
            assert!(text.contains(part), "{line}: {text}");
        }
    }
}
