//! Kinds of problems of a trajectory, ordered by their effect on an arm.

use serde::Serialize;

/// Maximum share of a joint's torque limit for holding the arm, without friction. At 98 % arms have fallen.
pub const HOLD_SHARE: f64 = 0.97;

/// Declares the kinds: meaning, name, words, and the unit of value and limit if they have one.
macro_rules! kinds {
    ($($(#[$meaning:meta])* $name:ident, $words:literal $(in $unit:literal)?;)+) => {
        /// Kind of a problem.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ProblemKind {
            $($(#[$meaning])* $name,)+
        }

        impl ProblemKind {
            /// All kinds.
            pub const ALL: [Self; [$($words),+].len()] = [$(Self::$name),+];

            /// Returns the kind as text, without the facts.
            pub fn words(self) -> &'static str {
                match self {
                    $(Self::$name => $words,)+
                }
            }

            /// Returns the unit of value and limit; empty for a count.
            pub(super) fn unit(self) -> &'static str {
                match self {
                    $(Self::$name => concat!($($unit)?),)+
                }
            }
        }
    };
}

kinds! {
    /// The trajectory has no points.
    Empty, "no points";
    /// More points than the controller holds.
    TooManyPoints, "too many points";
    /// More segments than a trajectory may have.
    TooManySegments, "too many segments";
    /// Points per segment outside 1..1500.
    SegmentPoints, "points per segment";
    /// The step time is 0.
    StepTime, "step time of 0 ms";
    /// A position does not fit into a frame.
    PositionScale, "position outside the range of a frame" in "rad";
    /// A velocity does not fit into a frame.
    VelocityScale, "velocity outside the range of a frame" in "rad/s";
    /// An acceleration does not fit into a frame.
    AccelerationScale, "acceleration outside the range of a frame" in "rad/s²";
    /// Two points are too far apart for the arm to move from one to the other in one step.
    Jump, "jump" in "rad";
    /// Position over its limit.
    Position, "position over its limit" in "rad";
    /// Velocity over its limit.
    Velocity, "velocity over its limit" in "rad/s";
    /// Acceleration over its limit.
    Acceleration, "acceleration over its limit" in "rad/s²";
    /// Torque of the arm model over its limit.
    Torque, "torque over its limit" in "N·m";
    /// Where the path stands still, holding the arm needs nearly all of a joint's torque, so the arm would fall later.
    HoldTorque, "too much torque needed at rest" in "N·m";
    /// A velocity is outside the friction table (J-36).
    FrictionVelocity, "velocity outside the friction table" in "rad/s";
    /// From this place Pause or Stop cannot bring the arm to rest in time with the available torque (J-33).
    NoStop, "no stop in time" in "N·m";
    /// The positions move faster than the velocity limit, independent of the velocities in the file.
    PositionSpeed, "positions move faster than the velocity limit" in "rad/s";
    /// The positions move at another speed than the velocities in the file. The problem is a warning if this happens at
    /// few places.
    VelocityMismatch, "positions and velocities disagree" in "rad/s";
    /// The first or last point is not at rest.
    NotAtRest, "not at rest at an end" in "rad/s";
    /// The arm is not at the first point (J-34).
    StartPose, "the arm is not at the first point" in "rad";
    /// Velocities change by other amounts than the accelerations in the file.
    AccelerationMismatch, "velocities and accelerations disagree" in "rad/s²";
}

impl ProblemKind {
    pub(super) fn scale(channel: &str) -> Self {
        match channel {
            "position" => ProblemKind::PositionScale,
            "velocity" => ProblemKind::VelocityScale,
            _ => ProblemKind::AccelerationScale,
        }
    }

    /// Returns `true` if the problem ends the motion before an operator could stop it, or if the path cannot run at all.
    pub(super) fn stops_at_once(self) -> bool {
        use ProblemKind::*;
        !matches!(
            self,
            NotAtRest | StartPose | VelocityMismatch | AccelerationMismatch | FrictionVelocity | HoldTorque
        )
    }
}
