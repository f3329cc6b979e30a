//! The phases of an execution.
use crate::motion::ControlMode;
use crate::{JOINTS, TrajectoryState};

/// Where in Operate the controller is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
    /// Waits until every joint is enabled, and for how long it has, ms.
    Waiting { elapsed_ms: u32 },
    /// The approach: from where the arm is held to the first point, or to the one where the path was paused.
    Approaching { from: [f64; JOINTS], elapsed_ms: f64, leave: Option<TrajectoryState> },
    /// At point 0, which the next tick commands.
    AtStart,
    /// On the path; `leave`: the state that follows at standstill.
    Running { leave: Option<TrajectoryState> },
}

impl Phase {
    /// Nothing was waited for yet.
    pub const BEGIN: Self = Self::Waiting { elapsed_ms: 0 };

    /// The control mode.
    pub fn mode(&self) -> ControlMode {
        match self {
            Self::Waiting { .. } => ControlMode::Hold,
            Self::Approaching { .. } => ControlMode::Approach,
            Self::AtStart | Self::Running { .. } => ControlMode::Follow,
        }
    }

    /// The state that an accepted Pause or Stop leads to.
    pub fn leave(&self) -> Option<TrajectoryState> {
        match self {
            Self::Approaching { leave, .. } | Self::Running { leave } => *leave,
            Self::Waiting { .. } | Self::AtStart => None,
        }
    }
}
