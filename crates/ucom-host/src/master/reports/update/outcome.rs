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
    /// The image was there already (U-3); nothing was sent.
    UpToDate,
    /// Something was erased and no image is complete: the board stays in its exloader and can be programmed again.
    Incomplete,
    /// The board may have lost what it had, and does not report it.
    Unknown,
    /// The board reports it as written, but PC_INFO did not confirm the new Program ID and date: it showed others, nothing,
    /// or nobody knows what to expect ([`UpdateReport::unverifiable`](crate::master::update::UpdateReport::unverifiable)).
    Written,
    /// PC_INFO shows the new Program ID and date (U-10).
    Verified,
    /// Written, and the application runs; verified unless [`UpdateReport::unverifiable`](crate::master::update::UpdateReport::unverifiable) gives the reason against it.
    Running,
}

impl UpdateOutcome {
    /// The name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotStarted => "not-started",
            Self::Cancelled => "cancelled",
            Self::UpToDate => "up-to-date",
            Self::Incomplete => "incomplete",
            Self::Unknown => "unknown",
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
