//! Phases of the execution of a trajectory.
use crate::bit_codec::{BitCodec, BitSink, BitSource};
use crate::motion::ControlMode;
use crate::trajectory::path::PathClock;
use crate::{JOINTS, TrajectoryState};

/// Phase of the execution in state Operate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
    /// The controller waits until every joint is enabled. `elapsed_ms` is the elapsed waiting time, ms.
    Waiting { elapsed_ms: u32 },
    /// Approach from the held position to the first point or to the paused point, with the duration `length_ms`. The approach has its own
    /// clock. `leave` is the trajectory state that follows at standstill.
    Approaching { from: [f64; JOINTS], length_ms: f64, clock: PathClock, leave: Option<TrajectoryState> },
    /// Start of the path at point 0, which the next tick commands.
    AtStart,
    /// Motion along the path. `leave` is the trajectory state that follows at standstill.
    Running { leave: Option<TrajectoryState> },
}

impl BitCodec for Phase {
    fn write<S: BitSink>(&self, to: &mut S) {
        let kind = match self {
            Self::Waiting { .. } => 0,
            Self::Approaching { .. } => 1,
            Self::AtStart => 2,
            Self::Running { .. } => 3,
        };
        to.put(kind, 2);
        match self {
            Self::Waiting { elapsed_ms } => elapsed_ms.write(to),
            Self::Approaching { from, length_ms, clock, leave } => {
                from.write(to);
                length_ms.write(to);
                clock.write(to);
                leave.write(to);
            }
            Self::AtStart => {}
            Self::Running { leave } => leave.write(to),
        }
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        match from.take(2) {
            0 => Self::Waiting { elapsed_ms: BitCodec::read(from) },
            1 => {
                let start = BitCodec::read(from);
                let length_ms = BitCodec::read(from);
                let clock = BitCodec::read(from);
                Self::Approaching { from: start, length_ms, clock, leave: BitCodec::read(from) }
            }
            2 => Self::AtStart,
            _ => Self::Running { leave: BitCodec::read(from) },
        }
    }
}

impl Phase {
    /// First phase of an execution: waiting, with no elapsed time.
    pub(crate) const BEGIN: Self = Self::Waiting { elapsed_ms: 0 };

    /// Creates an approach from the held position that takes `length_ms`.
    pub(crate) fn approach(from: [f64; JOINTS], length_ms: f64) -> Self {
        Self::Approaching { from, length_ms, clock: PathClock::start(1.0), leave: None }
    }

    /// Returns the control mode of the phase.
    pub(crate) fn mode(&self) -> ControlMode {
        match self {
            Self::Waiting { .. } => ControlMode::Hold,
            Self::Approaching { .. } => ControlMode::Approach,
            Self::AtStart | Self::Running { .. } => ControlMode::Follow,
        }
    }

    /// Returns `true` while the controller waits until all joints are enabled.
    pub(crate) fn waits(&self) -> bool {
        matches!(self, Self::Waiting { .. })
    }

    /// Returns `true` if the arm is in motion, and no Pause or Stop has been accepted.
    pub(crate) fn goes_on(&self) -> bool {
        match self {
            Self::Approaching { clock, leave, .. } => leave.is_none() && clock.time > 0.0,
            Self::Running { leave } => leave.is_none(),
            Self::Waiting { .. } | Self::AtStart => false,
        }
    }

    /// Returns the rate of the clock that drives the motion, which is the clock of the approach or of the path.
    pub(crate) fn rate(&self, path: &PathClock) -> f64 {
        match self {
            Self::Approaching { clock, .. } => clock.rate,
            _ => path.rate,
        }
    }

    /// Returns the trajectory state that follows an accepted Pause or Stop.
    pub(crate) fn leave(&self) -> Option<TrajectoryState> {
        match self {
            Self::Approaching { leave, .. } | Self::Running { leave } => *leave,
            Self::Waiting { .. } | Self::AtStart => None,
        }
    }
}

#[cfg(test)]
mod tests;
