//! Why an update cannot be planned.
use host_kit::{Diagnose, Diagnosis, ErrorKind};
use ucom::profile::Plan;

/// Why an update cannot be planned.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// No board.
    #[error("no board is named")]
    NoTarget,
    /// A board twice.
    #[error("board {board} is named twice")]
    Twice {
        /// Its number.
        board: u8,
    },
    /// An image without bytes.
    #[error("the image is empty")]
    Empty,
    /// The plan needs a second image.
    #[error("plan `{plan}` needs a second image")]
    SecondMissing {
        /// `prog.plan`.
        plan: Plan,
    },
    /// The plan has no place for a second image.
    #[error("plan `{plan}` sends one image twice: there is no place for a second one")]
    SecondUnused {
        /// `prog.plan`.
        plan: Plan,
    },
    /// Another image than the one that the user named by its Program ID.
    #[error("the image has Program ID 0x{image:04X}, not 0x{expected:04X}")]
    OtherProgram {
        /// Of the image.
        image: u16,
        /// The one that was named.
        expected: u16,
    },
    /// Half a word.
    #[error("the image has {bytes} bytes: not whole words")]
    HalfWord {
        /// Its length.
        bytes: usize,
    },
    /// The number of a board that has no application.
    #[error("Program ID 0xFFFF with date 0xFFFF means `no application`: choose another date")]
    Void,
}

impl Diagnose for PlanError {
    fn diagnosis(&self) -> Diagnosis {
        match self {
            Self::NoTarget | Self::Twice { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "plan",
                "`ucom update N IMAGE` with a number, a list or `all`",
            ),
            Self::Empty | Self::HalfWord { .. } => Diagnosis::new(
                ErrorKind::Usage,
                "plan",
                "is it the right file? `ucom update --dry-run` shows what it holds",
            ),
            Self::SecondMissing { .. } | Self::SecondUnused { .. } => {
                Diagnosis::new(ErrorKind::Usage, "plan", "see `prog.plan` in `ucom help profile`")
            }
            Self::OtherProgram { .. } => Diagnosis::new(
                ErrorKind::Refused,
                "plan",
                "is it the right file? without `--expect-program-id` it is not compared",
            ),
            Self::Void => Diagnosis::new(ErrorKind::Usage, "plan", "`--date YYYY-MM-DD`"),
        }
    }
}
