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

/// Identifier of a running procedure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ProcedureId(pub(crate) u64);

/// Request that starts a procedure of the master. With `force`, the procedure runs even if another PC is on the bus or if another check
/// would refuse it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Request {
    /// Lists the boards on the bus. This request does not change any board.
    Scan,
    /// Assigns numbers to all boards of the chain.
    Init(InitOptions),
    /// Assigns a lost number to one board again.
    Repair {
        /// Board number.
        board: u8,
        /// Flash number that the board at this position must have.
        flash_number: u16,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Sends PC_INFO to a board. This request does not change any board.
    Info {
        /// Board number.
        board: u8,
    },
    /// Sends PC_SETSTATUS to a board and reads the status back.
    SetStatus {
        /// Board number.
        board: u8,
        /// Status bits to change.
        mask: Status,
        /// Requested values of the status bits in the mask. The PC does not send the bits outside the mask.
        value: Status,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Sends one PC_SETSTATUS exactly as the formula `new = (old & ~mask) | value` defines it, including value bits
    /// outside the mask. The master never repeats this command.
    RawStatus {
        /// Number of the board that gets the command; `None` for a broadcast to all boards.
        board: Option<u8>,
        /// Boards whose status is read before and after the command.
        seen: Vec<u8>,
        /// First byte of PC_SETSTATUS.
        mask: u8,
        /// Second byte of PC_SETSTATUS.
        value: u8,
        /// Permission to continue although a check would refuse the request, see [`Request`]. With `force`, the command is sent even if
        /// control loops run.
        force: bool,
    },
    /// Sends PC_RESET to one board or to all boards.
    Reset {
        /// Number of the board that gets the command; `None` for all boards.
        board: Option<u8>,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Sends PC_XRESET to a board until the exloader runs with programming enabled.
    XReset {
        /// Board number.
        board: u8,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Sends PC_START to a board until the application runs.
    Start {
        /// Board number.
        board: u8,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Stops a board in the reverse order of the start.
    Stop {
        /// Board number.
        board: u8,
        /// Level at which the stop ends.
        level: StopLevel,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Reads the flags of a board, changes them and writes them.
    Admin {
        /// Board number.
        board: u8,
        /// Change to the flags.
        change: AdminChange,
        /// Permission to continue although a check would refuse the request, see [`Request`].
        force: bool,
    },
    /// Updates the firmware of boards.
    Update(UpdateOptions),
    /// Reads the descriptions of a board's inputs, outputs and parameters. This request does not change any board.
    Describe {
        /// Board number.
        board: u8,
        /// `true` to read the description again even if the description is already known.
        fresh: bool,
    },
    /// Reads the initial inputs of a board with MCA_DUMP_CI. This request does not change any board.
    InitialInputs {
        /// Board number.
        board: u8,
    },
    /// Starts the control loops of boards with all steps that this needs.
    Run(RunOptions),
    /// Measures properties in which a board may differ from the profile.
    Probe(ProbeOptions),
    /// Tests that boards behave as the protocol page describes.
    Conformance(ConformanceOptions),
}

impl Request {
    /// Returns the name of the request for messages.
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

    /// Returns `true` if the request continues when two boards have the same number. A stop, and a change of flags
    /// that only ends motion, must not wait, and both boards receive the command. A scan, an init and a repair detect
    /// boards with the same number themselves and report them in more detail.
    pub(crate) fn bears_shared_numbers(&self) -> bool {
        match self {
            Self::Stop { .. } | Self::Scan | Self::Init(_) | Self::Repair { .. } => true,
            Self::Admin { change, .. } => change.only_ends(),
            _ => false,
        }
    }

    /// Returns the boards that the request works with. Each bit is a board. Only one procedure at a time can work with a board.
    pub(crate) fn claims(&self) -> u32 {
        let one = |board: &u8| 1_u32.checked_shl((*board).into()).unwrap_or(0);
        match self {
            Self::Scan | Self::Init(_) | Self::Reset { board: None, .. } | Self::Probe(_) => u32::MAX,
            Self::RawStatus { .. } | Self::Conformance(_) => u32::MAX,
            // The broadcast of a group update reaches all boards, and no other board may be started while the PC sends program data.
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
        /// Board number.
        board: u8,
        /// Answer to PC_INFO after the change.
        info: BoardInfo,
    },
    /// Outcome of [`Request::Reset`].
    Reset(Reports),
    /// Outcome of [`Request::Start`].
    Started(BoardSeen),
    /// Outcome of [`Request::Admin`].
    Admin {
        /// Board number.
        board: u8,
        /// Flags of the board after the change.
        admin: Admin,
    },
    /// Outcome of [`Request::Update`], with a result for each board.
    Update(UpdateReport),
    /// Outcome of [`Request::Describe`].
    Description {
        /// Board number.
        board: u8,
        /// Description of the board's inputs, outputs and parameters.
        description: IoDescription,
    },
    /// Outcome of [`Request::InitialInputs`].
    InitialInputs {
        /// Board number.
        board: u8,
        /// Initial values of the inputs, in the order of the buffer.
        values: Vec<u16>,
    },
    /// Outcome of [`Request::Run`].
    Running(RunReport),
    /// Outcome of [`Request::Probe`].
    Probe(ProbeReport),
    /// Outcome of [`Request::RawStatus`].
    RawStatus(Vec<RawStatus>),
    /// Outcome of [`Request::Conformance`], with the results of the tests and the error that ended them early.
    Conformance(ConformanceReport),
}
