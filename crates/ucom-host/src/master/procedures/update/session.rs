//! State of all boards of an update; the state is kept if the update is cancelled or the bus fails.

use crate::master::engine::Link;
use crate::master::error::Error;
use crate::master::reports::update::{UpdateFailure, UpdateOptions, UpdateOutcome, UpdatePlan, UpdateResult};
use host_kit::{Diagnose, ErrorKind};
use std::collections::BTreeMap;
use ucom::{BoardInfo, Header};

/// Extent to which a board's memory has changed. The stage of a board only increases, except in [`UpdateSession::proved_untouched`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    /// The memory of the board is unchanged.
    #[default]
    Untouched,
    /// Frames that erase the memory were sent, and the board may have received these frames.
    MaybeErased,
    /// The PC commanded the board to erase its memory.
    Erased,
    /// The board reported that the program is written.
    Written,
    /// The board's answer to PC_INFO contained the new program.
    Verified,
}

/// State of all boards of an update.
pub(super) struct UpdateSession {
    pub options: UpdateOptions,
    pub results: Vec<UpdateResult>,
    /// Boards to which an XRESET was sent and whose update has not ended.
    pub active: Vec<u8>,
    /// Board whose application the update is starting.
    pub starting: Option<u8>,
    /// Boards that already report the program and will be started at the end.
    pub to_start: Vec<u8>,
    /// Boards that already report the program and are in programming mode.
    pub programming: Vec<u8>,
    stages: BTreeMap<u8, Stage>,
}

impl UpdateSession {
    pub(super) fn new(options: UpdateOptions) -> Self {
        let results = options.targets.iter().map(|t| UpdateResult::new(t.board)).collect();
        let (active, to_start, programming) = (Vec::new(), Vec::new(), Vec::new());
        Self { options, results, active, starting: None, to_start, programming, stages: BTreeMap::new() }
    }

    pub(super) fn result(&mut self, board: u8) -> Option<&mut UpdateResult> {
        self.results.iter_mut().find(|r| r.board == board)
    }

    /// Marks the update of the board as in progress. The updates of other boards in the same group may be in progress as well.
    pub(super) fn begin(&mut self, board: u8) {
        if !self.active.contains(&board) {
            self.active.push(board);
        }
    }

    pub(super) fn stage(&self, board: u8) -> Stage {
        self.stages.get(&board).copied().unwrap_or_default()
    }

    /// Returns `true` if the old application of the board is, or may be, completely or partly erased.
    pub(super) fn may_be_erased(&self, board: u8) -> bool {
        self.stage(board) > Stage::Untouched
    }

    pub(super) fn reach(&mut self, board: u8, stage: Stage) {
        let known = self.stages.entry(board).or_default();
        *known = stage.max(*known);
    }

    /// Records that PC_INFO returns the same program as before the update. The frames that could have erased the memory of the board
    /// therefore had no effect.
    pub(super) fn proved_untouched(&mut self, board: u8) {
        if self.stage(board) == Stage::MaybeErased {
            self.stages.remove(&board);
        }
    }

    /// Records that the board reports the program and that this tool has written the program.
    pub(super) fn prove(&mut self, board: u8) {
        if let Some(result) = self.result(board) {
            result.verified = true;
        }
    }

    fn is_proven(&self, board: u8) -> bool {
        self.results.iter().any(|r| r.board == board && r.verified)
    }

    pub(super) fn end(&mut self, board: u8, outcome: UpdateOutcome, failure: Option<UpdateFailure>) {
        self.active.retain(|b| *b != board);
        if let Some(result) = self.result(board) {
            result.outcome = outcome;
            result.failure = failure;
        }
    }

