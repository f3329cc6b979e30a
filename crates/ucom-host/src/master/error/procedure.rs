//! What can go wrong in a procedure, with the facts in it, the kind of failure and the command that helps.
use crate::master::error::answer::{Incomplete, LastReceived, Received};
use crate::master::error::plan::PlanError;
use crate::master::error::words::{Boards, Near, Sharing, other_order};
use crate::master::load::LoadForecast;
use ucom::profile::Endian;
use ucom::{ErrorCode, Function, Status};

/// Why a procedure did not do what was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A board did not answer.
    #[error("board {board} does not answer {} ({tries} tries, {waited_ms} ms; {})", asked.name(), Received(*last))]
    NoAnswer {
        /// Its number.
        board: u8,
        /// What was asked.
        asked: Function,
        /// How often.
        tries: u32,
        /// Time from the first request to giving up, ms.
        waited_ms: u64,
        /// What was last received from it.
        last: Option<LastReceived>,
    },
    /// An answer never came whole.
    #[error("board {board}: the answer to {} never came whole ({tries} tries): {problem}", asked.name())]
    Incomplete {
        /// Its number.
        board: u8,
        /// What was asked.
        asked: Function,
        /// How often.
        tries: u32,
        /// What was wrong with the last one.
        problem: Incomplete,
    },
    /// Answers of a board contradict each other.
    #[error(
        "board {board}: its answers to PC_INFO contradict each other in {tries} tries (two boards with one number?)"
    )]
    Contradiction {
        /// Its number.
        board: u8,
        /// How often it was asked.
        tries: u32,
    },
    /// The board reported an error.
    #[error("board {board} reports {code} during {during}: {}", code.meaning())]
    Device {
        /// Its number.
        board: u8,
        /// The code.
        code: ErrorCode,
        /// What was going on.
        during: &'static str,
    },
    /// Acknowledge of PC_INIT under one number with another in it (D-24).
    #[error("DSP_INITACK under number {id} contains number {data}: the board is refused")]
    AckMismatch {
        /// By the identifier.
        id: u8,
        /// By the data.
        data: u8,
    },
    /// DSP_INFO under one number with another in it.
    #[error("board {board} reports that its number is {reported}: it is refused")]
    WrongSequence {
        /// By the identifier.
        board: u8,
        /// By the data.
        reported: u8,
    },
    /// Another board than the one that was named.
    #[error("board {board} has flash number 0x{found:04X}, not 0x{wanted:04X}")]
    WrongBoard {
        /// Its number.
        board: u8,
        /// The flash number that was named.
        wanted: u16,
        /// The one it has.
        found: u16,
    },
    /// The flash numbers of boards fit their reports only with their bytes exchanged (D-10).
    #[error("{}", other_order(*endian))]
    ByteOrder {
        /// The order that the profile has.
        endian: Endian,
    },
    /// Two boards have one number: both carry out every command to it.
    #[error(
        "two boards answer to number {board}: {}{}",
        Sharing(found),
        if *given_back { "; it was taken back from both" } else { "" }
    )]
    NumberShared {
        /// The number.
        board: u8,
        /// The flash numbers of those that answered to it; twice the same one when they cannot be distinguished.
        found: Vec<u16>,
        /// Nobody answers to it any more.
        given_back: bool,
    },
    /// Giving a number could give it to the first board of the chain.
    #[error("board {other} does not answer: without a number it would take number {board}")]
    MayTakeNumber {
        /// The number that was to be given.
        board: u8,
        /// The first board.
        other: u8,
    },
    /// A status was set and is not what was set.
    #[error(
        "board {board}: status is {} after {tries} tries, wanted {} of the bits {}",
        status,
        wanted,
        mask
    )]
    StatusNotTaken {
        /// Its number.
        board: u8,
        /// Bits that were to change.
        mask: Status,
        /// What they were to be.
        wanted: Status,
        /// The status that was read.
        status: Status,
        /// How often it was set.
        tries: u32,
    },
    /// A state was not reached.
    #[error("board {board}: {what} not within {waited_ms} ms; status {status}")]
    NotReached {
        /// Its number.
        board: u8,
        /// What was waited for.
        what: &'static str,
        /// How long, ms.
        waited_ms: u64,
        /// The last status.
        status: Status,
    },
    /// Flags were sent and others came back.
    #[error("board {board} answers MCA_ADMIN_DATA with `{is}` instead of `{wanted}`")]
    AdminRefused {
        /// Its number.
        board: u8,
        /// What was sent.
        wanted: ucom::Admin,
        /// Its text.
        is: ucom::Admin,
    },
    /// A competing master: another PC is on the bus (D-08).
    #[error("another PC is on the bus: {} to {to} was received {ago_ms} ms ago", function.name())]
    CompetingMaster {
        /// What it sent.
        function: Function,
        /// To which number.
        to: u8,
        /// When, ms.
        ago_ms: u64,
    },
    /// Boards run their control loop.
    #[error("{} running: program data would outrank their process data", Boards(boards))]
    Running {
        /// Their numbers.
        boards: Vec<u8>,
    },
    /// Control loops run, and what was asked for could stop them where they are, or worse.
    #[error("{} running its control loop", Boards(boards))]
    LoopRuns {
        /// Their numbers.
        boards: Vec<u8>,
    },
    /// The boards that report are not those that have a number: a new address assignment would mean other boards than before.
    #[error(
        "boards that report: {reports}, with a number: {boards}, or two share a flash id: not as `ucom init` leaves a chain"
    )]
    NotNumbered {
        /// Different reports.
        reports: u32,
        /// Boards with a number.
        boards: u32,
    },
    /// The bus would be too busy.
    #[error("{0}")]
    Load(LoadForecast),
    /// The procedure needs a board that is at work for another one.
    #[error("{} busy with {with}", Boards(boards))]
    Busy {
        /// The boards.
        boards: Vec<u8>,
        /// The other procedure.
        with: &'static str,
    },
    /// A number that no board has.
    #[error("{number} is no board number (1 to 31, and {first} is the first here)")]
    NoBoard {
        /// The number.
        number: u8,
        /// `addr.first`.
        first: u32,
    },
    /// No application is on the board, or it is not started.
    #[error("board {board}: {}", if *valid { "its application is not started" } else { "it has no valid application" })]
    NoApplication {
        /// Its number.
        board: u8,
        /// It has one, but it is not running.
        valid: bool,
    },
    /// No signal of that name.
    #[error("board {board} has no {kind} `{name}`{}", Near(near))]
    NoSignal {
        /// Its number.
        board: u8,
        /// `CI`, `SO` or `PAR`.
        kind: &'static str,
        /// What was asked for.
        name: String,
        /// Names like it.
        near: Vec<String>,
    },
    /// A board describes itself otherwise than was known when values for it were chosen (D-36).
    #[error(
        "board {board}: its inputs, outputs and parameters are not those that were known under its program"
    )]
    StaleNames {
        /// Its number.
        board: u8,
    },
    /// The board's image or plan cannot be sent.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// A board that was being started, or had been, is gone; by `on_lost` all were stopped (D-51).
    #[error("board {board} was lost while boards were started: all are stopped")]
    Lost {
        /// Its number.
        board: u8,
    },
    /// The caller reports that the bus is gone, see [`Master::abandon`](crate::master::Master::abandon).
    #[error("the bus failed: {reason}")]
    Bus {
        /// The driver's error.
        reason: String,
    },
    /// The caller asked to end.
    #[error("cancelled")]
    Cancelled,
}
