//! Values of a file that the loader changed, filled in or left out.

use serde::Serialize;

/// Kind of a change that the loader made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Change {
    /// The loader chose the base frame.
    Base,
    /// The loader chose the flange frame.
    Flange,
    /// The axis of a joint was rotated to +z.
    AxisTurned,
    /// A fixed joint, or its body, was merged into the link to which it is attached.
    Merged,
    /// A joint that is not one of the six arm joints is fixed at position 0.
    LeftOut,
    /// A limit was narrowed to the range of the drives.
    LimitCut,
    /// A limit is missing or unusable, and another value is used.
    LimitAssumed,
    /// An arm file has no key for the number.
    NotCarried,
    /// A number of a robot description is used only as a starting value.
    Doubtful,
    /// Some numbers of the file are proposals of `jtc arm import`.
    Proposed,
    /// The loader chose between several files.
    Files,
}

impl Change {
    /// Returns a heading for changes of this kind.
    pub const fn heading(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Flange => "flange",
            Self::AxisTurned => {
                "turned: the frame of the link, so that its joint turns about +z; positions and torques do not change"
            }
            Self::Merged => "merged: links on fixed joints, into the link that carries them",
            Self::LeftOut => "left out: joints other than the six, held at 0",
            Self::LimitCut => "cut: limits beyond those of the drives",
            Self::LimitAssumed => "missing: limits that are absent or not usable",
            Self::NotCarried => "not imported",
            Self::Doubtful => "starting values only",
            Self::Proposed => "proposed",
            Self::Files => "files",
        }
    }
}

/// Item of a file that the loader ignored, changed or filled in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Kind of the change.
    pub change: Change,
    /// Name of the joint, link or key.
    pub place: String,
    /// Problem, and the change that the loader made.
    pub problem: String,
}

impl Warning {
    pub(super) fn new(change: Change, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { change, place: place.into(), problem: problem.into() }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.place, self.problem)
    }
}
