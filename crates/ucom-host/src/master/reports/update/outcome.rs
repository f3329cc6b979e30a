//! How far the update of a board got.
use serde::Serialize;

/// How far a board got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpdateOutcome {
    /// Nothing was erased: the board has what it had.
    #[default]
    NotStarted,
    /// The user ended it before anything was erased: the board has what it had.
    Cancelled,
    /// The board shows the program, and the flash record has the same image at the same address (U-3, D-62); nothing was
    /// sent.
    UpToDate,
    /// The board shows the program, but no flash record covers load address and content (D-62); nothing was sent.
    ProgramUpToDate,
    /// Something was erased and no image is complete: the board stays in its exloader and can be programmed again.
    Incomplete,
    /// The board may have lost what it had, and does not report it.
    Unknown,
    /// The board reports it as written, but PC_INFO did not confirm the new Program ID and date: it showed others, nothing,
    /// or nobody knows what to expect ([`UpdateReport::unverifiable`](crate::master::update::UpdateReport::unverifiable)).
    Written,
    /// PC_INFO shows the new Program ID and date (U-10).
    Verified,
    /// The application runs. [`UpdateResult::verified`](crate::master::update::UpdateResult::verified) shows whether the image
    /// is proven.
    Running,
}

impl UpdateOutcome {
    /// The name in JSON.
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
