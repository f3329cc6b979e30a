//! What there is to know of an error beside its words: kind, short name, next command.
use crate::master::error::answer::Incomplete;
use crate::master::error::procedure::Error;
use crate::master::error::words::{MEASURE_ORDER, SHARED_CAUSE};
use host_kit::ErrorKind;

impl Error {
    /// What kind of failure it is. An update has its own, see [`UpdateReport::failure`](crate::master::update::UpdateReport::failure).
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Device { .. } | Self::AdminRefused { .. } | Self::StatusNotTaken { .. } => {
                ErrorKind::Device
            }
            Self::NoSignal { .. } | Self::NoBoard { .. } => ErrorKind::Usage,
            Self::Plan(e) => e.kind(),
            Self::NoAnswer { .. } | Self::Incomplete { .. } | Self::NotReached { .. } | Self::Bus { .. } => {
                ErrorKind::NoLink
            }
            Self::Contradiction { .. }
            | Self::AckMismatch { .. }
            | Self::WrongSequence { .. }
            | Self::WrongBoard { .. }
            | Self::ByteOrder { .. }
            | Self::NumberShared { .. }
            | Self::MayTakeNumber { .. }
            | Self::CompetingMaster { .. }
            | Self::Running { .. }
            | Self::LoopRuns { .. }
            | Self::NotNumbered { .. }
            | Self::Load(_)
            | Self::Busy { .. }
            | Self::StaleNames { .. }
            | Self::NoApplication { .. } => ErrorKind::Refused,
            Self::Lost { .. } | Self::Cancelled => ErrorKind::Fault,
        }
    }

    /// A short name for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoAnswer { .. } => "no-answer",
            Self::Incomplete { .. } => "incomplete-answer",
            Self::Contradiction { .. } => "contradiction",
            Self::Device { .. } => "device-error",
            Self::AckMismatch { .. } => "ack-mismatch",
            Self::WrongSequence { .. } => "wrong-sequence",
            Self::WrongBoard { .. } => "wrong-board",
            Self::ByteOrder { .. } => "byte-order",
            Self::NumberShared { .. } => "number-shared",
            Self::MayTakeNumber { .. } => "may-take-number",
            Self::StatusNotTaken { .. } => "status-not-taken",
            Self::NotReached { .. } => "not-reached",
            Self::AdminRefused { .. } => "admin-refused",
            Self::CompetingMaster { .. } => "foreign-master",
            Self::Running { .. } | Self::LoopRuns { .. } => "running",
            Self::NotNumbered { .. } => "not-numbered",
            Self::Load(_) => "load",
            Self::Busy { .. } => "busy",
            Self::NoBoard { .. } => "no-board",
            Self::NoApplication { .. } => "no-application",
            Self::NoSignal { .. } => "no-edge",
            Self::StaleNames { .. } => "stale-names",
            Self::Plan(_) => "plan",
            Self::Lost { .. } => "lost",
            Self::Bus { .. } => "bus",
            Self::Cancelled => "cancelled",
        }
    }

    /// The likely cause and the next command or act that helps.
    pub fn hint(&self) -> String {
        match self {
            Self::NoAnswer { board, last: None, .. } => {
                format!("no frame of board {board} was received: `ucom scan` lists who is there, `ucom doctor` why not")
            }
            Self::NoAnswer { board, .. } => {
                format!("board {board} talks but does not answer this: `ucom info {board}`, then `ucom doctor`")
            }
            Self::ByteOrder { .. } | Self::Incomplete { problem: Incomplete::ByteOrder { .. }, .. } => {
                MEASURE_ORDER.into()
            }
            Self::Incomplete { problem: Incomplete::TooMany { .. } | Incomplete::Start { .. }, .. } => {
                "the board may read the protocol otherwise: `ucom probe` measures it".into()
            }
            Self::Incomplete { .. } => {
                "frames get lost: `ucom doctor` looks at bus load, error counters and termination".into()
            }
            Self::Contradiction { .. } => "number the boards anew: `ucom init`".into(),
            Self::NumberShared { .. } => format!("{}; {}", SHARED_CAUSE.0, SHARED_CAUSE.1),
            Self::MayTakeNumber { other, .. } => {
                format!("`ucom repair {other}` first, or number all boards anew: `ucom init`")
            }
            Self::Device { code, .. } => code.reaction().into(),
            Self::AckMismatch { .. } | Self::WrongSequence { .. } => {
                "two boards may share a number, or the board reads the protocol otherwise: `ucom reset`, `ucom probe`"
                    .into()
            }
            Self::WrongBoard { wanted, found, .. } if *wanted == found.swap_bytes() => {
                "only the bytes are exchanged: is the byte order right (`endian` in the profile)? `ucom probe` measures it"
                    .into()
            }
            Self::WrongBoard { board, .. } => {
                format!("`ucom info {board}` shows who stands there; boards may have been swapped: `ucom init`")
            }
            Self::StatusNotTaken { .. } => {
                "bits that mirror reality cannot be set, PROG only in the exloader: `ucom help status`".into()
            }
            Self::NotReached { board, .. } => format!("`ucom info {board}`, then `ucom reset` and `ucom init`"),
            Self::AdminRefused { .. } => "outputs need a running control loop: `ucom start`".into(),
            Self::CompetingMaster { .. } => {
                "end the other program, or force this one if you know that it does not matter".into()
            }
            Self::Running { .. } | Self::LoopRuns { .. } => "`ucom stop all` first, or force it".into(),
            Self::NotNumbered { .. } => "`ucom init`, then again".into(),
            Self::Load(_) => "fewer boards, longer `so.period` or `ci.period`, or force it".into(),
            Self::Busy { .. } => "wait for it, or cancel it".into(),
            Self::NoBoard { .. } => "`ucom scan` lists the boards".into(),
            Self::NoApplication { board, valid: true } => format!("`ucom start {board}`"),
            Self::NoApplication { board, valid: false } => format!("`ucom update {board} IMAGE`"),
            Self::NoSignal { board, .. } => format!("`ucom io {board}` lists the names"),
            Self::StaleNames { board } => format!("`ucom io {board} --fresh` reads them anew"),
            Self::Plan(e) => e.hint().into(),
            Self::Lost { board } => {
                format!("`ucom info {board}`: has it rebooted, has it power? `ucom doctor` looks at bus and boards")
            }
            Self::Bus { .. } => "is the bus still there, the adapter plugged in? `ucom doctor` looks at it".into(),
            Self::Cancelled => "`ucom scan` shows in what state the boards are".into(),
        }
    }
}
