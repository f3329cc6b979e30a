//! Reasons why an update cannot be planned.
use host_kit::{Diagnose, Diagnosis, ErrorKind, next};
use ucom::profile::Plan;

/// Reasons why the selection of boards for an update is not clear.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TargetError {
    /// No board is selected.
    #[error("no board is selected")]
    None,
    /// A board is selected twice.
    #[error("board {board} is selected twice")]
    Twice {
        /// Board number.
        board: u8,
    },
}

impl Diagnose for TargetError {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "plan", next!("give a number, a list or `all`: {}", BoardUpdate))
    }
}

/// Reasons why an update cannot be planned.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The image is empty.
    #[error("the image is empty")]
    Empty,
    /// The image has an odd number of bytes, so its last word is incomplete.
    #[error("the image has {bytes} bytes, expected an even number")]
    HalfWord {
        /// Length of the image in bytes.
        bytes: usize,
    },
    /// The image has another Program ID than the user expects.
    #[error("the image has Program ID 0x{image:04X}, not 0x{expected:04X}")]
    OtherProgram {
        /// Program ID of the image.
        image: u16,
        /// Program ID that the user expects.
        expected: u16,
    },
    /// The Program ID and the date of the image have the values that mean "no application".
    #[error("Program ID 0xFFFF with date 0xFFFF means `no application`: choose another date")]
    Void,
    /// The plan and the second image do not match.
    #[error(transparent)]
    Second(#[from] SecondImageError),
}

impl Diagnose for PlanError {
    fn diagnosis(&self) -> Diagnosis {
        let (kind, next) = match self {
            Self::Empty | Self::HalfWord { .. } => (
                ErrorKind::Usage,
                "check that this is the right file: `ucom update --dry-run` shows its content",
            ),
            Self::OtherProgram { .. } => (
                ErrorKind::Refused,
                "check that this is the right file; without `--expect-program-id` the Program ID is not \
                 compared",
            ),
            Self::Void => (ErrorKind::Usage, "`--date YYYY-MM-DD`"),
            Self::Second(e) => return e.diagnosis(),
        };
        Diagnosis::new(kind, "plan", next)
    }
}

/// Reasons why `prog.plan` and a second image do not match.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SecondImageError {
    /// The plan needs a second image, but the user gave only one image.
    #[error("plan `{plan}` needs a second image")]
    Missing {
        /// Value of `prog.plan` in the profile.
        plan: Plan,
    },
    /// The user gave a second image, but the plan uses only one image.
    #[error("plan `{plan}` sends the first image twice and never sends a second one")]
    Unused {
        /// Value of `prog.plan` in the profile.
        plan: Plan,
    },
}

impl Diagnose for SecondImageError {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "plan", "see `prog.plan` in `ucom help profile`")
    }
}
