//! Events that the master reports without a request of its user.
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
        /// Procedure that ended.
        id: ProcedureId,
        /// Result of the procedure.
        result: Result<Outcome, Error>,
    },
    /// An update made progress.
    Progress {
        /// Procedure of the update.
        id: ProcedureId,
        /// Progress of the update.
        progress: Progress,
    },
    /// An update will reset this board for programming, so the board's flash record becomes invalid (D-62).
    /// The board's memory is erased only after the board has answered the reset.
    FlashBegins {
        /// Procedure of the update.
        id: ProcedureId,
        /// Flash number of the board.
        flash_number: u16,
    },
    /// A board reported the program that an update has written (D-62).
    FlashVerified {
        /// Procedure of the update.
        id: ProcedureId,
        /// Answer of the board to PC_INFO.
        info: BoardInfo,
    },
    /// A conformance test ended.
    Tested {
        /// Procedure of the conformance tests.
        id: ProcedureId,
        /// Test that ended, with its result.
        test: ConformanceTest,
    },
    /// A procedure reports a note before its end.
    Note {
        /// Procedure that reports the note.
        id: ProcedureId,
        /// Text of the note.
        text: String,
    },
    /// The state of a board's heartbeat supervision changed.
    Supervision {
        /// Board number.
        board: u8,
        /// Change of the board's supervision.
        change: Supervision,
    },
    /// A board reported an error.
    BoardError {
        /// Number of the board. For a board without a number, it is the number that the profile defines for such
        /// boards (0 by default).
        board: u8,
        /// Reported error code.
        code: ErrorCode,
        /// Procedure that works with the board; `None` if no procedure works with it.
        during: Option<ProcedureId>,
    },
    /// A board sent its flags without a request.
    Admin {
        /// Board number.
        board: u8,
        /// Flags that the board sent.
        admin: Admin,
    },
    /// A board sent a text.
    Debug {
        /// Board number.
        board: u8,
        /// Text of the board.
        text: String,
    },
    /// All sensor outputs of a board at one time. The master reports this event only for boards that
    /// [`Master::watch`](crate::master::Master::watch) has selected.
    Snapshot {
        /// Board number.
        board: u8,
        /// Values of the sensor outputs.
        snapshot: Snapshot,
    },
    /// A frame is not of this protocol (D-02). The master reports only the first foreign frame of each kind, but counts all foreign frames.
    Foreign(Foreign),
    /// Another PC sent a frame and is therefore a competing master (D-08). The master reports the first frame, and a
    /// later frame only if no other PC sent a frame in the second before it.
    /// [`Master::competing_master`](crate::master::Master::competing_master) returns the last frame, also while the
    /// competing master sends permanently.
    CompetingMaster {
        /// Function of the frame.
        function: Function,
        /// Board number that the frame was sent to; it can be the broadcast number.
        to: u8,
    },
    /// Two boards have the same number (D-24). The master reports each shared number only once until the number is assigned again.
    NumberShared {
        /// Number that the boards share.
        board: u8,
        /// Flash numbers of the boards that share the number. The list contains the same flash number twice if the
        /// boards cannot be distinguished.
        found: Vec<u16>,
    },
    /// The master discarded events because the caller did not fetch them.
    Overflow {
        /// Number of events that the master discarded.
        dropped: u64,
    },
}

/// Change of a board's supervision (D-51).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supervision {
    /// A heartbeat of the board is missing.
    Late,
    /// Three heartbeats of the board are missing. The master immediately sends the stop commands that the profile key
    /// `on_lost` requires.
    Lost,
    /// The board sends heartbeats again.
    Back,
    /// The board sent a report without a request, which means that it has rebooted and has lost its number (D-26).
    Rebooted {
        /// Low byte of the board's flash number.
        ucom_id: u8,
    },
    /// An unknown board sent a report without a request.
    UnknownRebooted {
        /// Low byte of the board's flash number.
        ucom_id: u8,
    },
}
