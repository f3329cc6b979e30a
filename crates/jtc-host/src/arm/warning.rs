//! What reading a file changed, filled in or left out.

use serde::Serialize;

/// What kind of change it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Change {
    /// Which frame is the base.
    Base,
    /// Which frame is the flange.
    Flange,
    /// A joint's axis is turned to +z.
    AxisTurned,
    /// A fixed joint, or the body behind one, is part of what carries it.
    Merged,
    /// A joint that is none of the six is held at 0.
    LeftOut,
    /// A limit is narrowed to what the drives can do.
    LimitCut,
    /// A limit is missing or of no use, and another is taken.
    LimitAssumed,
    /// A number that an arm file has no place for.
    NotCarried,
    /// A number of a robot description that is taken for a start only.
    Doubtful,
    /// Numbers of the file are proposals of `jtc arm import`.
    Proposed,
    /// Which of several files counts.
    Files,
}

impl Change {
    /// A heading for changes of this kind.
    pub const fn heading(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Flange => "flange",
            Self::AxisTurned => {
                "turned: the link's frame, so that its joint turns about +z; positions and torques are as they were"
            }
            Self::Merged => "merged: what fixed joints carry, into the link that carries them",
            Self::LeftOut => "left out: joints that are none of the six, held at 0",
            Self::LimitCut => "cut: limits that the drives cannot do",
            Self::LimitAssumed => "missing: limits that are not given, or are no limits",
            Self::NotCarried => "not carried",
            Self::Doubtful => "taken for a start",
            Self::Proposed => "proposed",
            Self::Files => "files",
        }
    }
}

/// Something in a file that could not be carried over, or was filled in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// What kind of change it is.
    pub change: Change,
    /// Joint, link or key.
    pub place: String,
    /// What is the matter and what was done.
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
