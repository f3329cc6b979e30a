//! How an update ended, named, with the exit code of the command.

use std::prelude::v1::*;

use serde::Serialize;

use crate::ErrorCode;
use crate::master::Error;

/// How far a board got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateOutcome {
    /// Nothing was erased: the board has what it had.
    #[default]
    NotStarted,
    /// The image was there already (U-3); nothing was sent.
    UpToDate,
    /// Something was erased and no image is complete: the board stays in its exloader and can be programmed again.
    Incomplete,
    /// The board says it is written, but PC_INFO did not confirm the new Program ID and date.
    Written,
    /// PC_INFO shows the new Program ID and date (U-10).
    Verified,
    /// Verified, and the application runs.
    Running,
}

impl UpdateOutcome {
    /// The name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotStarted => "not-started",
            Self::UpToDate => "up-to-date",
            Self::Incomplete => "incomplete",
            Self::Written => "written",
            Self::Verified => "verified",
            Self::Running => "running",
        }
    }

    /// The board has the image.
    pub const fn is_done(self) -> bool {
        matches!(self, Self::UpToDate | Self::Verified | Self::Running)
    }
}

/// Why a board was not updated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UpdateFailure {
    /// A check refused it; nothing was sent to the board but questions.
    #[error("{0}")]
    Refused(Box<Error>),
    /// No answer before anything was erased.
    #[error("{0}")]
    NoAnswer(Box<Error>),
    /// The board reported an error.
    #[error("{code} in cycle {cycle}, block {block}, after {attempts} attempts: {}", code.meaning())]
    Device {
        /// The code.
        code: ErrorCode,
        /// 1 or 2.
        cycle: u32,
        /// From 0, the header's block.
        block: usize,
        /// How many.
        attempts: u32,
        /// Something was erased.
        erased: bool,
    },
    /// The board did not take a block in time.
    #[error(
        "no DSP_READY for block {block} of cycle {cycle} within {waited_ms} ms, after {attempts} attempts"
    )]
    Timeout {
        /// 1 or 2.
        cycle: u32,
        /// From 0, the header's block.
        block: usize,
        /// How long was waited, ms.
        waited_ms: u64,
        /// How many.
        attempts: u32,
        /// Something was erased.
        erased: bool,
    },
    /// DSP_PROGFINISHED came, or should have, and the board shows another program.
    #[error(
        "the board shows Program ID 0x{program_id:04X}, date 0x{date:04X} instead of 0x{wanted_id:04X}, 0x{wanted_date:04X}"
    )]
    NotVerified {
        /// On the board.
        program_id: u16,
        /// On the board.
        date: u16,
        /// Of the image.
        wanted_id: u16,
        /// Of the image.
        wanted_date: u16,
    },
    /// The image is written and verified, but the application did not start.
    #[error("verified, but: {0}")]
    NotRunning(Box<Error>),
    /// A step after something was erased failed.
    #[error("{0}")]
    After(Box<Error>),
    /// The user ended it.
    #[error("cancelled{}", if *erased { "; the old application is erased, the board waits in its exloader" } else { "; the old application is untouched" })]
    Cancelled {
        /// Something was erased.
        erased: bool,
    },
    /// Another board of the list failed before its turn came.
    #[error("not begun: board {after} failed before")]
    Skipped {
        /// The one that failed.
        after: u8,
    },
}

impl UpdateFailure {
    /// Exit code of the command: 1 the board reported an error before anything was erased, 3 no answer, 4 refused, 5
    /// failed or cancelled after something was erased.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Refused(e) => match e.exit_code() {
                2 => 2,
                3 => 3,
                _ => 4,
            },
            Self::NoAnswer(_) | Self::Timeout { erased: false, .. } => 3,
            Self::Device { erased: false, .. } => 1,
            Self::Device { .. }
            | Self::Timeout { .. }
            | Self::NotVerified { .. }
            | Self::NotRunning(_)
            | Self::After(_)
            | Self::Cancelled { .. } => 5,
            Self::Skipped { .. } => 4,
        }
    }

    /// A short name for programs.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Refused(e) | Self::NoAnswer(e) | Self::After(e) => e.code(),
            Self::Device { .. } => "device-error",
            Self::Timeout { .. } => "timeout",
            Self::NotVerified { .. } => "not-verified",
            Self::NotRunning(_) => "not-running",
            Self::Cancelled { .. } => "cancelled",
            Self::Skipped { .. } => "skipped",
        }
    }

    /// The likely cause and what helps.
    pub fn hint(&self) -> String {
        match self {
            Self::Refused(e) | Self::NoAnswer(e) | Self::NotRunning(e) | Self::After(e) => e.hint(),
            Self::Device { code, .. } => code.reaction().into(),
            Self::Timeout { .. } => {
                "frames get lost or the board is slower than the profile says (`prog.ready_timeout`): `ucom doctor`".into()
            }
            Self::NotVerified { .. } => {
                "the board may compute its Program ID otherwise (`prog.checksum`): `ucom probe --image FILE`".into()
            }
            Self::Cancelled { erased: true } => "run the update again to get an application back".into(),
            Self::Cancelled { erased: false } | Self::Skipped { .. } => {
                "run the update again: boards that are done are skipped".into()
            }
        }
    }
}

/// What became of one board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateResult {
    /// Its number.
    pub board: u8,
    /// Its flash number, when it answered.
    pub flash_number: Option<u16>,
    /// How far it got.
    pub outcome: UpdateOutcome,
    /// Attempts that were made.
    pub attempts: u32,
    /// Why it failed.
    pub failure: Option<UpdateFailure>,
    /// From XRESET to the last answer, µs.
    pub time_us: u64,
}

impl UpdateResult {
    pub(crate) fn new(board: u8) -> Self {
        Self {
            board,
            flash_number: None,
            outcome: UpdateOutcome::NotStarted,
            attempts: 0,
            failure: None,
            time_us: 0,
        }
    }
}

/// What became of all boards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UpdateReport {
    /// In the order of the list.
    pub boards: Vec<UpdateResult>,
    /// Nothing was sent but questions.
    pub dry_run: bool,
    /// Program ID of the image; `None`: hidden in a raw image.
    pub program_id: Option<u16>,
    /// Flash date of the image.
    pub date: u16,
    /// Bytes of both cycles.
    pub bytes: u64,
}

impl UpdateReport {
    /// Exit code of the command: that of the worst board (5, then 3, 1, 4, 2).
    pub fn exit_code(&self) -> u8 {
        let codes = self.boards.iter().filter_map(|b| b.failure.as_ref()).map(UpdateFailure::exit_code);
        let rank = |code: &u8| [0, 2, 4, 1, 3, 5].iter().position(|c| c == code);
        codes.max_by_key(rank).unwrap_or(0)
    }
}

/// How far an update is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// The boards that get the image now.
    pub boards: Vec<u8>,
    /// 1 to `prog.attempts`.
    pub attempt: u32,
    /// 1 or 2.
    pub cycle: u32,
    /// Bytes of both cycles that were taken in this attempt.
    pub bytes: u64,
    /// Bytes of both cycles.
    pub total: u64,
    /// Bytes per second so far.
    pub rate: u64,
    /// Remaining time at that rate, µs.
    pub remaining_us: u64,
}
