//! Warnings about values of a file that the loader changed, filled in or ignored.

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
    /// A fixed joint was merged into another joint, or the body of a link was merged into another link.
    Merged,
    /// A joint that is not one of the six arm joints is fixed at position 0.
    LeftOut,
    /// A limit was narrowed to the range of the drives.
    LimitCut,
    /// A limit is missing or unusable, so another value is used.
    LimitAssumed,
    /// A value that no rule can propose is missing.
    Missing,
    /// A body is physically impossible by a small amount. The check of the arm file refuses it.
    Impossible,
    /// A number of the robot description is not imported.
    NotCarried,
    /// A value of the robot description is doubtful, so it is used only as a starting value.
    Doubtful,
    /// Some numbers of the file are proposals of `jtc arm import`.
    Proposed,
    /// The loader found several files or tables and did not use all of them.
    Files,
}

impl Change {
    /// Returns the heading of a list of changes of this kind.
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
            Self::Missing => {
                "missing: values that no rule can propose; a controller refuses this arm without them"
            }
            Self::Impossible => "impossible: inertias of no physical body; a controller refuses this arm",
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
    /// Kind of the change that the loader made.
    pub change: Change,
    /// Name of the joint, link or key to which the warning applies.
    pub place: String,
    /// Description of the problem and of the change that the loader made.
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
