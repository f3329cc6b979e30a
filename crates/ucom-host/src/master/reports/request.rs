//! Requests to a master, and their outcomes.
use crate::master::io::IoDescription;
use crate::master::reports::conformance::{ConformanceOptions, ConformanceReport};
use crate::master::reports::flags::{AdminChange, StopLevel};
use crate::master::reports::init::{InitOptions, InitReport};
use crate::master::reports::probe::{ProbeOptions, ProbeReport};
use crate::master::reports::raw_status::RawStatus;
use crate::master::reports::run::{RunOptions, RunReport};
use crate::master::reports::scan::{Reports, ScanReport};
use crate::master::reports::seen::BoardSeen;
use crate::master::reports::update::{UpdateOptions, UpdateReport};
use ucom::{Admin, BoardInfo, Status};

/// Identifies a procedure while it runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ProcedureId(pub(crate) u64);

/// Request to start a procedure. `force`: the procedure runs although another PC is on the bus or another check refuses.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request {
    /// Lists the boards; changes nothing.
    Scan,
    /// Assigns numbers to the whole chain.
    Init(InitOptions),
    /// Gives one board its number back.
    Repair {
        /// Board number.
        board: u8,
        /// The flash number that the board at this position must have.
        flash_number: u16,
        /// See above.
        force: bool,
    },
    /// PC_INFO; changes nothing.
    Info {
        /// The board.
        board: u8,
    },
    /// PC_SETSTATUS with read-back.
    SetStatus {
        /// The board.
        board: u8,
        /// Bits to change.
        mask: Status,
        /// Their values; bits outside the mask are not sent.
        value: Status,
        /// See above.
        force: bool,
    },
    /// Sends one PC_SETSTATUS exactly by the formula, value bits outside the mask included; never repeated.
    RawStatus {
        /// The board to send it to; `None`: all boards at once.
        board: Option<u8>,
        /// Boards to read before and after.
        seen: Vec<u8>,
        /// First byte.
        mask: u8,
        /// Second byte.
        value: u8,
        /// See above; with `force` also although control loops run.
        force: bool,
    },
    /// PC_RESET.
    Reset {
        /// The board; `None`: all.
        board: Option<u8>,
        /// See above.
        force: bool,
    },
    /// PC_XRESET until the exloader runs with programming enabled.
    XReset {
        /// The board.
        board: u8,
        /// See above.
        force: bool,
    },
    /// PC_START until the application is up.
    Start {
        /// The board.
        board: u8,
        /// See above.
        force: bool,
    },
    /// Stops a board in the reverse order of the start.
    Stop {
        /// The board.
        board: u8,
        /// Level of the stop.
        level: StopLevel,
        /// See above.
        force: bool,
    },
    /// Flags of a board, read, changed and written.
    Admin {
        /// The board.
        board: u8,
        /// Change.
        change: AdminChange,
        /// See above.
        force: bool,
    },
    /// Updates the firmware of boards.
    Update(UpdateOptions),
    /// Descriptions of inputs, outputs and parameters; changes nothing.
    Describe {
        /// The board.
        board: u8,
        /// `true` to read it again although it is known.
        fresh: bool,
    },
    /// MCA_DUMP_CI; changes nothing.
    InitialInputs {
        /// The board.
        board: u8,
    },
    /// Runs boards: all steps to a running control loop.
    Run(RunOptions),
    /// Measures properties in which a board differs from the profile.
    Probe(ProbeOptions),
    /// Tests that boards follow the protocol page.
    Conformance(ConformanceOptions),
}

impl Request {
    /// Returns the name of the request.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Init(_) => "init",
            Self::Repair { .. } => "repair",
            Self::Info { .. } => "info",
            Self::SetStatus { .. } | Self::RawStatus { .. } => "status",
            Self::Reset { .. } => "reset",
            Self::XReset { .. } => "xreset",
            Self::Start { .. } => "start",
            Self::Stop { .. } => "stop",
            Self::Admin { .. } => "admin",
            Self::Update(_) => "update",
            Self::Describe { .. } => "io",
            Self::InitialInputs { .. } => "ci",
            Self::Run(_) => "run",
            Self::Probe(_) => "probe",
            Self::Conformance(_) => "conformance",
        }
    }

    /// Returns `true` if two boards with one number do not end the request. A stop stops both boards and must not wait. The other
    /// requests detect such boards themselves and report more.
    pub(crate) fn bears_shared_numbers(&self) -> bool {
        match self {
            Self::Stop { .. } | Self::Scan | Self::Init(_) | Self::Repair { .. } => true,
            Self::Admin { change, .. } => change.only_ends(),
            _ => false,
        }
    }

    /// Returns the boards that the request works with, by bit. Only one procedure at a time works with a board.
    pub(crate) fn claims(&self) -> u32 {
        let one = |board: &u8| 1_u32.checked_shl((*board).into()).unwrap_or(0);
        match self {
            Self::Scan | Self::Init(_) | Self::Reset { board: None, .. } | Self::Probe(_) => u32::MAX,
            Self::RawStatus { .. } | Self::Conformance(_) => u32::MAX,
            // The broadcast of a group reaches all boards, and program data must not coincide with the start of another board.
            Self::Update(_) => u32::MAX,
            Self::Repair { board, .. }
            | Self::Info { board }
            | Self::SetStatus { board, .. }
            | Self::Reset { board: Some(board), .. }
            | Self::XReset { board, .. }
            | Self::Start { board, .. }
            | Self::Stop { board, .. }
            | Self::Admin { board, .. }
            | Self::Describe { board, .. }
            | Self::InitialInputs { board } => one(board),
            Self::Run(options) => options.boards.iter().fold(0, |mask, b| mask | one(&b.board)),
        }
    }
}

/// Outcome of a procedure.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outcome {
    /// Outcome of [`Request::Scan`].
    Scan(ScanReport),
    /// Outcome of [`Request::Init`]; see [`InitReport::findings`].
    Init(InitReport),
    /// Outcome of [`Request::Repair`].
    Repaired(BoardSeen),
    /// Outcome of [`Request::Info`].
    Info(BoardSeen),
    /// Outcome of [`Request::SetStatus`], [`Request::XReset`] and [`Request::Stop`].
    Status {
        /// The board.
        board: u8,
        /// Board info as read back.
        info: BoardInfo,
    },
    /// Outcome of [`Request::Reset`].
    Reset(Reports),
    /// Outcome of [`Request::Start`].
    Started(BoardSeen),
    /// Outcome of [`Request::Admin`].
    Admin {
        /// The board.
        board: u8,
        /// Present flags.
        admin: Admin,
    },
    /// Outcome of [`Request::Update`]; see each board's result.
    Update(UpdateReport),
    /// Outcome of [`Request::Describe`].
    Description {
        /// The board.
        board: u8,
        /// Description.
        description: IoDescription,
    },
    /// Outcome of [`Request::InitialInputs`].
    InitialInputs {
        /// The board.
        board: u8,
        /// The words.
        values: Vec<u16>,
    },
    /// Outcome of [`Request::Run`].
    Running(RunReport),
    /// Outcome of [`Request::Probe`].
    Probe(ProbeReport),
    /// Outcome of [`Request::RawStatus`].
    RawStatus(Vec<RawStatus>),
    /// Outcome of [`Request::Conformance`]; see each verdict, and the error that ended the tests.
    Conformance(ConformanceReport),
}
