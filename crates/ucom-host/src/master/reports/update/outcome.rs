//! Outcomes of the update of a board.
use serde::Serialize;

/// Outcome of the update of a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateOutcome {
    /// No memory of the board was erased. The state of the board is unchanged.
    #[default]
    NotStarted,
    /// The user cancelled the update before memory of the board was erased. The state of the board is unchanged.
    Cancelled,
    /// The board reports the program, and the flash record has the same image at the same address (U-3, D-62). The PC sent no program data.
    UpToDate,
    /// The board reports the program, but no flash record confirms the load address and the content (D-62). The PC sent no program data.
    ProgramUpToDate,
    /// The memory of the board was erased, and no image is complete. The board stays in its exloader, and an update can program it again.
    Incomplete,
    /// The old program of the board may be lost, and the board has not reported its state since then.
    Unknown,
    /// The board reported that the program is written, but PC_INFO did not confirm Program ID and date. The answer to PC_INFO had other
    /// values or was missing, or the expected values are not known
    /// ([`UpdateReport::unverifiable`](crate::master::update::UpdateReport::unverifiable)).
    Written,
    /// The answer to PC_INFO contained the new Program ID and date (U-10).
    Verified,
    /// The application of the board is running. [`UpdateResult::verified`](crate::master::update::UpdateResult::verified) is `true` if the
    /// image is verified.
    Running,
}

impl UpdateOutcome {
    /// Returns the name of the outcome in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotStarted => "not-started",
            Self::Cancelled => "cancelled",
            Self::UpToDate => "up-to-date",
            Self::ProgramUpToDate => "program-up-to-date",
            Self::Incomplete => "incomplete",
            Self::Unknown => "unknown",
            Self::Written => "written",
            Self::Verified => "verified",
            Self::Running => "running",
        }
    }
}
