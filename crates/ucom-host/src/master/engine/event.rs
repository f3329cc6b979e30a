//! Events: what the master reports to its user unasked.
use crate::master::error::Error;
use crate::master::io::Snapshot;
use crate::master::reports::update::Progress;
use crate::master::reports::{ConformanceTest, Outcome, ProcedureId};
use ucom::{Admin, BoardInfo, ErrorCode, Foreign, Function};

/// Something happened.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A procedure ended.
    Done {
        /// Which.
        id: ProcedureId,
        /// How.
        result: Result<Outcome, Error>,
    },
    /// An update went on.
    Progress {
        /// Which procedure.
        id: ProcedureId,
        /// How far.
        progress: Progress,
    },
    /// An update is about to reset this board for programming: its flash record does not hold any more (D-62). Nothing is
    /// erased before the board has answered to the reset.
    FlashBegins {
        /// Which procedure.
        id: ProcedureId,
        /// Its flash number.
        flash_number: u16,
    },
    /// A board showed the program that an update wrote (D-62).
    FlashVerified {
        /// Which procedure.
        id: ProcedureId,
        /// What it shows.
        info: BoardInfo,
    },
    /// A conformance test was done.
    Tested {
        /// Which procedure.
        id: ProcedureId,
        /// How it ended.
        test: ConformanceTest,
    },
    /// A procedure reports something on its way.
    Note {
        /// Which procedure.
        id: ProcedureId,
        /// In words.
        text: String,
    },
    /// A board's heartbeats changed.
    Supervision {
        /// Its number.
        board: u8,
        /// What happened.
        change: Supervision,
    },
    /// A board reported an error.
    BoardError {
        /// Its number; 0 (or what stands for it) from a board without one.
        board: u8,
        /// The code.
        code: ErrorCode,
        /// The procedure that was at work with the board; `None`: unsolicited.
        during: Option<ProcedureId>,
    },
    /// A board's flags, sent by itself.
    Admin {
        /// Its number.
        board: u8,
        /// The flags.
        admin: Admin,
    },
    /// A text of a board.
    Debug {
        /// Its number.
        board: u8,
        /// The text.
        text: String,
    },
    /// All sensor outputs of a board at one time (only for boards that [`Master::watch`](crate::master::Master::watch) names).
    Snapshot {
        /// Its number.
        board: u8,
        /// The words.
        snapshot: Snapshot,
    },
    /// A frame that is not of this protocol (D-02); the first of each kind, all are counted.
    Foreign(Foreign),
    /// A competing master: another PC sends on the bus (D-08), and has not for a second; [`Master::competing_master`](crate::master::Master::competing_master) also shows one that goes on.
    CompetingMaster {
        /// What it sent.
        function: Function,
        /// To which number.
        to: u8,
    },
    /// Two boards have one number (D-24); reported once, until numbers are given anew.
    NumberShared {
        /// The number.
        board: u8,
        /// Their flash numbers; twice the same one when they cannot be distinguished.
        found: Vec<u16>,
    },
    /// So many events were dropped because nobody took them.
    Overflow {
        /// How many.
        dropped: u64,
    },
}

/// Change of a board's supervision (D-51).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supervision {
    /// One heartbeat is missing.
    Late,
    /// Three are; frames of the policy follow at once.
    Lost,
    /// They are there again.
    Back,
    /// A report came that nobody asked for: it has rebooted and has no number any more (D-26).
    Rebooted {
        /// Low byte of its flash number.
        ucom_id: u8,
    },
    /// A report came that nobody asked for, of a board that is not known.
    UnknownRebooted {
        /// Low byte of its flash number.
        ucom_id: u8,
    },
}
