//! Outcome of the update of a board.
use serde::Serialize;

/// Outcome of the update of a board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateOutcome {
    /// Nothing was erased. The board is unchanged.
    #[default]
    NotStarted,
    /// The user cancelled the update before memory was erased. The board is unchanged.
    Cancelled,
    /// The board shows the program, and the flash record has the same image at the same address (U-3, D-62). No program data were sent.
    UpToDate,
    /// The board shows the program, but no flash record confirms its load address and content (D-62). No program data were sent.
    ProgramUpToDate,
    /// Memory was erased and no image is complete. The board stays in its exloader and can be programmed again.
    Incomplete,
    /// The old program of the board may be lost, and the board has not reported its state afterwards.
    Unknown,
    /// The board reported that the program is written, but PC_INFO did not confirm Program ID and date. PC_INFO showed other values, had no
    /// answer, or the expected values are not known ([`UpdateReport::unverifiable`](crate::master::update::UpdateReport::unverifiable)).
    Written,
    /// PC_INFO showed the new Program ID and date (U-10).
    Verified,
    /// The application is running. [`UpdateResult::verified`](crate::master::update::UpdateResult::verified) shows if the image is
    /// verified.
    Running,
}

impl UpdateOutcome {
    /// Returns the name in JSON.
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
