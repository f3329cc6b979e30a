//! Reasons why a board was not updated, with the facts, the kind of failure and the remedy.
use crate::master::error::Error;
use crate::master::reports::update::outcome::UpdateOutcome;
use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};
use ucom::{ErrorCode, Status};

/// Reasons why a board was not updated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UpdateFailure {
    /// A check refused the update. No memory of the board was erased.
    #[error("{0}")]
    Refused(Box<Error>),
    /// The board did not answer. No memory of the board was erased.
    #[error("{0}")]
    NoAnswer(Box<Error>),
    /// The board answered but did not carry out a request. No memory of the board was erased.
    #[error("{0}")]
    Reported(Box<Error>),
    /// The board reported an error.
    #[error("{code} in cycle {cycle}, block {block}, after {attempts} attempts: {}", code.meaning())]
    Device {
        /// Reported error code.
        code: ErrorCode,
        /// Cycle in which the error occurred, 1 or 2.
        cycle: u32,
        /// Number of the block to which the error belongs. Block 0 of each cycle contains the header.
        block: usize,
        /// Number of attempts to update the board.
        attempts: u32,
        /// `true` if memory of the board was erased.
        erased: bool,
    },
    /// The board did not confirm a block in time.
    #[error(
        "no DSP_READY for block {block} of cycle {cycle} within {waited_ms} ms, after {attempts} attempts"
    )]
    Timeout {
        /// Cycle in which the answer is missing, 1 or 2.
        cycle: u32,
        /// Number of the block that has no answer. Block 0 of each cycle contains the header.
        block: usize,
        /// Time that the PC waited for the answer, ms.
        waited_ms: u64,
        /// Number of attempts to update the board.
        attempts: u32,
        /// `true` if memory of the board was erased.
        erased: bool,
    },
    /// The board reported, or should have reported, that programming is complete, but its answer to PC_INFO contains another program.
    #[error(
        "the board shows Program ID 0x{program_id:04X}, date 0x{date:04X} instead of 0x{wanted_id:04X}{}",
        wanted_date.map_or_else(String::new, |date| format!(", 0x{date:04X}"))
    )]
    NotVerified {
        /// Program ID in the board's answer.
        program_id: u16,
        /// Flash date in the board's answer.
        date: u16,
        /// Program ID of the image.
        wanted_id: u16,
        /// Flash date of the image; `None` if the date is not known.
        wanted_date: Option<u16>,
    },
    /// The board reported that programming is complete, but it is in its exloader and has no valid application.
    #[error(
        "the board reports that programming is complete, but shows no valid application in its exloader: \
         Program ID 0x{program_id:04X}, date 0x{date:04X}, status {status}"
    )]
    NotValid {
        /// Program ID in the board's answer.
        program_id: u16,
        /// Flash date in the board's answer.
        date: u16,
        /// Status of the board.
        status: Status,
    },
    /// The board reports the new program, but the application did not start.
    #[error("the board shows the program, but the start failed: {0}")]
    NotRunning(Box<Error>),
    /// The board already had the program, but it was in programming mode, and the PC could not end this mode.
    #[error("the board already shows the program, but may still be in programming mode: {0}")]
    StillProgramming(Box<Error>),
    /// A step of the update failed after memory of the board was erased.
    #[error("{0}")]
    After(Box<Error>),
    /// The board was removed from the group and does not answer. Frames to the group may have erased the board.
    #[error("the board may be erased, because it could receive frames of the group: {0}")]
    MayBeErased(Box<Error>),
    /// The user cancelled the update.
    #[error("cancelled: {}", left_behind(*left))]
    Cancelled {
        /// State in which the cancel left the board: the outcome of the board, or `Running` if the application may be
        /// running.
        left: UpdateOutcome,
    },
    /// An earlier board of the list failed, so the update of this board was skipped.
    #[error("not started, because the update of board {after} failed")]
    Skipped {
        /// Number of the board that failed.
        after: u8,
    },
}

impl Diagnose for UpdateFailure {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(self.kind_of(), self.name(), self.next())
    }
}

