//! How an update ended, named, with the kind of failure.
use crate::master::reports::update::failure::UpdateFailure;
use crate::master::reports::update::outcome::UpdateOutcome;
use crate::master::reports::update::plan::{PlannedImage, Unverifiable};
use host_kit::{Diagnose, ErrorKind};
use ucom::BoardInfo;

/// What became of one board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateResult {
    /// Its number.
    pub board: u8,
    /// Its flash number, when it answered.
    pub flash_number: Option<u16>,
    /// What PC_INFO showed before.
    pub before: Option<BoardInfo>,
    /// What PC_INFO showed after the board reported that it is done.
    pub after: Option<BoardInfo>,
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
            before: None,
            after: None,
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
    /// Program ID that the boards shall show; `None`: nobody knows it.
    pub program_id: Option<u16>,
    /// Why nobody knows it: what was written could not be verified then.
    pub unverifiable: Option<Unverifiable>,
    /// What was written and could not be verified counts as done.
    pub accept_unverified: bool,
    /// What was sent, the image first.
    pub images: Vec<PlannedImage>,
    /// Flash date of the image.
    pub date: u16,
    /// Bytes of both cycles.
    pub bytes: u64,
}

impl UpdateReport {
    /// What kind of failure it is: the gravest of any board. `None`: all is done.
    pub fn failure(&self) -> Option<ErrorKind> {
        let kinds = self.boards.iter().filter_map(|b| b.failure.as_ref()).map(UpdateFailure::kind);
        // Done by the board's report, which nothing can confirm.
        let trusted = |b: &&UpdateResult| {
            let done = matches!(b.outcome, UpdateOutcome::Written | UpdateOutcome::Running);
            self.unverifiable.is_some() && !self.accept_unverified && done && b.failure.is_none()
        };
        kinds.chain(self.boards.iter().filter(trusted).map(|_| ErrorKind::Fault)).max()
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
