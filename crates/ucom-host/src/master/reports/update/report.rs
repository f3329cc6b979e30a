//! Results of an update, and the kind of its failure.
use crate::date_text;
use crate::master::reports::update::failure::UpdateFailure;
use crate::master::reports::update::outcome::UpdateOutcome;
use crate::master::reports::update::plan::{PlannedImage, Unverifiable, has_header};
use host_kit::{Diagnose, ErrorKind};
use ucom::{BoardInfo, Profile};

/// Result of the update of one board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UpdateResult {
    /// Board number.
    pub board: u8,
    /// Flash number of the board; `None` if the board did not answer.
    pub flash_number: Option<u16>,
    /// Answer to PC_INFO before the update.
    pub before: Option<BoardInfo>,
    /// Answer to PC_INFO after the board reported the end of the update.
    pub after: Option<BoardInfo>,
    /// Outcome of the update.
    pub outcome: UpdateOutcome,
    /// `true` if PC_INFO returns the Program ID and date of the image, and this tool has written exactly this image
    /// to this address. The tool has written it in this update, or in an earlier update that the flash record
    /// describes.
    pub verified: bool,
    /// Number of attempts to update the board.
    pub attempts: u32,
    /// Reason of the failure; `None` if the update succeeded.
    pub failure: Option<UpdateFailure>,
    /// Time from the XRESET to the last answer of the board, µs.
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
            verified: false,
            attempts: 0,
            failure: None,
            time_us: 0,
        }
    }
}

/// Results of an update for all boards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UpdateReport {
    /// Results in the order of the boards in the options.
    pub boards: Vec<UpdateResult>,
    /// `true` if the PC sent only queries.
    pub dry_run: bool,
    /// Program ID that the boards must report; `None` if the ID is not known.
    pub program_id: Option<u16>,
    /// Reason why this Program ID is not known, so that the written program cannot be verified.
    pub unverifiable: Option<Unverifiable>,
    /// `true` if the options accept programs that were written but not verified.
    pub accept_unverified: bool,
    /// Images that were sent, the main image first.
    pub images: Vec<PlannedImage>,
    /// Flash date of the image.
    pub date: u16,
    /// Number of bytes that the PC sends in both cycles.
    pub bytes: u64,
}

impl UpdateReport {
    /// Returns the most serious kind of failure of all boards. The function returns `None` if the update succeeded.
    pub fn failure(&self) -> Option<ErrorKind> {
        let kinds = self.boards.iter().filter_map(|b| b.failure.as_ref()).map(UpdateFailure::kind);
        let unproven = self.boards.iter().filter(|b| !self.accept_unverified && b.failure.is_none());
        let unproven = unproven.filter_map(|b| match b.outcome {
            UpdateOutcome::ProgramUpToDate => Some(ErrorKind::Refused),
            UpdateOutcome::Written | UpdateOutcome::Running if !b.verified => Some(ErrorKind::Fault),
            _ => None,
        });
        kinds.chain(unproven).max()
    }

    /// Returns the final message and the remedy for an update that had no failure but did not verify a program.
    pub fn unproven(&self) -> (String, &'static str) {
        let is_shown = |b: &&UpdateResult| b.outcome == UpdateOutcome::ProgramUpToDate;
        let boards: Vec<String> = self.boards.iter().filter(is_shown).map(|b| b.board.to_string()).collect();
        if boards.is_empty() {
            let next = self.unverifiable.map_or("", |why| why.hint());
            return ("the written program could not be verified".into(), next);
        }
        let message = format!(
            "nothing was sent: board {} shows this program, but content and load address are not verified",
            boards.join(", ")
        );
        (message, "`rewrite` writes it")
    }

    /// Returns the flash date of a board that already has the program, if this date differs from the date of the image.
    fn flashed(&self, result: &UpdateResult, profile: &Profile) -> Option<String> {
        let before = result.before.filter(|before| has_header(profile) && before.date != self.date)?;
        let is_shown = matches!(result.outcome, UpdateOutcome::UpToDate | UpdateOutcome::ProgramUpToDate);
        is_shown.then(|| format!("flashed {}", date_text(profile, before.date)))
    }

    /// Returns the outcome of a board in words. If the board keeps another date, the text contains the date, as in
    /// `up-to-date (flashed 2026-11-25)` (U-3).
    pub fn outcome_words(&self, result: &UpdateResult, profile: &Profile) -> String {
        let name = result.outcome.name();
        self.flashed(result, profile).map_or_else(|| name.into(), |flashed| format!("{name} ({flashed})"))
    }

    /// Returns the evidence that a board already has the program; returns `None` for boards that did not have the program before.
    pub fn shown_already(&self, result: &UpdateResult, profile: &Profile) -> Option<String> {
        let same = match self.flashed(result, profile) {
            Some(flashed) => format!("same Program ID, {flashed}"),
            None => "same Program ID and date".into(),
        };
        match result.outcome {
            UpdateOutcome::UpToDate => Some(same),
            UpdateOutcome::ProgramUpToDate => Some(format!("{same}; content and address not verified")),
            _ => None,
        }
    }
}

/// Progress of an update.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Boards that receive the image now.
    pub boards: Vec<u8>,
    /// Number of the attempt, from 1 to `prog.attempts`.
    pub attempt: u32,
    /// Number of the cycle, 1 or 2.
    pub cycle: u32,
    /// Number of bytes, of both cycles, that the boards have confirmed in this attempt.
    pub bytes: u64,
    /// Number of bytes that the PC sends in both cycles.
    pub total: u64,
    /// Average transfer rate so far, in bytes per second.
    pub rate: u64,
    /// Estimated remaining time at this rate, µs.
    pub remaining_us: u64,
}
