//! Events: reports of the master that its user did not request.
use crate::master::error::Error;
use crate::master::io::Snapshot;
use crate::master::reports::update::Progress;
use crate::master::reports::{ConformanceTest, Outcome, ProcedureId};
use ucom::{Admin, BoardInfo, ErrorCode, Foreign, Function};

/// Event on the bus or in a procedure.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A procedure ended.
    Done {
        /// Procedure.
        id: ProcedureId,
        /// Result.
        result: Result<Outcome, Error>,
    },
    /// An update made progress.
    Progress {
        /// Procedure.
        id: ProcedureId,
        /// Progress.
        progress: Progress,
    },
    /// An update will reset this board for programming, so the board's flash record is no longer valid (D-62). The board's memory is erased
    /// only after the board has answered the reset.
    FlashBegins {
        /// Procedure.
        id: ProcedureId,
        /// Flash number of the board.
        flash_number: u16,
    },
    /// A board reported the program that an update has written (D-62).
    FlashVerified {
        /// Procedure.
        id: ProcedureId,
        /// Answer of the board.
        info: BoardInfo,
    },
    /// A conformance test ended.
    Tested {
        /// Procedure.
        id: ProcedureId,
        /// Result.
        test: ConformanceTest,
    },
    /// A procedure reports a note before its end.
    Note {
        /// Procedure.
        id: ProcedureId,
        /// Text of the note.
        text: String,
    },
    /// A board's heartbeats changed.
    Supervision {
        /// Board number.
        board: u8,
        /// Change.
        change: Supervision,
    },
    /// A board reported an error.
    BoardError {
        /// Board number; 0 (or its equivalent) from a board without a number.
        board: u8,
        /// The code.
        code: ErrorCode,
        /// Procedure that works with the board; `None` if no procedure does.
        during: Option<ProcedureId>,
    },
    /// A board sent its flags without a request.
    Admin {
        /// Board number.
        board: u8,
        /// The flags.
        admin: Admin,
    },
    /// A board sent a text.
    Debug {
        /// Board number.
        board: u8,
        /// The text.
        text: String,
    },
    /// All sensor outputs of a board at one time. Reported only for boards that [`Master::watch`](crate::master::Master::watch) has
    /// selected.
    Snapshot {
        /// Board number.
        board: u8,
        /// The words.
        snapshot: Snapshot,
    },
    /// A frame is not of this protocol (D-02). Only the first frame of each kind is reported, but all frames are counted.
    Foreign(Foreign),
    /// Another PC sent a frame and is therefore a competing master (D-08). The event is reported only after at least one second without
    /// frames of another PC. [`Master::competing_master`](crate::master::Master::competing_master) also shows a master that sends
    /// permanently.
    CompetingMaster {
        /// Function of the frame.
        function: Function,
        /// Number that the frame was sent to.
        to: u8,
    },
    /// Two boards have the same number (D-24). The event is reported only once until numbers are assigned again.
    NumberShared {
        /// The number.
        board: u8,
        /// Flash numbers of these boards. The list contains one number twice if the boards cannot be distinguished.
        found: Vec<u16>,
    },
    /// Events were discarded because the caller did not fetch them.
    Overflow {
        /// Number of discarded events.
        dropped: u64,
    },
}

/// Change of a board's supervision (D-51).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supervision {
    /// A heartbeat is missing.
    Late,
    /// Three heartbeats are missing. The frames that the policy requires are sent at once.
    Lost,
    /// The heartbeats have returned.
    Back,
    /// The board sent a report without a request: it has rebooted and has lost its number (D-26).
    Rebooted {
        /// Low byte of its flash number.
        ucom_id: u8,
    },
    /// An unknown board sent a report without a request.
    UnknownRebooted {
        /// Low byte of its flash number.
        ucom_id: u8,
    },
}