    /// Records a failure of a board. The outcome is derived from the change of the board's memory so far.
    pub(super) fn fail(&mut self, board: u8, failure: UpdateFailure) {
        let outcome = match self.stage(board) {
            Stage::Untouched if matches!(failure, UpdateFailure::Cancelled { .. }) => {
                UpdateOutcome::Cancelled
            }
            Stage::Untouched => UpdateOutcome::NotStarted,
            Stage::MaybeErased => UpdateOutcome::Unknown,
            Stage::Erased => UpdateOutcome::Incomplete,
            Stage::Written => UpdateOutcome::Written,
            Stage::Verified if self.is_proven(board) => UpdateOutcome::Verified,
            Stage::Verified => UpdateOutcome::ProgramUpToDate,
        };
        self.end(board, outcome, Some(failure));
    }

    /// Records an error that occurred in a step of the update. The kind of failure depends on the state of the board's memory.
    pub(super) fn fail_with(&mut self, board: u8, error: Error) {
        let (kind, error) = (error.kind(), Box::new(error));
        let failure = match self.stage(board) {
            Stage::Untouched => match kind {
                ErrorKind::Refused => UpdateFailure::Refused(error),
                ErrorKind::Device => UpdateFailure::Reported(error),
                ErrorKind::Usage | ErrorKind::NoLink | ErrorKind::Fault => UpdateFailure::NoAnswer(error),
            },
            Stage::MaybeErased => UpdateFailure::MayBeErased(error),
            _ => UpdateFailure::After(error),
        };
        self.fail(board, failure);
    }

    /// Records that the user cancelled the update of a board. If a start command was sent to the board, and the board is not known to be
    /// stopped, its application may be running.
    pub(super) fn cancel(&mut self, board: u8) {
        self.fail(board, UpdateFailure::Cancelled { left: UpdateOutcome::Cancelled });
        let started = self.starting == Some(board);
        if let Some(result) = self.result(board) {
            let left = if started { UpdateOutcome::Running } else { result.outcome };
            result.failure = Some(UpdateFailure::Cancelled { left });
        }
    }

    /// Cancels the start of each board whose update is complete except for the start of the application.
    pub(super) fn cancel_starts(&mut self) {
        for board in core::mem::take(&mut self.to_start) {
            let left = self.outcome(board);
            self.end(board, left, Some(UpdateFailure::Cancelled { left }));
        }
    }

    pub(super) fn outcome(&self, board: u8) -> UpdateOutcome {
        self.results.iter().find(|r| r.board == board).map(|r| r.outcome).unwrap_or_default()
    }

    /// Returns the boards whose update has not begun.
    pub(super) fn open(&self) -> Vec<u8> {
        let open = |r: &&UpdateResult| r.failure.is_none() && r.outcome == UpdateOutcome::NotStarted;
        self.results.iter().filter(open).map(|r| r.board).collect()
    }

    /// Refuses the update of all boards whose update has not begun.
    pub(super) fn refuse(&mut self, error: &Error) {
        for board in self.open() {
            self.fail(board, UpdateFailure::Refused(Box::new(error.clone())));
        }
    }

    /// Skips all boards whose update has not begun, because board `after` failed.
    pub(super) fn skip_open(&mut self, after: u8) {
        for board in self.open() {
            self.fail(board, UpdateFailure::Skipped { after });
        }
    }

    /// Returns the boards whose update is in progress or has not begun.
    pub(super) fn unfinished(&self) -> Vec<u8> {
        let mut boards = self.active.clone();
        boards.extend(self.open().iter().filter(|b| !self.active.contains(b)));
        boards
    }

    pub(super) fn flash_number(&self, board: u8) -> Option<u16> {
        self.results.iter().find(|r| r.board == board).and_then(|r| r.flash_number)
    }

    /// Returns the answer of the board to PC_INFO before the update.
    pub(super) fn before(&self, board: u8) -> Option<BoardInfo> {
        self.results.iter().find(|r| r.board == board).and_then(|r| r.before)
    }

    /// Returns the update plan for one board, or for a group of boards.
    pub(super) fn plan(&self, link: &Link, board: Option<u8>) -> Result<UpdatePlan, Error> {
        let named = board.and_then(|b| self.flash_number(b)).filter(|_| self.options.name_target);
        Ok(UpdatePlan::new(&self.options, named.unwrap_or(Header::ANY_BOARD), &link.profile())?)
    }
}
