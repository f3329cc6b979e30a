//! Kinds of problems of a trajectory, ordered by their effect on an arm.

use serde::Serialize;

/// Maximum share of a joint's torque limit that may be needed to hold the arm, without friction. In practice, arms
/// that needed 98 % have fallen.
pub const HOLD_SHARE: f64 = 0.97;

/// Declares the kinds of problems. Each kind has a meaning, a name and a text. If the problem has a value, the kind also has a unit.
macro_rules! kinds {
    ($($(#[$meaning:meta])* $name:ident, $words:literal $(in $unit:literal)?;)+) => {
        /// Kind of a problem of a trajectory.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ProblemKind {
            $($(#[$meaning])* $name,)+
        }

        impl ProblemKind {
            /// All kinds of problems.
            pub const ALL: [Self; [$($words),+].len()] = [$(Self::$name),+];

            /// Returns a text that describes the kind. The text does not contain values or points.
            pub fn words(self) -> &'static str {
                match self {
                    $(Self::$name => $words,)+
                }
            }

            /// Returns the unit of the value and of the limit. The unit of a count is empty.
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
    /// The trajectory has more points than the controller can store.
    TooManyPoints, "too many points";
    /// The trajectory has more segments than allowed.
    TooManySegments, "too many segments";
    /// The number of points per segment is outside 1 to 1500.
    SegmentPoints, "points per segment";
    /// The step time is 0.
    StepTime, "step time of 0 ms";
    /// A position is outside the range of a serial frame.
    PositionScale, "position outside the range of a frame" in "rad";
    /// A velocity is outside the range of a serial frame.
    VelocityScale, "velocity outside the range of a frame" in "rad/s";
    /// An acceleration is outside the range of a serial frame.
    AccelerationScale, "acceleration outside the range of a frame" in "rad/s²";
    /// Two points are too far apart for the arm to move from one to the other in one step.
    Jump, "jump" in "rad";
    /// A position exceeds its limit.
    Position, "position over its limit" in "rad";
    /// A velocity exceeds its limit.
    Velocity, "velocity over its limit" in "rad/s";
    /// An acceleration exceeds its limit.
    Acceleration, "acceleration over its limit" in "rad/s²";
    /// The torque that is computed with the arm model exceeds its limit.
    Torque, "torque over its limit" in "N·m";
    /// While the arm is at rest, a joint needs nearly its whole torque limit to hold the arm, so the arm would fall after some time.
    HoldTorque, "too much torque needed at rest" in "N·m";
    /// A velocity is outside the friction table (J-36).
    FrictionVelocity, "velocity outside the friction table" in "rad/s";
    /// From this point of the path, Pause or Stop cannot bring the arm to rest in time with the available torque (J-33).
    NoStop, "no stop in time" in "N·m";
    /// The positions in the file change faster than the velocity limit allows, independent of the velocities in the file.
    PositionSpeed, "positions move faster than the velocity limit" in "rad/s";
    /// The speed at which the positions change differs from the velocities in the file. This problem is a warning if it occurs at few
    /// points.
    VelocityMismatch, "positions and velocities disagree" in "rad/s";
    /// The first or last point is not at rest.
    NotAtRest, "not at rest at an end" in "rad/s";
    /// The arm is not at the first point (J-34).
    StartPose, "the arm is not at the first point" in "rad";
    /// The rate at which the velocities in the file change differs from the accelerations in the file.
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

    /// Returns `true` if a problem of this kind makes the path impossible to execute, or ends the motion before an
    /// operator could stop the arm.
    pub(super) fn stops_at_once(self) -> bool {
        use ProblemKind::*;
        !matches!(
            self,
            NotAtRest | StartPose | VelocityMismatch | AccelerationMismatch | FrictionVelocity | HoldTorque
        )
    }
}