impl UpdateFailure {
    /// Returns the kind of failure of the update. If memory of the board may have been erased, the kind is always a
    /// fault.
    fn kind_of(&self) -> ErrorKind {
        match self {
            Self::Refused(e) | Self::StillProgramming(e) => match e.kind() {
                kind @ (ErrorKind::Usage | ErrorKind::NoLink) => kind,
                ErrorKind::Refused | ErrorKind::Device | ErrorKind::Fault => ErrorKind::Refused,
            },
            Self::NoAnswer(_) | Self::Timeout { erased: false, .. } => ErrorKind::NoLink,
            Self::Device { erased: false, .. } | Self::Reported(_) => ErrorKind::Device,
            Self::Skipped { .. }
            | Self::Cancelled {
                left: UpdateOutcome::Cancelled | UpdateOutcome::UpToDate | UpdateOutcome::ProgramUpToDate,
            } => ErrorKind::Refused,
            Self::Device { .. }
            | Self::Timeout { .. }
            | Self::NotVerified { .. }
            | Self::NotValid { .. }
            | Self::NotRunning(_)
            | Self::After(_)
            | Self::MayBeErased(_)
            | Self::Cancelled { .. } => ErrorKind::Fault,
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Refused(e) | Self::NoAnswer(e) | Self::Reported(e) | Self::After(e) => e.code(),
            Self::MayBeErased(_) => "may-be-erased",
            Self::StillProgramming(_) => "still-programming",
            Self::NotValid { .. } => "not-valid",
            Self::Device { .. } => "device-error",
            Self::Timeout { .. } => "timeout",
            Self::NotVerified { .. } => "not-verified",
            Self::NotRunning(_) => "not-running",
            Self::Cancelled { .. } => "cancelled",
            Self::Skipped { .. } => "skipped",
        }
    }

    fn next(&self) -> Next {
        match self {
            Self::Refused(e) | Self::NoAnswer(e) | Self::Reported(e) | Self::NotRunning(e) => {
                e.diagnosis().next
            }
            Self::StillProgramming(e) => match e.diagnosis().next {
                next if next.is_empty() => "`ucom status N --clear PROG` ends it".into(),
                next => next.then("; `ucom status N --clear PROG` ends it"),
            },
            Self::After(e) => {
                e.diagnosis().next.then("; then run the update again to get an application back")
            }
            Self::MayBeErased(_) => {
                next!("run the update again when the board answers (`ucom repair`, {})", ChainInit)
            }
            Self::NotValid { .. } => {
                "check that the image is for this board, check `prog.plan` in the profile, then run the \
                 update again"
                    .into()
            }
            Self::Device { code, .. } => code.reaction().into(),
            Self::Timeout { .. } => {
                next!(
                    "frames are lost, or the board is slower than `prog.ready_timeout` of the profile: {}",
                    ChainDoctor
                )
            }
            Self::NotVerified { .. } => {
                "the board may compute its Program ID differently (`prog.checksum`): `ucom probe --image \
                 FILE`"
                    .into()
            }
            Self::Cancelled { left: UpdateOutcome::Running } => next!("{} stops it", BoardStop),
            Self::Cancelled { left: UpdateOutcome::Incomplete } => {
                "run the update again to get an application back".into()
            }
            Self::Cancelled { .. } | Self::Skipped { .. } => {
                "run the update again: boards that are done are skipped".into()
            }
        }
    }
}

/// Returns a text about the state of the board after a cancel.
fn left_behind(outcome: UpdateOutcome) -> &'static str {
    match outcome {
        UpdateOutcome::Incomplete => "the old application is erased, the board waits in its exloader",
        UpdateOutcome::Unknown => "the old application may be erased",
        UpdateOutcome::Written => {
            "the board reported that programming is complete, but the result was not read back"
        }
        UpdateOutcome::UpToDate => "the board already had the image, its application was not started",
        UpdateOutcome::ProgramUpToDate => {
            "nothing was sent because the board already shows this program, and the program was not started"
        }
        UpdateOutcome::Running => "the new application is on the board, and it may be started",
        UpdateOutcome::Verified => "the new application is on the board, but not started",
        _ => "nothing was erased, the board is unchanged",
    }
}
